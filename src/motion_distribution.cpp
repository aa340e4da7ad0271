// SPDX-License-Identifier: BSD-2-Clause
#include "motion_distribution.hpp"

#include <cmath>
#include <memory>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/contact_polygon.hpp"
#include "nan.hpp"
#include "standard_gravity.hpp"

namespace dynacom::internal {

namespace {

// The mean of the heights that are known.
double findMeanHeight(const Eigen::Matrix3Xd& com) {
  const auto heights = com.row(2);
  if (areFinite(heights)) return heights.mean();
  const auto known = heights.array().isFinite();
  return known.select(heights.array(), 0.).sum() / double(known.count());
}

// √(g / mean height of the CoM above the ground), the natural frequency of the pendulum.
double computeOmega(const Eigen::Matrix3Xd& com, double gravity, double ground_height) {
  const double height = findMeanHeight(com) - ground_height;
  const double omega = std::sqrt(gravity / height);
  return omega > 0. && std::isfinite(omega) ? omega : kNaN;
}

SurfaceOptions findOptions(const ContactBase& contact) {
  if (const auto* point = dynamic_cast<const ContactPoint*>(&contact)) return point->getSettings();
  if (const auto* surface = dynamic_cast<const Contact6D*>(&contact)) return surface->getSettings();
  if (const auto* polygon = dynamic_cast<const ContactPolygon*>(&contact))
    return polygon->getSettings();
  return {};
}

// Makes room for all frames, in which nothing is written yet but what contacts are called, and when
// they are active.
void makeRoom(const Carrier& carrier, const ContactSchedule& schedule, MotionAnalysis& result) {
  const Eigen::Index frames = result.time.size();
  result.feasible_acom.resize(3, frames);
  result.feasible_dam.resize(3, frames);
  for (Eigen::Matrix2Xd* values : {&result.cop, &result.vrp, &result.nl, &result.dcm})
    values->resize(2, frames);
  result.status.resize(static_cast<std::size_t>(frames));
  result.residual.resize(6, frames);
  result.contacts.resize(carrier.contacts.size());
  for (std::size_t k = 0; k < carrier.contacts.size(); ++k) {
    MotionAnalysis::Contact& contact = result.contacts[k];
    contact.name = carrier.contacts[k].name;
    contact.friction = findOptions(*carrier.contacts[k].contact);
    contact.active.setConstant(frames, false);
    for (std::size_t row = 0; row < schedule.names.size(); ++row)
      if (schedule.names[row] == contact.name)
        contact.active = schedule.active.row(static_cast<Eigen::Index>(row)).transpose();
    contact.wrench.resize(6, frames);
    contact.cop.resize(2, frames);
    for (Eigen::VectorXd* values : {&contact.vertical_force, &contact.friction_usage,
                                    &contact.yaw_usage, &contact.cop_margin})
      values->resize(frames);
  }
}

// How readily contacts bear load, frames × contacts; nothing where the schedule says nothing.
Eigen::MatrixXd orderReadiness(const Carrier& carrier, const ContactSchedule& schedule) {
  if (schedule.readiness.size() == 0) return {};
  Eigen::MatrixXd readiness =
      Eigen::MatrixXd::Ones(schedule.readiness.cols(), Eigen::Index(carrier.contacts.size()));
  for (std::size_t row = 0; row < schedule.names.size(); ++row)
    for (std::size_t k = 0; k < carrier.contacts.size(); ++k)
      if (carrier.contacts[k].name == schedule.names[row])
        readiness.col(static_cast<Eigen::Index>(k)) =
            schedule.readiness.row(static_cast<Eigen::Index>(row)).transpose();
  return readiness;
}

}  // namespace

// One frame after the other.
struct MotionDistribution::Solver {
  explicit Solver(const Carrier& carrier) {
    distribution.setWrenchWeights(carrier.wrench_weights);
    distribution.setWarmStart(carrier.warm_start);
    distribution.setMaximalIterations(carrier.maximal_iterations);
    for (const FixedContact& fixed : carrier.contacts) {
      const auto contact = fixed.contact->clone();
      contact->setPose(pinocchio::SE3::Identity());
      distribution.reserve(*contact, loads.size());
      loads.push_back({contact, contact->getSurfacePose().inverse(), contact->reg_A(), 1.});
    }
  }

  // A contact as this thread uses it.
  struct Load {
    std::shared_ptr<ContactBase> contact;
    pinocchio::SE3 to_frame;  // from the surface
    Eigen::VectorXd weights;  // of forces, as the carrier has them
    double factor;            // by which the contact's are multiplied
  };

  WrenchDistribution distribution;
  std::vector<Load> loads;
};

// What a thread does with blocks of frames.
class MotionDistribution::Worker {
 public:
  Worker(const MotionDistribution& distribution, const std::vector<ContactMotion>& motions,
         const Eigen::MatrixXd& readiness, double ground_height, bool flat, MotionAnalysis& result)
      : distribution_(distribution),
        carrier_(distribution.carrier_),
        motions_(motions),
        readiness_(readiness),
        ground_height_(ground_height),
        flat_(flat),
        result_(result) {
    if (distribution.lane_carrier_)
      lanes_.emplace(*distribution.lane_carrier_, ground_height, flat);
  }

  void run(Eigen::Index first, Eigen::Index frames) {
    writeDefaults(first, frames);
    if (lanes_) lanes_->run(first, frames, motions_, readiness_, result_);
    is_cold_ = true;
    for (Eigen::Index k = 0; k < frames; ++k) {
      const Eigen::Index frame = first + k;
      const auto status = lanes_ ? lanes_->status(k) : std::nullopt;
      if (status)
        result_.status[static_cast<std::size_t>(frame)] = *status;
      else
        distribute(frame);
    }
    addPoints(first, frames);
  }

 private:
  using Load = Solver::Load;

  void writeDefaults(Eigen::Index first, Eigen::Index frames);
  void setWeights(Load& load, double factor) const;
  void addActive(Eigen::Index frame);
  void distribute(Eigen::Index frame);
  void write(Load& load, Eigen::Index frame, MotionAnalysis::Contact& result) const;
  Eigen::Vector2d findPressureCentre(Eigen::Index frame) const;
  void addPoints(Eigen::Index first, Eigen::Index frames);

  const MotionDistribution& distribution_;
  const Carrier& carrier_;
  const std::vector<ContactMotion>& motions_;
  const Eigen::MatrixXd& readiness_;  // frames × contacts, or nothing
  const double ground_height_;
  const bool flat_;
  MotionAnalysis& result_;
  std::optional<LaneDistributor> lanes_;
  // For what the lanes leave, as soon as there is any.
  std::shared_ptr<Solver> solver_;
  bool is_cold_ = true;           // whether it has done nothing in this block
  std::vector<bool> was_active_;  // in the last distribution of this block
};

// What holds where nothing is active, and a pressure and its points have no meaning.
void MotionDistribution::Worker::writeDefaults(Eigen::Index first, Eigen::Index frames) {
  result_.cop.middleCols(first, frames).setConstant(kNaN);
  for (MotionAnalysis::Contact& contact : result_.contacts) {
    contact.wrench.middleCols(first, frames).setZero();
    contact.vertical_force.segment(first, frames).setZero();
    contact.cop.middleCols(first, frames).setConstant(kNaN);
    for (Eigen::VectorXd* values :
         {&contact.friction_usage, &contact.yaw_usage, &contact.cop_margin})
      values->segment(first, frames).setConstant(kNaN);
  }
}

// Weights of the forces of a contact, by how readily it bears load.
void MotionDistribution::Worker::setWeights(Load& load, double factor) const {
  if (load.factor == factor) return;
  load.factor = factor;
  const Eigen::Vector3d force_weights = factor * load.weights.head<3>();
  if (auto* point = dynamic_cast<ContactPoint*>(load.contact.get())) {
    point->setForceWeights(force_weights);
  } else if (auto* surface = dynamic_cast<Contact6D*>(load.contact.get())) {
    surface->setForceWeights(force_weights);
    surface->setTorqueWeights(factor * load.weights.tail<3>());
  }
}

// Gives the distribution the contacts of a frame.
void MotionDistribution::Worker::addActive(Eigen::Index frame) {
  bool changed = false;
  for (std::size_t k = 0; k < solver_->loads.size(); ++k) {
    const bool is_active = result_.contacts[k].active[frame];
    changed = changed || is_active != was_active_[k];
    was_active_[k] = is_active;
  }
  if (changed) solver_->distribution.forgetForces();
  solver_->distribution.clear();
  for (std::size_t k = 0; k < solver_->loads.size(); ++k) {
    if (!was_active_[k]) continue;
    Load& load = solver_->loads[k];
    const pinocchio::SE3 surface(
        Eigen::Quaterniond(Eigen::Vector4d(motions_[k].rotation.col(frame))),
        motions_[k].position.col(frame));
    load.contact->updateNewtonEuler(result_.com.col(frame), surface * load.to_frame);
    setWeights(load,
               readiness_.size() > 0 ? 1. / std::sqrt(readiness_(frame, Eigen::Index(k))) : 1.);
    solver_->distribution.add(*load.contact, k);
  }
}

void MotionDistribution::Worker::distribute(Eigen::Index frame) {
  if (!solver_) solver_ = distribution_.solvers_.take();
  if (is_cold_) {
    solver_->distribution.forgetAnswers();
    was_active_.assign(solver_->loads.size(), false);
    is_cold_ = false;
  }
  addActive(frame);
  DynaCoM::Vector6 wrench;
  wrench << result_.ground_force.col(frame), result_.ground_torque.col(frame);
  solver_->distribution.solve(wrench, carrier_.mass * kStandardGravity);

  const DistributionResult& found = solver_->distribution.result();
  result_.status[static_cast<std::size_t>(frame)] = found.status;
  result_.residual.col(frame) = found.residual;
  result_.feasible_acom.col(frame) = found.achieved.head<3>() / carrier_.mass + carrier_.gravity;
  result_.feasible_dam.col(frame) = found.achieved.tail<3>();
  std::size_t added = 0;
  for (std::size_t k = 0; k < solver_->loads.size(); ++k) {
    if (!was_active_[k]) continue;
    solver_->loads[k].contact->applyForce(found.contacts[added++].force);
    write(solver_->loads[k], frame, result_.contacts[k]);
  }
  const Eigen::Vector3d com = result_.com.col(frame);
  result_.cop.col(frame) =
      flat_ ? computeFlatGroundCoP({wrench.head<3>(), wrench.tail<3>()}, com, ground_height_,
                                   carrier_.minimal_vertical_force)
            : findPressureCentre(frame);
}

// As DynaCoM::getContactCoP(), getContactFrictionUsage() and the others.
void MotionDistribution::Worker::write(Load& load, Eigen::Index frame,
                                       MotionAnalysis::Contact& result) const {
  const ContactBase& contact = *load.contact;
  const bool is_loaded = contact.appliedForce()[2] >= carrier_.minimal_vertical_force;
  const auto orNothing = [&](double usage) { return std::isnan(usage) || is_loaded ? usage : 0.; };
  result.wrench.col(frame).head(contact.cols()) = contact.appliedForce();
  result.vertical_force[frame] = contact.ne_A().row(2).dot(contact.appliedForce());
  if (is_loaded) {
    result.cop.col(frame) = contact.getCoP();
    result.cop_margin[frame] = contact.getCoPMargin();
  }
  result.friction_usage[frame] = orNothing(contact.getFrictionUsage());
  result.yaw_usage[frame] = orNothing(contact.getYawUsage());
}

// Equation (6), with each contact's own centre of pressure, as DynaCoM has it.
Eigen::Vector2d MotionDistribution::Worker::findPressureCentre(Eigen::Index frame) const {
  Eigen::Vector2d moment = Eigen::Vector2d::Zero();
  double vertical_force = 0.;
  for (std::size_t k = 0; k < solver_->loads.size(); ++k) {
    if (!was_active_[k]) continue;
    const ContactBase& contact = *solver_->loads[k].contact;
    const Eigen::Vector2d cop = contact.getCoP();
    if (!cop.allFinite()) continue;
    const double force = result_.contacts[k].vertical_force[frame];
    moment += force * contact.getSurfacePose().act(Eigen::Vector3d(cop.x(), cop.y(), 0.)).head<2>();
    vertical_force += force;
  }
  const Eigen::Vector2d centre = moment / vertical_force;
  if (!(vertical_force >= carrier_.minimal_vertical_force) || !centre.allFinite())
    return Eigen::Vector2d::Constant(kNaN);
  return centre;
}

// Virtual repellent point (7), non-linearity (8) and divergent component of motion (20) of the
// motion whose centre of pressure is reported, as DynaCoM::computeNL().
void MotionDistribution::Worker::addPoints(Eigen::Index first, Eigen::Index frames) {
  if (std::isnan(result_.omega)) {
    for (Eigen::Matrix2Xd* values : {&result_.vrp, &result_.nl, &result_.dcm})
      values->middleCols(first, frames).setConstant(kNaN);
    return;
  }
  const Eigen::Matrix3Xd& acceleration = flat_ ? result_.acom : result_.feasible_acom;
  CentroidalState state = {};
  for (Eigen::Index frame = first; frame < first + frames; ++frame) {
    state.com = result_.com.col(frame);
    state.vcom = result_.vcom.col(frame);
    state.acom = acceleration.col(frame);
    result_.vrp.col(frame) = computeVRP(state, result_.omega);
    result_.dcm.col(frame) = computeDCM(state, result_.omega);
    result_.nl.col(frame) = result_.cop.col(frame) - result_.vrp.col(frame);
  }
}

MotionDistribution::MotionDistribution(const Carrier& carrier, int lanes)
    : carrier_(carrier),
      lane_carrier_(LaneCarrier::make(carrier, lanes)),
      solvers_([&carrier] { return std::make_unique<Solver>(carrier); }) {}

MotionDistribution::~MotionDistribution() = default;

void MotionDistribution::run(const ContactSchedule& schedule,
                             const std::vector<ContactMotion>& contacts, double ground_height,
                             const AnalysisSettings& settings, Workers& workers,
                             MotionAnalysis& analysis,
                             const std::function<void(Eigen::Index)>& progress) const {
  makeRoom(carrier_, schedule, analysis);
  analysis.omega = settings.omega;
  if (analysis.omega == 0.)
    analysis.omega = computeOmega(analysis.com, -carrier_.gravity.z(), ground_height);
  const Eigen::MatrixXd readiness = orderReadiness(carrier_, schedule);
  forEachBlock(
      workers, analysis.time.size(),
      [&]() -> BlockWork {
        const auto worker = std::make_shared<Worker>(*this, contacts, readiness, ground_height,
                                                     settings.flat_horizontal_ground, analysis);
        return [worker](Eigen::Index first, Eigen::Index frames) { worker->run(first, frames); };
      },
      progress);
}

}  // namespace dynacom::internal
