// SPDX-License-Identifier: BSD-2-Clause
// Lesson 4. Is a motion possible? Configurations in, a verdict out.
#include <cstdio>
#include <dynacom/contact_inference.hpp>
#include <dynacom/motion_verdict.hpp>

#include "crouch.hpp"

// A schedule in which no contact is ever active.
dynacom::ContactSchedule nobody(Eigen::Index frames) {
  return {{}, dynacom::ContactSchedule::Matrix(0, frames)};
}

int main(int argc, char** argv) {
  dynacom::DynaCoM talos = makeTalos(argc > 1 ? argv[1] : DYNACOM_TALOS_URDF);
  const dynacom::PartRobot parts = dynacom::splitContacts(talos);

  for (const double period : {2., 0.5}) {
    const Eigen::VectorXd time = crouchTimes(period);
    const Eigen::MatrixXd q = crouch(talos, period);

    // Velocities and accelerations, without what is faster than 6 Hz.
    const Eigen::MatrixXd smooth = dynacom::filterConfigurations(talos.getModel(), q, 100., 6.);
    const dynacom::Motion motion = dynacom::differentiate(talos.getModel(), time, smooth);

    // Which corners of which feet touch the ground, and when? What the motion needs tells.
    const auto corners = dynacom::computeContactMotions(parts.robot, motion);
    const auto needed = dynacom::analyzeMotion(parts.robot, motion, nobody(time.size()));
    const auto found = dynacom::inferContacts(parts, corners, needed, false);
    const auto schedule = dynacom::gatherParts(talos, parts, found.schedule);

    // What must they give, and what can they? And is that enough?
    const auto analysis = dynacom::analyzeMotion(parts.robot, motion, found.schedule);
    const dynacom::RecordedMotion recorded{time, q};
    const dynacom::MotionVerdict verdict =
        dynacom::judgeMotion(parts.robot, motion, recorded, corners, found.ground, analysis);
    const double largest = analysis.ground_force.row(2).maxCoeff() / (talos.getMass() * 9.81);
    const double share = 100. * schedule.active.cast<double>().mean();
    std::printf("A crouch in %.1f s: %s\n", period,
                verdict.isFeasible() ? "feasible" : "not feasible");
    std::printf("  on the ground %.0f %%, up to %.2f m g\n", share, largest);
    for (std::size_t k = 0; k < dynacom::kMotionFaults; ++k) {
      const dynacom::MotionFinding& finding = verdict.findings[k];
      if (finding.holds)
        std::printf("  %s: %td frames, worst at %.2f s\n",
                    dynacom::to_string(static_cast<dynacom::MotionFault>(k)), finding.frames,
                    finding.time);
    }
  }
}
