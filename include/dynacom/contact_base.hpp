// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <pinocchio/spatial.hpp>
#include <string>

#include "dynacom/contact_set.hpp"
#include "dynacom/errors.hpp"
#include "dynacom/export.hpp"

namespace dynacom {

/// What every contact is: a frame of the robot, through which the environment gives the robot a
/// force λ, limited by linear inequalities.
///
/// λ is expressed in the surface's frame s, whose z axis is the surface's normal, pointing into the
/// robot. It has cols() components: the force [N], then, for surfaces, the moment [N·m] about the
/// origin of s.
///
///     U λ ≤ u     unilaterality   uni_A(), uni_b()
///     C λ ≤ c     friction        fri_A(), fri_b()
///     wᵢ λᵢ       what is squared and summed in the cost of a distribution: reg_A() holds wᵢ
///     NE λ        the contact's wrench about the CoM, in the world's axes: ne_A()
///
/// The friction inequalities |f_x|, |f_y| ≤ μ f_z are a pyramid around the friction cone: on its
/// diagonals they allow √2 μ f_z.
///
/// A contact is described by its settings, which the derived classes hold. Until it has them,
/// cols() is 0. It may be one DynaCoM's, of which copies know nothing, and which it stays when it
/// is assigned to.
class DYNACOM_EXPORT ContactBase {
 public:
  using SE3 = pinocchio::SE3;
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using FrameIndex = pinocchio::FrameIndex;

  /// The value of getFrameID() as long as nobody has looked the frame up in a model.
  static constexpr FrameIndex kUnknownFrame = std::numeric_limits<FrameIndex>::max();

  virtual ~ContactBase() = default;

  /// A copy of this contact, sharing nothing with it.
  virtual std::shared_ptr<ContactBase> clone() const = 0;

  /// Name of the frame, in the robot's model, that the contact is attached to.
  virtual const std::string& getFrameName() const = 0;

  /// Index of that frame in a model, or kUnknownFrame. DynaCoM::addContact sets it.
  FrameIndex getFrameID() const { return frame_id_; }
  void setFrameID(FrameIndex frame_id) { frame_id_ = frame_id; }

  /// Placement of the contact's frame in the world, as last given to setPose() or
  /// updateNewtonEuler(); the identity before.
  const SE3& getPose() const { return pose_; }
  /// Places the contact's frame, and leaves ne_A() as it is.
  void setPose(const SE3& pose) { pose_ = pose; }

  /// Placement oMs of the surface in the world: getPose(), unless the settings say otherwise
  /// (ContactPointSettings::world_aligned, ContactPointSettings::radius).
  virtual SE3 getSurfacePose() const { return pose_; }

  /// Corners of the surface, in its plane (x, y of s) and in order around it, 2 × corners [m]: of
  /// points, and of kinds that know of none, the origin.
  virtual Eigen::Matrix2Xd getCorners() const { return Eigen::Matrix2Xd::Zero(2, 1); }

  /// Number of rows of uni_A(), of fri_A(), and number of components of λ.
  Eigen::Index uni_rows() const { return uni_A_.rows(); }
  Eigen::Index fri_rows() const { return fri_A_.rows(); }
  Eigen::Index cols() const { return reg_A_.size(); }

  /// Unilaterality, uni_rows() × cols(), and its right-hand side, uni_rows(), which is zero unless
  /// the normal force has bounds.
  const Eigen::MatrixXd& uni_A() const { return uni_A_; }
  const Eigen::VectorXd& uni_b() const { return uni_b_; }

  /// Friction, fri_rows() × cols(), and its right-hand side, fri_rows(), which is zero. Of a
  /// friction cone it has the pyramid around it.
  const Eigen::MatrixXd& fri_A() const { return fri_A_; }
  const Eigen::VectorXd& fri_b() const { return fri_b_; }

  /// Weights wᵢ of the components of λ in the cost ½ Σ (wᵢ λᵢ)², and the value that the cost pulls
  /// λ to, which is zero unless there is a reference; cols() each.
  const Eigen::VectorXd& reg_A() const { return reg_A_; }
  const Eigen::VectorXd& reg_b() const { return reg_b_; }

  /// The set of λ; nothing for kinds that are described by matrices alone.
  const std::optional<ContactSet>& getSet() const { return set_; }
  /// Whether λ is in the pyramid uni_A() λ ≤ 0, fri_A() λ ≤ 0, and the cost pulls it to zero: then
  /// distributions have a multiplier for each of these inequalities.
  bool isPyramid() const { return is_pyramid_; }

  /// Number of these matrices, but for ne_A(): another one whenever they may have changed, and no
  /// other contact's unless they are copies of each other; 0 before there are any.
  std::uint64_t getRevision() const { return revision_; }

  /// Newton–Euler matrix, 6 × cols(), at the pose and the CoM of the last updateNewtonEuler(): it
  /// takes λ to the wrench (force, moment) about the CoM in the world's axes.
  const Eigen::Matrix<double, 6, Eigen::Dynamic>& ne_A() const { return ne_A_; }

  /// Sets the pose and brings ne_A() up to date.
  /// @param com  position of the centre of mass, world [m]
  /// @param oMs  placement of the contact's frame in the world; where the surface is, is up to
  ///             getSurfacePose()
  void updateNewtonEuler(const Eigen::Vector3d& com, const SE3& oMs);

  /// The force λ in force, cols() components; zero before applyForce().
  const Eigen::VectorXd& appliedForce() const { return force_; }

  /// Records the force λ that acts here.
  /// @throws std::invalid_argument if force does not have cols() components
  void applyForce(const Eigen::Ref<const Eigen::VectorXd>& force);

  /// Nothing acts here any more: the applied force is zero.
  void deactivate() { force_.setZero(); }

  /// The applied force as a wrench (force [N], moment [N·m]) in the world's axes, about the world's
  /// origin.
  Vector6 toWorldForces() const;

  /// The same, about the CoM of the last updateNewtonEuler().
  Vector6 toCoMForces() const { return ne_A_ * force_; }

  /// Centre of pressure of the applied force, in the surface's plane (x, y of s) [m]; NaN unless
  /// the normal force is positive.
  Eigen::Vector2d getCoP() const;

  /// How much of the friction that the applied force allows it uses: the larger of |f_x| and |f_y|
  /// over μ f_z, 1 on the pyramid; of other friction SurfaceOptions::findTangential() over that.
  /// NaN where there is no friction to use (μ = 0), and for kinds that know of none; else 0 where
  /// there is no force, and infinite where there is one without a positive normal force.
  virtual double getFrictionUsage() const;
  /// Distance of getCoP() to the nearest edge of the surface, negative beyond it [m]; NaN unless
  /// the normal force is positive, and for kinds without edges.
  virtual double getCoPMargin() const;
  /// The same as getFrictionUsage() for the yaw moment: |τ_z| over γ f_z.
  virtual double getYawUsage() const;

 protected:
  ContactBase() = default;
  ContactBase(const ContactBase&) = default;
  ContactBase& operator=(const ContactBase&) = default;

  /// The larger of some components' magnitudes over a limit per normal force, as
  /// getFrictionUsage().
  double getUsage(double tangential, double coefficient) const;

  /// Gives the contact its matrices; what else it has stays, unless cols() has changed.
  /// @param uni_A, fri_A  uni_A() and fri_A(), as many columns as reg_A has components
  /// @param reg_A         reg_A(): 3 weights, of a force, or 6, of a force and a moment
  /// @throws std::invalid_argument if the sizes are others
  void setMatrices(const Eigen::Ref<const Eigen::MatrixXd>& uni_A,
                   const Eigen::Ref<const Eigen::MatrixXd>& fri_A,
                   const Eigen::Ref<const Eigen::VectorXd>& reg_A);

  /// The same for one whose pyramid is known as a set.
  void setMatrices(const Eigen::Ref<const Eigen::MatrixXd>& uni_A,
                   const Eigen::Ref<const Eigen::MatrixXd>& fri_A,
                   const Eigen::Ref<const Eigen::VectorXd>& reg_A, const ContactSet& set);

  /// The same for a contact of another set, or with a force that the cost pulls to.
  /// @param uni_b, fri_b, reg_b  right-hand sides
  /// @param set  set.size() components
  void setMatrices(const Eigen::Ref<const Eigen::MatrixXd>& uni_A,
                   const Eigen::Ref<const Eigen::VectorXd>& uni_b,
                   const Eigen::Ref<const Eigen::MatrixXd>& fri_A,
                   const Eigen::Ref<const Eigen::VectorXd>& fri_b,
                   const Eigen::Ref<const Eigen::VectorXd>& reg_A,
                   const Eigen::Ref<const Eigen::VectorXd>& reg_b, const ContactSet& set);

  /// Gives the contact other weights, and nothing else: that allocates nothing.
  /// @param reg_A  as many components as before
  /// @throws std::invalid_argument if there are others
  void setWeights(const Eigen::Ref<const Eigen::VectorXd>& reg_A);

  /// Forgets frame index, force and ne_A(). For initialize(), after setMatrices().
  void reset();

 private:
  friend class DynaCoM;

  // Whether a DynaCoM has this contact, whatever is copied from it or assigned to it.
  struct Taken {
    Taken() = default;
    Taken(const Taken&) {}
    Taken& operator=(const Taken&) { return *this; }

    bool value = false;
  };

  Eigen::MatrixXd uni_A_, fri_A_;
  Eigen::VectorXd reg_A_;
  std::uint64_t revision_ = 0;
  Eigen::VectorXd uni_b_, fri_b_, reg_b_;
  std::optional<ContactSet> set_;
  bool is_pyramid_ = false;
  Eigen::Matrix<double, 6, Eigen::Dynamic> ne_A_;
  FrameIndex frame_id_ = kUnknownFrame;
  SE3 pose_ = SE3::Identity();
  Eigen::VectorXd force_;
  Taken taken_;
};

}  // namespace dynacom
