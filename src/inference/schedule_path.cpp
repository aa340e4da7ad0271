// SPDX-License-Identifier: BSD-2-Clause
#include "schedule_path.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "cone_projection.hpp"

namespace dynacom::internal {

namespace {

using Eigen::Index;
using Mask = std::uint32_t;

// How many sets there may be in a frame. More are made fewer, see FrameSets.
constexpr std::size_t kMaximalSets = 256;
// A change of contact is as probable as its cost says in so long a time [s], in a longer one, too,
// and in a shorter one the less. The path pays the same for it at any frame rate.
constexpr double kChangeTime = 1. / 60.;
// What costs no more than this in kChangeTime is not worth looking for: a hundredth of a change.
constexpr float kNegligible = 0.05f;
// From which probability on it is worth knowing what a set is missing.
constexpr float kProbable = 0.005f;
// Costs that are larger by this make a set improbable.
constexpr float kImprobable = 6.f;
// The most that what a set is missing costs: next to what is infinite, nothing else would count.
constexpr float kLargestCost = 1e5f;

// So many points of a limb, with what it costs that they are active where they are.
struct Level {
  Mask mask;
  float cost;

  static bool isCheaper(const Level& one, const Level& other) { return one.cost < other.cost; }
};

// What the points of each limb may do in a frame: nothing, or so many of its cheapest ones are
// active.
using Levels = std::vector<std::vector<Level>>;

// What changes of a limb's points cost from one frame to the next, and how probable they are: a row
// for each level that it has in the later frame, with a number for each in the earlier one.
struct LimbChanges {
  std::vector<float> cost, probability;
};

// The sets of a frame: each takes of each limb one of its levels. They are numbered in the manner
// of digits, the first limb's being the fastest.
struct FrameSets {
  Levels levels;
  std::vector<LimbChanges> changes;  // of each limb, since the frame before
  std::vector<Mask> mask;
  std::vector<float> cost;        // of where the points are
  std::vector<float> missing;     // cost of what the set cannot give; before it is known, a bound
  std::vector<bool> is_known;     // whether it is
  std::vector<float> likelihood;  // of the costs, but for a factor

  std::size_t size() const { return cost.size(); }

  // At least, where it is not known what the set is missing.
  float total(std::size_t number) const { return cost[number] + missing[number]; }

  // Cones are nested: what a set cannot give, none of its subsets can, which are missing no less
  // than `bound`.
  void setMissing(std::size_t number, float value, float bound) {
    missing[number] = value;
    is_known[number] = true;
    for (std::size_t other = 0; other < number; ++other)
      if (!is_known[other] && (mask[other] & ~mask[number]) == 0)
        missing[other] = std::max(missing[other], bound);
  }
  std::size_t findCheapest() const {
    std::size_t best = 0;
    for (std::size_t number = 1; number < size(); ++number)
      if (total(number) < total(best)) best = number;
    return best;
  }
};

// What changes of a limb's points cost: by whether the whole limb begins or ends, and how many of
// its points change. It is a metric: no way is longer than one with a stop.
class Changes {
 public:
  Changes(double change, double further) {
    for (std::size_t points = 1; points < costs_[0].size(); ++points) {
      costs_[0][points] = float(further * change * double(points));
      costs_[1][points] = float(further * change * double(points - 1) + change);
    }
    for (const std::size_t whole : {0, 1})
      for (std::size_t points = 0; points < costs_[0].size(); ++points)
        probabilities_[whole][points] = std::exp(-costs_[whole][points]);
  }

  float cost(Mask before, Mask after) const { return find(costs_, before, after); }
  float least() const { return costs_[0][1]; }
  // In kChangeTime.
  float probability(Mask before, Mask after) const { return find(probabilities_, before, after); }

 private:
  using Table = std::array<std::array<float, 33>, 2>;

  static float find(const Table& table, Mask before, Mask after) {
    std::size_t points = 0;
    for (Mask rest = before ^ after; rest != 0; rest &= rest - 1) ++points;
    return table[before == 0 || after == 0 ? 1 : 0][points];
  }

  Table costs_ = {}, probabilities_ = {};
};

// The cheapest set of a frame by itself, and how much more others cost at least.
struct Choice {
  Mask set;
  float gap;    // of the closest one
  float ratio;  // by what it costs to change to it
};

class PathFinder {
 public:
  PathFinder(const std::vector<PointTrack>& points, const std::vector<Rests>& rests,
             const CostScales& scales, const WrenchTrack& wrench, double weight,
             const Eigen::VectorXd& time, const DetectionSettings& settings,
             const KnownContacts* known, const PathPieces& pieces)
      : points_(points),
        rests_(rests),
        scales_(scales),
        wrench_(wrench),
        weight_(weight),
        time_(time),
        settings_(settings),
        known_(known),
        pieces_(pieces),
        changes_(settings.change, settings.further_points),
        projection_(settings.lever) {
    int limbs = 0;
    for (const PointTrack& point : points) {
      limbs = std::max(limbs, point.limb + 1);
      friction_.push_back(point.friction);
    }
    limbs_.resize(static_cast<std::size_t>(limbs));
    limb_masks_.resize(limbs_.size(), 0);
    for (std::size_t k = 0; k < points.size(); ++k) {
      limbs_[static_cast<std::size_t>(points[k].limb)].push_back(static_cast<int>(k));
      limb_masks_[static_cast<std::size_t>(points[k].limb)] |= Mask(1) << k;
    }
    levers_.resize(3, Index(points.size()));
  }

  SchedulePath find() {
    const Index frames = time_.size();
    found_.sets.resize(static_cast<std::size_t>(frames));
    found_.probability.setZero(Index(points_.size()), frames);
    found_.missing.resize(2, frames);
    projected_.resize(static_cast<std::size_t>(frames));
    const std::vector<bool> certain = chooseCertain();
    for (Index first = 0; first < frames; ++first) {
      if (certain[static_cast<std::size_t>(first)]) {
        for (Mask rest = found_.sets[static_cast<std::size_t>(first)]; rest != 0; rest &= rest - 1)
          found_.probability(__builtin_ctz(rest), first) = 1.;
        continue;
      }
      Index behind = first;
      while (behind < frames && !certain[static_cast<std::size_t>(behind)]) ++behind;
      // A frame does not depend on others that are far away: what is long is taken piece by piece,
      // each from the last frame of the one before on, which is then certain.
      for (; behind - first > pieces_.longest + pieces_.overlap; first += pieces_.longest)
        findBetween(first, first + pieces_.longest + pieces_.overlap);
      findBetween(first, behind);
      first = behind - 1;
    }
    return std::move(found_);
  }

 private:
  // What sets are missing, as far as that is known.
  using Projections = std::vector<std::pair<Mask, Eigen::Vector2d>>;

  // How long a frame lasts; one that is alone as long as one likes.
  double duration(Index frame) const {
    const Index last = time_.size() - 1;
    if (last == 0) return 1.;
    return 0.5 * (time_[std::min(frame + 1, last)] - time_[std::max<Index>(frame - 1, 0)]);
  }

  // How probable a change is in such a time, beside what its cost says.
  static double partOf(double time) { return std::min(time / kChangeTime, 1.); }
  // What costs no more is not worth looking for: a hundredth of a change of contact in kChangeTime.
  float negligible(Index frame) const { return kNegligible * float(duration(frame) / kChangeTime); }

  double cost(std::size_t point, Index frame) const;
  void makeLevels(Index frame, Levels& levels);
  void makeSets(Index frame, FrameSets& sets);
  static void combineLevels(FrameSets& sets);
  Eigen::Vector2d findMissing(Index frame, Mask set);
  // Gives back the memory of what sets are missing in a frame, of which hardly anybody asks again.
  void forget(Index frame) { Projections().swap(projected_[static_cast<std::size_t>(frame)]); }
  float costOf(const Eigen::Vector2d& missing, Index frame) const;
  float leastCostOf(const Eigen::Vector2d& missing, Index frame) const;
  void evaluate(FrameSets& sets, Index frame, std::size_t number) {
    const Eigen::Vector2d missing = findMissing(frame, sets.mask[number]);
    sets.setMissing(number, costOf(missing, frame), leastCostOf(missing, frame));
  }
  float changeOf(Mask before, Mask after) const;

  bool isDetourProbable(Index frame, float gap) const;
  Choice choose(Index frame);
  Choice chooseAmongAll(Index frame);
  std::vector<bool> chooseCertain();
  void markCertain(std::size_t first, const std::vector<Choice>& choices,
                   std::vector<bool>& certain);

  void findBetween(Index first, Index behind);
  void findChanges(const FrameSets& before, Index frame, FrameSets& sets) const;
  bool refine(FrameSets& sets, Index frame, std::size_t number);
  std::vector<std::size_t> findCheapestPath(std::size_t count);
  bool findProbability(Index first, Index behind);

  const std::vector<PointTrack>& points_;
  const std::vector<Rests>& rests_;
  const CostScales& scales_;
  const WrenchTrack& wrench_;
  const double weight_;
  const Eigen::VectorXd& time_;
  const DetectionSettings& settings_;
  const KnownContacts* const known_;
  const PathPieces pieces_;
  const Changes changes_;
  std::vector<Section> friction_;        // of each point
  std::vector<std::vector<int>> limbs_;  // points of each
  std::vector<Mask> limb_masks_;
  ConeProjection projection_;
  std::vector<Projections> projected_;  // by frame, as long as somebody may ask for them
  Index placed_ = -1;                   // the frame of the levers
  Eigen::Matrix3Xd levers_;
  std::vector<std::pair<double, int>> order_;  // of a limb's points
  FrameSets one_;                              // of a frame by itself
  // Of frames that are not certain, and of the certain ones before and behind them, which have one
  // set.
  std::vector<FrameSets> between_;
  std::vector<std::vector<std::uint16_t>> origins_;
  std::vector<std::vector<float>> forward_;
  SchedulePath found_;
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
  const double fine_greatest = settings_.contact_gain + settings_.fine_excess;
  if (owner < 0) return fine_greatest + settings_.coarse_greatest;
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
  return std::min(fine, fine_greatest) +
         std::min(settings_.coarse_factor * coarse, settings_.coarse_greatest);
}

void PathFinder::makeLevels(Index frame, Levels& levels) {
  const double scale = settings_.rate * duration(frame);
  levels.resize(limbs_.size());
  std::size_t count = 1;
  for (std::size_t limb = 0; limb < limbs_.size(); ++limb) {
    order_.clear();
    for (const int point : limbs_[limb]) {
      const double value = cost(static_cast<std::size_t>(point), frame);
      if (std::isfinite(value)) order_.emplace_back(value - settings_.contact_gain, point);
    }
    std::sort(order_.begin(), order_.end());
    std::vector<Level>& own = levels[limb];
    own.assign(1, {0, 0.f});
    for (std::size_t k = 0; k < order_.size(); ++k) {
      const double share = scale * (k == 0 ? 1. : settings_.further_points);
      own.push_back({own.back().mask | Mask(1) << order_[k].second,
                     own.back().cost + float(share * order_[k].first)});
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
  }
  // Too many: of the limb with the most levels only nothing, the cheapest, and all; and then of the
  // limb that would cost most, nothing.
  while (count > kMaximalSets) {
    const auto cheapest = [](const std::vector<Level>& limb) {
      return *std::min_element(limb.begin() + (limb.size() > 1), limb.end(), Level::isCheaper);
    };
    auto most = std::max_element(levels.begin(), levels.end(),
                                 [](const auto& a, const auto& b) { return a.size() < b.size(); });
    if (most->size() > 3) {
      std::vector<Level> fewer = {most->front()};
      const Level best = cheapest(*most);
      if (best.mask != most->back().mask) fewer.push_back(best);
      fewer.push_back(most->back());
      *most = std::move(fewer);
    } else {
      const auto value = [&](const std::vector<Level>& limb) {
        return limb.size() < 2 ? -std::numeric_limits<float>::infinity() : cheapest(limb).cost;
      };
      most = std::max_element(levels.begin(), levels.end(),
                              [&](const auto& a, const auto& b) { return value(a) < value(b); });
      most->resize(1);
    }
    count = 1;
    for (const auto& limb : levels) count *= limb.size();
  }
}

void PathFinder::makeSets(Index frame, FrameSets& sets) {
  makeLevels(frame, sets.levels);
  combineLevels(sets);
  for (const auto& [set, missing] : projected_[static_cast<std::size_t>(frame)]) {
    const auto place = std::find(sets.mask.begin(), sets.mask.end(), set) - sets.mask.begin();
    sets.setMissing(static_cast<std::size_t>(place), costOf(missing, frame),
                    leastCostOf(missing, frame));
  }
}

// All that a frame has, as far as its levels are there.
void PathFinder::combineLevels(FrameSets& sets) {
  sets.cost.assign(1, 0.f);
  sets.mask.assign(1, 0);
  for (const std::vector<Level>& limb : sets.levels) {
    const std::size_t below = sets.size();
    sets.cost.resize(below * limb.size());
    sets.mask.resize(sets.size());
    for (std::size_t level = limb.size(); level-- > 0;)
      for (std::size_t low = 0; low < below; ++low) {
        sets.cost[level * below + low] = sets.cost[low] + limb[level].cost;
        sets.mask[level * below + low] = sets.mask[low] | limb[level].mask;
      }
  }
  sets.missing.assign(sets.size(), 0.f);
  sets.is_known.assign(sets.size(), false);
}

// What a set cannot give in a frame: norms of force [m g] and moment [m g m]. It is asked for again
// where a frame's own choice is not certain.
Eigen::Vector2d PathFinder::findMissing(Index frame, Mask set) {
  Projections& known = projected_[static_cast<std::size_t>(frame)];
  for (const auto& [other, missing] : known)
    if (other == set) return missing;
  if (placed_ != frame)
    for (std::size_t k = 0; k < points_.size(); ++k)
      levers_.col(Index(k)) = points_[k].position.col(frame) - wrench_.com.col(frame);
  placed_ = frame;
  ConeProjection::Vector6 wrench;
  wrench << wrench_.force.col(frame), wrench_.torque.col(frame);
  const auto residual = projection_.project(wrench / weight_, levers_, friction_, set);
  known.emplace_back(set, Eigen::Vector2d(residual.force, residual.torque));
  return known.back().second;
}

float PathFinder::costOf(const Eigen::Vector2d& missing, Index frame) const {
  const double fine = missing[0] / scales_.force + missing[1] / scales_.torque;
  const double coarse =
      missing[0] / settings_.missing_force + missing[1] / settings_.missing_torque;
  const double cost =
      settings_.rate * duration(frame) * settings_.dynamics_weight *
      (std::min(fine, settings_.missing_greatest) + settings_.missing_factor * coarse);
  return cost < double(kLargestCost) ? float(cost) : kLargestCost;
}

// The least cost of what a subset is missing, whose norm, of force and moment together, is no less.
float PathFinder::leastCostOf(const Eigen::Vector2d& missing, Index frame) const {
  const double norm = std::hypot(missing[0], missing[1] / settings_.lever);
  const bool is_force_cheaper =
      settings_.missing_force * settings_.lever > settings_.missing_torque;
  return is_force_cheaper ? costOf({norm, 0.}, frame) : costOf({0., settings_.lever * norm}, frame);
}

float PathFinder::changeOf(Mask before, Mask after) const {
  float sum = 0.f;
  for (const Mask limb : limb_masks_) sum += changes_.cost(before & limb, after & limb);
  return sum;
}

// The cheapest set of a frame: of each limb what costs least where it is, if that can give what is
// needed, or as much as all points together: cones are nested.
Choice PathFinder::choose(Index frame) {
  Levels& levels = one_.levels;
  makeLevels(frame, levels);
  const auto cheapest = [](const std::vector<Level>& limb) {
    return std::min_element(limb.begin(), limb.end(), Level::isCheaper);
  };
  Choice choice = {0, std::numeric_limits<float>::infinity(), 0.f};
  Mask all = 0;
  for (const std::vector<Level>& limb : levels) {
    choice.set |= cheapest(limb)->mask;
    all |= limb.back().mask;
  }
  found_.missing.col(frame) = findMissing(frame, choice.set);
  float excess = costOf(found_.missing.col(frame), frame);
  if (excess == kLargestCost) return {choice.set, 0.f, 0.f};
  if (excess > negligible(frame) && all != choice.set)
    excess -= leastCostOf(findMissing(frame, all), frame);
  // A subset of all points may trade force for moment, and so cost less than all of them, which can
  // be no more than hundredths.
  if (all == choice.set || excess <= negligible(frame)) excess = 0.f;
  choice.ratio = choice.gap;
  for (const std::vector<Level>& limb : levels) {
    const auto own = cheapest(limb);
    for (auto other = limb.begin(); other != limb.end(); ++other) {
      if (other == own) continue;
      const float gap = other->cost - own->cost - excess;
      choice.gap = std::min(choice.gap, gap);
      choice.ratio = std::min(choice.ratio, gap / changes_.cost(own->mask, other->mask));
    }
  }
  return choice.gap >= 0.f ? choice : chooseAmongAll(frame);
}

// The same by all sets, of the levels that choose() has made.
Choice PathFinder::chooseAmongAll(Index frame) {
  FrameSets& sets = one_;
  combineLevels(sets);
  evaluate(sets, frame, sets.size() - 1);
  std::size_t best = sets.findCheapest();
  while (!sets.is_known[best]) {
    evaluate(sets, frame, best);
    best = sets.findCheapest();
  }
  found_.missing.col(frame) = findMissing(frame, sets.mask[best]);
  Choice choice = {sets.mask[best], std::numeric_limits<float>::infinity(), 0.f};
  choice.ratio = choice.gap;
  for (std::size_t other = 0; other < sets.size(); ++other) {
    if (other == best) continue;
    const float gap = sets.total(other) - sets.total(best);
    choice.gap = std::min(choice.gap, gap);
    choice.ratio = std::min(choice.ratio, gap / changeOf(choice.set, sets.mask[other]));
  }
  return choice;
}

// Whether a path may leave a set and come back to it, and be elsewhere in a frame, if another set
// costs so much more in each frame: the sum over all beginnings and ends of such a detour.
bool PathFinder::isDetourProbable(Index frame, float gap) const {
  const double change = partOf(duration(frame)) * std::exp(-double(changes_.least()));
  const double stay = std::exp(-double(gap));
  const double end = change / (1. - stay);
  return !(stay * end * end < std::exp(-double(kImprobable)));
}

// Writes the sets of the frames that every cheapest path passes, and says which these are.
//
// Where frames have the same cheapest set Y, one after the other, paths that are once in Y stay
// there: each other set costs more, and changes are a metric, so that it is no longer to go to Y at
// the first frame and to leave it at the last. A path that is in other sets all the time saves two
// times the change from the closest of them to Y at most. So if the sum over the frames of how much
// more others cost, by the cost of that change, is 2 and more, all cheapest paths are in Y. Certain
// is where in addition other sets are not probable: far from both ends, and not worth a detour.
std::vector<bool> PathFinder::chooseCertain() {
  const auto frames = static_cast<std::size_t>(time_.size());
  std::vector<bool> certain(frames, false);
  std::vector<Choice> choices;  // since the cheapest set has been the same
  for (std::size_t frame = 0; frame < frames; ++frame) {
    const Choice choice = choose(Index(frame));
    found_.sets[frame] = choice.set;
    if (!choices.empty() && choices.back().set != choice.set) {
      markCertain(frame - choices.size(), choices, certain);
      choices.clear();
    }
    choices.push_back(choice);
  }
  markCertain(frames - choices.size(), choices, certain);
  return certain;
}

// Says which of the frames that have the same cheapest set are certain.
void PathFinder::markCertain(std::size_t first, const std::vector<Choice>& choices,
                             std::vector<bool>& certain) {
  float ratio = 0.f;
  for (const Choice& choice : choices) ratio += choice.ratio;
  if (!(ratio >= 2.f)) return;
  float since = 0.f, until = 0.f;
  for (std::size_t k = 0; k < choices.size(); ++k) {
    const float gap = choices[k].gap;
    certain[first + k] = (since += gap) >= kImprobable && !isDetourProbable(Index(first + k), gap);
  }
  for (std::size_t k = choices.size(); k-- > 0 && until < kImprobable;)
    if ((until += choices[k].gap) < kImprobable) certain[first + k] = false;
  for (std::size_t k = 0; k < choices.size(); ++k)
    if (certain[first + k]) forget(Index(first + k));
}

// Finds the path through frames that are not certain, from and to those around them.
void PathFinder::findBetween(Index first, Index behind) {
  const Index from = std::max<Index>(first - 1, 0), to = std::min(behind + 1, time_.size());
  const auto count = static_cast<std::size_t>(to - from);
  if (between_.size() < count) between_.resize(count);
  for (Index frame = from; frame < to; ++frame) {
    FrameSets& sets = between_[static_cast<std::size_t>(frame - from)];
    if (first <= frame && frame < behind) {
      makeSets(frame, sets);
      continue;
    }
    sets.levels.resize(limbs_.size());
    for (std::size_t limb = 0; limb < limbs_.size(); ++limb)
      sets.levels[limb].assign(
          1, {found_.sets[static_cast<std::size_t>(frame)] & limb_masks_[limb], 0.f});
    sets.mask.assign(1, found_.sets[static_cast<std::size_t>(frame)]);
    sets.cost.assign(1, 0.f);
    sets.missing.assign(1, 0.f);
    sets.is_known.assign(1, true);
  }

  for (std::size_t k = 1; k < count; ++k)
    findChanges(between_[k - 1], from + Index(k), between_[k]);

  const auto forEach = [&](const auto& act) {
    for (Index frame = first; frame < behind; ++frame)
      act(between_[static_cast<std::size_t>(frame - from)], frame);
  };
  std::vector<std::size_t> path;
  for (bool is_done = false; !is_done;) {
    path = findCheapestPath(count);
    is_done = true;
    forEach([&](FrameSets& sets, Index frame) {
      if (refine(sets, frame, path[static_cast<std::size_t>(frame - from)])) is_done = false;
    });
  }
  forEach([&](FrameSets& sets, Index frame) {
    const Mask set = sets.mask[path[static_cast<std::size_t>(frame - from)]];
    found_.sets[static_cast<std::size_t>(frame)] = set;
    found_.missing.col(frame) = findMissing(frame, set);
  });

  while (findProbability(from, to)) continue;
  for (Index frame = first; frame < behind; ++frame) forget(frame);
}

void PathFinder::findChanges(const FrameSets& before, Index frame, FrameSets& sets) const {
  const auto part = float(partOf(time_[frame] - time_[frame - 1]));
  sets.changes.resize(limbs_.size());
  for (std::size_t limb = 0; limb < limbs_.size(); ++limb) {
    LimbChanges& changes = sets.changes[limb];
    changes.cost.clear();
    changes.probability.clear();
    for (const Level& to : sets.levels[limb])
      for (const Level& from : before.levels[limb]) {
        changes.cost.push_back(changes_.cost(from.mask, to.mask));
        changes.probability.push_back(
            from.mask == to.mask ? 1.f : part * changes_.probability(from.mask, to.mask));
      }
  }
}

// Computes what a set is missing, and if that is something, what those are that may be better; says
// whether that was new.
bool PathFinder::refine(FrameSets& sets, Index frame, std::size_t number) {
  if (sets.is_known[number]) return false;
  evaluate(sets, frame, number);
  if (sets.missing[number] <= negligible(frame)) return true;
  if (!sets.is_known.back()) evaluate(sets, frame, sets.size() - 1);
  for (std::size_t other = sets.size(); other-- > 0;) {
    if (sets.is_known[other]) continue;
    if (sets.total(other) < sets.total(number)) evaluate(sets, frame, other);
  }
  return true;
}

// Viterbi's recursion over the first of between_. From one frame's sets to the next's limb by limb,
// since what changes cost is a sum over limbs: digits below the limb's are of the later frame
// already, those above it still of the earlier one.
std::vector<std::size_t> PathFinder::findCheapestPath(std::size_t count) {
  if (origins_.size() < count) origins_.resize(count);
  std::vector<float> value, next;
  std::vector<std::uint16_t> origin, next_origin;
  for (std::size_t k = 0; k < count; ++k) {
    const FrameSets& sets = between_[k];
    if (k == 0) {
      value.assign(sets.size(), 0.f);
    } else {
      origin.resize(value.size());
      std::iota(origin.begin(), origin.end(), std::uint16_t(0));
      const FrameSets& before = between_[k - 1];
      std::size_t below = 1, above = before.size();
      for (std::size_t limb = 0; limb < sets.levels.size(); ++limb) {
        const std::size_t from = before.levels[limb].size(), to = sets.levels[limb].size();
        above /= from;
        next.resize(below * to * above);
        next_origin.resize(next.size());
        for (std::size_t high = 0; high < above; ++high)
          for (std::size_t j = 0; j < to; ++j)
            for (std::size_t low = 0; low < below; ++low) {
              const float* const change = sets.changes[limb].cost.data() + j * from;
              const std::size_t first = high * from * below + low;
              const std::size_t target = (high * to + j) * below + low;
              float least = std::numeric_limits<float>::infinity();
              std::size_t source = first;
              for (std::size_t i = 0; i < from; ++i) {
                const float candidate = value[first + i * below] + change[i];
                if (!(candidate < least)) continue;
                least = candidate;
                source = first + i * below;
              }
              next[target] = least;
              next_origin[target] = origin[source];
            }
        value.swap(next);
        origin.swap(next_origin);
        below *= to;
      }
      origins_[k] = origin;
    }
    for (std::size_t number = 0; number < sets.size(); ++number)
      value[number] += sets.total(number);
    const float least = *std::min_element(value.begin(), value.end());
    for (float& number : value) number -= least;
  }
  std::vector<std::size_t> path(count);
  path[count - 1] = std::size_t(std::min_element(value.begin(), value.end()) - value.begin());
  for (std::size_t k = count; --k > 0;) path[k - 1] = origins_[k][path[k]];
  return path;
}

// The forward-backward recursion over the same costs, taken for negative logarithms of
// probabilities; of the frames in between_, the first of which is given. Computes what sets are
// missing that are probable; says whether there was any.
bool PathFinder::findProbability(Index first, Index behind) {
  const auto count = static_cast<std::size_t>(behind - first);
  if (forward_.size() < count) forward_.resize(count);
  for (std::size_t k = 0; k < count; ++k) {
    FrameSets& sets = between_[k];
    const float least = sets.total(sets.findCheapest());
    sets.likelihood.resize(sets.size());
    for (std::size_t number = 0; number < sets.size(); ++number)
      sets.likelihood[number] = std::exp(least - sets.total(number));
  }
  const auto weigh = [](std::vector<float>& value, const FrameSets& sets) {
    float sum = 0.f;
    for (std::size_t number = 0; number < sets.size(); ++number)
      sum += value[number] *= sets.likelihood[number];
    if (sum > 0.f)
      for (float& number : value) number /= sum;
    else
      std::fill(value.begin(), value.end(), 1.f / float(value.size()));
  };
  std::vector<float> next;
  const auto move = [&](std::vector<float>& value, std::size_t k, std::size_t to_k) {
    const FrameSets &before = between_[k], &after = between_[to_k];
    const bool is_forward = k < to_k;
    std::size_t below = 1, above = before.size();
    for (std::size_t limb = 0; limb < after.levels.size(); ++limb) {
      const std::size_t from = before.levels[limb].size(), to = after.levels[limb].size();
      const float* const factors = between_[std::max(k, to_k)].changes[limb].probability.data();
      const std::size_t from_step = is_forward ? 1 : to, to_step = is_forward ? from : 1;
      above /= from;
      next.resize(below * to * above);
      for (std::size_t high = 0; high < above; ++high)
        for (std::size_t j = 0; j < to; ++j)
          for (std::size_t low = 0; low < below; ++low) {
            const std::size_t first = high * from * below + low;
            float sum = 0.f;
            for (std::size_t i = 0; i < from; ++i)
              sum += factors[j * to_step + i * from_step] * value[first + i * below];
            next[(high * to + j) * below + low] = sum;
          }
      value.swap(next);
      below *= to;
    }
  };
  for (std::size_t k = 0; k < count; ++k) {
    std::vector<float>& value = forward_[k];
    if (k == 0) {
      value.assign(between_[0].size(), 1.f);
    } else {
      value = forward_[k - 1];
      move(value, k - 1, k);
    }
    weigh(value, between_[k]);
  }
  bool is_new = false;
  std::vector<float> backward;
  for (std::size_t k = count; k-- > 0;) {
    FrameSets& sets = between_[k];
    if (k + 1 == count) {
      backward.assign(sets.size(), 1.f);
    } else {
      weigh(backward, between_[k + 1]);
      move(backward, k + 1, k);
    }
    float sum = 0.f;
    for (std::size_t number = 0; number < sets.size(); ++number)
      sum += forward_[k][number] * backward[number];
    if (!(sum > 0.f)) continue;
    const Index frame = first + Index(k);
    auto probability = found_.probability.col(frame);
    probability.setZero();
    for (std::size_t number = 0; number < sets.size(); ++number) {
      const float value = forward_[k][number] * backward[number] / sum;
      for (Mask rest = sets.mask[number]; rest != 0; rest &= rest - 1)
        probability[__builtin_ctz(rest)] += double(value);
      if (value > kProbable && !sets.is_known[number]) {
        evaluate(sets, frame, number);
        is_new = true;
      }
    }
    probability = probability.cwiseMin(1.);
  }
  return is_new;
}

}  // namespace

SchedulePath findSchedulePath(const std::vector<PointTrack>& points,
                              const std::vector<Rests>& rests, const CostScales& scales,
                              const WrenchTrack& wrench, double weight, const Eigen::VectorXd& time,
                              const DetectionSettings& settings, const KnownContacts* known,
                              const PathPieces& pieces) {
  return PathFinder(points, rests, scales, wrench, weight, time, settings, known, pieces).find();
}

}  // namespace dynacom::internal
