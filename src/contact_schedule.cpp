// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_schedule.hpp"

#include <algorithm>
#include <cmath>
#include <optional>
#include <ostream>
#include <pinocchio/multibody.hpp>

#include "check.hpp"
#include "contact_frame.hpp"
#include "motion_steps.hpp"

namespace dynacom {

using internal::requireField;
using internal::throwInvalid;

namespace {

// Which part of the heights of a slow contact is below its ground: what lies lower is noise.
constexpr double kGroundPart = 0.05;
// What standing still is, as a part of what is slow.
constexpr double kStill = 0.2;
// What durations may lack through the rounding of times [s].
constexpr double kRounding = 1e-9;
// How many times its median speed a contact may move until it is not at rest.
constexpr double kRest = 3.;

bool isNotNegative(double value) { return std::isfinite(value) && value >= 0.; }

double percentile(std::vector<double> values, double part) {
  const auto nth = values.begin() + std::lround(part * double(values.size() - 1));
  std::nth_element(values.begin(), nth, values.end());
  return *nth;
}

void requireSizes(const std::vector<ContactMotion>& contacts, Eigen::Index frames) {
  for (const ContactMotion& contact : contacts) {
    internal::requireSize("height", contact.height.size(), frames, "frames (as many as time)");
    internal::requireSize("velocity", contact.velocity.cols(), frames, "frames (as many as time)");
  }
}

// Calls a function with the first frame and the one behind the last of each run of equal values.
template <class Function>
void forEachRun(const Eigen::Array<bool, Eigen::Dynamic, 1>& values, Function function) {
  for (Eigen::Index first = 0, last = 0; first < values.size(); first = last) {
    while (last < values.size() && values[last] == values[first]) ++last;
    function(first, last);
  }
}

// How long frames last, each until the next begins; the last one of all as long as the one before.
double duration(const Eigen::VectorXd& time, Eigen::Index first, Eigen::Index behind) {
  const Eigen::Index frames = time.size();
  if (behind < frames) return time[behind] - time[first];
  const double last_step = frames > 1 ? time[frames - 1] - time[frames - 2] : 0.;
  return time[frames - 1] - time[first] + last_step;
}

// Turns short runs of a value into the other one: those inside, where both neighbours are that.
void removeShort(bool value, const Eigen::VectorXd& time, double minimal_duration,
                 Eigen::Array<bool, Eigen::Dynamic, 1>& values) {
  const Eigen::Array<bool, Eigen::Dynamic, 1> before = values;
  forEachRun(before, [&](Eigen::Index first, Eigen::Index behind) {
    const bool inside = first > 0 && behind < values.size();
    if (inside && before[first] == value &&
        duration(time, first, behind) < minimal_duration - kRounding)
      values.segment(first, behind - first).setConstant(!value);
  });
}

// Cuts runs of contact back to where the contact is at rest, but for the ends of the motion.
void cutToRest(const Eigen::VectorXd& speed, double rest_speed,
               Eigen::Array<bool, Eigen::Dynamic, 1>& active) {
  const Eigen::Array<bool, Eigen::Dynamic, 1> before = active;
  forEachRun(before, [&](Eigen::Index first, Eigen::Index behind) {
    if (!before[first]) return;
    const double* const speeds = speed.data();
    const double median = percentile({speeds + first, speeds + behind}, 0.5);
    const double limit = std::max(rest_speed, kRest * median);
    if (first > 0)
      for (Eigen::Index frame = first; speed[frame] > limit; ++frame) active[frame] = false;
    if (behind < active.size())
      for (Eigen::Index frame = behind - 1; speed[frame] > limit; --frame) active[frame] = false;
  });
}

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

void DetectionSettings::validate() const {
  requireField(isNotNegative(height), "DetectionSettings.height", "finite and >= 0 m", height);
  requireField(isNotNegative(speed), "DetectionSettings.speed", "finite and >= 0 m/s", speed);
  requireField(std::isfinite(release_height) && release_height >= height,
               "DetectionSettings.release_height", "finite and >= height", release_height);
  requireField(std::isfinite(release_speed) && release_speed >= speed,
               "DetectionSettings.release_speed", "finite and >= speed", release_speed);
  requireField(isNotNegative(rest_speed), "DetectionSettings.rest_speed", "finite and >= 0 m/s",
               rest_speed);
  requireField(isNotNegative(minimal_duration), "DetectionSettings.minimal_duration",
               "finite and >= 0 s", minimal_duration);
  requireField(!std::isinf(ground_height), "DetectionSettings.ground_height", "finite or NaN",
               ground_height);
  requireField(isNotNegative(same_ground), "DetectionSettings.same_ground", "finite and >= 0 m",
               same_ground);
}

std::string DetectionSettings::to_string() const { return internal::concat(*this); }

bool DetectionSettings::operator==(const DetectionSettings& other) const {
  const bool same_ground_height = ground_height == other.ground_height ||
                                  (std::isnan(ground_height) && std::isnan(other.ground_height));
  return height == other.height && speed == other.speed && release_height == other.release_height &&
         release_speed == other.release_speed && rest_speed == other.rest_speed &&
         minimal_duration == other.minimal_duration && same_ground_height &&
         same_ground == other.same_ground;
}

std::ostream& operator<<(std::ostream& out, const DetectionSettings& settings) {
  return out << "DetectionSettings(height=" << settings.height << ", speed=" << settings.speed
             << ", release_height=" << settings.release_height
             << ", release_speed=" << settings.release_speed
             << ", rest_speed=" << settings.rest_speed
             << ", minimal_duration=" << settings.minimal_duration
             << ", ground_height=" << settings.ground_height
             << ", same_ground=" << settings.same_ground << ")";
}

Eigen::VectorXd estimateGround(const std::vector<ContactMotion>& contacts,
                               const Eigen::VectorXd& time, const DetectionSettings& settings) {
  settings.validate();
  requireSizes(contacts, time.size());
  const auto count = static_cast<Eigen::Index>(contacts.size());
  if (!std::isnan(settings.ground_height))
    return Eigen::VectorXd::Constant(count, settings.ground_height);

  // Of each contact, from frames where it is slower than a speed; nothing where there are none.
  const auto findGround = [&](const ContactMotion& contact, double speed) {
    std::vector<double> heights;
    for (Eigen::Index frame = 0; frame < time.size(); ++frame)
      if (contact.velocity.col(frame).norm() <= speed) heights.push_back(contact.height[frame]);
    return heights.empty() ? std::nullopt
                           : std::optional<double>(percentile(std::move(heights), kGroundPart));
  };
  std::vector<std::optional<double>> own;
  double lowest = std::numeric_limits<double>::infinity();
  for (const ContactMotion& contact : contacts) {
    own.push_back(findGround(contact, settings.speed));
    if (own.back()) lowest = std::min(lowest, *own.back());
  }
  if (std::isinf(lowest))  // nothing ever is slow
    for (const ContactMotion& contact : contacts)
      if (contact.height.size() > 0) lowest = std::min(lowest, contact.height.minCoeff());

  Eigen::VectorXd ground = Eigen::VectorXd::Constant(count, lowest);
  for (Eigen::Index k = 0; k < count; ++k) {
    const ContactMotion& contact = contacts[static_cast<std::size_t>(k)];
    const std::optional<double>& height = own[static_cast<std::size_t>(k)];
    if (!height) continue;
    const double top = *height + settings.release_height;
    bool stands = false;
    const auto still =
        ((contact.velocity.colwise().norm().transpose().array() <= kStill * settings.speed) &&
         (contact.height.array() <= top))
            .eval();
    forEachRun(still, [&](Eigen::Index first, Eigen::Index behind) {
      stands = stands || (still[first] &&
                          duration(time, first, behind) >= settings.minimal_duration - kRounding);
    });
    if (*height <= lowest + settings.same_ground || stands) ground[k] = *height;
  }
  return ground;
}

ContactSchedule detectContacts(const std::vector<ContactMotion>& contacts,
                               const Eigen::VectorXd& time, const Eigen::VectorXd& ground,
                               const DetectionSettings& settings) {
  settings.validate();
  requireSizes(contacts, time.size());
  internal::requireSize("ground", ground.size(), Eigen::Index(contacts.size()),
                        "heights (one per contact)");
  ContactSchedule schedule;
  schedule.active.resize(ground.size(), time.size());
  for (Eigen::Index k = 0; k < ground.size(); ++k) {
    const ContactMotion& contact = contacts[static_cast<std::size_t>(k)];
    schedule.names.push_back(contact.name);
    const Eigen::VectorXd speed = contact.velocity.colwise().norm();
    Eigen::Array<bool, Eigen::Dynamic, 1> active(time.size());
    bool touches = false;
    for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
      const double height = contact.height[frame] - ground[k];
      touches = touches
                    ? height <= settings.release_height && speed[frame] <= settings.release_speed
                    : height <= settings.height && speed[frame] <= settings.speed;
      active[frame] = touches;
    }
    removeShort(false, time, settings.minimal_duration, active);
    cutToRest(speed, settings.rest_speed, active);
    removeShort(true, time, settings.minimal_duration, active);
    schedule.active.row(k) = active.transpose();
  }
  return schedule;
}

}  // namespace dynacom
