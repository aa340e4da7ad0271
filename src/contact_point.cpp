// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_point.hpp"

#include <cmath>
#include <ostream>

#include "check.hpp"
#include "surface_matrices.hpp"
#include "surface_options.hpp"

namespace dynacom {

using internal::requireField;

void ContactPointSettings::validate() const {
  requireField(std::isfinite(mu) && mu >= 0., "ContactPointSettings.mu", "finite and >= 0", mu);
  requireField(weights.allFinite() && (weights.array() > 0.).all(), "ContactPointSettings.weights",
               "finite and > 0", weights.transpose());
  requireField(reference.allFinite(), "ContactPointSettings.reference", "finite",
               reference.transpose());
  internal::validate(*this, "ContactPointSettings");
  requireField(!frame_name.empty(), "ContactPointSettings.frame_name", "a frame's name", "''");
  requireField(std::isfinite(radius) && radius >= 0., "ContactPointSettings.radius",
               "finite and >= 0", radius);
}

std::string ContactPointSettings::to_string() const { return internal::concat(*this); }

bool ContactPointSettings::operator==(const ContactPointSettings& other) const {
  return SurfaceOptions::operator==(other) && reference == other.reference && mu == other.mu &&
         weights == other.weights && frame_name == other.frame_name &&
         world_aligned == other.world_aligned && radius == other.radius;
}

std::ostream& operator<<(std::ostream& out, const ContactPointSettings& settings) {
  out << "ContactPointSettings(mu=" << settings.mu << ", weights=[" << settings.weights.transpose()
      << "], frame_name='" << settings.frame_name
      << "', world_aligned=" << (settings.world_aligned ? "true" : "false")
      << ", radius=" << settings.radius;
  internal::write(out, settings);
  if (!settings.reference.isZero(0.))
    out << ", reference=[" << settings.reference.transpose() << "]";
  return out << ")";
}

ContactPoint::ContactPoint(const ContactPointSettings& settings) { initialize(settings); }

void ContactPoint::initialize(const ContactPointSettings& settings) {
  settings.validate();
  settings_ = settings;
  updateMatrices();
  reset();
}

std::shared_ptr<ContactBase> ContactPoint::clone() const {
  return std::make_shared<ContactPoint>(*this);
}

ContactBase::SE3 ContactPoint::getSurfacePose() const {
  SE3 surface = getPose() * settings_.placement;
  if (settings_.world_aligned) surface.rotation().setIdentity();
  surface.translation() -= settings_.radius * surface.rotation().col(2);
  return surface;
}

double ContactPoint::getFrictionUsage() const {
  if (cols() == 0) return ContactBase::getFrictionUsage();
  return getUsage(settings_.findTangential(appliedForce().head<2>()), settings_.mu);
}

void ContactPoint::setMu(double mu) {
  changeSettings(&ContactPointSettings::mu, mu);
  updateMatrices();
}

void ContactPoint::setForceWeights(const Eigen::Vector3d& force_weights) {
  changeSettings(&ContactPointSettings::weights, force_weights);
  setWeights(settings_.weights);
}

template <class Value>
void ContactPoint::changeSettings(Value ContactPointSettings::*field, const Value& value) {
  if (cols() == 0) throw NotReadyError("ContactPoint is used before initialize()");
  internal::changeField(settings_, field, value);
}

void ContactPoint::updateMatrices() {
  ContactSet set = ContactSet::point(settings_.makeFriction(settings_.mu));
  if (!internal::isPyramid(settings_) || !settings_.reference.isZero(0.)) {
    set.boundNormalForce(settings_.least_normal_force, settings_.greatest_normal_force);
    const internal::SurfaceMatrices matrices = internal::listInequalities(set, nullptr);
    setMatrices(matrices.uni_A, matrices.uni_b, matrices.fri_A, matrices.fri_b, settings_.weights,
                settings_.reference, set);
    return;
  }
  const double mu = internal::getPyramidMu(settings_, settings_.mu);
  const Eigen::RowVector3d uni_A(0., 0., -1.);
  Eigen::Matrix<double, 4, 3> fri_A;
  fri_A << 1., 0., -mu,  //
      0., 1., -mu,       //
      -1., 0., -mu,      //
      0., -1., -mu;
  setMatrices(uni_A, fri_A, settings_.weights, set);
}

}  // namespace dynacom
