// SPDX-License-Identifier: BSD-2-Clause
#include "ground_slope.hpp"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace dynacom::internal {

namespace {

using Eigen::Index;
using Members = std::vector<std::size_t>;  // footings, in their order

// Fewer points do not show that they lie in a plane.
constexpr double kPoints = 6.;
// And feet that are tilted, all alike, do not show that the ground is: points must be this far
// apart along the slope [m].
constexpr double kExtent = 0.5;
// All footings lie on a slope from this gradient on, one degree; some of them do from two degrees
// on, since more of them are looked at.
constexpr double kGradient = 0.01746, kLocalGradient = 0.0349;
// And if heights differ by this [m], and no point is off the plane by more than this [m], and than
// a part of the difference.
constexpr double kRise = 0.02, kOff = 0.02, kOffPart = 0.2;
// A sole is tilted as a plane is if the squares of what it is off a level plane become so small a
// part of themselves.
constexpr double kTiltPart = 0.25;
// So many soles in a row show a slope, and up to which parts: three only if they show it well.
struct Row {
  std::size_t soles;
  double off_part, tilt_part;
};
constexpr Row kRows[] = {{3, 0.1, 0.05}, {5, kOffPart, kTiltPart}};
// Points that are closer together in some direction say nothing of the ground's gradient there: the
// standard deviation of their places [m].
constexpr double kNarrow = 0.02;

double square(double value) { return value * value; }

// The points of a footing or of more, summed up.
struct Moments {
  double count = 0.;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();  // sum of squares about the mean

  void add(const Moments& other) {
    const Eigen::Vector3d between = other.mean - mean;
    const double all = count + other.count;
    scatter += other.scatter + count * other.count / all * between * between.transpose();
    mean += other.count / all * between;
    count = all;
  }

  // The squares of what points are off a plane with this gradient through their mean, summed up.
  double findOff(const Eigen::Vector2d& gradient) const {
    const Eigen::Vector3d down(-gradient.x(), -gradient.y(), 1.);
    return down.dot(scatter * down);
  }

  // Of the plane of least squares; of the least such, where points do not tell.
  Eigen::Vector2d findGradient() const {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
    axes.computeDirect(scatter.topLeftCorner<2, 2>());
    Eigen::Vector2d gradient = Eigen::Vector2d::Zero();
    for (Index k = 0; k < 2; ++k) {
      const Eigen::Vector2d axis = axes.eigenvectors().col(k);
      if (axes.eigenvalues()[k] > count * square(kNarrow))
        gradient += axis * axis.dot(scatter.topRightCorner<2, 1>()) / axes.eigenvalues()[k];
    }
    return gradient;
  }
};

Moments sumUp(const Footing& footing) {
  Moments sum;
  sum.count = double(footing.points.cols());
  sum.mean = footing.points.rowwise().mean();
  const Eigen::Matrix3Xd centred = footing.points.colwise() - sum.mean;
  sum.scatter = centred * centred.transpose();
  return sum;
}

class SlopeFinder {
 public:
  explicit SlopeFinder(const std::vector<Footing>& footings)
      : footings_(footings),
        slopes_(footings.size(), Eigen::Vector2d::Zero()),
        off_(footings.size(), std::numeric_limits<double>::infinity()) {
    for (const Footing& footing : footings_) moments_.push_back(sumUp(footing));
  }

  std::vector<Eigen::Vector2d> find() {
    Members all(footings_.size());
    std::iota(all.begin(), all.end(), 0);
    if (takePlane(all, kGradient, kOffPart, kTiltPart)) return slopes_;
    std::size_t contacts = 0;
    for (const Footing& footing : footings_) contacts = std::max(contacts, footing.contact + 1);
    std::vector<Members> sequences(contacts + 1);  // of soles: each contact's, and all
    for (const std::size_t k : all) {
      if (!isSole(k)) continue;
      sequences[footings_[k].contact].push_back(k);
      sequences[contacts].push_back(k);
    }
    for (const Members& sequence : sequences)
      for (const Row& row : kRows)
        for (std::size_t k = 0; k + row.soles <= sequence.size(); ++k) {
          const auto first = sequence.begin() + std::ptrdiff_t(k);
          takePlane({first, first + std::ptrdiff_t(row.soles)}, kLocalGradient, row.off_part,
                    row.tilt_part);
        }
    return slopes_;
  }

 private:
  // Whether it shows how it is tilted along and across.
  bool isSole(std::size_t k) const {
    Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes;
    axes.computeDirect(moments_[k].scatter.topLeftCorner<2, 2>(), Eigen::EigenvaluesOnly);
    return axes.eigenvalues()[0] > moments_[k].count * square(kNarrow);
  }

  // Whether footings lie in a plane that is no level; which they have then, unless they fit another
  // one better.
  bool takePlane(const Members& members, double least_gradient, double off_part, double tilt_part) {
    Moments sum;
    for (const std::size_t k : members) sum.add(moments_[k]);
    const Eigen::Vector2d gradient = sum.findGradient();
    if (!(gradient.norm() >= least_gradient) || sum.count < kPoints) return false;
    constexpr double inf = std::numeric_limits<double>::infinity();
    double low = inf, high = -inf, begin = inf, end = -inf, off = 0.;
    for (const std::size_t k : members) {
      if (isSole(k) && !(moments_[k].findOff(gradient) <
                         tilt_part * moments_[k].findOff(Eigen::Vector2d::Zero())))
        return false;
      for (const auto point : footings_[k].points.colwise()) {
        const double along = gradient.dot((point - sum.mean).head<2>());
        off = std::max(off, std::abs(point.z() - sum.mean.z() - along));
        low = std::min(low, point.z());
        high = std::max(high, point.z());
        begin = std::min(begin, along / gradient.norm());
        end = std::max(end, along / gradient.norm());
      }
    }
    if (end - begin < kExtent || !(high - low > kRise) ||
        !(off <= std::min(kOff, off_part * (high - low))))
      return false;
    const double mean_off = sum.findOff(gradient) / sum.count;
    for (const std::size_t k : members) {
      if (!(mean_off < off_[k])) continue;
      off_[k] = mean_off;
      slopes_[k] = gradient;
    }
    return true;
  }

  const std::vector<Footing>& footings_;
  std::vector<Moments> moments_;         // of each footing
  std::vector<Eigen::Vector2d> slopes_;  // of each, as far as they are known
  std::vector<double> off_;              // mean squares of what their planes are off [m²]
};

}  // namespace

std::vector<Eigen::Vector2d> findGroundSlopes(const std::vector<Footing>& footings) {
  if (footings.empty()) return {};
  return SlopeFinder(footings).find();
}

}  // namespace dynacom::internal
