// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/ground_plane.hpp"

#include <Eigen/Geometry>
#include <ostream>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom {

namespace {

// Not Eigen's normalized(), which squares the largest and the smallest numbers to infinity and 0.
Eigen::Vector3d unitNormal(const GroundPlane& plane) {
  return (plane.normal / plane.normal.cwiseAbs().maxCoeff()).normalized();
}

}  // namespace

void GroundPlane::validate() const {
  internal::requireField(point.allFinite(), "GroundPlane.point", "finite", point.transpose());
  internal::requireField(normal.allFinite() && !normal.isZero(0.), "GroundPlane.normal",
                         "finite and not zero", normal.transpose());
}

std::string GroundPlane::to_string() const { return internal::concat(*this); }

bool GroundPlane::operator==(const GroundPlane& other) const {
  return point == other.point && normal == other.normal;
}

std::ostream& operator<<(std::ostream& out, const GroundPlane& plane) {
  return out << "GroundPlane(point=[" << plane.point.transpose() << "], normal=["
             << plane.normal.transpose() << "])";
}

Eigen::Vector3d computeCoP(const CentroidalWrench& groundWrench, const Eigen::Vector3d& com,
                           const GroundPlane& plane, double minimalNormalForce) {
  plane.validate();
  const Eigen::Vector3d n = unitNormal(plane);
  const double height = n.dot(com - plane.point);
  const double normal_force = n.dot(groundWrench.force);
  const Eigen::Vector3d lateral = groundWrench.force - normal_force * n;
  const Eigen::Vector3d cop =
      com - height * n + (n.cross(groundWrench.torque) - height * lateral) / normal_force;  // (21)
  if (!(normal_force >= minimalNormalForce) || !cop.allFinite())
    return Eigen::Vector3d::Constant(internal::kNaN);
  return cop;
}

Eigen::Vector3d computeCMP(const Eigen::Vector3d& groundForce, const Eigen::Vector3d& com,
                           const GroundPlane& plane, double minimalNormalForce) {
  return computeCoP({groundForce, Eigen::Vector3d::Zero()}, com, plane,
                    minimalNormalForce);  // (22)
}

}  // namespace dynacom
