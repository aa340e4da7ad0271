// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <functional>
#include <pinocchio/multibody.hpp>

namespace dynacom::internal {

/// Finds the CoM of each of several configurations, nq × frames.
using CoMFunction = std::function<Eigen::Matrix3Xd(const Eigen::MatrixXd&)>;

/// As the public function of that name, of what is known to be valid.
double estimateAccelerationNoise(const pinocchio::Model& model, const CoMFunction& findCoM,
                                 const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                 Eigen::Index stride);

/// One configuration after the other.
/// @param data  the model's
Eigen::Matrix3Xd findCoM(const pinocchio::Model& model, pinocchio::Data& data,
                         const Eigen::MatrixXd& q);

}  // namespace dynacom::internal
