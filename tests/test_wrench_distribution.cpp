// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE wrench_distribution
#include <Eigen/QR>
#include <limits>
#include <sstream>
#include <utility>
#include <vector>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

using Contacts = std::vector<std::shared_ptr<ContactBase>>;

std::shared_ptr<ContactBase> makeSole(const Vector3d& position, double mu = 0.7,
                                      const Vector6& weights = Vector6::Ones()) {
  Contact6DSettings settings;
  settings.mu = mu;
  settings.gu = 0.05;
  settings.half_length = 0.1;
  settings.half_width = 0.06;
  settings.weights = weights;
  settings.frame_name = "sole";
  auto contact = std::make_shared<Contact6D>(settings);
  contact->updateNewtonEuler(Vector3d::Zero(), SE3(Matrix3d::Identity(), position));
  return contact;
}

std::shared_ptr<ContactBase> makePoint(const Vector3d& position, double mu = 0.7) {
  ContactPointSettings settings;
  settings.mu = mu;
  settings.frame_name = "point";
  auto contact = std::make_shared<ContactPoint>(settings);
  contact->updateNewtonEuler(Vector3d::Zero(), SE3(Matrix3d::Identity(), position));
  return contact;
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

struct Problem {
  MatrixXd ne, inequalities;  ///< NE λ = w, [U; C] λ ≤ [u; c]
  VectorXd limits;            ///< [u; c], which is zero for contacts of the library
  VectorXd q;                 ///< the diagonal of Q, weights squared
};

/// The problem of equations (9-13), written down anew from the contacts' own matrices.
Problem stackedProblem(const Contacts& contacts) {
  Index cols = 0, rows = 0;
  for (const auto& contact : contacts) {
    cols += contact->cols();
    rows += contact->uni_rows() + contact->fri_rows();
  }
  Problem problem{MatrixXd::Zero(6, cols), MatrixXd::Zero(rows, cols), VectorXd::Zero(rows),
                  VectorXd::Zero(cols)};
  Index col = 0, row = 0;
  for (const auto& contact : contacts) {
    problem.ne.middleCols(col, contact->cols()) = contact->ne_A();
    problem.q.segment(col, contact->cols()) = contact->reg_A().cwiseAbs2();
    for (const auto& [block, limit] : {std::make_pair(contact->uni_A(), contact->uni_b()),
                                       std::make_pair(contact->fri_A(), contact->fri_b())}) {
      problem.inequalities.block(row, col, block.rows(), block.cols()) = block;
      problem.limits.segment(row, block.rows()) = limit;
      row += block.rows();
    }
    col += contact->cols();
  }
  return problem;
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

/// By how much forces miss the conditions of Karush, Kuhn and Tucker, relative to the cost's
/// gradient: Q λ + NEᵀ ν + Aᵀ μ = 0 with μ ≥ 0 on the inequalities that are tight, and 0 elsewhere.
double optimalityGap(const Problem& problem, const VectorXd& forces, Index* tight = nullptr) {
  const VectorXd slack = problem.limits - problem.inequalities * forces;
  std::vector<Index> rows;
  for (Index i = 0; i < slack.size(); ++i)
    if (slack[i] < 1e-8 * forces.cwiseAbs().maxCoeff()) rows.push_back(i);
  if (tight) *tight = static_cast<Index>(rows.size());

  // ν is free: what it cannot reach is the null space of NE, and only there must μ help.
  const Eigen::HouseholderQR<MatrixXd> qr(problem.ne.transpose());
  const Index free = problem.ne.cols() - 6;
  const MatrixXd nullSpace = MatrixXd(qr.householderQ()).rightCols(free);
  const VectorXd gradient = problem.q.cwiseProduct(forces);
  MatrixXd normals(free, static_cast<Index>(rows.size()));
  for (std::size_t i = 0; i < rows.size(); ++i)
    normals.col(static_cast<Index>(i)) =
        -nullSpace.transpose() * problem.inequalities.row(rows[i]).transpose();
  return nonNegativeLeastSquares(normals, nullSpace.transpose() * gradient) / gradient.norm();
}

DistributionStatus solve(WrenchDistribution& distribution, const Contacts& contacts,
                         const Vector6& wrench) {
  distribution.clear();
  for (const auto& contact : contacts) distribution.add(*contact);
  return distribution.solve(wrench);
}

DistributionStatus solve(const Contacts& contacts, const Vector6& wrench) {
  WrenchDistribution distribution;
  return solve(distribution, contacts, wrench);
}

bool isZero(const VectorXd& forces) { return (forces.array() == 0.).all(); }

/// Left and right sole, the CoM between them on the ground.
Contacts twoSoles() { return {makeSole({0., 0.1, 0.}), makeSole({0., -0.1, 0.})}; }

/// A contact of a kind that the library does not know: a magnet, which holds against a pull.
class Magnet : public ContactBase {
 public:
  Magnet(const Vector3d& position, double pull) {
    reset(1, 4, 6);
    uni_A_ << 0, 0, -1, 0, 0, 0;
    uni_b_ << pull;
    fri_A_.topLeftCorner<4, 2>() << 1, 0, 0, 1, -1, 0, 0, -1;
    fri_b_.setConstant(pull / 2.);
    reg_A_.setOnes();
    updateNewtonEuler(Vector3d::Zero(), SE3(Matrix3d::Identity(), position));
  }
  std::shared_ptr<ContactBase> clone() const override { return std::make_shared<Magnet>(*this); }
  const std::string& getFrameName() const override { return name_; }

 private:
  std::string name_ = "magnet";
};

/// Another: a hand that can give what is within a random polytope, in which a force lies.
class Hand : public ContactBase {
 public:
  Hand(Random& random, const VectorXd& inside) {
    reset(8, 8, 6);
    uni_A_ = random.vector(48).reshaped(8, 6);
    fri_A_ = random.vector(48).reshaped(8, 6);
    uni_b_ = uni_A_ * inside + random.vector(8, 0., 50.);
    fri_b_ = fri_A_ * inside + random.vector(8, 0., 50.);
    reg_A_ = randomWeights(random, 6);
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

}  // namespace

BOOST_AUTO_TEST_CASE(statuses_print_their_names) {
  const std::vector<std::pair<DistributionStatus, std::string>> names = {
      {DistributionStatus::Solved, "Solved"},
      {DistributionStatus::Infeasible, "Infeasible"},
      {DistributionStatus::NoContact, "NoContact"},
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
  BOOST_TEST(close(distribution.forces(), expected, 1e-10));
}

BOOST_AUTO_TEST_CASE(weights_act_squared) {
  // Of two soles in one place, the one whose weights are twice as large carries a quarter of what
  // the other carries, in every component.
  const Contacts contacts = {makeSole(Vector3d::Zero(), 0.7, Vector6::Ones()),
                             makeSole(Vector3d::Zero(), 0.7, Vector6::Constant(2.))};
  const Vector6 total = wrench(50., -20., 500., 2., 3., 1.);
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.forces().head<6>(), 0.8 * total, 1e-10));
  BOOST_TEST(close(distribution.forces().tail<6>(), 0.2 * total, 1e-10));
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
    const Problem problem = stackedProblem(contacts);
    const Vector6 total = wrench(0., 0., 500.) + Vector6(random.vector(6, 10.));
    const MatrixXd mapped = problem.q.cwiseInverse().asDiagonal() * problem.ne.transpose();
    const VectorXd expected = mapped * (problem.ne * mapped).ldlt().solve(total);
    if ((problem.inequalities * expected).maxCoeff() > -1e-3) continue;
    ++inside;

    WrenchDistribution distribution;
    BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
    BOOST_TEST(close(distribution.forces(), expected, 1e-10));
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
    const Problem problem = stackedProblem(contacts);
    const double fraction = random.coin() ? random.uniform(0., 1.) : 1.;
    VectorXd given(problem.q.size());
    Index col = 0;
    for (const auto& contact : contacts) {
      given.segment(col, contact->cols()) = randomForce(random, *contact, fraction);
      col += contact->cols();
    }
    const Vector6 total = problem.ne * given;

    BOOST_REQUIRE(solve(distribution, contacts, total) == DistributionStatus::Solved);
    const VectorXd& forces = distribution.forces();
    BOOST_REQUIRE(close(problem.ne * forces, total, 1e-9));
    const double size = forces.cwiseAbs().maxCoeff();
    BOOST_REQUIRE((problem.inequalities * forces).maxCoeff() <= 1e-9 * size);
    const VectorXd gradient = problem.q.cwiseProduct(forces);
    BOOST_REQUIRE(gradient.dot(forces) <= (1. + 1e-9) * problem.q.cwiseProduct(given).dot(given));
    Index tight = 0;
    // A single sole leaves no choice.
    if (problem.ne.cols() > 6) BOOST_REQUIRE(optimalityGap(problem, forces, &tight) < 1e-7);
    ++(tight == 0 ? interior : tightened);
  }
  // Both kinds of solution have been met.
  BOOST_TEST(interior > 50);
  BOOST_TEST(tightened > 500);
}

BOOST_AUTO_TEST_CASE(the_check_of_optimality_knows_what_is_not_optimal) {
  // Forces that sum to the wrench within the cones, but are not the cheapest.
  const Contacts contacts = twoSoles();
  const Problem problem = stackedProblem(contacts);
  VectorXd forces(12);
  forces << 0., 0., 250., 0., 0., 0., 0., 0., 250., 0., 0., 0.;
  BOOST_TEST(optimalityGap(problem, forces) < 1e-12);
  forces[0] += 10.;
  forces[6] -= 10.;
  forces[5] += 1.;
  forces[11] += 1.;
  BOOST_TEST(close(problem.ne * forces, wrench(0., 0., 500.)));
  BOOST_TEST((problem.inequalities * forces).maxCoeff() <= 0.);
  BOOST_TEST(optimalityGap(problem, forces) > 1e-3);
}

BOOST_AUTO_TEST_CASE(the_order_of_contacts_changes_nothing) {
  Random random(3);
  for (int trial = 0; trial < 100; ++trial) {
    Contacts contacts = randomContacts(random);
    const Problem problem = stackedProblem(contacts);
    VectorXd given(problem.q.size());
    Index col = 0;
    for (const auto& contact : contacts) {
      given.segment(col, contact->cols()) = randomForce(random, *contact, 0.9);
      col += contact->cols();
    }
    WrenchDistribution forward, backward;
    BOOST_REQUIRE(solve(forward, contacts, problem.ne * given) == DistributionStatus::Solved);
    BOOST_REQUIRE(solve(backward, Contacts(contacts.rbegin(), contacts.rend()),
                        problem.ne * given) == DistributionStatus::Solved);
    col = 0;
    Index end = backward.forces().size();
    for (const auto& contact : contacts) {
      end -= contact->cols();
      BOOST_TEST(close(backward.forces().segment(end, contact->cols()),
                       forward.forces().segment(col, contact->cols()), 1e-9));
      col += contact->cols();
    }
  }
}

BOOST_AUTO_TEST_CASE(what_the_ground_cannot_give_is_infeasible) {
  const Contacts soles = twoSoles();
  const auto infeasible = [&](const Vector6& total) {
    WrenchDistribution distribution;
    BOOST_TEST(solve(distribution, soles, total) == DistributionStatus::Infeasible);
    BOOST_TEST(distribution.forces().size() == 12);
    BOOST_TEST(isZero(distribution.forces()));
  };
  const auto solved = [&](const Vector6& total) {
    BOOST_TEST(solve(soles, total) == DistributionStatus::Solved);
  };
  // It does not pull.
  infeasible(wrench(0., 0., -500.));
  infeasible(wrench(0., 0., -1.));
  // Friction: μ = 0.7, and so 350 N along the axes. It is nearly a moment-free problem, because the
  // CoM is on the ground.
  for (const double sign : {-1., 1.}) {
    solved(wrench(sign * 349., 0., 500.));
    infeasible(wrench(sign * 351., 0., 500.));
    solved(wrench(0., sign * 349., 500.));
    infeasible(wrench(0., sign * 351., 500.));
  }
  // Pressure at the outer edges, 0.1 m ahead and 0.16 m aside: moments of 50 and 80 N·m.
  for (const double sign : {-1., 1.}) {
    solved(wrench(0., 0., 500., 0., sign * 49.9, 0.));
    infeasible(wrench(0., 0., 500., 0., sign * 50.1, 0.));
    solved(wrench(0., 0., 500., sign * 79.9, 0., 0.));
    infeasible(wrench(0., 0., 500., sign * 80.1, 0., 0.));
  }
  // Lateral force without any load.
  infeasible(wrench(10., 0., 0.));
}

BOOST_AUTO_TEST_CASE(any_contact_is_taken_with_its_own_inequalities) {
  // Their right-hand sides included: two magnets of 50 N hold 100 N, and 25 N aside each.
  const Contacts magnets = {std::make_shared<Magnet>(Vector3d(0., 0.1, 0.), 50.),
                            std::make_shared<Magnet>(Vector3d(0., -0.1, 0.), 50.)};
  WrenchDistribution distribution;
  for (const double size : {99., 101.}) {
    const auto expected = size < 100. ? DistributionStatus::Solved : DistributionStatus::Infeasible;
    BOOST_TEST(solve(distribution, magnets, wrench(0., 0., -size)) == expected);
    BOOST_TEST(solve(distribution, magnets, wrench(size / 2., 0., 0.)) == expected);
    BOOST_TEST(solve(distribution, magnets, wrench(0., -size / 2., 500.)) == expected);
  }
  BOOST_TEST(solve(distribution, magnets, wrench(0., 0., -80.)) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.forces()[2], -40., 1e-10));
}

BOOST_AUTO_TEST_CASE(forces_are_the_cheapest_within_any_polytopes) {
  Random random(6);
  WrenchDistribution distribution;
  for (int trial = 0; trial < 500; ++trial) {
    Contacts contacts;
    const Index hands = random.integer(2, 4);
    const VectorXd given = random.vector(6 * hands, 100.);
    for (Index i = 0; i < hands; ++i)
      contacts.push_back(std::make_shared<Hand>(random, given.segment<6>(6 * i)));
    const Problem problem = stackedProblem(contacts);
    const Vector6 total = problem.ne * given;
    BOOST_REQUIRE(solve(distribution, contacts, total) == DistributionStatus::Solved);
    const VectorXd& forces = distribution.forces();
    BOOST_REQUIRE(close(problem.ne * forces, total, 1e-9));
    BOOST_REQUIRE((problem.inequalities * forces - problem.limits).maxCoeff() <=
                  1e-9 * forces.cwiseAbs().maxCoeff());
    BOOST_REQUIRE(optimalityGap(problem, forces) < 1e-7);
  }
}

/// A force just inside a corner of a contact's cone.
VectorXd cornerForce(Random& random, const ContactBase& contact) {
  VectorXd force = randomForce(random, contact, 1.);
  const auto sign = [&random] { return (1. - 1e-6) * (random.coin() ? 1. : -1.); };
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
      const VectorXd force = random.coin() ? cornerForce(random, *contacts.back())
                                           : randomForce(random, *contacts.back(), 1.);
      total += contacts.back()->ne_A() * force;
    }
    BOOST_TEST_CONTEXT("problem " << i) {
      WrenchDistribution distribution;
      BOOST_TEST(solve(distribution, contacts, total) == DistributionStatus::Solved);
      const Problem problem = stackedProblem(contacts);
      const VectorXd& forces = distribution.forces();
      BOOST_TEST((problem.ne * forces - total).norm() <= 1e-8 * total.norm());
      BOOST_TEST((problem.inequalities * forces).maxCoeff() <= 1e-8 * total.norm());
    }
  }
}

BOOST_AUTO_TEST_CASE(no_force_is_asked_and_none_is_given) {
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, twoSoles(), Vector6::Zero()) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.forces(), VectorXd::Zero(12)));
}

BOOST_AUTO_TEST_CASE(without_contacts_there_is_no_contact) {
  WrenchDistribution distribution;
  for (const Vector6& total : {wrench(0., 0., 500.), wrench(0., 0., 0.)}) {
    BOOST_TEST(solve(distribution, {}, total) == DistributionStatus::NoContact);
    BOOST_TEST(distribution.forces().size() == 0);
  }
}

BOOST_AUTO_TEST_CASE(numbers_that_are_not_finite_are_a_numerical_failure) {
  WrenchDistribution distribution;
  for (const double bad : {kNaN, kInfinity, -kInfinity}) {
    for (Index i = 0; i < 6; ++i) {
      Vector6 total = wrench(0., 0., 500.);
      total[i] = bad;
      BOOST_TEST(solve(distribution, twoSoles(), total) == DistributionStatus::NumericalFailure);
      BOOST_TEST(distribution.forces().size() == 12);
      BOOST_TEST(isZero(distribution.forces()));
    }
    // A placement that is not finite comes from sensors, too.
    Contacts contacts = twoSoles();
    contacts[0]->updateNewtonEuler(Vector3d(bad, 0., 0.), SE3::Identity());
    BOOST_TEST(solve(distribution, contacts, wrench(0., 0., 500.)) ==
               DistributionStatus::NumericalFailure);
    BOOST_TEST(isZero(distribution.forces()));
  }
  // It is as good as new after that.
  BOOST_TEST(solve(distribution, twoSoles(), wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.forces()[2], 250., 1e-10));
}

BOOST_AUTO_TEST_CASE(fewer_than_three_points_give_what_they_can) {
  // One point, two points and three in a row cannot give every wrench: the equalities depend on
  // each other. Some wrenches that they can give, and some that they cannot, are asked for here.
  Random random(4);
  WrenchDistribution distribution;
  for (int trial = 0; trial < 300; ++trial) {
    Contacts contacts;
    const Vector3d start = random.vector3(), direction = random.vector3();
    const Index points = random.integer(1, 3);
    for (Index i = 0; i < points; ++i) contacts.push_back(makePoint(start + i * direction));
    const Problem problem = stackedProblem(contacts);
    VectorXd given(3 * points);
    for (Index i = 0; i < points; ++i)
      given.segment<3>(3 * i) = randomForce(random, *contacts[i], 0.9);
    Vector6 total = problem.ne * given;
    const bool withinReach = random.coin();
    if (!withinReach) total += random.vector(6, 50.);

    const auto status = solve(distribution, contacts, total);
    if (withinReach) {
      BOOST_TEST(status == DistributionStatus::Solved);
      BOOST_TEST(close(problem.ne * distribution.forces(), total, 1e-9));
      BOOST_TEST((problem.inequalities * distribution.forces()).maxCoeff() <= 1e-6);
    } else {
      BOOST_TEST(status == DistributionStatus::Infeasible);
      BOOST_TEST(isZero(distribution.forces()));
    }
  }
}

BOOST_AUTO_TEST_CASE(sizes_of_all_magnitudes_give_finite_forces) {
  WrenchDistribution distribution;
  for (const double size : {1e-200, 1e-9, 1e9, 1e150, 1e200, 1e300}) {
    const Vector6 total = size * wrench(0.1, 0., 1., 0., 0.01, 0.);
    const auto status = solve(distribution, twoSoles(), total);
    BOOST_TEST_CONTEXT("wrench of size " << size) {
      BOOST_TEST(distribution.forces().allFinite());
      // Beyond what machines are built for, the status may be any, as long as it is true.
      if (size > 1e-100 && size < 1e100) BOOST_TEST(status == DistributionStatus::Solved);
      if (status != DistributionStatus::Solved)
        BOOST_TEST(isZero(distribution.forces()));
      else if (size > 1e-100)
        BOOST_TEST(close(distribution.forces().head<3>() / size, Vector3d(0.05, 0., 0.5), 1e-9));
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
  BOOST_TEST(close(distribution.forces()[2], 250., 1e-10));
  BOOST_TEST(close(distribution.forces()[8], 250., 1e-10));
}

BOOST_AUTO_TEST_CASE(a_contact_without_settings_is_refused) {
  WrenchDistribution distribution;
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  BOOST_TEST(
      throws<std::invalid_argument>([&] { distribution.add(Contact6D()); }, {"initialised"}));
  BOOST_TEST(
      throws<std::invalid_argument>([&] { distribution.add(ContactPoint()); }, {"initialised"}));
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(close(distribution.forces()[2], 250., 1e-10));
}

BOOST_AUTO_TEST_CASE(clear_begins_anew) {
  WrenchDistribution distribution;
  BOOST_TEST(solve(distribution, twoSoles(), wrench(0., 0., 500.)) == DistributionStatus::Solved);
  // Another size, bigger and then smaller.
  const Contacts points = {makePoint({0.3, 0.2, 0.}), makePoint({0.3, -0.2, 0.}),
                           makePoint({-0.3, 0.2, 0.}), makePoint({-0.3, -0.2, 0.}),
                           makeSole({0., 0., 0.})};
  BOOST_TEST(solve(distribution, points, wrench(0., 0., 500.)) == DistributionStatus::Solved);
  BOOST_TEST(distribution.forces().size() == 18);
  for (Index i = 0; i < 4; ++i) BOOST_TEST(close(distribution.forces()[3 * i + 2], 100., 1e-10));

  BOOST_TEST(solve(distribution, {makeSole({0., 0., 0.})}, wrench(1., 2., 500.)) ==
             DistributionStatus::Solved);
  BOOST_TEST(close(distribution.forces(), wrench(1., 2., 500.), 1e-10));

  distribution.clear();
  BOOST_TEST(distribution.solve(wrench(0., 0., 500.)) == DistributionStatus::NoContact);
}

BOOST_AUTO_TEST_CASE(the_same_problem_may_be_solved_for_many_wrenches) {
  Random random(5);
  WrenchDistribution distribution;
  for (const auto& contact : twoSoles()) distribution.add(*contact);
  for (int trial = 0; trial < 50; ++trial) {
    const Vector6 total = wrench(0., 0., 500.) + Vector6(random.vector(6, 20.));
    BOOST_TEST(distribution.solve(total) == solve(twoSoles(), total));
    WrenchDistribution fresh;
    solve(fresh, twoSoles(), total);
    BOOST_TEST(close(distribution.forces(), fresh.forces(), 1e-10));
  }
}

BOOST_AUTO_TEST_CASE(a_copy_is_independent) {
  WrenchDistribution original;
  for (const auto& contact : twoSoles()) original.add(*contact);
  original.solve(wrench(0., 0., 500.));

  WrenchDistribution copy(original);
  BOOST_TEST(close(copy.forces(), original.forces(), 0.));
  BOOST_TEST(copy.solve(wrench(0., 0., 300.)) == DistributionStatus::Solved);
  BOOST_TEST(close(copy.forces()[2], 150., 1e-10));
  BOOST_TEST(close(original.forces()[2], 250., 1e-10));

  original = copy;
  BOOST_TEST(close(original.forces()[2], 150., 1e-10));
  copy.clear();
  BOOST_TEST(original.solve(wrench(0., 0., 200.)) == DistributionStatus::Solved);

  WrenchDistribution moved(std::move(original));
  BOOST_TEST(close(moved.forces()[2], 100., 1e-10));
}
