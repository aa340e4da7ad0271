// SPDX-License-Identifier: BSD-2-Clause
#include "surface_options.hpp"

#include <cmath>
#include <ostream>

#include "check.hpp"
#include "rotation_check.hpp"

namespace dynacom {

using internal::requireField;

const char* to_string(FrictionModel model) {
  switch (model) {
    case FrictionModel::OuterPyramid:
      return "OuterPyramid";
    case FrictionModel::InnerPyramid:
      return "InnerPyramid";
    case FrictionModel::Facets:
      return "Facets";
    case FrictionModel::Cone:
      return "Cone";
  }
  return "unknown friction model";
}

std::ostream& operator<<(std::ostream& out, FrictionModel model) { return out << to_string(model); }

Section SurfaceOptions::makeFriction(double mu) const {
  switch (friction) {
    case FrictionModel::InnerPyramid:
      return Section::facets(internal::getPyramidMu(*this, mu), 4);
    case FrictionModel::Facets:
      return Section::facets(mu, facets, facet_angle);
    case FrictionModel::Cone:
      return Section::disc(mu);
    case FrictionModel::OuterPyramid:
      break;
  }
  return Section::facets(mu, 4);
}

double SurfaceOptions::findTangential(const Eigen::Vector2d& force) const {
  const double largest = force.lpNorm<Eigen::Infinity>();
  switch (friction) {
    case FrictionModel::InnerPyramid:
      return std::sqrt(2.) * largest;
    case FrictionModel::Facets: {
      // Against the normal that is closest.
      const double sector = 2. * 3.14159265358979323846 / facets;
      const double angle = std::remainder(std::atan2(force.y(), force.x()) - facet_angle, sector);
      return force.norm() * std::cos(angle);
    }
    case FrictionModel::Cone:
      return force.norm();
    case FrictionModel::OuterPyramid:
      break;
  }
  return largest;
}

bool SurfaceOptions::operator==(const SurfaceOptions& other) const {
  return friction == other.friction && facets == other.facets && facet_angle == other.facet_angle &&
         least_normal_force == other.least_normal_force &&
         greatest_normal_force == other.greatest_normal_force && placement == other.placement;
}

namespace internal {

void validate(const SurfaceOptions& options, const char* settings) {
  // Names are put together for messages only: a control loop may change settings.
  const auto require = [&](bool holds, const char* field, const char* expected, const auto& value) {
    if (!holds) requireField(false, concat(settings, ".", field).c_str(), expected, value);
  };
  require(options.facets >= 4 && options.facets <= 64, "facets", "from 4 to 64", options.facets);
  require(std::isfinite(options.facet_angle), "facet_angle", "finite", options.facet_angle);
  require(std::isfinite(options.least_normal_force) && options.least_normal_force >= 0.,
          "least_normal_force", "finite and >= 0", options.least_normal_force);
  require(options.greatest_normal_force >= options.least_normal_force, "greatest_normal_force",
          ">= least_normal_force", options.greatest_normal_force);
  require(
      options.placement.translation().allFinite() && isOrthonormal(options.placement.rotation()),
      "placement", "finite, its rotation orthonormal", options.placement);
}

bool isPyramid(const SurfaceOptions& options) {
  return (options.friction == FrictionModel::OuterPyramid ||
          options.friction == FrictionModel::InnerPyramid) &&
         options.least_normal_force == 0. && std::isinf(options.greatest_normal_force);
}

double getPyramidMu(const SurfaceOptions& options, double mu) {
  return options.friction == FrictionModel::InnerPyramid ? mu / std::sqrt(2.) : mu;
}

void write(std::ostream& out, const SurfaceOptions& options) {
  static const SurfaceOptions plain;
  if (options.friction != plain.friction) out << ", friction=" << options.friction;
  if (options.facets != plain.facets) out << ", facets=" << options.facets;
  if (options.facet_angle != plain.facet_angle) out << ", facet_angle=" << options.facet_angle;
  if (options.least_normal_force != plain.least_normal_force)
    out << ", least_normal_force=" << options.least_normal_force;
  if (options.greatest_normal_force != plain.greatest_normal_force)
    out << ", greatest_normal_force=" << options.greatest_normal_force;
  if (!(options.placement == plain.placement))
    out << ", placement=(" << options.placement.translation().transpose() << "; "
        << Eigen::Quaterniond(options.placement.rotation()).coeffs().transpose() << ")";
}

}  // namespace internal

}  // namespace dynacom
