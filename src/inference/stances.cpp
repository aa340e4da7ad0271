// SPDX-License-Identifier: BSD-2-Clause
#include "stances.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

namespace dynacom::internal {

namespace {

using Eigen::Index;

// A normal distribution's standard deviation, in medians of absolute deviations.
constexpr double kDeviation = 1.4826;
// How fast a point gets, as a quantile of its speeds.
constexpr double kFast = 0.95;

double quantile(std::vector<double>& values, double part) {
  const auto nth = values.begin() + std::lround(part * double(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

// Speeds as rests see them.
Eigen::VectorXd findSpeeds(const PointTrack& point, double horizontal_part) {
  return (point.velocity.row(2).array().square() +
          horizontal_part * horizontal_part *
              point.velocity.topRows<2>().colwise().squaredNorm().array())
      .sqrt();
}

using Frames = Eigen::Array<bool, Eigen::Dynamic, 1>;

Frames findCounting(const std::vector<PointTrack>& points, const Eigen::VectorXd& time,
                    const DetectionSettings& settings) {
  const Index frames = time.size();
  Frames moves = Frames::Constant(frames, false), stirs = moves;
  for (const PointTrack& point : points) {
    const auto speed = point.velocity.colwise().norm().transpose().array();
    moves = moves || speed > settings.moving_speed;
    stirs = stirs || speed > settings.stir_speed;
  }
  if (!stirs.any()) return Frames::Constant(frames, true);
  if (!moves.any()) return stirs;
  Frames counts = Frames::Constant(frames, false);
  double last = -std::numeric_limits<double>::infinity();
  for (Index frame = 0; frame < frames; ++frame) {
    if (moves[frame]) last = time[frame];
    if (time[frame] - last <= settings.near_movement) counts[frame] = stirs[frame];
  }
  last = std::numeric_limits<double>::infinity();
  for (Index frame = frames; frame-- > 0;) {
    if (moves[frame]) last = time[frame];
    if (last - time[frame] <= settings.near_movement) counts[frame] = stirs[frame];
  }
  return counts;
}

// Its height is that of the frames that count, if there are any.
Rest makeRest(const PointTrack& point, const Frames& counts, Index first, Index behind) {
  std::vector<double> heights;
  for (const bool all : {false, true}) {
    for (Index frame = first; frame < behind; ++frame)
      if (all || counts[frame]) heights.push_back(point.position(2, frame));
    if (!heights.empty()) break;
  }
  return {first, behind, quantile(heights, 0.5), false};
}

// Where a point is slow for long enough.
std::vector<Rest> findRuns(const PointTrack& point, const Frames& counts,
                           const Eigen::VectorXd& speed, const Eigen::VectorXd& time, double slow,
                           double duration) {
  std::vector<Rest> rests;
  const Index frames = time.size();
  for (Index first = 0, behind = 0; first < frames; first = behind + 1) {
    behind = first;
    while (behind < frames && speed[behind] < slow) ++behind;
    if (behind == first) continue;
    const double step = frames > 1 ? (time[frames - 1] - time[0]) / double(frames - 1) : 0.;
    // By a little less, because times are rounded.
    if (time[behind - 1] - time[first] + 1.01 * step >= duration || behind - first == frames)
      rests.push_back(makeRest(point, counts, first, behind));
  }
  return rests;
}

// Makes one of neighbours that are the same rest. While it grows, its height is that of when it was
// at least this part as long: medians of all frames for each neighbour would take too long.
constexpr double kStillItsHeight = 0.8;

void mergeRests(const PointTrack& point, const Frames& counts, const Eigen::VectorXd& speed,
                double not_much_faster, double same, std::vector<Rest>& rests) {
  std::vector<Rest> merged;
  Index measured = 0;  // until where the last one's height is known
  const auto measure = [&] {
    if (!merged.empty() && merged.back().behind != measured)
      merged.back() = makeRest(point, counts, merged.back().first, merged.back().behind);
  };
  for (const Rest& rest : rests) {
    if (!merged.empty()) {
      Rest& last = merged.back();
      const Index between = rest.first - last.behind;
      const double fastest = between > 0 ? speed.segment(last.behind, between).maxCoeff() : 0.;
      if (fastest < not_much_faster && std::abs(rest.height - last.height) <= same) {
        last.behind = rest.behind;
        if (double(measured - last.first) < kStillItsHeight * double(last.behind - last.first)) {
          measure();
          measured = last.behind;
        }
        continue;
      }
    }
    measure();
    merged.push_back(rest);
    measured = rest.behind;
  }
  measure();
  rests.swap(merged);
}

// Until it is fastest between two rests, a point belongs to the first.
std::vector<int> findOwners(const std::vector<Rest>& rests, const Eigen::VectorXd& speed) {
  std::vector<int> owner(static_cast<std::size_t>(speed.size()), -1);
  Index first = 0;
  for (std::size_t k = 0; k < rests.size(); ++k) {
    Index behind = speed.size();
    if (k + 1 < rests.size()) {
      const Index from = rests[k].behind, between = rests[k + 1].first - from;
      Index fastest = 0;
      if (between > 0) speed.segment(from, between).maxCoeff(&fastest);
      behind = from + fastest;
    }
    std::fill(owner.begin() + first, owner.begin() + behind, static_cast<int>(k));
    first = behind;
  }
  return owner;
}

// Whether a point was so high above a rest since it was last as low, or will be until it is as low
// again.
bool rises(const PointTrack& point, const std::vector<Rest>& rests, std::size_t k, int direction,
           double same, double rise) {
  const double height = rests[k].height;
  for (auto other = std::ptrdiff_t(k);; other += direction) {
    // From one rest to the next one in this direction, or the end of the motion.
    const auto next = other + direction;
    const bool ends = next < 0 || next == std::ptrdiff_t(rests.size());
    const Rest& rest = rests[static_cast<std::size_t>(other)];
    Index from, behind;
    if (direction > 0) {
      from = rest.behind;
      behind = ends ? point.position.cols() : rests[static_cast<std::size_t>(next)].first;
    } else {
      from = ends ? 0 : rests[static_cast<std::size_t>(next)].behind;
      behind = rest.first;
    }
    if (behind > from &&
        point.position.row(2).segment(from, behind - from).maxCoeff() >= height + rise)
      return true;
    if (ends || rests[static_cast<std::size_t>(next)].height <= height + same) return false;
    if (rests[static_cast<std::size_t>(next)].height >= height + rise) return true;
  }
}

// Velocities of which the ground may have one are counted in squares of this size [m/s].
constexpr double kVelocityStep = 0.1;
// Low is what is no higher than this above a point's lowest place, but for the lowest twentieth
// [m].
constexpr double kLow = 0.03, kLowest = 0.05;
// The ground moves if its velocity is this many times as frequent as rest, in a part of the frames.
constexpr double kMoreFrequent = 3., kFrequent = 0.1;
// Velocities around one count as that one if they are more than this part of those of low points.
constexpr double kMostOfLow = 0.5;

// Puts on the ground where points rest while their contact is known to be active, if they are about
// as low as its lowest one.
void standWhereKnown(const std::vector<PointTrack>& points, const KnownContacts& known,
                     double same_ground, std::vector<Rests>& all) {
  for (std::size_t contact = 0; contact < known.masks.size(); ++contact) {
    const auto active = known.active.row(Index(contact));
    for (std::size_t k = 0; k < points.size(); ++k) {
      if (!(known.masks[contact] >> k & 1u)) continue;
      for (Rest& rest : all[k].list) {
        const Index size = rest.behind - rest.first;
        if (!active.segment(rest.first, size).any()) continue;
        double lowest = std::numeric_limits<double>::infinity();
        for (std::size_t other = 0; other < points.size(); ++other)
          if (known.masks[contact] >> other & 1u)
            lowest =
                std::min(lowest, points[other].position.row(2).segment(rest.first, size).mean());
        if (rest.height <= lowest + same_ground) rest.on_ground = true;
      }
    }
  }
}

}  // namespace

Eigen::Vector3d findGroundVelocity(const std::vector<PointTrack>& points) {
  std::map<std::pair<long, long>, std::vector<Eigen::Vector2d>> squares;
  Index all = 0, low_points = 0;
  for (const PointTrack& point : points) {
    if (point.is_body) continue;
    const Index frames = point.position.cols();
    all += frames;
    if (frames == 0) continue;
    std::vector<double> heights(static_cast<std::size_t>(frames));
    for (Index frame = 0; frame < frames; ++frame)
      heights[static_cast<std::size_t>(frame)] = point.position(2, frame);
    const double low = quantile(heights, kLowest) + kLow;
    for (Index frame = 0; frame < frames; ++frame) {
      const Eigen::Vector3d velocity = point.velocity.col(frame);
      if (point.position(2, frame) > low || std::abs(velocity.z()) > kVelocityStep) continue;
      ++low_points;
      squares[{std::lround(velocity.x() / kVelocityStep),
               std::lround(velocity.y() / kVelocityStep)}]
          .push_back(velocity.head<2>());
    }
  }
  using Square = std::pair<long, long>;
  const auto forEachAround = [&](const Square& square, const auto& act) {
    for (long x = -1; x <= 1; ++x)
      for (long y = -1; y <= 1; ++y) {
        const auto found = squares.find({square.first + x, square.second + y});
        if (found != squares.end()) act(found->second);
      }
  };
  // Who runs rolls over its feet, at velocities that scatter over the squares around the ground's,
  // but no others are as frequent. Rest is among those around slow ones.
  Square mode;
  std::size_t most = 0;
  for (const auto& [square, velocities] : squares) {
    const bool is_slow = std::max(std::abs(square.first), std::abs(square.second)) <= 1;
    std::size_t size = velocities.size(), around = 0;
    if (!is_slow) forEachAround(square, [&](const auto& others) { around += others.size(); });
    if (double(around) > kMostOfLow * double(low_points)) size = around;
    if (size <= most) continue;
    most = size;
    mode = square;
  }
  const auto at_rest = static_cast<double>(squares[{0, 0}].size());
  Eigen::Vector3d ground = Eigen::Vector3d::Zero();
  if (double(most) <= kMoreFrequent * at_rest || double(most) < kFrequent * double(all))
    return ground;
  for (int axis = 0; axis < 2; ++axis) {
    std::vector<double> values;
    forEachAround(mode, [&](const auto& around) {
      for (const Eigen::Vector2d& velocity : around) values.push_back(velocity[axis]);
    });
    ground[axis] = quantile(values, 0.5);
  }
  return ground;
}

std::vector<Rests> findRests(const std::vector<PointTrack>& points, const Eigen::VectorXd& time,
                             bool exact, const DetectionSettings& settings,
                             const KnownContacts* known) {
  // Where exact motions stand, nothing stirs, and all heights are the same.
  const Frames counts =
      exact ? Frames::Constant(time.size(), true) : findCounting(points, time, settings);
  std::vector<Rests> all(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const PointTrack& point = points[k];
    const Eigen::VectorXd speed = findSpeeds(point, settings.horizontal_part);
    std::vector<double> moving;
    for (Index frame = 0; frame < time.size(); ++frame)
      if (point.velocity.col(frame).norm() > settings.moving_speed) moving.push_back(speed[frame]);
    const double fast = moving.empty() ? 0. : quantile(moving, kFast);
    const double slow =
        std::clamp(settings.rest_speed_part * fast,
                   exact ? settings.exact_rest_speed_least : settings.rest_speed_least,
                   exact ? settings.exact_rest_speed_greatest : settings.rest_speed_greatest);
    std::vector<Rest>& rests = all[k].list;
    rests = findRuns(point, counts, speed, time, slow, settings.rest_duration);
    mergeRests(point, counts, speed, settings.same_rest_speed * slow, settings.same_rest, rests);
    all[k].owner = findOwners(rests, speed);
  }
  const double same_contact = exact ? settings.exact_same_ground : settings.same_ground;
  if (known) standWhereKnown(points, *known, same_contact, all);

  if (!std::isnan(settings.ground_height)) {
    for (Rests& rests : all)
      for (Rest& rest : rests.list) {
        const bool is_low = rest.height <= settings.ground_height + settings.same_ground;
        if (is_low) rest.height = settings.ground_height;
        rest.on_ground = rest.on_ground || is_low;
      }
    return all;
  }
  double lowest = std::numeric_limits<double>::infinity(), lowest_contact = lowest;
  std::vector<double> levels;
  for (std::size_t k = 0; k < points.size(); ++k)
    for (std::size_t i = 0; i < all[k].list.size(); ++i) {
      Rest& rest = all[k].list[i];
      lowest = std::min(lowest, rest.height);
      if (points[k].is_body) continue;
      lowest_contact = std::min(lowest_contact, rest.height);
      for (const int direction : {-1, 1})
        if (rises(points[k], all[k].list, i, direction, settings.same_rest,
                  settings.landing_height))
          rest.on_ground = true;
      if (rest.on_ground) levels.push_back(rest.height);
    }
  levels.push_back(lowest);
  // Links are pressed into the ground, too, and geometry is not exact.
  if (lowest_contact - lowest <= settings.body_ground) levels.push_back(lowest_contact);
  std::sort(levels.begin(), levels.end());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const double same = points[k].is_body ? settings.body_ground : same_contact;
    for (Rest& rest : all[k].list) {
      const auto level = std::lower_bound(levels.begin(), levels.end(), rest.height - same);
      if (level != levels.end() && *level <= rest.height + same) rest.on_ground = true;
    }
  }
  return all;
}

CostScales findScales(const std::vector<PointTrack>& points, const std::vector<Rests>& rests,
                      const Eigen::VectorXd& time, const DetectionSettings& settings) {
  const Frames counts = findCounting(points, time, settings);
  // Links tell only where no contact does: they roll.
  const auto tells = [&](std::size_t k, bool is_body) {
    const auto& list = rests[k].list;
    return points[k].is_body == is_body &&
           std::any_of(list.begin(), list.end(), [](const Rest& rest) { return rest.on_ground; });
  };
  bool bodies = true;
  for (std::size_t k = 0; k < points.size(); ++k) bodies = bodies && !tells(k, false);
  std::vector<double> scatter, speeds;
  for (std::size_t k = 0; k < points.size(); ++k)
    for (const Rest& rest : rests[k].list) {
      if (!rest.on_ground || points[k].is_body != bodies) continue;
      for (Index frame = rest.first; frame < rest.behind; ++frame) {
        if (!counts[frame]) continue;
        scatter.push_back(std::abs(points[k].position(2, frame) - rest.height));
        speeds.push_back(points[k].velocity.col(frame).norm());
      }
    }
  const auto scale = [](std::vector<double>& values, double part, double least, double greatest) {
    return values.empty() ? greatest : std::clamp(part * quantile(values, 0.5), least, greatest);
  };
  CostScales scales;
  scales.height =
      scale(scatter, kDeviation, settings.height_scale_least, settings.height_scale_greatest);
  scales.speed = scale(speeds, settings.speed_scale_part, settings.speed_scale_least,
                       settings.speed_scale_greatest);
  scales.force = std::clamp(settings.force_scale_part * scales.speed, settings.force_scale_least,
                            settings.force_scale_greatest);
  scales.torque = settings.lever * scales.force;
  return scales;
}

}  // namespace dynacom::internal
