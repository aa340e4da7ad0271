// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <iosfwd>

#include "dynacom/contact_base.hpp"
#include "dynacom/surface_options.hpp"

namespace dynacom {

/// What describes a Contact6D. The defaults describe a frictionless point.
struct DYNACOM_EXPORT Contact6DSettings : SurfaceOptions {
  /// Friction coefficient μ ≥ 0.
  double mu = 0.;
  /// Yaw friction coefficient γ ≥ 0: |τ_z| ≤ γ f_z [m]. Without meaning where yaw is coupled.
  double gu = 0.;
  /// Whether yaw is bounded by what friction at the four corners can give besides the rest of the
  /// wrench, equation (27), rather than by γ. For pyramids of four sides without bounds and
  /// reference; see Contact6D.
  bool coupled_yaw = false;
  /// Half of the rectangle's extent along x, ≥ 0 [m].
  double half_length = 0.;
  /// Half of the rectangle's extent along y, ≥ 0 [m].
  double half_width = 0.;
  /// Weights (f_x, f_y, f_z [1/N], τ_x, τ_y, τ_z [1/(N·m)]) > 0 of the cost, which squares them.
  Eigen::Matrix<double, 6, 1> weights = Eigen::Matrix<double, 6, 1>::Ones();
  /// Name of the frame in the robot's model, at the rectangle's centre; not empty.
  std::string frame_name;

  /// Force that the cost pulls to, λ₀ of ½ Σ (wᵢ (λ − λ₀)ᵢ)² [N], [N·m].
  Eigen::Matrix<double, 6, 1> reference = Eigen::Matrix<double, 6, 1>::Zero();

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
  std::string to_string() const;
  bool operator==(const Contact6DSettings& other) const;
  bool operator!=(const Contact6DSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const Contact6DSettings& settings);

/// A rectangle that gives a wrench λ = (f_x, f_y, f_z, τ_x, τ_y, τ_z): it pushes, with its centre
/// of pressure inside, within a friction pyramid and a bound on the yaw moment.
///
///     U = [0 0 −1   0  0 0]      C = [ 1  0 −μ 0 0  0]      NE = [    R     0]
///         [0 0 −dx  0 −1 0]          [ 0  1 −μ 0 0  0]           [[p − c]×R R]
///         [0 0 −dy  1  0 0]          [−1  0 −μ 0 0  0]
///         [0 0 −dx  0  1 0]          [ 0 −1 −μ 0 0  0]
///         [0 0 −dy −1  0 0]          [ 0  0 −γ 0 0  1]
///                                    [ 0  0 −γ 0 0 −1]
///
/// The pyramid circumscribes the friction cone: on its diagonals it allows √2 μ f_z.
/// dx is half_length, dy half_width, γ is gu; R and p are the orientation and the position of the
/// contact's frame, c is the CoM.
///
/// With coupled_yaw these inequalities are those of a force at each corner within the pyramid:
/// eight rows take the place of the last two of C, for the signs r, s, t = ±1 the rows
///
///     r τ_z + s (dy f_x + r μ τ_x) + t (dx f_y + r μ τ_y) ≤ μ (dx + dy) f_z                 (27)
///
/// the last sign changing first (Caron, Pham and Nakamura, ICRA 2015); of inner pyramids μ is
/// μ / √2 here, too. Such a contact has no set, getSet(): the robust solver distributes its forces,
/// which takes two to four times as long, and it shares no wrench with contacts that are more than
/// pyramids.
class DYNACOM_EXPORT Contact6D : public ContactBase {
 public:
  /// A contact that waits for initialize().
  Contact6D() = default;
  /// @throws std::invalid_argument as Contact6DSettings::validate()
  explicit Contact6D(const Contact6DSettings& settings);

  /// Takes new settings; may be called again. The applied force becomes zero, and the frame is
  /// looked up again at the next use.
  /// @throws std::invalid_argument as Contact6DSettings::validate(); nothing has changed then
  void initialize(const Contact6DSettings& settings);

  std::shared_ptr<ContactBase> clone() const override;
  const Contact6DSettings& getSettings() const { return settings_; }
  const std::string& getFrameName() const override { return settings_.frame_name; }
  /// getPose() and SurfaceOptions::placement.
  SE3 getSurfacePose() const override;
  Eigen::Matrix2Xd getCorners() const override;
  double getFrictionUsage() const override;
  double getCoPMargin() const override;
  /// Where yaw is coupled, how much of f_z the rest of the wrench needs by (27), 1 at the limit.
  double getYawUsage() const override;

  /// Each throws std::invalid_argument where the value is out of the range that Contact6DSettings
  /// gives, and NotReadyError before initialize(); the matrices follow at once.
  void setMu(double mu);
  void setGu(double gu);
  void setForceWeights(const Eigen::Vector3d& force_weights);
  void setTorqueWeights(const Eigen::Vector3d& torque_weights);
  void setSurfaceHalfWidth(double half_width);
  void setSurfaceHalfLength(double half_length);

 private:
  template <class Value>
  void change(Value Contact6DSettings::*field, const Value& value);
  void changeWeights(const Vector6& weights);
  void updateMatrices();

  Contact6DSettings settings_;
};

}  // namespace dynacom
