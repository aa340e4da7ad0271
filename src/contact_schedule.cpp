// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_schedule.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <pinocchio/multibody.hpp>
#include <utility>

#include "check.hpp"
#include "contact_frame.hpp"
#include "motion_steps.hpp"

namespace dynacom {

using internal::requireField;
using internal::throwInvalid;

namespace {

// What a thread has to place the contacts of a robot: copies of these, and the joints that they
// hang on.
class ContactPlacer {
 public:
  explicit ContactPlacer(const internal::Desks& desks) : model_(desks.robot().getModel()) {
    const DynaCoM& robot = desks.robot();
    if (desks.laneRobot()) lanes_.emplace(*desks.laneRobot(), robot.getGroundHeight(), true);
    std::vector<bool> carries(static_cast<std::size_t>(model_.njoints), false);
    for (const std::string& name : robot.getKnownContacts()) {
      const auto contact = robot.getContact(name)->clone();
      const pinocchio::Frame& frame = internal::getFrame(model_, *contact, name);
      contacts_.push_back({contact, frame, contact->getCorners()});
      for (auto joint = frame.parentJoint; joint > 0; joint = model_.parents[joint])
        carries[joint] = true;
    }
    moved_.resize(carries.size());
    for (std::size_t joint = 1; joint < carries.size(); ++joint)
      if (carries[joint]) joints_.push_back({joint, model_.joints[joint].createData()});
  }

  void place(const Motion& motion, Eigen::Index first, Eigen::Index frames,
             std::vector<ContactMotion>& contacts) {
    if (lanes_) lanes_->place(motion, first, frames);
    for (Eigen::Index k = 0; k < frames; ++k) {
      const Eigen::Index frame = first + k;
      const bool is_placed = lanes_ && lanes_->outcome(k) != lanes::Outcome::Nothing;
      if (!is_placed) moveJoints(motion, frame);
      for (std::size_t i = 0; i < contacts_.size(); ++i) {
        if (is_placed)
          write(contacts_[i], lanes_->placement(i, k), lanes_->velocity(i, k), frame, contacts[i]);
        else
          write(contacts_[i], findPlacement(contacts_[i]), findVelocity(contacts_[i]), frame,
                contacts[i]);
      }
    }
  }

 private:
  struct Placed {
    std::shared_ptr<ContactBase> contact;
    const pinocchio::Frame& frame;
    Eigen::Matrix2Xd corners;
  };
  struct Joint {
    std::size_t index;
    pinocchio::JointData data;
  };
  struct Moved {
    pinocchio::SE3 placement = pinocchio::SE3::Identity();
    pinocchio::Motion velocity = pinocchio::Motion::Zero();  // in the joint's axes
  };

  // As pinocchio::forwardKinematics(), for the joints that carry contacts.
  void moveJoints(const Motion& motion, Eigen::Index frame) {
    q_ = motion.q.col(frame);
    v_ = motion.v.col(frame);
    for (Joint& joint : joints_) {
      const Moved& parent = moved_[model_.parents[joint.index]];
      Moved& moved = moved_[joint.index];
      model_.joints[joint.index].calc(joint.data, q_, v_);
      const pinocchio::SE3 step = model_.jointPlacements[joint.index] * joint.data.M();
      moved.placement = parent.placement * step;
      moved.velocity = joint.data.v();
      moved.velocity += step.actInv(parent.velocity);
    }
  }

  // Of the contact's frame: in the world, and the velocity of its origin in the world's axes.
  pinocchio::SE3 findPlacement(const Placed& placed) const {
    return moved_[placed.frame.parentJoint].placement * placed.frame.placement;
  }
  pinocchio::Motion findVelocity(const Placed& placed) const {
    const Moved& joint = moved_[placed.frame.parentJoint];
    const pinocchio::Motion own = placed.frame.placement.actInv(joint.velocity);
    return pinocchio::SE3(findPlacement(placed).rotation(), Eigen::Vector3d::Zero()).act(own);
  }

  static void write(const Placed& placed, const pinocchio::SE3& placement,
                    const pinocchio::Motion& velocity, Eigen::Index frame, ContactMotion& motion) {
    placed.contact->setPose(placement);
    const pinocchio::SE3 surface = placed.contact->getSurfacePose();
    Eigen::Vector3d lowest = Eigen::Vector3d::Constant(std::numeric_limits<double>::infinity());
    for (Eigen::Index corner = 0; corner < placed.corners.cols(); ++corner) {
      const Eigen::Vector3d point =
          surface.act(Eigen::Vector3d(placed.corners(0, corner), placed.corners(1, corner), 0.));
      if (point.z() < lowest.z()) lowest = point;
    }
    motion.position.col(frame) = surface.translation();
    motion.rotation.col(frame) = Eigen::Quaterniond(surface.rotation()).coeffs();
    motion.height[frame] = lowest.z();
    motion.velocity.col(frame) =
        velocity.linear() + velocity.angular().cross(lowest - placement.translation());
  }

  const pinocchio::Model& model_;
  std::optional<internal::LaneAnalysis> lanes_;
  std::vector<Placed> contacts_;
  std::vector<Joint> joints_;  // that carry contacts
  std::vector<Moved> moved_;   // by index of all joints, the first of which is the world
  Eigen::VectorXd q_, v_;
};

}  // namespace

void ContactSchedule::validate(Eigen::Index frames) const {
  for (auto name = names.begin(); name != names.end(); ++name)
    if (std::find(names.begin(), name, *name) != name)
      throwInvalid("the schedule names the contact '", *name, "' twice");
  internal::requireSize("active", active.rows(), Eigen::Index(names.size()), "contacts");
  internal::requireSize("active", active.cols(), frames, "frames");
  for (const auto& [name, values] :
       {std::pair("confidence", &confidence), std::pair("readiness", &readiness)}) {
    if (values->size() == 0) continue;
    internal::requireSize(name, values->rows(), active.rows(), "contacts");
    internal::requireSize(name, values->cols(), frames, "frames");
  }
  const auto requireRange = [](const char* name, const Eigen::MatrixXd& values, bool may_be_zero) {
    for (Eigen::Index frame = 0; frame < values.cols(); ++frame)
      for (Eigen::Index row = 0; row < values.rows(); ++row) {
        const double value = values(row, frame);
        if (!((may_be_zero ? value >= 0. : value > 0.) && value <= 1.))
          throwInvalid(name, " must be ", may_be_zero ? ">= 0" : "> 0", " and <= 1, got ", value,
                       " in frame ", frame);
      }
  };
  requireRange("confidence", confidence, true);
  requireRange("readiness", readiness, false);
}

std::vector<ContactMotion> computeContactMotions(const DynaCoM& robot, const Motion& motion,
                                                 int threads, int lanes) {
  requireField(threads >= 0, "threads", ">= 0", threads);
  requireField(lanes >= 1, "lanes", ">= 1", lanes);
  internal::Desks desks(robot, lanes);
  internal::Workers workers(threads);
  return internal::computeContactMotions(desks, motion, workers);
}

std::vector<ContactMotion> internal::computeContactMotions(Desks& desks, const Motion& motion,
                                                           Workers& workers) {
  const DynaCoM& robot = desks.robot();
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by computeContactMotions before initialize()");
  const pinocchio::Model& model = robot.getModel();
  motion.validate(model);
  const Eigen::Index frames = motion.frames();
  std::vector<ContactMotion> contacts;
  for (const std::string& name : robot.getKnownContacts())
    contacts.push_back({name, Eigen::Matrix3Xd(3, frames), Eigen::Matrix4Xd(4, frames),
                        Eigen::VectorXd(frames), Eigen::Matrix3Xd(3, frames)});
  forEachBlock(workers, frames, [&]() -> BlockWork {
    const auto placer = std::make_shared<ContactPlacer>(desks);
    return [placer, &motion, &contacts](Eigen::Index first, Eigen::Index size) {
      placer->place(motion, first, size, contacts);
    };
  });
  return contacts;
}

}  // namespace dynacom
