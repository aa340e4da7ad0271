// SPDX-License-Identifier: BSD-2-Clause
#include "dynacom/contact_base.hpp"

#include <atomic>

#include "check.hpp"
#include "nan.hpp"

namespace dynacom {

using internal::kNaN;

namespace {

// A number that no contact has had, in any thread.
std::uint64_t nextRevision() {
  static std::atomic<std::uint64_t> revisions{0};
  return ++revisions;
}

}  // namespace

void ContactBase::updateNewtonEuler(const Eigen::Vector3d& com, const SE3& oMs) {
  pose_ = oMs;
  if (cols() == 0) return;
  const SE3 surface = getSurfacePose();
  const Eigen::Matrix3d& R = surface.rotation();
  const Eigen::Vector3d lever = surface.translation() - com;
  // The force adjoint from s to the frame at the CoM with the world's axes: [R 0; [p − c]×R R], of
  // which a point has the three columns of the force.
  Eigen::Map<Eigen::Matrix<double, 6, 3>> of_force(ne_A_.data());
  of_force.topRows<3>() = R;
  of_force.row(3) = lever.y() * R.row(2) - lever.z() * R.row(1);
  of_force.row(4) = lever.z() * R.row(0) - lever.x() * R.row(2);
  of_force.row(5) = lever.x() * R.row(1) - lever.y() * R.row(0);
  if (cols() == 6) ne_A_.bottomRightCorner<3, 3>() = R;
}

void ContactBase::applyForce(const Eigen::Ref<const Eigen::VectorXd>& force) {
  internal::requireSize("force", force.size(), cols(), "components");
  force_ = force;
}

ContactBase::Vector6 ContactBase::toWorldForces() const {
  pinocchio::Force wrench = pinocchio::Force::Zero();
  wrench.toVector().head(cols()) = force_;
  return getSurfacePose().act(wrench).toVector();
}

Eigen::Vector2d ContactBase::getCoP() const {
  if (cols() == 0 || !(force_[2] > 0.)) return Eigen::Vector2d::Constant(kNaN);
  if (cols() == 3) return Eigen::Vector2d::Zero();
  return Eigen::Vector2d(-force_[4], force_[3]) / force_[2];
}

double ContactBase::getFrictionUsage() const { return kNaN; }
double ContactBase::getCoPMargin() const { return kNaN; }
double ContactBase::getYawUsage() const { return kNaN; }

double ContactBase::getUsage(double tangential, double coefficient) const {
  if (!(coefficient > 0.)) return kNaN;
  if (force_.isZero(0.)) return 0.;
  if (!(force_[2] > 0.)) return std::numeric_limits<double>::infinity();
  return tangential / (coefficient * force_[2]);
}

void ContactBase::setMatrices(const Eigen::Ref<const Eigen::MatrixXd>& uni_A,
                              const Eigen::Ref<const Eigen::MatrixXd>& fri_A,
                              const Eigen::Ref<const Eigen::VectorXd>& reg_A) {
  if (reg_A.size() != 3 && reg_A.size() != 6)
    internal::throwInvalid("reg_A must have 3 or 6 components, got ", reg_A.size());
  internal::requireSize("uni_A", uni_A.cols(), reg_A.size(), "columns (as many as reg_A)");
  internal::requireSize("fri_A", fri_A.cols(), reg_A.size(), "columns (as many as reg_A)");
  const bool same_cols = reg_A.size() == cols();
  uni_A_ = uni_A;
  uni_b_.setZero(uni_A.rows());
  fri_A_ = fri_A;
  fri_b_.setZero(fri_A.rows());
  reg_A_ = reg_A;
  reg_b_.setZero(cols());
  set_.reset();
  is_pyramid_ = true;
  revision_ = nextRevision();
  if (same_cols) return;
  ne_A_.setZero(6, cols());
  force_.setZero(cols());
}

void ContactBase::setMatrices(const Eigen::Ref<const Eigen::MatrixXd>& uni_A,
                              const Eigen::Ref<const Eigen::MatrixXd>& fri_A,
                              const Eigen::Ref<const Eigen::VectorXd>& reg_A,
                              const ContactSet& set) {
  internal::requireSize("set", set.size(), reg_A.size(), "components (as many as reg_A)");
  setMatrices(uni_A, fri_A, reg_A);
  set_ = set;
}

void ContactBase::setMatrices(const Eigen::Ref<const Eigen::MatrixXd>& uni_A,
                              const Eigen::Ref<const Eigen::VectorXd>& uni_b,
                              const Eigen::Ref<const Eigen::MatrixXd>& fri_A,
                              const Eigen::Ref<const Eigen::VectorXd>& fri_b,
                              const Eigen::Ref<const Eigen::VectorXd>& reg_A,
                              const Eigen::Ref<const Eigen::VectorXd>& reg_b,
                              const ContactSet& set) {
  internal::requireSize("uni_b", uni_b.size(), uni_A.rows(), "components (rows of uni_A)");
  internal::requireSize("fri_b", fri_b.size(), fri_A.rows(), "components (rows of fri_A)");
  internal::requireSize("reg_b", reg_b.size(), reg_A.size(), "components (as many as reg_A)");
  setMatrices(uni_A, fri_A, reg_A, set);
  is_pyramid_ = false;
  uni_b_ = uni_b;
  fri_b_ = fri_b;
  reg_b_ = reg_b;
}

void ContactBase::setWeights(const Eigen::Ref<const Eigen::VectorXd>& reg_A) {
  internal::requireSize("reg_A", reg_A.size(), cols(), "components");
  reg_A_ = reg_A;
  revision_ = nextRevision();
}

void ContactBase::reset() {
  ne_A_.setZero();
  force_.setZero();
  frame_id_ = kUnknownFrame;
}

}  // namespace dynacom
