// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact6d.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>

#include "check.hpp"
#include "surface_matrices.hpp"
#include "surface_options.hpp"

namespace dynacom {

using internal::requireField;

void Contact6DSettings::validate() const {
  requireField(std::isfinite(mu) && mu >= 0., "Contact6DSettings.mu", "finite and >= 0", mu);
  requireField(std::isfinite(gu) && gu >= 0., "Contact6DSettings.gu", "finite and >= 0", gu);
  requireField(std::isfinite(half_length) && half_length >= 0., "Contact6DSettings.half_length",
               "finite and >= 0", half_length);
  requireField(std::isfinite(half_width) && half_width >= 0., "Contact6DSettings.half_width",
               "finite and >= 0", half_width);
  requireField(weights.allFinite() && (weights.array() > 0.).all(), "Contact6DSettings.weights",
               "finite and > 0", weights.transpose());
  requireField(reference.allFinite(), "Contact6DSettings.reference", "finite",
               reference.transpose());
  internal::validate(*this, "Contact6DSettings");
  if (coupled_yaw && (!internal::isPyramid(*this) || !reference.isZero(0.)))
    internal::throwInvalid(
        "Contact6DSettings.coupled_yaw must be false unless friction is OuterPyramid or "
        "InnerPyramid, without bounds of the normal force and without reference, got ",
        friction, ", [", least_normal_force, ", ", greatest_normal_force, "], [",
        reference.transpose(), "]");
  requireField(!frame_name.empty(), "Contact6DSettings.frame_name", "a frame's name", "''");
}

std::string Contact6DSettings::to_string() const { return internal::concat(*this); }

bool Contact6DSettings::operator==(const Contact6DSettings& other) const {
  return SurfaceOptions::operator==(other) && reference == other.reference && mu == other.mu &&
         gu == other.gu && coupled_yaw == other.coupled_yaw && half_length == other.half_length &&
         half_width == other.half_width && weights == other.weights &&
         frame_name == other.frame_name;
}

std::ostream& operator<<(std::ostream& out, const Contact6DSettings& settings) {
  out << "Contact6DSettings(mu=" << settings.mu << ", gu=" << settings.gu
      << ", half_length=" << settings.half_length << ", half_width=" << settings.half_width
      << ", weights=[" << settings.weights.transpose() << "], frame_name='" << settings.frame_name
      << "'";
  if (settings.coupled_yaw) out << ", coupled_yaw=true";
  internal::write(out, settings);
  if (!settings.reference.isZero(0.))
    out << ", reference=[" << settings.reference.transpose() << "]";
  return out << ")";
}

Contact6D::Contact6D(const Contact6DSettings& settings) { initialize(settings); }

void Contact6D::initialize(const Contact6DSettings& settings) {
  settings.validate();
  settings_ = settings;
  updateMatrices();
  reset();
}

std::shared_ptr<ContactBase> Contact6D::clone() const { return std::make_shared<Contact6D>(*this); }

ContactBase::SE3 Contact6D::getSurfacePose() const { return getPose() * settings_.placement; }

Eigen::Matrix2Xd Contact6D::getCorners() const {
  const double dx = settings_.half_length, dy = settings_.half_width;
  Eigen::Matrix2Xd corners(2, 4);
  corners << dx, -dx, -dx, dx,  //
      dy, dy, -dy, -dy;
  return corners;
}

double Contact6D::getFrictionUsage() const {
  if (cols() == 0) return ContactBase::getFrictionUsage();
  return getUsage(settings_.findTangential(appliedForce().head<2>()), settings_.mu);
}

double Contact6D::getCoPMargin() const {
  const Eigen::Vector2d half_sizes(settings_.half_length, settings_.half_width);
  return (half_sizes - getCoP().cwiseAbs()).minCoeff<Eigen::PropagateNaN>();
}

double Contact6D::getYawUsage() const {
  if (cols() == 0) return ContactBase::getYawUsage();
  if (settings_.coupled_yaw) {
    const double mu = internal::getPyramidMu(settings_, settings_.mu);
    const double dx = settings_.half_length, dy = settings_.half_width;
    const auto need = [&](double sign) {
      const auto& force = appliedForce();
      return sign * force[5] + std::abs(dy * force[0] + sign * mu * force[3]) +
             std::abs(dx * force[1] + sign * mu * force[4]);
    };
    return getUsage(std::max(need(1.), need(-1.)), mu * (dx + dy));
  }
  return getUsage(std::abs(appliedForce()[5]), settings_.gu);
}

void Contact6D::setMu(double mu) { change(&Contact6DSettings::mu, mu); }

void Contact6D::setGu(double gu) { change(&Contact6DSettings::gu, gu); }

void Contact6D::setForceWeights(const Eigen::Vector3d& force_weights) {
  Vector6 weights = settings_.weights;
  weights.head<3>() = force_weights;
  changeWeights(weights);
}

void Contact6D::setTorqueWeights(const Eigen::Vector3d& torque_weights) {
  Vector6 weights = settings_.weights;
  weights.tail<3>() = torque_weights;
  changeWeights(weights);
}

void Contact6D::setSurfaceHalfWidth(double half_width) {
  change(&Contact6DSettings::half_width, half_width);
}

void Contact6D::setSurfaceHalfLength(double half_length) {
  change(&Contact6DSettings::half_length, half_length);
}

template <class Value>
void Contact6D::change(Value Contact6DSettings::*field, const Value& value) {
  if (cols() == 0) throw NotReadyError("Contact6D is used before initialize()");
  internal::changeField(settings_, field, value);
  updateMatrices();
}

void Contact6D::changeWeights(const Vector6& weights) {
  if (cols() == 0) throw NotReadyError("Contact6D is used before initialize()");
  internal::changeField(settings_, &Contact6DSettings::weights, weights);
  setWeights(settings_.weights);
}

void Contact6D::updateMatrices() {
  const double dx = settings_.half_length;
  const double dy = settings_.half_width;
  // Pyramids as the manual has them, whose settings a control loop may change, are in sizes that
  // the compiler knows: that allocates nothing.
  Eigen::Matrix<double, 5, 6> uni_A;
  uni_A << 0., 0., -1., 0., 0., 0.,  //
      0., 0., -dx, 0., -1., 0.,      //
      0., 0., -dy, 1., 0., 0.,       //
      0., 0., -dx, 0., 1., 0.,       //
      0., 0., -dy, -1., 0., 0.;
  const double mu = internal::getPyramidMu(settings_, settings_.mu);
  Eigen::Matrix<double, 4, 6> sides;
  sides << 1., 0., -mu, 0., 0., 0.,  //
      0., 1., -mu, 0., 0., 0.,       //
      -1., 0., -mu, 0., 0., 0.,      //
      0., -1., -mu, 0., 0., 0.;
  if (settings_.coupled_yaw) {
    Eigen::Matrix<double, 12, 6> fri_A;
    fri_A.topRows<4>() = sides;
    Eigen::Index row = 4;
    for (const double r : {1., -1.})
      for (const double s : {1., -1.})
        for (const double t : {1., -1.})
          fri_A.row(row++) << s * dy, t * dx, -mu * (dx + dy), s * r * mu, t * r * mu, r;
    setMatrices(uni_A, fri_A, settings_.weights);
    return;
  }
  const Section places = Section::rectangle({-dx, -dy}, {dx, dy});
  ContactSet set = ContactSet::surface(settings_.makeFriction(settings_.mu), places, settings_.gu);
  if (!internal::isPyramid(settings_) || !settings_.reference.isZero(0.)) {
    set.boundNormalForce(settings_.least_normal_force, settings_.greatest_normal_force);
    const internal::SurfaceMatrices matrices = internal::listInequalities(set, &places);
    setMatrices(matrices.uni_A, matrices.uni_b, matrices.fri_A, matrices.fri_b, settings_.weights,
                settings_.reference, set);
    return;
  }
  const double gu = settings_.gu;
  Eigen::Matrix<double, 6, 6> fri_A;
  fri_A.topRows<4>() = sides;
  fri_A.bottomRows<2>() << 0., 0., -gu, 0., 0., 1.,  //
      0., 0., -gu, 0., 0., -1.;
  setMatrices(uni_A, fri_A, settings_.weights, set);
}

}  // namespace dynacom
