// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <iosfwd>
#include <memory>
#include <pinocchio/multibody.hpp>
#include <string>
#include <vector>

#include "dynacom/centroidal.hpp"
#include "dynacom/contact_base.hpp"
#include "dynacom/ground_plane.hpp"
#include "dynacom/wrench_distribution.hpp"

namespace dynacom {

namespace internal {
class ConfigurationCheck;
}

/// What describes a DynaCoM.
struct DYNACOM_EXPORT DynaCoMSettings {
  /// The robot: path of a URDF file, or the XML itself. Its root joint will be a free-flyer: its
  /// own, where a massless root link holds all others by a floating joint, whose origin is left
  /// out.
  std::string urdf;
  /// Gravity, along −z or zero [m/s²].
  Eigen::Vector3d gravity = Eigen::Vector3d(0., 0., -9.81);

  /// @throws std::invalid_argument naming the first field out of its range
  void validate() const;
  std::string to_string() const;
  bool operator==(const DynaCoMSettings& other) const;
  bool operator!=(const DynaCoMSettings& other) const { return !(*this == other); }
};

DYNACOM_EXPORT std::ostream& operator<<(std::ostream& out, const DynaCoMSettings& settings);

/// The ground wrench of a robot in motion, where it presses, and how the contacts share it.
///
/// A DynaCoM owns a model, its data and an ordered list of contacts: the active ones, in the order
/// of their activation, then the others. Matrices and forces are stacked in that order. Copying a
/// DynaCoM copies its contacts too, so that a copy can work in another thread. One that was moved
/// from has no robot and no contacts, and waits for initialize() as a new one does; what it still
/// says of a motion means nothing.
///
/// Vectors have the sizes of Pinocchio: q has getModel().nq components, v and a have getModel().nv.
/// Everything is in the world's axes unless another frame is named. Before computeDynamics() all
/// numbers of the motion are NaN.
///
/// Once the contacts are added, computeDynamics(), computeNL(), distributeForce(),
/// activateContact(), deactivateContact(), setContactPose() and the getters that return references
/// or small vectors neither allocate, nor lock, nor call the system, nor print, and throw only for
/// mistakes in the program: a vector of the wrong size, a contact whose frame does not exist. That
/// a contact is initialised again counts as adding it.
class DYNACOM_EXPORT DynaCoM {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  using VectorRef = Eigen::Ref<const Eigen::VectorXd>;

  /// A DynaCoM that waits for initialize(): until then it has no mass and no contacts, and neither
  /// computes nor takes any (NotReadyError).
  DynaCoM();
  /// @throws std::invalid_argument as initialize(settings)
  explicit DynaCoM(const DynaCoMSettings& settings);
  /// @throws std::invalid_argument as initialize(model)
  explicit DynaCoM(const pinocchio::Model& model);

  /// Reads the robot and forgets the contacts, not the ground's height; may be called again.
  /// Nothing has changed when it throws.
  /// @throws std::invalid_argument if the settings are not valid, the URDF cannot be read, or the
  ///         robot has no mass
  void initialize(const DynaCoMSettings& settings);

  /// The same for a model, which is copied, with its gravity; the settings' urdf will be empty.
  /// @throws std::invalid_argument if gravity does not lie along −z, or the robot has no mass
  void initialize(const pinocchio::Model& model);

  /// Whether there is a robot: false before initialize().
  bool isInitialized() const { return configuration_check_ != nullptr; }

  const DynaCoMSettings& getSettings() const { return settings_; }
  const pinocchio::Model& getModel() const { return model_; }
  const pinocchio::Data& getData() const { return data_; }
  /// One may run Pinocchio's algorithms on it between two calls: contacts are placed by its oMi.
  pinocchio::Data& getData() { return data_; }
  /// Mass of the robot [kg]; 0 before initialize().
  double getMass() const { return isInitialized() ? mass_ : 0.; }

  /// Height of the flat horizontal ground in the world, 0 by default [m].
  double getGroundHeight() const { return ground_height_; }
  /// @throws std::invalid_argument unless groundHeight is finite
  void setGroundHeight(double groundHeight);

  /// Below this vertical force a centre of pressure means nothing, kMinimalVerticalForce by default
  /// [N]: getCoP() is NaN then; and below this normal force, a contact's getContactCoP(), and what
  /// is to be found on a GroundPlane.
  double getMinimalVerticalForce() const { return minimal_vertical_force_; }
  /// @throws std::invalid_argument unless minimalVerticalForce is finite and > 0
  void setMinimalVerticalForce(double minimalVerticalForce);

  /// Weights of the norm in which a wrench that is out of reach is replaced by the closest that the
  /// contacts can give, see WrenchDistribution::setWrenchWeights().
  const Vector6& getWrenchWeights() const { return distribution_.getWrenchWeights(); }
  /// @throws std::invalid_argument unless all are finite and > 0
  void setWrenchWeights(const Vector6& weights) { distribution_.setWrenchWeights(weights); }

  /// Whether a distribution starts from the inequalities that were active in the last one, contact
  /// by contact, as is the default; also of a contact that was deactivated in between, if it missed
  /// no more than ten distributions. See WrenchDistribution::setWarmStart().
  bool getWarmStart() const { return distribution_.getWarmStart(); }
  void setWarmStart(bool warmStart) { distribution_.setWarmStart(warmStart); }

  /// How many iterations a distribution may take, WrenchDistribution::kMaximalIterations by
  /// default. That is for those who can wait: a controller sets 50, or what docs/real_time.md says
  /// of the time that it has. What needs more ends as DistributionStatus::NumericalFailure, and the
  /// forces stay those of the last answer. See WrenchDistribution::setMaximalIterations().
  int getMaximalIterations() const { return distribution_.getMaximalIterations(); }
  /// @throws std::invalid_argument unless maximalIterations > 0
  void setMaximalIterations(int maximalIterations) {
    distribution_.setMaximalIterations(maximalIterations);
  }

  /// Computes the centroidal state, the ground wrench by equations (1, 2), the placement of all
  /// known contacts, and the centre of pressure. On flat horizontal ground that is equation (5).
  /// Elsewhere the wrench is first distributed, see distributeForce(), and from what the contacts
  /// achieve of it equation (6) gives the centre of the vertical pressures,
  ///
  ///     p = S τᵒ / f_z,   τᵒ = Σ p_k × (f_k·ẑ) ẑ,   f_z = Σ f_k·ẑ
  ///
  /// with p_k the centre of pressure of contact k and f_k its force. Contacts without load drop
  /// out.
  ///
  /// If a number is not finite, or becomes so, or a quaternion's norm is not 1 (up to 1e-3), all
  /// results of the motion are NaN; a distribution on uneven ground ends as
  /// DistributionStatus::InvalidInput. On flat ground there is none: forces and getDistribution()
  /// stay those of the last one.
  /// @param q          configuration, model().nq, its quaternions of norm 1
  /// @param v, a       velocity and acceleration, model().nv
  /// @param extWrench  (force [N], moment [N·m]) on the robot besides the contacts', about the CoM
  /// @throws std::invalid_argument if a vector has the wrong size; NotReadyError before
  ///         initialize()
  void computeDynamics(const VectorRef& q, const VectorRef& v, const VectorRef& a,
                       const Vector6& extWrench = Vector6::Zero(),
                       bool flatHorizontalGround = true);

  /// The same on any plane, a slope or a wall: the centre of pressure is that of the ground wrench
  /// by equation (21), so that it is where lateral forces put it, too. Nothing is distributed, as
  /// on flat horizontal ground, which is the plane with getGroundHeight() and the normal z.
  /// @throws std::invalid_argument if the plane is not valid, else as above; nothing has changed
  ///         then
  void computeDynamics(const VectorRef& q, const VectorRef& v, const VectorRef& a,
                       const Vector6& extWrench, const GroundPlane& ground);

  /// The first for a motion of which all that Pinocchio computes is known:
  /// computeCentroidalMomentumTimeVariation(getModel(), data, q, v, a) has run on data, and nothing
  /// since that changes its com, vcom, hg, dhg, mass or oMi. Those are read, and oMi is copied to
  /// getData(), so that contacts can be placed later; nothing else in getData() is that of the
  /// motion.
  /// @throws std::invalid_argument if data has another number of joints; NotReadyError if its mass
  ///         is not the robot's, because that algorithm has never run on it, and before
  ///         initialize()
  void computeDynamics(const pinocchio::Data& data, const Vector6& extWrench = Vector6::Zero(),
                       bool flatHorizontalGround = true);
  /// And on any plane.
  void computeDynamics(const pinocchio::Data& data, const Vector6& extWrench,
                       const GroundPlane& ground);

  /// Of the last computeDynamics(): the wrench that the ground must give, about the CoM.
  const Eigen::Vector3d& getGroundCoMForce() const { return ground_wrench_.force; }    ///< [N]
  const Eigen::Vector3d& getGroundCoMTorque() const { return ground_wrench_.torque; }  ///< [N·m]
  /// Of the last computeDynamics(): position, velocity and acceleration of the CoM.
  const Eigen::Vector3d& getCoM() const { return state_.com; }    ///< [m]
  const Eigen::Vector3d& getVCoM() const { return state_.vcom; }  ///< [m/s]
  const Eigen::Vector3d& getACoM() const { return state_.acom; }  ///< [m/s²]
  /// Of the last computeDynamics(): angular momentum about the CoM, and its rate.
  const Eigen::Vector3d& getAM() const { return state_.am; }                    ///< [kg·m²/s]
  const Eigen::Vector3d& getAMVariation() const { return state_.amVariation; }  ///< [N·m]
  /// Of the last computeDynamics(): x and y of the centre of pressure [m]; NaN unless
  /// isCoPDefined().
  const Eigen::Vector2d& getCoP() const { return cop_; }
  /// The whole of it: on the ground's plane, or, on uneven ground, the mean of the contacts' p_k.
  const Eigen::Vector3d& getCoP3D() const { return cop_3d_; }
  /// Whether there is a centre of pressure: the vertical force, on a GroundPlane that along its
  /// normal, is getMinimalVerticalForce() or more.
  bool isCoPDefined() const { return cop_.allFinite(); }

  /// Centroidal moment pivot of the last computeDynamics() on a plane, equation (22): where the
  /// line along the ground's force through the CoM meets it. The force is the one of which
  /// getCoP() is: getGroundCoMForce(), or, on uneven ground, what the contacts achieve of it.
  /// @return world [m]; NaN where the force along the normal is below getMinimalVerticalForce()
  /// @throws std::invalid_argument if the plane is not valid
  Eigen::Vector3d getCMP(const GroundPlane& plane) const;

  /// The accelerations that the contacts can really cause, by the wrench (f, τ) that the last
  /// distribution since computeDynamics() has achieved and that call's extWrench (f_e, τ_e),
  ///
  ///     c̈ = (f + f_e)/m + g      L̇ = τ + τ_e
  ///
  /// which are those of the motion if the distribution is DistributionStatus::Solved. NaN before.
  const Eigen::Vector3d& getFeasibleACoM() const { return feasible_.acom; }  ///< [m/s²]
  const Eigen::Vector3d& getFeasibleAMVariation() const {                    ///< [N·m]
    return feasible_.amVariation;
  }

  /// Computes the virtual repellent point v = c − c̈/ω² and the non-linearity n = p − v, equations
  /// (7, 8), of the last computeDynamics(). Where that has distributed the wrench, because the
  /// ground is not flat, c̈ is getFeasibleACoM(), so that p and v are those of one motion.
  /// @param omega  ω > 0 [rad/s]
  /// @throws std::invalid_argument unless ω is finite and > 0; NotReadyError before
  ///         computeDynamics()
  void computeNL(double omega);

  /// computeDynamics() and computeNL(omega).
  void computeNL(double omega, const VectorRef& q, const VectorRef& v, const VectorRef& a,
                 const Vector6& extWrench = Vector6::Zero(), bool flatHorizontalGround = true);
  /// And on any plane.
  void computeNL(double omega, const VectorRef& q, const VectorRef& v, const VectorRef& a,
                 const Vector6& extWrench, const GroundPlane& ground);

  const Eigen::Vector2d& getVRP() const { return vrp_; }  ///< Of the last computeNL() [m].
  const Eigen::Vector2d& getNL() const { return nl_; }    ///< The same; NaN where the CoP is [m].
  /// Of the last computeNL(): virtual repellent point, whose x and y getVRP() has, and enhanced
  /// centroidal moment pivot, equation (23), of the same c̈ [m].
  const Eigen::Vector3d& getVRP3D() const { return vrp_3d_; }
  const Eigen::Vector3d& getECMP() const { return ecmp_; }

  /// Makes a contact known under a name, and active unless said otherwise. It is shared, not
  /// copied: settings that change in the caller's hand act on the next call. A contact serves one
  /// DynaCoM at a time, which sets its frame index, its pose and its force; it is free again once
  /// it was removed, or that DynaCoM was initialised again or is gone.
  /// @throws std::invalid_argument if the contact is null, was never initialised or is known
  ///         already, here or to another DynaCoM, the name is taken, or the model does not have one
  ///         frame of the contact's name
  void addContact(const std::shared_ptr<ContactBase>& contact, const std::string& name,
                  bool active = true);
  /// Forgets a contact; its force becomes zero.
  /// @throws std::invalid_argument if the name is not known, as the next two
  void removeContact(const std::string& name);
  /// The contact takes part from now on, as the last one in order; does nothing if it does already.
  void activateContact(const std::string& name);
  /// The contact's force becomes zero, and it takes no part; does nothing if it takes none already.
  void deactivateContact(const std::string& name);

  /// The names that these functions had when there were 6D contacts only. They take any contact.
  void addContact6d(const std::shared_ptr<ContactBase>& contact, const std::string& name,
                    bool active = true) {
    addContact(contact, name, active);
  }
  void removeContact6d(const std::string& name) { removeContact(name); }
  void activateContact6d(const std::string& name) { activateContact(name); }
  void deactivateContact6d(const std::string& name) { deactivateContact(name); }

  /// Places a contact's frame where it was measured, wherever the model says that it is: from now
  /// on, until it is set again or resetContactPose().
  /// @param oMs  placement of the contact's frame in the world; see ContactBase::getSurfacePose()
  /// @throws std::invalid_argument if the name is not known
  void setContactPose(const std::string& name, const pinocchio::SE3& oMs);
  /// Places a contact by the model again, from the next computeDynamics() or distributeForce() on.
  /// @throws std::invalid_argument if the name is not known
  void resetContactPose(const std::string& name);

  /// @throws std::invalid_argument if the name is not known
  std::shared_ptr<ContactBase> getContact(const std::string& name) const;
  /// Names of the active contacts, in the order of their activation.
  std::vector<std::string> getActiveContacts() const;
  /// Names of all contacts: the active ones as above, then the others.
  std::vector<std::string> getKnownContacts() const;

  /// Shares a wrench between the active contacts, placed by getData() or setContactPose(): the
  /// cheapest forces that give it within all inequalities, equations (9–13), or the closest wrench
  /// that they can give. Each contact is given its force. What it all amounts to is in
  /// getDistribution().
  ///
  /// DistributionStatus says which case it was. Where there is no answer (InvalidInput,
  /// NumericalFailure), forces are those of the last one, unless a contact was activated or
  /// deactivated, or an active one was removed or given other settings since: then they are zero.
  /// @param groundCoMForce   [N]
  /// @param groundCoMTorque  about the CoM [N·m]
  /// @param com              position of the CoM, which the moments are about [m]; that of
  ///                         getCoM(), or getFeasibleAMVariation() means nothing
  /// @throws std::invalid_argument if active contacts cannot share a wrench: soles of coupled yaw
  ///         and ones that are more than pyramids, see WrenchDistribution::add()
  DistributionStatus distributeForce(const Eigen::Vector3d& groundCoMForce,
                                     const Eigen::Vector3d& groundCoMTorque,
                                     const Eigen::Vector3d& com);
  /// Forgets which inequalities were active, and forces that would be kept: the next distribution
  /// starts cold, and does not depend on those before.
  void forgetAnswers() { distribution_.forgetAnswers(); }
  /// The last distribution, be it distributeForce()'s or that of computeDynamics() on uneven
  /// ground; its contacts are those that were active then, in the order of their activation. What
  /// was computed or activated since has not changed it.
  const DistributionResult& getDistribution() const { return distribution_.result(); }
  /// The last distribution's status; DistributionStatus::NoContact before the first.
  DistributionStatus getDistributionStatus() const { return getDistribution().status; }
  /// How far the wrench of the last distribution is from what its contacts cannot give. Takes many
  /// times as long as a distribution.
  WrenchMargin computeWrenchMargin() { return distribution_.computeMargin(); }

  /// Zero-moment point of the last distribution on a plane: equation (21) of the wrench that its
  /// contacts achieve, wherever they stand. On a plane on which all of them stand it is their
  /// centre of pressure.
  /// @return world [m]; NaN where the force along the normal is below getMinimalVerticalForce()
  /// @throws std::invalid_argument if the plane is not valid
  Eigen::Vector3d getZMP(const GroundPlane& plane) const;

  /// Of the last distribution, for a contact: its centre of pressure, in its surface's plane [m];
  /// NaN where its normal force is below getMinimalVerticalForce().
  /// @throws std::invalid_argument if the name is not known, as the next three
  Eigen::Vector2d getContactCoP(const std::string& name) const;
  /// ContactBase::getFrictionUsage(), getCoPMargin() [m] and getYawUsage(). Where the normal force
  /// is below getMinimalVerticalForce(), the margin is NaN, and a usage 0, unless it is NaN for all
  /// forces of the contact.
  double getContactFrictionUsage(const std::string& name) const;
  double getContactCoPMargin(const std::string& name) const;
  double getContactYawUsage(const std::string& name) const;

  /// Of the active contacts, stacked: block-diagonal U and C, their right-hand sides, the weights,
  /// and the matrix NE (6 rows), as the contacts hold them now.
  Eigen::MatrixXd uni_A() const;
  Eigen::VectorXd uni_b() const;
  Eigen::MatrixXd fri_A() const;
  Eigen::VectorXd fri_b() const;
  Eigen::VectorXd reg_A() const;
  Eigen::VectorXd reg_b() const;
  Eigen::MatrixXd ne_A() const;
  /// The wrench (force, moment) about the CoM that the last distribution was asked for.
  const Vector6& ne_b() const { return getDistribution().wrench; }
  /// The forces of the active contacts, stacked, each in its surface's frame.
  Eigen::VectorXd allForces() const;

 private:
  // A contact that is this robot's, as long as this lives. A copy has a contact of its own; a move
  // keeps it.
  class OwnContact {
   public:
    explicit OwnContact(std::shared_ptr<ContactBase> contact);
    OwnContact(const OwnContact& other);
    OwnContact(OwnContact&&) noexcept = default;
    OwnContact& operator=(OwnContact other) noexcept;
    ~OwnContact();

    const std::shared_ptr<ContactBase>& get() const { return contact_; }
    ContactBase& operator*() const { return *contact_; }
    ContactBase* operator->() const { return contact_.get(); }

   private:
    std::shared_ptr<ContactBase> contact_;
  };

  struct Entry {
    std::string name;
    OwnContact contact;
    std::size_t slot;  // of the distribution
    bool active = false;
    bool measured = false;  // placed by setContactPose()
  };

  void setModel(pinocchio::Model&& model, DynaCoMSettings&& settings);
  void forgetMotion();
  void requireInitialized() const;
  bool hasMotion() const;
  std::vector<Entry>::const_iterator find(const std::string& name) const;
  std::vector<Entry>::iterator find(const std::string& name);
  std::vector<Entry>::iterator firstInactive();
  void updateFrames();
  void place(const Entry& entry, const Eigen::Vector3d& com);
  void readMotion(const VectorRef& q, const VectorRef& v, const VectorRef& a,
                  const Vector6& extWrench);
  void readMotion(const pinocchio::Data& data, const Vector6& extWrench);
  void takeMotion(const CentroidalState& state, bool finite, const Vector6& extWrench);
  void press(bool flatHorizontalGround);
  void pressOn(const GroundPlane& ground);
  void pressByContacts();
  std::size_t findFreeSlot() const;
  bool isLoaded(const ContactBase& contact) const;
  double getUsage(const std::string& name, double (ContactBase::*usage)() const) const;
  void setCoP(const Eigen::Vector3d& cop);
  Eigen::Vector3d computePressureCentre() const;
  template <class Rows, class Block>
  Eigen::MatrixXd stackDiagonally(Rows rows, Block block) const;
  template <class Block>
  Eigen::VectorXd stack(Block block) const;

  DynaCoMSettings settings_;
  pinocchio::Model model_;
  pinocchio::Data data_;
  std::shared_ptr<const internal::ConfigurationCheck> configuration_check_;  // of the robot
  double mass_ = 0.;
  double ground_height_ = 0.;
  double minimal_vertical_force_ = kMinimalVerticalForce;

  CentroidalState state_;
  CentroidalWrench ground_wrench_;
  Vector6 ext_wrench_;
  CentroidalState feasible_;  // the state with the accelerations that contacts can cause
  CentroidalState pressing_;  // state_ or feasible_: the motion whose CoP and VRP are reported
  Eigen::Vector2d cop_, vrp_, nl_;
  Eigen::Vector3d cop_3d_, vrp_3d_, ecmp_;

  std::vector<Entry> contacts_;  // the active ones first
  WrenchDistribution distribution_;
  Eigen::Vector3d distribution_com_;  // which the last distribution's moments are about
};

}  // namespace dynacom
