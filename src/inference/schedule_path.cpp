// SPDX-License-Identifier: BSD-2-Clause
#include "schedule_path.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>

#include "cone_projection.hpp"

namespace dynacom::internal {

namespace {

using Eigen::Index;
using Mask = std::uint32_t;

// How many sets there may be in a frame. More are made fewer, see FrameSets.
constexpr std::size_t kMaximalSets = 256;
// What costs no more than this is not worth looking for: it is a hundredth of a change of contact.
constexpr double kNegligible = 0.05;
// A point whose probability is between this and one minus this is not sure; and sets that cost this
// much more than the cheapest are not probable.
constexpr double kSure = 0.02, kImprobable = 7.;

constexpr double kUnknown = -1.;  // what a set is missing, before it was computed

// The sets of a frame: each takes of each limb a level, that is, so many of its cheapest points.
// They are numbered in the manner of digits, the first limb's being the fastest.
struct FrameSets {
  std::vector<std::vector<Mask>> levels;  // of each limb: sets of its points, the first is empty
  std::vector<float> cost;                // of where the points are
  std::vector<float> missing;             // cost of the dynamics; kUnknown before it is computed
  float least_missing = 0.f;              // no set is missing less, as far as is known

  std::size_t size() const { return cost.size(); }

  Mask mask(std::size_t number) const {
    Mask mask = 0;
    for (const std::vector<Mask>& limb : levels) {
      mask |= limb[number % limb.size()];
      number /= limb.size();
    }
    return mask;
  }

  // At least, where it is not known what the set is missing.
  float total(std::size_t number) const {
    return cost[number] + std::max(least_missing, missing[number]);
  }
};

class PathFinder {
 public:
  PathFinder(const std::vector<PointTrack>& points, const std::vector<Rests>& rests,
             const CostScales& scales, const WrenchTrack& wrench, double weight,
             const Eigen::VectorXd& time, const DetectionSettings& settings,
             const KnownContacts* known)
      : points_(points),
        rests_(rests),
        scales_(scales),
        wrench_(wrench),
        weight_(weight),
        time_(time),
        settings_(settings),
        known_(known),
        projection_(settings.lever) {
    int limbs = 0;
    for (const PointTrack& point : points) {
      limbs = std::max(limbs, point.limb + 1);
      mu_.push_back(point.mu);
    }
    limbs_.resize(static_cast<std::size_t>(limbs));
    for (std::size_t points = 1; points < changes_[0].size(); ++points) {
      const double one = settings.further_points * settings.change;
      changes_[0][points] = one * double(points);
      changes_[1][points] = one * double(points - 1) + settings.change;
    }
    for (const std::size_t whole : {0, 1})
      for (std::size_t points = 0; points < changes_[0].size(); ++points)
        factors_[whole][points] = float(std::exp(-changes_[whole][points]));
    limb_masks_.resize(limbs_.size(), 0);
    for (std::size_t k = 0; k < points.size(); ++k) {
      limbs_[static_cast<std::size_t>(points[k].limb)].push_back(static_cast<int>(k));
      limb_masks_[static_cast<std::size_t>(points[k].limb)] |= Mask(1) << k;
    }
    levers_.resize(3, Index(points.size()));
    for (Index frame = 0; frame < time.size(); ++frame) sets_.push_back(makeSets(frame));
  }

  SchedulePath find() {
    SchedulePath found;
    std::vector<std::size_t> path;
    for (bool is_done = false; !is_done;) {
      path = findCheapest();
      is_done = true;
      for (Index frame = 0; frame < time_.size(); ++frame)
        if (look(frame, path[static_cast<std::size_t>(frame)])) is_done = false;
    }
    found.probability = findProbability();
    bool changed = false;
    for (Index frame = 0; frame < time_.size(); ++frame)
      if ((found.probability.col(frame).array() > kSure &&
           found.probability.col(frame).array() < 1. - kSure)
              .any())
        changed = lookAtProbable(frame) || changed;
    if (changed) found.probability = findProbability();
    found.sets.reserve(path.size());
    found.missing.resize(2, Index(path.size()));
    for (std::size_t frame = 0; frame < path.size(); ++frame) {
      found.sets.push_back(sets_[frame].mask(path[frame]));
      const auto missing = project(Index(frame), found.sets.back());
      found.missing.col(Index(frame)) << missing.force, missing.torque;
    }
    return found;
  }

 private:
  // How long a frame counts; one that is alone as long as one likes.
  double duration(Index frame) const {
    const Index last = time_.size() - 1;
    if (last == 0) return 1.;
    return 0.5 * (time_[std::min(frame + 1, last)] - time_[std::max<Index>(frame - 1, 0)]);
  }

  double cost(std::size_t point, Index frame) const;
  FrameSets makeSets(Index frame) const;
  // By whether the whole limb begins or ends, and how many of its points change.
  template <class Number>
  using Table = std::array<std::array<Number, 33>, 2>;
  template <class Number>
  static Number find(const Table<Number>& table, Mask before, Mask after) {
    return table[before == 0 || after == 0 ? 1 : 0]
                [static_cast<std::size_t>(__builtin_popcount(before ^ after))];
  }
  // What a limb costs that changes from one set of its points to another, and its probability.
  double changeOf(Mask before, Mask after) const { return find(changes_, before, after); }
  float factorOf(Mask before, Mask after) const { return find(factors_, before, after); }
  bool look(Index frame, std::size_t number);
  bool lookAtProbable(Index frame);
  ConeProjection::Residual project(Index frame, Mask mask);
  void compute(Index frame, std::size_t number);
  std::vector<std::size_t> findCheapest() const;
  Eigen::MatrixXd findProbability() const;

  const std::vector<PointTrack>& points_;
  const std::vector<Rests>& rests_;
  const CostScales& scales_;
  const WrenchTrack& wrench_;
  const double weight_;
  const Eigen::VectorXd& time_;
  const DetectionSettings& settings_;
  const KnownContacts* const known_;
  std::vector<double> mu_;
  std::vector<std::vector<int>> limbs_;  // points of each
  std::vector<Mask> limb_masks_;
  Table<double> changes_ = {};
  Table<float> factors_;
  std::vector<FrameSets> sets_;
  ConeProjection projection_;
  Eigen::Matrix3Xd levers_;
};

// Of a point in contact, from where it is and how it moves; infinite where nothing carries it.
double PathFinder::cost(std::size_t index, Index frame) const {
  const PointTrack& point = points_[index];
  const Rests& rests = rests_[index];
  const int owner = rests.owner[static_cast<std::size_t>(frame)];
  bool carries = owner >= 0 && rests.list[static_cast<std::size_t>(owner)].on_ground;
  if (known_)
    for (std::size_t k = 0; k < known_->masks.size(); ++k)
      if (known_->masks[k] >> index & 1u) carries = known_->active(Index(k), frame);
  if (!carries) return std::numeric_limits<double>::infinity();
  if (owner < 0) return settings_.fine_greatest + settings_.coarse_greatest;
  const auto square = [](double value) { return value * value; };
  const double height =
      point.position(2, frame) - rests.list[static_cast<std::size_t>(owner)].height;
  // What is below its rest is pressed, on its way down or up.
  const bool pressed = height < 0. && height >= -settings_.pressed_depth;
  const double off = pressed ? 0. : height < 0. ? -settings_.pressed_depth - height : height;
  const double vertical = pressed ? 0. : point.velocity(2, frame);
  const double horizontal = point.velocity.col(frame).head<2>().squaredNorm();
  const double fine =
      square(off / scales_.height) + (square(vertical) + horizontal) / square(scales_.speed);
  const double coarse = square(off / settings_.coarse_height) +
                        (square(vertical) + horizontal) / square(settings_.coarse_speed);
  return std::min(fine, settings_.fine_greatest) +
         std::min(settings_.coarse_factor * coarse, settings_.coarse_greatest);
}

FrameSets PathFinder::makeSets(Index frame) const {
  struct Level {
    Mask mask;
    double cost;
  };
  FrameSets sets;
  std::vector<std::vector<Level>> levels;
  std::size_t count = 1;
  for (const std::vector<int>& limb : limbs_) {
    std::vector<std::pair<double, int>> order;
    for (const int point : limb) {
      const double value = cost(static_cast<std::size_t>(point), frame);
      if (std::isfinite(value)) order.emplace_back(value - settings_.contact_gain, point);
    }
    std::sort(order.begin(), order.end());
    std::vector<Level> own = {{0, 0.}};
    for (std::size_t k = 0; k < order.size(); ++k) {
      const double share = k == 0 ? 1. : settings_.further_points;
      own.push_back(
          {own.back().mask | Mask(1) << order[k].second, own.back().cost + share * order[k].first});
    }
    if (known_) {
      const Mask possible = own.back().mask;
      const auto lacks = [&](const Level& level) {
        for (std::size_t k = 0; k < known_->masks.size(); ++k)
          if ((known_->masks[k] & possible) && !(known_->masks[k] & level.mask)) return true;
        return false;
      };
      own.erase(std::remove_if(own.begin(), own.end(), lacks), own.end());
    }
    count *= own.size();
    levels.push_back(std::move(own));
  }
  // Too many: of the limb with the most levels only nothing, the cheapest, and all; and then of the
  // limb that would cost most, nothing.
  while (count > kMaximalSets) {
    const auto cheapest = [](const std::vector<Level>& limb) {
      return std::min_element(limb.begin() + (limb.size() > 1), limb.end(),
                              [](const Level& a, const Level& b) { return a.cost < b.cost; });
    };
    auto most = std::max_element(levels.begin(), levels.end(),
                                 [](const auto& a, const auto& b) { return a.size() < b.size(); });
    if (most->size() > 3) {
      *most = std::vector<Level>{most->front(), *cheapest(*most), most->back()};
    } else {
      const auto value = [&](const std::vector<Level>& limb) {
        return limb.size() < 2 ? -std::numeric_limits<double>::infinity() : cheapest(limb)->cost;
      };
      most = std::max_element(levels.begin(), levels.end(),
                              [&](const auto& a, const auto& b) { return value(a) < value(b); });
      most->resize(1);
    }
    count = 1;
    for (const auto& limb : levels) count *= limb.size();
  }

  const double scale = settings_.rate * duration(frame);
  sets.cost.resize(count);
  sets.missing.assign(count, float(kUnknown));
  for (std::size_t number = 0; number < count; ++number) {
    double sum = 0.;
    std::size_t rest = number;
    for (const auto& limb : levels) {
      sum += limb[rest % limb.size()].cost;
      rest /= limb.size();
    }
    sets.cost[number] = float(scale * sum);
  }
  for (const auto& limb : levels) {
    std::vector<Mask> masks;
    for (const Level& level : limb) masks.push_back(level.mask);
    sets.levels.push_back(std::move(masks));
  }
  return sets;
}

// What a set cannot give in a frame, in [m g] and [m g m].
ConeProjection::Residual PathFinder::project(Index frame, Mask mask) {
  ConeProjection::Vector6 wrench;
  wrench << wrench_.force.col(frame), wrench_.torque.col(frame);
  for (std::size_t k = 0; k < points_.size(); ++k)
    levers_.col(Index(k)) = points_[k].position.col(frame) - wrench_.com.col(frame);
  return projection_.project(wrench / weight_, levers_, mu_, mask);
}

void PathFinder::compute(Index frame, std::size_t number) {
  FrameSets& sets = sets_[static_cast<std::size_t>(frame)];
  const auto missing = project(frame, sets.mask(number));
  const double fine = missing.force / scales_.force + missing.torque / scales_.torque;
  const double coarse =
      missing.force / settings_.missing_force + missing.torque / settings_.missing_torque;
  sets.missing[number] =
      float(settings_.rate * duration(frame) * settings_.dynamics_weight *
            (std::min(fine, settings_.missing_greatest) + settings_.missing_factor * coarse));
}

// Computes what a set is missing, and if that is something, what those are that may be better, even
// if the path had to leave this one for them and come back; says whether that was new.
bool PathFinder::look(Index frame, std::size_t number) {
  FrameSets& sets = sets_[static_cast<std::size_t>(frame)];
  if (sets.missing[number] >= 0.f) return false;
  compute(frame, number);
  if (sets.missing[number] <= kNegligible) return true;
  // Cones are nested: what all points together cannot give, no set can.
  const std::size_t all = sets.size() - 1;
  if (sets.missing[all] < 0.f) compute(frame, all);
  sets.least_missing = sets.missing[all];
  if (sets.missing[number] - sets.least_missing <= kNegligible) return true;
  const Mask own = sets.mask(number);
  for (std::size_t other = 0; other < sets.size(); ++other) {
    if (sets.missing[other] >= 0.f) continue;
    const Mask mask = sets.mask(other);
    double way = 0.;
    for (const Mask limb : limb_masks_) way += 2. * changeOf(own & limb, mask & limb);
    if (sets.total(other) <= sets.total(number) + way) compute(frame, other);
  }
  return true;
}

// Computes what sets are missing that may be probable; says whether there was any.
bool PathFinder::lookAtProbable(Index frame) {
  FrameSets& sets = sets_[static_cast<std::size_t>(frame)];
  bool changed = false;
  float least = std::numeric_limits<float>::infinity();
  for (std::size_t number = 0; number < sets.size(); ++number)
    least = std::min(least, sets.total(number));
  for (std::size_t number = 0; number < sets.size(); ++number)
    if (sets.missing[number] < 0.f && sets.total(number) <= least + kImprobable) {
      compute(frame, number);
      changed = true;
    }
  return changed;
}

// Viterbi's recursion. From one frame's sets to the next's limb by limb, since what changes cost is
// a sum over limbs.
std::vector<std::size_t> PathFinder::findCheapest() const {
  const std::size_t frames = sets_.size();
  std::vector<std::vector<std::uint16_t>> origins(frames);
  std::vector<float> value, next;
  std::vector<std::uint16_t> origin, next_origin;
  for (std::size_t frame = 0; frame < frames; ++frame) {
    const FrameSets& sets = sets_[frame];
    if (frame == 0) {
      value.assign(sets.size(), 0.f);
    } else {
      const FrameSets& before = sets_[frame - 1];
      origin.resize(before.size());
      std::iota(origin.begin(), origin.end(), std::uint16_t(0));
      // Digits below the limb's are of this frame already, those above it still of the one before.
      std::size_t below = 1, above = before.size();
      for (std::size_t limb = 0; limb < sets.levels.size(); ++limb) {
        const auto& from = before.levels[limb];
        const auto& to = sets.levels[limb];
        above /= from.size();
        next.assign(below * to.size() * above, std::numeric_limits<float>::infinity());
        next_origin.resize(next.size());
        for (std::size_t j = 0; j < to.size(); ++j)
          for (std::size_t i = 0; i < from.size(); ++i) {
            const auto change = float(changeOf(from[i], to[j]));
            for (std::size_t high = 0; high < above; ++high) {
              const std::size_t source = (high * from.size() + i) * below;
              const std::size_t target = (high * to.size() + j) * below;
              for (std::size_t low = 0; low < below; ++low)
                if (value[source + low] + change < next[target + low]) {
                  next[target + low] = value[source + low] + change;
                  next_origin[target + low] = origin[source + low];
                }
            }
          }
        value.swap(next);
        origin.swap(next_origin);
        below *= to.size();
      }
      origins[frame] = origin;
    }
    for (std::size_t number = 0; number < sets.size(); ++number)
      value[number] += sets.total(number);
    const float least = *std::min_element(value.begin(), value.end());
    for (float& number : value) number -= least;
  }
  std::vector<std::size_t> path(frames);
  if (frames == 0) return path;
  path[frames - 1] = std::size_t(std::min_element(value.begin(), value.end()) - value.begin());
  for (std::size_t frame = frames; --frame > 0;) path[frame - 1] = origins[frame][path[frame]];
  return path;
}

// The forward-backward recursion over the same costs, taken for negative logarithms of
// probabilities.
Eigen::MatrixXd PathFinder::findProbability() const {
  const std::size_t frames = sets_.size();
  Eigen::MatrixXd probability = Eigen::MatrixXd::Zero(Index(points_.size()), Index(frames));
  std::vector<std::vector<float>> forward(frames);
  const auto weigh = [&](std::vector<float>& value, const FrameSets& sets) {
    float least = std::numeric_limits<float>::infinity();
    for (std::size_t k = 0; k < sets.size(); ++k) least = std::min(least, sets.total(k));
    float sum = 0.f;
    for (std::size_t k = 0; k < sets.size(); ++k)
      sum += value[k] *= std::exp(least - sets.total(k));
    if (sum > 0.f)
      for (float& number : value) number /= sum;
    else
      std::fill(value.begin(), value.end(), 1.f / float(value.size()));
  };
  const auto move = [&](std::vector<float>& value, const FrameSets& before, const FrameSets& sets) {
    std::vector<float> next;
    std::size_t below = 1, above = before.size();
    for (std::size_t limb = 0; limb < sets.levels.size(); ++limb) {
      const auto& from = before.levels[limb];
      const auto& to = sets.levels[limb];
      above /= from.size();
      next.assign(below * to.size() * above, 0.f);
      for (std::size_t j = 0; j < to.size(); ++j)
        for (std::size_t i = 0; i < from.size(); ++i) {
          const float factor = factorOf(from[i], to[j]);
          for (std::size_t high = 0; high < above; ++high) {
            const std::size_t source = (high * from.size() + i) * below;
            const std::size_t target = (high * to.size() + j) * below;
            for (std::size_t low = 0; low < below; ++low)
              next[target + low] += factor * value[source + low];
          }
        }
      value.swap(next);
      below *= to.size();
    }
  };
  for (std::size_t frame = 0; frame < frames; ++frame) {
    std::vector<float>& value = forward[frame];
    if (frame == 0) {
      value.assign(sets_[0].size(), 1.f);
    } else {
      value = forward[frame - 1];
      move(value, sets_[frame - 1], sets_[frame]);
    }
    weigh(value, sets_[frame]);
  }
  std::vector<float> backward;
  for (std::size_t frame = frames; frame-- > 0;) {
    const FrameSets& sets = sets_[frame];
    if (frame + 1 == frames) {
      backward.assign(sets.size(), 1.f);
    } else {
      weigh(backward, sets_[frame + 1]);
      move(backward, sets_[frame + 1], sets);
    }
    double sum = 0.;
    for (std::size_t k = 0; k < sets.size(); ++k) {
      const double value = double(forward[frame][k]) * double(backward[k]);
      sum += value;
      for (Mask rest = sets.mask(k); rest != 0; rest &= rest - 1)
        probability(__builtin_ctz(rest), Index(frame)) += value;
    }
    if (sum > 0.)
      probability.col(Index(frame)) = (probability.col(Index(frame)) / sum).cwiseMin(1.);
  }
  return probability;
}

}  // namespace

SchedulePath findSchedulePath(const std::vector<PointTrack>& points,
                              const std::vector<Rests>& rests, const CostScales& scales,
                              const WrenchTrack& wrench, double weight, const Eigen::VectorXd& time,
                              const DetectionSettings& settings, const KnownContacts* known) {
  return PathFinder(points, rests, scales, wrench, weight, time, settings, known).find();
}

}  // namespace dynacom::internal
