// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_analysis.hpp"

#include <cmath>
#include <optional>

#include "check.hpp"
#include "contact_frame.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "lane_analysis.hpp"
#include "motion_check.hpp"
#include "motion_steps.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::Desks;
using internal::kNaN;
using internal::LaneAnalysis;
using internal::LaneRobot;
using internal::MotionCheck;

namespace {

// A frame's numbers are not those of a motion; Motion::validate() says what is wrong.
struct InvalidFrame {};

// √(g / mean height of the CoM above the ground), the natural frequency of the pendulum.
double computeOmega(const Eigen::Matrix3Xd& com, double gravity, double ground_height) {
  const double height = com.row(2).mean() - ground_height;
  const double omega = std::sqrt(gravity / height);
  return omega > 0. && std::isfinite(omega) ? omega : kNaN;
}

// Storage for all frames, in which nothing is written yet but what contacts are called, and when
// they are active.
MotionAnalysis makeStorage(const std::vector<std::string>& names, const Motion& motion,
                           const ContactSchedule& schedule) {
  const Eigen::Index frames = motion.frames();
  MotionAnalysis result;
  result.omega = kNaN;
  result.time = motion.time;
  for (Eigen::Matrix3Xd* values :
       {&result.com, &result.vcom, &result.acom, &result.am, &result.dam, &result.ground_force,
        &result.ground_torque, &result.feasible_acom, &result.feasible_dam})
    values->resize(3, frames);
  for (Eigen::Matrix2Xd* values : {&result.cop, &result.vrp, &result.nl, &result.dcm})
    values->resize(2, frames);
  result.status.resize(static_cast<std::size_t>(frames));
  result.residual.resize(6, frames);
  for (const std::string& name : names) {
    MotionAnalysis::Contact contact;
    contact.name = name;
    contact.active.setConstant(frames, false);
    for (std::size_t k = 0; k < schedule.names.size(); ++k)
      if (schedule.names[k] == name)
        contact.active = schedule.active.row(static_cast<Eigen::Index>(k)).transpose();
    contact.wrench.resize(6, frames);
    contact.cop.resize(2, frames);
    for (Eigen::VectorXd* values : {&contact.vertical_force, &contact.friction_usage,
                                    &contact.yaw_usage, &contact.cop_margin})
      values->resize(frames);
    result.contacts.push_back(std::move(contact));
  }
  return result;
}

// How readily the robot's contacts bear load, frames × contacts; nothing where the schedule says
// nothing.
Eigen::MatrixXd orderReadiness(const std::vector<std::string>& names, Eigen::Index frames,
                               const ContactSchedule& schedule) {
  if (schedule.readiness.size() == 0) return {};
  Eigen::MatrixXd readiness =
      Eigen::MatrixXd::Ones(frames, static_cast<Eigen::Index>(names.size()));
  for (std::size_t row = 0; row < schedule.names.size(); ++row)
    for (std::size_t k = 0; k < names.size(); ++k)
      if (names[k] == schedule.names[row])
        readiness.col(static_cast<Eigen::Index>(k)) =
            schedule.readiness.row(static_cast<Eigen::Index>(row)).transpose();
  return readiness;
}

// What a thread does with blocks of frames.
class Analyst {
 public:
  Analyst(Desks& desks, double ground_height, const Motion& motion, const ContactSchedule& schedule,
          const Eigen::MatrixXd& readiness, const AnalysisSettings& settings,
          MotionAnalysis& result)
      : desks_(desks),
        ground_height_(ground_height),
        motion_(motion),
        schedule_(schedule),
        readiness_(readiness),
        flat_(settings.flat_horizontal_ground),
        check_(desks.robot().getModel()),
        result_(result) {
    if (desks.laneRobot()) lanes_.emplace(*desks.laneRobot(), ground_height, flat_);
  }

  void analyze(Eigen::Index first, Eigen::Index frames) {
    writeDefaults(first, frames);
    is_cold_ = true;
    if (lanes_) lanes_->run(motion_, first, frames, readiness_, result_);
    for (Eigen::Index k = 0; k < frames; ++k) {
      const Eigen::Index frame = first + k;
      const auto outcome = lanes_ ? lanes_->outcome(k) : lanes::Outcome::Nothing;
      switch (outcome) {
        case lanes::Outcome::Everything:
          result_.status[static_cast<std::size_t>(frame)] = DistributionStatus::Solved;
          break;
        case lanes::Outcome::Dynamics:
          takeDynamics(k, frame);
          break;
        case lanes::Outcome::Nothing:
          computeDynamics(frame);
          break;
      }
    }
  }

 private:
  void writeDefaults(Eigen::Index first, Eigen::Index frames);
  DynaCoM& prepare(Eigen::Index frame);
  void setWeights(Eigen::Index frame);
  void takeDynamics(Eigen::Index k, Eigen::Index frame);
  void computeDynamics(Eigen::Index frame);
  void finish(Eigen::Index frame);

  Desks& desks_;
  const double ground_height_;
  const Motion& motion_;
  const ContactSchedule& schedule_;
  const Eigen::MatrixXd& readiness_;  // frames × contacts, or nothing
  const bool flat_;
  const MotionCheck check_;
  MotionAnalysis& result_;
  std::optional<LaneAnalysis> lanes_;
  // For what the lanes leave, as soon as there is any: a robot, and its contacts.
  std::shared_ptr<DynaCoM> worker_;
  std::vector<std::shared_ptr<ContactBase>> contacts_;
  std::vector<Eigen::VectorXd> weights_;  // of the contacts' forces, as the robot has them
  std::vector<double> factors_;           // by which the worker's are multiplied
  bool is_cold_ = true;                   // whether the worker has done nothing in this block
};

// What holds where nothing is active, and a pressure and its points have no meaning.
void Analyst::writeDefaults(Eigen::Index first, Eigen::Index frames) {
  for (Eigen::Matrix2Xd* values : {&result_.cop, &result_.vrp, &result_.nl, &result_.dcm})
    values->middleCols(first, frames).setConstant(kNaN);
  for (MotionAnalysis::Contact& contact : result_.contacts) {
    contact.wrench.middleCols(first, frames).setZero();
    contact.vertical_force.segment(first, frames).setZero();
    contact.cop.middleCols(first, frames).setConstant(kNaN);
    for (Eigen::VectorXd* values :
         {&contact.friction_usage, &contact.yaw_usage, &contact.cop_margin})
      values->segment(first, frames).setConstant(kNaN);
  }
}

// The robot with the contacts of a frame.
DynaCoM& Analyst::prepare(Eigen::Index frame) {
  if (!worker_) {
    worker_ = desks_.take();
    worker_->setGroundHeight(ground_height_);
    for (const MotionAnalysis::Contact& contact : result_.contacts) {
      contacts_.push_back(worker_->getContact(contact.name));
      weights_.push_back(desks_.robot().getContact(contact.name)->reg_A());
    }
    // Whoever had it before may have left it with other weights.
    factors_.assign(contacts_.size(), kNaN);
  }
  if (is_cold_) {
    Desks::clear(*worker_);
    is_cold_ = false;
  }
  for (std::size_t k = 0; k < schedule_.names.size(); ++k) {
    if (schedule_.active(static_cast<Eigen::Index>(k), frame))
      worker_->activateContact(schedule_.names[k]);
    else
      worker_->deactivateContact(schedule_.names[k]);
  }
  setWeights(frame);
  return *worker_;
}

// Weights of the forces of active contacts, by how readily they bear load.
void Analyst::setWeights(Eigen::Index frame) {
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    if (!result_.contacts[k].active[frame]) continue;
    const double factor = readiness_.size() > 0
                              ? 1. / std::sqrt(readiness_(frame, static_cast<Eigen::Index>(k)))
                              : 1.;
    if (factors_[k] == factor) continue;
    factors_[k] = factor;
    const Eigen::Vector3d force_weights = factor * weights_[k].head<3>();
    if (auto* point = dynamic_cast<ContactPoint*>(contacts_[k].get())) {
      point->setForceWeights(force_weights);
    } else if (auto* surface = dynamic_cast<Contact6D*>(contacts_[k].get())) {
      surface->setForceWeights(force_weights);
      surface->setTorqueWeights(factor * weights_[k].tail<3>());
    }
  }
}

// From the dynamics that lanes have computed.
void Analyst::takeDynamics(Eigen::Index k, Eigen::Index frame) {
  DynaCoM& worker = prepare(frame);
  const pinocchio::Model& model = worker.getModel();
  pinocchio::Data& data = worker.getData();
  data.mass[0] = worker.getMass();
  data.com[0] = result_.com.col(frame);
  data.vcom[0] = result_.vcom.col(frame);
  data.hg.linear() = data.mass[0] * data.vcom[0];
  data.hg.angular() = result_.am.col(frame);
  data.dhg.linear() = data.mass[0] * result_.acom.col(frame);
  data.dhg.angular() = result_.dam.col(frame);
  for (std::size_t i = 0; i < contacts_.size(); ++i) {
    if (!result_.contacts[i].active[frame]) continue;
    const pinocchio::Frame& contact_frame =
        internal::getFrame(model, *contacts_[i], result_.contacts[i].name);
    data.oMi[contact_frame.parentJoint] =
        lanes_->placement(i, k) * contact_frame.placement.inverse();
  }
  worker.computeDynamics(data, DynaCoM::Vector6::Zero(), flat_);
  finish(frame);
}

void Analyst::computeDynamics(Eigen::Index frame) {
  if (!check_.isValid(motion_, frame)) throw InvalidFrame();
  prepare(frame).computeDynamics(motion_.q.col(frame), motion_.v.col(frame), motion_.a.col(frame),
                                 DynaCoM::Vector6::Zero(), flat_);
  finish(frame);
}

// Distributes the wrench, and writes all that the worker knows.
void Analyst::finish(Eigen::Index frame) {
  DynaCoM& worker = *worker_;
  result_.com.col(frame) = worker.getCoM();
  result_.vcom.col(frame) = worker.getVCoM();
  result_.acom.col(frame) = worker.getACoM();
  result_.am.col(frame) = worker.getAM();
  result_.dam.col(frame) = worker.getAMVariation();
  result_.ground_force.col(frame) = worker.getGroundCoMForce();
  result_.ground_torque.col(frame) = worker.getGroundCoMTorque();
  result_.cop.col(frame) = worker.getCoP();

  // On uneven ground the centre of pressure needed the distribution already.
  if (flat_)
    worker.distributeForce(worker.getGroundCoMForce(), worker.getGroundCoMTorque(),
                           worker.getCoM());
  result_.status[static_cast<std::size_t>(frame)] = worker.getDistributionStatus();
  result_.residual.col(frame) = worker.getDistribution().residual;
  result_.feasible_acom.col(frame) = worker.getFeasibleACoM();
  result_.feasible_dam.col(frame) = worker.getFeasibleAMVariation();
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    MotionAnalysis::Contact& contact = result_.contacts[k];
    if (!contact.active[frame]) continue;
    contact.wrench.col(frame).head(contacts_[k]->cols()) = contacts_[k]->appliedForce();
    contact.vertical_force[frame] = contacts_[k]->toCoMForces().z();
    contact.cop.col(frame) = worker.getContactCoP(contact.name);
    contact.friction_usage[frame] = worker.getContactFrictionUsage(contact.name);
    contact.yaw_usage[frame] = worker.getContactYawUsage(contact.name);
    contact.cop_margin[frame] = worker.getContactCoPMargin(contact.name);
  }
}

// Virtual repellent point (7), non-linearity (8) and divergent component of motion (20) of the
// motion whose centre of pressure is reported, as DynaCoM::computeNL().
void addPoints(MotionAnalysis& result, bool flat_horizontal_ground, Eigen::Index first,
               Eigen::Index frames) {
  const Eigen::Matrix3Xd& acceleration =
      flat_horizontal_ground ? result.acom : result.feasible_acom;
  CentroidalState state;
  for (Eigen::Index frame = first; frame < first + frames; ++frame) {
    state.com = result.com.col(frame);
    state.vcom = result.vcom.col(frame);
    state.acom = acceleration.col(frame);
    result.vrp.col(frame) = computeVRP(state, result.omega);
    result.dcm.col(frame) = computeDCM(state, result.omega);
    result.nl.col(frame) = result.cop.col(frame) - result.vrp.col(frame);
  }
}

}  // namespace

void AnalysisSettings::validate() const {
  internal::requireField(omega >= 0. && std::isfinite(omega), "AnalysisSettings.omega",
                         "finite and >= 0 rad/s", omega);
  internal::requireField(threads >= 0, "AnalysisSettings.threads", ">= 0", threads);
  internal::requireField(lanes >= 1, "AnalysisSettings.lanes", ">= 1", lanes);
}

int countLanes(const DynaCoM& robot, int lanes) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by countLanes before initialize()");
  internal::requireField(lanes >= 1, "lanes", ">= 1", lanes);
  const auto lane_robot = LaneRobot::make(robot, lanes);
  return lane_robot ? lane_robot->lanes() : 1;
}

MotionAnalysis analyzeMotion(const DynaCoM& robot, const Motion& motion,
                             const ContactSchedule& schedule, const AnalysisSettings& settings) {
  settings.validate();
  Desks desks(robot, settings.lanes);
  internal::Workers workers(settings.threads);
  return internal::analyzeMotion(desks, robot.getGroundHeight(), motion, schedule, settings,
                                 workers);
}

MotionAnalysis internal::analyzeMotion(Desks& desks, double ground_height, const Motion& motion,
                                       const ContactSchedule& schedule,
                                       const AnalysisSettings& settings, Workers& workers) {
  const DynaCoM& robot = desks.robot();
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by analyzeMotion before initialize()");
  const MotionCheck check(robot.getModel());
  if (!check.hasSizes(motion)) motion.validate(robot.getModel());
  schedule.validate(motion.frames());

  for (const std::string& name : schedule.names) robot.getContact(name);
  const std::vector<std::string> names = robot.getKnownContacts();
  MotionAnalysis result = makeStorage(names, motion, schedule);
  const Eigen::MatrixXd readiness = orderReadiness(names, motion.frames(), schedule);
  const auto makeWork = [&]() -> BlockWork {
    const auto analyst = std::make_shared<Analyst>(desks, ground_height, motion, schedule,
                                                   readiness, settings, result);
    return [analyst](Eigen::Index first, Eigen::Index frames) { analyst->analyze(first, frames); };
  };
  try {
    forEachBlock(workers, motion.frames(), makeWork, settings.progress);
  } catch (const InvalidFrame&) {
    motion.validate(robot.getModel());
    throw;
  }
  result.omega = settings.omega;
  if (result.omega == 0.)
    result.omega = computeOmega(result.com, -robot.getSettings().gravity.z(), ground_height);
  if (std::isnan(result.omega)) return result;
  forEachBlock(workers, motion.frames(), [&]() -> BlockWork {
    return [&](Eigen::Index first, Eigen::Index frames) {
      addPoints(result, settings.flat_horizontal_ground, first, frames);
    };
  });
  return result;
}

}  // namespace dynacom
