// SPDX-License-Identifier: BSD-2-Clause
// Lesson 6. A motion that is too fast, and the closest one that physics allows.
#include <cstdio>
#include <dynacom/motion_repairer.hpp>

#include "crouch.hpp"

int main(int argc, char** argv) {
  dynacom::DynaCoM talos = makeTalos(argc > 1 ? argv[1] : DYNACOM_TALOS_URDF);
  const dynacom::MotionRepairer repairer(talos);

  for (const double period : {2., 0.5}) {
    const dynacom::RecordedMotion recorded{crouchTimes(period), crouch(talos, period)};
    const dynacom::MotionRepair repair = repairer.repair(recorded);
    std::printf("A crouch in %.1f s: %s\n", period, dynacom::to_string(repair.outcome));

    // What is left stands in reasons; what came out, in recorded, which need not be filtered.
    for (const dynacom::RepairReason& reason : repair.reasons)
      std::printf("  %s: %s\n", reason.code.c_str(), reason.text.c_str());
    std::printf("  %td of %td frames were out of reach, and %td are\n", repair.missing_before,
                repair.recorded.time.size(), repair.missing);
    std::printf("  the root was displaced by %.1f mm, at most, and joints turned by %.2f deg\n",
                1e3 * repair.root.largest, 180. / std::acos(-1.) * repair.joints.largest);
    for (const dynacom::RepairStep& step : repair.steps)
      std::printf("  step %s: %s\n", dynacom::to_string(step.rung),
                  step.is_kept ? "kept" : "not kept");

    // It is what its contacts can give, in every frame, and so says whoever examines it.
    dynacom::ExaminationSettings plain;
    plain.sensitivity = false;
    const dynacom::MotionExaminer examiner(talos, plain);
    const dynacom::MotionExamination found = examiner.examine(repair.recorded);
    std::printf("  it is %s\n", found.verdict.isFeasible() ? "feasible" : "not feasible");
  }
}
