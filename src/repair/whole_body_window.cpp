// SPDX-License-Identifier: BSD-2-Clause
#include "whole_body_window.hpp"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <pinocchio/spatial.hpp>

#include "part_sets.hpp"

namespace dynacom::internal {

using Eigen::Index;

namespace {

// Of ADMM: the penalty for what cannot be given, squared, in a second, and how much more in flight,
// where there is nothing to choose; over-relaxation; and how often it linearises, and iterates
// then.
constexpr double kPenalty = 2000., kFlight = 300., kRelaxation = 1.6;
constexpr int kRounds = 2, kIterations = 12;
// The same where feet or joints have to be moved, which is farther.
constexpr int kFarRounds = 5, kFarIterations = 8;
// Then, costs count no more: the nearest motion within the cones, in which points and joints that
// are held stay as they are, with larger penalties.
constexpr double kPolish = 100., kPolishPlaces = 100.;
constexpr int kPolishes = 12, kPolishIterations = 8;
// What is missing after that is rounding [m g, m g·m]: with more, distributions are not Solved.
constexpr double kReached = 1e-10;
// The polish ends where so many rounds in a row leave more than this part of what was missing
// before: what remains has no solution nearby.
constexpr double kProgress = 0.7;
constexpr int kFailures = 2;
// No wrench depends on frames that are farther away.
constexpr Index kFarthest = 3;
// The polish changes frames that are no farther from one in which something is missing, in windows.
constexpr double kAround = 0.04;
// A window stays as it was where more would be missing than that and this, RMS [m g], [m g·m].
constexpr double kLost = 0.01;
// Moments count as forces with this lever [m].
constexpr double kLever = 1.;
// A joint that is so far from the limit that it is held at costs 1 in a second [rad], [m].
constexpr double kPinned = 1e-4;
// By how much more it costs to change the root's velocity at the ends of the motion than
// accelerations elsewhere: what was before and comes after knows of no change. Joints may have to,
// where feet that slid stand still.
constexpr double kRest = 1e3;
// By how much more it costs to move points from their places near these ends. Much more, and where
// places cannot be kept, joints go far for little.
constexpr double kRestOfPlaces = 100.;

// By how much more an end that is pinned costs than other frames.
constexpr double kAnchor = 1e10;

template <class Function>
void forEachPoint(std::uint32_t set, Function act) {
  for (; set != 0; set &= set - 1) act(Index(__builtin_ctz(set)));
}

}  // namespace

Eigen::Matrix<double, 6, 1> findResidual(ConeProjection& projection, const LinearizedFrame& linear,
                                         const std::vector<Section>& friction, std::uint32_t set) {
  projection.project(linear.wrench, linear.points.colwise() - linear.com, friction, set);
  return projection.residual();
}

WholeBodyWindow::WholeBodyWindow(const WholeBodyProblem& problem, const RepairSettings& settings)
    : problem_(problem),
      settings_(settings),
      linearizer_(problem.model, problem.points),
      projection_(kLever, ConeProjection::kExact),
      of_place_(1. / (settings.held_point * settings.held_point)),
      shrunk_(scale(problem.friction, 1. - settings.friction_margin)) {}

void WholeBodyWindow::solve(Index first, Index behind, Index asked, Eigen::MatrixXd& change,
                            Eigen::MatrixXd& q) {
  const Eigen::MatrixXd start_change = change.middleCols(first, behind - first),
                        start_q = q.middleCols(first, behind - first);
  const double before = measureLack(q, first, std::min(behind, asked));
  begin(first, behind, asked);
  const bool is_far = !problem_.joints.empty() || problem_.floor.rows() > 0;
  const int rounds = is_far ? kFarRounds : kRounds;
  const int iterations = is_far ? kFarIterations : kIterations;
  for (int round = 0; round < rounds; ++round) {
    linearize(q);
    if (round == 0) restart();
    if (!factorize(kPenalty, 1.)) break;
    for (int k = 0; k < iterations; ++k) {
      iterate(true, change);
      project(true);
    }
    apply(change, q);
  }
  mend(first, behind, asked, change, q);
  // Where there is no solution nearby, steps may lead away from all.
  const double allowed = before + kLost * kLost * double(behind - first);
  if (measureLack(q, first, std::min(behind, asked)) <= allowed) return;
  change.middleCols(first, behind - first) = start_change;
  q.middleCols(first, behind - first) = start_q;
}

// The sum of the squares of what is missing.
double WholeBodyWindow::measureLack(const Eigen::MatrixXd& q, Index first, Index behind) {
  double lack = 0.;
  for (Index frame = first; frame < behind; ++frame) {
    const double missing = findMissingWrench(q, frame);
    lack += missing * missing;
  }
  return std::isnan(lack) ? std::numeric_limits<double>::infinity() : lack;
}

void WholeBodyWindow::mend(Index first, Index behind, Index asked, Eigen::MatrixXd& change,
                           Eigen::MatrixXd& q) {
  const Eigen::VectorXd& time = problem_.time;
  const Index last = std::min(asked, behind) - 1;
  const double around = kAround * settings_.window;
  Index begun = -1, ended = -1;  // of a span of frames, with what is around them
  const auto close = [&] {
    if (begun < 0) return;
    begin(begun, ended + 1, ended + 1 < behind ? ended + 1 + kFarthest : asked);
    polish(change, q);
    begun = -1;
  };
  for (Index frame = std::max<Index>(first - 1, 0); frame <= last; ++frame) {
    if (begun >= 0 && frame > ended) close();
    if (findMissing(q, frame) <= kReached) continue;
    const auto before = std::lower_bound(time.data(), time.data() + frame, time[frame] - around);
    const auto after =
        std::upper_bound(time.data() + frame, time.data() + last + 1, time[frame] + around);
    if (begun < 0) begun = std::max(first, Index(before - time.data()));
    ended = Index(after - time.data()) - 1;
    if (last - ended < kFarthest) ended = behind - 1;
  }
  close();
}

double WholeBodyWindow::findMissing(const Eigen::MatrixXd& q, Index frame) {
  for (const LimitedJoint& joint : problem_.joints)
    for (const LimitKind kind : kLimitKinds)
      if (const double off = measureOwnExcess(joint, kind, problem_.time, q, frame); off > kReached)
        return off;
  return findMissingWrench(q, frame);
}

double WholeBodyWindow::findMissingWrench(const Eigen::MatrixXd& q, Index frame) {
  if (problem_.free[frame]) return 0.;
  linearizer_.evaluate(problem_.time, q, frame, evaluated_);
  const std::uint32_t set = problem_.sets[static_cast<std::size_t>(frame)];
  return findResidual(projection_, evaluated_, problem_.friction, set).norm();
}

void WholeBodyWindow::polish(Eigen::MatrixXd& change, Eigen::MatrixXd& q) {
  Eigen::MatrixXd best_change, best_q;
  double best = std::numeric_limits<double>::infinity();
  for (int round = 0, failed = 0; round <= kPolishes; ++round) {
    const double missing = linearize(q);
    failed = missing > kProgress * best ? failed + 1 : 0;
    if (missing < best) {
      best = missing;
      best_change = change.middleCols(first_, behind_ - first_);
      best_q = q.middleCols(first_, behind_ - first_);
    }
    if (best <= kReached || failed == kFailures || round == kPolishes) break;
    restart();
    stay();
    if (!factorize(kPenalty * kPolish, kPolishPlaces)) break;
    for (int k = 0; k < kPolishIterations; ++k) {
      iterate(false, change);
      project(false);
    }
    apply(change, q);
  }
  change.middleCols(first_, behind_ - first_) = best_change;
  q.middleCols(first_, behind_ - first_) = best_q;
}

// Lets points that are held be so where they are, and joints that are within their own limits.
void WholeBodyWindow::stay() {
  for (Constraint& constraint : constraints_) constraint.off.setZero();
  for (Pin& pin : pins_)
    if (!(pin.own > 0.)) pin.off = 0.;
}

// The frames whose wrench depends on what is sought, and of which something is asked.
void WholeBodyWindow::begin(Index first, Index behind, Index asked) {
  first_ = first;
  behind_ = behind;
  constraints_.clear();
  const Index frames = problem_.time.size();
  for (Index frame = std::max<Index>(first - kFarthest, 0);
       frame < std::min({behind + kFarthest, frames, asked}); ++frame) {
    const auto [low, high] = MotionLinearizer::findReach(frame, frames);
    if (high < first || low >= behind) continue;
    Constraint& constraint = constraints_.emplace_back();
    constraint.frame = frame;
    constraint.dual.setZero();
  }
}

// A path that stays at its first and last place before and behind the motion.
WholeBodyWindow::Difference WholeBodyWindow::differ(Index frame) const {
  const Index last = problem_.time.size() - 1;
  const auto stepFrom = [&](Index k) { return problem_.time[k + 1] - problem_.time[k]; };
  const double before = stepFrom(std::max<Index>(frame - 1, 0));
  const double after = stepFrom(std::min(frame, last - 1));
  const double duration = 0.5 * (before + after);
  const double to_before = frame > 0 ? 1. / (before * duration) : 0.;
  const double to_after = frame < last ? 1. / (after * duration) : 0.;
  return {to_before, -to_before - to_after, to_after, duration};
}

// Says how much is missing at the most.
double WholeBodyWindow::linearize(const Eigen::MatrixXd& q) {
  double worst = 0.;
  for (Constraint& constraint : constraints_) {
    const Index frame = constraint.frame;
    const std::uint32_t set = problem_.sets[static_cast<std::size_t>(frame)];
    LinearizedFrame& linear = constraint.linear;
    linearizer_.linearize(problem_.time, q, frame,
                          set | problem_.held[static_cast<std::size_t>(frame)], linear);
    place(constraint);
    constraint.moved = linear.wrench;
    if (!problem_.free[frame]) {
      projection_.setAnswer(constraint.answer);
      worst = std::max(worst, findResidual(projection_, linear, problem_.friction, set).norm());
    }
    shrink(constraint);
  }
  return std::max(worst, pin(q));
}

// Says how far points are from where they are to be.
void WholeBodyWindow::place(Constraint& constraint) {
  constraint.off.resize(0);
  constraint.of_places.resize(0, problem_.model.nv);
  if (!isSought(constraint.frame)) return;
  const std::uint32_t held = problem_.held[static_cast<std::size_t>(constraint.frame)];
  const auto& bodies = linearizer_.bodies();
  for (std::size_t body = 0; body < bodies.size(); ++body)
    if (const std::uint32_t points = bodies[body].points & held; points != 0)
      hold(constraint, body, points);
  lift(constraint);
}

// Asks for the places of points of a body. Since it is rigid, the squares of how far its n points
// are off are n times that of their centre, and those of three turns about axes in which their
// second moments are diagonal, but for what no displacement of the body changes.
void WholeBodyWindow::hold(Constraint& constraint, std::size_t body, std::uint32_t points) {
  constexpr double kLeastMoment = 1e-12;  // [m²]
  const LinearizedFrame& linear = constraint.linear;
  const auto& jacobian = linear.of_bodies[body];
  const auto findOff = [&](Index point) -> Eigen::Vector3d {
    return linear.points.col(point) -
           problem_.targets[static_cast<std::size_t>(point)].col(constraint.frame);
  };
  const double root = std::sqrt(double(__builtin_popcount(points)));
  Eigen::Vector3d centre = Eigen::Vector3d::Zero(), off = Eigen::Vector3d::Zero();
  forEachPoint(points, [&](Index point) {
    centre += linear.arms.col(point) / (root * root);
    off += findOff(point) / root;
  });
  Eigen::Matrix3d moments = Eigen::Matrix3d::Zero();
  Eigen::Vector3d turned = Eigen::Vector3d::Zero();
  forEachPoint(points, [&](Index point) {
    const Eigen::Vector3d arm = linear.arms.col(point) - centre;
    moments += arm.squaredNorm() * Eigen::Matrix3d::Identity() - arm * arm.transpose();
    turned += arm.cross(findOff(point));
  });
  const Index first = constraint.off.size();
  constraint.off.conservativeResize(first + 6);
  constraint.of_places.conservativeResize(first + 6, Eigen::NoChange);
  constraint.off.segment<3>(first) = off;
  constraint.of_places.middleRows<3>(first) =
      root * (jacobian.topRows<3>() - pinocchio::skew(centre) * jacobian.bottomRows<3>());
  Index rows = first + 3;
  Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> axes;
  axes.computeDirect(moments);
  for (int k = 0; k < 3; ++k) {
    if (!(axes.eigenvalues()[k] > kLeastMoment)) continue;
    const double arm = std::sqrt(axes.eigenvalues()[k]);
    const Eigen::Vector3d axis = axes.eigenvectors().col(k);
    constraint.off[rows] = axis.dot(turned) / arm;
    constraint.of_places.row(rows++).noalias() = arm * axis.transpose() * jacobian.bottomRows<3>();
  }
  constraint.off.conservativeResize(rows);
  constraint.of_places.conservativeResize(rows, Eigen::NoChange);
}

// Asks for the heights of points in the air that are below their floor. Costs leave those that
// they lift a little below, and what is above needs none.
void WholeBodyWindow::lift(Constraint& constraint) {
  const Index frame = constraint.frame;
  const std::uint32_t held = problem_.held[static_cast<std::size_t>(frame)];
  for (Index point = 0; point < problem_.floor.rows(); ++point) {
    const double height = constraint.linear.points(2, point) - problem_.floor(point, frame);
    if (held >> point & 1u || !(height < 0.)) continue;
    linearizer_.linearizePoints(std::uint32_t(1) << point, constraint.linear);
    const Index row = constraint.off.size();
    constraint.off.conservativeResize(row + 1);
    constraint.of_places.conservativeResize(row + 1, Eigen::NoChange);
    constraint.off[row] = height;
    constraint.of_places.row(row) = linearizer_.findPointJacobian(constraint.linear, point).row(2);
  }
}

// Finds joints that are beyond a limit, and says how far they are beyond their own at most. Of
// those within, none needs to be held.
double WholeBodyWindow::pin(const Eigen::MatrixXd& q) {
  pins_.clear();
  double largest = 0.;
  for (const LimitedJoint& joint : problem_.joints)
    for (Index frame = std::max<Index>(first_ - 1, 0); frame < behind_; ++frame)
      for (const LimitKind kind : kLimitKinds) {
        // A step leads here from the frame before.
        if (!isOfStep(kind) && !isSought(frame)) continue;
        const double off = measureExcess(joint, kind, problem_.time, q, frame);
        if (!(off > 0.)) continue;
        const double own = measureOwnExcess(joint, kind, problem_.time, q, frame);
        pins_.push_back({frame, &joint, kind, off, own});
        largest = std::max(largest, own);
      }
  return largest;
}

// Makes the cones smaller by the margins, and adds to the derivative of the moment that of the
// levers at which the forces push that are there.
void WholeBodyWindow::shrink(Constraint& constraint) {
  LinearizedFrame& linear = constraint.linear;
  const std::uint32_t set = problem_.sets[static_cast<std::size_t>(constraint.frame)];
  if (set == 0) return;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  forEachPoint(set, [&](Index point) {
    centre += linear.points.col(point) / double(__builtin_popcount(set));
  });
  forEachPoint(set, [&](Index point) {
    const Eigen::Vector3d inward = centre - linear.points.col(point);
    const double size = inward.head<2>().norm();
    if (size > 0.)
      linear.points.col(point) += std::min(settings_.support_margin / size, 1.) * inward;
  });
  projection_.setAnswer(constraint.answer);
  findResidual(projection_, linear, shrunk_, set);
  constraint.answer = projection_.answer();
  auto of_moment = linear.own(constraint.frame).derivative.bottomRows<3>();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  const auto& bodies = linearizer_.bodies();
  for (std::size_t body = 0; body < bodies.size(); ++body) {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    Eigen::Matrix3d by_turn = Eigen::Matrix3d::Zero();  // f × (ω × r) = ((f · r) 1 - r fᵀ) ω
    forEachPoint(set & bodies[body].points, [&](Index point) {
      const Eigen::Vector3d own = projection_.force(int(point)), arm = linear.arms.col(point);
      force += own;
      by_turn += own.dot(arm) * Eigen::Matrix3d::Identity() - arm * own.transpose();
    });
    if (force.isZero(0.)) continue;
    sum += force;
    const auto& jacobian = linear.of_bodies[body];
    of_moment +=
        (pinocchio::skew(force) * jacobian.topRows<3>() + by_turn * jacobian.bottomRows<3>());
  }
  of_moment -= pinocchio::skew(sum) * linear.of_com;
}

double WholeBodyWindow::weigh(const Constraint& constraint) const {
  if (problem_.free[constraint.frame]) return 0.;
  const bool flies = problem_.sets[static_cast<std::size_t>(constraint.frame)] == 0;
  return differ(constraint.frame).duration * penalty_ * (flies ? kFlight : 1.);
}

double WholeBodyWindow::weighChange(Index frame) const {
  return differ(frame).duration * (problem_.pinned_ends && isEnd(frame) ? kAnchor : 1.);
}

// Of squares of how far points are from their places. Where the wrench at an end of the motion
// depends on them, the root is at rest, and feet would have to move instead.
double WholeBodyWindow::weighPlaces(Index frame) const {
  const bool is_near_end = std::min(frame, problem_.time.size() - 1 - frame) <= kFarthest;
  return differ(frame).duration * hold_ * (is_near_end ? kRestOfPlaces : 1.);
}

// Of squares of accelerations in a frame.
Eigen::VectorXd WholeBodyWindow::weighAcceleration(Index frame) const {
  Eigen::VectorXd costs = differ(frame).duration * problem_.of_acceleration;
  if (isEnd(frame)) costs.head<6>() *= kRest;
  return costs;
}

// By how much a step of the changes leads beyond a limit.
double WholeBodyWindow::step(const Pin& pin) const {
  const Index row = pin.joint->v, column = pin.frame - first_;
  double step = 0.;
  if (isSought(pin.frame)) step = isOfStep(pin.kind) ? -step_(row, column) : step_(row, column);
  if (isOfStep(pin.kind) && isSought(pin.frame + 1)) step += step_(row, column + 1);
  return getSign(pin.kind) * step;
}

void WholeBodyWindow::addPins() {
  for (const Pin& pin : pins_) {
    const Index row = pin.joint->v, here = pin.frame - first_, next = here + 1;
    const double weight = differ(pin.frame).duration * pinch_;
    const bool leads_on = isOfStep(pin.kind) && isSought(pin.frame + 1);
    if (isSought(pin.frame)) system_(here, here)(row, row) += weight;
    if (leads_on) system_(next, next)(row, row) += weight;
    if (isSought(pin.frame) && leads_on) system_(next, here)(row, row) -= weight;
  }
}

// The second derivative of the augmented Lagrangian.
bool WholeBodyWindow::factorize(double penalty, double penalty_of_places) {
  penalty_ = penalty;
  hold_ = of_place_ * penalty_of_places;
  pinch_ = penalty_of_places / (kPinned * kPinned);
  const Index last = problem_.time.size() - 1;
  std::vector<Index> first;
  for (Index frame = first_; frame < behind_; ++frame) {
    // Both ends of the motion reach three frames far.
    const Index band = frame == 3 || frame == last ? 3 : 2;
    first.push_back(std::max<Index>(frame - band, first_) - first_);
  }
  system_.resize(problem_.model.nv, first);
  const auto block = [&](Index row, Index column) {
    return system_(row - first_, column - first_);
  };
  for (Index frame = std::max<Index>(first_ - 1, 0); frame <= std::min(behind_, last); ++frame) {
    const Difference difference = differ(frame);
    const double factors[3] = {difference.before, difference.here, difference.after};
    const Eigen::VectorXd costs = weighAcceleration(frame);
    if (isSought(frame)) block(frame, frame).diagonal() += weighChange(frame) * problem_.of_change;
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j <= i; ++j)
        if (isSought(frame - 1 + i) && isSought(frame - 1 + j))
          block(frame - 1 + i, frame - 1 + j).diagonal() += factors[i] * factors[j] * costs;
  }
  for (const Constraint& constraint : constraints_) {
    const Index frame = constraint.frame;
    if (constraint.off.size() > 0)
      block(frame, frame)
          .selfadjointView<Eigen::Lower>()
          .rankUpdate(constraint.of_places.transpose(), weighPlaces(frame));
    const double weight = weigh(constraint);
    const auto& terms = constraint.linear.terms;
    for (std::size_t i = 0; i < terms.size(); ++i)
      for (std::size_t j = 0; j <= i; ++j)
        if (isSought(terms[i].frame) && isSought(terms[j].frame))
          block(terms[i].frame, terms[j].frame).noalias() +=
              weight * terms[i].derivative.transpose() * terms[j].derivative;
  }
  addPins();
  return system_.factorize();
}

// The gradient of what changes cost, to be descended.
void WholeBodyWindow::addCosts(const Eigen::MatrixXd& change) {
  const Index last = problem_.time.size() - 1;
  for (Index frame = std::max<Index>(first_ - 1, 0); frame <= std::min(behind_, last); ++frame) {
    const Difference difference = differ(frame);
    const double factors[3] = {difference.before, difference.here, difference.after};
    Eigen::VectorXd acceleration = Eigen::VectorXd::Zero(change.rows());
    for (int i = 0; i < 3; ++i)
      if (factors[i] != 0.) acceleration += factors[i] * change.col(frame - 1 + i);
    acceleration = weighAcceleration(frame).cwiseProduct(acceleration);
    for (int i = 0; i < 3; ++i)
      if (isSought(frame - 1 + i)) step_.col(frame - 1 + i - first_) -= factors[i] * acceleration;
    if (isSought(frame))
      step_.col(frame - first_) -=
          weighChange(frame) * problem_.of_change.cwiseProduct(change.col(frame));
  }
}

// A step of ADMM with the linear model that there is.
void WholeBodyWindow::iterate(bool with_costs, Eigen::MatrixXd& change) {
  step_.setZero(problem_.model.nv, behind_ - first_);
  if (with_costs) addCosts(change);
  for (const Constraint& constraint : constraints_) {
    const Index frame = constraint.frame;
    if (constraint.off.size() > 0)
      step_.col(frame - first_).noalias() -=
          weighPlaces(frame) * constraint.of_places.transpose() * constraint.off;
    const Vector6 off = weigh(constraint) * (constraint.moved - constraint.given + constraint.dual);
    for (const auto& term : constraint.linear.terms)
      if (isSought(term.frame))
        step_.col(term.frame - first_).noalias() -= term.derivative.transpose() * off;
  }
  for (const Pin& pin : pins_) {
    const Index row = pin.joint->v, column = pin.frame - first_;
    const double pull = getSign(pin.kind) * differ(pin.frame).duration * pinch_ * pin.off;
    if (isSought(pin.frame)) step_(row, column) += isOfStep(pin.kind) ? pull : -pull;
    if (isOfStep(pin.kind) && isSought(pin.frame + 1)) step_(row, column + 1) -= pull;
  }
  system_.solve(step_);
  change.middleCols(first_, behind_ - first_) += step_;
  for (Constraint& constraint : constraints_) {
    for (const auto& term : constraint.linear.terms)
      if (isSought(term.frame))
        constraint.moved.noalias() += term.derivative * step_.col(term.frame - first_);
    if (constraint.off.size() > 0)
      constraint.off.noalias() += constraint.of_places * step_.col(constraint.frame - first_);
  }
  for (Pin& pin : pins_) pin.off += step(pin);
}

// The wrenches within the cones that are closest to those of the linear model.
void WholeBodyWindow::project(bool relaxed) {
  const double relaxation = relaxed ? kRelaxation : 1.;
  for (Constraint& constraint : constraints_) {
    if (problem_.free[constraint.frame]) continue;
    const Vector6 target =
        relaxation * constraint.moved + (1. - relaxation) * constraint.given + constraint.dual;
    constraint.dual = target;
    const std::uint32_t set = problem_.sets[static_cast<std::size_t>(constraint.frame)];
    if (set != 0) {
      const LinearizedFrame& linear = constraint.linear;
      projection_.setAnswer(constraint.answer);
      projection_.project(target, linear.points.colwise() - linear.com, shrunk_, set);
      constraint.answer = projection_.answer();
      constraint.dual = projection_.residual();
    }
    constraint.given = target - constraint.dual;
  }
}

// Begins ADMM with the closest wrenches, without multipliers.
void WholeBodyWindow::restart() {
  for (Constraint& constraint : constraints_) {
    constraint.given = constraint.moved;
    constraint.dual.setZero();
  }
  project(false);
  for (Constraint& constraint : constraints_) constraint.dual.setZero();
}

void WholeBodyWindow::apply(const Eigen::MatrixXd& change, Eigen::MatrixXd& q) const {
  Eigen::VectorXd configuration(problem_.model.nq);
  for (Index frame = first_; frame < behind_; ++frame) {
    pinocchio::integrate(problem_.model, problem_.q.col(frame), change.col(frame), configuration);
    q.col(frame) = configuration;
  }
}

}  // namespace dynacom::internal
