// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion.hpp"

#include <algorithm>
#include <cmath>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::kNaN;
using internal::throwInvalid;

namespace {

// How far a quaternion's squared norm may be from 1: files are often rounded to a few digits.
constexpr double kNormalized = 1e-3;
// How many frames pass between two calls of AnalysisSettings::progress.
constexpr Eigen::Index kProgressFrames = 256;

void requireFrames(const char* name, const Eigen::MatrixXd& values, Eigen::Index size,
                   const char* unit, Eigen::Index frames) {
  internal::requireSize(name, values.rows(), size, unit);
  internal::requireSize(name, values.cols(), frames, "frames");
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!values.col(frame).allFinite())
      throwInvalid(name, " must be finite, got another number in frame ", frame);
}

// √(g / mean height of the CoM above the ground), the natural frequency of the pendulum.
double computeOmega(const Eigen::Matrix3Xd& com, double gravity, double ground_height) {
  const double height = com.row(2).mean() - ground_height;
  const double omega = std::sqrt(gravity / height);
  return omega > 0. && std::isfinite(omega) ? omega : kNaN;
}

}  // namespace

void Motion::validate(const pinocchio::Model& model) const {
  if (frames() == 0) throwInvalid("time must have at least one frame, got 0");
  for (Eigen::Index frame = 0; frame < frames(); ++frame) {
    if (!std::isfinite(time[frame]))
      throwInvalid("time must be finite, got ", time[frame], " in frame ", frame);
    if (frame > 0 && !(time[frame] > time[frame - 1]))
      throwInvalid("time must increase, got ", time[frame - 1], " s and then ", time[frame],
                   " s in frame ", frame);
  }
  requireFrames("q", q, model.nq, "components (nq)", frames());
  for (Eigen::Index frame = 0; frame < frames(); ++frame)
    if (!pinocchio::isNormalized(model, q.col(frame), kNormalized))
      throwInvalid("q must have quaternions of norm 1, got another in frame ", frame);
  requireFrames("v", v, model.nv, "components (nv)", frames());
  requireFrames("a", a, model.nv, "components (nv)", frames());
}

void ContactSchedule::validate(Eigen::Index frames) const {
  for (auto name = names.begin(); name != names.end(); ++name)
    if (std::find(names.begin(), name, *name) != name)
      throwInvalid("the schedule names the contact '", *name, "' twice");
  internal::requireSize("active", active.rows(), Eigen::Index(names.size()), "contacts");
  internal::requireSize("active", active.cols(), frames, "frames");
}

void AnalysisSettings::validate() const {
  internal::requireField(omega >= 0. && std::isfinite(omega), "AnalysisSettings.omega",
                         "finite and >= 0 rad/s", omega);
}

MotionAnalysis analyzeMotion(const DynaCoM& robot, const Motion& motion,
                             const ContactSchedule& schedule, const AnalysisSettings& settings) {
  if (!robot.isInitialized())
    throw NotReadyError("DynaCoM is used by analyzeMotion before initialize()");
  const Eigen::Index frames = motion.frames();
  motion.validate(robot.getModel());
  schedule.validate(frames);
  settings.validate();

  DynaCoM worker(robot);
  for (const std::string& name : worker.getKnownContacts()) worker.resetContactPose(name);
  MotionAnalysis result;
  for (const std::string& name : schedule.names) worker.getContact(name);
  std::vector<std::shared_ptr<const ContactBase>> contacts;
  for (const std::string& name : worker.getKnownContacts()) {
    worker.deactivateContact(name);
    contacts.push_back(worker.getContact(name));
    result.contacts.push_back({name, Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(frames, false),
                               Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, frames),
                               Eigen::VectorXd::Zero(frames)});
  }
  result.time = motion.time;
  for (Eigen::Matrix3Xd* values : {&result.com, &result.vcom, &result.acom, &result.am, &result.dam,
                                   &result.ground_force, &result.ground_torque})
    values->resize(3, frames);
  for (Eigen::Matrix2Xd* values : {&result.cop, &result.vrp, &result.nl})
    values->setConstant(2, frames, kNaN);
  result.status.resize(frames);
  result.residual.resize(6, frames);
  Eigen::Matrix3Xd acceleration(3, frames);  // of the virtual repellent point, as DynaCoM's

  for (Eigen::Index frame = 0; frame < frames; ++frame) {
    for (std::size_t k = 0; k < schedule.names.size(); ++k) {
      if (schedule.active(k, frame))
        worker.activateContact(schedule.names[k]);
      else
        worker.deactivateContact(schedule.names[k]);
    }
    worker.computeDynamics(motion.q.col(frame), motion.v.col(frame), motion.a.col(frame),
                           DynaCoM::Vector6::Zero(), settings.flat_horizontal_ground);
    result.com.col(frame) = worker.getCoM();
    result.vcom.col(frame) = worker.getVCoM();
    result.acom.col(frame) = worker.getACoM();
    result.am.col(frame) = worker.getAM();
    result.dam.col(frame) = worker.getAMVariation();
    result.ground_force.col(frame) = worker.getGroundCoMForce();
    result.ground_torque.col(frame) = worker.getGroundCoMTorque();
    result.cop.col(frame) = worker.getCoP();

    // On uneven ground the centre of pressure needed the distribution already.
    if (settings.flat_horizontal_ground)
      worker.distributeForce(worker.getGroundCoMForce(), worker.getGroundCoMTorque(),
                             worker.getCoM());
    result.status[frame] = worker.getDistributionStatus();
    result.residual.col(frame) = worker.getDistribution().residual;
    acceleration.col(frame) =
        settings.flat_horizontal_ground ? worker.getACoM() : worker.getFeasibleACoM();
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      const ContactBase& contact = *contacts[k];
      result.contacts[k].wrench.col(frame).head(contact.cols()) = contact.appliedForce();
      result.contacts[k].vertical_force[frame] = contact.toCoMForces().z();
    }
    if (settings.progress && (frame + 1) % kProgressFrames == 0) settings.progress(frame + 1);
  }
  for (std::size_t k = 0; k < schedule.names.size(); ++k)
    for (MotionAnalysis::Contact& contact : result.contacts)
      if (contact.name == schedule.names[k]) contact.active = schedule.active.row(k).transpose();

  result.omega = settings.omega;
  if (result.omega == 0.)
    result.omega =
        computeOmega(result.com, -worker.getSettings().gravity.z(), worker.getGroundHeight());
  if (!std::isnan(result.omega)) {
    CentroidalState state;
    for (Eigen::Index frame = 0; frame < frames; ++frame) {
      state.com = result.com.col(frame);
      state.acom = acceleration.col(frame);
      result.vrp.col(frame) = computeVRP(state, result.omega);
    }
    result.nl = result.cop - result.vrp;  // (8)
  }
  if (settings.progress && frames % kProgressFrames != 0) settings.progress(frames);
  return result;
}

}  // namespace dynacom
