// SPDX-License-Identifier: BSD-2-Clause
#include "motion_check.hpp"

#include <cmath>
#include <pinocchio/algorithm/joint-configuration.hpp>
#include <string>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom::internal {

namespace {

// How far a quaternion's norm may be from 1: files are often rounded to a few digits.
constexpr double kNormalized = 1e-3;

}  // namespace

bool hasFreeFlyer(const pinocchio::Model& model) {
  return model.njoints > 1 &&
         model.joints[1].shortname() == pinocchio::JointModelFreeFlyer::classname();
}

void requireTime(const Eigen::VectorXd& time) {
  if (time.size() == 0) throwInvalid("time must have at least one frame, got 0");
  for (Eigen::Index frame = 0; frame < time.size(); ++frame) {
    if (!std::isfinite(time[frame]))
      throwInvalid("time must be finite, got ", time[frame], " in frame ", frame);
    if (frame > 0 && !(time[frame] > time[frame - 1]))
      throwInvalid("time must increase, got ", time[frame - 1], " s and then ", time[frame],
                   " s in frame ", frame);
  }
}

void requireFrames(const char* name, const Eigen::MatrixXd& values, Eigen::Index size,
                   const char* unit, Eigen::Index frames) {
  requireSize(name, values.rows(), size, unit);
  requireSize(name, values.cols(), frames, "frames");
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!areFinite(values.col(frame)))
      throwInvalid(name, " must be finite, got another number in frame ", frame);
}

void requireConfigurations(const pinocchio::Model& model, const Eigen::MatrixXd& q,
                           Eigen::Index frames, const char* name) {
  requireFrames(name, q, model.nq, "components (nq)", frames);
  const ConfigurationCheck check(model);
  for (Eigen::Index frame = 0; frame < frames; ++frame)
    if (!check.isNormalized(model, q.col(frame)))
      throwInvalid(name, " must have quaternions of norm 1, got another in frame ", frame);
}

void requireNumbers(const pinocchio::Model& model, const Motion& motion) {
  requireTime(motion.time);
  requireFrames("q", motion.q, model.nq, "components (nq)", motion.frames());
  requireFrames("v", motion.v, model.nv, "components (nv)", motion.frames());
  requireFrames("a", motion.a, model.nv, "components (nv)", motion.frames());
}

ConfigurationCheck::ConfigurationCheck(const pinocchio::Model& model) {
  for (std::size_t k = 1; k < static_cast<std::size_t>(model.njoints); ++k) {
    const pinocchio::JointModel& joint = model.joints[k];
    if (joint.nq() == joint.nv()) continue;
    const std::string name = joint.shortname();
    if (name == pinocchio::JointModelFreeFlyer::classname())
      circles_.push_back({joint.idx_q() + 3, 4});
    else if (name == pinocchio::JointModelPlanar::classname())
      circles_.push_back({joint.idx_q() + 2, 2});
    else if (joint.nv() == 1 || name == pinocchio::JointModelSpherical::classname())
      circles_.push_back({joint.idx_q(), joint.nq()});
    else
      is_known_ = false;
  }
}

bool ConfigurationCheck::isNormalized(const pinocchio::Model& model,
                                      const Eigen::Ref<const Eigen::VectorXd>& q) const {
  if (!is_known_) return pinocchio::isNormalized(model, q, kNormalized);
  for (const Circle& circle : circles_)
    if (!(std::abs(q.segment(circle.first, circle.size).norm() - 1.) <= kNormalized)) return false;
  return true;
}

bool hasSizes(const pinocchio::Model& model, const Motion& motion) {
  const Eigen::Index frames = motion.frames();
  if (frames == 0 || motion.q.rows() != model.nq || motion.q.cols() != frames) return false;
  for (const Eigen::MatrixXd* values : {&motion.v, &motion.a})
    if (values->rows() != model.nv || values->cols() != frames) return false;
  if (!areFinite(motion.time)) return false;
  for (Eigen::Index frame = 1; frame < frames; ++frame)
    if (!(motion.time[frame] > motion.time[frame - 1])) return false;
  return true;
}

bool isFinite(const Motion& motion, Eigen::Index frame) {
  return areFinite(motion.q.col(frame)) && areFinite(motion.v.col(frame)) &&
         areFinite(motion.a.col(frame));
}

}  // namespace dynacom::internal
