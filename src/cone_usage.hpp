// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "nan.hpp"

namespace dynacom::internal {

/// μ of a contact; NaN of a kind that is not known.
inline double findFriction(const ContactBase& contact) {
  if (const auto* point = dynamic_cast<const ContactPoint*>(&contact))
    return point->getSettings().mu;
  if (const auto* surface = dynamic_cast<const Contact6D*>(&contact))
    return surface->getSettings().mu;
  return kNaN;
}

/// MotionAnalysis::Contact::cone_usage of an active contact.
/// @param force          in the surface's frame [N]
/// @param minimal_force  below which normal force it is zero [N]
inline double findConeUsage(const Eigen::Vector3d& force, double mu, double minimal_force) {
  if (!(mu > 0.)) return kNaN;
  return force.z() >= minimal_force ? force.head<2>().norm() / (mu * force.z()) : 0.;
}

}  // namespace dynacom::internal
