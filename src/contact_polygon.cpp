// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_polygon.hpp"

#include <cmath>
#include <ostream>

#include "check.hpp"
#include "nan.hpp"
#include "surface_matrices.hpp"
#include "surface_options.hpp"

namespace dynacom {

using internal::requireField;

void ContactPolygonSettings::validate() const {
  const char* const finite = "finite and >= 0";
  requireField(std::isfinite(mu) && mu >= 0., "ContactPolygonSettings.mu", finite, mu);
  requireField(std::isfinite(gu) && gu >= 0., "ContactPolygonSettings.gu", finite, gu);
  requireField(vertices.cols() >= 1, "ContactPolygonSettings.vertices", "a point or more", "none");
  requireField(vertices.allFinite(), "ContactPolygonSettings.vertices", "finite", vertices);
  requireField(weights.allFinite() && (weights.array() > 0.).all(),
               "ContactPolygonSettings.weights", "finite and > 0", weights.transpose());
  requireField(reference.allFinite(), "ContactPolygonSettings.reference", "finite",
               reference.transpose());
  internal::validate(*this, "ContactPolygonSettings");
  requireField(!frame_name.empty(), "ContactPolygonSettings.frame_name", "a frame's name", "''");
}

std::string ContactPolygonSettings::to_string() const { return internal::concat(*this); }

bool ContactPolygonSettings::operator==(const ContactPolygonSettings& other) const {
  return SurfaceOptions::operator==(other) && mu == other.mu && gu == other.gu &&
         vertices.cols() == other.vertices.cols() && vertices == other.vertices &&
         weights == other.weights && reference == other.reference && frame_name == other.frame_name;
}

std::ostream& operator<<(std::ostream& out, const ContactPolygonSettings& settings) {
  out << "ContactPolygonSettings(mu=" << settings.mu << ", gu=" << settings.gu << ", vertices=[";
  for (Eigen::Index k = 0; k < settings.vertices.cols(); ++k)
    out << (k > 0 ? ", " : "") << "[" << settings.vertices.col(k).transpose() << "]";
  out << "], weights=[" << settings.weights.transpose() << "], frame_name='" << settings.frame_name
      << "'";
  internal::write(out, settings);
  if (!settings.reference.isZero(0.))
    out << ", reference=[" << settings.reference.transpose() << "]";
  return out << ")";
}

ContactPolygon::ContactPolygon(const ContactPolygonSettings& settings) { initialize(settings); }

void ContactPolygon::initialize(const ContactPolygonSettings& settings) {
  settings.validate();
  settings_ = settings;
  places_ = Section::polygon(settings_.vertices);
  ContactSet set = ContactSet::surface(settings_.makeFriction(settings_.mu), places_, settings_.gu);
  set.boundNormalForce(settings_.least_normal_force, settings_.greatest_normal_force);
  const internal::SurfaceMatrices matrices = internal::listInequalities(set, &places_);
  const bool is_around_origin =
      places_.shape() == Section::Shape::Rectangle && places_.lower() == -places_.upper();
  if (internal::isPyramid(settings_) && is_around_origin && settings_.reference.isZero(0.))
    setMatrices(matrices.uni_A, matrices.fri_A, settings_.weights, set);
  else
    setMatrices(matrices.uni_A, matrices.uni_b, matrices.fri_A, matrices.fri_b, settings_.weights,
                settings_.reference, set);
  reset();
}

std::shared_ptr<ContactBase> ContactPolygon::clone() const {
  return std::make_shared<ContactPolygon>(*this);
}

ContactBase::SE3 ContactPolygon::getSurfacePose() const { return getPose() * settings_.placement; }

Eigen::Matrix2Xd ContactPolygon::getCorners() const {
  if (places_.vertices().cols() > 0) return places_.vertices();
  const Eigen::Vector2d &low = places_.lower(), &high = places_.upper();
  Eigen::Matrix2Xd corners(2, 4);
  corners << high.x(), low.x(), low.x(), high.x(),  //
      high.y(), high.y(), low.y(), low.y();
  return corners;
}

double ContactPolygon::getFrictionUsage() const {
  if (cols() == 0) return ContactBase::getFrictionUsage();
  return getUsage(settings_.findTangential(appliedForce().head<2>()), settings_.mu);
}

double ContactPolygon::getCoPMargin() const {
  const Eigen::Vector2d cop = getCoP();
  return cop.allFinite() ? -places_.excess(cop, 1.) : internal::kNaN;
}

double ContactPolygon::getYawUsage() const {
  if (cols() == 0) return ContactBase::getYawUsage();
  return getUsage(std::abs(appliedForce()[5]), settings_.gu);
}

}  // namespace dynacom
