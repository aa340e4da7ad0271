// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>
#include <string>

#include "dynacom/contact_base.hpp"
#include "dynacom/surface_options.hpp"

namespace dynacom {

/// What describes a ContactPolygon. The defaults describe a frictionless point.
struct DYNACOM_EXPORT ContactPolygonSettings : SurfaceOptions {
  /// Friction coefficient μ ≥ 0.
  double mu = 0.;
  /// Yaw friction coefficient γ ≥ 0: |τ_z| ≤ γ f_z [m].
  double gu = 0.;
  /// Places in the surface's plane, between which pressure may be, 2 × points, at least one [m]. An
  /// edge of two, or a vertex alone, are polygons, too; the origin may be outside.
  Eigen::Matrix2Xd vertices = Eigen::Matrix2Xd::Zero(2, 1);
  /// Weights (f_x, f_y, f_z [1/N], τ_x, τ_y, τ_z [1/(N·m)]) > 0 of the cost, which squares them.
  Eigen::Matrix<double, 6, 1> weights = Eigen::Matrix<double, 6, 1>::Ones();
  /// Force that the cost pulls to, λ₀ of ½ Σ (wᵢ (λ − λ₀)ᵢ)² [N], [N·m].
  Eigen::Matrix<double, 6, 1> reference = Eigen::Matrix<double, 6, 1>::Zero();
  /// Name of the frame in the robot's model; not empty.
  std::string frame_name;

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
  std::string to_string() const;
  bool operator==(const ContactPolygonSettings& other) const;
  bool operator!=(const ContactPolygonSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const ContactPolygonSettings& settings);

/// A convex polygon that gives a wrench λ = (f_x, f_y, f_z, τ_x, τ_y, τ_z): it pushes, with its
/// centre of pressure (−τ_y, τ_x) / f_z between the vertices, with friction and a bound on the yaw
/// moment. A Contact6D is one with four vertices.
class DYNACOM_EXPORT ContactPolygon : public ContactBase {
 public:
  /// A contact that waits for initialize().
  ContactPolygon() = default;
  /// @throws std::invalid_argument as ContactPolygonSettings::validate()
  explicit ContactPolygon(const ContactPolygonSettings& settings);

  /// Takes new settings; may be called again. The applied force becomes zero, and the frame is
  /// looked up again at the next use.
  /// @throws std::invalid_argument as ContactPolygonSettings::validate(); nothing has changed then
  void initialize(const ContactPolygonSettings& settings);

  std::shared_ptr<ContactBase> clone() const override;
  const ContactPolygonSettings& getSettings() const { return settings_; }
  const std::string& getFrameName() const override { return settings_.frame_name; }
  /// getPose() and SurfaceOptions::placement.
  SE3 getSurfacePose() const override;
  /// The vertices of the convex hull.
  Eigen::Matrix2Xd getCorners() const override;
  double getFrictionUsage() const override;
  double getCoPMargin() const override;
  double getYawUsage() const override;

 private:
  ContactPolygonSettings settings_;
  Section places_;
};

}  // namespace dynacom
