// SPDX-License-Identifier: BSD-2-Clause
// Lesson 4. Is a motion possible? Configurations in, a verdict out.
#include <cmath>
#include <cstdio>
#include <dynacom/contact6d.hpp>
#include <dynacom/motion_verdict.hpp>

namespace {

// Configurations of two crouches, 100 a second, with the feet where they are.
Eigen::MatrixXd crouch(dynacom::DynaCoM& talos, double period, const Eigen::VectorXd& time) {
  const pinocchio::Model& model = talos.getModel();
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  Eigen::MatrixXd configurations(model.nq, time.size());
  for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
    Eigen::VectorXd q = pinocchio::neutral(model);
    const double bend = 0.2 + 0.3 * (1. - std::cos(2. * std::acos(-1.) * time[frame] / period));
    for (const char* side : {"left", "right"}) {
      const auto set = [&](const char* number, double angle) {
        const std::string joint = std::string("leg_") + side + "_" + number + "_joint";
        q[model.joints[model.getJointId(joint)].idx_q()] = angle;
      };
      set("3", -bend), set("4", 2. * bend), set("5", -bend);
    }
    talos.computeDynamics(q, rest, rest);
    q.head<3>() -= talos.getContact("left_sole")->getSurfacePose().translation();
    configurations.col(frame) = q;
  }
  return configurations;
}

}  // namespace

int main(int argc, char** argv) {
  dynacom::DynaCoMSettings settings;
  settings.urdf = argc > 1 ? argv[1] : DYNACOM_TALOS_URDF;
  dynacom::DynaCoM talos(settings);
  for (const char* side : {"left", "right"}) {
    dynacom::Contact6DSettings sole;
    sole.frame_name = std::string("leg_") + side + "_sole_fix_joint";
    sole.half_length = 0.10;
    sole.half_width = 0.06;
    sole.mu = 0.7;
    sole.gu = 0.08;
    talos.addContact(std::make_shared<dynacom::Contact6D>(sole), std::string(side) + "_sole");
  }

  for (const double period : {2., 0.5}) {
    const auto frames = static_cast<Eigen::Index>(200. * period) + 1;
    const Eigen::VectorXd time = Eigen::ArrayXd::LinSpaced(frames, 0, frames - 1) / 100.;
    const Eigen::MatrixXd q = crouch(talos, period, time);

    // Velocities and accelerations, without what is faster than 6 Hz.
    const Eigen::MatrixXd smooth = dynacom::filterConfigurations(talos.getModel(), q, 100., 6.);
    const dynacom::Motion motion = dynacom::differentiate(talos.getModel(), time, smooth);

    // Which feet touch the ground, and when? What must they give, and what can they?
    const auto contacts = dynacom::computeContactMotions(talos, motion);
    const Eigen::VectorXd ground = dynacom::estimateGround(contacts, time);
    const dynacom::ContactSchedule schedule = dynacom::detectContacts(contacts, time, ground);
    const dynacom::MotionAnalysis analysis = dynacom::analyzeMotion(talos, motion, schedule);

    // And is that enough?
    const dynacom::RecordedMotion recorded{time, q};
    const dynacom::MotionVerdict verdict =
        dynacom::judgeMotion(talos, motion, recorded, contacts, ground, analysis);
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
