// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_parts.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <memory>
#include <utility>

#include "check.hpp"
#include "contact_frame.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::kNaN;
using internal::throwInvalid;

namespace {

// μ of bodies where nothing is known of any ground.
constexpr double kBodyFriction = 0.7;

std::string nameCorner(const Eigen::Vector2d& corner) {
  return std::string(corner.x() > 0. ? "front" : "rear") + (corner.y() > 0. ? "_left" : "_right");
}

// A new frame of the model, and its name.
std::string addFrame(pinocchio::Model& model, pinocchio::JointIndex joint,
                     const pinocchio::SE3& placement, const std::string& part) {
  std::string name = part;
  while (model.existFrame(name)) name += '_';
  model.addFrame(pinocchio::Frame(name, joint, placement, pinocchio::OP_FRAME));
  return name;
}

pinocchio::SE3 makeOffset(const Eigen::Vector3d& offset) {
  return pinocchio::SE3(Eigen::Matrix3d::Identity(), offset);
}

// Numbers for joints, the same for those of which one moves the other.
class Limbs {
 public:
  explicit Limbs(const pinocchio::Model& model) : model_(model) {}

  void add(pinocchio::JointIndex joint) { numbers_.emplace(joint, -1); }

  int find(pinocchio::JointIndex joint) {
    pinocchio::JointIndex root = joint;
    for (auto parent = joint; parent > 0; parent = model_.parents[parent])
      if (numbers_.count(parent) > 0) root = parent;
    int& number = numbers_[root];
    if (number < 0) number = count_++;
    return number;
  }

 private:
  const pinocchio::Model& model_;
  std::map<pinocchio::JointIndex, int> numbers_;
  int count_ = 0;
};

// A contact as a whole, from the forces of its parts in one frame.
class Gatherer {
 public:
  Gatherer(const DynaCoM& robot, const std::string& name)
      : contact_(robot.getContact(name)->clone()),
        minimal_force_(robot.getMinimalVerticalForce()),
        force_(Eigen::VectorXd::Zero(contact_->cols())) {}

  /// @param wrench  of its parts, about its origin, in its own axes
  /// @param force   the same force in the world
  void write(Eigen::Index frame, const DynaCoM::Vector6& wrench, const Eigen::Vector3d& force,
             MotionAnalysis::Contact& result) {
    force_ = wrench.head(force_.size());
    contact_->applyForce(force_);
    const bool loaded = force_[2] >= minimal_force_;
    result.wrench.col(frame) = wrench;
    if (loaded)
      result.cop.col(frame) = contact_->getCoP();
    else
      result.cop.col(frame).setConstant(kNaN);
    result.cop_margin[frame] = loaded ? contact_->getCoPMargin() : kNaN;
    result.friction_usage[frame] = findFrictionUsage(force);
    result.yaw_usage[frame] = findYawUsage(force);
  }

 private:
  // Of a sole by the normal of the ground that its corners touch, which is not the sole's where
  // that is tilted; the pyramid has the sole's axes.
  double findFrictionUsage(const Eigen::Vector3d& force) const {
    const auto* surface = dynamic_cast<const Contact6D*>(contact_.get());
    const double own = contact_->getFrictionUsage();
    if (std::isnan(own) || !surface)
      return force_[2] >= minimal_force_ || std::isnan(own) ? own : 0.;
    if (force.z() < minimal_force_) return 0.;
    const Eigen::Vector2d along = force_.head<2>();
    const double part = along.isZero(0.) ? 1. : along.lpNorm<Eigen::Infinity>() / along.norm();
    return part * force.head<2>().norm() / (surface->getSettings().mu * force.z());
  }
  double findYawUsage(const Eigen::Vector3d& force) const {
    const auto* surface = dynamic_cast<const Contact6D*>(contact_.get());
    if (!surface || std::isnan(contact_->getYawUsage())) return kNaN;
    if (force.z() < minimal_force_) return 0.;
    return std::abs(force_[5]) / (surface->getSettings().gu * force.z());
  }

  const std::shared_ptr<ContactBase> contact_;
  const double minimal_force_;
  Eigen::VectorXd force_;
};

MotionAnalysis::Contact makeContact(const std::string& name, Eigen::Index frames) {
  MotionAnalysis::Contact contact;
  contact.name = name;
  contact.active.setConstant(frames, false);
  contact.wrench.setZero(6, frames);
  contact.vertical_force.setZero(frames);
  contact.cop.setConstant(2, frames, kNaN);
  for (Eigen::VectorXd* values : {&contact.friction_usage, &contact.yaw_usage, &contact.cop_margin})
    values->setConstant(frames, kNaN);
  return contact;
}

// A schedule for owners of parts, whose numbers begin with `first`.
ContactSchedule gather(const PartRobot& parts, std::size_t first, std::vector<std::string> owners,
                       const ContactSchedule& schedule) {
  const Eigen::Index frames = schedule.active.cols();
  schedule.validate(frames);
  ContactSchedule gathered;
  gathered.names = std::move(owners);
  const auto count = static_cast<Eigen::Index>(gathered.names.size());
  gathered.active.setConstant(count, frames, false);
  if (schedule.confidence.size() > 0) gathered.confidence.setZero(count, frames);
  for (std::size_t k = 0; k < parts.parts.size(); ++k) {
    const auto owner = static_cast<Eigen::Index>(parts.parts[k].contact - first);
    if (parts.parts[k].contact < first || owner >= count) continue;
    const auto part = static_cast<Eigen::Index>(k);
    gathered.active.row(owner) = gathered.active.row(owner) || schedule.active.row(part);
    if (schedule.confidence.size() > 0)
      gathered.confidence.row(owner) =
          gathered.confidence.row(owner).cwiseMax(schedule.confidence.row(part));
  }
  return gathered;
}

}  // namespace

std::size_t PartRobot::countContacts() const {
  std::size_t count = 0;
  for (const Part& part : parts) count = std::max(count, part.contact + 1);
  return count - std::min(count, bodies.size());
}

PartRobot splitContacts(const DynaCoM& robot, const std::vector<BodyPoints>& bodies) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by splitContacts before initialize()");
  const std::vector<std::string> names = robot.getKnownContacts();
  pinocchio::Model model = robot.getModel();
  std::vector<PartRobot::Part> parts;
  std::vector<ContactPointSettings> settings;
  std::vector<pinocchio::JointIndex> joints;
  for (std::size_t k = 0; k < names.size(); ++k) {
    const ContactBase& contact = *robot.getContact(names[k]);
    const pinocchio::Frame frame = internal::getFrame(robot.getModel(), contact, names[k]);
    if (const auto* point = dynamic_cast<const ContactPoint*>(&contact)) {
      parts.push_back({names[k], k, 0});
      settings.push_back(point->getSettings());
      joints.push_back(frame.parentJoint);
    } else if (const auto* surface = dynamic_cast<const Contact6D*>(&contact)) {
      const Eigen::Matrix2Xd corners = surface->getCorners();
      for (Eigen::Index i = 0; i < corners.cols(); ++i) {
        const std::string name = names[k] + "." + nameCorner(corners.col(i));
        ContactPointSettings part;
        part.mu = surface->getSettings().mu;
        part.weights = std::sqrt(double(corners.cols())) * surface->getSettings().weights.head<3>();
        part.world_aligned = true;
        const Eigen::Vector3d corner(corners(0, i), corners(1, i), 0.);
        part.frame_name =
            addFrame(model, frame.parentJoint, frame.placement * makeOffset(corner), name);
        parts.push_back({name, k, 0});
        settings.push_back(part);
        joints.push_back(frame.parentJoint);
      }
    } else {
      throwInvalid("contact '", names[k],
                   "' must be a ContactPoint or a Contact6D to be taken apart, got another kind");
    }
  }
  Limbs limbs(model);
  for (const pinocchio::JointIndex joint : joints) limbs.add(joint);
  for (std::size_t k = 0; k < parts.size(); ++k) parts[k].limb = limbs.find(joints[k]);

  double mu = settings.empty() ? kBodyFriction : std::numeric_limits<double>::infinity();
  for (const ContactPointSettings& part : settings) mu = std::min(mu, part.mu);
  ContactPointSettings point;
  point.mu = mu;
  if (!settings.empty()) point.weights = settings.front().weights;
  point.world_aligned = true;
  int limb = 0;
  for (const PartRobot::Part& part : parts) limb = std::max(limb, part.limb + 1);
  std::vector<std::string> links;
  for (const BodyPoints& body : bodies) {
    if (body.points.cols() == 0) continue;
    if (body.joint == 0 || body.joint >= static_cast<std::size_t>(model.njoints))
      throwInvalid("body '", body.link, "': joint must be one of the robot's, 1 to ",
                   model.njoints - 1, ", got ", body.joint);
    internal::requireSize("radius", body.radius.size(), body.points.cols(), "points");
    for (Eigen::Index i = 0; i < body.points.cols(); ++i) {
      const std::string name = "body." + body.link + "." + std::to_string(i);
      point.radius = body.radius[i];
      point.frame_name = addFrame(model, body.joint, makeOffset(body.points.col(i)), name);
      parts.push_back({name, names.size() + links.size(), limb});
      settings.push_back(point);
    }
    links.push_back(body.link);
    ++limb;
  }

  PartRobot split{DynaCoM(model), std::move(parts), std::move(links)};
  split.robot.setGroundHeight(robot.getGroundHeight());
  split.robot.setMinimalVerticalForce(robot.getMinimalVerticalForce());
  split.robot.setWrenchWeights(robot.getWrenchWeights());
  split.robot.setMaximalIterations(robot.getMaximalIterations());
  for (std::size_t k = 0; k < split.parts.size(); ++k)
    split.robot.addContact(std::make_shared<ContactPoint>(settings[k]), split.parts[k].name);
  return split;
}

MotionAnalysis gatherParts(const DynaCoM& robot, const PartRobot& parts,
                           const std::vector<ContactMotion>& contacts,
                           const std::vector<ContactMotion>& motions, MotionAnalysis analysis) {
  const std::vector<std::string> names = robot.getKnownContacts();
  internal::requireSize("contacts", contacts.size(), names.size(), "contacts of the robot");
  internal::requireSize("motions", motions.size(), parts.parts.size(), "parts");
  internal::requireSize("analysis.contacts", analysis.contacts.size(), parts.parts.size(), "parts");
  const Eigen::Index frames = analysis.time.size();
  for (const auto* list : {&contacts, &motions})
    for (const ContactMotion& moved : *list)
      internal::requireSize(moved.name.c_str(), moved.height.size(), frames, "frames");

  std::vector<MotionAnalysis::Contact> gathered;
  std::vector<Gatherer> gatherers;
  std::vector<MotionAnalysis::Body> bodies(parts.bodies.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    bodies[k].link = parts.bodies[k];
    bodies[k].active.setConstant(frames, false);
    bodies[k].force.setZero(3, frames);
    bodies[k].position.setZero(3, frames);
  }
  for (const std::string& name : names) {
    gathered.push_back(makeContact(name, frames));
    gatherers.emplace_back(robot, name);
  }
  const auto findRotation = [](const ContactMotion& moved, Eigen::Index frame) {
    return Eigen::Quaterniond(moved.rotation.col(frame)).toRotationMatrix();
  };
  std::vector<DynaCoM::Vector6> wrenches(names.size());
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    for (DynaCoM::Vector6& wrench : wrenches) wrench.setZero();
    for (std::size_t k = 0; k < parts.parts.size(); ++k) {
      const MotionAnalysis::Contact& part = analysis.contacts[k];
      if (!part.active[frame]) continue;
      const std::size_t owner = parts.parts[k].contact;
      const Eigen::Vector3d force =  // in the world
          findRotation(motions[k], frame) * part.wrench.col(frame).head<3>();
      if (owner >= names.size()) {
        MotionAnalysis::Body& body = bodies.at(owner - names.size());
        body.active[frame] = true;
        body.force.col(frame) += force;
        body.position.col(frame) += force.z() * motions[k].position.col(frame);
        continue;
      }
      gathered[owner].active[frame] = true;
      gathered[owner].vertical_force[frame] += part.vertical_force[frame];
      // About the contact's origin.
      const Eigen::Vector3d lever =
          motions[k].position.col(frame) - contacts[owner].position.col(frame);
      wrenches[owner].head<3>() += force;
      wrenches[owner].tail<3>() += lever.cross(force);
    }
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (!gathered[k].active[frame]) continue;
      const Eigen::Matrix3d axes = findRotation(contacts[k], frame).transpose();
      DynaCoM::Vector6 wrench;
      wrench << axes * wrenches[k].head<3>(), axes * wrenches[k].tail<3>();
      gatherers[k].write(frame, wrench, wrenches[k].head<3>(), gathered[k]);
    }
  }
  const double least = robot.getMinimalVerticalForce();
  for (MotionAnalysis::Body& body : bodies)
    for (Eigen::Index frame = 0; frame < frames; ++frame)
      if (body.force(2, frame) > 0. && body.force(2, frame) >= least)
        body.position.col(frame) /= body.force(2, frame);
      else
        body.position.col(frame).setConstant(kNaN);
  analysis.bodies = std::move(bodies);
  analysis.parts = std::move(analysis.contacts);
  analysis.contacts = std::move(gathered);
  return analysis;
}

ContactSchedule gatherParts(const DynaCoM& robot, const PartRobot& parts,
                            const ContactSchedule& schedule) {
  internal::requireSize("schedule.names", schedule.names.size(), parts.parts.size(), "parts");
  return gather(parts, 0, robot.getKnownContacts(), schedule);
}

ContactSchedule gatherBodies(const PartRobot& parts, const ContactSchedule& schedule) {
  internal::requireSize("schedule.names", schedule.names.size(), parts.parts.size(), "parts");
  return gather(parts, parts.countContacts(), parts.bodies, schedule);
}

}  // namespace dynacom
