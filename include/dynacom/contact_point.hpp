// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>

#include "dynacom/contact_base.hpp"
#include "dynacom/surface_options.hpp"

namespace dynacom {

/// What describes a ContactPoint. The defaults describe a frictionless point.
struct DYNACOM_EXPORT ContactPointSettings : SurfaceOptions {
  /// Friction coefficient μ ≥ 0.
  double mu = 0.;
  /// Weights (f_x, f_y, f_z) > 0 of the cost, which squares them [1/N].
  Eigen::Vector3d weights = Eigen::Vector3d::Ones();
  /// Name of the frame in the robot's model; not empty.
  std::string frame_name;
  /// True: the surface's axes are the world's, whatever the frame's orientation. For ball feet,
  /// whose frame rolls with the shank.
  bool world_aligned = false;
  /// The point lies this far below the frame's origin, along the surface's normal, ≥ 0 [m].
  double radius = 0.;

  /// Force that the cost pulls to, λ₀ of ½ Σ (wᵢ (λ − λ₀)ᵢ)² [N].
  Eigen::Vector3d reference = Eigen::Vector3d::Zero();

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
  std::string to_string() const;
  bool operator==(const ContactPointSettings& other) const;
  bool operator!=(const ContactPointSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const ContactPointSettings& settings);

/// A point that gives a force λ = (f_x, f_y, f_z) [N]: it pushes, within a friction pyramid.
///
///     U = [0 0 −1]      C = [ 1  0 −μ]      NE = [    R    ]
///                           [ 0  1 −μ]           [[p − c]×R]
///                           [−1  0 −μ]
///                           [ 0 −1 −μ]
///
/// The pyramid circumscribes the friction cone: on its diagonals it allows √2 μ f_z.
/// R and p are the orientation and the position of the surface's frame, c is the CoM.
class DYNACOM_EXPORT ContactPoint : public ContactBase {
 public:
  /// A contact that waits for initialize().
  ContactPoint() = default;
  /// @throws std::invalid_argument as ContactPointSettings::validate()
  explicit ContactPoint(const ContactPointSettings& settings);

  /// Takes new settings; may be called again. The applied force becomes zero, and the frame is
  /// looked up again at the next use.
  /// @throws std::invalid_argument as ContactPointSettings::validate(); nothing has changed then
  void initialize(const ContactPointSettings& settings);

  std::shared_ptr<ContactBase> clone() const override;
  const ContactPointSettings& getSettings() const { return settings_; }
  const std::string& getFrameName() const override { return settings_.frame_name; }
  double getFrictionUsage() const override;
  SE3 getSurfacePose() const override;

  /// @throws std::invalid_argument unless mu ≥ 0; NotReadyError before initialize()
  void setMu(double mu);
  /// @throws std::invalid_argument unless all weights > 0; NotReadyError before initialize()
  void setForceWeights(const Eigen::Vector3d& force_weights);

 private:
  template <class Value>
  void changeSettings(Value ContactPointSettings::*field, const Value& value);
  void updateMatrices();

  ContactPointSettings settings_;
};

}  // namespace dynacom
