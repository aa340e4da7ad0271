// SPDX-License-Identifier: BSD-2-Clause
#include "motion_sweep.hpp"

#include <limits>
#include <pinocchio/algorithm/kinematics.hpp>
#include <utility>

#include "dynacom/centroidal.hpp"
#include "motion_check.hpp"
#include "nan.hpp"

namespace dynacom::internal {

namespace {

// A frame's numbers are not finite; requireNumbers() says which.
struct InvalidFrame {};

bool isFinite(const CentroidalState& state, const CentroidalWrench& wrench) {
  return state.com.allFinite() && state.vcom.allFinite() && state.acom.allFinite() &&
         state.am.allFinite() && state.amVariation.allFinite() && wrench.force.allFinite() &&
         wrench.torque.allFinite();
}

}  // namespace

// What a thread does with blocks of frames.
class MotionSweep::Worker {
 public:
  Worker(const MotionSweep& sweep, const Motion& motion, std::vector<ContactMotion>& contacts,
         MotionAnalysis* dynamics)
      : sweep_(sweep),
        motion_(motion),
        contacts_(contacts),
        dynamics_(dynamics),
        check_(sweep.model_),
        model_(sweep.model_) {
    if (sweep.lane_robot_) lanes_.emplace(*sweep.lane_robot_);
  }

  void run(Eigen::Index first, Eigen::Index frames) {
    if (lanes_) {
      for (ContactMotion& contact : contacts_)  // those that have the world's axes
        contact.rotation.middleCols(first, frames).colwise() = Eigen::Vector4d::UnitW();
      lanes_->run(motion_, first, frames, dynamics_, contacts_);
    }
    for (Eigen::Index k = 0; k < frames; ++k)
      if (!lanes_ || !lanes_->isKnown(k)) computeFrame(first + k);
  }

 private:
  void computeFrame(Eigen::Index frame) {
    if (!data_) {  // what the lanes leave, if anything
      data_ = sweep_.data_.take();
      for (const FixedContact& fixed : sweep_.contacts_)
        placed_.push_back({fixed.contact->clone(), fixed.contact->getCorners()});
    }
    if (dynamics_) {
      if (!isFinite(motion_, frame)) throw InvalidFrame();
      if (!check_.isNormalized(model_, motion_.q.col(frame))) {
        writeUnknown(frame);
        return;
      }
      computeDynamics(frame);
    } else {
      pinocchio::forwardKinematics(model_, *data_, motion_.q.col(frame), motion_.v.col(frame));
    }
    for (std::size_t k = 0; k < placed_.size(); ++k)
      place(sweep_.contacts_[k], placed_[k], frame, contacts_[k]);
  }

  // Numbers that are too large to be computed with are not known at all.
  void computeDynamics(Eigen::Index frame) {
    const CentroidalState state = computeCentroidalState(
        model_, *data_, motion_.q.col(frame), motion_.v.col(frame), motion_.a.col(frame));
    const CentroidalWrench wrench =
        computeGroundWrench(state, model_.gravity.linear(), DynaCoM::Vector6::Zero());
    if (isFinite(state, wrench))
      write(frame, state, wrench);
    else
      writeUnknownDynamics(frame);
  }

  // Of what is no configuration nothing is known.
  void writeUnknown(Eigen::Index frame) {
    writeUnknownDynamics(frame);
    for (ContactMotion& contact : contacts_) {
      contact.position.col(frame).setConstant(kNaN);
      contact.rotation.col(frame).setConstant(kNaN);
      contact.height[frame] = kNaN;
      contact.velocity.col(frame).setConstant(kNaN);
    }
  }

  void writeUnknownDynamics(Eigen::Index frame) {
    const Eigen::Vector3d nan = Eigen::Vector3d::Constant(kNaN);
    write(frame, {kNaN, nan, nan, nan, nan, nan}, {nan, nan});
  }

  void write(Eigen::Index frame, const CentroidalState& state, const CentroidalWrench& wrench) {
    dynamics_->com.col(frame) = state.com;
    dynamics_->vcom.col(frame) = state.vcom;
    dynamics_->acom.col(frame) = state.acom;
    dynamics_->am.col(frame) = state.am;
    dynamics_->dam.col(frame) = state.amVariation;
    dynamics_->ground_force.col(frame) = wrench.force;
    dynamics_->ground_torque.col(frame) = wrench.torque;
  }

  struct Placed {
    std::shared_ptr<ContactBase> contact;
    Eigen::Matrix2Xd corners;
  };

  void place(const FixedContact& fixed, const Placed& placed, Eigen::Index frame,
             ContactMotion& motion) const {
    const pinocchio::SE3& joint = data_->oMi[fixed.joint];
    placed.contact->setPose(joint * fixed.placement);
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
    const pinocchio::Motion& velocity = data_->v[fixed.joint];  // in the joint's axes
    motion.velocity.col(frame) =
        joint.rotation() * (velocity.linear() + velocity.angular().cross(joint.actInv(lowest)));
  }

  const MotionSweep& sweep_;
  const Motion& motion_;
  std::vector<ContactMotion>& contacts_;
  MotionAnalysis* const dynamics_;
  const ConfigurationCheck check_;
  const pinocchio::Model& model_;
  std::optional<LaneSweeper> lanes_;
  std::shared_ptr<pinocchio::Data> data_;
  std::vector<Placed> placed_;
};

MotionSweep::MotionSweep(const pinocchio::Model& model, std::vector<FixedContact> contacts,
                         int lanes, DataPool& data)
    : model_(model),
      contacts_(std::move(contacts)),
      data_(data),
      lane_robot_(LaneRobot::make(model_, contacts_, lanes)) {}

void MotionSweep::run(const Motion& motion, Workers& workers, std::vector<ContactMotion>& contacts,
                      MotionAnalysis* dynamics,
                      const std::function<void(Eigen::Index)>& progress) const {
  if (!hasSizes(model_, motion)) requireNumbers(model_, motion);
  const Eigen::Index frames = motion.frames();
  contacts.resize(contacts_.size());
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    contacts[k].name = contacts_[k].name;
    contacts[k].position.resize(3, frames);
    contacts[k].rotation.resize(4, frames);
    contacts[k].height.resize(frames);
    contacts[k].velocity.resize(3, frames);
  }
  if (dynamics) {
    dynamics->time = motion.time;
    for (Eigen::Matrix3Xd* values :
         {&dynamics->com, &dynamics->vcom, &dynamics->acom, &dynamics->am, &dynamics->dam,
          &dynamics->ground_force, &dynamics->ground_torque})
      values->resize(3, frames);
  }
  try {
    forEachBlock(
        workers, frames,
        [&]() -> BlockWork {
          const auto worker = std::make_shared<Worker>(*this, motion, contacts, dynamics);
          return [worker](Eigen::Index first, Eigen::Index size) { worker->run(first, size); };
        },
        progress);
  } catch (const InvalidFrame&) {
    requireNumbers(model_, motion);
    throw;
  }
}

}  // namespace dynacom::internal
