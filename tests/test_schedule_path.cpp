// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE schedule_path
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "inference/cone_projection.hpp"
#include "inference/schedule_path.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;
using namespace dynacom::internal;

namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr double kWeight = 300.;
using Mask = std::uint32_t;

/// Points that move at random about their rests, and a wrench that now one, now another could give.
struct Problem {
  /// @param is_calm  whether points stay where they are for some frames, so that what is cheapest
  ///                 in a frame is so in the next, too
  /// @param on_cones  whether friction is the cone's, else the pyramid's
  Problem(Random& random, const std::vector<int>& given_limbs, Index given_frames,
          bool is_calm = false, bool on_cones = false)
      : limbs(given_limbs), frames(given_frames) {
    time = VectorXd::Zero(frames);
    for (Index frame = 1; frame < frames; ++frame)
      time[frame] = time[frame - 1] + random.uniform(0.01, 0.05);
    com = Eigen::Matrix3Xd::Zero(3, frames);
    com.row(2).setConstant(0.8);
    force = torque = Eigen::Matrix3Xd::Zero(3, frames);
    for (Index frame = 0; frame < frames; ++frame) {
      force.col(frame) << 20. * random.vector3().head<2>(), random.uniform(0., 1.5) * kWeight;
      torque.col(frame) = 20. * random.vector3();
    }
    if (is_calm) {
      force = Vector3d(0., 0., 0.9 * kWeight).replicate(1, frames);
      torque *= 0.1;
    }
    for (std::size_t k = 0; k < limbs.size(); ++k) {
      const Vector3d place(random.uniform(-0.2, 0.2), random.uniform(-0.2, 0.2), 0.);
      position.push_back(place.replicate(1, frames));
      velocity.push_back(Eigen::Matrix3Xd::Zero(3, frames));
      for (Index frame = 0; frame < frames; ++frame) {
        position[k](2, frame) = random.uniform(-0.1, 0.04);
        velocity[k].col(frame) = random.uniform(0., 0.8) * random.vector3();
      }
      if (is_calm) {
        const Index half = random.integer(0, int(frames));
        position[k].row(2).head(half).setZero();
        velocity[k].leftCols(half) *= 0.1;
      }
      const double mu = random.uniform(0.4, 1.);
      friction.push_back(on_cones ? Section::disc(mu) : Section::facets(mu, 4));
      // One of two rests, of which the second carries only now and then.
      Rests own;
      own.list = {{0, 2, 0., true}, {2, frames, random.uniform(-0.02, 0.02), random.coin()}};
      own.owner.assign(static_cast<std::size_t>(frames), 0);
      std::fill(own.owner.begin() + random.integer(1, frames - 1), own.owner.end(), 1);
      if (random.integer(0, 4) == 0) own.owner[0] = -1;
      rests.push_back(own);
    }
  }

  SchedulePath find(const KnownContacts* known = nullptr, const PathPieces& pieces = {}) const {
    std::vector<PointTrack> points;
    for (std::size_t k = 0; k < limbs.size(); ++k)
      points.push_back({limbs[k], friction[k], false, position[k], velocity[k]});
    return findSchedulePath(points, rests, scales, {com, force, torque}, kWeight, time, settings,
                            known, pieces);
  }

  std::vector<int> limbs;
  Index frames;
  VectorXd time;
  Eigen::Matrix3Xd com, force, torque;
  std::vector<Eigen::Matrix3Xd> position, velocity;
  std::vector<Section> friction;
  std::vector<Rests> rests;
  CostScales scales = {0.01, 0.1, 0.03, 0.01};
  DetectionSettings settings;
};

/// All paths, one after the other, with costs as DetectionSettings describes them.
class AllPaths {
 public:
  explicit AllPaths(const Problem& problem, const KnownContacts* known = nullptr)
      : problem_(problem), known_(known), costs_(std::size_t(problem.frames)) {
    for (Index frame = 0; frame < problem.frames; ++frame)
      for (const Mask set : setsOf(frame))
        costs_[std::size_t(frame)].emplace_back(set, costOf(frame, set));
    probability = MatrixXd::Zero(Index(problem.limbs.size()), problem.frames);
    std::vector<Mask> path;
    walk(path, 0.);
    // Costs are negative logarithms of probabilities.
    least = cheapest_;
    walk_sums_ = true;
    walk(path, 0.);
    probability /= sum_;
  }

  /// Of a path that was found.
  double cost(const std::vector<Mask>& path) const {
    double sum = 0.;
    for (std::size_t frame = 0; frame < path.size(); ++frame) {
      double own = kInfinity;
      for (const auto& [set, value] : costs_[frame])
        if (set == path[frame]) own = value;
      sum += own + (frame > 0 ? change(path[frame - 1], path[frame]) : 0.);
    }
    return sum;
  }

  double least = kInfinity;
  std::vector<Mask> cheapest;
  MatrixXd probability;

 private:
  double pointCost(std::size_t k, Index frame) const {
    const int owner = problem_.rests[k].owner[std::size_t(frame)];
    bool carries = owner >= 0 && problem_.rests[k].list[std::size_t(owner)].on_ground;
    if (known_) carries = known_->active(contactOf(k), frame);
    if (!carries) return kInfinity;
    const DetectionSettings& s = problem_.settings;
    if (owner < 0) return s.fine_excess + s.coarse_greatest;
    const double height =
        problem_.position[k](2, frame) - problem_.rests[k].list[std::size_t(owner)].height;
    Vector3d velocity = problem_.velocity[k].col(frame);
    double off = std::max(0., height);
    if (height < -s.pressed_depth) off = -height - s.pressed_depth;
    if (height < 0. && off == 0.) velocity.z() = 0.;
    const double speed = velocity.norm();
    return std::min(std::pow(off / problem_.scales.height, 2) +
                        std::pow(speed / problem_.scales.speed, 2),
                    s.contact_gain + s.fine_excess) +
           std::min(s.coarse_factor *
                        (std::pow(off / s.coarse_height, 2) + std::pow(speed / s.coarse_speed, 2)),
                    s.coarse_greatest) -
           s.contact_gain;
  }

  Index contactOf(std::size_t k) const {
    for (std::size_t contact = 0; contact < known_->masks.size(); ++contact)
      if (known_->masks[contact] >> k & 1u) return Index(contact);
    return -1;
  }

  int limbs() const { return *std::max_element(problem_.limbs.begin(), problem_.limbs.end()) + 1; }

  /// The points of a limb that may carry, the cheapest first.
  std::vector<std::pair<double, std::size_t>> orderOf(int limb, Index frame) const {
    std::vector<std::pair<double, std::size_t>> order;
    for (std::size_t k = 0; k < problem_.limbs.size(); ++k)
      if (problem_.limbs[k] == limb && std::isfinite(pointCost(k, frame)))
        order.emplace_back(pointCost(k, frame), k);
    std::sort(order.begin(), order.end());
    return order;
  }

  /// All sets that take of each limb its cheapest points, and of each known contact at least one.
  std::vector<Mask> setsOf(Index frame) const {
    std::vector<Mask> sets = {0};
    for (int limb = 0; limb < limbs(); ++limb) {
      const std::vector<Mask> before = sets;
      Mask own = 0;
      for (const auto& entry : orderOf(limb, frame)) {
        own |= Mask(1) << entry.second;
        for (const Mask set : before) sets.push_back(set | own);
      }
    }
    if (known_) {
      const auto lacks = [&](Mask set) {
        for (std::size_t k = 0; k < known_->masks.size(); ++k)
          if (known_->active(Index(k), frame) && !(set & known_->masks[k])) return true;
        return false;
      };
      sets.erase(std::remove_if(sets.begin(), sets.end(), lacks), sets.end());
    }
    return sets;
  }

  double costOf(Index frame, Mask set) const {
    const DetectionSettings& s = problem_.settings;
    double sum = 0.;
    for (int limb = 0; limb < limbs(); ++limb) {
      double share = 1.;
      for (const auto& [value, k] : orderOf(limb, frame))
        if (set >> k & 1u) {
          sum += share * value;
          share = s.further_points;
        }
    }
    Vector6 wrench;
    wrench << problem_.force.col(frame), problem_.torque.col(frame);
    Eigen::Matrix3Xd levers(3, Index(problem_.limbs.size()));
    for (std::size_t k = 0; k < problem_.limbs.size(); ++k)
      levers.col(Index(k)) = problem_.position[k].col(frame) - problem_.com.col(frame);
    const auto missing = ConeProjection(s.lever).project(wrench, levers, problem_.friction, set);
    const double force = missing.force / kWeight, torque = missing.torque / kWeight;
    sum += s.dynamics_weight *
           (std::min(force / problem_.scales.force + torque / problem_.scales.torque,
                     s.missing_greatest) +
            s.missing_factor * (force / s.missing_force + torque / s.missing_torque));
    // A frame counts from halfway to the one before to halfway to the next.
    const Index last = problem_.frames - 1;
    const double from = frame > 0 ? problem_.time[frame - 1] : problem_.time[0];
    const double to = frame < last ? problem_.time[frame + 1] : problem_.time[last];
    return s.rate * 0.5 * (to - from) * sum;
  }

  /// The first point of a limb to begin, or the last to end, costs a change; others a part of it.
  double change(Mask before, Mask after) const {
    double sum = 0.;
    for (int limb = 0; limb < limbs(); ++limb) {
      Mask own = 0;
      for (std::size_t k = 0; k < problem_.limbs.size(); ++k)
        if (problem_.limbs[k] == limb) own |= Mask(1) << k;
      const Mask one = before & own, other = after & own;
      int points = 0;
      for (Mask rest = one ^ other; rest != 0; rest &= rest - 1) ++points;
      if (points > 0 && (one == 0 || other == 0)) sum += 1. + 0.5 * (points - 1);
      if (points > 0 && one != 0 && other != 0) sum += 0.5 * points;
    }
    return problem_.settings.change * sum;
  }

  /// How probable it is that limbs change in the time from one frame to the next, beyond what the
  /// costs say, which hold for a sixtieth of a second and more: of each that does, in proportion.
  double chance(Index frame, Mask before, Mask after) const {
    double product = 1.;
    for (int limb = 0; limb < limbs(); ++limb)
      for (std::size_t k = 0; k < problem_.limbs.size(); ++k)
        if (problem_.limbs[k] == limb && ((before ^ after) >> k & 1u)) {
          product *= std::min(1., 60. * (problem_.time[frame] - problem_.time[frame - 1]));
          break;
        }
    return product;
  }

  void walk(std::vector<Mask>& path, double cost, double chances = 1.) {
    const std::size_t frame = path.size();
    if (frame == costs_.size()) {
      if (walk_sums_) {
        const double weight = chances * std::exp(cheapest_ - cost);
        sum_ += weight;
        for (std::size_t k = 0; k < frame; ++k)
          for (Index point = 0; point < probability.rows(); ++point)
            if (path[k] >> point & 1u) probability(point, Index(k)) += weight;
      } else if (cost < cheapest_) {
        cheapest_ = cost;
        cheapest = path;
      }
      return;
    }
    for (const auto& [set, value] : costs_[frame]) {
      const double way = frame > 0 ? change(path.back(), set) : 0.;
      const double part = frame > 0 ? chance(Index(frame), path.back(), set) : 1.;
      path.push_back(set);
      walk(path, cost + value + way, chances * part);
      path.pop_back();
    }
  }

  const Problem& problem_;
  const KnownContacts* const known_;
  std::vector<std::vector<std::pair<Mask, double>>> costs_;
  double cheapest_ = kInfinity, sum_ = 0.;
  bool walk_sums_ = false;
};

// Where it is sure which sets a frame has, others are taken for as cheap as they may be, and so for
// more probable than they are: in some frames by as much as this, on average by far less.
constexpr double kWorst = 0.02, kMean = 0.0005;

}  // namespace

BOOST_AUTO_TEST_CASE(the_path_is_the_cheapest_of_all_and_probabilities_are_sums_over_all) {
  Random random(1);
  int changes = 0, unsure = 0;
  double off = 0.;
  const std::vector<std::vector<int>> kinds = {{0, 1, 2}, {0, 0, 0, 1}, {0, 1}};
  for (int trial = 0; trial < 120; ++trial) {
    const auto kind = std::size_t(trial) % kinds.size();
    Problem problem(random, kinds[kind], kind == 2 ? 8 : 5, kind == 2);
    problem.settings.further_points = 0.5;
    problem.settings.change = random.uniform(0.1, 2.);
    problem.settings.rate = random.uniform(1., 40.);
    const SchedulePath found = problem.find();
    const AllPaths all(problem);
    BOOST_TEST(close(all.cost(found.sets), all.least, 1e-5));
    BOOST_TEST(close(found.probability, all.probability, kWorst));
    off += (found.probability - all.probability).cwiseAbs().mean() / 120.;
    for (std::size_t frame = 1; frame < found.sets.size(); ++frame)
      changes += found.sets[frame] != found.sets[frame - 1];
    unsure += ((all.probability.array() - 0.5).abs() < 0.4).any();
  }
  BOOST_TEST(off < kMean);
  BOOST_TEST(changes > 40);
  BOOST_TEST(unsure > 20);
}

BOOST_AUTO_TEST_CASE(on_cones_it_is_the_cheapest_but_for_what_projections_leave) {
  Random random(11);
  bool is_other = false;
  for (int trial = 0; trial < 60; ++trial) {
    Problem problem(random, {0, 0, 1}, 5, false, true);
    problem.settings.change = random.uniform(0.1, 2.);
    problem.force.topRows<2>() += 0.5 * kWeight * Eigen::Matrix2Xd::Ones(2, 5);  // that slip
    const AllPaths all(problem);
    BOOST_TEST(close(all.cost(problem.find().sets), all.least, 1e-3));
    Problem on_pyramids = problem;
    for (Section& section : on_pyramids.friction) section = Section::facets(section.radius(), 4);
    is_other = is_other || AllPaths(on_pyramids).least < all.least - 0.01;
  }
  BOOST_TEST(is_other);
}

BOOST_AUTO_TEST_CASE(known_contacts_stay_and_only_their_points_are_found) {
  Random random(2);
  for (int trial = 0; trial < 60; ++trial) {
    Problem problem(random, {0, 0, 1, 1}, 5);
    problem.settings.change = random.uniform(0.1, 2.);
    KnownContacts known;
    known.masks = {0b0011, 0b1100};
    known.active = Eigen::Matrix<bool, Eigen::Dynamic, Eigen::Dynamic>::NullaryExpr(
        2, 5, [&](Index, Index) { return random.coin(); });
    const SchedulePath found = problem.find(&known);
    for (Index frame = 0; frame < 5; ++frame)
      for (const Index contact : {0, 1})
        BOOST_TEST(known.active(contact, frame) ==
                   bool(found.sets[std::size_t(frame)] & known.masks[std::size_t(contact)]));
    const AllPaths all(problem, &known);
    BOOST_TEST(close(all.cost(found.sets), all.least, 1e-5));
    BOOST_TEST(close(found.probability, all.probability, kWorst));
  }
}

BOOST_AUTO_TEST_CASE(what_ground_carries_and_nobody_lifts_is_active_for_sure) {
  Random random(3);
  Problem problem(random, {0, 1}, 4);
  for (std::size_t k : {0, 1}) {
    problem.position[k].row(2).setZero();
    problem.velocity[k].setZero();
    problem.rests[k].list = {{0, 4, 0., true}};
    problem.rests[k].owner.assign(4, 0);
  }
  const Vector3d middle = 0.5 * (problem.position[0] + problem.position[1]).col(0);
  problem.com.colwise() = middle + Vector3d(0., 0., 0.8);
  problem.force = Vector3d(0., 0., kWeight).replicate(1, 4);
  problem.torque.setZero();
  problem.time = VectorXd::LinSpaced(4, 0., 1.);
  const SchedulePath found = problem.find();
  BOOST_TEST((found.sets == std::vector<Mask>(4, 0b11)));
  BOOST_TEST(found.probability.minCoeff() > 0.99);
  // And in the air never.
  for (Rests& rests : problem.rests) rests.list[0].on_ground = false;
  const SchedulePath none = problem.find();
  BOOST_TEST((none.sets == std::vector<Mask>(4, 0)));
  BOOST_TEST(none.probability.maxCoeff() == 0.);
}

BOOST_AUTO_TEST_CASE(levels_that_are_left_out_of_many_are_none_twice) {
  // Five feet of three points each have 1024 sets, of which 256 are looked at. All points are at
  // rest, nothing is needed and changes are for free, so that neither feet nor frames depend on
  // each other.
  Random random(5);
  Problem problem(random, {0, 0, 0, 1, 1, 1, 2, 2, 2, 3, 3, 3, 4, 4, 4}, 2);
  problem.time[1] = 1.;
  problem.force.setZero();
  problem.torque.setZero();
  for (std::size_t k = 0; k < problem.limbs.size(); ++k) {
    problem.position[k].row(2).setZero();
    problem.velocity[k].setZero();
    problem.rests[k] = {{{0, 2, 0., true}}, {0, 0}};
  }
  problem.settings.change = 1e-9;
  problem.settings.rate = 0.1;  // a frame lasts half a second
  const SchedulePath found = problem.find();
  const double all = std::exp(0.5 * problem.settings.rate * problem.settings.contact_gain * 2.);
  for (const Index last : {2, 5, 8, 11, 14}) {  // of a foot, active only if all its points are
    BOOST_TEST(found.probability(last, 0) < all / (1. + all) + 1e-4);
    BOOST_TEST(found.probability(last, 0) > 0.3);
  }
}

BOOST_AUTO_TEST_CASE(long_motions_are_looked_at_piece_by_piece) {
  Random random(7);
  double largest = 0.;
  for (int trial = 0; trial < 10; ++trial) {
    Problem problem(random, {0, 0, 1, 1}, 400);
    const SchedulePath whole = problem.find();
    const SchedulePath pieces = problem.find(nullptr, {60, 40});
    BOOST_TEST((pieces.sets == whole.sets));
    BOOST_TEST(close(pieces.missing, whole.missing));
    // Where a piece begins, it is sure of the frame before.
    const MatrixXd off = (pieces.probability - whole.probability).cwiseAbs();
    BOOST_TEST(off.mean() < 0.01);
    largest = std::max(largest, off.maxCoeff());
  }
  BOOST_TEST(largest > 0.);
}

BOOST_AUTO_TEST_CASE(what_is_not_finite_in_a_frame_ends_there) {
  Random random(6);
  Problem problem(random, {0, 0, 1, 1}, 40, true);
  const SchedulePath before = problem.find();
  for (const double size : {1e30, 1e200, kInfinity, std::nan("")}) {
    problem.force.col(20).setConstant(size);
    const SchedulePath found = problem.find();
    for (const Index frame : {0, 10, 18, 22, 30, 39})
      BOOST_TEST(found.sets[std::size_t(frame)] == before.sets[std::size_t(frame)]);
    BOOST_TEST(found.probability.allFinite());
  }
}

BOOST_AUTO_TEST_CASE(an_empty_motion_and_a_robot_without_points) {
  Random random(4);
  Problem problem(random, {0, 1}, 4);
  problem.frames = 0;
  problem.time.resize(0);
  for (auto* matrix : {&problem.com, &problem.force, &problem.torque}) matrix->resize(3, 0);
  BOOST_TEST(problem.find().sets.empty());
  const Problem nobody(random, {}, 3);
  const SchedulePath found = nobody.find();
  BOOST_TEST((found.sets == std::vector<Mask>(3, 0)));
  BOOST_TEST(found.probability.rows() == 0);
}
