// SPDX-License-Identifier: BSD-2-Clause
#include "set_problems.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace dynacom_tests {

using dynacom::ContactSet;
using dynacom::DistributionProblem;
using dynacom::DistributionStatus;
using dynacom::Section;
using Eigen::Index;
using Real = long double;
using Vector = Eigen::Matrix<Real, Eigen::Dynamic, 1>;
using Vector2 = Eigen::Matrix<Real, 2, 1>;
using Vector3 = Eigen::Matrix<Real, 3, 1>;
using Vector6 = Eigen::Matrix<Real, 6, 1>;

namespace {

constexpr double kPi = 3.14159265358979323846;

// The largest value of ⟨direction, p⟩ over a section.
Real supportOf(double radius, const Eigen::Matrix2Xd& vertices, const Vector2& direction) {
  if (radius > 0.) return Real(radius) * direction.norm();
  if (vertices.cols() == 0) return 0;
  return (direction.transpose() * vertices.cast<Real>()).maxCoeff();
}

// The same over the set; forces are no larger than `largest`.
Real supportOf(const SetContact& contact, const Vector& direction, Real largest) {
  if (contact.is_grasp) {
    Real sum = 0;
    for (Index k = 0; k < 6; ++k)
      sum += direction[k] * std::clamp(Real(direction[k] > 0 ? contact.upper[k] : contact.lower[k]),
                                       -largest, largest);
    return sum;
  }
  Real rate = direction[2] + supportOf(contact.radius, contact.friction, direction.head<2>());
  if (contact.size == 6) {
    // A unit force at (x, y) has the moment (y, −x).
    const Vector2 of_places(-direction[4], direction[3]);
    rate += supportOf(0., contact.places, of_places) + contact.gamma * std::abs(direction[5]);
  }
  return rate * (rate > 0 ? std::min(Real(contact.greatest), largest) : Real(contact.least));
}

// By how much a point is beyond a polygon that is `normal` times as large.
Real excessOf(const Eigen::Matrix2Xd& vertices, const Vector2& point, Real normal) {
  Real most = -std::numeric_limits<Real>::infinity();
  const Index count = vertices.cols();
  for (Index k = 0; k < count; ++k) {
    const Vector2 first = vertices.col(k).cast<Real>();
    const Vector2 edge = vertices.col((k + 1) % count).cast<Real>() - first;
    if (edge.norm() == 0) {
      most = std::max(most, (point - normal * first).norm());
      continue;
    }
    const Vector2 along = edge.normalized(), off = point - normal * first;
    most = std::max(most, along.y() * off.x() - along.x() * off.y());
    if (count == 2) most = std::max({most, -along.dot(off), along.dot(off) - normal * edge.norm()});
  }
  return most;
}

// The same over the face in which ⟨exposing, λ⟩ is largest, up to a tolerance.
Real supportOnFace(SetContact contact, const Vector& exposing, Real tolerance,
                   const Vector& direction, Real largest) {
  const auto expose = [&](Eigen::Matrix2Xd& vertices, const Vector2& along) {
    const Eigen::RowVectorXd values = (along.transpose() * vertices.cast<Real>()).cast<double>();
    Eigen::Matrix2Xd face(2, 0);
    for (Index k = 0; k < vertices.cols(); ++k) {
      if (values[k] < values.maxCoeff() - double(tolerance)) continue;
      face.conservativeResize(2, face.cols() + 1);
      face.rightCols<1>() = vertices.col(k);
    }
    vertices = face;
  };
  if (contact.is_grasp) {
    for (Index k = 0; k < 6; ++k) {
      if (exposing[k] > tolerance) contact.lower[k] = contact.upper[k];
      if (exposing[k] < -tolerance) contact.upper[k] = contact.lower[k];
    }
    return supportOf(contact, direction, largest);
  }
  Real rate = exposing[2] + supportOf(contact.radius, contact.friction, exposing.head<2>());
  if (contact.radius == 0.) {
    expose(contact.friction, exposing.head<2>());
  } else if (exposing.head<2>().norm() > tolerance) {
    contact.friction = (contact.radius * exposing.head<2>().normalized()).cast<double>();
    contact.radius = 0.;
  }
  Real yaw = 0;
  if (contact.size == 6) {
    const Vector2 of_places(-exposing[4], exposing[3]);
    rate += supportOf(0., contact.places, of_places) + contact.gamma * std::abs(exposing[5]);
    expose(contact.places, of_places);
    if (std::abs(exposing[5]) > tolerance) yaw = exposing[5] > 0 ? contact.gamma : -contact.gamma;
  }
  if (rate > tolerance) contact.least = contact.greatest;
  if (rate < -tolerance) contact.greatest = contact.least;
  Vector rest = direction;
  if (yaw != 0) {
    rest[2] += yaw * direction[5];
    rest[5] = 0;
  }
  return supportOf(contact, rest, largest);
}

Real excessOf(const SetContact& contact, const Vector& force) {
  if (contact.is_grasp)
    return std::max((contact.lower.cast<Real>() - force).maxCoeff(),
                    (force - contact.upper.cast<Real>()).maxCoeff());
  const Real normal = force[2];
  Real most = std::max(contact.least - normal, normal - contact.greatest);
  most = std::max(most, contact.radius > 0. ? force.head<2>().norm() - contact.radius * normal
                                            : excessOf(contact.friction, force.head<2>(), normal));
  if (contact.size == 6) {
    most = std::max(most, excessOf(contact.places, Vector2(-force[4], force[3]), normal));
    most = std::max(most, std::abs(force[5]) - contact.gamma * normal);
  }
  return most;
}

Vector6 wrenchOf(const SetContact& contact, const Vector& force) {
  Vector6 wrench;
  const Eigen::Matrix<Real, 3, 3> R = contact.rotation.cast<Real>();
  const Vector3 push = R * force.head<3>(), lever = contact.lever.cast<Real>();
  wrench << push, lever.cross(push);
  if (contact.size == 6) wrench.tail<3>() += R * force.tail<3>();
  return wrench;
}

Vector pullOf(const SetContact& contact, const Vector6& y) {
  const Eigen::Matrix<Real, 3, 3> R = contact.rotation.cast<Real>();
  const Vector3 lever = contact.lever.cast<Real>(), moment = y.tail<3>();
  Vector pull(contact.size);
  pull.head<3>() = R.transpose() * (y.head<3>() + moment.cross(lever));
  if (contact.size == 6) pull.tail<3>() = R.transpose() * moment;
  return pull;
}

}  // namespace

DistributionProblem::Contact SetContact::make() const {
  DistributionProblem::Contact contact;
  if (is_grasp) {
    contact.set = ContactSet::grasp(lower, upper);
  } else {
    const Section section = radius > 0. ? Section::disc(radius) : Section::polygon(friction);
    contact.set = size == 3 ? ContactSet::point(section)
                            : ContactSet::surface(section, Section::polygon(places), gamma);
    contact.set.boundNormalForce(least, greatest);
  }
  contact.rotation = rotation;
  contact.lever = lever;
  contact.weights = weights;
  contact.reference = reference;
  return contact;
}

double SetProblemGenerator::powerOfTen(double low, double high) {
  return std::pow(10., uniform(low, high));
}

// Vertices on an ellipse, at any angle.
Eigen::Matrix2Xd SetProblemGenerator::polygon(double size, int vertices, double off_centre) {
  const double start = uniform(0., 2. * kPi);
  const Eigen::Vector2d radii(size, size * uniform(0.3, 1.));
  const Eigen::Vector2d centre =
      off_centre * size * Eigen::Vector2d(uniform(-1., 1.), uniform(-1., 1.));
  Eigen::Matrix2Xd polygon(2, vertices);
  for (int k = 0; k < vertices; ++k) {
    const double angle = start + 2. * kPi * (k + (vertices > 2 ? uniform(0., 0.8) : 0.)) / vertices;
    polygon.col(k) =
        centre + Eigen::Vector2d(radii.x() * std::cos(angle), radii.y() * std::sin(angle));
  }
  return polygon;
}

SetContact SetProblemGenerator::contact(SetKind kind) {
  const auto isOf = [&](SetKind other) {
    return kind == other || (kind == SetKind::Mixed && oneIn(2));
  };
  SetContact contact;
  contact.is_grasp = kind == SetKind::Grasps ? !oneIn(3) : kind == SetKind::Mixed && oneIn(5);
  contact.size = contact.is_grasp || oneIn(2) ? 6 : 3;
  const double mu = oneIn(10) ? 1e-3 : uniform(0.1, 1.2);
  if (isOf(SetKind::Discs))
    contact.radius = mu;
  else if (isOf(SetKind::Polygons))
    contact.friction = polygon(mu, integer(3, 8), 0.);
  else
    contact.friction =
        mu * (Eigen::Matrix<double, 2, 4>() << 1, -1, -1, 1, 1, 1, -1, -1).finished();
  const Eigen::Vector2d half(uniform(0.02, 0.2), uniform(0.01, 0.1));
  if (isOf(SetKind::Polygons))
    contact.places = polygon(half.x(), integer(1, 8), uniform(0., 2.));
  else
    contact.places = half.asDiagonal() *
                     (Eigen::Matrix<double, 2, 4>() << 1, -1, -1, 1, 1, 1, -1, -1).finished();
  contact.gamma = oneIn(10) ? 0. : uniform(0.005, 0.1);
  if (isOf(SetKind::Bounds)) {
    contact.least = oneIn(2) ? 0. : powerOfTen(0., 2.);
    if (!oneIn(3)) contact.greatest = contact.least + (oneIn(10) ? 0. : powerOfTen(1., 3.));
  }
  for (int k = 0; k < 6; ++k) {
    const double size = powerOfTen(0., 2.5) * (k < 3 ? 1. : 0.1);
    contact.lower[k] = oneIn(5) ? 0. : -size * uniform(0.2, 1.);
    contact.upper[k] = oneIn(10) ? contact.lower[k] : size;
  }
  contact.rotation =
      (Eigen::AngleAxisd(uniform(-kPi, kPi), Eigen::Vector3d::UnitZ()) *
       Eigen::AngleAxisd(uniform(-1., 1.) * (oneIn(3) ? 1.2 : 0.2),
                         Eigen::Vector3d(uniform(-1., 1.), uniform(-1., 1.), 0.1).normalized()))
          .toRotationMatrix();
  contact.lever = Eigen::Vector3d(uniform(-0.5, 0.5), uniform(-0.3, 0.3), uniform(-1., -0.5));
  const double spread = oneIn(3) ? 1. : 0.;
  contact.weights.resize(contact.size);
  for (Index k = 0; k < contact.size; ++k) contact.weights[k] = powerOfTen(-spread, spread);
  if (oneIn(2)) contact.weights[1] = contact.weights[0];
  contact.reference = Eigen::VectorXd::Zero(contact.size);
  if (isOf(SetKind::References))
    for (Index k = 0; k < contact.size; ++k)
      contact.reference[k] = uniform(-1., 1.) * powerOfTen(0., 2.) * (k < 3 ? 1. : 0.1);
  return contact;
}

// Some force that a contact can give.
Eigen::VectorXd SetProblemGenerator::force(const SetContact& contact, bool on_boundary,
                                           double size) {
  Eigen::VectorXd force(contact.size);
  const auto part = [&] {
    return on_boundary && oneIn(2) ? double(integer(0, 1)) : uniform(0., 1.);
  };
  if (contact.is_grasp) {
    for (Index k = 0; k < 6; ++k)
      force[k] = contact.lower[k] + part() * (contact.upper[k] - contact.lower[k]);
    return force;
  }
  const double greatest = std::min(contact.greatest, contact.least + size);
  force[2] = contact.least + part() * (greatest - contact.least);
  const auto place = [&](const Eigen::Matrix2Xd& vertices) {
    Eigen::VectorXd shares(vertices.cols());
    for (double& share : shares) share = on_boundary && !oneIn(3) ? 0. : uniform(0., 1.);
    shares[integer(0, int(vertices.cols()) - 1)] += 1e-3;
    return Eigen::Vector2d(vertices * shares / shares.sum());
  };
  if (contact.radius > 0.) {
    const double angle = uniform(-kPi, kPi);
    const double radius = contact.radius * (on_boundary && oneIn(2) ? 1. : uniform(0., 1.));
    force.head<2>() = force[2] * radius * Eigen::Vector2d(std::cos(angle), std::sin(angle));
  } else {
    force.head<2>() = force[2] * place(contact.friction);
  }
  if (contact.size == 6) {
    const Eigen::Vector2d at = place(contact.places);
    force.segment<2>(3) = force[2] * Eigen::Vector2d(at.y(), -at.x());
    force[5] = force[2] * contact.gamma * (2. * part() - 1.);
  }
  return force;
}

SetProblem SetProblemGenerator::next(SetKind kind) {
  SetProblem made;
  made.kind = kind;
  made.place = static_cast<SetPlace>(integer(0, 3));
  const int count = integer(1, 4);
  for (int k = 0; k < count; ++k) {
    made.contacts.push_back(contact(kind));
    made.problem.contacts.push_back(made.contacts.back().make());
  }
  const double size = powerOfTen(0., 3.);
  Vector6 wrench = Vector6::Zero();
  const bool on_boundary = made.place == SetPlace::Boundary || made.place == SetPlace::NearBoundary;
  for (const SetContact& contact : made.contacts)
    wrench += wrenchOf(contact, force(contact, on_boundary, size).cast<Real>());
  made.problem.wrench = wrench.cast<double>();
  if (made.place == SetPlace::NearBoundary)
    for (double& component : made.problem.wrench)
      component += uniform(-1., 1.) * powerOfTen(-9., -2.) * size;
  if (made.place == SetPlace::Anywhere)
    for (Index k = 0; k < 6; ++k)
      made.problem.wrench[k] = uniform(-1., 1.) * size * (k < 3 ? 1. : 0.3) + (k == 2 ? size : 0.);
  if (oneIn(3))
    for (double& weight : made.problem.wrench_weights) weight = powerOfTen(-1., 1.);
  made.problem.minimal_scale = oneIn(2) ? 0. : size;
  return made;
}

SetVerdict check(const SetProblem& made, const dynacom::DistributionSolution& solution) {
  constexpr double kFeasible = 1e-9, kDistance = 1e-8, kCost = 1e-6, kReach = 1e-8;
  const DistributionProblem& problem = made.problem;
  SetVerdict verdict;
  if (solution.status != DistributionStatus::Solved &&
      solution.status != DistributionStatus::Relaxed) {
    verdict.error = "no answer";
    return verdict;
  }
  const Vector6 weights = problem.wrench_weights.cast<Real>();
  const Real scale = problem.scale(), unit = scale > 0 ? scale / weights.maxCoeff() : Real(1);
  Vector6 achieved = Vector6::Zero();
  Real largest = unit;
  for (std::size_t k = 0; k < made.contacts.size(); ++k) {
    const Vector force = solution.forces[k].cast<Real>();
    achieved += wrenchOf(made.contacts[k], force);
    largest = std::max(largest, force.lpNorm<Eigen::Infinity>());
    for (const double bound : {made.contacts[k].least, made.contacts[k].greatest})
      if (std::isfinite(bound)) largest = std::max(largest, Real(bound));
    if (made.contacts[k].is_grasp)
      largest = std::max({largest, Real(made.contacts[k].lower.cwiseAbs().maxCoeff()),
                          Real(made.contacts[k].upper.cwiseAbs().maxCoeff())});
  }
  const Real far = 10 * largest;
  for (std::size_t k = 0; k < made.contacts.size(); ++k)
    verdict.outside =
        std::max(verdict.outside,
                 double(excessOf(made.contacts[k], solution.forces[k].cast<Real>()) / largest));
  const Vector6 residual = problem.wrench.cast<Real>() - achieved;
  const Real size = weights.cwiseProduct(residual).norm();
  const Vector6 direction = weights.cwiseAbs2().cwiseProduct(residual);
  const bool relaxed = solution.status == DistributionStatus::Relaxed;
  if (relaxed) {
    Real gap = 0;
    for (std::size_t k = 0; k < made.contacts.size(); ++k) {
      const Vector pull = pullOf(made.contacts[k], direction);
      gap += supportOf(made.contacts[k], pull, far) - pull.dot(solution.forces[k].cast<Real>());
    }
    // Forces have the digits of a double, and no residual has more than their sum.
    gap -= 10 * std::numeric_limits<double>::epsilon() * std::pow(weights.maxCoeff(), 2) * largest *
           far;
    verdict.distance_gap = double(std::max(Real(0), gap) / (size * std::max(size, scale)));
  }

  // The cost is at least that of the dual, with any multipliers of the wrench that was achieved.
  Real cost = 0, best = std::numeric_limits<Real>::infinity();
  for (std::size_t k = 0; k < made.contacts.size(); ++k) {
    const SetContact& contact = made.contacts[k];
    const Vector off = (solution.forces[k] - contact.reference).cast<Real>();
    cost += contact.weights.cast<Real>().cwiseProduct(off).squaredNorm() / 2;
  }
  constexpr double kExposed = 1e-7;
  // A wrench that is hardly out of reach is Solved, with the closest one as well: then its
  // residual, as it is said to be, is more than rounding.
  const Vector6 exposing =
      relaxed ? direction
              : Vector6(weights.cwiseAbs2().cwiseProduct(solution.residual.cast<Real>()));
  const int ways = relaxed || size > 1e-11 * scale ? 12 : 1;
  for (int way = relaxed ? 0 : -1; way < ways; ++way) {
    // With the residual times ever more, it exposes the same faces as on its own.
    const bool on_faces = way == 0;
    if (on_faces && ways == 1) continue;
    Vector6 multipliers = solution.multipliers.cast<Real>();
    if (way > 0)
      multipliers += exposing / exposing.norm() * std::max(multipliers.norm(), Real(1e-30)) *
                     std::pow(Real(10), Real(way));
    Real gap = 0;
    for (std::size_t k = 0; k < made.contacts.size(); ++k) {
      const SetContact& contact = made.contacts[k];
      const Vector force = solution.forces[k].cast<Real>();
      const Vector downhill =
          pullOf(contact, multipliers) - contact.weights.cast<Real>().cwiseAbs2().cwiseProduct(
                                             force - contact.reference.cast<Real>());
      const Vector pull = pullOf(contact, exposing);
      gap += (on_faces ? supportOnFace(contact, pull, kExposed * exposing.norm(), downhill, far)
                       : supportOf(contact, downhill, far)) -
             downhill.dot(force);
    }
    best = std::min(best, std::abs(gap));
  }
  Real least_weight = std::numeric_limits<Real>::infinity();
  for (const SetContact& contact : made.contacts)
    least_weight = std::min(least_weight, Real(contact.weights.minCoeff()));
  verdict.cost_gap =
      double(std::max(Real(0), best) / (cost + std::pow(least_weight * largest, 2) / 2));

  if (!(verdict.outside <= kFeasible))
    verdict.error = "a force is outside its set";
  else if (!relaxed && !(size <= kReach * scale * (1 + 1e-3)))
    verdict.error = "Solved, but not reached";
  else if (relaxed && !(verdict.distance_gap <= kDistance))
    verdict.error = "another wrench may be closer";
  else if (!(verdict.cost_gap <= kCost))
    verdict.error = "other forces may be cheaper";
  return verdict;
}

}  // namespace dynacom_tests
