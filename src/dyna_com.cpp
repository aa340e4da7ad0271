// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/dyna_com.hpp"

#include <algorithm>
#include <cmath>
#include <ostream>
#include <pinocchio/algorithm/center-of-mass.hpp>
#include <utility>

#include "check.hpp"
#include "contact_frame.hpp"
#include "motion_check.hpp"
#include "nan.hpp"
#include "standard_gravity.hpp"
#include "urdf.hpp"

namespace dynacom {

using internal::areFinite;
using internal::findFrame;
using internal::kNaN;
using internal::throwInvalid;

namespace {

// By what part sums of the same masses may differ.
constexpr double kSameMass = 1e-9;

CentroidalState unknownState(double mass) {
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(kNaN);
  return {mass, nan, nan, nan, nan, nan};
}

pinocchio::SE3 unknownPlacement() {
  return {Eigen::Matrix3d::Constant(kNaN), Eigen::Vector3d::Constant(kNaN)};
}

bool isFinite(const CentroidalState& state) {
  return state.com.allFinite() && state.vcom.allFinite() && state.acom.allFinite() &&
         state.am.allFinite() && state.amVariation.allFinite();
}

}  // namespace

void DynaCoMSettings::validate() const {
  internal::requireField(
      gravity.allFinite() && gravity.x() == 0. && gravity.y() == 0. && gravity.z() <= 0.,
      "DynaCoMSettings.gravity", "along -z or zero", gravity.transpose());
}

std::string DynaCoMSettings::to_string() const { return internal::concat(*this); }

bool DynaCoMSettings::operator==(const DynaCoMSettings& other) const {
  return urdf == other.urdf && gravity == other.gravity;
}

std::ostream& operator<<(std::ostream& out, const DynaCoMSettings& settings) {
  return out << "DynaCoMSettings(urdf='" << settings.urdf << "', gravity=["
             << settings.gravity.transpose() << "])";
}

DynaCoM::OwnContact::OwnContact(std::shared_ptr<ContactBase> contact)
    : contact_(std::move(contact)) {
  contact_->taken_.value = true;
}

DynaCoM::OwnContact::OwnContact(const OwnContact& other) : OwnContact(other->clone()) {}

DynaCoM::OwnContact& DynaCoM::OwnContact::operator=(OwnContact other) noexcept {
  contact_.swap(other.contact_);
  return *this;
}

DynaCoM::OwnContact::~OwnContact() {
  if (contact_) contact_->taken_.value = false;
}

DynaCoM::DynaCoM() { forgetMotion(); }
DynaCoM::DynaCoM(const DynaCoMSettings& settings) { initialize(settings); }
DynaCoM::DynaCoM(const pinocchio::Model& model) { initialize(model); }

void DynaCoM::initialize(const DynaCoMSettings& settings) {
  settings.validate();
  pinocchio::Model model = internal::readUrdf(settings.urdf);
  model.gravity.linear() = settings.gravity;
  setModel(std::move(model), DynaCoMSettings(settings));
}

void DynaCoM::initialize(const pinocchio::Model& model) {
  DynaCoMSettings settings;
  settings.gravity = model.gravity.linear();
  settings.validate();
  setModel(pinocchio::Model(model), std::move(settings));
}

void DynaCoM::setModel(pinocchio::Model&& model, DynaCoMSettings&& settings) {
  const double mass = pinocchio::computeTotalMass(model);
  if (!(mass > 0.)) throwInvalid("the robot '", model.name, "' must have a mass > 0, got ", mass);
  if (std::isinf(mass)) throwInvalid("the robot '", model.name, "' must have a finite mass");
  pinocchio::Data data(model);
  auto configuration_check = std::make_shared<const internal::ConfigurationCheck>(model);
  for (Entry& entry : contacts_) entry.contact->deactivate();
  contacts_.clear();
  settings_ = std::move(settings);
  model_ = std::move(model);
  data_ = std::move(data);
  configuration_check_ = std::move(configuration_check);
  mass_ = mass;
  forgetMotion();
}

// Sets all numbers of the motion to NaN, as before the first computeDynamics().
void DynaCoM::forgetMotion() {
  const Eigen::Vector3d nan = Eigen::Vector3d::Constant(kNaN);
  state_ = unknownState(kNaN);
  ground_wrench_ = {nan, nan};
  ext_wrench_.setConstant(kNaN);
  feasible_ = pressing_ = state_;
  cop_ = vrp_ = nl_ = nan.head<2>();
  cop_3d_ = vrp_3d_ = ecmp_ = distribution_com_ = nan;
  distribution_.reset();
}

void DynaCoM::requireInitialized() const {
  if (!isInitialized()) throw NotReadyError("DynaCoM is used before initialize()");
}

bool DynaCoM::hasMotion() const { return !std::isnan(state_.mass); }

void DynaCoM::setGroundHeight(double groundHeight) {
  if (!std::isfinite(groundHeight)) throwInvalid("groundHeight must be finite, got ", groundHeight);
  ground_height_ = groundHeight;
}

void DynaCoM::setMinimalVerticalForce(double minimalVerticalForce) {
  if (!std::isfinite(minimalVerticalForce) || !(minimalVerticalForce > 0.))
    throwInvalid("minimalVerticalForce must be finite and > 0 N, got ", minimalVerticalForce);
  minimal_vertical_force_ = minimalVerticalForce;
}

void DynaCoM::computeDynamics(const VectorRef& q, const VectorRef& v, const VectorRef& a,
                              const Vector6& extWrench, bool flatHorizontalGround) {
  readMotion(q, v, a, extWrench);
  press(flatHorizontalGround);
}

void DynaCoM::computeDynamics(const VectorRef& q, const VectorRef& v, const VectorRef& a,
                              const Vector6& extWrench, const GroundPlane& ground) {
  ground.validate();
  readMotion(q, v, a, extWrench);
  pressOn(ground);
}

void DynaCoM::computeDynamics(const pinocchio::Data& data, const Vector6& extWrench,
                              bool flatHorizontalGround) {
  readMotion(data, extWrench);
  press(flatHorizontalGround);
}

void DynaCoM::computeDynamics(const pinocchio::Data& data, const Vector6& extWrench,
                              const GroundPlane& ground) {
  ground.validate();
  readMotion(data, extWrench);
  pressOn(ground);
}

void DynaCoM::readMotion(const VectorRef& q, const VectorRef& v, const VectorRef& a,
                         const Vector6& extWrench) {
  requireInitialized();
  updateFrames();
  const CentroidalState state = computeCentroidalState(model_, data_, q, v, a);
  const bool finite = areFinite(q) && areFinite(v) && areFinite(a);
  const bool normalized = configuration_check_->isNormalized(model_, q);
  // Numbers that are not finite make all placements so that hang on them; wrong norms do not.
  if (finite && !normalized)
    for (pinocchio::SE3& oMi : data_.oMi) oMi = unknownPlacement();
  takeMotion(state, finite && normalized, extWrench);
}

void DynaCoM::readMotion(const pinocchio::Data& data, const Vector6& extWrench) {
  requireInitialized();
  internal::requireSize("data.oMi", Eigen::Index(data.oMi.size()), Eigen::Index(model_.njoints),
                        "placements (one per joint)");
  const CentroidalState state = readCentroidalState(data);
  if (!(std::abs(state.mass - mass_) <= kSameMass * mass_))
    throw NotReadyError(internal::concat(
        "DynaCoM::computeDynamics(data) needs computeCentroidalMomentumTimeVariation(model, data, "
        "q, v, a) before: data's mass must be ",
        mass_, " kg, got ", state.mass));
  updateFrames();
  data_.oMi = data.oMi;
  takeMotion(state, true, extWrench);
}

// What follows from a state, be it finite or not; if what it was computed from is not finite, it is
// not to be trusted either.
void DynaCoM::takeMotion(const CentroidalState& state, bool finite, const Vector6& extWrench) {
  state_ = state;
  ext_wrench_ = extWrench;
  ground_wrench_ = computeGroundWrench(state_, settings_.gravity, ext_wrench_);
  const bool known = finite && extWrench.allFinite() && isFinite(state_) &&
                     ground_wrench_.force.allFinite() && ground_wrench_.torque.allFinite();
  if (!known) {
    // There is a motion, of which nothing is known: not even what happens to be finite.
    state_ = unknownState(mass_);
    vrp_ = nl_ = Eigen::Vector2d::Constant(kNaN);
    vrp_3d_ = ecmp_ = Eigen::Vector3d::Constant(kNaN);
    ext_wrench_.setConstant(kNaN);
    ground_wrench_ = computeGroundWrench(state_, settings_.gravity, ext_wrench_);
  }
  for (const Entry& entry : contacts_) place(entry, state_.com);

  feasible_ = unknownState(mass_);
  pressing_ = state_;
}

void DynaCoM::press(bool flatHorizontalGround) {
  if (flatHorizontalGround)
    pressOn({Eigen::Vector3d(0., 0., ground_height_), Eigen::Vector3d::UnitZ()});  // (5)
  else
    pressByContacts();
}

void DynaCoM::pressOn(const GroundPlane& ground) {
  setCoP(computeCoP(ground_wrench_, state_.com, ground, minimal_vertical_force_));
}

void DynaCoM::pressByContacts() {
  distributeForce(ground_wrench_.force, ground_wrench_.torque, state_.com);
  pressing_ = feasible_;
  // Of a motion that is not known, contacts keep the forces of another.
  setCoP(isFinite(state_) ? computePressureCentre() : Eigen::Vector3d::Constant(kNaN));
}

void DynaCoM::setCoP(const Eigen::Vector3d& cop) {
  cop_3d_ = cop;
  cop_ = cop.head<2>();
}

void DynaCoM::computeNL(double omega) {
  requireInitialized();
  if (!hasMotion()) throw NotReadyError("DynaCoM::computeNL needs computeDynamics() before");
  vrp_ = computeVRP(pressing_, omega);
  vrp_3d_ = computeVRP3D(pressing_, omega);
  ecmp_ = computeECMP(pressing_, settings_.gravity, omega);
  nl_ = cop_ - vrp_;  // (8)
}

void DynaCoM::computeNL(double omega, const VectorRef& q, const VectorRef& v, const VectorRef& a,
                        const Vector6& extWrench, bool flatHorizontalGround) {
  internal::requireOmega(omega);  // before anything changes
  computeDynamics(q, v, a, extWrench, flatHorizontalGround);
  computeNL(omega);
}

void DynaCoM::computeNL(double omega, const VectorRef& q, const VectorRef& v, const VectorRef& a,
                        const Vector6& extWrench, const GroundPlane& ground) {
  internal::requireOmega(omega);
  computeDynamics(q, v, a, extWrench, ground);
  computeNL(omega);
}

void DynaCoM::addContact(const std::shared_ptr<ContactBase>& contact, const std::string& name,
                         bool active) {
  requireInitialized();
  if (!contact) throwInvalid("contact '", name, "' must not be null");
  if (contact->cols() == 0) throwInvalid("contact '", name, "' was never initialised");
  for (const Entry& entry : contacts_) {
    if (entry.name == name) throwInvalid("there is a contact '", name, "' already");
    if (entry.contact.get() == contact)
      throwInvalid("contact '", name, "' is known already, as '", entry.name, "'");
  }
  if (contact->taken_.value)
    throwInvalid("contact '", name, "' serves another DynaCoM: this one needs a copy of it");
  updateFrames();
  // Whatever index the contact holds may be another model's.
  const pinocchio::FrameIndex frame_id = findFrame(model_, contact->getFrameName(), name);
  const std::size_t slot = findFreeSlot();
  distribution_.clear();  // the slot may be that of a contact that was removed
  distribution_.reserve(*contact, slot);
  contacts_.push_back({name, OwnContact(contact), slot});
  contact->setFrameID(frame_id);
  contact->deactivate();
  if (hasMotion()) place(contacts_.back(), state_.com);
  if (active) activateContact(name);
}

// The first slot that no contact has.
std::size_t DynaCoM::findFreeSlot() const {
  for (std::size_t slot = 0;; ++slot)
    if (std::none_of(contacts_.begin(), contacts_.end(),
                     [&](const Entry& entry) { return entry.slot == slot; }))
      return slot;
}

void DynaCoM::removeContact(const std::string& name) {
  const auto entry = find(name);
  entry->contact->deactivate();
  if (entry->active) distribution_.forgetForces();
  contacts_.erase(entry);
}

void DynaCoM::activateContact(const std::string& name) {
  const auto entry = find(name);
  if (entry->active) return;
  updateFrames();
  if (hasMotion()) place(*entry, state_.com);
  const auto end_of_active = firstInactive();
  entry->active = true;
  distribution_.forgetForces();
  std::rotate(end_of_active, entry, entry + 1);
}

void DynaCoM::deactivateContact(const std::string& name) {
  const auto entry = find(name);
  if (!entry->active) return;
  const auto end_of_active = firstInactive();
  entry->active = false;
  distribution_.forgetForces();
  entry->contact->deactivate();
  std::rotate(entry, entry + 1, end_of_active);
}

std::vector<DynaCoM::Entry>::const_iterator DynaCoM::find(const std::string& name) const {
  const auto entry = std::find_if(contacts_.begin(), contacts_.end(),
                                  [&](const Entry& entry) { return entry.name == name; });
  if (entry == contacts_.end()) {
    std::string known;
    for (const Entry& entry : contacts_) known += (known.empty() ? "'" : ", '") + entry.name + "'";
    throwInvalid("there is no contact '", name, "'; known: ", known.empty() ? "none" : known);
  }
  return entry;
}

std::vector<DynaCoM::Entry>::iterator DynaCoM::find(const std::string& name) {
  return contacts_.begin() + (std::as_const(*this).find(name) - contacts_.cbegin());
}

std::vector<DynaCoM::Entry>::iterator DynaCoM::firstInactive() {
  return std::find_if(contacts_.begin(), contacts_.end(),
                      [](const Entry& entry) { return !entry.active; });
}

// Looks up the frames of contacts that were initialised again, which have forgotten theirs. Refuses
// those that cannot be placed, before anything else changes.
void DynaCoM::updateFrames() {
  for (const Entry& entry : contacts_) {
    if (entry.contact->getFrameID() < model_.frames.size()) continue;
    entry.contact->setFrameID(findFrame(model_, entry.contact->getFrameName(), entry.name));
    distribution_.forgetForces();
  }
}

// Places a contact where its frame is: where it was measured, or by oMi, which every kinematic
// algorithm of Pinocchio leaves in data.
void DynaCoM::place(const Entry& entry, const Eigen::Vector3d& com) {
  ContactBase& contact = *entry.contact;
  if (entry.measured) {
    contact.updateNewtonEuler(com, contact.getPose());
    return;
  }
  const pinocchio::Frame& frame = model_.frames[contact.getFrameID()];
  contact.updateNewtonEuler(com, data_.oMi[frame.parentJoint] * frame.placement);
}

void DynaCoM::setContactPose(const std::string& name, const pinocchio::SE3& oMs) {
  const auto entry = find(name);
  entry->measured = true;
  entry->contact->setPose(oMs);
  if (hasMotion()) place(*entry, state_.com);
}

void DynaCoM::resetContactPose(const std::string& name) { find(name)->measured = false; }

std::shared_ptr<ContactBase> DynaCoM::getContact(const std::string& name) const {
  return find(name)->contact.get();
}

std::vector<std::string> DynaCoM::getActiveContacts() const {
  std::vector<std::string> names;
  for (const Entry& entry : contacts_)
    if (entry.active) names.push_back(entry.name);
  return names;
}

std::vector<std::string> DynaCoM::getKnownContacts() const {
  std::vector<std::string> names;
  for (const Entry& entry : contacts_) names.push_back(entry.name);
  return names;
}

DistributionStatus DynaCoM::distributeForce(const Eigen::Vector3d& groundCoMForce,
                                            const Eigen::Vector3d& groundCoMTorque,
                                            const Eigen::Vector3d& com) {
  requireInitialized();
  updateFrames();
  distribution_.clear();
  for (const Entry& entry : contacts_) {
    if (!entry.active) break;
    place(entry, com);
    distribution_.add(*entry.contact, entry.slot);
  }
  Vector6 wrench;
  wrench << groundCoMForce, groundCoMTorque;
  distribution_.solve(wrench, mass_ * internal::kStandardGravity);
  distribution_com_ = com;

  const DistributionResult& result = distribution_.result();
  for (std::size_t k = 0; k < result.contacts.size(); ++k)
    contacts_[k].contact->applyForce(result.contacts[k].force);
  if (hasMotion())
    feasible_ = applyGroundWrench(state_, {result.achieved.head<3>(), result.achieved.tail<3>()},
                                  settings_.gravity, ext_wrench_);
  return result.status;
}

Eigen::Vector3d DynaCoM::getZMP(const GroundPlane& plane) const {
  const Vector6& achieved = getDistribution().achieved;
  return computeCoP({achieved.head<3>(), achieved.tail<3>()}, distribution_com_, plane,
                    minimal_vertical_force_);
}

Eigen::Vector3d DynaCoM::getCMP(const GroundPlane& plane) const {
  const CentroidalWrench pressing = computeGroundWrench(pressing_, settings_.gravity, ext_wrench_);
  return computeCMP(pressing.force, state_.com, plane, minimal_vertical_force_);
}

bool DynaCoM::isLoaded(const ContactBase& contact) const {
  // What was assigned to a contact may never have been initialised, and has no force.
  return contact.cols() > 0 && contact.appliedForce()[2] >= minimal_vertical_force_;
}

Eigen::Vector2d DynaCoM::getContactCoP(const std::string& name) const {
  const ContactBase& contact = *find(name)->contact;
  return isLoaded(contact) ? contact.getCoP() : Eigen::Vector2d::Constant(kNaN);
}

double DynaCoM::getUsage(const std::string& name, double (ContactBase::*usage)() const) const {
  const ContactBase& contact = *find(name)->contact;
  const double value = (contact.*usage)();
  return std::isnan(value) || isLoaded(contact) ? value : 0.;
}

double DynaCoM::getContactFrictionUsage(const std::string& name) const {
  return getUsage(name, &ContactBase::getFrictionUsage);
}

double DynaCoM::getContactCoPMargin(const std::string& name) const {
  const ContactBase& contact = *find(name)->contact;
  return isLoaded(contact) ? contact.getCoPMargin() : kNaN;
}

double DynaCoM::getContactYawUsage(const std::string& name) const {
  return getUsage(name, &ContactBase::getYawUsage);
}

// Equation (6), with each contact's own centre of pressure p_k in the world: S (p × F ẑ) = F p, so
// that this is the mean of the p_k, weighted by the vertical forces.
Eigen::Vector3d DynaCoM::computePressureCentre() const {
  Eigen::Vector3d moment = Eigen::Vector3d::Zero();
  double vertical_force = 0.;
  for (const Entry& entry : contacts_) {
    if (!entry.active) break;
    const Eigen::Vector2d cop = entry.contact->getCoP();
    if (!cop.allFinite()) continue;
    const pinocchio::SE3 surface = entry.contact->getSurfacePose();
    const double force = surface.rotation().row(2).dot(entry.contact->appliedForce().head<3>());
    moment += force * surface.act(Eigen::Vector3d(cop.x(), cop.y(), 0.));
    vertical_force += force;
  }
  const Eigen::Vector3d centre = moment / vertical_force;
  if (!(vertical_force >= minimal_vertical_force_) || !centre.allFinite())
    return Eigen::Vector3d::Constant(kNaN);
  return centre;
}

template <class Rows, class Block>
Eigen::MatrixXd DynaCoM::stackDiagonally(Rows rows, Block block) const {
  Eigen::Index all_rows = 0, all_cols = 0;
  for (const Entry& entry : contacts_) {
    if (!entry.active) break;
    all_rows += ((*entry.contact).*rows)();
    all_cols += entry.contact->cols();
  }
  Eigen::MatrixXd stacked = Eigen::MatrixXd::Zero(all_rows, all_cols);
  Eigen::Index row = 0, col = 0;
  for (const Entry& entry : contacts_) {
    if (!entry.active) break;
    const Eigen::MatrixXd& matrix = ((*entry.contact).*block)();
    stacked.block(row, col, matrix.rows(), matrix.cols()) = matrix;
    row += matrix.rows();
    col += matrix.cols();
  }
  return stacked;
}

template <class Block>
Eigen::VectorXd DynaCoM::stack(Block block) const {
  Eigen::VectorXd stacked(0);
  for (const Entry& entry : contacts_) {
    if (!entry.active) break;
    const Eigen::VectorXd& vector = ((*entry.contact).*block)();
    stacked.conservativeResize(stacked.size() + vector.size());
    stacked.tail(vector.size()) = vector;
  }
  return stacked;
}

Eigen::MatrixXd DynaCoM::uni_A() const {
  return stackDiagonally(&ContactBase::uni_rows, &ContactBase::uni_A);
}
Eigen::VectorXd DynaCoM::uni_b() const { return stack(&ContactBase::uni_b); }
Eigen::MatrixXd DynaCoM::fri_A() const {
  return stackDiagonally(&ContactBase::fri_rows, &ContactBase::fri_A);
}
Eigen::VectorXd DynaCoM::fri_b() const { return stack(&ContactBase::fri_b); }
Eigen::VectorXd DynaCoM::reg_A() const { return stack(&ContactBase::reg_A); }
Eigen::VectorXd DynaCoM::reg_b() const { return stack(&ContactBase::reg_b); }
Eigen::VectorXd DynaCoM::allForces() const { return stack(&ContactBase::appliedForce); }

Eigen::MatrixXd DynaCoM::ne_A() const {
  Eigen::MatrixXd stacked(6, 0);
  for (const Entry& entry : contacts_) {
    if (!entry.active) break;
    stacked.conservativeResize(6, stacked.cols() + entry.contact->cols());
    stacked.rightCols(entry.contact->cols()) = entry.contact->ne_A();
  }
  return stacked;
}

}  // namespace dynacom
