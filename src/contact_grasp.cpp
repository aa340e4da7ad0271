// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_grasp.hpp"

#include <cmath>
#include <ostream>
#include <pinocchio/spatial.hpp>

#include "check.hpp"
#include "rotation_check.hpp"

namespace dynacom {

using internal::requireField;

void ContactGraspSettings::validate() const {
  constexpr double kInfinity = ContactSet::kInfinity;
  requireField((lower.array() <= upper.array()).all() && (lower.array() < kInfinity).all() &&
                   (upper.array() > -kInfinity).all(),
               "ContactGraspSettings.lower", "<= upper", lower.transpose());
  requireField(weights.allFinite() && (weights.array() > 0.).all(), "ContactGraspSettings.weights",
               "finite and > 0", weights.transpose());
  requireField(reference.allFinite(), "ContactGraspSettings.reference", "finite",
               reference.transpose());
  requireField(placement.translation().allFinite() && internal::isOrthonormal(placement.rotation()),
               "ContactGraspSettings.placement", "finite, its rotation orthonormal", placement);
  requireField(!frame_name.empty(), "ContactGraspSettings.frame_name", "a frame's name", "''");
}

std::string ContactGraspSettings::to_string() const { return internal::concat(*this); }

bool ContactGraspSettings::operator==(const ContactGraspSettings& other) const {
  return lower == other.lower && upper == other.upper && weights == other.weights &&
         reference == other.reference && placement == other.placement &&
         frame_name == other.frame_name;
}

std::ostream& operator<<(std::ostream& out, const ContactGraspSettings& settings) {
  return out << "ContactGraspSettings(lower=[" << settings.lower.transpose() << "], upper=["
             << settings.upper.transpose() << "], weights=[" << settings.weights.transpose()
             << "], reference=[" << settings.reference.transpose() << "], frame_name='"
             << settings.frame_name << "')";
}

ContactGrasp::ContactGrasp(const ContactGraspSettings& settings) { initialize(settings); }

void ContactGrasp::initialize(const ContactGraspSettings& settings) {
  settings.validate();
  settings_ = settings;
  Eigen::MatrixXd A(0, 6);
  Eigen::VectorXd b;
  for (Eigen::Index k = 0; k < 6; ++k)
    for (const double sign : {1., -1.}) {
      const double bound = sign > 0. ? settings.upper[k] : -settings.lower[k];
      if (!std::isfinite(bound)) continue;
      A.conservativeResize(A.rows() + 1, 6);
      A.bottomRows<1>() = sign * Eigen::RowVectorXd::Unit(6, k);
      b.conservativeResize(b.size() + 1);
      b.tail<1>()[0] = bound;
    }
  setMatrices(A, b, Eigen::MatrixXd(0, 6), Eigen::VectorXd(), settings.weights, settings.reference,
              ContactSet::grasp(settings.lower, settings.upper));
  reset();
}

std::shared_ptr<ContactBase> ContactGrasp::clone() const {
  return std::make_shared<ContactGrasp>(*this);
}

}  // namespace dynacom
