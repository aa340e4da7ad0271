// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "../inference/cone_projection.hpp"
#include "block_band.hpp"
#include "dynacom/motion_repair.hpp"
#include "joint_limits.hpp"
#include "motion_linearization.hpp"

namespace dynacom::internal {

/// What repairMotion() asks.
struct WholeBodyProblem {
  const pinocchio::Model& model;
  std::vector<BodyPoint> points;
  std::vector<Section> friction;  // F of each point
  Eigen::VectorXd time;
  Eigen::MatrixXd q;                      // before, nq × frames
  std::vector<std::uint32_t> sets;        // of each frame: a bit for each point that pushes
  std::vector<std::uint32_t> held;        // the same of points that are to be at their targets
  std::vector<Eigen::Matrix3Xd> targets;  // where these are to be, 3 × frames each
  Eigen::MatrixXd floor;  // above which other points are to be, points × frames; NaN where that is
                          // not known
  Eigen::Array<bool, Eigen::Dynamic, 1> free;  // frames whose wrench is not asked for
  Eigen::VectorXd of_change, of_acceleration;  // costs of squares, nv
  std::vector<LimitedJoint> joints;            // that are to be within their limits
  bool pinned_ends;                            // whether the first and the last frame stay
};

/// Changes of the configurations, frame after frame, found for some frames at a time.
class WholeBodyWindow {
 public:
  /// @param problem, settings  must outlive this
  WholeBodyWindow(const WholeBodyProblem& problem, const RepairSettings& settings);

  /// Finds the changes of the frames from `first` to `behind`, excluded, beginning with those that
  /// there are; the others stay as they are.
  /// @param asked   of frames from this one on nothing is asked but that they cost little, so that
  ///                they lead to what is behind
  /// @param change  in the tangent space at the configurations before, nv × frames
  /// @param q       the configurations that it leads to
  void solve(Eigen::Index first, Eigen::Index behind, Eigen::Index asked, Eigen::MatrixXd& change,
             Eigen::MatrixXd& q);

  /// Brings frames within reach that are not, whatever it costs, by changes around them.
  void mend(Eigen::Index first, Eigen::Index behind, Eigen::Index asked, Eigen::MatrixXd& change,
            Eigen::MatrixXd& q);

 private:
  using Vector6 = Eigen::Matrix<double, 6, 1>;
  // δ̈ = before δ₋ + here δ + after δ₊, and how long a frame lasts.
  struct Difference {
    double before, here, after, duration;
  };
  // A frame whose wrench depends on what is sought.
  struct Constraint {
    Eigen::Index frame;
    LinearizedFrame linear;
    Eigen::MatrixXd of_places;  // derivatives of what is asked of places, rows × nv
    Eigen::VectorXd off;        // and by how much they are off
    Vector6 moved, given, dual;
    ConeProjection::Answer answer;
  };

  // A limit that a joint is beyond.
  struct Pin {
    Eigen::Index frame;
    const LimitedJoint* joint;
    LimitKind kind;
    double off;
  };

  Difference differ(Eigen::Index frame) const;
  bool isSought(Eigen::Index frame) const { return first_ <= frame && frame < behind_; }
  void begin(Eigen::Index first, Eigen::Index behind, Eigen::Index asked);
  double linearize(const Eigen::MatrixXd& q);
  void place(Constraint& constraint);
  void hold(Constraint& constraint, std::size_t body, std::uint32_t points);
  void lift(Constraint& constraint);
  void shrink(Constraint& constraint);
  double pin(const Eigen::MatrixXd& q);
  double step(const Pin& pin) const;
  double findMissing(const Eigen::MatrixXd& q, Eigen::Index frame);
  double findMissingWrench(const Eigen::MatrixXd& q, Eigen::Index frame);
  double measureLack(const Eigen::MatrixXd& q, Eigen::Index first, Eigen::Index behind);
  void polish(Eigen::MatrixXd& change, Eigen::MatrixXd& q);
  void stay();
  bool factorize(double penalty, double penalty_of_places);
  void addPins();
  void addCosts(const Eigen::MatrixXd& change);
  void iterate(bool with_costs, Eigen::MatrixXd& change);
  void project(bool relaxed);
  void restart();
  void apply(const Eigen::MatrixXd& change, Eigen::MatrixXd& q) const;
  double weigh(const Constraint& constraint) const;
  double weighChange(Eigen::Index frame) const;
  Eigen::VectorXd weighAcceleration(Eigen::Index frame) const;
  const WholeBodyProblem& problem_;
  const RepairSettings& settings_;
  MotionLinearizer linearizer_;
  ConeProjection projection_;
  const double of_place_;              // cost of the square of how far a point is from its place
  const std::vector<Section> shrunk_;  // F of each point, smaller by the margin
  Eigen::Index first_ = 0, behind_ = 0;
  std::vector<Constraint> constraints_;
  std::vector<Pin> pins_;
  double penalty_ = 0.;
  double hold_ = 0., pinch_ = 0.;  // costs of points and joints that are off, as they are now
  BlockBand<Eigen::Dynamic> system_;
  Eigen::MatrixXd step_;
  LinearizedFrame evaluated_;
};

/// What points cannot give of a wrench over the weight, by a projection on what they can.
Eigen::Matrix<double, 6, 1> findResidual(ConeProjection& projection, const LinearizedFrame& linear,
                                         const std::vector<Section>& friction, std::uint32_t set);

}  // namespace dynacom::internal
