// SPDX-License-Identifier: BSD-2-Clause
// Random wrench distributions of every sort, the same ones for the same seed.
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "dynacom/contact_base.hpp"

namespace dynacom_tests {

using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Where a problem's wrench is.
enum class Place { Inside, Corner, Anywhere, Boundary, NearBoundary, Nothing };
constexpr std::array<const char*, 6> kPlaceNames = {"inside",   "corner",        "anywhere",
                                                    "boundary", "near boundary", "nothing"};

/// A contact in numbers: where it is, and what it can give.
struct ProblemContact {
  Eigen::Matrix3d rotation;
  Eigen::Vector3d lever;  ///< from the CoM [m]
  bool is_point = false;
  bool is_cone = false;  ///< Coulomb's cone; else the pyramid around it
  double mu = 0., gu = 0., half_length = 0., half_width = 0.;
  Eigen::VectorXd weights;  ///< 3 or 6
};

struct Problem {
  Place place;
  bool nearly_parallel = false;    ///< contacts of one orientation, but for 1e-14 to 1e-2 rad
  bool weights_far_apart = false;  ///< wrench weights up to 1e4 apart, rather than 1e2
  std::vector<ProblemContact> contacts;
  Vector6 wrench;
  Vector6 wrench_weights;
  double minimal_scale;
  /// Distance of the wrench from what is reachable, over the scale, where the construction tells.
  std::optional<double> distance;

  /// The same contacts as the library's, placed.
  std::vector<std::shared_ptr<dynacom::ContactBase>> makeContacts() const;
};

/// Makes problems of 1 to 8 contacts, points and soles mixed: with equal weights, and with weights
/// up to 1e4 apart; tilted by up to 80°; with contacts at one place, parallel or nearly parallel
/// ones, without friction or extent, on a line; from a mouse to an elephant.
class ProblemGenerator {
 public:
  explicit ProblemGenerator(std::uint64_t seed) : engine_(seed) {}
  Problem next();

 private:
  double uniform(double low, double high);
  double powerOfTen(double low, double high);
  int integer(int low, int high);
  bool oneIn(int n) { return integer(1, n) == 1; }
  Eigen::Vector3d direction();
  ProblemContact contact(double tilt, double weight_decades, bool degenerate);
  Eigen::VectorXd force(const ProblemContact& contact, double fraction, bool corner);
  Vector6 inCone(const Problem& problem, double fraction, bool corner);
  bool onFacet(Problem& problem);

  std::mt19937_64 engine_;
};

}  // namespace dynacom_tests
