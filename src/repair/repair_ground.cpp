// SPDX-License-Identifier: BSD-2-Clause
#include <algorithm>
#include <cmath>

#include "../check.hpp"
#include "../nan.hpp"
#include "dynacom/motion_repair.hpp"
#include "dynacom/terrain.hpp"

namespace dynacom {

using Eigen::Index;

namespace {

struct Rest {
  double height, duration;
};

// The stances of the lowest parts of what stands on the flat.
std::vector<Rest> listRests(const std::vector<PartRobot::Part>& parts,
                            const ContactInference& inference, const Eigen::VectorXd& time) {
  std::vector<Rest> rests;
  const auto stands = [&](const Stance& stance) {
    return stance.on_ground && stance.slope.isZero(0.) &&
           inference.schedule.active.row(Index(stance.part))
               .segment(stance.first, stance.behind - stance.first)
               .any();
  };
  for (const Stance& stance : inference.stances) {
    if (!stands(stance)) continue;
    const bool is_lowest =
        std::none_of(inference.stances.begin(), inference.stances.end(), [&](const Stance& other) {
          return other.height < stance.height &&
                 parts[other.part].contact == parts[stance.part].contact &&
                 other.first < stance.behind && stance.first < other.behind && stands(other);
        });
    if (is_lowest) rests.push_back({stance.height, time[stance.behind - 1] - time[stance.first]});
  }
  std::sort(rests.begin(), rests.end(),
            [](const Rest& one, const Rest& other) { return one.height < other.height; });
  return rests;
}

double findMedian(std::vector<Rest>::const_iterator first,
                  std::vector<Rest>::const_iterator behind) {
  double sum = 0., half = 0.;
  for (auto rest = first; rest != behind; ++rest) half += 0.5 * rest->duration;
  for (auto rest = first; rest != behind; ++rest)
    if ((sum += rest->duration) >= half) return rest->height;
  return (behind - 1)->height;
}

// Levels on which something rests for a while; where something is at rest for a moment only, the
// ground may be elsewhere.
std::vector<double> findLevels(const std::vector<Rest>& rests) {
  constexpr double kLeastShare = 0.02;
  const auto sum = [](auto first, auto behind) {
    double duration = 0.;
    for (; first != behind; ++first) duration += first->duration;
    return duration;
  };
  const double all = sum(rests.begin(), rests.end());
  std::vector<double> levels;
  for (auto first = rests.begin(); first != rests.end();) {
    const auto behind = std::find_if(first, rests.end(), [&](const Rest& rest) {
      return rest.height - first->height > kSameLevel;
    });
    if (sum(first, behind) >= kLeastShare * all) levels.push_back(findMedian(first, behind));
    first = behind;
  }
  return levels;
}

// The level that is as high; NaN if none is.
double findLevel(const std::vector<double>& levels, double height) {
  for (const double level : levels)
    if (std::abs(height - level) <= kSameLevel) return level;
  return internal::kNaN;
}

// Of a contact that stands on the flat, the lowest of the parts that carry tells where the ground
// is.
void levelContacts(const std::vector<PartRobot::Part>& parts, const ContactInference& inference,
                   Eigen::MatrixXd& ground) {
  for (Index frame = 0; frame < ground.cols(); ++frame)
    for (Index first = 0, behind = 0; first < ground.rows(); first = behind) {
      const std::size_t contact = parts[std::size_t(first)].contact;
      double lowest = internal::kNaN;
      for (; behind < ground.rows() && parts[std::size_t(behind)].contact == contact; ++behind)
        if (inference.schedule.active(behind, frame) && !std::isnan(ground(behind, frame)) &&
            !(ground(behind, frame) >= lowest))
          lowest = ground(behind, frame);
      for (Index part = first; part < behind; ++part)
        if (inference.schedule.active(part, frame))
          ground(part, frame) =
              inference.ground(part, frame) - lowest <= kSameLevel ? lowest : internal::kNaN;
    }
}

}  // namespace

RepairGround findRepairGround(const std::vector<PartRobot::Part>& parts,
                              const ContactInference& inference, const Eigen::VectorXd& time) {
  const Index frames = time.size();
  internal::requireSize("inference", inference.ground.rows(), Index(parts.size()), "parts");
  internal::requireSize("inference", inference.ground.cols(), frames, "frames");
  internal::requireSize("inference", inference.schedule.active.rows(), Index(parts.size()),
                        "parts");
  internal::requireSize("inference", inference.schedule.active.cols(), frames, "frames");
  const std::vector<Rest> rests = listRests(parts, inference, time);
  const std::vector<double> levels = findLevels(rests);
  RepairGround ground = {inference.ground, inference.ground_velocity};
  for (double& height : ground.height.reshaped()) height = findLevel(levels, height);
  levelContacts(parts, inference, ground.height);
  for (const Stance& stance : inference.stances)
    if (!stance.slope.isZero(0.))
      ground.height.row(Index(stance.part)).segment(stance.begin, stance.end - stance.begin) =
          inference.ground.row(Index(stance.part)).segment(stance.begin, stance.end - stance.begin);
  return ground;
}

}  // namespace dynacom
