// SPDX-License-Identifier: BSD-2-Clause
// Random wrench distributions over sets of every kind, the same ones for the same seed, and a judge
// of answers that knows the sets by their geometry alone.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "dynacom/distribution_solver.hpp"

namespace dynacom_tests {

/// What the contacts of a problem are.
enum class SetKind { Boxes, Discs, Polygons, Bounds, Grasps, References, Mixed };
constexpr std::array<const char*, 7> kSetKindNames = {"boxes",  "discs",      "polygons", "bounds",
                                                      "grasps", "references", "mixed"};

/// Where a problem's wrench is.
enum class SetPlace { Inside, Boundary, NearBoundary, Anywhere };
constexpr std::array<const char*, 4> kSetPlaceNames = {"inside", "boundary", "near boundary",
                                                       "anywhere"};

/// A contact in numbers. Sections are convex polygons, counter-clockwise, at a unit normal force;
/// that of the friction a disc where it has a radius.
struct SetContact {
  int size = 3;
  bool is_grasp = false;
  double radius = 0.;
  Eigen::Matrix2Xd friction, places;
  double gamma = 0.;
  double least = 0., greatest = dynacom::ContactSet::kInfinity;
  Eigen::Matrix<double, 6, 1> lower, upper;  ///< of a grasp
  Eigen::Matrix3d rotation;
  Eigen::Vector3d lever;
  Eigen::VectorXd weights, reference;

  dynacom::DistributionProblem::Contact make() const;
};

struct SetProblem {
  SetKind kind;
  SetPlace place;
  std::vector<SetContact> contacts;
  dynacom::DistributionProblem problem;
};

/// Makes problems of 1 to 4 contacts.
class SetProblemGenerator {
 public:
  explicit SetProblemGenerator(std::uint64_t seed) : engine_(seed) {}
  SetProblem next(SetKind kind);

 private:
  double uniform(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double powerOfTen(double low, double high);
  int integer(int low, int high) { return std::uniform_int_distribution<int>(low, high)(engine_); }
  bool oneIn(int n) { return integer(1, n) == 1; }
  Eigen::Matrix2Xd polygon(double size, int vertices, double off_centre);
  SetContact contact(SetKind kind);
  Eigen::VectorXd force(const SetContact& contact, bool on_boundary, double size);

  std::mt19937_64 engine_;
};

/// What an answer is certified to be, over the scale, or over the largest number compared.
struct SetVerdict {
  std::string error;         ///< what is wrong with it; empty if nothing
  double outside = 0.;       ///< by how much a force is outside its set
  double distance_gap = 0.;  ///< by how much the residual could be above the least, at most
  double cost_gap = 0.;      ///< by which part the cost could be above the least, at most
};

/// Certifies forces by weak duality, in extended precision. Forces that are larger by far than all
/// in the answer are not thought of.
SetVerdict check(const SetProblem& problem, const dynacom::DistributionSolution& solution);

}  // namespace dynacom_tests
