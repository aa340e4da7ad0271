// SPDX-License-Identifier: BSD-2-Clause
// Lesson 5. Many motions at once, on all cores. How fast may one crouch?
#include <array>
#include <cstdio>
#include <dynacom/motion_examination.hpp>
#include <optional>

#include "crouch.hpp"

int main(int argc, char** argv) {
  dynacom::DynaCoM talos = makeTalos(argc > 1 ? argv[1] : DYNACOM_TALOS_URDF);
  constexpr std::array periods = {2.0, 1.5, 1.0, 0.9, 0.8, 0.7, 0.6, 0.5};
  std::array<dynacom::RecordedMotion, periods.size()> clips;
  for (std::size_t k = 0; k < periods.size(); ++k)
    clips[k] = {crouchTimes(periods[k]), crouch(talos, periods[k])};

  // Clips are read by several threads, each when it is wanted, and forgotten when they are judged:
  // there might be a million of them, in files. What one keeps of them is up to the caller.
  struct Row {
    dynacom::MotionOutcome outcome;
    double solved, largest;
  };
  std::array<std::optional<Row>, periods.size()> table;
  const auto read = [&](std::size_t clip) { return clips.at(clip); };
  const auto keep = [&](std::size_t clip, const dynacom::MotionExamination* found,
                        const std::string& error) {
    if (!found) {
      std::fprintf(stderr, "clip %zu: %s\n", clip, error.c_str());
      return;
    }
    const dynacom::MotionStatistics& statistics = found->statistics;
    table[clip] = Row{found->verdict.outcome, statistics.share(dynacom::DistributionStatus::Solved),
                      statistics.contacts[0].largest_vertical_force};
  };
  dynacom::analyzeMotions(talos, clips.size(), read, keep);

  for (std::size_t k = 0; k < periods.size(); ++k)
    if (table[k])
      std::printf("%.1f s: %s, within reach %3.0f %%, left sole up to %.2f m g\n", periods[k],
                  dynacom::to_string(table[k]->outcome), 100. * table[k]->solved,
                  table[k]->largest);
}
