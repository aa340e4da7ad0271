// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <pinocchio/multibody.hpp>

namespace dynacom::internal {

/// dynacom::estimateAccelerationNoise() without a look at its arguments, but for their sizes: where
/// not all configurations are valid, the result may be any number, or NaN.
double estimateAccelerationNoise(const pinocchio::Model& model, pinocchio::Data& data,
                                 const Eigen::VectorXd& time, const Eigen::MatrixXd& q,
                                 Eigen::Index stride);

}  // namespace dynacom::internal
