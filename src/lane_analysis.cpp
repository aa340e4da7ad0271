// SPDX-License-Identifier: BSD-2-Clause
#include "lane_analysis.hpp"

#include <cmath>
#include <cstdlib>
#include <new>
#include <string>
#include <typeinfo>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "standard_gravity.hpp"
#include "surface_options.hpp"
#ifdef DYNACOM_HAS_LANES
#include <dlfcn.h>
#endif

namespace dynacom::internal {

namespace {

using Matrix3 = Eigen::Matrix3d;
using Vector3 = Eigen::Vector3d;
using Vector6 = DynaCoM::Vector6;

// ---- The shared objects ----

#ifdef DYNACOM_HAS_LANES

// One that lies beside this library, and stays loaded; null if it does not.
const lanes::Interface* load(const std::string& name) {
  Dl_info library;
  if (!dladdr(reinterpret_cast<const void*>(&load), &library)) return nullptr;
  // Not beside a link to it.
  const std::unique_ptr<char, void (*)(void*)> path(realpath(library.dli_fname, nullptr),
                                                    std::free);
  if (!path) return nullptr;
  const std::string file = path.get();
  void* object =
      dlopen((file.substr(0, file.rfind('/') + 1) + name).c_str(), RTLD_NOW | RTLD_LOCAL);
  if (!object) return nullptr;
  const auto entry = reinterpret_cast<lanes::Entry>(dlsym(object, lanes::kEntry));
  const lanes::Interface* interface = entry ? entry() : nullptr;
  return interface && interface->version == lanes::kVersion ? interface : nullptr;
}

bool hasAvx512() {
  return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512dq") &&
         __builtin_cpu_supports("avx512vl") && __builtin_cpu_supports("avx512bw") &&
         __builtin_cpu_supports("fma");
}

bool hasAvx2() { return __builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"); }

const lanes::Interface* findInterface(int at_most) {
  if (at_most == 1) return nullptr;
  static const lanes::Interface* const avx512 =
      hasAvx512() ? load("libdynacom_avx512.so") : nullptr;
  static const lanes::Interface* const avx2 = hasAvx2() ? load("libdynacom_avx2.so") : nullptr;
  for (const lanes::Interface* interface : {avx512, avx2})
    if (interface && interface->lanes <= at_most) return interface;
  return nullptr;
}

#else

const lanes::Interface* findInterface(int) { return nullptr; }

#endif

// ---- The robot as plain arrays ----

// By how much the norm of an axis may differ from 1: Pinocchio takes others as they are.
constexpr double kUnit = 1e-12;

struct JointKind {
  lanes::JointKind kind;
  Vector3 axis = Vector3::UnitZ();
};

// Nothing for a kind that lanes do not know.
struct Recogniser : boost::static_visitor<std::optional<JointKind>> {
  using Kind = lanes::JointKind;
  using Result = std::optional<JointKind>;

  template <class Joint>
  Result operator()(const Joint&) const {
    return std::nullopt;
  }
  template <int axis>
  Result operator()(const pinocchio::JointModelRevoluteTpl<double, 0, axis>&) const {
    return JointKind{Kind::Revolute, Vector3::Unit(axis)};
  }
  Result operator()(const pinocchio::JointModelRevoluteUnaligned& joint) const {
    return JointKind{Kind::Revolute, joint.axis};
  }
  template <int axis>
  Result operator()(const pinocchio::JointModelRevoluteUnboundedTpl<double, 0, axis>&) const {
    return JointKind{Kind::UnboundedRevolute, Vector3::Unit(axis)};
  }
  Result operator()(const pinocchio::JointModelRevoluteUnboundedUnaligned& joint) const {
    return JointKind{Kind::UnboundedRevolute, joint.axis};
  }
  template <int axis>
  Result operator()(const pinocchio::JointModelPrismaticTpl<double, 0, axis>&) const {
    return JointKind{Kind::Prismatic, Vector3::Unit(axis)};
  }
  Result operator()(const pinocchio::JointModelPrismaticUnaligned& joint) const {
    return JointKind{Kind::Prismatic, joint.axis};
  }
  Result operator()(const pinocchio::JointModelFreeFlyer&) const {
    return JointKind{Kind::FreeFlyer};
  }
  Result operator()(const pinocchio::JointModelSpherical&) const {
    return JointKind{Kind::Spherical};
  }
  Result operator()(const pinocchio::JointModelTranslation&) const {
    return JointKind{Kind::Translation};
  }
  Result operator()(const pinocchio::JointModelPlanar&) const { return JointKind{Kind::Planar}; }
};

void write(const pinocchio::SE3& placement, double* numbers) {
  Matrix3::Map(numbers) = placement.rotation();
  Vector3::Map(numbers + 9) = placement.translation();
}

// The contacts that lanes know: those at their frames without bounds and references.
template <class Contact>
const Contact* asKnown(const ContactBase& contact) {
  if (typeid(contact) != typeid(Contact) || contact.cols() == 0) return nullptr;
  const auto& known = static_cast<const Contact&>(contact);
  const auto& settings = known.getSettings();
  SurfaceOptions plain;
  plain.friction = settings.friction;
  plain.facets = settings.facets;
  plain.facet_angle = settings.facet_angle;
  return plain == settings && settings.reference.isZero(0.) ? &known : nullptr;
}
const Contact6D* asSurface(const ContactBase& contact) { return asKnown<Contact6D>(contact); }
const ContactPoint* asPoint(const ContactBase& contact) { return asKnown<ContactPoint>(contact); }

// Describes friction as lanes know it: as a pyramid of four sides, or as a disc. Returns whether it
// is such.
template <class Settings>
bool describeFriction(const Settings& settings, lanes::Contact& description) {
  double mu = settings.mu;
  switch (settings.friction) {
    case FrictionModel::OuterPyramid:
      break;
    case FrictionModel::InnerPyramid:
      mu = getPyramidMu(settings, mu);
      break;
    case FrictionModel::Facets:
      if (settings.facets != 4 || settings.facet_angle != 0.) return false;
      break;
    case FrictionModel::Cone:
      description.is_disc = true;
      if (settings.weights[0] != settings.weights[1]) return false;
  }
  description.betas[0] = description.betas[1] = mu;
  return true;
}

bool isAligned(const ContactBase& contact) {
  const ContactPoint* point = asPoint(contact);
  return point && point->getSettings().world_aligned;
}

// Where a contact's column of a frame is.
template <class Values>
auto columnOf(Values& values, Eigen::Index frame) {
  return values.data() + frame * values.rows();
}

}  // namespace

std::optional<LaneRobot> LaneRobot::make(const pinocchio::Model& model,
                                         const std::vector<FixedContact>& contacts, int lanes) {
  LaneRobot made;
  made.interface_ = findInterface(lanes);
  if (!made.interface_ || model.njoints < 2) return std::nullopt;

  // From the axes that lanes want, of which z is the joint's, to those of the joint.
  std::vector<pinocchio::SE3> aligned = {pinocchio::SE3::Identity()};
  for (std::size_t k = 1; k < static_cast<std::size_t>(model.njoints); ++k) {
    const auto kind = boost::apply_visitor(Recogniser(), model.joints[k].toVariant());
    if (!kind) return std::nullopt;
    if (std::abs(kind->axis.norm() - 1.) > kUnit) return std::nullopt;
    Matrix3 to_axis = Matrix3::Identity();
    if (kind->axis != Vector3::UnitZ()) {  // else, also joints of no axis are to stay as they are
      const Vector3 x = kind->axis.unitOrthogonal();
      to_axis << x, kind->axis.cross(x), kind->axis;
    }
    aligned.emplace_back(to_axis, Vector3::Zero());
    lanes::Joint joint = {};
    joint.kind = kind->kind;
    joint.parent = static_cast<int>(model.parents[k]) - 1;
    joint.q = model.joints[k].idx_q();
    joint.v = model.joints[k].idx_v();
    write(aligned[model.parents[k]].actInv(model.jointPlacements[k]) * aligned[k], joint.placement);
    const pinocchio::Inertia inertia = aligned[k].actInv(model.inertias[k]);
    joint.massless = inertia.isZero(0.);
    joint.mass = inertia.mass();
    Vector3::Map(joint.com) = inertia.lever();
    const Matrix3 about_com = inertia.inertia().matrix();
    Vector6::Map(joint.inertia) << about_com(0, 0), about_com(1, 0), about_com(1, 1),
        about_com(2, 0), about_com(2, 1), about_com(2, 2);
    made.joints_.push_back(joint);
  }
  for (const FixedContact& fixed : contacts) {
    const Contact6D* surface = asSurface(*fixed.contact);
    const ContactPoint* point = asPoint(*fixed.contact);
    if (fixed.joint == 0 || (!surface && !point)) return std::nullopt;
    lanes::Fixture fixture = {};
    fixture.parent = static_cast<int>(fixed.joint) - 1;
    write(aligned[fixed.joint].actInv(fixed.placement), fixture.placement);
    if (point) {
      fixture.world_aligned = point->getSettings().world_aligned;
      fixture.radius = point->getSettings().radius;
    } else {
      fixture.half_length = surface->getSettings().half_length;
      fixture.half_width = surface->getSettings().half_width;
    }
    made.contacts_.push_back(fixture);
  }
  made.nq_ = model.nq;
  made.nv_ = model.nv;
  made.gravity_ = model.gravity.linear();
  return made;
}

LaneSweeper::LaneSweeper(const LaneRobot& robot)
    : interface_(*robot.interface_), worker_(nullptr, interface_.destroy_sweeper) {
  lanes::Robot description = {};
  description.nq = robot.nq_;
  description.nv = robot.nv_;
  description.joints = static_cast<int>(robot.joints_.size());
  description.joint = robot.joints_.data();
  description.contacts = static_cast<int>(robot.contacts_.size());
  description.contact = robot.contacts_.data();
  Vector3::Map(description.gravity) = robot.gravity_;
  worker_.reset(interface_.create_sweeper(&description));
  if (!worker_) throw std::bad_alloc();
  rows_.resize(robot.contacts_.size());
  for (const lanes::Fixture& contact : robot.contacts_)
    is_aligned_.push_back(contact.world_aligned);
}

void LaneSweeper::run(const Motion& motion, Eigen::Index first, Eigen::Index frames,
                      MotionAnalysis* dynamics, std::vector<ContactMotion>& contacts) {
  known_.resize(frames);
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    ContactMotion& contact = contacts[k];
    rows_[k] = {columnOf(contact.position, first), contact.height.data() + first,
                columnOf(contact.velocity, first),
                is_aligned_[k] ? nullptr : columnOf(contact.rotation, first)};
  }
  lanes::Sweep sweep = {};
  sweep.count = frames;
  sweep.q = columnOf(motion.q, first);
  sweep.v = columnOf(motion.v, first);
  if (dynamics) {
    sweep.a = columnOf(motion.a, first);
    sweep.com = columnOf(dynamics->com, first);
    sweep.vcom = columnOf(dynamics->vcom, first);
    sweep.acom = columnOf(dynamics->acom, first);
    sweep.am = columnOf(dynamics->am, first);
    sweep.dam = columnOf(dynamics->dam, first);
    sweep.force = columnOf(dynamics->ground_force, first);
    sweep.torque = columnOf(dynamics->ground_torque, first);
  }
  sweep.contacts = rows_.data();
  sweep.known = known_.data();
  interface_.sweep(worker_.get(), &sweep);
}

std::optional<LaneCarrier> LaneCarrier::make(const Carrier& carrier, int lanes) {
  LaneCarrier made;
  made.interface_ = findInterface(lanes);
  if (!made.interface_) return std::nullopt;
  for (const FixedContact& fixed : carrier.contacts) {
    const ContactBase& contact = *fixed.contact;
    const Contact6D* surface = asSurface(contact);
    const ContactPoint* point = asPoint(contact);
    if (!surface && !point) return std::nullopt;
    lanes::Contact description = {};
    Eigen::Map<Vector6> betas(description.betas), weights(description.weights);
    weights.setOnes();
    description.size = static_cast<int>(contact.cols());
    weights.head(contact.cols()) = contact.reg_A();
    if (!(surface ? describeFriction(surface->getSettings(), description)
                  : describeFriction(point->getSettings(), description)))
      return std::nullopt;
    if (surface) {
      const Contact6DSettings& settings = surface->getSettings();
      if (settings.coupled_yaw) return std::nullopt;
      betas.tail<3>() << settings.half_width, settings.half_length, settings.gu;
    }
    made.contacts_.push_back(description);
    made.is_aligned_.push_back(isAligned(contact));
  }
  made.carrier_.contacts = static_cast<int>(made.contacts_.size());
  made.carrier_.mass = carrier.mass;
  Vector3::Map(made.carrier_.gravity) = carrier.gravity;
  Vector6::Map(made.carrier_.wrench_weights) = carrier.wrench_weights;
  made.carrier_.minimal_scale = carrier.mass * kStandardGravity;
  made.carrier_.minimal_vertical_force = carrier.minimal_vertical_force;
  return made;
}

LaneDistributor::LaneDistributor(const LaneCarrier& carrier, double ground_height,
                                 bool flat_horizontal_ground)
    : interface_(*carrier.interface_),
      worker_(nullptr, interface_.destroy_distributor),
      rows_(carrier.contacts_.size()),
      is_aligned_(carrier.is_aligned_) {
  lanes::Carrier description = carrier.carrier_;
  description.contact = carrier.contacts_.data();
  description.ground_height = ground_height;
  description.flat_horizontal_ground = flat_horizontal_ground;
  worker_.reset(interface_.create_distributor(&description));
  if (!worker_) throw std::bad_alloc();
}

void LaneDistributor::run(Eigen::Index first, Eigen::Index frames,
                          const std::vector<ContactMotion>& contacts,
                          const Eigen::MatrixXd& readiness, MotionAnalysis& result) {
  answers_.resize(static_cast<std::size_t>(frames));
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    MotionAnalysis::Contact& contact = result.contacts[k];
    lanes::ContactRows& rows = rows_[k];
    rows.active = contact.active.data() + first;
    rows.readiness =
        readiness.size() > 0 ? readiness.col(static_cast<Eigen::Index>(k)).data() + first : nullptr;
    rows.position = columnOf(contacts[k].position, first);
    rows.rotation = is_aligned_[k] ? nullptr : columnOf(contacts[k].rotation, first);
    rows.wrench = columnOf(contact.wrench, first);
    rows.vertical_force = contact.vertical_force.data() + first;
    rows.cop = columnOf(contact.cop, first);
    rows.friction_usage = contact.friction_usage.data() + first;
    rows.yaw_usage = contact.yaw_usage.data() + first;
    rows.cop_margin = contact.cop_margin.data() + first;
  }
  lanes::Distributions distributions = {};
  distributions.count = frames;
  distributions.com = columnOf(result.com, first);
  distributions.force = columnOf(result.ground_force, first);
  distributions.torque = columnOf(result.ground_torque, first);
  distributions.cop = columnOf(result.cop, first);
  distributions.feasible_acom = columnOf(result.feasible_acom, first);
  distributions.feasible_dam = columnOf(result.feasible_dam, first);
  distributions.residual = columnOf(result.residual, first);
  distributions.contacts = rows_.data();
  distributions.answers = answers_.data();
  interface_.distribute(worker_.get(), &distributions);
}

std::optional<DistributionStatus> LaneDistributor::status(Eigen::Index frame) const {
  switch (answers_[static_cast<std::size_t>(frame)]) {
    case lanes::Answer::Solved:
      return DistributionStatus::Solved;
    case lanes::Answer::Relaxed:
      return DistributionStatus::Relaxed;
    case lanes::Answer::None:
      break;
  }
  return std::nullopt;
}

}  // namespace dynacom::internal
