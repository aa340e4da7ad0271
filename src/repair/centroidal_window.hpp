// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "../inference/cone_projection.hpp"
#include "block_band.hpp"
#include "dynacom/centroidal_filter.hpp"

namespace dynacom::internal {

/// What distanceToFeasible() asks, without a robot: wrenches are parts of its weight.
struct CentroidalProblem {
  double gravity;  // g of m g [m/s²]
  Eigen::VectorXd time;
  Eigen::Matrix3Xd com;
  Eigen::Matrix<double, 6, Eigen::Dynamic> wrench;  // about the CoM [m g, m g·m]
  std::vector<const Eigen::Matrix3Xd*> points;      // places of what may push, of each 3 × frames
  std::vector<Section> friction;                    // F of each
  std::vector<std::uint32_t> sets;                  // of each frame: a bit for each that pushes
  Eigen::Array<bool, Eigen::Dynamic, 1> free;       // frames of which nothing is asked
};

/// The cheapest change of some frames in a row, at rest at both ends.
class CentroidalWindow {
 public:
  using Vector6 = Eigen::Matrix<double, 6, 1>;

  /// @param problem, settings  must outlive this
  CentroidalWindow(const CentroidalProblem& problem, const CentroidalFilterSettings& settings);

  /// Solves for some frames: the first, and how many.
  void solve(Eigen::Index first, Eigen::Index frames);

  // What was found in a frame, counted from the first.
  Eigen::Vector3d displacement(Eigen::Index k) const { return x_.col(k).head<3>(); }
  Eigen::Vector3d angularMomentum(Eigen::Index k) const;  // [m g·m·s]
  Vector6 residual(Eigen::Index k) const { return moved_[at(k)] - given_[at(k)]; }
  int iterations() const { return iterations_; }
  bool converged() const { return converged_; }

 private:
  /// δ̈ = before δ₋ + here δ + after δ₊, over g; how long a frame lasts; what the square of δ̈ costs;
  /// and 1 where the wrench must be within reach, else 0.
  struct Difference {
    double before, here, after, duration, cost, asked;
  };
  using Vectors = std::vector<Vector6>;

  static std::size_t at(Eigen::Index k) { return static_cast<std::size_t>(k); }
  bool isLast(Eigen::Index k) const { return k + 1 == frames_; }
  bool isFlight(Eigen::Index k) const;
  void discretize();
  Eigen::Vector3d acceleration(Eigen::Index k) const;
  Vector6 computeWrench(Eigen::Index k) const;
  void factorize();
  void change();
  void project();
  bool isDone() const;
  void adaptPenalty();

  const CentroidalProblem& problem_;
  const CentroidalFilterSettings& settings_;
  const double of_displacement_, of_acceleration_, of_momentum_;  // costs of squares
  ConeProjection projection_;
  Eigen::Matrix3Xd levers_;
  Eigen::Index first_ = 0, frames_ = 0;
  std::vector<Difference> differences_;
  double penalty_ = 0.;  // ρ of ADMM
  BlockBand<6> system_;
  // Of each frame δ, and h half a frame later; and by how much the last iteration changed these.
  Eigen::Matrix<double, 6, Eigen::Dynamic> x_, step_;
  Vectors moved_, given_;  // wrenches after the change, and the closest ones that contacts can give
  Vectors last_given_;     // an iteration before
  Vectors dual_;           // multipliers of moved = given, over ρ
  std::vector<ConeProjection::Answer> answers_;
  int iterations_ = 0;
  bool converged_ = false;
};

}  // namespace dynacom::internal
