// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>
#include <limits>
#include <string>

#include "dynacom/contact_base.hpp"

namespace dynacom {

/// What describes a ContactGrasp. The defaults describe one that holds whatever comes.
struct DYNACOM_EXPORT ContactGraspSettings {
  /// Bounds of (f_x, f_y, f_z [N], τ_x, τ_y, τ_z [N·m]) in the grasp's frame, lower ≤ upper; where
  /// both are the same, the component is known.
  Eigen::Matrix<double, 6, 1> lower =
      Eigen::Matrix<double, 6, 1>::Constant(-std::numeric_limits<double>::infinity());
  Eigen::Matrix<double, 6, 1> upper =
      Eigen::Matrix<double, 6, 1>::Constant(std::numeric_limits<double>::infinity());
  /// Weights (f_x, f_y, f_z [1/N], τ_x, τ_y, τ_z [1/(N·m)]) > 0 of the cost, which squares them.
  Eigen::Matrix<double, 6, 1> weights = Eigen::Matrix<double, 6, 1>::Ones();
  /// Force that the cost pulls to, λ₀ of ½ Σ (wᵢ (λ − λ₀)ᵢ)² [N], [N·m].
  Eigen::Matrix<double, 6, 1> reference = Eigen::Matrix<double, 6, 1>::Zero();
  /// Of the grasp in the contact's frame.
  pinocchio::SE3 placement = pinocchio::SE3::Identity();
  /// Name of the frame in the robot's model; not empty.
  std::string frame_name;

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
  std::string to_string() const;
  bool operator==(const ContactGraspSettings& other) const;
  bool operator!=(const ContactGraspSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const ContactGraspSettings& settings);

/// A hand on a rail, a magnet, a suction cup: it gives a wrench λ = (f_x, f_y, f_z, τ_x, τ_y, τ_z)
/// that pulls as well as it pushes, each component between bounds of its own.
class DYNACOM_EXPORT ContactGrasp : public ContactBase {
 public:
  /// A contact that waits for initialize().
  ContactGrasp() = default;
  /// @throws std::invalid_argument as ContactGraspSettings::validate()
  explicit ContactGrasp(const ContactGraspSettings& settings);

  /// Takes new settings; may be called again. The applied force becomes zero, and the frame is
  /// looked up again at the next use.
  /// @throws std::invalid_argument as ContactGraspSettings::validate(); nothing has changed then
  void initialize(const ContactGraspSettings& settings);

  std::shared_ptr<ContactBase> clone() const override;
  const ContactGraspSettings& getSettings() const { return settings_; }
  const std::string& getFrameName() const override { return settings_.frame_name; }
  /// getPose() and the settings' placement.
  SE3 getSurfacePose() const override { return getPose() * settings_.placement; }

 private:
  ContactGraspSettings settings_;
};

}  // namespace dynacom
