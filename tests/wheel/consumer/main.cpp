// A stool at rest, away from DynaCoM's sources: its three legs share its weight.
#include <cmath>
#include <dynacom/contact_point.hpp>
#include <dynacom/dyna_com.hpp>
#include <iostream>
#include <memory>
#include <string>

int main() {
  std::string urdf =
      "<robot name='stool'><link name='seat'><inertial><mass value='6'/>"
      "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link>";
  const char* const feet[][2] = {{"0.2 0 -1", "a"}, {"-0.1 0.2 -1", "b"}, {"-0.1 -0.2 -1", "c"}};
  for (const auto& [xyz, name] : feet) {
    urdf += std::string("<link name='") + name + "'/><joint name='to_" + name +
            "' type='fixed'><parent link='seat'/><child link='" + name + "'/><origin xyz='" + xyz +
            "'/></joint>";
  }
  dynacom::DynaCoMSettings settings;
  settings.urdf = urdf + "</robot>";
  dynacom::DynaCoM stool(settings);
  std::cout << "mass " << stool.getMass() << " kg\n";

  for (const auto& foot : feet) {
    dynacom::ContactPointSettings point;
    point.mu = 0.5;
    point.frame_name = foot[1];
    stool.addContact(std::make_shared<dynacom::ContactPoint>(point), foot[1]);
  }
  const auto& model = stool.getModel();
  Eigen::VectorXd q = Eigen::VectorXd::Zero(model.nq);
  q[6] = 1.;
  const Eigen::VectorXd rest = Eigen::VectorXd::Zero(model.nv);
  stool.computeDynamics(q, rest, rest);
  const auto status =
      stool.distributeForce(stool.getGroundCoMForce(), stool.getGroundCoMTorque(), stool.getCoM());

  double sum = 0.;
  for (const std::string& name : stool.getActiveContacts()) {
    const double force = stool.getContact(name)->appliedForce()[2];
    std::cout << "foot " << name << " carries " << force << " N\n";
    sum += force;
  }
  const bool right =
      status == dynacom::DistributionStatus::Solved && std::abs(sum - 6. * 9.81) < 1e-9;
  std::cout << (right ? "right\n" : "wrong\n");
  return right ? 0 : 1;
}
