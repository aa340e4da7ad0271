// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_parts.hpp"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <type_traits>
#include <utility>

#include "check.hpp"
#include "contact_frame.hpp"
#include "contact_split.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::kNaN;
using internal::throwInvalid;

namespace {

// μ of bodies where nothing is known of any ground.
constexpr double kBodyFriction = 0.7;

// Names of Contact6D::getCorners(), also of those that coincide on an edge without width.
constexpr const char* kCorners[] = {"front_left", "rear_left", "rear_right", "front_right"};

// A new frame of the model, and its name.
std::string addFrame(pinocchio::Model& model, pinocchio::JointIndex joint,
                     const pinocchio::SE3& placement, const std::string& part) {
  std::string name = part;
  while (model.existFrame(name)) name += '_';
  model.addFrame(pinocchio::Frame(name, joint, placement, pinocchio::OP_FRAME));
  return name;
}

const ContactPointSettings& settingsOf(const ContactBase& point) {
  return dynamic_cast<const ContactPoint&>(point).getSettings();
}

pinocchio::SE3 makeOffset(const Eigen::Vector3d& offset) {
  return pinocchio::SE3(Eigen::Matrix3d::Identity(), offset);
}

// Gives a part the friction of its contact, where that is no outer pyramid, else a given one.
template <class Settings>
void takeFriction(const Settings& contact, const std::string& name, FrictionModel friction,
                  SurfaceOptions& part) {
  if (contact.least_normal_force > 0. || std::isfinite(contact.greatest_normal_force) ||
      !contact.reference.isZero(0.))
    throwInvalid(
        "contact '", name,
        "' must have neither bounds of its normal force nor a reference to be taken apart, "
        "got ",
        contact);
  part.friction = contact.friction == FrictionModel::OuterPyramid ? friction : contact.friction;
  part.facets = contact.facets;
  part.facet_angle = contact.facet_angle;
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
  /// @param part  of one of its parts, whose friction is what it is judged by
  Gatherer(const DynaCoM& robot, const std::string& name, const SurfaceOptions& part)
      : contact_(robot.getContact(name)->clone()),
        minimal_force_(robot.getMinimalVerticalForce()),
        force_(Eigen::VectorXd::Zero(contact_->cols())) {
    if (auto* surface = dynamic_cast<Contact6D*>(contact_.get()))
      judgeBy(part, *surface);
    else if (auto* point = dynamic_cast<ContactPoint*>(contact_.get()))
      judgeBy(part, *point);
  }

  /// @param wrench  of its parts, about its origin, in its own axes
  /// @param force   in the axes that its parts have: the ground's, where they are a sole's
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
  template <class Contact>
  static void judgeBy(const SurfaceOptions& part, Contact& contact) {
    auto settings = contact.getSettings();
    settings.friction = part.friction;
    settings.facets = part.facets;
    settings.facet_angle = part.facet_angle;
    // What bounds yaw then is the friction of the corners, and their usage says how much.
    if constexpr (std::is_same_v<Contact, Contact6D>)
      if (std::exchange(settings.coupled_yaw, false)) settings.gu = 0.;
    contact.initialize(settings);
  }

  // Of a sole by the normal of the ground that its corners touch, which is not the sole's where
  // that is tilted; a pyramid has the sole's axes.
  double findFrictionUsage(const Eigen::Vector3d& force) const {
    const auto* surface = dynamic_cast<const Contact6D*>(contact_.get());
    const double own = contact_->getFrictionUsage();
    if (std::isnan(own) || !surface)
      return force_[2] >= minimal_force_ || std::isnan(own) ? own : 0.;
    if (force.z() < minimal_force_) return 0.;
    const Eigen::Vector2d along = force_.head<2>();
    const double part =
        along.isZero(0.) ? 1. : surface->getSettings().findTangential(along) / along.norm();
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

// How many contacts parts have, besides those of bodies.
std::size_t countContactsOf(const std::vector<PartRobot::Part>& parts, std::size_t bodies) {
  std::size_t count = 0;
  for (const PartRobot::Part& part : parts) count = std::max(count, part.contact + 1);
  return count - std::min(count, bodies);
}

// A schedule for owners of parts, whose numbers begin with `first`.
ContactSchedule gather(const std::vector<PartRobot::Part>& parts, std::size_t first,
                       std::vector<std::string> owners, const ContactSchedule& schedule) {
  internal::requireSize("schedule.names", schedule.names.size(), parts.size(), "parts");
  const Eigen::Index frames = schedule.active.cols();
  schedule.validate(frames);
  ContactSchedule gathered;
  gathered.names = std::move(owners);
  const auto count = static_cast<Eigen::Index>(gathered.names.size());
  gathered.active.setConstant(count, frames, false);
  if (schedule.confidence.size() > 0) gathered.confidence.setZero(count, frames);
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const auto owner = static_cast<Eigen::Index>(parts[k].contact - first);
    if (parts[k].contact < first || owner >= count) continue;
    const auto part = static_cast<Eigen::Index>(k);
    gathered.active.row(owner) = gathered.active.row(owner) || schedule.active.row(part);
    if (schedule.confidence.size() > 0)
      gathered.confidence.row(owner) =
          gathered.confidence.row(owner).cwiseMax(schedule.confidence.row(part));
  }
  return gathered;
}

// As the public function of that name, for parts and bodies of whatever was split.
// @param find_friction  of a part, by its number
MotionAnalysis gather(const DynaCoM& robot, const std::vector<PartRobot::Part>& parts,
                      const std::vector<std::string>& links,
                      const std::function<SurfaceOptions(std::size_t)>& find_friction,
                      const std::vector<ContactMotion>& contacts,
                      const std::vector<ContactMotion>& motions, MotionAnalysis analysis) {
  const std::vector<std::string> names = robot.getKnownContacts();
  internal::requireSize("contacts", contacts.size(), names.size(), "contacts of the robot");
  internal::requireSize("motions", motions.size(), parts.size(), "parts");
  internal::requireSize("analysis.contacts", analysis.contacts.size(), parts.size(), "parts");
  const Eigen::Index frames = analysis.time.size();
  for (const auto* list : {&contacts, &motions})
    for (const ContactMotion& moved : *list)
      internal::requireSize(moved.name.c_str(), moved.height.size(), frames, "frames");

  std::vector<MotionAnalysis::Contact> gathered;
  std::vector<Gatherer> gatherers;
  std::vector<MotionAnalysis::Body> bodies(links.size());
  for (std::size_t k = 0; k < bodies.size(); ++k) {
    bodies[k].link = links[k];
    bodies[k].active.setConstant(frames, false);
    bodies[k].force.setZero(3, frames);
    bodies[k].position.setZero(3, frames);
  }
  for (std::size_t k = 0; k < names.size(); ++k) {
    gathered.push_back(makeContact(names[k], frames));
    const auto part = std::find_if(parts.begin(), parts.end(), [k](const PartRobot::Part& other) {
      return other.contact == k;
    });
    if (part != parts.end())
      gathered[k].friction = find_friction(std::size_t(part - parts.begin()));
    gatherers.emplace_back(robot, names[k], gathered[k].friction);
  }
  const auto findRotation = [](const ContactMotion& moved, Eigen::Index frame) {
    return Eigen::Quaterniond(moved.rotation.col(frame)).toRotationMatrix();
  };
  std::vector<DynaCoM::Vector6> wrenches(names.size());
  std::vector<Eigen::Vector3d> forces(names.size());
  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    for (DynaCoM::Vector6& wrench : wrenches) wrench.setZero();
    for (Eigen::Vector3d& force : forces) force.setZero();
    for (std::size_t k = 0; k < parts.size(); ++k) {
      const MotionAnalysis::Contact& part = analysis.contacts[k];
      if (!part.active[frame]) continue;
      const std::size_t owner = parts[k].contact;
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
      forces[owner] += part.wrench.col(frame).head<3>();
      wrenches[owner].head<3>() += force;
      wrenches[owner].tail<3>() += lever.cross(force);
    }
    for (std::size_t k = 0; k < names.size(); ++k) {
      if (!gathered[k].active[frame]) continue;
      const Eigen::Matrix3d axes = findRotation(contacts[k], frame).transpose();
      DynaCoM::Vector6 wrench;
      wrench << axes * wrenches[k].head<3>(), axes * wrenches[k].tail<3>();
      gatherers[k].write(frame, wrench, forces[k], gathered[k]);
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

}  // namespace

std::size_t PartRobot::countContacts() const { return countContactsOf(parts, bodies.size()); }

std::size_t internal::ContactSplit::countContacts() const {
  return countContactsOf(parts, bodies.size());
}

std::vector<std::string> internal::ContactSplit::nameContacts() const {
  std::vector<std::string> names(countContacts());
  std::vector<int> count(names.size(), 0);
  for (const PartRobot::Part& part : parts) {
    if (part.contact >= names.size()) continue;
    // One that is alone has its contact's name, see splitContacts().
    const bool is_alone = count[part.contact]++ == 0;
    names[part.contact] = is_alone ? part.name : part.name.substr(0, part.name.rfind('.'));
  }
  return names;
}

internal::ContactSplit internal::describeSplit(const PartRobot& parts) {
  return {parts.parts, parts.bodies, describeCarrier(parts.robot)};
}

double internal::findBodyFriction(const std::vector<FixedContact>& points) {
  if (points.empty()) return kBodyFriction;
  double least = std::numeric_limits<double>::infinity();
  for (const FixedContact& point : points) least = std::min(least, settingsOf(*point.contact).mu);
  return least;
}

internal::ContactSplit internal::splitCarrier(const DynaCoM& robot,
                                              const std::vector<BodyPoints>& bodies,
                                              FrictionModel friction) {
  const pinocchio::Model& model = robot.getModel();
  ContactSplit split = {{}, {}, describeCarrier(robot)};
  const std::vector<FixedContact> contacts = std::move(split.carrier.contacts);
  std::vector<FixedContact>& points = split.carrier.contacts;
  points.clear();
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const FixedContact& whole = contacts[k];
    if (const auto* point = dynamic_cast<const ContactPoint*>(whole.contact.get())) {
      ContactPointSettings part = point->getSettings();
      takeFriction(part, whole.name, friction, part);
      split.parts.push_back({whole.name, k, 0});
      points.push_back(
          {whole.name, std::make_shared<ContactPoint>(part), whole.joint, whole.placement});
    } else if (const auto* surface = dynamic_cast<const Contact6D*>(whole.contact.get())) {
      const Eigen::Matrix2Xd corners = surface->getCorners();
      ContactPointSettings part;
      takeFriction(surface->getSettings(), whole.name, friction, part);
      part.mu = surface->getSettings().mu;
      part.weights = std::sqrt(double(corners.cols())) * surface->getSettings().weights.head<3>();
      part.world_aligned = true;
      const pinocchio::SE3 placement = whole.placement * surface->getSettings().placement;
      for (Eigen::Index i = 0; i < corners.cols(); ++i) {
        part.frame_name = whole.name + "." + kCorners[i];
        const Eigen::Vector3d corner(corners(0, i), corners(1, i), 0.);
        split.parts.push_back({part.frame_name, k, 0});
        points.push_back({part.frame_name, std::make_shared<ContactPoint>(part), whole.joint,
                          placement * makeOffset(corner)});
      }
    } else {
      throwInvalid("contact '", whole.name,
                   "' must be a ContactPoint or a Contact6D to be taken apart, got another kind");
    }
  }
  Limbs limbs(model);
  for (const FixedContact& point : points) limbs.add(point.joint);
  int limb = 0;
  for (std::size_t k = 0; k < points.size(); ++k) {
    split.parts[k].limb = limbs.find(points[k].joint);
    limb = std::max(limb, split.parts[k].limb + 1);
  }

  ContactPointSettings point;
  point.friction = friction;
  point.mu = findBodyFriction(points);
  if (!points.empty()) point.weights = settingsOf(*points.front().contact).weights;
  point.world_aligned = true;
  for (const BodyPoints& body : bodies) {
    if (body.points.cols() == 0) continue;
    if (body.joint == 0 || body.joint >= static_cast<std::size_t>(model.njoints))
      throwInvalid("body '", body.link, "': joint must be one of the robot's, 1 to ",
                   model.njoints - 1, ", got ", body.joint);
    requireSize("radius", body.radius.size(), body.points.cols(), "points");
    for (Eigen::Index i = 0; i < body.points.cols(); ++i) {
      point.frame_name = "body." + body.link + "." + std::to_string(i);
      point.radius = body.radius[i];
      split.parts.push_back({point.frame_name, contacts.size() + split.bodies.size(), limb});
      points.push_back({point.frame_name, std::make_shared<ContactPoint>(point), body.joint,
                        makeOffset(body.points.col(i))});
    }
    split.bodies.push_back(body.link);
    ++limb;
  }
  return split;
}

PartRobot splitContacts(const DynaCoM& robot, const std::vector<BodyPoints>& bodies,
                        FrictionModel friction) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by splitContacts before initialize()");
  internal::ContactSplit parts = internal::splitCarrier(robot, bodies, friction);
  const std::vector<std::string> names = robot.getKnownContacts();
  pinocchio::Model model = robot.getModel();
  std::vector<std::shared_ptr<ContactPoint>> points;
  for (std::size_t k = 0; k < parts.parts.size(); ++k) {
    const internal::FixedContact& fixed = parts.carrier.contacts[k];
    ContactPointSettings settings = settingsOf(*fixed.contact);
    // A contact that is a point has a frame already.
    const std::size_t owner = parts.parts[k].contact;
    if (owner >= names.size() || parts.parts[k].name != names[owner])
      settings.frame_name = addFrame(model, fixed.joint, fixed.placement, fixed.name);
    points.push_back(std::make_shared<ContactPoint>(settings));
  }
  PartRobot split{DynaCoM(model), std::move(parts.parts), std::move(parts.bodies)};
  split.robot.setGroundHeight(robot.getGroundHeight());
  split.robot.setMinimalVerticalForce(robot.getMinimalVerticalForce());
  split.robot.setWrenchWeights(robot.getWrenchWeights());
  split.robot.setWarmStart(robot.getWarmStart());
  split.robot.setMaximalIterations(robot.getMaximalIterations());
  for (std::size_t k = 0; k < points.size(); ++k)
    split.robot.addContact(points[k], split.parts[k].name);
  return split;
}

MotionAnalysis gatherParts(const DynaCoM& robot, const PartRobot& parts,
                           const std::vector<ContactMotion>& contacts,
                           const std::vector<ContactMotion>& motions, MotionAnalysis analysis) {
  const auto findFriction = [&](std::size_t part) -> SurfaceOptions {
    return settingsOf(*parts.robot.getContact(parts.parts[part].name));
  };
  return gather(robot, parts.parts, parts.bodies, findFriction, contacts, motions,
                std::move(analysis));
}

MotionAnalysis internal::gatherParts(const DynaCoM& robot, const ContactSplit& split,
                                     const std::vector<ContactMotion>& contacts,
                                     const std::vector<ContactMotion>& motions,
                                     MotionAnalysis analysis) {
  const auto findFriction = [&](std::size_t part) -> SurfaceOptions {
    return settingsOf(*split.carrier.contacts[part].contact);
  };
  return gather(robot, split.parts, split.bodies, findFriction, contacts, motions,
                std::move(analysis));
}

ContactSchedule gatherParts(const DynaCoM& robot, const PartRobot& parts,
                            const ContactSchedule& schedule) {
  return gather(parts.parts, 0, robot.getKnownContacts(), schedule);
}

ContactSchedule internal::gatherParts(const std::vector<std::string>& contacts,
                                      const ContactSplit& split, const ContactSchedule& schedule) {
  return gather(split.parts, 0, contacts, schedule);
}

ContactSchedule gatherBodies(const PartRobot& parts, const ContactSchedule& schedule) {
  return gather(parts.parts, parts.countContacts(), parts.bodies, schedule);
}

ContactSchedule internal::gatherBodies(const ContactSplit& split, const ContactSchedule& schedule) {
  return gather(split.parts, split.countContacts(), split.bodies, schedule);
}

}  // namespace dynacom
