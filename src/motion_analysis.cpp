// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/motion_analysis.hpp"

#include <cmath>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::kNaN;

namespace {

// How many frames pass between two calls of AnalysisSettings::progress.
constexpr Eigen::Index kProgressFrames = 256;

// √(g / mean height of the CoM above the ground), the natural frequency of the pendulum.
double computeOmega(const Eigen::Matrix3Xd& com, double gravity, double ground_height) {
  const double height = com.row(2).mean() - ground_height;
  const double omega = std::sqrt(gravity / height);
  return omega > 0. && std::isfinite(omega) ? omega : kNaN;
}

// What a contact does, for frames in which it takes no part.
MotionAnalysis::Contact makeContact(const std::string& name, Eigen::Index frames) {
  const Eigen::VectorXd unknown = Eigen::VectorXd::Constant(frames, kNaN);
  return {name,
          Eigen::Array<bool, Eigen::Dynamic, 1>::Constant(frames, false),
          Eigen::Matrix<double, 6, Eigen::Dynamic>::Zero(6, frames),
          Eigen::VectorXd::Zero(frames),
          Eigen::Matrix2Xd::Constant(2, frames, kNaN),
          unknown,
          unknown,
          unknown};
}

}  // namespace

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
    result.contacts.push_back(makeContact(name, frames));
  }
  for (std::size_t k = 0; k < schedule.names.size(); ++k)
    for (MotionAnalysis::Contact& contact : result.contacts)
      if (contact.name == schedule.names[k]) contact.active = schedule.active.row(k).transpose();
  result.time = motion.time;
  for (Eigen::Matrix3Xd* values :
       {&result.com, &result.vcom, &result.acom, &result.am, &result.dam, &result.ground_force,
        &result.ground_torque, &result.feasible_acom, &result.feasible_dam})
    values->resize(3, frames);
  for (Eigen::Matrix2Xd* values : {&result.cop, &result.vrp, &result.nl, &result.dcm})
    values->setConstant(2, frames, kNaN);
  result.status.resize(frames);
  result.residual.resize(6, frames);

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
    result.feasible_acom.col(frame) = worker.getFeasibleACoM();
    result.feasible_dam.col(frame) = worker.getFeasibleAMVariation();
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      MotionAnalysis::Contact& contact = result.contacts[k];
      if (!contact.active[frame]) continue;
      contact.wrench.col(frame).head(contacts[k]->cols()) = contacts[k]->appliedForce();
      contact.vertical_force[frame] = contacts[k]->toCoMForces().z();
      contact.cop.col(frame) = worker.getContactCoP(contact.name);
      contact.friction_usage[frame] = worker.getContactFrictionUsage(contact.name);
      contact.yaw_usage[frame] = worker.getContactYawUsage(contact.name);
      contact.cop_margin[frame] = worker.getContactCoPMargin(contact.name);
    }
    if (settings.progress && (frame + 1) % kProgressFrames == 0) settings.progress(frame + 1);
  }

  result.omega = settings.omega;
  if (result.omega == 0.)
    result.omega =
        computeOmega(result.com, -worker.getSettings().gravity.z(), worker.getGroundHeight());
  if (!std::isnan(result.omega)) {
    // Of the motion whose centre of pressure is reported, as DynaCoM::computeNL().
    const Eigen::Matrix3Xd& acceleration =
        settings.flat_horizontal_ground ? result.acom : result.feasible_acom;
    CentroidalState state;
    for (Eigen::Index frame = 0; frame < frames; ++frame) {
      state.com = result.com.col(frame);
      state.vcom = result.vcom.col(frame);
      state.acom = acceleration.col(frame);
      result.vrp.col(frame) = computeVRP(state, result.omega);
      result.dcm.col(frame) = computeDCM(state, result.omega);
    }
    result.nl = result.cop - result.vrp;  // (8)
  }
  if (settings.progress && frames % kProgressFrames != 0) settings.progress(frames);
  return result;
}

}  // namespace dynacom
