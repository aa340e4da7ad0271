// SPDX-License-Identifier: BSD-2-Clause
#include "random_problems.hpp"

#include <Eigen/Geometry>
#include <Eigen/QR>
#include <cmath>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"

namespace dynacom_tests {

namespace {

constexpr double kTiltLimit = 80. * M_PI / 180.;

Vector6 wrenchOf(const ProblemContact& contact, const Eigen::VectorXd& force) {
  Vector6 wrench;
  wrench.head<3>() = contact.rotation * force.head<3>();
  wrench.tail<3>() = contact.lever.cross(wrench.head<3>());
  if (!contact.is_point) wrench.tail<3>() += contact.rotation * force.tail<3>();
  return wrench;
}

/// The largest y·w over the wrenches w that a contact gives with a unit of normal force.
double support(const ProblemContact& contact, const Vector6& y) {
  const Eigen::Vector3d moment = y.tail<3>();
  const Eigen::Vector3d f =
      contact.rotation.transpose() * (y.head<3>() + moment.cross(contact.lever));
  double value = f.z() + contact.mu * (std::abs(f.x()) + std::abs(f.y()));
  if (!contact.is_point) {
    const Eigen::Vector3d t = contact.rotation.transpose() * moment;
    value += contact.half_width * std::abs(t.x()) + contact.half_length * std::abs(t.y()) +
             contact.gu * std::abs(t.z());
  }
  return value;
}

}  // namespace

std::vector<std::shared_ptr<dynacom::ContactBase>> Problem::makeContacts() const {
  std::vector<std::shared_ptr<dynacom::ContactBase>> made;
  for (const ProblemContact& contact : contacts) {
    if (contact.is_point) {
      dynacom::ContactPointSettings settings;
      settings.mu = contact.mu;
      settings.weights = contact.weights;
      settings.frame_name = "point";
      made.push_back(std::make_shared<dynacom::ContactPoint>(settings));
    } else {
      dynacom::Contact6DSettings settings;
      settings.mu = contact.mu;
      settings.gu = contact.gu;
      settings.half_length = contact.half_length;
      settings.half_width = contact.half_width;
      settings.weights = contact.weights;
      settings.frame_name = "sole";
      made.push_back(std::make_shared<dynacom::Contact6D>(settings));
    }
    made.back()->updateNewtonEuler(Eigen::Vector3d::Zero(),
                                   pinocchio::SE3(contact.rotation, contact.lever));
  }
  return made;
}

double ProblemGenerator::uniform(double low, double high) {
  return std::uniform_real_distribution<double>(low, high)(engine_);
}
double ProblemGenerator::powerOfTen(double low, double high) {
  return std::pow(10., uniform(low, high));
}
int ProblemGenerator::integer(int low, int high) {
  return std::uniform_int_distribution<int>(low, high)(engine_);
}

Eigen::Vector3d ProblemGenerator::direction() {
  std::normal_distribution<double> normal;
  Eigen::Vector3d vector(normal(engine_), normal(engine_), normal(engine_));
  return vector.normalized();
}

ProblemContact ProblemGenerator::contact(double tilt, double weight_decades, bool degenerate) {
  ProblemContact contact;
  Eigen::Vector3d axis = direction();
  axis.z() = 0.;
  contact.rotation = (Eigen::AngleAxisd(uniform(0., tilt), axis.normalized()) *
                      Eigen::AngleAxisd(uniform(-M_PI, M_PI), Eigen::Vector3d::UnitZ()))
                         .toRotationMatrix();
  contact.lever = Eigen::Vector3d(uniform(-0.5, 0.5), uniform(-0.5, 0.5),
                                  uniform(-1.2, degenerate ? 0. : -0.4));
  contact.is_point = integer(0, 1) == 0;
  const auto extent = [&](double low, double high) {
    return degenerate && oneIn(3) ? 0. : uniform(low, high);
  };
  contact.mu = extent(0.2, 1.);
  if (!contact.is_point) {
    contact.gu = extent(0.01, 0.2);
    contact.half_length = extent(0.01, 0.15);
    contact.half_width = extent(0.01, 0.1);
  }
  contact.weights.resize(contact.is_point ? 3 : 6);
  for (double& weight : contact.weights) weight = powerOfTen(-weight_decades, weight_decades);
  return contact;
}

/// A force of a contact that uses its inequalities up to a fraction, or all of them fully.
Eigen::VectorXd ProblemGenerator::force(const ProblemContact& contact, double fraction,
                                        bool corner) {
  const double normal = uniform(0., 1.);
  const auto use = [&](double limit) {
    return normal * limit * (corner ? (oneIn(2) ? 1. : -1.) : fraction * uniform(-1., 1.));
  };
  Eigen::VectorXd force(contact.is_point ? 3 : 6);
  force.head<3>() << use(contact.mu), use(contact.mu), normal;
  if (!contact.is_point)
    force.tail<3>() << use(contact.half_width), use(contact.half_length), use(contact.gu);
  return force;
}

Vector6 ProblemGenerator::inCone(const Problem& problem, double fraction, bool corner) {
  Vector6 wrench = Vector6::Zero();
  for (const ProblemContact& contact : problem.contacts)
    wrench += wrenchOf(contact, force(contact, fraction, corner));
  return wrench;
}

/// Puts the wrench on a facet of the cone of reachable wrenches, or at a known distance from it.
/// A facet is found by trial: the plane through five extreme rays is one if all are on one side.
bool ProblemGenerator::onFacet(Problem& problem) {
  const int contacts = static_cast<int>(problem.contacts.size());
  for (int trial = 0; trial < 100; ++trial) {
    Eigen::Matrix<double, 6, 5> rays;
    for (int i = 0; i < 5; ++i) {
      const ProblemContact& contact = problem.contacts[integer(0, contacts - 1)];
      Vector6 ray = wrenchOf(contact, force(contact, 1., true));
      if (ray.norm() == 0.) return false;
      rays.col(i) = ray.normalized();
    }
    const Eigen::ColPivHouseholderQR<Eigen::Matrix<double, 6, 5>> qr(rays);
    // Corners of one contact depend on each other: such planes are no facets.
    if (std::abs(qr.matrixQR()(4, 4)) < 1e-3) continue;
    const Eigen::Matrix<double, 6, 6> Q = qr.householderQ();
    for (const double sign : {1., -1.}) {
      const Vector6 normal = sign * Q.col(5);
      bool is_facet = true;
      for (const ProblemContact& contact : problem.contacts)
        is_facet = is_facet && support(contact, normal) <= 1e-14;
      if (!is_facet) continue;

      problem.wrench.setZero();
      for (int i = 0; i < 5; ++i) problem.wrench += uniform(0.1, 1.) * rays.col(i);
      problem.distance = 0.;
      if (problem.place == Place::NearBoundary) {
        problem.wrench_weights.setOnes();  // the distance along the normal is that of this norm
        const double distance = powerOfTen(-13., -3.);
        const bool outside = oneIn(2);
        problem.wrench += (outside ? distance : -distance) * normal;
        if (outside)
          problem.distance = distance / problem.wrench.norm();
        else
          problem.distance.reset();  // a flat cone is left on its other side
      }
      return true;
    }
  }
  return false;
}

Problem ProblemGenerator::next() {
  Problem problem;
  const int contacts = oneIn(3) ? integer(1, 2) : integer(1, 8);
  const double tilt = oneIn(4) ? kTiltLimit : oneIn(3) ? 0. : 0.3;
  const double decades = oneIn(2) ? 0. : uniform(0., 2.);  // up to 1e4 apart
  const bool degenerate = oneIn(4);
  for (int i = 0; i < contacts; ++i) problem.contacts.push_back(contact(tilt, decades, degenerate));
  if (oneIn(6)) {  // soles of one orientation, or nearly
    problem.nearly_parallel = contacts > 1 && oneIn(4);
    const double angle = problem.nearly_parallel ? powerOfTen(-14., -2.) : 0.;
    for (ProblemContact& contact : problem.contacts)
      contact.rotation = Eigen::AngleAxisd(angle * uniform(-1., 1.), direction()) *
                         problem.contacts.front().rotation;
  }
  if (degenerate) {
    if (oneIn(3)) problem.contacts.back() = problem.contacts.front();
    if (oneIn(3))  // in a row
      for (ProblemContact& contact : problem.contacts)
        contact.lever.tail<2>() = problem.contacts.front().lever.tail<2>();
  }
  const double weight = powerOfTen(-6., 6.);
  for (ProblemContact& contact : problem.contacts) contact.weights *= weight;
  problem.wrench_weights.setOnes();
  if (oneIn(4)) {
    problem.weights_far_apart = oneIn(2);
    const double decades = problem.weights_far_apart ? 2. : 1.;
    for (double& wrench_weight : problem.wrench_weights)
      wrench_weight = powerOfTen(-decades, decades);
  }

  problem.place = static_cast<Place>(integer(0, 4));
  if (oneIn(50)) problem.place = Place::Nothing;
  switch (problem.place) {
    case Place::Inside:
      problem.wrench = inCone(problem, 0.99, false);
      problem.distance = 0.;
      break;
    case Place::Corner:
      problem.wrench = inCone(problem, 1., true);
      problem.distance = 0.;
      break;
    case Place::Boundary:
    case Place::NearBoundary:
      if (onFacet(problem)) break;
      problem.place = Place::Anywhere;
      [[fallthrough]];
    case Place::Anywhere:
      for (double& component : problem.wrench) component = uniform(-1., 1.);
      if (oneIn(2)) problem.wrench[2] = std::abs(problem.wrench[2]) * 3.;
      break;
    case Place::Nothing:
      problem.wrench.setZero();
      if (oneIn(2))
        for (double& component : problem.wrench) component = 1e-17 * uniform(-1., 1.);
      break;
  }
  const double weight_of_robot = 9.81 * powerOfTen(-1., 4.);
  problem.wrench *= weight_of_robot;
  // Tolerances are relative to the scale; the floor is at most what the wrench is, so that what is
  // known about distances holds.
  problem.minimal_scale = problem.place == Place::Nothing ? weight_of_robot : 0.;
  return problem;
}

}  // namespace dynacom_tests
