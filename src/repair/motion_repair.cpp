// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_repair.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <pinocchio/algorithm/joint-configuration.hpp>

#include "../check.hpp"
#include "../motion_check.hpp"
#include "../settings_fields.hpp"
#include "../standard_gravity.hpp"
#include "dynacom/contact_point.hpp"
#include "footwork.hpp"
#include "part_sets.hpp"
#include "whole_body_window.hpp"

namespace dynacom {

using Eigen::Index;

const std::vector<RepairSettings::Field>& RepairSettings::fields() {
  static const std::vector<Field> all = {
      {"displacement", &RepairSettings::displacement},
      {"turn", &RepairSettings::turn},
      {"linear_acceleration", &RepairSettings::linear_acceleration},
      {"angular_acceleration", &RepairSettings::angular_acceleration},
      {"friction_margin", &RepairSettings::friction_margin},
      {"support_margin", &RepairSettings::support_margin},
      {"held_point", &RepairSettings::held_point},
      {"largest_drift", &RepairSettings::largest_drift},
      {"slide_speed", &RepairSettings::slide_speed},
      {"largest_shift", &RepairSettings::largest_shift},
      {"clearance", &RepairSettings::clearance},
      {"joint_margin", &RepairSettings::joint_margin},
      {"speed_margin", &RepairSettings::speed_margin},
      {"window", &RepairSettings::window},
      {"overlap", &RepairSettings::overlap},
  };
  return all;
}

const std::vector<RepairSettings::Switch>& RepairSettings::switches() {
  static const std::vector<Switch> all = {
      {"feet", &RepairSettings::feet},
      {"joints", &RepairSettings::joints},
      {"pinned_ends", &RepairSettings::pinned_ends},
  };
  return all;
}

void RepairSettings::validate() const {
  internal::requirePositive("RepairSettings", *this, fields(),
                            {&RepairSettings::friction_margin, &RepairSettings::support_margin,
                             &RepairSettings::largest_drift, &RepairSettings::clearance,
                             &RepairSettings::joint_margin, &RepairSettings::speed_margin});
  for (const auto& [name, margin] :
       {std::pair("friction_margin", friction_margin), std::pair("speed_margin", speed_margin)})
    internal::requireField(margin < 1., internal::concat("RepairSettings.", name).c_str(), "< 1",
                           margin);
}

std::string RepairSettings::to_string() const { return internal::concat(*this); }

bool RepairSettings::operator==(const RepairSettings& other) const {
  const auto is_same = [&](const Switch& own) { return this->*own.second == other.*own.second; };
  return internal::areEqual(*this, other, fields()) &&
         std::all_of(switches().begin(), switches().end(), is_same);
}

std::ostream& operator<<(std::ostream& out, const RepairSettings& settings) {
  out << "RepairSettings(";
  internal::write(out, settings, RepairSettings::fields());
  for (const auto& [name, value] : RepairSettings::switches())
    out << ", " << name << "=" << (settings.*value ? "True" : "False");
  return out << ")";
}

namespace {

using internal::BodyPoint;
using internal::WholeBodyProblem;

// Wrenches that lack no more than this part of the weight are within reach.
constexpr double kReach = 1e-7;
// Parts that are no farther from where they are to be stay there [m].
constexpr double kPlace = 1e-3;
std::vector<BodyPoint> listPoints(const internal::ContactSplit& parts) {
  std::vector<BodyPoint> points;
  for (const internal::FixedContact& fixed : parts.carrier.contacts) {
    const auto& settings = dynamic_cast<const ContactPoint&>(*fixed.contact).getSettings();
    BodyPoint point = {fixed.joint, fixed.placement.translation()};
    if (settings.world_aligned)
      point.drop = settings.radius;
    else
      point.place -= settings.radius * fixed.placement.rotation().col(2);
    points.push_back(point);
  }
  return points;
}

// Costs of the squares of changes, or of their accelerations, in the tangent space.
Eigen::VectorXd listCosts(const pinocchio::Model& model, double linear, double angular) {
  const Eigen::Index nv = model.nv;
  const Eigen::VectorXd scale = internal::findSliding(model).select(
      Eigen::VectorXd::Constant(nv, linear), Eigen::VectorXd::Constant(nv, angular));
  return scale.array().square().inverse();
}

// What contacts cannot give, over the weight, and how far what carries is from its place.
double measure(const WholeBodyProblem& problem, const Eigen::MatrixXd& ground,
               const Eigen::MatrixXd& q, RepairedMotion& found) {
  internal::MotionLinearizer linearizer(problem.model, problem.points);
  internal::ConeProjection projection(1., internal::ConeProjection::kExact);
  internal::LinearizedFrame needed;
  found.residual.setZero(6, problem.time.size());
  found.held_largest = found.sunk_largest = 0.;
  double worst = 0.;
  for (Index frame = 0; frame < problem.time.size(); ++frame) {
    const std::uint32_t set = problem.sets[static_cast<std::size_t>(frame)];
    linearizer.evaluate(problem.time, q, frame, needed);
    for (std::size_t part = 0; part < problem.points.size(); ++part) {
      const auto place = needed.points.col(Index(part));
      if (set >> part & 1u)
        found.held_largest =
            std::max(found.held_largest, (place - problem.targets[part].col(frame)).norm());
      else if (ground.rows() > 0)  // std::max() leaves what is not known
        found.sunk_largest = std::max(found.sunk_largest, ground(Index(part), frame) - place.z());
    }
    if (problem.free[frame]) continue;
    if (!needed.wrench.allFinite())
      internal::throwInvalid("motion: what frame ", frame, " needs is too large for numbers");
    found.residual.col(frame) = findResidual(projection, needed, problem.friction, set);
    worst = std::max(worst, found.residual.col(frame).norm());
  }
  return worst;
}

// How far joints are beyond their limits.
void measureJoints(const WholeBodyProblem& problem, const Eigen::MatrixXd& q,
                   RepairedMotion& found) {
  found.joint_excess = found.speed_excess = 0.;
  for (const internal::LimitedJoint& joint : internal::listLimits(problem.model, 0., 0.))
    for (Index frame = 0; frame < problem.time.size(); ++frame)
      for (const internal::LimitKind kind : internal::kLimitKinds) {
        const double excess = measureExcess(joint, kind, problem.time, q, frame);
        if (excess <= 0.) continue;
        if (!isOfStep(kind))
          found.joint_excess = std::max(found.joint_excess, excess);
        else
          found.speed_excess =
              std::max(found.speed_excess,
                       excess / (joint.speed * (problem.time[frame + 1] - problem.time[frame])));
      }
}

// Changes begin with those that lead to `start`.
void repairInWindows(const WholeBodyProblem& problem, const RepairSettings& settings,
                     const Eigen::MatrixXd& start, bool is_mended, Eigen::MatrixXd& change,
                     Eigen::MatrixXd& q) {
  internal::WholeBodyWindow window(problem, settings);
  const Eigen::VectorXd& time = problem.time;
  for (Index frame = 0; frame < time.size(); ++frame)
    change.col(frame) =
        pinocchio::difference(problem.model, problem.q.col(frame), start.col(frame));
  q = start;
  const Eigen::MatrixXd at_start = change;
  const auto frameAt = [&](double moment) {
    return Index(std::lower_bound(time.data(), time.data() + time.size(), moment) - time.data());
  };
  // Each goes on where the one before it is still right: not at its end, behind which nothing has
  // changed yet, and where nothing is asked, so that it can lead there.
  constexpr double kLeading = 0.5;  // of the overlap
  for (Index first = 0; first < time.size();) {
    const double begin = time[first];
    const Index end = frameAt(begin + settings.window);
    Index behind = frameAt(begin + settings.window + settings.overlap);
    Index asked = frameAt(begin + settings.window + (1. - kLeading) * settings.overlap);
    if (time[time.size() - 1] - begin <= settings.window + 2. * settings.overlap ||
        time.size() - end < 4)
      behind = asked = time.size();
    if (is_mended)
      window.mend(first, behind, asked, change, q);
    else
      window.solve(first, behind, asked, change, q);
    if (behind == time.size()) return;
    change.middleCols(end, behind - end) = at_start.middleCols(end, behind - end);
    q.middleCols(end, behind - end) = start.middleCols(end, behind - end);
    first = std::max(end, first + 1);
  }
}

void summarize(const pinocchio::Model& model, RepairedMotion& found) {
  const auto root = found.change.topRows<3>().colwise().norm();
  found.root_rms = std::sqrt(root.squaredNorm() / double(found.change.cols()));
  found.root_largest = root.maxCoeff();
  const auto slides = internal::findSliding(model);
  double sum = 0.;
  Index joints = 0;
  for (Index row = 6; row < model.nv; ++row) {
    if (slides[row]) continue;
    ++joints;
    sum += found.change.row(row).squaredNorm() / double(found.change.cols());
    found.joint_largest =
        std::max(found.joint_largest, found.change.row(row).cwiseAbs().maxCoeff());
  }
  if (joints > 0) found.joint_rms = std::sqrt(sum / double(joints));
}

}  // namespace

RepairedMotion repairMotion(const PartRobot& parts, const Motion& motion,
                            const ContactSchedule& schedule, const RepairSettings& settings,
                            const Eigen::Array<bool, Eigen::Dynamic, 1>& free,
                            const RepairGround& ground, const Eigen::MatrixXd& start, bool anew) {
  settings.validate();
  const pinocchio::Model& model = parts.robot.getModel();
  const Index frames = motion.time.size();
  internal::requireTime(motion.time);
  internal::requireConfigurations(model, motion.q, frames);
  if (start.size() != 0) internal::requireConfigurations(model, start, frames);
  if (frames < 4) internal::throwInvalid("motion must have at least 4 frames, got ", frames);
  if (!internal::hasFreeFlyer(model))
    internal::throwInvalid("the root must be a free-flyer to be moved");
  if (free.size() != 0) internal::requireSize("free", free.size(), frames, "frames (or none)");
  if (ground.height.rows() != 0) {
    internal::requireSize("ground", ground.height.rows(), Index(parts.parts.size()), "parts");
    internal::requireSize("ground", ground.height.cols(), frames, "frames");
  }

  const internal::ContactSplit split = internal::describeSplit(parts);
  WholeBodyProblem problem = {
      model,
      listPoints(split),
      internal::listFriction(split),
      motion.time,
      motion.q,
      internal::listSets(parts.parts, schedule, frames),
      {},
      {},
      {},
      free,
      listCosts(model, settings.displacement, settings.turn),
      listCosts(model, settings.linear_acceleration, settings.angular_acceleration),
      {},
      settings.pinned_ends};
  if (settings.joints)
    problem.joints = internal::listLimits(model, settings.joint_margin, settings.speed_margin);
  if (free.size() == 0) problem.free.setConstant(frames, false);

  RepairedMotion found;
  found.change.setZero(model.nv, frames);
  found.stances = internal::Footwork(split, problem, settings, ground).place();
  Eigen::MatrixXd q = motion.q;
  double worst = measure(problem, settings.feet ? ground.height : Eigen::MatrixXd(), q, found);
  measureJoints(problem, q, found);
  const bool are_joints_wrong =
      settings.joints && std::max(found.joint_excess, found.speed_excess) > 0.;
  if (worst > kReach || std::max(found.held_largest, found.sunk_largest) > kPlace ||
      are_joints_wrong) {
    const bool is_new = start.size() == 0;
    repairInWindows(problem, settings, is_new ? motion.q : start, !is_new && !anew, found.change,
                    q);
    worst = measure(problem, settings.feet ? ground.height : Eigen::MatrixXd(), q, found);
    measureJoints(problem, q, found);
  } else {
    for (RepairedStance& stance : found.stances) stance.is_still = false;
  }
  found.within_reach = worst <= kReach;
  found.residual *= split.carrier.mass * internal::findUnitGravity(split.carrier.gravity);
  found.motion = differentiate(model, motion.time, q);
  summarize(model, found);
  return found;
}

}  // namespace dynacom
