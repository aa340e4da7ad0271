// SPDX-License-Identifier: BSD-2-Clause
#include "foot_measures.hpp"

#include <algorithm>

#include "../nan.hpp"

namespace dynacom::internal {

using Eigen::Index;

namespace {

std::size_t countParts(const MotionExamination& found, const MotionExamination& carrying) {
  return std::min(found.parts.size(), carrying.parts.size());
}

double measureDrift(const MotionExamination& found, const MotionExamination& carrying,
                    std::size_t part, const RepairedStance& stance) {
  const auto forEach = [&](const auto& act) {
    for (Index frame = stance.first; frame < stance.behind; ++frame)
      if (carrying.inference.schedule.active(Index(part), frame))
        act(Eigen::Vector3d(found.part_motions[part].position.col(frame) -
                            found.derived.motion.time[frame] * found.inference.ground_velocity));
  };
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  Index count = 0;
  forEach([&](const Eigen::Vector3d& place) {
    sum += place;
    ++count;
  });
  double drift = 0.;
  forEach([&](const Eigen::Vector3d& place) {
    drift = std::max(drift, (place - sum / double(count)).norm());
  });
  return drift;
}

}  // namespace

std::vector<double> measureDrifts(const MotionExamination& found, const MotionExamination& carrying,
                                  const std::vector<RepairedStance>& stances) {
  std::vector<double> drifts;
  for (const RepairedStance& stance : stances) {
    double& drift = drifts.emplace_back(0.);
    for (std::size_t part = 0; part < countParts(found, carrying); ++part)
      if (carrying.parts[part].contact == stance.contact)
        drift = std::max(drift, measureDrift(found, carrying, part, stance));
  }
  return drifts;
}

RepairedFeet measureFeet(const MotionExamination& found, const MotionExamination& carrying,
                         const std::vector<RepairedStance>& stances) {
  RepairedFeet feet;
  feet.speed = found.verdict[MotionFault::FootSliding].worst;
  feet.drift = stances.empty() ? kNaN : 0.;
  const std::vector<double> drifts = measureDrifts(found, carrying, stances);
  for (std::size_t k = 0; k < stances.size(); ++k)
    if (stances[k].contact < found.contacts.size()) feet.drift = std::max(feet.drift, drifts[k]);
  const RepairGround ground =
      findRepairGround(found.parts, found.inference, found.derived.motion.time);
  for (std::size_t part = 0; part < found.parts.size(); ++part) {
    if (found.parts[part].contact >= found.contacts.size()) continue;
    for (Index frame = 0; frame < ground.height.cols(); ++frame) {
      // std::max() leaves what is not known.
      const double height =
          found.part_motions[part].height[frame] - ground.height(Index(part), frame);
      feet.sunk = std::max(feet.sunk, -height);
      if (found.inference.schedule.active(Index(part), frame))
        feet.floating = std::max(feet.floating, height);
    }
  }
  return feet;
}

}  // namespace dynacom::internal
