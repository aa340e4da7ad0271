// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE wrench_distribution
#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <cstring>
#include <eiquadprog/eiquadprog-fast.hpp>
#include <functional>
#include <limits>
#include <numeric>
#include <sstream>
#include <utility>
#include <vector>

#include "asked_solvers.hpp"
#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "problem_checker.hpp"
#include "random_problems.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

using Contacts = std::vector<std::shared_ptr<ContactBase>>;

Contact6DSettings soleSettings(double mu = 0.7, const Vector6& weights = Vector6::Ones()) {
  Contact6DSettings settings;
  settings.mu = mu;
  settings.gu = 0.05;
  settings.half_length = 0.1;
  settings.half_width = 0.06;
  settings.weights = weights;
  settings.frame_name = "sole";
  return settings;
}

/// The CoM is the world's origin.
std::shared_ptr<ContactBase> makeSole(const Contact6DSettings& settings, const SE3& pose) {
  auto contact = std::make_shared<Contact6D>(settings);
  contact->updateNewtonEuler(Vector3d::Zero(), pose);
  return contact;
}

std::shared_ptr<ContactBase> makeSole(const Vector3d& position, double mu = 0.7,
                                      const Vector6& weights = Vector6::Ones()) {
  return makeSole(soleSettings(mu, weights), SE3(Matrix3d::Identity(), position));
}

std::shared_ptr<ContactBase> makePoint(const SE3& pose, double mu = 0.7,
                                       const Vector3d& weights = Vector3d::Ones()) {
  ContactPointSettings settings;
  settings.mu = mu;
  settings.weights = weights;
  settings.frame_name = "point";
  auto contact = std::make_shared<ContactPoint>(settings);
  contact->updateNewtonEuler(Vector3d::Zero(), pose);
  return contact;
}

std::shared_ptr<ContactBase> makePoint(const Vector3d& position, double mu = 0.7) {
  return makePoint(SE3(Matrix3d::Identity(), position), mu);
}

/// A random rotation of no more than an angle.
Matrix3d randomTilt(Random& random, double angle) {
  return Eigen::AngleAxisd(random.uniform(0., angle), random.rotation().col(0)).toRotationMatrix();
}

/// Zero, now and then: without friction or without extent, inequalities become degenerate.
double sometimesZero(Random& random, double low, double high) {
  return random.integer(0, 3) == 0 ? 0. : random.uniform(low, high);
}

/// Weights of which the largest is up to a hundred times the smallest.
VectorXd randomWeights(Random& random, Index size) {
  return Eigen::pow(10., random.vector(size).array());
}

/// At least three points, or a sole; tilted by up to 1 rad, with settings of every kind.
Contacts randomContacts(Random& random) {
  const Index soles = random.integer(0, 3);
  const Index points = random.integer(soles == 0 ? 3 : 0, 5);
  const Vector3d com = random.vector3(0.2) + Vector3d::UnitZ();
  Contacts contacts;
  for (Index i = 0; i < soles + points; ++i) {
    const SE3 pose(randomTilt(random, 1.), random.vector3(0.5));
    if (i < soles) {
      Contact6DSettings settings;
      settings.mu = sometimesZero(random, 0.2, 1.);
      settings.gu = sometimesZero(random, 0.02, 0.2);
      settings.half_length = sometimesZero(random, 0.02, 0.2);
      settings.half_width = sometimesZero(random, 0.02, 0.2);
      settings.weights = randomWeights(random, 6);
      settings.frame_name = "sole";
      contacts.push_back(std::make_shared<Contact6D>(settings));
    } else {
      ContactPointSettings settings;
      settings.mu = sometimesZero(random, 0.2, 1.);
      settings.weights = randomWeights(random, 3);
      settings.world_aligned = random.coin();
      settings.radius = random.uniform(0., 0.05);
      settings.frame_name = "point";
      contacts.push_back(std::make_shared<ContactPoint>(settings));
    }
    contacts.back()->updateNewtonEuler(com, pose);
  }
  return contacts;
}

/// A force that respects a contact's inequalities, and uses them up to a fraction.
VectorXd randomForce(Random& random, const ContactBase& contact, double fraction) {
  const double fz = random.uniform(10., 300.);
  VectorXd force(contact.cols());
  if (const auto* point = dynamic_cast<const ContactPoint*>(&contact)) {
    force.head<2>() = random.vector(2, fraction * point->getSettings().mu * fz);
  } else {
    const auto& settings = dynamic_cast<const Contact6D&>(contact).getSettings();
    force.head<2>() = random.vector(2, fraction * settings.mu * fz);
    force[3] = random.uniform(-1., 1.) * fraction * settings.half_width * fz;
    force[4] = random.uniform(-1., 1.) * fraction * settings.half_length * fz;
    force[5] = random.uniform(-1., 1.) * fraction * settings.gu * fz;
  }
  force[2] = fz;
  return force;
}

/// Such forces of all contacts, one behind the other.
VectorXd randomForces(Random& random, const Contacts& contacts, double fraction) {
  VectorXd forces;
  for (const auto& contact : contacts) {
    const VectorXd force = randomForce(random, *contact, fraction);
    forces.conservativeResize(forces.size() + force.size());
    forces.tail(force.size()) = force;
  }
  return forces;
}

struct StackedProblem {
  MatrixXd ne, inequalities;  ///< NE λ = w, A λ ≤ 0
  VectorXd q;                 ///< the diagonal of Q, weights squared
};

/// The problem of equations (9-13), written down anew from matrices of contacts.
StackedProblem stackedProblem(const std::vector<DistributionResult::Contact>& contacts) {
  Index cols = 0, rows = 0;
  for (const auto& contact : contacts) {
    cols += contact.A.cols();
    rows += contact.A.rows();
  }
  StackedProblem problem{MatrixXd::Zero(6, cols), MatrixXd::Zero(rows, cols), VectorXd::Zero(cols)};
  Index col = 0, row = 0;
  for (const auto& contact : contacts) {
    problem.ne.middleCols(col, contact.A.cols()) = contact.NE;
    problem.q.segment(col, contact.A.cols()) = contact.weights.cwiseAbs2();
    problem.inequalities.block(row, col, contact.A.rows(), contact.A.cols()) = contact.A;
    col += contact.A.cols();
    row += contact.A.rows();
  }
  return problem;
}

StackedProblem stackedProblem(const Contacts& contacts) {
  std::vector<DistributionResult::Contact> matrices;
  for (const auto& contact : contacts) {
    matrices.emplace_back();
    matrices.back().A.resize(contact->uni_rows() + contact->fri_rows(), contact->cols());
    matrices.back().A << contact->uni_A(), contact->fri_A();
    matrices.back().weights = contact->reg_A();
    matrices.back().NE = contact->ne_A();
  }
  return stackedProblem(matrices);
}

/// The smallest |A x − b| over x ≥ 0, by Lawson and Hanson.
double nonNegativeLeastSquares(const MatrixXd& A, const VectorXd& b) {
  VectorXd x = VectorXd::Zero(A.cols());
  std::vector<bool> free(static_cast<std::size_t>(A.cols()), false);
  for (int iteration = 0; iteration < 100; ++iteration) {
    const VectorXd gradient = A.transpose() * (b - A * x);
    Index best = -1;
    for (Index i = 0; i < A.cols(); ++i)
      if (!free[i] && gradient[i] > 1e-11 * b.norm() && (best < 0 || gradient[i] > gradient[best]))
        best = i;
    if (best < 0) break;
    free[best] = true;
    while (true) {
      MatrixXd columns = MatrixXd::Zero(A.rows(), A.cols());
      for (Index i = 0; i < A.cols(); ++i)
        if (free[i]) columns.col(i) = A.col(i);
      // The solution of least norm, so that columns that are not free stay at zero.
      const VectorXd y = columns.completeOrthogonalDecomposition().solve(b);
      double step = 1.;
      for (Index i = 0; i < A.cols(); ++i)
        if (free[i] && y[i] <= 0.) step = std::min(step, x[i] / (x[i] - y[i]));
      x += step * (y - x);
      if (step == 1.) break;
      for (Index i = 0; i < A.cols(); ++i) {
        if (!free[i] || x[i] > 1e-12) continue;
        free[i] = false;
        x[i] = 0.;
      }
    }
  }
  return (A * x - b).norm();
}

/// By how much forces miss the conditions of Karush, Kuhn and Tucker to be the cheapest that give
/// what they give, relative to the cost's gradient: Q λ + NEᵀ ν + Aᵀ μ = 0 with μ ≥ 0 on the
/// inequalities that are tight, and 0 elsewhere.
double costGap(const StackedProblem& problem, const VectorXd& forces, double scale,
               Index* tight = nullptr) {
  const VectorXd slack = -problem.inequalities * forces;
  std::vector<Index> rows;
  for (Index i = 0; i < slack.size(); ++i)
    if (slack[i] < 1e-8 * scale) rows.push_back(i);
  if (tight) *tight = static_cast<Index>(rows.size());

  // ν is free: what it cannot reach is the null space of NE, and only there must μ help.
  Eigen::ColPivHouseholderQR<MatrixXd> qr(problem.ne.transpose());
  qr.setThreshold(1e-10);
  const Index free = problem.ne.cols() - qr.rank();
  const VectorXd gradient = problem.q.cwiseProduct(forces);
  if (free == 0 || forces.norm() <= 1e-11 * scale) return 0.;
  const MatrixXd nullSpace = MatrixXd(qr.householderQ()).rightCols(free);
  MatrixXd normals(free, static_cast<Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i)
    normals.col(static_cast<Index>(i)) =
        -nullSpace.transpose() * problem.inequalities.row(rows[i]).transpose();
  return nonNegativeLeastSquares(normals, nullSpace.transpose() * gradient) / gradient.norm();
}

/// The largest g·λ over what a contact can give with a normal force of 1 N, by its geometry.
double largest(const ContactBase& contact, const VectorXd& g) {
  double mu = 0.;
  double value = 0.;
  if (const auto* point = dynamic_cast<const ContactPoint*>(&contact)) {
    mu = point->getSettings().mu;
  } else {
    const auto& settings = dynamic_cast<const Contact6D&>(contact).getSettings();
    mu = settings.mu;
    value = settings.half_width * std::abs(g[3]) + settings.half_length * std::abs(g[4]) +
            settings.gu * std::abs(g[5]);
  }
  return value + g[2] + mu * (std::abs(g[0]) + std::abs(g[1]));
}

/// The least distance ‖D (w − w')‖ of a wrench from the reachable ones w', or less than that, by
/// weak duality: a plane through the origin with all reachable wrenches behind it is nowhere nearer
/// than they are. Zero if the plane across the residual does not have them behind it.
double distanceBound(const Contacts& contacts, const DistributionResult& result) {
  const Vector6 normal = result.wrench_weights.cwiseAbs2().cwiseProduct(result.residual);
  for (const auto& contact : contacts) {
    const VectorXd g = contact->ne_A().transpose() * normal;
    const double size = (contact->ne_A().cwiseAbs().transpose() * normal.cwiseAbs()).maxCoeff();
    if (largest(*contact, g) > 1e-8 * size) return 0.;
  }
  return normal.dot(result.wrench) / normal.cwiseQuotient(result.wrench_weights).norm();
}

/// What an answer is, by everything but the code that found it: within the cones, the closest, the
/// cheapest, and summed up.
void checkAnswer(const Contacts& contacts, const DistributionResult& result) {
  const StackedProblem problem = stackedProblem(contacts);
  const VectorXd forces = result.forces();
  const double scale = result.scale;
  BOOST_REQUIRE(forces.size() == problem.q.size());
  BOOST_TEST((problem.inequalities * forces).maxCoeff() <= 1e-9 * scale);
  BOOST_TEST(close(result.achieved / scale, problem.ne * forces / scale));
  BOOST_TEST(close(result.residual / scale, (result.wrench - result.achieved) / scale));
  BOOST_TEST(close(result.cost / (scale * scale),
                   0.5 * problem.q.dot(forces.cwiseAbs2()) / (scale * scale)));
  BOOST_TEST(result.iterations >= 0);

  const double distance = result.wrench_weights.cwiseProduct(result.residual).norm();
  if (result.status == DistributionStatus::Solved) {
    BOOST_TEST(distance <= 1.001e-8 * scale);
  } else {
    BOOST_TEST(result.status == DistributionStatus::Relaxed);
    BOOST_TEST(distance > 0.999e-8 * scale);
    BOOST_TEST(distance - distanceBound(contacts, result) <= 1e-8 * scale);
  }
  BOOST_TEST(costGap(problem, forces, scale) < 1e-7);
  BOOST_TEST(result.isOptimal());
}

/// Calls an action with every subset of the rows of a matrix, and a basis of what it maps to zero.
template <class Action>
void forAllFaces(const MatrixXd& matrix, Action action) {
  const Index rows = matrix.rows(), cols = matrix.cols();
  for (int subset = 0; subset < (1 << rows); ++subset) {
    MatrixXd normals = MatrixXd::Zero(cols, rows);
    for (Index i = 0; i < rows; ++i)
      if (subset >> i & 1) normals.col(i) = matrix.row(i).transpose();
    if (rows == 0 || subset == 0) {
      action(MatrixXd::Identity(cols, cols));
    } else {
      const Eigen::ColPivHouseholderQR<MatrixXd> qr(normals);
      action(MatrixXd(qr.householderQ()).rightCols(cols - qr.rank()));
    }
  }
}

/// Another way to the answer, stage by stage: on every face of the cone, the forces that come
/// closest, and then the cheapest that give the closest wrench. Exponential, and without any choice
/// that could go wrong.
VectorXd forcesByEnumeration(const StackedProblem& problem, const Vector6& wrenchWeights,
                             const Vector6& wrench) {
  const double size = wrench.norm();
  const auto respects = [&](const VectorXd& forces) {
    return problem.inequalities.rows() == 0 ||
           (problem.inequalities * forces).maxCoeff() <= 1e-9 * size;
  };
  double least = kInfinity;
  Vector6 closest = Vector6::Zero();
  const MatrixXd weighted = wrenchWeights.asDiagonal() * problem.ne;
  forAllFaces(problem.inequalities, [&](const MatrixXd& face) {
    VectorXd forces = VectorXd::Zero(problem.q.size());
    if (face.cols() > 0)
      forces = face * (weighted * face)
                          .completeOrthogonalDecomposition()
                          .solve(wrenchWeights.cwiseProduct(wrench));
    const double distance = (wrenchWeights.cwiseProduct(wrench) - weighted * forces).norm();
    if (!respects(forces) || !(distance < least)) return;
    least = distance;
    closest = problem.ne * forces;
  });

  double cheapest = kInfinity;
  VectorXd answer = VectorXd::Zero(problem.q.size());
  const VectorXd inverse = problem.q.cwiseSqrt().cwiseInverse();
  forAllFaces(problem.inequalities * inverse.asDiagonal(), [&](const MatrixXd& face) {
    VectorXd forces = VectorXd::Zero(problem.q.size());
    if (face.cols() > 0) {
      const MatrixXd basis = inverse.asDiagonal() * face;
      forces = basis * (problem.ne * basis).completeOrthogonalDecomposition().solve(closest);
    }
    const double cost = problem.q.dot(forces.cwiseAbs2());
    if (!respects(forces) || (problem.ne * forces - closest).norm() > 1e-9 * size) return;
    if (!(cost < cheapest)) return;
    cheapest = cost;
    answer = forces;
  });
  return answer;
}

DistributionStatus solve(WrenchDistribution& distribution, const Contacts& contacts,
                         const Vector6& wrench, double minimalScale = 0.) {
  distribution.clear();
  for (const auto& contact : contacts) distribution.add(*contact);
  return distribution.solve(wrench, minimalScale);
}

DistributionStatus solve(const Contacts& contacts, const Vector6& wrench) {
  WrenchDistribution distribution;
  return solve(distribution, contacts, wrench);
}

bool isZero(const VectorXd& numbers) { return (numbers.array() == 0.).all(); }

/// Left and right sole, the CoM between them on the ground.
Contacts twoSoles() { return {makeSole({0., 0.1, 0.}), makeSole({0., -0.1, 0.})}; }

/// A contact of a kind that the library does not know, with as many components as is said.
class Hook : public ContactBase {
 public:
  explicit Hook(Index cols) {
    MatrixXd uni_A = MatrixXd::Zero(1, cols);
    if (cols > 2) uni_A(0, 2) = -1.;
    setMatrices(uni_A, MatrixXd(0, cols), VectorXd::Ones(cols));
  }
  std::shared_ptr<ContactBase> clone() const override { return std::make_shared<Hook>(*this); }
  const std::string& getFrameName() const override { return name_; }

 private:
  std::string name_ = "hook";
};

/// Another: a hand that can give what is within a random cone, in which a force lies.
class Hand : public ContactBase {
 public:
  Hand(Random& random, const VectorXd& inside) {
    MatrixXd uni_A(4, 6), fri_A(4, 6);
    for (MatrixXd* block : {&uni_A, &fri_A})
      for (Index i = 0; i < 4; ++i) {
        block->row(i) = random.vector(6).transpose();
        if (block->row(i).dot(inside) > 0.) block->row(i) *= -1.;
      }
    setMatrices(uni_A, fri_A, randomWeights(random, 6));
    updateNewtonEuler(random.vector3(), random.placement());
  }
  std::shared_ptr<ContactBase> clone() const override { return std::make_shared<Hand>(*this); }
  const std::string& getFrameName() const override { return name_; }

 private:
  std::string name_ = "hand";
};

Vector6 wrench(double fx, double fy, double fz, double tx = 0., double ty = 0., double tz = 0.) {
  return (Vector6() << fx, fy, fz, tx, ty, tz).finished();
}

/// Six weights of a norm, of which the largest is up to a hundred times the smallest.
Vector6 randomWrenchWeights(Random& random) { return randomWeights(random, 6); }

}  // namespace

BOOST_AUTO_TEST_CASE(statuses_print_their_names) {
  const std::vector<std::pair<DistributionStatus, std::string>> names = {
      {DistributionStatus::Solved, "Solved"},
      {DistributionStatus::Relaxed, "Relaxed"},
      {DistributionStatus::NoContact, "NoContact"},
      {DistributionStatus::InvalidInput, "InvalidInput"},
      {DistributionStatus::NumericalFailure, "NumericalFailure"},
  };
  for (const auto& [status, name] : names) {
    std::ostringstream out;
    out << status;
    BOOST_TEST(out.str() == name);
    BOOST_TEST(to_string(status) == name);
  }
}

BOOST_AUTO_TEST_CASE(two_soles_share_the_weight_by_halves) {
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, twoSoles(), wrench(0., 0., 500.)) == DistributionStatus::Solved);
  VectorXd expected(12);
  expected << 0., 0., 250., 0., 0., 0., 0., 0., 250., 0., 0., 0.;
  BOOST_TEST(close(distribution.result().forces(), expected, 1e-10));
}

BOOST_AUTO_TEST_CASE(weights_act_squared) {
  // Of two soles in one place, the one whose weights are twice as large carries a quarter of what
  // the other carries, in every component.
  const Contacts contacts = {makeSole(Vector3d::Zero(), 0.7, Vector6::Ones()),
                             makeSole(Vector3d::Zero(), 0.7, Vector6::Constant(2.))};
  const Vector6 total = wrench(50., -20., 500., 2., 3., 1.);
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().forces().head<6>(), 0.8 * total, 1e-10));
  BOOST_TEST(close(distribution.result().forces().tail<6>(), 0.2 * total, 1e-10));
}

BOOST_AUTO_TEST_CASE(strictly_inside_the_cones_the_solution_has_a_closed_form) {
  // λ = Q⁻¹ NEᵀ (NE Q⁻¹ NEᵀ)⁻¹ w
  Random random(1);
  int inside = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Contacts contacts = {makeSole({0., 0.1, 0.}, 0.7, random.vector(6, 0.5, 2.)),
                               makeSole({0., -0.1, 0.}, 0.7, random.vector(6, 0.5, 2.)),
                               makePoint({0.3, random.uniform(-0.1, 0.1), 0.1}),
                               makePoint({-0.3, random.uniform(-0.1, 0.1), 0.1})};
    const StackedProblem problem = stackedProblem(contacts);
    const Vector6 total = wrench(0., 0., 500.) + Vector6(random.vector(6, 10.));
    const MatrixXd mapped = problem.q.cwiseInverse().asDiagonal() * problem.ne.transpose();
    const VectorXd expected = mapped * (problem.ne * mapped).ldlt().solve(total);
    if ((problem.inequalities * expected).maxCoeff() > -1e-3) continue;
    ++inside;

    WrenchDistribution distribution;
    BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
    BOOST_TEST(close(distribution.result().forces(), expected, 1e-10));
  }
  BOOST_TEST(inside > 20);
}

BOOST_AUTO_TEST_CASE(forces_sum_to_the_wrench_within_the_cones_at_the_lowest_cost) {
  Random random(2);
  int interior = 0, tightened = 0;
  WrenchDistribution distribution;
  for (int trial = 0; trial < 2000; ++trial) {
    // The sum of forces within the cones can be distributed, of course; of forces on their
    // boundary, too.
    const Contacts contacts = randomContacts(random);
    const StackedProblem problem = stackedProblem(contacts);
    const double fraction = random.coin() ? random.uniform(0., 1.) : 1.;
    const VectorXd given = randomForces(random, contacts, fraction);
    const Vector6 total = problem.ne * given;

    BOOST_REQUIRE(solve(distribution, contacts, total) == DistributionStatus::Solved);
    const VectorXd forces = distribution.result().forces();
    BOOST_REQUIRE(close(problem.ne * forces, total, 1e-9));
    const double size = forces.cwiseAbs().maxCoeff();
    BOOST_REQUIRE((problem.inequalities * forces).maxCoeff() <= 1e-9 * size);
    const VectorXd gradient = problem.q.cwiseProduct(forces);
    BOOST_REQUIRE(gradient.dot(forces) <= (1. + 1e-9) * problem.q.cwiseProduct(given).dot(given));
    Index tight = 0;
    // A single sole leaves no choice.
    if (problem.ne.cols() > 6) BOOST_REQUIRE(costGap(problem, forces, size, &tight) < 1e-7);
    ++(tight == 0 ? interior : tightened);
  }
  // Both kinds of solution have been met.
  BOOST_TEST(interior > 50);
  BOOST_TEST(tightened > 500);
}

BOOST_AUTO_TEST_CASE(the_check_of_optimality_knows_what_is_not_optimal) {
  // Forces that sum to the wrench within the cones, but are not the cheapest.
  const Contacts contacts = twoSoles();
  const StackedProblem problem = stackedProblem(contacts);
  VectorXd forces(12);
  forces << 0., 0., 250., 0., 0., 0., 0., 0., 250., 0., 0., 0.;
  BOOST_TEST(costGap(problem, forces, 500.) < 1e-12);
  forces[0] += 10.;
  forces[6] -= 10.;
  forces[5] += 1.;
  forces[11] += 1.;
  BOOST_TEST(close(problem.ne * forces, wrench(0., 0., 500.)));
  BOOST_TEST((problem.inequalities * forces).maxCoeff() <= 0.);
  BOOST_TEST(costGap(problem, forces, 500.) > 1e-3);
}

BOOST_AUTO_TEST_CASE(the_order_of_contacts_changes_nothing) {
  Random random(3);
  for (int trial = 0; trial < 100; ++trial) {
    const Contacts contacts = randomContacts(random);
    // Half of the wrenches are within reach for certain.
    Vector6 total = stackedProblem(contacts).ne * randomForces(random, contacts, 0.9);
    const bool reachable = random.coin();
    if (!reachable) total = random.vector(6, 500.);
    WrenchDistribution forward, backward;
    const auto status = solve(forward, contacts, total);
    if (reachable) BOOST_REQUIRE(status == DistributionStatus::Solved);
    BOOST_REQUIRE(solve(backward, Contacts(contacts.rbegin(), contacts.rend()), total) == status);
    Index col = 0;
    Index end = backward.result().forces().size();
    for (const auto& contact : contacts) {
      end -= contact->cols();
      BOOST_TEST(close(backward.result().forces().segment(end, contact->cols()),
                       forward.result().forces().segment(col, contact->cols()), 1e-9));
      col += contact->cols();
    }
  }
}

BOOST_AUTO_TEST_CASE(what_the_ground_cannot_give_is_relaxed) {
  const Contacts soles = twoSoles();
  const auto relaxed = [&](const Vector6& total) {
    WrenchDistribution distribution;
    BOOST_TEST(solve(distribution, soles, total) == DistributionStatus::Relaxed);
    checkAnswer(soles, distribution.result());
    return distribution.result().achieved;
  };
  const auto solved = [&](const Vector6& total) {
    BOOST_TEST(solve(soles, total) == DistributionStatus::Solved);
  };
  // It does not pull: nothing comes closest.
  BOOST_TEST(close(relaxed(wrench(0., 0., -500.)), Vector6::Zero(), 1e-9));
  BOOST_TEST(close(relaxed(wrench(0., 0., -1.)), Vector6::Zero(), 1e-9));
  // Friction: μ = 0.7, and so 350 N along the axes. It is nearly a moment-free problem, because the
  // CoM is on the ground.
  for (const double sign : {-1., 1.}) {
    solved(wrench(sign * 349., 0., 500.));
    relaxed(wrench(sign * 351., 0., 500.));
    solved(wrench(0., sign * 349., 500.));
    relaxed(wrench(0., sign * 351., 500.));
  }
  // Pressure at the outer edges, 0.1 m ahead and 0.16 m aside: moments of 50 and 80 N·m.
  for (const double sign : {-1., 1.}) {
    solved(wrench(0., 0., 500., 0., sign * 49.9, 0.));
    relaxed(wrench(0., 0., 500., 0., sign * 50.1, 0.));
    solved(wrench(0., 0., 500., sign * 79.9, 0., 0.));
    relaxed(wrench(0., 0., 500., sign * 80.1, 0., 0.));
  }
  // Lateral force: as much as pushing alone would cost as much distance. (10, 0) comes closest to
  // (0.7, 1) t at t = 7 / 1.49.
  const Vector6 pushed = relaxed(wrench(10., 0., 0.));
  BOOST_TEST(close(pushed, wrench(4.9 / 1.49, 0., 7. / 1.49), 1e-9));
}

BOOST_AUTO_TEST_CASE(out_of_reach_the_closest_wrench_is_given_at_the_lowest_cost) {
  Random random(31);
  int relaxed = 0, pushing = 0;
  WrenchDistribution distribution;
  for (int trial = 0; trial < 2000; ++trial) {
    const Contacts contacts = randomContacts(random);
    distribution.setWrenchWeights(random.coin() ? Vector6(Vector6::Ones())
                                                : randomWrenchWeights(random));
    const Vector6 total = Vector6(random.vector(6, random.coin() ? 500. : 50.)) +
                          wrench(0., 0., random.coin() ? 500. : 0.);
    BOOST_TEST_CONTEXT("problem " << trial) {
      const auto status = solve(distribution, contacts, total);
      checkAnswer(contacts, distribution.result());
      relaxed += status == DistributionStatus::Relaxed;
      pushing += status == DistributionStatus::Relaxed &&
                 distribution.result().achieved.norm() > 1e-3 * total.norm();
    }
  }
  BOOST_TEST(relaxed > 1000);
  BOOST_TEST(pushing > 1000);
}

BOOST_AUTO_TEST_CASE(answers_agree_with_an_enumeration_of_all_faces) {
  // Small cones of any kind: some without an edge to stand on, some that are whole subspaces, some
  // that lack directions.
  Random random(32);
  int solved = 0, relaxed = 0;
  for (int trial = 0; trial < 400; ++trial) {
    WrenchDistribution distribution;
    distribution.setWrenchWeights(randomWrenchWeights(random));
    std::vector<DistributionResult::Contact> contacts(
        static_cast<std::size_t>(random.integer(1, 3)));
    for (auto& contact : contacts) {
      const Index cols = random.integer(1, 4), rows = random.integer(0, 3);
      MatrixXd A = random.vector(rows * cols).reshaped(rows, cols);
      if (rows > 1 && random.integer(0, 3) == 0) A.row(1) = A.row(0);
      if (rows > 1 && random.integer(0, 3) == 0) A.row(1) = -A.row(0);
      contact.A = A;
      contact.weights = randomWeights(random, cols);
      contact.NE = random.vector(6 * cols).reshaped(6, cols);
      distribution.add(contact.A, contact.weights, contact.NE);
    }
    const StackedProblem problem = stackedProblem(contacts);
    Vector6 total = random.vector(6, 100.);
    // Half of them lie in the span of what can be given, and some of these are within reach.
    if (random.coin()) total = problem.ne * random.vector(problem.q.size(), 100.);
    const VectorXd expected = forcesByEnumeration(problem, distribution.getWrenchWeights(), total);
    const Vector6 missing = total - problem.ne * expected;
    BOOST_TEST_CONTEXT("problem " << trial) {
      const auto status = distribution.solve(total);
      const bool reaches = missing.norm() < 1e-6;
      BOOST_TEST(status == (reaches ? DistributionStatus::Solved : DistributionStatus::Relaxed));
      BOOST_TEST(close(distribution.result().residual, missing, 1e-6));
      BOOST_TEST(close(distribution.result().forces(), expected, 1e-6));
      BOOST_TEST(distribution.result().isOptimal());
      ++(reaches ? solved : relaxed);
    }
  }
  BOOST_TEST(solved > 50);
  BOOST_TEST(relaxed > 100);
}

BOOST_AUTO_TEST_CASE(two_points_or_a_sole_agree_with_an_enumeration_of_all_faces) {
  Random random(33);
  int relaxed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    Contacts contacts;
    if (random.coin()) {
      contacts.push_back(makeSole(soleSettings(random.uniform(0.2, 1.), randomWeights(random, 6)),
                                  SE3(randomTilt(random, 1.), random.vector3(0.5))));
    } else {
      for (int i = 0; i < 2; ++i)
        contacts.push_back(makePoint(SE3(randomTilt(random, 1.), random.vector3(0.5)),
                                     random.uniform(0.2, 1.), randomWeights(random, 3)));
    }
    WrenchDistribution distribution;
    distribution.setWrenchWeights(randomWrenchWeights(random));
    const StackedProblem problem = stackedProblem(contacts);
    const Vector6 total = Vector6(problem.ne * randomForces(random, contacts, 1.)) +
                          Vector6(random.vector(6, random.coin() ? 100. : 0.));
    BOOST_TEST_CONTEXT("problem " << trial) {
      relaxed += solve(distribution, contacts, total) == DistributionStatus::Relaxed;
      BOOST_TEST(close(distribution.result().forces(),
                       forcesByEnumeration(problem, distribution.getWrenchWeights(), total), 1e-7));
    }
  }
  BOOST_TEST(relaxed > 5);
  BOOST_TEST(relaxed < 18);
}

BOOST_AUTO_TEST_CASE(wrench_weights_say_what_is_close) {
  // A point without friction gives wrenches along one ray: t = a·D² w / a·D² a, or none.
  Random random(34);
  int pushing = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const SE3 pose = random.placement();
    const Contacts contacts = {makePoint(pose, 0.)};
    Vector6 ray;
    ray << pose.rotation().col(2), pose.translation().cross(pose.rotation().col(2));
    const Vector6 total = random.vector(6, 100.), weights = randomWrenchWeights(random);
    WrenchDistribution distribution;
    distribution.setWrenchWeights(weights);
    BOOST_TEST(close(distribution.getWrenchWeights(), weights, 0.));
    BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Relaxed);
    const Vector6 weightedRay = weights.cwiseAbs2().cwiseProduct(ray);
    const double t = std::max(0., weightedRay.dot(total) / weightedRay.dot(ray));
    pushing += t > 0.;
    const DistributionResult& result = distribution.result();
    BOOST_TEST(close(result.forces(), Vector3d(0., 0., t), 1e-8));
    BOOST_TEST(close(result.achieved, t * ray, 1e-8));
    BOOST_TEST(close(result.residual, total - t * ray, 1e-8));
    BOOST_TEST(close(result.scale, weights.cwiseProduct(total).norm()));
    BOOST_TEST(close(result.wrench_weights, weights, 0.));
  }
  BOOST_TEST(pushing > 50);
  BOOST_TEST(pushing < 150);
}

BOOST_AUTO_TEST_CASE(wrench_weights_are_one_by_default_and_their_common_scale_means_nothing) {
  BOOST_TEST(close(WrenchDistribution().getWrenchWeights(), Vector6::Ones(), 0.));
  Random random(35);
  for (int trial = 0; trial < 50; ++trial) {
    const Contacts contacts = randomContacts(random);
    const Vector6 total = random.vector(6, 500.);
    WrenchDistribution plain, scaled;
    const auto status = solve(plain, contacts, total);
    for (const double scale : {1e-8, 1., 1e8}) {
      BOOST_TEST_CONTEXT("weights of " << scale) {
        scaled.setWrenchWeights(Vector6::Constant(scale));
        for (const double minimalScale : {0., 1000.}) {
          BOOST_TEST(solve(scaled, contacts, total, minimalScale) == status);
          BOOST_TEST(close(scaled.result().forces(), plain.result().forces(), 1e-7));
        }
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(moments_may_weigh_more_or_less_than_forces) {
  // Two soles on flat ground, whose inequalities follow from each other in many ways.
  Random random(36);
  WrenchDistribution distribution;
  for (const double length : {0.01, 0.1, 1., 10., 100.}) {
    Vector6 weights = Vector6::Ones();
    weights.tail<3>() /= length;
    distribution.setWrenchWeights(weights);
    for (int trial = 0; trial < 100; ++trial) {
      BOOST_TEST_CONTEXT("problem " << trial << " with a length of " << length) {
        solve(distribution, twoSoles(), random.vector(6, 500.));
        checkAnswer(twoSoles(), distribution.result());
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(wrench_weights_are_finite_and_positive) {
  WrenchDistribution distribution;
  const Vector6 weights = wrench(1., 2., 3., 4., 5., 6.);
  distribution.setWrenchWeights(weights);
  for (Index i = 0; i < 6; ++i) {
    for (const double bad : {0., -0.25, kNaN, kInfinity}) {
      Vector6 wrong = weights;
      wrong[i] = bad;
      const std::string value = bad == 0. ? "0" : bad < 0. ? "-0.25" : bad > 0. ? "inf" : "nan";
      BOOST_TEST(throws<std::invalid_argument>([&] { distribution.setWrenchWeights(wrong); },
                                               {"wrench", "weights", value}));
      BOOST_TEST(close(distribution.getWrenchWeights(), weights, 0.));
    }
  }
}

BOOST_AUTO_TEST_CASE(beyond_friction_the_closest_force_is_on_the_cone) {
  // In the plane of f_x and f_z the cone is |f_x| ≤ μ f_z: along (μ, 1) the closest is
  // t = (μ d_x² f_x + d_z² f_z) / (μ² d_x² + d_z²).
  const Contacts contacts = {makePoint(Vector3d::Zero(), 0.5)};
  WrenchDistribution distribution;
  for (const double dx : {0.1, 1., 10.}) {
    distribution.setWrenchWeights(wrench(dx, 1., 2., 1., 1., 1.));
    const double t = (0.5 * dx * dx * 300. + 4. * 100.) / (0.25 * dx * dx + 4.);
    BOOST_TEST(solve(distribution, contacts, wrench(300., 10., 100.)) ==
               DistributionStatus::Relaxed);
    BOOST_TEST(close(distribution.result().forces(), Vector3d(0.5 * t, 10., t), 1e-9));
  }
  // From within the polar cone, nothing is the closest.
  BOOST_TEST(solve(distribution, contacts, wrench(1., 0., -100.)) == DistributionStatus::Relaxed);
  BOOST_TEST(close(distribution.result().forces(), Vector3d::Zero(), 1e-9));
}

BOOST_AUTO_TEST_CASE(the_threshold_of_reach_is_1e_8_of_the_scale) {
  // A force along the pyramid's edge is (f_x − μ f_z) / √(1 + μ²) away from it, once it is beyond.
  const double mu = 0.7;
  const Contacts contacts = {makeSole(Vector3d::Zero(), mu)};
  WrenchDistribution distribution;
  const auto statusAt = [&](double distance, double minimalScale) {
    const Vector6 edge = wrench(mu * 100., 0., 100.);
    const double scale = std::max(edge.norm(), minimalScale);
    const auto status =
        solve(distribution, contacts,
              edge + wrench(distance * scale * std::sqrt(1. + mu * mu), 0., 0.), minimalScale);
    checkAnswer(contacts, distribution.result());
    BOOST_TEST(close(distribution.result().residual.norm() / scale, distance, 1e-10));
    BOOST_TEST(close(distribution.result().scale, scale, 1e-5));
    return status;
  };
  for (const double minimalScale : {0., 1000.}) {
    BOOST_TEST(statusAt(0.9e-8, minimalScale) == DistributionStatus::Solved);
    BOOST_TEST(statusAt(1.1e-8, minimalScale) == DistributionStatus::Relaxed);
  }
}

BOOST_AUTO_TEST_CASE(what_is_small_beside_the_minimal_scale_is_nothing) {
  const Contacts soles = twoSoles();
  WrenchDistribution distribution;
  // A pull of 1 mN is none for 1 MN, and out of reach for 100 N.
  BOOST_TEST(solve(distribution, soles, wrench(0., 0., -1e-3), 1e6) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().forces(), VectorXd::Zero(12), 1e-9));
  BOOST_TEST(distribution.result().scale == 1e6);
  BOOST_TEST(solve(distribution, soles, wrench(0., 0., -1e-3), 100.) ==
             DistributionStatus::Relaxed);
  // Where the wrench is larger, it is the scale.
  BOOST_TEST(solve(distribution, soles, wrench(30., 0., 400.), 100.) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().scale, std::hypot(30., 400.)));
}

BOOST_AUTO_TEST_CASE(any_cone_is_taken_with_its_own_inequalities) {
  Random random(6);
  WrenchDistribution distribution;
  int relaxed = 0;
  for (int trial = 0; trial < 500; ++trial) {
    Contacts contacts;
    const Index hands = random.integer(1, 4);
    const VectorXd given = random.vector(6 * hands, 100.);
    for (Index i = 0; i < hands; ++i)
      contacts.push_back(std::make_shared<Hand>(random, given.segment<6>(6 * i)));
    const StackedProblem problem = stackedProblem(contacts);
    Vector6 total = problem.ne * given;
    const bool withinReach = random.coin();
    if (!withinReach) total = random.vector(6, 100.);
    const auto status = solve(distribution, contacts, total);
    if (withinReach) BOOST_REQUIRE(status == DistributionStatus::Solved);
    const DistributionResult& result = distribution.result();
    const VectorXd forces = result.forces();
    const double scale = result.scale;
    BOOST_REQUIRE((problem.inequalities * forces).maxCoeff() <= 1e-9 * scale);
    BOOST_REQUIRE(costGap(problem, forces, scale) < 1e-7);
    if (status == DistributionStatus::Solved) {
      BOOST_REQUIRE(close(problem.ne * forces, total, 1e-8));
      continue;
    }
    ++relaxed;
    BOOST_REQUIRE(status == DistributionStatus::Relaxed);
    // The pull of what is missing is one that the inequalities resist, and does not work along what
    // is given.
    const VectorXd pull = problem.ne.transpose() * result.residual;
    BOOST_REQUIRE(nonNegativeLeastSquares(problem.inequalities.transpose(), pull) <=
                  1e-8 * pull.norm() + 1e-9 * scale);
    BOOST_REQUIRE(std::abs(pull.dot(forces)) <= 1e-9 * scale * scale);
  }
  BOOST_TEST(relaxed > 50);
}

BOOST_AUTO_TEST_CASE(contacts_of_other_kinds_are_forces_or_wrenches) {
  for (const Index cols : {0, 1, 2, 4, 5, 7})
    BOOST_TEST(throws<std::invalid_argument>([cols = cols] { Hook hook(cols); },
                                             {"reg_A", std::to_string(cols).c_str()}));
  for (const Index cols : {3, 6}) {
    // Nothing but a pull upwards, whatever the other components are.
    WrenchDistribution distribution;
    Hook hook(cols);
    hook.updateNewtonEuler(Vector3d::Zero(), SE3::Identity());
    distribution.add(hook);
    BOOST_TEST(distribution.solve(wrench(-30., 0., 500.)) == DistributionStatus::Solved);
    BOOST_TEST(close(distribution.result().forces().head<3>(), Vector3d(-30., 0., 500.)));
  }
}

BOOST_AUTO_TEST_CASE(eiquadprog_finds_the_same_forces) {
  // It needs independent equalities, which soles give, and a wrench within reach.
  Random random(77);
  WrenchDistribution distribution;
  int tightened = 0;
  for (int trial = 0; trial < 500; ++trial) {
    Contacts contacts;
    for (Index count = random.integer(1, 4); count > 0; --count)
      contacts.push_back(
          makeSole(soleSettings(0.7, random.vector(6, 0.5, 2.)), random.placement()));
    const StackedProblem problem = stackedProblem(contacts);
    VectorXd given(problem.q.size());
    for (std::size_t k = 0; k < contacts.size(); ++k)
      given.segment<6>(6 * static_cast<Index>(k)) =
          randomForce(random, *contacts[k], random.coin() ? 1. : 0.5);
    const Vector6 total = problem.ne * given;
    BOOST_REQUIRE(solve(distribution, contacts, total) == DistributionStatus::Solved);

    eiquadprog::solvers::EiquadprogFast solver;
    solver.reset(given.size(), 6, problem.inequalities.rows());
    VectorXd forces(given.size());
    const auto status = solver.solve_quadprog(problem.q.asDiagonal(), VectorXd::Zero(given.size()),
                                              problem.ne, -total, -problem.inequalities,
                                              VectorXd::Zero(problem.inequalities.rows()), forces);
    BOOST_REQUIRE((status == eiquadprog::solvers::EIQUADPROG_FAST_OPTIMAL));
    BOOST_TEST(close(distribution.result().forces(), forces, 1e-7));
    tightened += solver.getActiveSetSize() > 6;
  }
  BOOST_TEST(tightened > 100);
}

/// A force at a corner of a contact's cone.
VectorXd cornerForce(Random& random, const ContactBase& contact) {
  VectorXd force = randomForce(random, contact, 1.);
  const auto sign = [&random] { return random.coin() ? 1. : -1.; };
  const double fz = force[2];
  const auto& settings = dynamic_cast<const Contact6D&>(contact).getSettings();
  force << sign() * settings.mu * fz, sign() * settings.mu * fz, fz,
      sign() * settings.half_width * fz, sign() * settings.half_length * fz,
      sign() * settings.gu * fz;
  return force;
}

// Two feet on the same ground, or nearly, which lean on their edges and all but slide: what they
// can give has hardly an interior there, and many inequalities nearly follow from others.
BOOST_AUTO_TEST_CASE(corners_of_the_cones_of_nearly_parallel_soles_are_reached) {
  Random random(19);
  for (int i = 0; i < 20000; ++i) {
    Contacts contacts;
    Vector6 total = Vector6::Zero();
    for (const double side : {-0.1, 0.1}) {
      const double tilt = random.coin() ? 0. : std::pow(10., random.uniform(-13., -3.));
      Contact6DSettings settings;
      settings.mu = 0.7;
      settings.gu = 0.08;
      settings.half_length = 0.10;
      settings.half_width = 0.06;
      settings.weights << 1., 1., random.coin() ? 1. : 1e-3, 10., 10., 10.;
      settings.frame_name = "sole";
      contacts.push_back(std::make_shared<Contact6D>(settings));
      contacts.back()->updateNewtonEuler(Vector3d(0., 0., 0.9),
                                         SE3(randomTilt(random, tilt), Vector3d(0.1, side, 0.)));
      VectorXd force = random.coin() ? cornerForce(random, *contacts.back())
                                     : randomForce(random, *contacts.back(), 1.);
      // Exactly in the corner, 4 in 1000 were given up.
      const double normal_force = force[2];
      force *= 1. - 1e-6;
      force[2] = normal_force;
      total += contacts.back()->ne_A() * force;
    }
    BOOST_TEST_CONTEXT("problem " << i) {
      WrenchDistribution distribution;
      BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
      const StackedProblem problem = stackedProblem(contacts);
      const VectorXd forces = distribution.result().forces();
      BOOST_TEST((problem.ne * forces - total).norm() <= 1e-8 * total.norm());
      BOOST_TEST((problem.inequalities * forces).maxCoeff() <= 1e-9 * total.norm());
    }
  }
}

BOOST_AUTO_TEST_CASE(no_force_is_asked_and_none_is_given) {
  WrenchDistribution distribution;
  for (const double minimalScale : {0., 100.}) {
    BOOST_TEST(solve(distribution, twoSoles(), Vector6::Zero(), minimalScale) ==
               DistributionStatus::Solved);
    const DistributionResult& result = distribution.result();
    BOOST_TEST(isZero(result.forces()));
    BOOST_TEST(isZero(result.achieved));
    BOOST_TEST(isZero(result.residual));
    BOOST_TEST(isZero(result.wrench_multipliers));
    BOOST_TEST(result.cost == 0.);
    BOOST_TEST(result.scale == minimalScale);
    BOOST_TEST(result.isOptimal());
  }
}

BOOST_AUTO_TEST_CASE(without_contacts_nothing_but_a_free_flight_is_solved) {
  WrenchDistribution distribution;
  const auto check = [&](const Vector6& total, double minimalScale, DistributionStatus status) {
    BOOST_TEST(solve(distribution, {}, total, minimalScale) == status);
    const DistributionResult& result = distribution.result();
    BOOST_TEST(result.status == status);
    BOOST_TEST(result.forces().size() == 0);
    BOOST_TEST(result.contacts.empty());
    BOOST_TEST(isZero(result.achieved));
    BOOST_TEST(close(result.residual, total, 0.));
    BOOST_TEST(isZero(result.wrench_multipliers));
    BOOST_TEST(result.cost == 0.);
    BOOST_TEST(result.isOptimal());
  };
  check(wrench(0., 0., 500.), 0., DistributionStatus::NoContact);
  check(wrench(0., 0., 500.), 1e6, DistributionStatus::NoContact);
  check(Vector6::Zero(), 0., DistributionStatus::Solved);
  check(Vector6::Zero(), 500., DistributionStatus::Solved);
  // Without a scale, anything is a wrench.
  check(wrench(0., 0., 1e-9), 0., DistributionStatus::NoContact);
  for (Index i = 0; i < 6; ++i) {
    check(0.99e-6 * Vector6::Unit(i), 100., DistributionStatus::Solved);
    check(-1.01e-6 * Vector6::Unit(i), 100., DistributionStatus::NoContact);
  }
  // Both sizes are those in the wrench's norm, whose common factor means nothing.
  for (const double factor : {1e-8, 10., 1e8}) {
    distribution.setWrenchWeights(factor * Vector6::Ones());
    check(wrench(0., 0., 0.99e-6), 100., DistributionStatus::Solved);
    check(wrench(0., 0., 1.01e-6), 100., DistributionStatus::NoContact);
    distribution.setWrenchWeights(factor * (Vector6() << 0.1, 1., 0.5, 2., 2., 2.).finished());
    check(wrench(0., 0., 1.99e-6), 100., DistributionStatus::Solved);
    check(wrench(0., 0., 2.01e-6), 100., DistributionStatus::NoContact);
  }
}

BOOST_AUTO_TEST_CASE(what_was_never_placed_or_has_no_size_is_refused) {
  WrenchDistribution distribution;
  Hook hook(6);
  BOOST_TEST(throws<NotReadyError>([&] { distribution.add(hook); }, {"hook", "updateNewtonEuler"}));
  hook.setPose(SE3::Identity());  // which leaves NE as it is
  BOOST_TEST(throws<NotReadyError>([&] { distribution.add(hook); }, {"hook", "updateNewtonEuler"}));
  BOOST_TEST(throws<std::invalid_argument>([&] { distribution.solve(wrench(0., 0., 500.), -1.); },
                                           {"minimalScale", ">= 0", "-1"}));
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::NoContact);
}

BOOST_AUTO_TEST_CASE(before_the_first_solve_numbers_are_nan) {
  WrenchDistribution distribution;
  const auto check = [&] {
    const DistributionResult& result = distribution.result();
    BOOST_TEST(allNaN(result.wrench));
    BOOST_TEST(allNaN(result.achieved));
    BOOST_TEST(allNaN(result.residual));
    BOOST_TEST(allNaN(result.wrench_multipliers));
    BOOST_TEST(std::isnan(result.scale));
    BOOST_TEST(std::isnan(result.cost));
    BOOST_TEST(result.iterations == 0);
    BOOST_TEST(!result.isOptimal());
  };
  check();
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  check();
}

namespace {

/// What is said of a wrench or a placement that is no number.
void checkNoAnswer(const DistributionResult& result) {
  for (const auto& contact : result.contacts) {
    BOOST_TEST(contact.force.allFinite());
    BOOST_TEST(isZero(contact.multipliers));
    BOOST_TEST(isZero(contact.relaxation_multipliers));
    BOOST_TEST(contact.multipliers.size() == contact.A.rows());
    BOOST_TEST(contact.relaxation_multipliers.size() == contact.A.rows());
    BOOST_TEST(contact.active.size() == contact.A.rows());
    BOOST_TEST(!contact.active.any());
  }
  BOOST_TEST(isZero(result.wrench_multipliers));
  BOOST_TEST(!result.isOptimal());
  BOOST_TEST(!result.isOptimal(1e6));
}

/// Two soles that give a wrench of some sort, and what can come in then that is no number.
struct Disturbed {
  Contacts contacts = {makeSole({0., 0.1, 0.}), makeSole({0., -0.1, 0.})};
  WrenchDistribution distribution;
  VectorXd good;

  explicit Disturbed(const Vector6& total) {
    const auto status = solve(distribution, contacts, total, 100.);
    BOOST_TEST((status == DistributionStatus::Solved || status == DistributionStatus::Relaxed));
    good = distribution.result().forces();
    BOOST_TEST(!isZero(good));
  }

  /// The forces after a wrench that is no number.
  VectorXd disturb() {
    BOOST_TEST(solve(distribution, contacts, Vector6::Constant(kNaN), 100.) ==
               DistributionStatus::InvalidInput);
    checkNoAnswer(distribution.result());
    return distribution.result().forces();
  }
};

}  // namespace

BOOST_AUTO_TEST_CASE(numbers_that_are_not_finite_leave_the_forces_of_the_last_answer) {
  // A reachable wrench, and one out of reach.
  for (const Vector6& total : {wrench(20., 0., 500., 1., 2., 3.), wrench(900., 0., 500.)}) {
    for (const double bad : {kNaN, kInfinity, -kInfinity}) {
      Disturbed test(total);
      const DistributionResult& result = test.distribution.result();
      const double cost = result.cost;
      const Vector6 achieved = result.achieved;
      for (Index i = 0; i < 6; ++i) {
        Vector6 wrong = total;
        wrong[i] = bad;
        BOOST_TEST(solve(test.distribution, test.contacts, wrong, 100.) ==
                   DistributionStatus::InvalidInput);
        BOOST_TEST(result.status == DistributionStatus::InvalidInput);
        checkNoAnswer(result);
        BOOST_TEST(close(result.forces(), test.good, 0.));
        BOOST_TEST(close(result.achieved, achieved, 1e-13));
        BOOST_TEST(close(result.cost, cost, 1e-13));
        // The residual is that of the wrench that was asked for.
        for (Index k = 0; k < 6; ++k) {
          if (k == i)
            BOOST_TEST(!std::isfinite(result.residual[k]));
          else
            BOOST_TEST(close(result.residual[k], total[k] - achieved[k], 1e-12));
        }
      }
      BOOST_TEST(solve(test.distribution, test.contacts, total, bad) ==
                 DistributionStatus::InvalidInput);
      BOOST_TEST(close(result.forces(), test.good, 0.));
      BOOST_TEST(close(result.residual, total - achieved));
      checkNoAnswer(result);

      // A placement that is not finite comes from sensors, too. Forces that are kept are finite
      // whatever they would give.
      for (const auto& contact : test.contacts) {
        const SE3 pose = contact->getPose();
        contact->updateNewtonEuler(Vector3d(bad, 0., 0.), pose);
        BOOST_TEST(solve(test.distribution, test.contacts, total, 100.) ==
                   DistributionStatus::InvalidInput);
        BOOST_TEST(close(result.forces(), test.good, 0.));
        checkNoAnswer(result);
        contact->updateNewtonEuler(Vector3d::Zero(), pose);
      }
      // It is as good as new after that.
      WrenchDistribution fresh;
      const auto status = solve(fresh, test.contacts, total, 100.);
      BOOST_TEST(solve(test.distribution, test.contacts, total, 100.) == status);
      BOOST_TEST(close(result.forces(), fresh.result().forces(), 0.));
      checkAnswer(test.contacts, result);
    }
  }
}

BOOST_AUTO_TEST_CASE(without_an_answer_before_forces_are_zero) {
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    WrenchDistribution distribution;
    BOOST_TEST(solve(distribution, twoSoles(), Vector6::Constant(bad)) ==
               DistributionStatus::InvalidInput);
    checkNoAnswer(distribution.result());
    BOOST_TEST(distribution.result().forces().size() == 12);
    BOOST_TEST(isZero(distribution.result().forces()));
    BOOST_TEST(isZero(distribution.result().achieved));
    BOOST_TEST(distribution.result().cost == 0.);

    BOOST_TEST(solve(distribution, {}, Vector6::Constant(bad)) == DistributionStatus::InvalidInput);
    BOOST_TEST(distribution.result().forces().size() == 0);
    BOOST_TEST(!distribution.result().isOptimal());
  }
}

BOOST_AUTO_TEST_CASE(forces_are_kept_while_contacts_move) {
  Disturbed test(wrench(20., 0., 500., 1., 2., 3.));
  test.contacts[0]->updateNewtonEuler(Vector3d(1., 2., 3.), Random(41).placement());
  BOOST_TEST(close(test.disturb(), test.good, 0.));
  BOOST_TEST(close(test.distribution.result().achieved,
                   stackedProblem(test.contacts).ne * test.good, 1e-12));
  // And time and again; what is set to what it was has not changed.
  test.distribution.setWrenchWeights(Vector6::Ones());
  BOOST_TEST(close(test.disturb(), test.good, 0.));
  // What is refused changes nothing: a contact, weights.
  BOOST_TEST(throws<std::invalid_argument>([&] { test.distribution.add(Contact6D()); }, {}));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { test.distribution.setWrenchWeights(Vector6::Zero()); }, {}));
  BOOST_TEST(close(test.disturb(), test.good, 0.));
}

BOOST_AUTO_TEST_CASE(forces_are_not_kept_once_anything_else_has_changed) {
  using Change = std::function<void(Disturbed&)>;
  const auto sole = [](Disturbed& test) -> Contact6D& {
    return dynamic_cast<Contact6D&>(*test.contacts[1]);
  };
  const std::vector<std::pair<std::string, Change>> changes = {
      {"mu", [&](auto& test) { sole(test).setMu(0.8); }},
      {"gu", [&](auto& test) { sole(test).setGu(0.06); }},
      {"half length", [&](auto& test) { sole(test).setSurfaceHalfLength(0.11); }},
      {"half width", [&](auto& test) { sole(test).setSurfaceHalfWidth(0.07); }},
      {"weights", [&](auto& test) { sole(test).setTorqueWeights(Vector3d(1., 1., 2.)); }},
      {"wrench weights",
       [](auto& test) { test.distribution.setWrenchWeights(wrench(1., 1., 1., 1., 1., 2.)); }},
      {"one contact less", [](auto& test) { test.contacts.pop_back(); }},
      {"one contact more",
       [](auto& test) {
         test.contacts.push_back(makeSole({1., 0., 0.}));
       }},
      {"another kind",
       [](auto& test) {
         test.contacts[1] = makePoint({0., -0.1, 0.});
       }},
      {"no contact", [](auto& test) { test.contacts.clear(); }},
      {"forgotten", [](auto& test) { test.distribution.forgetForces(); }},
      {"a zero wrench",
       [](auto& test) { solve(test.distribution, test.contacts, Vector6::Zero()); }},
      {"a flight between", [](auto& test) { solve(test.distribution, {}, Vector6::Zero(), 100.); }},
  };
  for (const auto& [name, change] : changes) {
    BOOST_TEST_CONTEXT(name) {
      for (const Vector6& total : {wrench(20., 0., 500., 1., 2., 3.), wrench(900., 0., 500.)}) {
        Disturbed test(total);
        change(test);
        BOOST_TEST(isZero(test.disturb()));
        BOOST_TEST(isZero(test.distribution.result().achieved));
        // As long as there is no answer.
        BOOST_TEST(isZero(test.disturb()));
        if (test.contacts.empty()) continue;
        solve(test.distribution, test.contacts, total, 100.);
        checkAnswer(test.contacts, test.distribution.result());
        const VectorXd good = test.distribution.result().forces();
        BOOST_TEST(close(test.disturb(), good, 0.));
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(beyond_the_largest_numbers_forces_are_kept_too) {
  Disturbed test(wrench(20., 0., 500., 1., 2., 3.));
  const Vector6 huge = Vector6::Constant(std::numeric_limits<double>::max());
  for (int twice = 0; twice < 2; ++twice) {
    BOOST_TEST(solve(test.distribution, test.contacts, huge) ==
               DistributionStatus::NumericalFailure);
    checkNoAnswer(test.distribution.result());
    BOOST_TEST(close(test.distribution.result().forces(), test.good, 0.));
    BOOST_TEST(std::isnan(test.distribution.computeMargin().margin));
  }
  BOOST_TEST(solve(test.distribution, test.contacts, wrench(20., 0., 500., 1., 2., 3.), 100.) ==
             DistributionStatus::Solved);
  BOOST_TEST(close(test.distribution.result().forces(), test.good, 0.));
}

BOOST_AUTO_TEST_CASE(the_result_holds_the_problem) {
  Random random(42);
  const Contacts contacts = randomContacts(random);
  const StackedProblem problem = stackedProblem(contacts);
  const Vector6 total = problem.ne * randomForces(random, contacts, 0.9);
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
  const DistributionResult& result = distribution.result();
  BOOST_TEST(close(result.wrench, total, 0.));
  BOOST_TEST(close(result.scale, total.norm()));
  BOOST_REQUIRE(result.contacts.size() == contacts.size());
  Index col = 0;
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const auto& contact = result.contacts[i];
    BOOST_TEST(close(contact.A.topRows(contacts[i]->uni_rows()), contacts[i]->uni_A(), 0.));
    BOOST_TEST(close(contact.A.bottomRows(contacts[i]->fri_rows()), contacts[i]->fri_A(), 0.));
    BOOST_TEST(close(contact.weights, contacts[i]->reg_A(), 0.));
    BOOST_TEST(close(contact.NE, contacts[i]->ne_A(), 0.));
    BOOST_TEST(close(contact.force, result.forces().segment(col, contact.force.size()), 0.));
    col += contact.force.size();
  }
  BOOST_TEST(col == problem.q.size());
}

BOOST_AUTO_TEST_CASE(multipliers_are_those_of_the_conditions_in_the_documentation) {
  Random random(43);
  WrenchDistribution distribution;
  int multiplied = 0, active = 0;
  for (int trial = 0; trial < 500; ++trial) {
    const Contacts contacts = randomContacts(random);
    Vector6 total = stackedProblem(contacts).ne * randomForces(random, contacts, 1.);
    if (random.coin()) total += random.vector(6, 300.);
    solve(distribution, contacts, total);
    const DistributionResult& result = distribution.result();
    const double scale = result.scale;
    const bool relaxed = result.status == DistributionStatus::Relaxed;
    for (const auto& contact : result.contacts) {
      // W² λ = NEᵀ ν − Aᵀ μ, and NEᵀ D² r = Aᵀ μ'
      const VectorXd gradient = contact.weights.cwiseAbs2().cwiseProduct(contact.force);
      const VectorXd ofWrench = contact.NE.transpose() * result.wrench_multipliers;
      const VectorXd ofBounds = contact.A.transpose() * contact.multipliers;
      const double terms =
          scale + contact.multipliers.cwiseAbs().sum() + result.wrench_multipliers.cwiseAbs().sum();
      BOOST_TEST((gradient - ofWrench + ofBounds).norm() <= 1e-8 * terms);
      const VectorXd pull = contact.NE.transpose() * result.residual;
      if (relaxed)
        BOOST_TEST(close(contact.A.transpose() * contact.relaxation_multipliers / scale,
                         pull / scale, 1e-8));
      else
        BOOST_TEST(isZero(contact.relaxation_multipliers));

      BOOST_TEST(contact.relaxation_multipliers.minCoeff() >= 0.);
      const VectorXd slack = -contact.A * contact.force;
      for (Index i = 0; i < slack.size(); ++i) {
        const bool held = contact.relaxation_multipliers[i] > 0.;
        if (!held) BOOST_TEST(contact.multipliers[i] >= 0.);
        if (!contact.active[i]) BOOST_TEST(contact.multipliers[i] == 0.);
        if (contact.active[i]) BOOST_TEST(std::abs(slack[i]) <= 1e-9 * scale);
        if (held) BOOST_TEST(std::abs(slack[i]) <= 1e-8 * scale);
        multiplied += held;
        active += contact.active[i];
      }
    }
  }
  BOOST_TEST(multiplied > 500);
  BOOST_TEST(active > 1000);
}

BOOST_AUTO_TEST_CASE(an_answer_that_was_tampered_with_is_not_optimal) {
  // Beyond friction, with one foot more loaded than the other.
  const Contacts contacts = {makeSole({0., 0.1, 0.}), makeSole({0.02, -0.1, 0.01})};
  for (const Vector6& total : {wrench(900., 100., 500., 1., 2., 3.), wrench(300., 0., 500., 60.)}) {
    WrenchDistribution distribution;
    const auto status = solve(distribution, contacts, total);
    const DistributionResult result = distribution.result();
    const bool relaxed = status == DistributionStatus::Relaxed;
    BOOST_TEST(relaxed == (total[0] == 900.));
    BOOST_TEST(result.isOptimal(1e-9));

    const auto refused = [&](const std::string& what, auto change) {
      DistributionResult changed = result;
      change(changed);
      BOOST_TEST(!changed.isOptimal(), what);
      return changed;
    };
    const auto refusedAtAnyTolerance = [&](const std::string& what, auto change) {
      BOOST_TEST(!refused(what, change).isOptimal(1e9), what);
    };
    for (const double change : {1e-3 * result.scale, -1e-3 * result.scale}) {
      for (Index i = 0; i < 6; ++i) {
        const std::string component = " " + std::to_string(i);
        refused("wrench" + component, [&](auto& bad) { bad.wrench[i] += change; });
        refused("achieved" + component, [&](auto& bad) { bad.achieved[i] += change; });
        refused("residual" + component, [&](auto& bad) { bad.residual[i] += change; });
        refused("ν" + component, [&](auto& bad) { bad.wrench_multipliers[i] += change; });
        // What is consistent, but neither reached nor closest.
        refused("another wrench" + component, [&](auto& bad) {
          bad.wrench[i] += change;
          bad.residual[i] += change;
        });
      }
      for (std::size_t k = 0; k < 2; ++k) {
        for (Index i = 0; i < 6; ++i)
          refused("force " + std::to_string(i),
                  [&](auto& bad) { bad.contacts[k].force[i] += change; });
        for (Index i = 0; i < 11; ++i) {
          refused("μ " + std::to_string(i),
                  [&](auto& bad) { bad.contacts[k].multipliers[i] += change; });
          if (relaxed)
            refused("μ' " + std::to_string(i),
                    [&](auto& bad) { bad.contacts[k].relaxation_multipliers[i] += change; });
        }
      }
    }
    refused("weights", [](auto& bad) { bad.contacts[0].weights *= 1.01; });
    refused("NE", [](auto& bad) { bad.contacts[0].NE *= 1.01; });
    refused("scaled", [](auto& bad) { bad.wrench *= 1.01; });
    if (relaxed) {
      refused("said to be reached", [](auto& bad) { bad.status = DistributionStatus::Solved; });
      refused("wrench weights", [](auto& bad) { bad.wrench_weights[0] *= 2.; });
    }
    for (const auto none : {DistributionStatus::InvalidInput, DistributionStatus::NumericalFailure})
      refusedAtAnyTolerance(to_string(none), [&](auto& bad) { bad.status = none; });
    refusedAtAnyTolerance("wrench is NaN", [](auto& bad) { bad.wrench[2] = kNaN; });
    refusedAtAnyTolerance("achieved is NaN", [](auto& bad) { bad.achieved[2] = kNaN; });
    refusedAtAnyTolerance("residual is NaN", [](auto& bad) { bad.residual[2] = kNaN; });
    refusedAtAnyTolerance("force is NaN", [](auto& bad) { bad.contacts[1].force[2] = kNaN; });
    refusedAtAnyTolerance("ν is NaN", [](auto& bad) { bad.wrench_multipliers[2] = kNaN; });
    refusedAtAnyTolerance("μ is NaN", [](auto& bad) { bad.contacts[1].multipliers[2] = kNaN; });
    if (relaxed)
      refusedAtAnyTolerance("μ' is NaN",
                            [](auto& bad) { bad.contacts[1].relaxation_multipliers[2] = kNaN; });
  }
}

BOOST_AUTO_TEST_CASE(every_condition_of_optimality_is_looked_at) {
  // Two contacts that push upwards, f ≥ 0, written down by hand.
  const auto write = [](DistributionStatus status, double wrench, double achieved, double nu,
                        const Vector2d& forces, const Vector2d& multipliers,
                        const Vector2d& relaxation) {
    DistributionResult result;
    result.status = status;
    result.wrench = wrench * Vector6::Unit(2);
    result.achieved = achieved * Vector6::Unit(2);
    result.residual = result.wrench - result.achieved;
    result.scale = std::abs(wrench);
    result.cost = 0.5 * forces.squaredNorm();
    result.wrench_multipliers = nu * Vector6::Unit(2);
    for (const Index i : {0, 1}) {
      DistributionResult::Contact contact;
      contact.A = -MatrixXd::Ones(1, 1);
      contact.weights = VectorXd::Ones(1);
      contact.NE = Vector6::Unit(2);
      contact.force = forces.segment<1>(i);
      contact.active.setConstant(1, forces[i] == 0.);
      contact.multipliers = multipliers.segment<1>(i);
      contact.relaxation_multipliers = relaxation.segment<1>(i);
      result.contacts.push_back(contact);
    }
    return result;
  };
  const auto solved = DistributionStatus::Solved, relaxed = DistributionStatus::Relaxed;
  const Vector2d none = Vector2d::Zero();
  BOOST_TEST(write(solved, 100., 100., 50., {50., 50.}, none, none).isOptimal());
  BOOST_TEST(write(relaxed, -100., 0., 0., none, none, {100., 100.}).isOptimal());

  // A negative multiplier: the second would better push, too.
  BOOST_TEST(!write(solved, 100., 100., 100., {100., 0.}, {0., -100.}, none).isOptimal());
  // A multiplier where there is room: the first would better push less.
  BOOST_TEST(!write(solved, 100., 100., 40., {60., 40.}, {20., 0.}, none).isOptimal());
  // Forces that give something else.
  BOOST_TEST(!write(solved, 100., 100., 30., {30., 30.}, none, none).isOptimal());
  // Forces that give the achieved wrench, which is not the one that was asked for.
  BOOST_TEST(!write(solved, 100., 60., 30., {30., 30.}, none, none).isOptimal());
  // A pull, of the sizes that a push would have.
  BOOST_TEST(!write(solved, -100., -100., -50., {-50., -50.}, none, none).isOptimal());
  // They could push more, and come closer.
  BOOST_TEST(!write(relaxed, 100., 0., 0., none, none, {-100., -100.}).isOptimal());
  BOOST_TEST(!write(relaxed, 100., 0., 0., none, none, none).isOptimal());
  // They could push less, and come closer.
  BOOST_TEST(!write(relaxed, -50., 100., 50., {50., 50.}, none, {150., 150.}).isOptimal());
  // The relaxation's multipliers excuse a negative one, but only where they are right.
  for (const double multiplier : {1e-300, 1e-12, 1e-10, 1e-9, 1.}) {
    const Vector2d excuse(0., multiplier);
    DistributionResult result = write(solved, 100., 100., 100., {100., 0.}, {0., -100.}, excuse);
    BOOST_TEST(!result.isOptimal());
    result.status = relaxed;
    BOOST_TEST(!result.isOptimal());
    // Truly out of reach.
    result.wrench[0] = result.residual[0] = 50.;
    result.scale = result.wrench.norm();
    BOOST_TEST(!result.isOptimal());
  }
  // Small slacks times large multipliers: much cheaper forces may be next to these.
  const double slack = 1e-7;
  BOOST_TEST(!write(solved, 100., 100., 1e8, {100. - slack, slack}, {1e8, 1e8}, none).isOptimal());
  // Large multipliers of opposite sides that hide a cheaper answer: the second would better push.
  DistributionResult squeezed = write(solved, 100., 100., 50., {90., 10.}, none, none);
  for (DistributionResult::Contact& contact : squeezed.contacts) {
    contact.A = (MatrixXd(3, 1) << -1., 1e-9, -1e-9).finished();
    contact.force[0] = 0.5 * contact.force[0];
    contact.multipliers = VectorXd::Constant(3, 1e17);
    contact.multipliers[0] = 0.;
    contact.relaxation_multipliers.setZero(3);
    contact.active.setConstant(3, true);
  }
  BOOST_TEST(!squeezed.isOptimal());
  // Other names for the same.
  BOOST_TEST(!write(relaxed, 100., 100., 50., {50., 50.}, none, none).isOptimal());
  DistributionResult nothing = write(DistributionStatus::NoContact, 100., 0., 0., none, none, none);
  BOOST_TEST(!nothing.isOptimal());
  nothing.contacts.clear();
  BOOST_TEST(nothing.isOptimal());
  nothing.wrench = nothing.residual = 1e-9 * nothing.wrench;
  BOOST_TEST(!nothing.isOptimal());
}

BOOST_AUTO_TEST_CASE(forces_that_are_not_the_cheapest_are_not_optimal) {
  // They give the wrench within the cones, but push against each other.
  WrenchDistribution distribution;
  solve(distribution, twoSoles(), wrench(0., 0., 500.));
  DistributionResult result = distribution.result();
  result.contacts[0].force[1] += 10.;
  result.contacts[1].force[1] -= 10.;
  BOOST_TEST(close(stackedProblem(twoSoles()).ne * result.forces(), result.achieved));
  BOOST_TEST(!result.isOptimal());
  // Ten of the 250 N are about 4 percent.
  BOOST_TEST(result.isOptimal(0.1));
}

BOOST_AUTO_TEST_CASE(forces_outside_the_cone_are_not_optimal) {
  // The cheapest forces for a wrench, were it not for friction.
  DistributionResult result;
  WrenchDistribution distribution;
  solve(distribution, {makeSole(Vector3d::Zero(), 1.)}, wrench(80., 0., 100.));
  result = distribution.result();
  BOOST_TEST(result.isOptimal());
  solve(distribution, {makeSole(Vector3d::Zero(), 0.7)}, wrench(80., 0., 100.));
  result.contacts[0].A = distribution.result().contacts[0].A;
  BOOST_TEST(!result.isOptimal());
}

BOOST_AUTO_TEST_CASE(points_give_what_they_can) {
  // One point, two points and three in a row cannot give every wrench: the equalities depend on
  // each other. Some wrenches that they can give, and some that they cannot, are asked for here.
  Random random(4);
  WrenchDistribution distribution;
  for (int trial = 0; trial < 600; ++trial) {
    Contacts contacts;
    const Vector3d start = random.vector3(), direction = random.vector3();
    const Index points = random.integer(1, 3);
    const bool inARow = random.coin();
    for (Index i = 0; i < points; ++i)
      contacts.push_back(makePoint(inARow ? Vector3d(start + i * direction) : random.vector3()));
    Vector6 total = stackedProblem(contacts).ne * randomForces(random, contacts, 0.9);
    const bool withinReach = random.coin();
    if (!withinReach) total += random.vector(6, 50.);

    BOOST_TEST_CONTEXT("problem " << trial) {
      const auto status = solve(distribution, contacts, total);
      if (withinReach)
        BOOST_TEST(status == DistributionStatus::Solved);
      else if (points < 3 || inARow)
        BOOST_TEST(status == DistributionStatus::Relaxed);
      checkAnswer(contacts, distribution.result());
    }
  }
}

BOOST_AUTO_TEST_CASE(a_sole_without_extent_or_friction_leaves_out_what_it_cannot_give) {
  // The CoM is at the sole, and so its force is the wrench, but for what it cannot give.
  const Vector6 total = wrench(20., -10., 500., 3., 4., 5.);
  const auto expect = [&](auto change, std::initializer_list<Index> lacking) {
    Contact6DSettings settings = soleSettings();
    change(settings);
    const Contacts contacts = {makeSole(settings, SE3::Identity())};
    Vector6 expected = total;
    for (const Index i : lacking) expected[i] = 0.;
    WrenchDistribution distribution;
    BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Relaxed);
    BOOST_TEST(close(distribution.result().forces(), expected, 1e-9));
    BOOST_TEST(close(distribution.result().residual, total - expected, 1e-7));
    checkAnswer(contacts, distribution.result());
    BOOST_TEST(solve(distribution, contacts, expected) == DistributionStatus::Solved);
    BOOST_TEST(close(distribution.result().forces(), expected, 1e-9));
  };
  expect([](auto& settings) { settings.half_length = 0.; }, {4});
  expect([](auto& settings) { settings.half_width = 0.; }, {3});
  expect([](auto& settings) { settings.half_length = settings.half_width = 0.; }, {3, 4});
  expect([](auto& settings) { settings.gu = 0.; }, {5});
  expect([](auto& settings) { settings.mu = 0.; }, {0, 1});
  expect([](auto& settings) { settings.mu = settings.gu = 0.; }, {0, 1, 5});
  expect(
      [](auto& settings) {
        settings.mu = settings.gu = settings.half_length = settings.half_width = 0.;
      },
      {0, 1, 3, 4, 5});
}

BOOST_AUTO_TEST_CASE(contacts_at_one_place_share_by_their_squared_weights) {
  // Within reach or not: of any number of equal soles, each gives what a single one would, times
  // its share.
  Random random(44);
  for (int trial = 0; trial < 100; ++trial) {
    const SE3 pose = random.placement();
    const Vector6 weights = randomWeights(random, 6);
    Contacts contacts;
    VectorXd shares = random.vector(random.integer(2, 5), 0.5, 2.);
    for (const double share : shares)
      contacts.push_back(makeSole(soleSettings(0.7, weights / std::sqrt(share)), pose));
    shares /= shares.sum();
    Vector6 total = contacts[0]->ne_A() * randomForce(random, *contacts[0], 1.);
    if (random.coin()) total += random.vector(6, 100.);

    WrenchDistribution one, all;
    const auto status = solve(one, {contacts[0]}, total);
    BOOST_TEST(solve(all, contacts, total) == status);
    for (std::size_t i = 0; i < contacts.size(); ++i)
      BOOST_TEST(close(all.result().contacts[i].force,
                       shares[static_cast<Index>(i)] * one.result().forces(), 1e-7));
  }
}

BOOST_AUTO_TEST_CASE(one_contact_more_never_takes_the_wrench_further_away) {
  Random random(45);
  WrenchDistribution distribution;
  for (int trial = 0; trial < 200; ++trial) {
    const Vector6 weights = randomWrenchWeights(random);
    const Vector6 total = random.vector(6, 500.);
    distribution.setWrenchWeights(weights);
    distribution.clear();
    double former = kInfinity;
    for (const auto& contact : randomContacts(random)) {
      distribution.add(*contact);
      distribution.solve(total);
      const double distance = weights.cwiseProduct(distribution.result().residual).norm();
      BOOST_TEST(distance <= former + 1e-8 * distribution.result().scale);
      former = distance;
    }
  }
}

BOOST_AUTO_TEST_CASE(scaling_the_wrench_scales_the_forces) {
  Random random(46);
  WrenchDistribution distribution;
  for (int trial = 0; trial < 100; ++trial) {
    const Contacts contacts = randomContacts(random);
    Vector6 total = stackedProblem(contacts).ne * randomForces(random, contacts, 0.9);
    if (random.coin()) total = random.vector(6, 500.);
    const auto status = solve(distribution, contacts, total);
    const DistributionResult one = distribution.result();
    for (const double scale : {1e-6, 1e-3, 1e3, 1e6}) {
      BOOST_TEST(solve(distribution, contacts, scale * total) == status);
      const DistributionResult& scaled = distribution.result();
      BOOST_TEST(close(scaled.forces() / scale, one.forces(), 1e-9));
      BOOST_TEST(close(scaled.residual / scale, one.residual, 1e-9));
      BOOST_TEST(close(scaled.cost / (scale * scale), one.cost, 1e-9));
      BOOST_TEST(close(scaled.scale / scale, one.scale));
      BOOST_TEST(scaled.isOptimal());
    }
  }
}

BOOST_AUTO_TEST_CASE(sizes_of_all_magnitudes_give_finite_forces) {
  WrenchDistribution distribution;
  for (const double size : {1e-300, 1e-200, 1e-9, 1e9, 1e150, 1e200, 1e300}) {
    for (const double direction : {1., -1.}) {
      const Vector6 total = direction * size * wrench(0.1, 0., 1., 0., 0.01, 0.);
      const auto status = solve(distribution, twoSoles(), total);
      BOOST_TEST_CONTEXT("wrench of size " << size) {
        BOOST_TEST(status ==
                   (direction > 0. ? DistributionStatus::Solved : DistributionStatus::Relaxed));
        const VectorXd forces = distribution.result().forces() / size;
        if (direction > 0.)
          BOOST_TEST(close(forces.head<3>(), Vector3d(0.05, 0., 0.5), 1e-9));
        else
          BOOST_TEST(close(forces, VectorXd::Zero(12), 1e-9));
        BOOST_TEST(close(distribution.result().residual / size,
                         (total - distribution.result().achieved) / size));
      }
      BOOST_TEST(solve(distribution, {}, total) == DistributionStatus::NoContact);
    }
  }
}

BOOST_AUTO_TEST_CASE(contacts_are_taken_as_they_are_when_added) {
  const auto left = makeSole({0., 0.1, 0.}), right = makeSole({0., -0.1, 0.});
  WrenchDistribution distribution;
  distribution.add(*left);
  distribution.add(*right);
  // What is added is copied.
  left->updateNewtonEuler(Vector3d::Zero(), SE3(Matrix3d::Identity(), Vector3d(5., 5., 5.)));
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().forces()[2], 250., 1e-10));
  BOOST_TEST(close(distribution.result().forces()[8], 250., 1e-10));
}

BOOST_AUTO_TEST_CASE(a_contact_is_its_matrices) {
  Random random(47);
  for (int trial = 0; trial < 50; ++trial) {
    const Contacts contacts = randomContacts(random);
    const Vector6 total = random.vector(6, 500.);
    WrenchDistribution whole, matrices;
    const auto status = solve(whole, contacts, total);
    for (const auto& contact : contacts) {
      MatrixXd A(contact->uni_rows() + contact->fri_rows(), contact->cols());
      A << contact->uni_A(), contact->fri_A();
      matrices.add(A, contact->reg_A(), contact->ne_A());
    }
    BOOST_TEST(matrices.solve(total) == status);
    BOOST_TEST(close(matrices.result().forces() / whole.result().scale,
                     whole.result().forces() / whole.result().scale, 1e-8));
  }
}

BOOST_AUTO_TEST_CASE(changed_matrices_are_noticed) {
  // Two equal contacts share by halves; NE is where they are, and may change.
  const auto halves = [](WrenchDistribution& distribution, double mu, double weight, double height,
                         const Vector6& total) {
    Contact6DSettings settings = soleSettings(mu);
    settings.weights *= weight;
    const auto sole = makeSole(settings, SE3(Matrix3d::Identity(), Vector3d(0., 0., height)));
    MatrixXd A(11, 6);
    A << sole->uni_A(), sole->fri_A();
    distribution.clear();
    distribution.add(A, settings.weights, sole->ne_A());
    distribution.add(A, settings.weights, sole->ne_A());
    return distribution.solve(total);
  };
  const Vector6 none = Vector6::Constant(kNaN), total = wrench(30., 0., 500.);
  VectorXd expected(12);
  expected << 0.5 * total, 0.5 * total;
  WrenchDistribution distribution;
  const auto check = [&](double mu, double weight, double height, const VectorXd& kept) {
    BOOST_TEST(halves(distribution, 0.7, 1., 0., total) == DistributionStatus::Solved);
    BOOST_TEST(close(distribution.result().forces(), expected, 1e-10));
    BOOST_TEST(halves(distribution, mu, weight, height, none) == DistributionStatus::InvalidInput);
    BOOST_TEST(close(distribution.result().forces(), kept, 1e-10));
  };
  check(0.7, 1., 0., expected);
  check(0.7, 1., 1., expected);
  check(0.8, 1., 0., VectorXd::Zero(12));
  check(0.7, 2., 0., VectorXd::Zero(12));
  // They are what the next answer is for, too.
  BOOST_TEST(halves(distribution, 0.05, 1., 0., total) == DistributionStatus::Relaxed);
  BOOST_TEST(halves(distribution, 0.07, 1., 0., total) == DistributionStatus::Solved);
}

BOOST_AUTO_TEST_CASE(matrices_may_be_without_inequalities) {
  // A glued sole gives anything.
  WrenchDistribution distribution;
  distribution.add(MatrixXd(0, 6), VectorXd::Ones(6), MatrixXd::Identity(6, 6));
  for (const Vector6& total : {wrench(1., 2., 3., 4., 5., 6.), wrench(0., 0., -500.)}) {
    BOOST_TEST(distribution.solve(total) == DistributionStatus::Solved);
    BOOST_TEST(close(distribution.result().forces(), total, 1e-10));
    BOOST_TEST(distribution.result().isOptimal());
    BOOST_TEST(distribution.computeMargin().margin == kInfinity);
  }
}

BOOST_AUTO_TEST_CASE(matrices_that_do_not_fit_are_refused) {
  WrenchDistribution distribution;
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  distribution.solve(wrench(0., 0., 500.));
  const MatrixXd A = MatrixXd::Ones(2, 3), NE = MatrixXd::Ones(6, 3);
  const VectorXd weights = Vector3d::Ones();
  const auto refused = [&](const MatrixXd& A, const VectorXd& weights, const MatrixXd& NE,
                           std::initializer_list<std::string> words) {
    BOOST_TEST(throws<std::invalid_argument>([&] { distribution.add(A, weights, NE); }, words));
    // Nothing has changed.
    BOOST_TEST(distribution.result().contacts.size() == 2u);
    BOOST_TEST(distribution.solve(Vector6::Constant(kNaN)) == DistributionStatus::InvalidInput);
    BOOST_TEST(close(distribution.result().forces()[2], 250., 1e-10));
  };
  refused(MatrixXd::Ones(2, 4), weights, NE, {"A", "3", "4"});
  refused(MatrixXd::Ones(2, 0), weights, NE, {"A", "3", "0"});
  refused(A, weights, MatrixXd::Ones(6, 2), {"NE", "3", "2"});
  refused(A, VectorXd(0), NE, {"weights"});
  refused(MatrixXd(2, 0), VectorXd(0), MatrixXd(6, 0), {"weights"});
  for (const double bad : {kNaN, kInfinity}) {
    MatrixXd wrong = A;
    wrong(1, 2) = bad;
    refused(wrong, weights, NE, {"A"});
    refused(A, Vector3d(1., bad, 1.), NE, {"weights", std::isnan(bad) ? "nan" : "inf"});
  }
  refused(A, Vector3d(1., 0., 1.), NE, {"weights", "0"});
  refused(A, Vector3d(1., 1., -0.25), NE, {"weights", "-0.25"});
  // Placements are data: they are looked at when it is solved.
  distribution.add(A, weights, MatrixXd::Constant(6, 3, kNaN));
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::InvalidInput);
  BOOST_TEST(isZero(distribution.result().forces()));
}

BOOST_AUTO_TEST_CASE(a_contact_without_settings_is_refused) {
  WrenchDistribution distribution;
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  BOOST_TEST(
      throws<std::invalid_argument>([&] { distribution.add(Contact6D()); }, {"initialised"}));
  BOOST_TEST(
      throws<std::invalid_argument>([&] { distribution.add(ContactPoint()); }, {"initialised"}));
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().forces()[2], 250., 1e-10));
}

BOOST_AUTO_TEST_CASE(clear_begins_anew) {
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, twoSoles(), wrench(0., 0., 500.)) == DistributionStatus::Solved);
  // Another size, bigger and then smaller.
  const Contacts points = {makePoint({0.3, 0.2, 0.}), makePoint({0.3, -0.2, 0.}),
                           makePoint({-0.3, 0.2, 0.}), makePoint({-0.3, -0.2, 0.}),
                           makeSole({0., 0., 0.})};
  BOOST_TEST(solve(distribution, points, wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(distribution.result().forces().size() == 18);
  for (Index i = 0; i < 4; ++i)
    BOOST_TEST(close(distribution.result().forces()[3 * i + 2], 100., 1e-10));

  BOOST_TEST(solve(distribution, {makeSole({0., 0., 0.})}, wrench(1., 2., 500.)) ==
             DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().forces(), wrench(1., 2., 500.), 1e-10));

  distribution.clear();
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::NoContact);
  BOOST_TEST(distribution.result().contacts.empty());
}

BOOST_AUTO_TEST_CASE(the_same_problem_may_be_solved_for_many_wrenches) {
  Random random(5);
  WrenchDistribution distribution;
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  for (int trial = 0; trial < 50; ++trial) {
    const Vector6 total = wrench(0., 0., 500.) + Vector6(random.vector(6, trial < 25 ? 20. : 500.));
    WrenchDistribution fresh;
    BOOST_TEST(distribution.solve(total) == solve(fresh, twoSoles(), total));
    BOOST_TEST(close(distribution.result().forces(), fresh.result().forces(), 1e-10));
  }
}

BOOST_AUTO_TEST_CASE(a_copy_is_independent) {
  WrenchDistribution original;
  for (const auto& contact : twoSoles()) original.add(*contact);
  original.solve(wrench(0., 0., 500.));

  WrenchDistribution copy(original);
  BOOST_TEST(close(copy.result().forces(), original.result().forces(), 0.));
  // It knows of the last answer, too.
  BOOST_TEST(copy.solve(Vector6::Constant(kNaN)) == DistributionStatus::InvalidInput);
  BOOST_TEST(close(copy.result().forces()[2], 250., 1e-10));
  BOOST_TEST(original.result().status == DistributionStatus::Solved);
  BOOST_TEST(copy.solve(wrench(0., 0., 300.)) == DistributionStatus::Solved);
  BOOST_TEST(close(copy.result().forces()[2], 150., 1e-10));
  BOOST_TEST(close(original.result().forces()[2], 250., 1e-10));
  copy.setWrenchWeights(Vector6::Constant(2.));
  BOOST_TEST(close(original.getWrenchWeights(), Vector6::Ones(), 0.));
  BOOST_TEST(close(original.result().wrench_weights, Vector6::Ones(), 0.));

  original = copy;
  BOOST_TEST(close(original.result().forces()[2], 150., 1e-10));
  BOOST_TEST(close(original.getWrenchWeights(), Vector6::Constant(2.), 0.));
  copy.clear();
  BOOST_TEST(original.solve(wrench(0., 0., 200.)) == DistributionStatus::Solved);

  WrenchDistribution moved(std::move(original));
  BOOST_TEST(close(moved.result().forces()[2], 100., 1e-10));
}

BOOST_AUTO_TEST_CASE(what_was_moved_from_is_as_new) {
  WrenchDistribution original;
  original.setWrenchWeights(Vector6::Constant(2.));
  original.setWarmStart(false);
  original.setMaximalIterations(7);
  for (const auto& contact : twoSoles()) original.add(*contact);
  original.solve(wrench(0., 0., 500.));
  WrenchDistribution moved(std::move(original));
  BOOST_TEST(moved.getMaximalIterations() == 7);

  WrenchDistribution copy(original);
  for (WrenchDistribution* distribution : {&original, &copy}) {
    BOOST_TEST(close(distribution->getWrenchWeights(), Vector6::Ones(), 0.));
    BOOST_TEST(distribution->getWarmStart());
    BOOST_TEST(distribution->getMaximalIterations() == WrenchDistribution::kMaximalIterations);
    BOOST_TEST(distribution->result().status == DistributionStatus::NoContact);
    BOOST_TEST(distribution->result().contacts.empty());
    BOOST_TEST(std::isnan(distribution->computeMargin().margin));
    distribution->reset();
    distribution->forgetForces();
    distribution->forgetAnswers();
    distribution->clear();
    for (const auto& contact : twoSoles()) distribution->add(*contact);
    BOOST_TEST(distribution->solve(wrench(0., 0., 500.)) == DistributionStatus::Solved);
  }
  WrenchDistribution again(std::move(copy));
  copy = moved;
  BOOST_TEST(close(copy.result().forces(), moved.result().forces(), 0.));
}

BOOST_AUTO_TEST_CASE(a_result_stays_where_it_is) {
  WrenchDistribution distribution;
  const DistributionResult& result = distribution.result();
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  distribution.solve(wrench(0., 0., 500.));
  BOOST_TEST(result.status == DistributionStatus::Solved);
  distribution.reset();
  BOOST_TEST(&distribution.result() == &result);
  BOOST_TEST(result.status == DistributionStatus::NoContact);
}

namespace {

/// The margin of a wrench that contacts can give.
WrenchMargin marginOf(const Contacts& contacts, const Vector6& total,
                      const Vector6& weights = Vector6::Ones()) {
  WrenchDistribution distribution;
  distribution.setWrenchWeights(weights);
  BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
  return distribution.computeMargin();
}

}  // namespace

BOOST_AUTO_TEST_CASE(margin_of_a_sole_has_a_closed_form) {
  // The CoM is at the sole, and so the wrench is its force. What is pushed more only helps; pushing
  // less tightens whatever is the tightest.
  Random random(51);
  std::vector<int> met(12, 0);
  for (int trial = 0; trial < 400; ++trial) {
    Contact6DSettings settings;
    settings.mu = random.uniform(0.1, 1.);
    settings.gu = random.uniform(0.1, 1.);
    settings.half_length = random.uniform(0.1, 1.);
    settings.half_width = random.uniform(0.1, 1.);
    settings.frame_name = "sole";
    const Contacts contacts = {makeSole(settings, SE3::Identity())};
    const Vector6 total = randomForce(random, *contacts[0], 0.9);
    const Vector6 weights = randomWrenchWeights(random);

    Vector6 limit;  // per newton of f_z
    limit << settings.mu, settings.mu, 1., settings.half_width, settings.half_length, settings.gu;
    double least = kInfinity;
    int axis = -1, sign = 0;
    for (int i = 0; i < 6; ++i) {
      for (const int s : {1, -1}) {
        double room = limit[i] * total[2] - s * total[i];
        if (i == 2) {
          room = kInfinity;
          for (int k = 0; k < 6 && s < 0; ++k)
            room = std::min(room, total[2] - (k == 2 ? 0. : std::abs(total[k]) / limit[k]));
        }
        if (!(weights[i] * room < least)) continue;
        least = weights[i] * room;
        axis = i;
        sign = s;
      }
    }
    const WrenchMargin margin = marginOf(contacts, total, weights);
    BOOST_TEST(close(margin.margin, least, 1e-8));
    BOOST_TEST(margin.axis == axis);
    BOOST_TEST(margin.sign == sign);
    ++met[static_cast<std::size_t>(2 * axis + (sign > 0))];
  }
  for (std::size_t i = 0; i < met.size(); ++i)
    if (i != 5) BOOST_TEST(met[i] > 5, "axis and sign " << i << ": " << met[i]);
  BOOST_TEST(met[5] == 0);
}

BOOST_AUTO_TEST_CASE(margin_of_two_soles_by_hand) {
  // The CoM is on the ground between them. 500 N push in the middle: friction of 350 N, moments of
  // 80 N·m about x and 50 N·m about y. About z, the soles give 25 N·m by themselves, and 35 N·m by
  // their friction ahead and back.
  const WrenchMargin margin = marginOf(twoSoles(), wrench(0., 0., 500.));
  BOOST_TEST(close(margin.margin, 50., 1e-8));
  BOOST_TEST(margin.axis == 4);
  // In centinewton metres those of the moments are a hundred times as large, and friction it is.
  const WrenchMargin other =
      marginOf(twoSoles(), wrench(10., 0., 500.), wrench(1., 1., 1., 100., 100., 100.));
  BOOST_TEST(close(other.margin, 340., 1e-8));
  BOOST_TEST(other.axis == 0);
  BOOST_TEST(other.sign == 1);
  // About z, towards which it turns already.
  const WrenchMargin yaw = marginOf(twoSoles(), wrench(0., 0., 500., 0., 0., -30.));
  BOOST_TEST(close(yaw.margin, 30., 1e-8));
  BOOST_TEST(yaw.axis == 5);
  BOOST_TEST(yaw.sign == -1);
}

BOOST_AUTO_TEST_CASE(palms_on_opposite_walls_give_any_wrench) {
  const auto about = [](double angle) {
    return Eigen::AngleAxisd(angle, Vector3d::UnitY()).toRotationMatrix();
  };
  const Contacts palms = {makeSole(soleSettings(), SE3(about(M_PI / 2.), Vector3d(-0.5, 0., 0.))),
                          makeSole(soleSettings(), SE3(about(-M_PI / 2.), Vector3d(0.5, 0., 0.)))};
  Random random(52);
  for (int trial = 0; trial < 20; ++trial) {
    const Vector6 total = random.vector(6, 500.);
    const WrenchMargin margin = marginOf(palms, total);
    BOOST_TEST(margin.margin == kInfinity);
    BOOST_TEST(margin.axis == -1);
    BOOST_TEST(margin.sign == 0);
  }
  // Of no wrench, too.
  BOOST_TEST(marginOf(palms, Vector6::Zero()).margin == kInfinity);
  // Without friction they only squeeze.
  const Contacts slippery = {makeSole(soleSettings(0.), palms[0]->getPose()),
                             makeSole(soleSettings(0.), palms[1]->getPose())};
  BOOST_TEST(close(marginOf(slippery, wrench(10., 0., 0.)).margin, 0., 1e-8));
}

BOOST_AUTO_TEST_CASE(what_contacts_cannot_give_at_all_leaves_no_margin) {
  // A point at the CoM gives forces only: the first moment is the first that it cannot give.
  const WrenchMargin point = marginOf({makePoint(Vector3d::Zero())}, wrench(0., 0., 500.));
  BOOST_TEST(close(point.margin, 0., 1e-8));
  BOOST_TEST(point.axis >= 3);
  BOOST_TEST(point.axis <= 5);
  BOOST_TEST(std::abs(point.sign) == 1);
  // Two points give no moment about the line between them, and two soles without width no other
  // one.
  const WrenchMargin line =
      marginOf({makePoint({0., 0.1, 0.}), makePoint({0., -0.1, 0.})}, wrench(0., 0., 500.));
  BOOST_TEST(close(line.margin, 0., 1e-8));
  BOOST_TEST(line.axis == 4);
  Contact6DSettings settings = soleSettings();
  settings.half_width = 0.;
  const WrenchMargin blade = marginOf({makeSole(settings, SE3::Identity())}, wrench(0., 0., 500.));
  BOOST_TEST(close(blade.margin, 0., 1e-8));
  BOOST_TEST(blade.axis == 3);
  const WrenchMargin ice =
      marginOf({makeSole(soleSettings(0.), SE3::Identity())}, wrench(0., 0., 500.));
  BOOST_TEST(close(ice.margin, 0., 1e-8));
  BOOST_TEST(ice.axis <= 1);
}

BOOST_AUTO_TEST_CASE(on_the_boundary_there_is_no_margin) {
  const WrenchMargin friction = marginOf({makeSole(Vector3d::Zero(), 0.5)}, wrench(0., -50., 100.));
  BOOST_TEST(close(friction.margin, 0., 1e-6));
  BOOST_TEST(friction.axis >= 0);
  BOOST_TEST(std::abs(friction.sign) == 1);
  const WrenchMargin nothing = marginOf(twoSoles(), Vector6::Zero());
  BOOST_TEST(nothing.margin == 0.);
  BOOST_TEST(nothing.axis >= 0);
  BOOST_TEST(std::abs(nothing.sign) == 1);
}

BOOST_AUTO_TEST_CASE(out_of_reach_the_margin_is_zero_and_without_an_axis) {
  WrenchDistribution distribution;
  const auto check = [&] {
    const WrenchMargin margin = distribution.computeMargin();
    BOOST_TEST(margin.margin == 0.);
    BOOST_TEST(margin.axis == -1);
    BOOST_TEST(margin.sign == 0);
  };
  BOOST_TEST(solve(distribution, twoSoles(), wrench(900., 0., 500.)) ==
             DistributionStatus::Relaxed);
  check();
  BOOST_TEST(solve(distribution, {}, wrench(0., 0., 500.)) == DistributionStatus::NoContact);
  check();
}

BOOST_AUTO_TEST_CASE(a_flight_has_no_margin) {
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, {}, Vector6::Zero()) == DistributionStatus::Solved);
  BOOST_TEST(distribution.computeMargin().margin == 0.);
}

BOOST_AUTO_TEST_CASE(without_an_answer_the_margin_is_nan) {
  WrenchDistribution distribution;
  const auto check = [&] {
    const WrenchMargin margin = distribution.computeMargin();
    BOOST_TEST(std::isnan(margin.margin));
    BOOST_TEST(margin.axis == -1);
    BOOST_TEST(margin.sign == 0);
  };
  check();
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  check();
  distribution.solve(wrench(0., 0., 500.));
  BOOST_TEST(distribution.computeMargin().margin > 0.);
  distribution.solve(Vector6::Constant(kNaN));
  check();
  distribution.solve(wrench(0., 0., 500.), kNaN);
  check();
}

BOOST_AUTO_TEST_CASE(within_the_margin_wrenches_are_solved_and_beyond_they_are_relaxed) {
  Random random(53);
  int bounded = 0;
  for (int trial = 0; trial < 200; ++trial) {
    const Contacts contacts = randomContacts(random);
    const Vector6 total = stackedProblem(contacts).ne * randomForces(random, contacts, 0.7);
    const Vector6 weights = randomWrenchWeights(random);
    BOOST_TEST_CONTEXT("problem " << trial) {
      const WrenchMargin margin = marginOf(contacts, total, weights);
      BOOST_TEST(margin.margin >= 0.);
      if (!(margin.margin > 1e-2) || margin.margin == kInfinity) continue;
      ++bounded;
      WrenchDistribution distribution;
      distribution.setWrenchWeights(weights);
      const auto statusAt = [&](int axis, double s) {
        return solve(distribution, contacts, total + s / weights[axis] * Vector6::Unit(axis));
      };
      BOOST_TEST(statusAt(margin.axis, margin.sign * 1.001 * margin.margin) ==
                 DistributionStatus::Relaxed);
      for (int axis = 0; axis < 6; ++axis)
        for (const double sign : {-1., 1.})
          BOOST_TEST(statusAt(axis, sign * 0.999 * margin.margin) == DistributionStatus::Solved);
    }
  }
  BOOST_TEST(bounded > 100);
}

BOOST_AUTO_TEST_CASE(the_margin_scales_with_wrench_and_weights) {
  Random random(54);
  for (int trial = 0; trial < 50; ++trial) {
    const Contacts contacts = randomContacts(random);
    const Vector6 total = stackedProblem(contacts).ne * randomForces(random, contacts, 0.7);
    const WrenchMargin one = marginOf(contacts, total);
    if (!(one.margin > 1e-2) || one.margin == kInfinity) continue;
    for (const double scale : {1e-6, 1e6}) {
      const WrenchMargin larger = marginOf(contacts, scale * total);
      BOOST_TEST(close(larger.margin / scale, one.margin, 1e-6));
      BOOST_TEST(larger.axis == one.axis);
      BOOST_TEST(larger.sign == one.sign);
      BOOST_TEST(close(marginOf(contacts, total, Vector6::Constant(scale)).margin / scale,
                       one.margin, 1e-6));
    }
  }
}

BOOST_AUTO_TEST_CASE(result_and_margin_are_those_of_the_last_solve) {
  WrenchDistribution distribution;
  for (const Vector6& total : {wrench(20., 0., 500., 1., 2., 3.), wrench(900., 0., 500.)}) {
    distribution.setWrenchWeights(Vector6::Ones());
    solve(distribution, twoSoles(), total);
    const VectorXd forces = distribution.result().forces();
    const double margin = distribution.computeMargin().margin;
    const auto check = [&] {
      BOOST_TEST(distribution.result().contacts.size() == 2u);
      BOOST_TEST(close(distribution.result().forces(), forces, 0.));
      BOOST_TEST(close(distribution.result().wrench_weights, Vector6::Ones(), 0.));
      BOOST_TEST(distribution.result().isOptimal());
      BOOST_TEST(distribution.computeMargin().margin == margin);
    };
    // What is set and added is for the next one.
    distribution.setWrenchWeights(wrench(1., 2., 3., 4., 5., 6.));
    check();
    distribution.add(*makeSole({1., 0., 0.}));
    check();
    distribution.forgetForces();
    check();
    distribution.clear();
    check();
    distribution.add(*makePoint({1., 0., 0.}));
    check();
  }
}

BOOST_AUTO_TEST_CASE(the_margin_changes_nothing) {
  WrenchDistribution distribution;
  solve(distribution, twoSoles(), wrench(20., 0., 500., 1., 2., 3.));
  const DistributionResult before = distribution.result();
  const double margin = distribution.computeMargin().margin;
  const DistributionResult& after = distribution.result();
  BOOST_TEST(close(after.forces(), before.forces(), 0.));
  BOOST_TEST(close(after.achieved, before.achieved, 0.));
  BOOST_TEST(close(after.wrench_multipliers, before.wrench_multipliers, 0.));
  BOOST_TEST(after.iterations == before.iterations);
  BOOST_TEST(after.isOptimal());
  BOOST_TEST(distribution.computeMargin().margin == margin);
  BOOST_TEST(distribution.solve(Vector6::Constant(kNaN)) == DistributionStatus::InvalidInput);
  BOOST_TEST(close(distribution.result().forces(), before.forces(), 0.));
}

// --- Slots -----------------------------------------------------------------------------------

namespace {

using Slots = std::vector<std::size_t>;

/// Solves for a wrench with the contacts in some slots, of which slot k is contact k's.
DistributionStatus solveSlots(WrenchDistribution& distribution, const Contacts& contacts,
                              const Slots& slots, const Vector6& wrench, double minimalScale = 0.) {
  distribution.clear();
  for (const std::size_t slot : slots) distribution.add(*contacts[slot], slot);
  return distribution.solve(wrench, minimalScale);
}

void reserveAll(WrenchDistribution& distribution, const Contacts& contacts) {
  for (std::size_t slot = 0; slot < contacts.size(); ++slot)
    distribution.reserve(*contacts[slot], slot);
}

/// Some of the slots of so many contacts, one or more, in any order.
Slots randomSlots(Random& random, std::size_t contacts) {
  Slots slots(contacts);
  std::iota(slots.begin(), slots.end(), 0);
  for (std::size_t k = contacts - 1; k > 0; --k)
    std::swap(slots[k], slots[static_cast<std::size_t>(random.integer(0, Index(k)))]);
  slots.resize(static_cast<std::size_t>(random.integer(1, Index(contacts))));
  return slots;
}

template <class Numbers>
bool sameBits(const Numbers& one, const Numbers& other) {
  using Scalar = typename Numbers::Scalar;
  return one.rows() == other.rows() && one.cols() == other.cols() &&
         (one.size() == 0 ||
          std::memcmp(one.data(), other.data(),
                      static_cast<std::size_t>(one.size()) * sizeof(Scalar)) == 0);
}

/// Whether two results are the same, bit for bit, in all that they hold.
boost::test_tools::predicate_result identical(const DistributionResult& one,
                                              const DistributionResult& other) {
  boost::test_tools::predicate_result result(false);
  const auto say = [&](const char* what) { result.message() << "another " << what; };
  if (one.status != other.status)
    say("status");
  else if (one.iterations != other.iterations)
    result.message() << one.iterations << " iterations instead of " << other.iterations;
  else if (!sameBits(one.wrench, other.wrench) || !sameBits(one.achieved, other.achieved) ||
           !sameBits(one.residual, other.residual))
    say("wrench");
  else if (!sameBits(Vector2d(one.scale, one.cost), Vector2d(other.scale, other.cost)))
    say("scale or cost");
  else if (!sameBits(one.wrench_multipliers, other.wrench_multipliers))
    say("multiplier");
  else if (one.contacts.size() != other.contacts.size())
    say("number of contacts");
  else
    result = true;
  if (!result) return result;
  for (std::size_t k = 0; k < one.contacts.size(); ++k) {
    const auto &a = one.contacts[k], &b = other.contacts[k];
    if (sameBits(a.A, b.A) && sameBits(a.weights, b.weights) && sameBits(a.NE, b.NE) &&
        sameBits(a.force, b.force) && sameBits(a.multipliers, b.multipliers) &&
        sameBits(a.relaxation_multipliers, b.relaxation_multipliers) &&
        sameBits(a.active, b.active))
      continue;
    result = false;
    result.message() << "another contact " << k;
  }
  return result;
}

}  // namespace

BOOST_AUTO_TEST_CASE(slots_change_nothing_but_the_order) {
  Random random(201);
  for (int trial = 0; trial < 100; ++trial) {
    const Contacts contacts = randomContacts(random);
    WrenchDistribution slotted, plain;
    reserveAll(slotted, contacts);
    for (int step = 0; step < 5; ++step) {
      const Slots slots = randomSlots(random, contacts.size());
      Contacts chosen;
      for (const std::size_t slot : slots) chosen.push_back(contacts[slot]);
      const Vector6 total = wrench(0., 0., 500.) + Vector6(random.vector(6, step < 3 ? 50. : 500.));
      slotted.setWarmStart(false);
      plain.setWarmStart(false);
      solveSlots(slotted, contacts, slots, total);
      solve(plain, chosen, total);
      // The contacts of the result are those that were added, in that order.
      BOOST_TEST(identical(slotted.result(), plain.result()));
      for (std::size_t k = 0; k < slots.size(); ++k)
        BOOST_TEST(close(slotted.result().contacts[k].NE, chosen[k]->ne_A(), 0.));
      // And so they are with warm start, but for rounding.
      slotted.setWarmStart(true);
      BOOST_TEST(solveSlots(slotted, contacts, slots, total) == plain.result().status);
      BOOST_TEST(close(slotted.result().forces() / slotted.result().scale,
                       plain.result().forces() / plain.result().scale, 1e-9));
    }
  }
}

BOOST_AUTO_TEST_CASE(forces_are_kept_by_order_and_slot) {
  const Contacts contacts = {makeSole({0., 0.1, 0.}), makeSole({0., -0.1, 0.}),
                             makeSole({0.2, 0., 0.})};
  const Vector6 total = wrench(20., 0., 500., 1., 2., 3.), none = Vector6::Constant(kNaN);
  WrenchDistribution distribution;
  reserveAll(distribution, contacts);
  const auto kept = [&](const Slots& before, const Slots& after) {
    BOOST_TEST(solveSlots(distribution, contacts, before, total) == DistributionStatus::Solved);
    const VectorXd forces = distribution.result().forces();
    BOOST_TEST(solveSlots(distribution, contacts, after, none) == DistributionStatus::InvalidInput);
    if (isZero(distribution.result().forces())) return false;
    BOOST_TEST(close(distribution.result().forces(), forces, 0.));
    return true;
  };
  BOOST_TEST(kept({0, 1}, {0, 1}));
  BOOST_TEST(kept({2, 1, 0}, {2, 1, 0}));
  BOOST_TEST(!kept({0, 1}, {1, 0}));
  BOOST_TEST(!kept({0, 1}, {0, 2}));  // with the same matrices
  BOOST_TEST(!kept({0, 1}, {0, 1, 2}));
  BOOST_TEST(!kept({0, 1, 2}, {0, 1}));
}

BOOST_AUTO_TEST_CASE(the_contact_of_a_slot_may_become_another) {
  Random random(202);
  WrenchDistribution distribution;
  for (int trial = 0; trial < 100; ++trial) {
    const Contacts contacts = randomContacts(random);  // others than before, of any size
    const Vector6 total = random.vector(6, 500.);
    const auto status = solve(distribution, contacts, total);
    WrenchDistribution fresh;
    BOOST_TEST(solve(fresh, contacts, total) == status);
    BOOST_TEST(close(distribution.result().forces() / distribution.result().scale,
                     fresh.result().forces() / fresh.result().scale, 1e-9));
    BOOST_TEST(distribution.result().isOptimal());
  }
}

BOOST_AUTO_TEST_CASE(mistakes_with_slots_are_named_and_change_nothing) {
  const Contacts contacts = {makeSole({0., 0.1, 0.}), makeSole({0., -0.1, 0.})};
  const auto point = makePoint(Vector3d(0., 0., 0.));
  WrenchDistribution distribution;
  const auto check = [&](auto mistake, std::initializer_list<std::string> words) {
    const DistributionResult before = distribution.result();
    BOOST_TEST(throws<std::invalid_argument>(mistake, words));
    BOOST_TEST(identical(distribution.result(), before));
  };
  const auto add = [&](const ContactBase& contact, std::size_t slot) {
    return [&distribution, &contact, slot] { distribution.add(contact, slot); };
  };
  const auto reserve = [&](const ContactBase& contact, std::size_t slot) {
    return [&distribution, &contact, slot] { distribution.reserve(contact, slot); };
  };
  const Contact6D empty;
  // There is none yet: the first that is free is 0.
  check(add(*point, 1), {"slot", "0", "1"});
  check(reserve(*point, 7), {"slot", "0", "7"});
  check(reserve(empty, 0), {"initialised"});
  check(add(empty, 0), {"initialised"});
  distribution.add(*contacts[0], 0);
  distribution.add(*contacts[1], 1);
  check(add(*point, 3), {"slot", "2", "3"});
  check(add(*point, 0), {"slot", "0", "taken"});
  check(add(*contacts[1], 1), {"slot", "1", "taken"});
  check(reserve(empty, 2), {"initialised"});
  check(reserve(empty, 1), {"initialised"});
  check([&] { distribution.add(*point, std::size_t(-1)); }, {"slot", "2"});
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(distribution.result().contacts.size() == 2u);
  BOOST_TEST(close(distribution.result().forces()[2], 250., 1e-10));
  BOOST_TEST(close(distribution.result().forces()[8], 250., 1e-10));
  // After an answer, too, which is kept.
  check(add(*point, 1), {"slot", "1", "taken"});
  check(add(*point, 4), {"slot", "2", "4"});
  BOOST_TEST(distribution.solve(Vector6::Constant(kNaN)) == DistributionStatus::InvalidInput);
  BOOST_TEST(close(distribution.result().forces()[2], 250., 1e-10));
  // Without a slot, a contact's position is its slot, taken or not.
  distribution.clear();
  distribution.add(*contacts[0], 1);
  check([&] { distribution.add(*contacts[1]); }, {"slot", "1", "taken"});
  distribution.add(*contacts[1], 0);
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.result().contacts[0].NE, contacts[0]->ne_A(), 0.));
}

BOOST_AUTO_TEST_CASE(reserving_changes_no_problem) {
  const Contacts contacts = {makeSole({0., 0.1, 0.}), makeSole({0., -0.1, 0.}),
                             makePoint(Vector3d(0.3, 0., 0.))};
  WrenchDistribution distribution, plain;
  reserveAll(distribution, contacts);
  BOOST_TEST(distribution.result().contacts.empty());
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::NoContact);
  distribution.add(*contacts[0], 0);
  plain.add(*contacts[0]);
  distribution.reserve(*contacts[2], 2);
  distribution.reserve(*contacts[2], 3);
  plain.solve(wrench(10., 0., 500.));
  distribution.solve(wrench(10., 0., 500.));
  BOOST_TEST(identical(distribution.result(), plain.result()));
  // What was never placed can be reserved, and not added.
  const Contact6D unplaced(soleSettings());
  distribution.reserve(unplaced, 4);
  BOOST_TEST(throws<NotReadyError>([&] { distribution.add(unplaced, 4); }, {"updateNewtonEuler"}));
  BOOST_TEST(identical(distribution.result(), plain.result()));
}

BOOST_AUTO_TEST_CASE(a_contact_that_was_added_is_not_changed_by_reserving_its_slot) {
  // What is added is copied. It may be refused, too.
  const auto sole = makeSole({0., 0., 0.});
  for (const std::shared_ptr<ContactBase>& other :
       {makeSole({0., 0., 0.}, 0.1), makePoint(Vector3d(0., 0., 0.))}) {
    WrenchDistribution distribution, plain;
    distribution.add(*sole, 0);
    try {
      distribution.reserve(*other, 0);
    } catch (const std::invalid_argument&) {
    }
    plain.add(*sole);
    distribution.solve(wrench(100., 0., 500.));
    plain.solve(wrench(100., 0., 500.));
    BOOST_TEST(identical(distribution.result(), plain.result()));
  }
}

BOOST_AUTO_TEST_CASE(reset_leaves_settings_only) {
  WrenchDistribution distribution;
  distribution.setWrenchWeights(Vector6::Constant(2.));
  distribution.setWarmStart(false);
  distribution.setMaximalIterations(17);
  solve(distribution, twoSoles(), wrench(0., 0., 500.));
  distribution.reset();
  BOOST_TEST(distribution.result().contacts.empty());
  BOOST_TEST(std::isnan(distribution.result().scale));
  BOOST_TEST(throws<std::invalid_argument>(
      [&] {
        distribution.add(*makeSole({0., 0., 0.}), 1);
      },
      {"slot", "0", "1"}));
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::NoContact);
  BOOST_TEST(close(distribution.getWrenchWeights(), Vector6::Constant(2.), 0.));
  BOOST_TEST(!distribution.getWarmStart());
  BOOST_TEST(distribution.getMaximalIterations() == 17);
}

// --- Warm start ------------------------------------------------------------------------------

namespace {

/// Where the wrenches of a walk are.
enum class Stance { Inside, Facet, Corner, Anywhere, Thrown };

/// A force of a contact: within its inequalities, on one of them, or in a corner of them all.
VectorXd forceAt(Random& random, const ContactBase& contact, Stance stance) {
  const VectorXd inside = randomForce(random, contact, 0.95), bound = [&] {
    const MatrixXd A = stackedProblem(Contacts{contact.clone()}).inequalities;
    // By how much each component may be, for this normal force.
    VectorXd bound = VectorXd::Zero(contact.cols());
    for (Index row = 0; row < A.rows(); ++row)
      for (Index i = 0; i < A.cols(); ++i)
        if (i != 2 && A(row, i) > 0.) bound[i] = -A(row, 2) * inside[2] / A(row, i);
    return bound;
  }();
  VectorXd force = inside;
  const Index facet = random.integer(0, contact.cols() - 1);
  for (Index i = 0; i < contact.cols(); ++i)
    if (i != 2 && (stance == Stance::Corner || (stance == Stance::Facet && i == facet)))
      force[i] = inside[i] < 0. ? -bound[i] : bound[i];
  return force;
}

/// A robot that stands, walks and falls: contacts that are activated and deactivated, and move a
/// little, and wrenches that change a little, or jump.
class Walk {
 public:
  Walk(unsigned seed, bool degenerate) : random_(seed), degenerate_(degenerate) {
    contacts_ = randomContacts(random_);
    if (!degenerate) {  // with weights that are equal, friction and extent
      for (auto& contact : contacts_) {
        const SE3 pose(randomTilt(random_, 0.3), random_.vector3(0.4));
        contact = random_.coin() ? makeSole(soleSettings(), pose) : makePoint(pose);
      }
    }
    for (const auto& contact : contacts_) poses_.push_back(contact->getPose());
    slots_.resize(contacts_.size());
    std::iota(slots_.begin(), slots_.end(), 0);
    wrench_weights_ = degenerate ? Vector6(Eigen::pow(10., random_.vector(6, 0.5).array()))
                                 : Vector6(Vector6::Ones());
    jump();
  }

  void step() {
    if (random_.integer(0, 9) == 0) {
      const auto slot = static_cast<std::size_t>(random_.integer(0, Index(contacts_.size()) - 1));
      const auto active = std::find(slots_.begin(), slots_.end(), slot);
      if (active == slots_.end())
        slots_.push_back(slot);
      else if (slots_.size() > 1)
        slots_.erase(active);
    }
    for (std::size_t slot = 0; slot < contacts_.size(); ++slot) {
      if (random_.coin()) poses_[slot].translation() += random_.vector3(1e-3);
      contacts_[slot]->updateNewtonEuler(Vector3d::UnitZ(), poses_[slot]);
    }
    if (random_.integer(0, 9) == 0)
      jump();
    else if ((stance == Stance::Facet || stance == Stance::Corner) && random_.coin())
      standThere();
    else
      total += random_.vector(6, 3.);
  }

  DistributionStatus solve(WrenchDistribution& distribution) const {
    distribution.setWrenchWeights(wrench_weights_);
    return solveSlots(distribution, contacts_, slots_, total);
  }

  const Contacts& contacts() const { return contacts_; }

  Stance stance = Stance::Inside;
  Vector6 total = Vector6::Zero();

 private:
  void jump() {
    stance = static_cast<Stance>(random_.integer(0, 4));
    if (!degenerate_ && (stance == Stance::Facet || stance == Stance::Corner))
      stance = Stance::Inside;
    if (stance == Stance::Anywhere || stance == Stance::Thrown)
      total = wrench(0., 0., 500.) +
              Vector6(random_.vector(6, stance == Stance::Anywhere ? 300. : 1000.));
    else
      standThere();
  }

  void standThere() {
    total.setZero();
    for (const std::size_t slot : slots_)
      total += contacts_[slot]->ne_A() * forceAt(random_, *contacts_[slot], stance);
  }

  Random random_;
  bool degenerate_;
  Contacts contacts_;
  std::vector<SE3> poses_;
  Slots slots_;
  Vector6 wrench_weights_;
};

}  // namespace

BOOST_AUTO_TEST_CASE(warm_start_is_automatic_and_can_be_switched_off) {
  WrenchDistribution distribution;
  BOOST_TEST(distribution.getWarmStart());
  distribution.setWarmStart(false);
  BOOST_TEST(!distribution.getWarmStart());
  BOOST_TEST(!WrenchDistribution(distribution).getWarmStart());
  BOOST_TEST(WrenchDistribution().getWarmStart());
  distribution.setWarmStart(true);
  BOOST_TEST(distribution.getWarmStart());
}

BOOST_AUTO_TEST_CASE(warm_start_never_changes_an_answer) {
  int solved = 0, relaxed = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    Walk walk(300 + seed, seed % 4 > 0);
    WrenchDistribution warm, cold;
    cold.setWarmStart(false);
    reserveAll(warm, walk.contacts());
    reserveAll(cold, walk.contacts());
    for (int step = 0; step < 60; ++step) {
      walk.step();
      const auto status = walk.solve(warm);
      BOOST_TEST_CONTEXT("walk " << seed << ", step " << step) {
        BOOST_TEST(walk.solve(cold) == status);
        const DistributionResult &result = warm.result(), &expected = cold.result();
        const double scale = result.scale;
        BOOST_TEST(close(result.forces() / scale, expected.forces() / scale, 1e-9));
        BOOST_TEST(close(result.achieved / scale, expected.achieved / scale, 1e-9));
        BOOST_TEST(close(result.residual / scale, expected.residual / scale, 1e-9));
        BOOST_TEST(close(result.cost / (scale * scale), expected.cost / (scale * scale), 1e-9));
        BOOST_TEST(result.isOptimal());
        BOOST_TEST(expected.isOptimal());
      }
      (status == DistributionStatus::Solved ? solved : relaxed) += 1;
    }
  }
  BOOST_TEST(solved > 3000);
  BOOST_TEST(relaxed > 3000);
}

BOOST_AUTO_TEST_CASE(warm_start_saves_iterations) {
  long warm_iterations = 0, cold_iterations = 0, all = 0, at_once = 0, degenerate = 0,
       degenerate_at_once = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    const bool is_degenerate = seed % 2 == 1;
    Walk walk(600 + seed, is_degenerate);
    WrenchDistribution warm, cold;
    cold.setWarmStart(false);
    reserveAll(warm, walk.contacts());
    reserveAll(cold, walk.contacts());
    for (int step = 0; step < 40; ++step) {
      walk.step();
      walk.solve(warm);
      walk.solve(cold);
      warm_iterations += warm.result().iterations;
      cold_iterations += cold.result().iterations;
      if (countAskedSolvers(cold.result()) > 1) continue;
      // Nor does an answer count from the last one that is so close to the boundary.
      const Vector6& weights = cold.result().wrench_weights;
      const double distance =
          weights.cwiseProduct(cold.result().residual).norm() / cold.result().scale;
      if (distance > 1e-12 && distance < 1e-4 * weights.maxCoeff() / weights.minCoeff()) continue;
      // The same again: the state that led to an answer is where the next solve() begins. Now and
      // then the robust solver was asked for the first one, of which there is no such state.
      const VectorXd forces = warm.result().forces() / warm.result().scale;
      walk.solve(warm);
      const int again = warm.result().iterations;
      BOOST_TEST(close(warm.result().forces() / warm.result().scale, forces, 1e-9));
      walk.solve(warm);
      if (is_degenerate) {
        ++degenerate;
        if (again <= 2) ++degenerate_at_once;
      } else {
        ++all;
        if (again <= 1) ++at_once;
        BOOST_TEST(warm.result().iterations <= 2);
      }
    }
  }
  BOOST_TEST(warm_iterations < 0.75 * cold_iterations);
  BOOST_TEST(all > 3000);
  BOOST_TEST(at_once > 0.995 * all);
  // Where components of the answer are just at their bounds, rounding may take some of them for
  // another state.
  BOOST_TEST(degenerate > 3000);
  BOOST_TEST(degenerate_at_once > 0.9 * degenerate);
  BOOST_TEST_MESSAGE(warm_iterations << " iterations instead of " << cold_iterations << "; again "
                                     << at_once << " of " << all << " and " << degenerate_at_once
                                     << " of " << degenerate << " in one step");
}

BOOST_AUTO_TEST_CASE(a_slow_walk_takes_hardly_more_than_one_iteration) {
  // At the limit of friction, and beyond it: at a kilohertz nothing changes much.
  for (const double push : {0., 200., 400.}) {
    const Contacts contacts = {makeSole({0., 0.1, -1.}), makeSole({0., -0.1, -1.})};
    WrenchDistribution warm, cold;
    cold.setWarmStart(false);
    int warm_iterations = 0, cold_iterations = 0;
    const int steps = 1000;
    for (int step = 0; step < steps; ++step) {
      const double phase = 2. * M_PI * step / steps;
      const Vector6 total = wrench(push, 30. * std::sin(phase), 500. + 50. * std::cos(phase),
                                   10. * std::cos(phase), -push + 10. * std::sin(phase), 5.);
      solve(warm, contacts, total);
      solve(cold, contacts, total);
      BOOST_TEST(warm.result().status == cold.result().status);
      warm_iterations += warm.result().iterations;
      cold_iterations += cold.result().iterations;
    }
    BOOST_TEST(warm_iterations < 1.1 * steps);
    BOOST_TEST(warm_iterations <= cold_iterations);
    BOOST_TEST_MESSAGE("pushed by " << push << " N: " << warm_iterations << " instead of "
                                    << cold_iterations);
  }
}

BOOST_AUTO_TEST_CASE(without_warm_start_nothing_before_matters) {
  // Bit for bit, by whichever solver.
  ProblemGenerator generator(203);
  WrenchDistribution used;
  used.setWarmStart(false);
  std::array<int, 4> asked{};
  for (int trial = 0; trial < 3000; ++trial) {
    const dynacom_tests::Problem problem = generator.next();
    const Contacts contacts = problem.makeContacts();
    // Now and then with an answer or a failure between.
    if (trial % 5 == 0) solve(used, contacts, Vector6::Constant(kNaN));
    used.setWarmStart(trial % 7 == 0);
    if (trial % 7 == 0) solve(used, contacts, problem.wrench.reverse());
    used.setWarmStart(false);
    WrenchDistribution fresh, warm;
    for (WrenchDistribution* distribution : {&used, &fresh, &warm}) {
      distribution->setWrenchWeights(problem.wrench_weights);
      solve(*distribution, contacts, problem.wrench, problem.minimal_scale);
    }
    BOOST_TEST_CONTEXT("problem " << trial) {
      BOOST_TEST(identical(used.result(), fresh.result()));
      BOOST_TEST(identical(warm.result(), fresh.result()));
    }
    if (!isZero(problem.wrench))
      ++asked[static_cast<std::size_t>(countAskedSolvers(fresh.result()))];
  }
  BOOST_TEST(asked[0] == 0);
  BOOST_TEST(asked[1] > 1000);
  BOOST_TEST(asked[2] > 10);
  BOOST_TEST(asked[3] > 50);
}

BOOST_AUTO_TEST_CASE(the_same_history_gives_the_same_bits) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    Walk walk(900 + seed, seed % 2 == 0);
    WrenchDistribution one, other;
    reserveAll(one, walk.contacts());
    reserveAll(other, walk.contacts());
    for (int step = 0; step < 40; ++step) {
      walk.step();
      walk.solve(one);
      walk.solve(other);
      BOOST_TEST(identical(one.result(), other.result()));
      if (step == 20) {
        // A copy goes on as the original would.
        WrenchDistribution copy = one;
        other = std::move(copy);
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(where_contacts_are_others_nothing_before_matters) {
  Random random(204);
  int answers = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Contacts contacts;
    for (int i = 0; i < 3; ++i)
      contacts.push_back(
          makeSole(soleSettings(),
                   SE3(randomTilt(random, 0.3), Vector3d(0.3 * i, 0., -1.) + random.vector3(0.1))));
    WrenchDistribution used, fresh;
    reserveAll(used, contacts);
    reserveAll(fresh, contacts);
    Vector6 total = Vector6::Zero();
    for (const auto& contact : contacts)
      total += contact->ne_A() * forceAt(random, *contact, Stance::Facet);
    solveSlots(used, contacts, {0, 1, 2}, total);
    // Without one of them, the others do what they would do at first.
    const auto away = static_cast<std::size_t>(random.integer(0, 2));
    const Slots others = {(away + 1) % 3, (away + 2) % 3};
    solveSlots(used, contacts, others, total);
    solveSlots(fresh, contacts, others, total);
    BOOST_TEST(identical(used.result(), fresh.result()));
    answers += used.result().isOptimal();
  }
  BOOST_TEST(answers == 200);
}

// --- The iteration cap -----------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(the_number_of_iterations_is_a_setting) {
  WrenchDistribution distribution;
  BOOST_TEST(distribution.getMaximalIterations() == WrenchDistribution::kMaximalIterations);
  distribution.setMaximalIterations(1);
  BOOST_TEST(distribution.getMaximalIterations() == 1);
  for (const int bad : {0, -1, std::numeric_limits<int>::min()}) {
    BOOST_TEST(throws<std::invalid_argument>([&] { distribution.setMaximalIterations(bad); },
                                             {"maximalIterations", "> 0", std::to_string(bad)}));
    BOOST_TEST(distribution.getMaximalIterations() == 1);
  }
  BOOST_TEST(WrenchDistribution(distribution).getMaximalIterations() == 1);
  distribution.setMaximalIterations(std::numeric_limits<int>::max());
  BOOST_TEST(solve(distribution, twoSoles(), wrench(900., 0., 500.)) ==
             DistributionStatus::Relaxed);
}

BOOST_AUTO_TEST_CASE(no_more_iterations_are_taken_than_are_allowed) {
  ProblemGenerator generator(205);
  std::array<int, 4> asked{};
  long answers = 0, failures = 0;
  for (int trial = 0; trial < 700; ++trial) {
    const dynacom_tests::Problem problem = generator.next();
    const Contacts contacts = problem.makeContacts();
    WrenchDistribution distribution;
    distribution.setWarmStart(trial % 2 == 0);
    distribution.setWrenchWeights(problem.wrench_weights);
    const auto status = solve(distribution, contacts, problem.wrench, problem.minimal_scale);
    const DistributionResult right = distribution.result();
    BOOST_TEST(right.iterations <= WrenchDistribution::kMaximalIterations);
    if (right.iterations < 3) continue;
    ++asked[static_cast<std::size_t>(countAskedSolvers(right))];

    Vector6 easy = Vector6::Zero();
    for (const auto& contact : contacts) easy += right.scale * contact->ne_A().col(2);
    for (int limit = 1; limit <= 40; ++limit) {
      distribution.setMaximalIterations(WrenchDistribution::kMaximalIterations);
      solve(distribution, contacts, easy, problem.minimal_scale);
      const VectorXd before = distribution.result().forces();
      distribution.setMaximalIterations(limit);
      solve(distribution, contacts, problem.wrench, problem.minimal_scale);
      const DistributionResult& result = distribution.result();
      BOOST_TEST_CONTEXT("problem " << trial << ", limit " << limit) {
        BOOST_TEST(result.iterations <= limit);
        if (result.status == DistributionStatus::NumericalFailure) {
          ++failures;
          BOOST_TEST(sameBits(result.forces(), before));
          checkNoAnswer(result);
          if (!distribution.getWarmStart()) BOOST_TEST(limit < right.iterations);
        } else {
          ++answers;
          BOOST_TEST(result.status == status);
          BOOST_TEST(result.isOptimal());
          if (problem.nearly_parallel || problem.weights_far_apart) continue;
          BOOST_TEST(check(problem, result).error == "");
          BOOST_TEST(close(result.forces() / result.scale, right.forces() / right.scale, 1e-7));
        }
      }
    }
  }
  BOOST_TEST(asked[1] > 200);
  BOOST_TEST(asked[2] + asked[3] > 15);
  BOOST_TEST(answers > 10000);
  BOOST_TEST(failures > 2000);
}

BOOST_AUTO_TEST_CASE(under_any_cap_a_warm_start_answers_where_a_cold_one_does) {
  long attempts_in_vain = 0, answers = 0, only_warm = 0, failures = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    Walk walk(700 + seed, seed % 2 == 1);
    WrenchDistribution warm, cold;
    cold.setWarmStart(false);
    reserveAll(warm, walk.contacts());
    reserveAll(cold, walk.contacts());
    for (int step = 0; step < 40; ++step) {
      walk.step();
      for (int limit = 1; limit <= 8; ++limit) {
        WrenchDistribution limited = warm, limited_cold = cold;
        for (WrenchDistribution* one : {&limited, &limited_cold}) one->setMaximalIterations(limit);
        const DistributionStatus status = walk.solve(limited), expected = walk.solve(limited_cold);
        const int iterations = limited.result().iterations;
        BOOST_TEST_CONTEXT("walk " << seed << ", step " << step << ", limit " << limit) {
          BOOST_TEST(iterations <= limit);
          BOOST_TEST(limited_cold.result().iterations <= limit);
          if (expected == DistributionStatus::NumericalFailure) {
            (status == expected ? failures : only_warm) += 1;
          } else {
            ++answers;
            if (iterations > limited_cold.result().iterations) ++attempts_in_vain;
            BOOST_TEST(status == expected);
            const double scale = limited.result().scale;
            BOOST_TEST(close(limited.result().forces() / scale,
                             limited_cold.result().forces() / scale, 1e-9));
          }
        }
      }
      walk.solve(warm);
      walk.solve(cold);
    }
  }
  BOOST_TEST(attempts_in_vain > 500);
  BOOST_TEST(answers > 5000);
  BOOST_TEST(only_warm > 500);
  BOOST_TEST(failures > 500);
}

BOOST_AUTO_TEST_CASE(what_is_proved_is_an_answer_though_there_was_no_time_for_more_digits) {
  // Of contacts that are nearly parallel, one in thousands needs all digits that there are.
  ProblemGenerator generator(206);
  int proofs = 0, cut_short = 0;
  for (int trial = 0; trial < 30000; ++trial) {
    const Problem made = generator.next();
    if (!made.nearly_parallel || made.weights_far_apart) continue;
    const Contacts contacts = made.makeContacts();
    const Vector6& total = made.wrench;
    WrenchDistribution distribution;
    distribution.setWarmStart(false);
    solve(distribution, contacts, total);
    const DistributionResult right = distribution.result();
    if (countAskedSolvers(right) != 3) continue;

    // What the solver before the last one says.
    DistributionResult proof = right;
    const Vector6 weights = Vector6::Ones();
    internal::TwoStageSolver<double> solver;
    solver.setProblem(proof.contacts, weights);
    proof.status = solver.solve(total / right.scale, WrenchDistribution::kMaximalIterations);
    if (proof.status == DistributionStatus::NumericalFailure) continue;
    solver.writeAnswer(proof, right.scale, 1.);
    proof.achieved.setZero();
    for (const auto& contact : proof.contacts) proof.achieved += contact.NE * contact.force;
    proof.residual = total - proof.achieved;
    if (!proof.isOptimal(1e-8)) continue;

    for (const int cap : {20, 50}) {
      distribution.setMaximalIterations(cap);
      solve(distribution, contacts, total);
      const DistributionResult& result = distribution.result();
      BOOST_TEST(result.iterations <= cap);
      if (result.status == DistributionStatus::NumericalFailure) {
        // Then there was no time for the proof: what led to it is more than the cap.
        DistributionProblem problem;
        for (const auto& contact : right.contacts) problem.contacts.push_back(describeBox(contact));
        problem.wrench = total;
        DistributionSolver first;
        first.setMaximalIterations(cap);
        BOOST_TEST(first.solve(problem).iterations + solver.iterations() > cap);
        continue;
      }
      ++proofs;
      if (right.iterations > cap) ++cut_short;
      BOOST_TEST(result.isOptimal(1e-8));
      BOOST_TEST(close(result.forces() / right.scale, right.forces() / right.scale, 1e-3));
    }
  }
  BOOST_TEST(proofs > 1);
  BOOST_TEST(cut_short > 0);
  BOOST_TEST_MESSAGE(proofs << " proofs, " << cut_short << " of them instead of more digits");
}

BOOST_AUTO_TEST_CASE(without_an_answer_before_forces_are_zero_when_iterations_are_used_up) {
  WrenchDistribution distribution;
  distribution.setMaximalIterations(1);
  const Vector6 total = wrench(900., 300., 500., 50., 60., 70.);
  BOOST_TEST(solve(distribution, twoSoles(), total) == DistributionStatus::NumericalFailure);
  BOOST_TEST(distribution.result().iterations == 1);
  BOOST_TEST(isZero(distribution.result().forces()));
  checkNoAnswer(distribution.result());
  BOOST_TEST(std::isnan(distribution.computeMargin().margin));
  // With more, there is one, and it is kept while contacts are the same.
  distribution.setMaximalIterations(WrenchDistribution::kMaximalIterations);
  BOOST_TEST(solve(distribution, twoSoles(), total) == DistributionStatus::Relaxed);
  const VectorXd forces = distribution.result().forces();
  BOOST_TEST(distribution.result().isOptimal());
  distribution.setMaximalIterations(1);
  distribution.setWarmStart(false);
  BOOST_TEST(solve(distribution, twoSoles(), total) == DistributionStatus::NumericalFailure);
  BOOST_TEST(close(distribution.result().forces(), forces, 0.));
  BOOST_TEST(close(distribution.result().residual, total - distribution.result().achieved));
  // The margin is not limited.
  BOOST_TEST(solve(distribution, twoSoles(), wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(distribution.result().iterations == 1);
  BOOST_TEST(distribution.computeMargin().margin > 10.);
}
