// SPDX-License-Identifier: BSD-2-Clause
#include "motion_windows.hpp"

#include <algorithm>

namespace dynacom::internal {

namespace {

// Frames without fault one after the other: the first, and the one behind the last; and the same
// without the unsure ones at both ends, of which none is left if the second is no more.
struct Run {
  Eigen::Index first, behind;
  Eigen::Index first_sure, behind_sure;
};

}  // namespace

std::vector<MotionWindow> findWindows(const Eigen::VectorXd& time,
                                      const Eigen::Array<bool, Eigen::Dynamic, 1>& beyond,
                                      const Eigen::Array<bool, Eigen::Dynamic, 1>& jumps,
                                      const Eigen::Array<bool, Eigen::Dynamic, 1>& unsure,
                                      const VerdictSettings& settings) {
  const Eigen::Index frames = time.size();
  std::vector<Run> runs;
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    if (beyond[frame] || jumps[frame]) continue;
    if (runs.empty() || runs.back().behind < frame) runs.push_back({frame, frame, frame, frame});
    runs.back().behind = frame + 1;
  }
  for (Run& run : runs) {
    run.first_sure = run.first;
    run.behind_sure = run.behind;
    while (run.first_sure < run.behind && unsure[run.first_sure]) ++run.first_sure;
    while (run.behind_sure > run.first_sure && unsure[run.behind_sure - 1]) --run.behind_sure;
  }

  // Each frame lasts until the next one; the last one of all has no time of its own.
  const auto lasts = [&](Eigen::Index first, Eigen::Index behind) {
    return time[std::min(behind, frames - 1)] - time[first];
  };
  const auto isLong = [&](const Run& run) {
    return run.first_sure < run.behind_sure &&
           lasts(run.first_sure, run.behind_sure) >= settings.interruption - kTimeRounding;
  };
  // Whether what lies between two runs is too short to end a window.
  const auto isShort = [&](const Run& before, const Run& after) {
    const Eigen::Index first = before.behind, size = after.first - first;
    return !jumps.segment(first, size).any() && isLong(before) && isLong(after) &&
           lasts(first, after.first) < settings.interruption - kTimeRounding;
  };
  std::vector<MotionWindow> windows;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const Eigen::Index first = runs[k].first_sure;
    while (k + 1 < runs.size() && isShort(runs[k], runs[k + 1])) ++k;
    const Eigen::Index last = runs[k].behind_sure - 1;
    if (first > last) continue;
    if (time[last] - time[first] >= settings.minimal_window - kTimeRounding)
      windows.push_back({first, last, time[first], time[last]});
  }
  return windows;
}

}  // namespace dynacom::internal
