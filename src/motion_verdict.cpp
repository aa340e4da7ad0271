// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_verdict.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <ostream>
#include <pinocchio/algorithm/kinematics.hpp>

#include "check.hpp"
#include "configuration_steps.hpp"
#include "motion_steps.hpp"

namespace dynacom {

using internal::requireField;
using internal::throwInvalid;

namespace {

using Vector6 = DynaCoM::Vector6;

// What forces and moments are compared with, whatever gravity is [m/s²] and [m].
constexpr double kStandardGravity = 9.81;
constexpr double kLever = 1.;

constexpr FaultLimit VerdictSettings::*kLimits[kMotionFaults] = {
    &VerdictSettings::residual_force,
    &VerdictSettings::residual_torque,
    &VerdictSettings::flight_with_support_needed,
    &VerdictSettings::contact_missing,
    &VerdictSettings::ground_penetration,
    &VerdictSettings::foot_sliding,
    &VerdictSettings::discontinuity,
    &VerdictSettings::quaternion};

// A wrench by the robot's weight. What is not a number is more than anything.
struct WrenchSize {
  WrenchSize(const Vector6& wrench, double weight)
      : force(finite(wrench.head<3>().norm() / weight)),
        torque(finite(wrench.tail<3>().norm() / (weight * kLever))) {}

  double larger() const { return std::max(force, torque); }
  bool isWithin(const VerdictSettings& settings) const {
    return force <= settings.residual_force.limit && torque <= settings.residual_torque.limit;
  }

  double force, torque;

 private:
  static double finite(double size) {
    return std::isnan(size) ? std::numeric_limits<double>::infinity() : size;
  }
};

// How unlike the step to each frame is to those before and after it, and to their mean: the least
// of the three, so that what is only next to a jump is none. At the ends, where there is one side
// only, how unlike to what its two neighbours let expect.
Eigen::VectorXd measureJumps(const pinocchio::Model& model, const Eigen::MatrixXd& q) {
  const Eigen::Index frames = q.cols(), last = frames - 2;
  Eigen::VectorXd jumps = Eigen::VectorXd::Zero(frames);
  if (frames < 4) return jumps;
  const Eigen::MatrixXd steps = internal::ConfigurationSteps(model).compute(q);
  const auto distance = [&](Eigen::Index k, const auto& expected) {
    return (steps.col(k) - expected).template lpNorm<Eigen::Infinity>();
  };
  jumps[1] = distance(0, 2. * steps.col(1) - steps.col(2));
  jumps[frames - 1] = distance(last, 2. * steps.col(last - 1) - steps.col(last - 2));
  for (Eigen::Index k = 1; k < last; ++k)
    jumps[k + 1] = std::min({distance(k, steps.col(k - 1)), distance(k, steps.col(k + 1)),
                             distance(k, 0.5 * (steps.col(k - 1) + steps.col(k + 1)))});
  return jumps;
}

// Distributes with other contacts than the analysis did.
class SecondLook {
 public:
  SecondLook(internal::Desks& desks, const std::vector<std::string>& names)
      : robot_(desks.take()), names_(names) {}

  // Begins a block of frames, which does not depend on others.
  void begin() { internal::Desks::clear(*robot_); }

  // What is missing with these contacts.
  Vector6 findResidual(const Motion& motion, const MotionAnalysis& analysis, Eigen::Index frame,
                       const Eigen::Array<bool, Eigen::Dynamic, 1>& active) {
    pinocchio::forwardKinematics(robot_->getModel(), robot_->getData(), motion.q.col(frame));
    for (std::size_t k = 0; k < names_.size(); ++k) {
      if (active[static_cast<Eigen::Index>(k)])
        robot_->activateContact(names_[k]);
      else
        robot_->deactivateContact(names_[k]);
    }
    robot_->distributeForce(analysis.ground_force.col(frame), analysis.ground_torque.col(frame),
                            analysis.com.col(frame));
    return robot_->getDistribution().residual;
  }

 private:
  const std::shared_ptr<DynaCoM> robot_;
  const std::vector<std::string>& names_;  // in the order of results
};

MotionFinding sumUp(Eigen::VectorXd measured, const FaultLimit& limit,
                    const Eigen::VectorXd& time) {
  Eigen::Index frame = 0;
  const double worst = measured.maxCoeff(&frame);
  const Eigen::Index beyond = (measured.array() > limit.limit).count();
  const bool holds = double(beyond) > limit.allowed_share * double(time.size());
  return {std::move(measured), beyond, worst, time[frame], holds};
}

}  // namespace

const char* to_string(MotionFault fault) {
  switch (fault) {
    case MotionFault::ResidualForce:
      return "residual_force";
    case MotionFault::ResidualTorque:
      return "residual_torque";
    case MotionFault::FlightWithSupportNeeded:
      return "flight_with_support_needed";
    case MotionFault::ContactMissing:
      return "contact_missing";
    case MotionFault::GroundPenetration:
      return "ground_penetration";
    case MotionFault::FootSliding:
      return "foot_sliding";
    case MotionFault::Discontinuity:
      return "discontinuity";
    case MotionFault::Quaternion:
      return "quaternion";
  }
  return "unknown fault";
}

const FaultLimit& VerdictSettings::operator[](MotionFault fault) const {
  return this->*kLimits[static_cast<std::size_t>(fault)];
}

FaultLimit& VerdictSettings::operator[](MotionFault fault) {
  return this->*kLimits[static_cast<std::size_t>(fault)];
}

void VerdictSettings::validate() const {
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const FaultLimit& limit = this->*kLimits[k];
    const std::string field =
        std::string("VerdictSettings.") + dynacom::to_string(static_cast<MotionFault>(k));
    requireField(std::isfinite(limit.limit) && limit.limit >= 0., (field + ".limit").c_str(),
                 "finite and >= 0", limit.limit);
    requireField(limit.allowed_share >= 0. && limit.allowed_share <= 1.,
                 (field + ".allowed_share").c_str(), "from 0 to 1", limit.allowed_share);
  }
  requireField(std::isfinite(near_ground) && near_ground >= 0., "VerdictSettings.near_ground",
               "finite and >= 0 m", near_ground);
}

std::string VerdictSettings::to_string() const { return internal::concat(*this); }

bool VerdictSettings::operator==(const VerdictSettings& other) const {
  return near_ground == other.near_ground &&
         std::all_of(std::begin(kLimits), std::end(kLimits),
                     [&](auto limit) { return this->*limit == other.*limit; });
}

std::ostream& operator<<(std::ostream& out, const VerdictSettings& settings) {
  out << "VerdictSettings(";
  for (std::size_t k = 0; k < kMotionFaults; ++k) {
    const FaultLimit& limit = settings.*kLimits[k];
    out << to_string(static_cast<MotionFault>(k)) << "=(" << limit.limit << ", "
        << limit.allowed_share << "), ";
  }
  return out << "near_ground=" << settings.near_ground << ")";
}

const MotionFinding& MotionVerdict::operator[](MotionFault fault) const {
  return findings[static_cast<std::size_t>(fault)];
}

bool MotionVerdict::isFeasible() const {
  return std::none_of(findings.begin(), findings.end(),
                      [](const MotionFinding& finding) { return finding.holds; });
}

MotionVerdict judgeMotion(const DynaCoM& robot, const Motion& motion,
                          const RecordedMotion& recorded,
                          const std::vector<ContactMotion>& contacts, const Eigen::VectorXd& ground,
                          const MotionAnalysis& analysis, const VerdictSettings& settings,
                          int threads) {
  requireField(threads >= 0, "threads", ">= 0", threads);
  internal::Desks desks(robot);
  internal::Workers workers(threads);
  return internal::judgeMotion(desks, motion, recorded, contacts, ground, analysis, settings,
                               workers);
}

MotionVerdict internal::judgeMotion(Desks& desks, const Motion& motion,
                                    const RecordedMotion& recorded,
                                    const std::vector<ContactMotion>& contacts,
                                    const Eigen::VectorXd& ground, const MotionAnalysis& analysis,
                                    const VerdictSettings& settings, Workers& workers) {
  const DynaCoM& robot = desks.robot();
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by judgeMotion before initialize()");
  settings.validate();
  motion.validate(robot.getModel());
  const Eigen::Index frames = motion.frames();
  const auto count = static_cast<Eigen::Index>(contacts.size());
  internal::requireSize("recorded.q", recorded.q.cols(), frames, "frames");
  internal::requireSize("recorded.q", recorded.q.rows(), Eigen::Index(robot.getModel().nq),
                        "components (nq)");
  if (recorded.quaternion_error.size() != 0)
    internal::requireSize("recorded.quaternion_error", recorded.quaternion_error.size(), frames,
                          "frames");
  for (const Eigen::Matrix3Xd* values :
       {&analysis.ground_force, &analysis.ground_torque, &analysis.com})
    internal::requireSize("analysis", values->cols(), frames, "frames");
  internal::requireSize("analysis", analysis.residual.cols(), frames, "frames");
  internal::requireSize("ground", ground.size(), count, "heights (one per contact)");
  const std::vector<std::string> names = robot.getKnownContacts();
  internal::requireSize("contacts", contacts.size(), names.size(), "contacts of the robot");
  internal::requireSize("analysis.contacts", analysis.contacts.size(), names.size(),
                        "contacts of the robot");
  for (std::size_t k = 0; k < names.size(); ++k) {
    if (contacts[k].name != names[k] || analysis.contacts[k].name != names[k])
      throwInvalid("contacts must be those of the robot in its order: expected '", names[k],
                   "', got '", contacts[k].name, "' and '", analysis.contacts[k].name, "'");
    for (const Eigen::Index size : {contacts[k].height.size(), contacts[k].velocity.cols()})
      internal::requireSize("contacts", size, frames, "frames");
    internal::requireSize("analysis.contacts", analysis.contacts[k].active.size(), frames,
                          "frames");
  }

  const double weight = robot.getMass() * kStandardGravity;
  std::array<Eigen::VectorXd, kMotionFaults> measured;
  for (Eigen::VectorXd& values : measured) values.setZero(frames);
  const auto measure = [&](MotionFault fault) -> Eigen::VectorXd& {
    return measured[static_cast<std::size_t>(fault)];
  };
  const auto judgeFrame = [&](Eigen::Index frame, const auto& lookAgain) {
    Eigen::Array<bool, Eigen::Dynamic, 1> active(count), near(count);
    for (Eigen::Index k = 0; k < count; ++k) {
      const ContactMotion& contact = contacts[static_cast<std::size_t>(k)];
      const double height = contact.height[frame] - ground[k];
      active[k] = analysis.contacts[static_cast<std::size_t>(k)].active[frame];
      near[k] = active[k] || height <= settings.near_ground;
      double& depth = measure(MotionFault::GroundPenetration)[frame];
      depth = std::max(depth, -height);
      double& sliding = measure(MotionFault::FootSliding)[frame];
      if (active[k]) sliding = std::max(sliding, contact.velocity.col(frame).head<2>().norm());
    }

    const WrenchSize residual(analysis.residual.col(frame), weight);
    const bool flight = !active.any();
    const bool unsupported =
        flight && residual.larger() > settings.flight_with_support_needed.limit;
    const bool out_of_reach = flight ? unsupported : !residual.isWithin(settings);
    const bool contact_missing =
        out_of_reach && residual.larger() > settings.contact_missing.limit &&
        (near != active).any() && WrenchSize(lookAgain(frame, near), weight).isWithin(settings);
    if (contact_missing) {
      measure(MotionFault::ContactMissing)[frame] = residual.larger();
    } else if (flight) {
      measure(MotionFault::FlightWithSupportNeeded)[frame] = residual.larger();
    } else {
      measure(MotionFault::ResidualForce)[frame] = residual.force;
      measure(MotionFault::ResidualTorque)[frame] = residual.torque;
    }
  };
  forEachBlock(workers, frames, [&]() -> BlockWork {
    return [&, second_look = std::shared_ptr<SecondLook>()](Eigen::Index first,
                                                            Eigen::Index size) mutable {
      if (second_look) second_look->begin();
      const auto lookAgain = [&](Eigen::Index frame, const auto& active) {
        if (!second_look) {
          second_look = std::make_shared<SecondLook>(desks, names);
          second_look->begin();
        }
        return second_look->findResidual(motion, analysis, frame, active);
      };
      for (Eigen::Index frame = first; frame < first + size; ++frame) judgeFrame(frame, lookAgain);
    };
  });
  measure(MotionFault::Discontinuity) = measureJumps(robot.getModel(), recorded.q);
  if (recorded.quaternion_error.size() != 0)
    measure(MotionFault::Quaternion) = recorded.quaternion_error;

  MotionVerdict verdict;
  for (std::size_t k = 0; k < kMotionFaults; ++k)
    verdict.findings[k] =
        sumUp(std::move(measured[k]), settings[static_cast<MotionFault>(k)], motion.time);
  return verdict;
}

}  // namespace dynacom
