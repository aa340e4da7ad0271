// SPDX-License-Identifier: BSD-2-Clause
#include "ground_slope.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace dynacom::internal {

namespace {

using Eigen::Index;
using Members = std::vector<std::size_t>;  // footings, in their order

// Fewer points do not show that they lie in a plane.
constexpr double kPoints = 6.;
// And feet that are tilted, all alike, do not show that the ground is: points must be this far
// apart along the slope [m].
constexpr double kExtent = 0.5;
// A plane is a slope from this gradient on, one degree, and this difference of heights [m], if no
// point is farther from it than this [m], and than this part of the difference.
constexpr double kGradient = 0.01746, kRise = 0.02, kOff = 0.02, kOffPart = 0.2;
// Points that are closer together in some direction say nothing of the ground's gradient there: the
// standard deviation of their places [m].
constexpr double kNarrow = 0.02;
// What a footing is off costs 1 at this root mean square [m].
constexpr double kScatter = 0.007;
// What a level costs that is stood on, what a slope costs, and what a footing costs at the most:
// one alone, whose tilt is whatever, pays for no slope.
constexpr double kLevel = 2., kSlope = 8., kUnknown = 6.;
// A slope must save so much for each footing of the neighbours that it is first seen in: who walks
// where it is level stands a bit better on a plane than on a level, but by less.
constexpr double kSeen = 0.3;
// Of the soles that are tilted like a slope, such a part must be on one: feet that are tilted
// wherever they stand rise and fall from step to step at times as if they were on slopes.
constexpr double kTilted = 0.7;
// How often planes are fitted to what they explain, which then may be more or less.
constexpr int kRounds = 3;
// Levels that differ by more are never one [m].
constexpr double kOneLevel = 0.05;

double square(double value) { return value * value; }

struct Plane {
  Eigen::Vector3d through;
  Eigen::Vector2d gradient;

  double findOff(const Eigen::Vector3d& point) const {
    return point.z() - through.z() - gradient.dot((point - through).head<2>());
  }
};

// The points of a footing or of more, summed up.
struct Moments {
  double count = 0.;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();  // sum of squares about the mean

  void add(const Moments& other) {
    const Eigen::Vector3d between = other.mean - mean;
    const double all = count + other.count;
    scatter += other.scatter + count * other.count / all * between * between.transpose();
    mean += other.count / all * between;
    count = all;
  }
  // The mean square of what points are off a plane through their mean.
  double findTilt(const Eigen::Vector2d& gradient) const {
    const Eigen::Vector3d down(-gradient.x(), -gradient.y(), 1.);
    return std::max(down.dot(scatter * down), 0.) / count;
  }
  // Whether they are closer to such a gradient than to a level.
  bool isTilted(const Eigen::Vector2d& gradient) const {
    return findTilt(gradient) < 0.25 * findTilt(Eigen::Vector2d::Zero());
  }
  double findCost(const Plane& plane) const {
    return (square(plane.findOff(mean)) + findTilt(plane.gradient)) / square(kScatter);
  }
  // That of least squares, of least gradient where points do not tell.
  Plane fit() const {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
    axes.computeDirect(scatter.topLeftCorner<2, 2>());
    Plane plane = {mean, Eigen::Vector2d::Zero()};
    for (Index k = 0; k < 2; ++k) {
      const Eigen::Vector2d axis = axes.eigenvectors().col(k);
      if (axes.eigenvalues()[k] > count * square(kNarrow))
        plane.gradient += axis * axis.dot(scatter.topRightCorner<2, 1>()) / axes.eigenvalues()[k];
    }
    return plane;
  }
};

Moments sumUp(const Footing& footing) {
  Moments sum;
  sum.count = double(footing.points.cols());
  sum.mean = footing.points.rowwise().mean();
  const Eigen::Matrix3Xd centred = footing.points.colwise() - sum.mean;
  sum.scatter = centred * centred.transpose();
  return sum;
}

class SlopeFinder {
 public:
  explicit SlopeFinder(const std::vector<Footing>& footings) : footings_(footings) {
    for (const Footing& footing : footings_) {
      contacts_ = std::max(contacts_, footing.contact + 1);
      moments_.push_back(sumUp(footing));
    }
    findLevelCosts();
  }

  std::vector<Eigen::Vector2d> find() {
    choose(findCandidates());
    assign();
    dropDoubtful();
    std::vector<Eigen::Vector2d> slopes(footings_.size(), Eigen::Vector2d::Zero());
    for (const Slope& slope : slopes_)
      for (const std::size_t k : slope.members) slopes[k] = slope.plane.gradient;
    return slopes;
  }

 private:
  struct Slope {
    Plane plane;
    Members members;
  };

  void findLevelCosts();
  std::vector<Members> makeGroups() const;
  Plane fit(const Members& members) const;
  bool isSlope(const Slope& slope) const;
  Members findMembers(const Slope& slope) const;
  double findSaved(const Slope& slope) const;
  std::vector<Slope> findCandidates() const;
  void choose(std::vector<Slope> candidates);
  void assign();
  void dropDoubtful();

  const std::vector<Footing>& footings_;
  std::size_t contacts_ = 0;
  std::vector<Moments> moments_;     // of each footing
  std::vector<double> level_costs_;  // of footings, if all ground were level
  std::vector<double> costs_;        // with slopes, as far as there are
  std::vector<Slope> slopes_;
};

// Of footings in the order of their heights, levels have those in a row. The cheapest ones are
// found from below.
void SlopeFinder::findLevelCosts() {
  const std::size_t count = footings_.size();
  Members order(count);
  std::iota(order.begin(), order.end(), 0);
  const auto height = [&](std::size_t k) { return moments_[order[k]].mean.z(); };
  std::sort(order.begin(), order.end(), [&](std::size_t one, std::size_t other) {
    return moments_[one].mean.z() < moments_[other].mean.z();
  });
  std::vector<double> least(count + 1, std::numeric_limits<double>::infinity());
  std::vector<std::size_t> first(count + 1);
  least[0] = 0.;
  for (std::size_t behind = 1; behind <= count; ++behind) {
    double sum = 0., squares = 0.;  // of heights, from the highest one on
    for (std::size_t k = behind; k-- > 0;) {
      const double off = height(k) - height(behind - 1);
      if (off < -kOneLevel) break;
      sum += off;
      squares += square(off);
      const double cost =
          least[k] + kLevel + (squares - square(sum) / double(behind - k)) / square(kScatter);
      if (cost < least[behind]) least[behind] = cost, first[behind] = k;
    }
  }
  level_costs_.resize(count);
  for (std::size_t behind = count; behind > 0; behind = first[behind]) {
    const auto size = double(behind - first[behind]);
    double mean = 0.;
    for (std::size_t k = first[behind]; k < behind; ++k) mean += height(k) / size;
    for (std::size_t k = first[behind]; k < behind; ++k) {
      const Moments& own = moments_[order[k]];
      const Plane level = {{0., 0., mean}, Eigen::Vector2d::Zero()};
      level_costs_[order[k]] = std::min(kLevel / size + own.findCost(level), kUnknown);
    }
  }
  costs_ = level_costs_;
}

// Footings that may lie in one plane: all, and neighbours in time, of all contacts and of one.
std::vector<Members> SlopeFinder::makeGroups() const {
  std::vector<Members> groups;
  Members all(footings_.size());
  std::iota(all.begin(), all.end(), 0);
  const auto add = [&](const Members& sequence, std::size_t size) {
    for (std::size_t k = 0; k + size <= sequence.size(); ++k)
      groups.emplace_back(sequence.begin() + std::ptrdiff_t(k),
                          sequence.begin() + std::ptrdiff_t(k + size));
  };
  for (const std::size_t size : {3, 6}) add(all, size);
  for (std::size_t contact = 0; contact < contacts_; ++contact) {
    Members own;
    for (const std::size_t k : all)
      if (footings_[k].contact == contact) own.push_back(k);
    for (const std::size_t size : {2, 3}) add(own, size);
  }
  groups.insert(groups.begin(), all);
  return groups;
}

Plane SlopeFinder::fit(const Members& members) const {
  Moments sum;
  for (const std::size_t k : members) sum.add(moments_[k]);
  return sum.fit();
}

bool SlopeFinder::isSlope(const Slope& slope) const {
  const Eigen::Vector2d& gradient = slope.plane.gradient;
  if (!(gradient.norm() >= kGradient)) return false;
  constexpr double inf = std::numeric_limits<double>::infinity();
  double low = inf, high = -inf, begin = inf, end = -inf, off = 0., points = 0.;
  for (const std::size_t k : slope.members) {
    // A sole that is level, rather than tilted as the plane is, shows no more than a point does.
    points += moments_[k].isTilted(gradient) ? moments_[k].count : 1.;
    for (const auto point : footings_[k].points.colwise()) {
      off = std::max(off, std::abs(slope.plane.findOff(point)));
      low = std::min(low, point.z());
      high = std::max(high, point.z());
      const double along = gradient.dot(point.head<2>()) / gradient.norm();
      begin = std::min(begin, along);
      end = std::max(end, along);
    }
  }
  return points >= kPoints && end - begin >= kExtent && high - low > kRise &&
         off <= std::min(kOff, kOffPart * (high - low));
}

// The footings that a plane explains at less than they cost: from those that it was found by on, as
// long as one follows within a few. Planes have no end, and something lies near them far away, too.
Members SlopeFinder::findMembers(const Slope& slope) const {
  const auto reach = std::ptrdiff_t(2 * contacts_);
  const auto belongs = [&](std::ptrdiff_t number) {
    const auto k = static_cast<std::size_t>(number);
    if (!(moments_[k].findCost(slope.plane) < costs_[k])) return false;
    for (const auto point : footings_[k].points.colwise())
      if (!(std::abs(slope.plane.findOff(point)) <= kOff)) return false;
    return true;
  };
  const auto first = std::ptrdiff_t(slope.members.front());
  const auto last = std::ptrdiff_t(slope.members.back());
  Members members;
  for (auto k = first, missed = std::ptrdiff_t(0); k-- > 0 && missed < reach; ++missed)
    if (belongs(k)) members.push_back(std::size_t(k)), missed = -1;
  std::reverse(members.begin(), members.end());
  for (auto k = first; k <= last; ++k)
    if (belongs(k)) members.push_back(std::size_t(k));
  for (auto k = last + 1, missed = std::ptrdiff_t(0);
       k < std::ptrdiff_t(footings_.size()) && missed < reach; ++k, ++missed)
    if (belongs(k)) members.push_back(std::size_t(k)), missed = -1;
  return members;
}

double SlopeFinder::findSaved(const Slope& slope) const {
  double saved = -kSlope;
  for (const std::size_t k : slope.members)
    saved += std::max(costs_[k] - moments_[k].findCost(slope.plane), 0.);
  return saved;
}

// Slopes that pay, one at least for each group that lies in one.
std::vector<SlopeFinder::Slope> SlopeFinder::findCandidates() const {
  std::vector<Slope> candidates;
  // More than all of this is not to be saved.
  if (std::accumulate(costs_.begin(), costs_.end(), 0.) <= kSlope) return candidates;
  std::vector<double> least = costs_;  // with the candidates so far
  for (const Members& group : makeGroups()) {
    Slope slope = {fit(group), group};
    double saved = 0.;
    for (const std::size_t k : group) saved += least[k] - moments_[k].findCost(slope.plane);
    if (group.size() < footings_.size() && !(saved > kSeen * double(group.size()))) continue;
    for (int round = 0; round < kRounds && !slope.members.empty(); ++round) {
      slope.members = findMembers(slope);
      slope.plane = fit(slope.members);
    }
    if (slope.members.empty() || findSaved(slope) <= 0. || !isSlope(slope)) continue;
    for (const std::size_t k : slope.members)
      least[k] = std::min(least[k], moments_[k].findCost(slope.plane));
    candidates.push_back(std::move(slope));
  }
  return candidates;
}

// Takes the slope that saves most, as long as there is one.
void SlopeFinder::choose(std::vector<Slope> candidates) {
  while (!candidates.empty()) {
    const auto best = std::max_element(
        candidates.begin(), candidates.end(),
        [&](const Slope& one, const Slope& other) { return findSaved(one) < findSaved(other); });
    if (findSaved(*best) <= 0.) return;
    for (const std::size_t k : best->members)
      costs_[k] = std::min(costs_[k], moments_[k].findCost(best->plane));
    slopes_.push_back(std::move(*best));
    candidates.erase(best);
  }
}

// Gives each footing what explains it best, and fits the slopes to what they have; those that are
// none then are left.
void SlopeFinder::assign() {
  for (int round = 0; round < kRounds; ++round) {
    costs_ = level_costs_;
    std::vector<int> owner(footings_.size(), -1);
    for (std::size_t number = 0; number < slopes_.size(); ++number)
      for (const std::size_t k : findMembers(slopes_[number])) {
        costs_[k] = moments_[k].findCost(slopes_[number].plane);
        owner[k] = static_cast<int>(number);
      }
    for (Slope& slope : slopes_) slope.members.clear();
    for (std::size_t k = 0; k < owner.size(); ++k)
      if (owner[k] >= 0) slopes_[static_cast<std::size_t>(owner[k])].members.push_back(k);
    for (Slope& slope : slopes_) slope.plane = fit(slope.members);
    slopes_.erase(std::remove_if(slopes_.begin(), slopes_.end(),
                                 [&](const Slope& slope) { return !isSlope(slope); }),
                  slopes_.end());
  }
}

// Leaves slopes whose tilt soles have as well where there is no slope.
void SlopeFinder::dropDoubtful() {
  const auto isDoubtful = [&](const Slope& slope) {
    std::vector<bool> tilted(footings_.size());
    double all = 0., here = 0.;
    for (std::size_t k = 0; k < tilted.size(); ++k)
      if ((tilted[k] = moments_[k].isTilted(slope.plane.gradient))) ++all;
    for (const Slope& other : slopes_)
      for (const std::size_t k : other.members)
        if (tilted[k]) ++here;
    return here < kTilted * all;
  };
  for (std::size_t number = 0; number < slopes_.size();) {
    if (isDoubtful(slopes_[number])) {
      slopes_.erase(slopes_.begin() + std::ptrdiff_t(number));
      number = 0;
    } else {
      ++number;
    }
  }
}

}  // namespace

std::vector<Eigen::Vector2d> findGroundSlopes(const std::vector<Footing>& footings) {
  if (footings.empty()) return {};
  return SlopeFinder(footings).find();
}

}  // namespace dynacom::internal
