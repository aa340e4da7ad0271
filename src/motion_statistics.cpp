// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_statistics.hpp"

#include <algorithm>
#include <cmath>

#include "check.hpp"
#include "motion_check.hpp"
#include "nan.hpp"
#include "standard_gravity.hpp"

namespace dynacom {

using internal::kNaN;

namespace {

// From which mean residual on it may be a load that nobody has told of, [m g] or [m g m], and as a
// part of the residual's root mean square, since a load does not change its sign: a box that a G1
// carries for half of a clip comes to 0.005 and a quarter, dances without a load to a twentieth.
constexpr double kLoad = 0.003, kLoadPart = 0.2;
// Nothing pulls along the ground by more than this all the time, and no load that is carried weighs
// more than this, or presses with more than this, [m g] and [m g m].
constexpr double kPull = 0.02, kLargestLoad = 0.3;

// Of the numbers that are not NaN; NaN if there are none.
double largestOf(const Eigen::VectorXd& numbers) {
  double largest = kNaN;
  for (const double number : numbers) largest = std::fmax(largest, number);
  return largest;
}

double rootMeanSquare(const Eigen::Ref<const Eigen::MatrixXd>& columns) {
  return std::sqrt(columns.squaredNorm() / double(columns.cols()));
}

ContactStatistics summarize(const MotionAnalysis::Contact& contact, double weight) {
  ContactStatistics statistics = {};
  const auto frames = double(contact.active.size());
  const auto active = double(contact.active.count());
  statistics.name = contact.name;
  statistics.active_share = active / frames;
  statistics.weight_share = contact.vertical_force.mean() / weight;
  // Where it is not active, it has no force.
  statistics.weight_share_while_active =
      active > 0. ? contact.vertical_force.sum() / (weight * active) : kNaN;
  statistics.largest_vertical_force = contact.vertical_force.maxCoeff() / weight;
  statistics.largest_friction_usage = largestOf(contact.friction_usage);
  statistics.largest_cone_usage = largestOf(computeConeUsage(contact));
  statistics.least_cop_margin = -largestOf(-contact.cop_margin);
  return statistics;
}

BodyStatistics summarize(const MotionAnalysis::Body& body, double weight) {
  const auto force = body.force.row(2);
  return {body.link, double(body.active.count()) / double(body.active.size()),
          force.mean() / weight, force.maxCoeff() / weight};
}

// What links do together that touch something besides the contacts.
void summarizeBodies(const std::vector<MotionAnalysis::Body>& bodies,
                     MotionStatistics& statistics) {
  Eigen::Array<bool, Eigen::Dynamic, 1> active =
      Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(statistics.frames, false);
  double force = 0.;  // where one is not active, it has none
  for (const MotionAnalysis::Body& body : bodies) {
    statistics.bodies.push_back(summarize(body, statistics.weight));
    active = active || body.active;
    force += body.force.row(2).sum();
  }
  const auto count = double(active.count());
  if (count == 0.) return;
  statistics.bodies_active_share = count / double(statistics.frames);
  statistics.bodies_weight_share_while_active = force / (statistics.weight * count);
}

// The residual in the heading's axes, averaged over the frames that have contacts and known
// accelerations.
MotionStatistics::Vector6 findMeanResidual(const pinocchio::Model& model, const Motion& motion,
                                           const MotionAnalysis& analysis,
                                           const MotionVerdict& verdict) {
  const bool has_heading = internal::hasFreeFlyer(model);
  MotionStatistics::Vector6 sum = MotionStatistics::Vector6::Zero();
  Eigen::Index frames = 0;
  for (Eigen::Index frame = 0; frame < motion.frames(); ++frame) {
    const bool flies =
        std::none_of(analysis.contacts.begin(), analysis.contacts.end(),
                     [&](const MotionAnalysis::Contact& contact) { return contact.active[frame]; });
    if (flies || verdict.unsure[frame]) continue;
    ++frames;
    MotionStatistics::Vector6 residual = analysis.residual.col(frame);
    if (has_heading) {
      const auto q = motion.q.col(frame).segment<4>(3);
      const Eigen::Rotation2Dd heading(
          std::atan2(2. * (q[3] * q[2] + q[0] * q[1]), 1. - 2. * (q[1] * q[1] + q[2] * q[2])));
      residual.head<2>() = heading.inverse() * residual.head<2>();
      residual.segment<2>(3) = heading.inverse() * residual.segment<2>(3);
    }
    sum += residual;
  }
  if (frames > 0) sum /= double(frames);
  return sum;
}

double correlate(const Eigen::VectorXd& one, const Eigen::VectorXd& other) {
  // Not by what is left of the mean: that rounds.
  if (one.minCoeff() == one.maxCoeff() || other.minCoeff() == other.maxCoeff()) return kNaN;
  const Eigen::VectorXd a = one.array() - one.mean(), b = other.array() - other.mean();
  return a.dot(b) / (a.norm() * b.norm());
}

}  // namespace

double MotionStatistics::share(DistributionStatus status) const {
  const auto found = statuses.find(status);
  return found == statuses.end() ? 0. : double(found->second) / double(frames);
}

bool MotionStatistics::mayBeLoad() const {
  const double force = mean_residual.head<3>().norm() / weight;
  const double torque = mean_residual.tail<3>().norm() / weight;
  const double pull = mean_residual.head<2>().norm() / weight;
  if (!(pull < kPull) || !(force < kLargestLoad) || !(torque < kLargestLoad)) return false;
  if (std::isnan(residual_force_rms) || std::isnan(residual_torque_rms)) return false;
  return force > std::max(kLoad, kLoadPart * residual_force_rms) ||
         torque > std::max(kLoad, kLoadPart * residual_torque_rms);
}

Eigen::VectorXd computeConeUsage(const MotionAnalysis::Contact& contact) {
  internal::requireSize("wrench", contact.wrench.cols(), contact.friction_usage.size(),
                        "frames (as friction_usage)");
  // Of a pyramid's usage, what the force's tangential part is longer than what that compares.
  Eigen::VectorXd usage = contact.friction_usage;
  for (Eigen::Index frame = 0; frame < usage.size(); ++frame) {
    const Eigen::Vector2d tangential = contact.wrench.col(frame).head<2>();
    const double compared = contact.friction.findTangential(tangential);
    if (compared > 0.) usage[frame] *= tangential.norm() / compared;
  }
  return usage;
}

MotionStatistics summarizeMotion(const DynaCoM& robot, const Motion& motion,
                                 const MotionAnalysis& analysis, const MotionVerdict& verdict) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by summarizeMotion before initialize()");
  const Eigen::Index frames = motion.frames();
  internal::requireSize("motion.q", motion.q.rows(), Eigen::Index(robot.getModel().nq),
                        "components (nq)");
  internal::requireSize("motion.q", motion.q.cols(), frames, "frames");
  for (const Eigen::Index size : {Eigen::Index(analysis.status.size()), analysis.residual.cols(),
                                  analysis.vcom.cols(), analysis.ground_force.cols()})
    internal::requireSize("analysis", size, frames, "frames");
  internal::requireSize("verdict", verdict.unsure.size(), frames, "frames");
  if (frames == 0) internal::throwInvalid("motion must have at least one frame, got 0");

  MotionStatistics statistics = {};
  statistics.frames = frames;
  statistics.mass = robot.getMass();
  statistics.weight = statistics.mass * internal::findUnitGravity(robot.getSettings().gravity);
  for (const DistributionStatus status : analysis.status) ++statistics.statuses[status];
  statistics.mean_vertical_force = analysis.ground_force.row(2).mean() / statistics.weight;
  if (frames > 1)
    statistics.momentum_change = robot.getMass() *
                                 (analysis.vcom(2, frames - 1) - analysis.vcom(2, 0)) /
                                 (statistics.weight * (motion.time[frames - 1] - motion.time[0]));
  statistics.residual_force_rms =
      rootMeanSquare(analysis.residual.topRows<3>()) / statistics.weight;
  statistics.residual_torque_rms =
      rootMeanSquare(analysis.residual.bottomRows<3>()) / statistics.weight;
  statistics.mean_residual = findMeanResidual(robot.getModel(), motion, analysis, verdict);
  for (const MotionAnalysis::Contact& contact : analysis.contacts)
    statistics.contacts.push_back(summarize(contact, statistics.weight));
  summarizeBodies(analysis.bodies, statistics);
  return statistics;
}

MeasuredDifference compareMeasured(const Eigen::MatrixXd& computed,
                                   const Eigen::MatrixXd& measured) {
  internal::requireSize("computed", computed.rows(), measured.rows(), "components (as measured)");
  internal::requireSize("computed", computed.cols(), measured.cols(), "frames (as measured)");
  Eigen::MatrixXd a(computed.rows(), computed.cols()), b = a;
  MeasuredDifference difference = {};
  for (Eigen::Index frame = 0; frame < measured.cols(); ++frame) {
    if (!internal::areFinite(measured.col(frame))) continue;
    a.col(difference.frames) = computed.col(frame);
    b.col(difference.frames++) = measured.col(frame);
  }
  a.conservativeResize(Eigen::NoChange, difference.frames);
  b.conservativeResize(Eigen::NoChange, difference.frames);
  difference.bias = difference.rms = difference.correlation =
      Eigen::VectorXd::Constant(computed.rows(), kNaN);
  if (difference.frames == 0) return difference;
  difference.bias = (a - b).rowwise().mean();
  difference.rms = ((a - b).array().square().rowwise().mean()).sqrt();
  for (Eigen::Index row = 0; row < a.rows(); ++row)
    difference.correlation[row] = correlate(a.row(row), b.row(row));
  return difference;
}

}  // namespace dynacom
