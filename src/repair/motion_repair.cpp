// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_repair.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <ostream>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/algorithm/kinematics.hpp>

#include "../check.hpp"
#include "../motion_check.hpp"
#include "../settings_fields.hpp"
#include "../standard_gravity.hpp"
#include "dynacom/contact_point.hpp"
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
      {"window", &RepairSettings::window},
      {"overlap", &RepairSettings::overlap},
  };
  return all;
}

void RepairSettings::validate() const {
  internal::requirePositive("RepairSettings", *this, fields(),
                            {&RepairSettings::friction_margin, &RepairSettings::support_margin,
                             &RepairSettings::largest_drift});
  internal::requireField(friction_margin < 1., "RepairSettings.friction_margin", "< 1",
                         friction_margin);
}

std::string RepairSettings::to_string() const { return internal::concat(*this); }

bool RepairSettings::operator==(const RepairSettings& other) const {
  return internal::areEqual(*this, other, fields());
}

std::ostream& operator<<(std::ostream& out, const RepairSettings& settings) {
  out << "RepairSettings(";
  internal::write(out, settings, RepairSettings::fields());
  return out << ")";
}

namespace {

using internal::BodyPoint;
using internal::WholeBodyProblem;

// Wrenches that lack no more than this part of the weight are within reach.
constexpr double kReach = 1e-7;

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

// The mean of placements, without those in which fewer parts carry than in others.
pinocchio::SE3 average(const std::vector<pinocchio::SE3>& placements,
                       const std::vector<std::uint32_t>& carrying) {
  int most = 0;
  for (const std::uint32_t set : carrying) most = std::max(most, __builtin_popcount(set));
  Eigen::Vector3d place = Eigen::Vector3d::Zero();
  Eigen::Vector4d rotation = Eigen::Vector4d::Zero();
  double count = 0.;
  for (std::size_t k = 0; k < placements.size(); ++k) {
    if (__builtin_popcount(carrying[k]) < most) continue;
    const Eigen::Vector4d own = Eigen::Quaterniond(placements[k].rotation()).coeffs();
    rotation += own.dot(rotation) < 0. ? Eigen::Vector4d(-own) : own;
    place += placements[k].translation();
    ++count;
  }
  return {Eigen::Quaterniond(Eigen::Vector4d(rotation.normalized())), place / count};
}

// Where the parts of each contact are, and are to be, while they carry.
class Footwork {
 public:
  Footwork(const internal::ContactSplit& parts, WholeBodyProblem& problem, double largest_drift)
      : parts_(parts), problem_(problem), largest_drift_(largest_drift) {
    pinocchio::Data data(problem.model);
    const Index frames = problem.time.size();
    problem.targets.assign(problem.points.size(), Eigen::Matrix3Xd(3, frames));
    placements_.resize(problem.points.size());
    for (Index frame = 0; frame < frames; ++frame) {
      pinocchio::forwardKinematics(problem.model, data, problem.q.col(frame));
      for (std::size_t k = 0; k < problem.points.size(); ++k) {
        placements_[k].push_back(data.oMi[problem.points[k].joint]);
        problem.targets[k].col(frame) = locate(k, placements_[k].back());
      }
    }
  }

  std::vector<RepairedStance> find() {
    std::vector<RepairedStance> stances;
    const Index frames = problem_.time.size();
    for (std::size_t first_part = 0; first_part < parts_.parts.size();) {
      const std::size_t contact = parts_.parts[first_part].contact;
      std::uint32_t mask = 0;
      std::size_t part = first_part;
      for (; part < parts_.parts.size() && parts_.parts[part].contact == contact; ++part)
        mask |= std::uint32_t(1) << part;
      for (Index first = 0, behind = 0; first < frames; first = behind) {
        behind = first + 1;
        if ((setOf(first) & mask) == 0) continue;
        while (behind < frames && (setOf(behind) & mask) != 0) ++behind;
        stances.push_back(stand(contact, first_part, mask, first, behind));
      }
      first_part = part;
    }
    return stances;
  }

 private:
  std::uint32_t setOf(Index frame) const { return problem_.sets[static_cast<std::size_t>(frame)]; }

  Eigen::Vector3d locate(std::size_t part, const pinocchio::SE3& placement) const {
    Eigen::Vector3d place = placement.act(problem_.points[part].place);
    place.z() -= problem_.points[part].drop;
    return place;
  }

  RepairedStance stand(std::size_t contact, std::size_t first_part, std::uint32_t mask, Index first,
                       Index behind) {
    const auto& placements = placements_[first_part];
    std::vector<std::uint32_t> carrying;
    for (Index frame = first; frame < behind; ++frame) carrying.push_back(setOf(frame) & mask);
    const pinocchio::SE3 mean =
        average({placements.begin() + first, placements.begin() + behind}, carrying);
    RepairedStance stance = {contact, first, behind, 0., false};
    const auto forEachCarrying = [&](const auto& act) {
      for (Index frame = first; frame < behind; ++frame)
        for (std::uint32_t rest = setOf(frame) & mask; rest != 0; rest &= rest - 1)
          act(static_cast<std::size_t>(__builtin_ctz(rest)), frame);
    };
    forEachCarrying([&](std::size_t part, Index frame) {
      const Eigen::Vector3d off = problem_.targets[part].col(frame) - locate(part, mean);
      stance.drift = std::max(stance.drift, off.norm());
    });
    stance.is_still = stance.drift <= largest_drift_;
    if (stance.is_still)
      forEachCarrying([&](std::size_t part, Index frame) {
        problem_.targets[part].col(frame) = locate(part, mean);
      });
    return stance;
  }

  const internal::ContactSplit& parts_;
  WholeBodyProblem& problem_;
  const double largest_drift_;
  std::vector<std::vector<pinocchio::SE3>> placements_;  // of each part's joint, by frame
};

// What contacts cannot give, over the weight, and how far what carries is from its place.
double measure(const WholeBodyProblem& problem, const Eigen::MatrixXd& q, RepairedMotion& found) {
  internal::MotionLinearizer linearizer(problem.model, problem.points);
  internal::ConeProjection projection(1., internal::ConeProjection::kExact);
  internal::LinearizedFrame linear;
  found.residual.setZero(6, problem.time.size());
  found.held_largest = 0.;
  double worst = 0.;
  for (Index frame = 0; frame < problem.time.size(); ++frame) {
    const std::uint32_t set = problem.sets[static_cast<std::size_t>(frame)];
    linearizer.linearize(problem.time, q, frame, 0, linear);
    for (std::uint32_t rest = set; rest != 0; rest &= rest - 1) {
      const auto part = static_cast<std::size_t>(__builtin_ctz(rest));
      const Eigen::Vector3d off = linear.points.col(Index(part)) - problem.targets[part].col(frame);
      found.held_largest = std::max(found.held_largest, off.norm());
    }
    if (problem.free[frame]) continue;
    if (!linear.wrench.allFinite())
      internal::throwInvalid("motion: what frame ", frame, " needs is too large for numbers");
    found.residual.col(frame) = findResidual(projection, linear, problem.mu, set);
    worst = std::max(worst, found.residual.col(frame).norm());
  }
  return worst;
}

void repairInWindows(const WholeBodyProblem& problem, const RepairSettings& settings,
                     Eigen::MatrixXd& change, Eigen::MatrixXd& q) {
  internal::WholeBodyWindow window(problem, settings);
  const Eigen::VectorXd& time = problem.time;
  const auto frameAt = [&](double moment) {
    return Index(std::lower_bound(time.data(), time.data() + time.size(), moment) - time.data());
  };
  // Each goes on where the one before it is still right: not at its end, behind which it knew of no
  // change.
  for (Index first = 0; first < time.size();) {
    const Index end = frameAt(time[first] + settings.window);
    Index behind = frameAt(time[first] + settings.window + settings.overlap);
    if (time.size() - behind < 4) behind = time.size();
    window.solve(first, behind, change, q);
    if (behind == time.size()) return;
    change.middleCols(end, behind - end).setZero();
    q.middleCols(end, behind - end) = problem.q.middleCols(end, behind - end);
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
                            const Eigen::Array<bool, Eigen::Dynamic, 1>& free) {
  settings.validate();
  const pinocchio::Model& model = parts.robot.getModel();
  const Index frames = motion.time.size();
  internal::requireTime(motion.time);
  internal::requireConfigurations(model, motion.q, frames);
  if (frames < 4) internal::throwInvalid("motion must have at least 4 frames, got ", frames);
  if (!internal::hasFreeFlyer(model))
    internal::throwInvalid("the root must be a free-flyer to be moved");
  if (free.size() != 0) internal::requireSize("free", free.size(), frames, "frames (or none)");

  const internal::ContactSplit split = internal::describeSplit(parts);
  WholeBodyProblem problem = {
      model,
      {},
      internal::listFriction(split),
      motion.time,
      motion.q,
      internal::listSets(parts.parts, schedule, frames),
      {},
      free,
      listCosts(model, settings.displacement, settings.turn),
      listCosts(model, settings.linear_acceleration, settings.angular_acceleration)};
  problem.points = listPoints(split);
  if (free.size() == 0) problem.free.setConstant(frames, false);

  RepairedMotion found;
  found.change.setZero(model.nv, frames);
  found.stances = Footwork(split, problem, settings.largest_drift).find();
  Eigen::MatrixXd q = motion.q;
  double worst = measure(problem, q, found);
  if (worst > kReach) {
    repairInWindows(problem, settings, found.change, q);
    worst = measure(problem, q, found);
  } else {
    for (RepairedStance& stance : found.stances) stance.is_still = false;
    found.held_largest = 0.;
  }
  found.within_reach = worst <= kReach;
  found.residual *= split.carrier.mass * internal::findUnitGravity(split.carrier.gravity);
  found.motion = differentiate(model, motion.time, q);
  summarize(model, found);
  return found;
}

}  // namespace dynacom
