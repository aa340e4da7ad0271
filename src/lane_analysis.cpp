// SPDX-License-Identifier: BSD-2-Clause
#include "lane_analysis.hpp"

#include <cmath>
#include <cstdlib>
#include <new>
#include <string>
#include <typeinfo>

#include "contact_frame.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
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

// Writes the size and the limits; false for a kind that lanes do not know.
bool describe(const ContactBase& contact, lanes::Contact& description) {
  Eigen::Map<Vector6> betas(description.betas), weights(description.weights);
  betas.setZero();
  weights.setOnes();
  description.size = static_cast<int>(contact.cols());
  weights.head(contact.cols()) = contact.reg_A();
  if (typeid(contact) == typeid(Contact6D)) {
    const Contact6DSettings& settings = static_cast<const Contact6D&>(contact).getSettings();
    description.world_aligned = false;
    description.radius = 0.;
    betas << settings.mu, settings.mu, 0., settings.half_width, settings.half_length, settings.gu;
    return true;
  }
  if (typeid(contact) == typeid(ContactPoint)) {
    const ContactPointSettings& settings = static_cast<const ContactPoint&>(contact).getSettings();
    description.world_aligned = settings.world_aligned;
    description.radius = settings.radius;
    betas.head<2>().setConstant(settings.mu);
    return true;
  }
  return false;
}

}  // namespace

std::optional<LaneRobot> LaneRobot::make(const DynaCoM& robot, int lanes) {
  LaneRobot made;
  made.interface_ = findInterface(lanes);
  if (!made.interface_) return std::nullopt;
  const pinocchio::Model& model = robot.getModel();
  if (model.njoints < 2) return std::nullopt;

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
  for (const std::string& name : robot.getKnownContacts()) {
    const ContactBase& contact = *robot.getContact(name);
    const pinocchio::Frame& frame = getFrame(model, contact, name);
    lanes::Contact description = {};
    if (frame.parentJoint == 0 || !describe(contact, description)) return std::nullopt;
    description.parent = static_cast<int>(frame.parentJoint) - 1;
    write(aligned[frame.parentJoint].actInv(frame.placement), description.placement);
    made.contacts_.push_back(description);
  }

  made.robot_.nq = model.nq;
  made.robot_.nv = model.nv;
  made.robot_.joints = static_cast<int>(made.joints_.size());
  made.robot_.contacts = static_cast<int>(made.contacts_.size());
  Vector3::Map(made.robot_.gravity) = robot.getSettings().gravity;
  Vector6::Map(made.robot_.wrench_weights) = robot.getWrenchWeights();
  made.robot_.minimal_vertical_force = robot.getMinimalVerticalForce();
  return made;
}

LaneAnalysis::LaneAnalysis(const LaneRobot& robot, double ground_height,
                           bool flat_horizontal_ground)
    : interface_(*robot.interface_), analysis_(nullptr, interface_.destroy) {
  lanes::Robot description = robot.robot_;
  description.joint = robot.joints_.data();
  description.contact = robot.contacts_.data();
  description.ground_height = ground_height;
  description.flat_horizontal_ground = flat_horizontal_ground;
  analysis_.reset(interface_.create(&description));
  if (!analysis_) throw std::bad_alloc();
  rows_.resize(robot.contacts_.size());
}

void LaneAnalysis::run(const Motion& motion, Eigen::Index first, Eigen::Index frames,
                       const Eigen::MatrixXd& readiness, MotionAnalysis& result) {
  const auto size = static_cast<std::size_t>(frames);
  outcomes_.resize(size);
  placements_.resize(12 * rows_.size() * size);
  const auto from = [first](auto& values) { return values.data() + first * values.rows(); };
  const auto number = [first](auto& values) { return values.data() + first; };
  for (std::size_t k = 0; k < rows_.size(); ++k) {
    MotionAnalysis::Contact& contact = result.contacts[k];
    const double* own_readiness =
        readiness.size() > 0 ? readiness.col(static_cast<Eigen::Index>(k)).data() + first : nullptr;
    rows_[k] = {number(contact.active),    own_readiness,
                from(contact.wrench),      number(contact.vertical_force),
                from(contact.cop),         number(contact.friction_usage),
                number(contact.yaw_usage), number(contact.cop_margin)};
  }
  lanes::Frames described = {};
  described.count = frames;
  described.q = from(motion.q);
  described.v = from(motion.v);
  described.a = from(motion.a);
  described.com = from(result.com);
  described.vcom = from(result.vcom);
  described.acom = from(result.acom);
  described.am = from(result.am);
  described.dam = from(result.dam);
  described.force = from(result.ground_force);
  described.torque = from(result.ground_torque);
  described.cop = from(result.cop);
  described.feasible_acom = from(result.feasible_acom);
  described.feasible_dam = from(result.feasible_dam);
  described.residual = from(result.residual);
  described.contacts = rows_.data();
  described.placements = placements_.data();
  described.outcomes = outcomes_.data();
  interface_.run(analysis_.get(), &described);
}

void LaneAnalysis::place(const Motion& motion, Eigen::Index first, Eigen::Index frames) {
  const auto size = static_cast<std::size_t>(frames);
  outcomes_.resize(size);
  placements_.resize(12 * rows_.size() * size);
  velocities_.resize(6 * rows_.size() * size);
  const lanes::Places places = {frames,
                                motion.q.col(first).data(),
                                motion.v.col(first).data(),
                                placements_.data(),
                                velocities_.data(),
                                outcomes_.data()};
  interface_.place(analysis_.get(), &places);
}

pinocchio::SE3 LaneAnalysis::placement(std::size_t contact, Eigen::Index frame) const {
  const double* numbers = placements_.data() + 12 * index(contact, frame);
  return {Matrix3::Map(numbers), Vector3::Map(numbers + 9)};
}

pinocchio::Motion LaneAnalysis::velocity(std::size_t contact, Eigen::Index frame) const {
  return pinocchio::Motion(Vector6::Map(velocities_.data() + 6 * index(contact, frame)));
}

}  // namespace dynacom::internal
