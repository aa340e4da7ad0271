// SPDX-License-Identifier: BSD-2-Clause
// Lesson 3. The same in a control loop: nothing in it allocates, locks, throws or calls the system,
// and how long it may take is bounded.
#include <cmath>
#include <cstdio>
#include <dynacom/contact6d.hpp>
#include <dynacom/dyna_com.hpp>
#include <pinocchio/algorithm/centroidal.hpp>
#include <string>
#include <vector>

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
    sole.gu = 0.1;
    talos.addContact(std::make_shared<dynacom::Contact6D>(sole), side);
  }
  // Nearly all distributions take one iteration. What has no answer after so many gets none.
  talos.setMaximalIterations(50);

  // Other parts of the controller need Pinocchio's results, too: they are computed once a tick.
  const pinocchio::Model& model = talos.getModel();
  pinocchio::Data data(model);
  const Eigen::VectorXd q = pinocchio::neutral(model), v = Eigen::VectorXd::Zero(model.nv);
  Eigen::VectorXd a = v;
  pinocchio::computeCentroidalMomentumTimeVariation(model, data, q, v, a);
  talos.computeDynamics(data);

  // The right foot's place is measured: it has sunk in by 5 mm.
  const std::string left = "left", right = "right";
  pinocchio::SE3 measured = talos.getContact(right)->getPose();
  measured.translation().z() -= 0.005;
  talos.setContactPose(right, measured);

  // What happens every 100 ms is printed afterwards: printing calls the system.
  struct Record {
    double t;
    dynacom::DistributionStatus status;
    double left, right;  // f_z
  };
  std::vector<Record> records;
  records.reserve(10);
  for (int tick = 0; tick < 1000; ++tick) {
    // Talos sways sideways, and lifts its left foot while it leans on the right one.
    const double t = 0.001 * tick;
    a[1] = std::sin(2. * M_PI * t);
    if (tick == 200) talos.deactivateContact(left);
    if (tick == 300) talos.activateContact(left);

    pinocchio::computeCentroidalMomentumTimeVariation(model, data, q, v, a);
    talos.computeDynamics(data);
    // Solved; Relaxed where it is out of reach, and then the forces are the best that there are,
    // and what they really do to the robot is in getFeasibleACoM(); else there is no answer, and
    // the forces are those of the last one: a few ticks of that are for the controller to bridge.
    const dynacom::DistributionStatus status = talos.distributeForce(
        talos.getGroundCoMForce(), talos.getGroundCoMTorque(), talos.getCoM());
    if (tick % 100 == 50)
      records.push_back({t, status, talos.getContact(left)->appliedForce()[2],
                         talos.getContact(right)->appliedForce()[2]});
  }

  std::printf("   t [s]  status     left, right f_z [N]\n");
  for (const Record& record : records)
    std::printf("%8.2f  %-9s %8.1f %8.1f\n", record.t, dynacom::to_string(record.status),
                record.left, record.right);
}
