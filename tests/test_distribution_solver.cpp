// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE distribution_solver
#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <random>
#include <stdexcept>

#include "distribution/scaled_set.hpp"
#include "dynacom/distribution_solver.hpp"
#include "dynacom/wrench_distribution.hpp"
#include "random_problems.hpp"
#include "set_problems.hpp"
#include "test_tools.hpp"

using namespace dynacom;
using namespace dynacom_tests;
using internal::ScaledSet;

namespace {

using Vector6 = DistributionProblem::Vector6;

// A problem of pyramids and rectangles for the solver of all sets.
DistributionProblem describe(const Problem& problem) {
  DistributionProblem described;
  described.wrench = problem.wrench;
  described.wrench_weights = problem.wrench_weights;
  described.minimal_scale = problem.minimal_scale;
  for (const ProblemContact& contact : problem.contacts) {
    DistributionProblem::Contact own;
    const Eigen::Vector2d mu(contact.mu, contact.mu), half(contact.half_length, contact.half_width);
    const Section friction = Section::rectangle(-mu, mu);
    own.set = contact.is_point
                  ? ContactSet::point(friction)
                  : ContactSet::surface(friction, Section::rectangle(-half, half), contact.gu);
    own.rotation = contact.rotation;
    own.lever = contact.lever;
    own.weights = contact.weights;
    described.contacts.push_back(own);
  }
  return described;
}

// A robot's weight on two soles side by side.
DistributionProblem stand(const Section& friction) {
  DistributionProblem problem;
  for (const double y : {0.1, -0.1}) {
    DistributionProblem::Contact sole;
    sole.set = ContactSet::surface(friction, Section::rectangle({-0.1, -0.05}, {0.1, 0.05}), 0.05);
    sole.lever = Eigen::Vector3d(0., y, -0.9);
    problem.contacts.push_back(sole);
  }
  problem.wrench << 0., 0., 900., 0., 0., 0.;
  return problem;
}

}  // namespace

BOOST_AUTO_TEST_CASE(projections_are_the_nearest_points_and_jacobians_their_changes) {
  // A point of a convex set is the nearest if nothing of the set is farther in the direction of
  // what is missing.
  for (std::size_t kind = 0; kind < kSetKindNames.size(); ++kind) {
    SetProblemGenerator generator(7);
    std::mt19937_64 engine(8);
    const auto uniform = [&](double low, double high) {
      return std::uniform_real_distribution<double>(low, high)(engine);
    };
    for (int trial = 0; trial < 300; ++trial) {
      const SetProblem made = generator.next(static_cast<SetKind>(kind));
      const DistributionProblem::Contact& contact = made.problem.contacts[0];
      const Eigen::Index n = contact.set.size();
      Vector6 weights = Vector6::Ones();
      weights.head(n) = contact.weights;
      ScaledSet set(contact.set, weights);
      set.setUnit(contact.set, weights, 1.);
      Vector6 point = Vector6::Zero();
      const double size = std::pow(10., uniform(-1., 3.));
      for (Eigen::Index k = 0; k < n; ++k) point[k] = size * uniform(-1., 1.);
      ScaledSet::Response response;
      set.project(point, response);
      const Vector6 x = response.force, missing = point - x;
      const double terms = 1. + point.norm() + x.norm();
      BOOST_TEST(contact.set.excess(x.head(n).cwiseQuotient(weights.head(n))) <= 1e-12 * terms);
      const double support = contact.set.support(missing.cwiseProduct(weights).head(n),
                                                 1e-11 * terms * weights.maxCoeff());
      BOOST_TEST(support <= missing.dot(x) + 1e-9 * terms * terms);

      const double step = 1e-7 * terms;
      const Vector6 direction = [&] {
        Vector6 some = Vector6::Zero();
        for (Eigen::Index k = 0; k < n; ++k) some[k] = uniform(-1., 1.);
        return some;
      }();
      ScaledSet::Response before, after;
      set.project(point - step * direction, before);
      set.project(point + step * direction, after);
      Vector6 change = direction;
      if (!response.is_free) {
        change = response.inverse_stiffness * response.growth.dot(direction) * response.growth +
                 response.free.cwiseProduct(direction);
        const Eigen::Vector2d &friction = response.friction_along,
                              &moments = response.moments_along;
        change.head<2>() += friction * friction.dot(direction.head<2>());
        change.segment<2>(3) += moments * moments.dot(direction.segment<2>(3));
      }
      const Vector6 measured = (after.force - before.force) / (2. * step);
      // Next to a kink both sides differ.
      const bool is_smooth =
          after.is_free == before.is_free &&
          (after.is_free || (after.free == before.free &&
                             (after.friction_along - before.friction_along).norm() < 1e-4 &&
                             (after.moments_along - before.moments_along).norm() < 1e-4 &&
                             (after.growth - before.growth).norm() < 1e-4));
      if (is_smooth) BOOST_TEST((measured - change).norm() < 1e-4 * (1. + measured.norm()));
    }
  }
}

BOOST_AUTO_TEST_CASE(bounds_are_those_that_forces_are_at) {
  for (std::size_t kind = 0; kind < kSetKindNames.size(); ++kind) {
    SetProblemGenerator generator(21);
    DistributionSolver solver;
    int at_bounds = 0;
    for (int trial = 0; trial < 300; ++trial) {
      const DistributionProblem problem = generator.next(static_cast<SetKind>(kind)).problem;
      const DistributionSolution& solution = solver.solve(problem);
      if (solution.status != DistributionStatus::Solved) continue;
      for (std::size_t k = 0; k < problem.contacts.size(); ++k) {
        const DistributionProblem::Contact& contact = problem.contacts[k];
        const Eigen::Index n = contact.set.size();
        const Eigen::VectorXd& force = solution.forces[k];
        const double size = 1. + force.lpNorm<Eigen::Infinity>();
        Eigen::VectorXd weights = Eigen::VectorXd::Ones(n), reference = Eigen::VectorXd::Zero(n);
        if (contact.weights.size() > 0) weights = contact.weights;
        if (contact.reference.size() > 0) reference = contact.reference;
        const Eigen::VectorXd gradient = weights.cwiseAbs2().cwiseProduct(force - reference) -
                                         contact.NE().transpose() * solution.multipliers;
        const bool is_inside = solution.bounds[k].head(n).isZero();
        at_bounds += !is_inside;
        // Inside nothing pushes back, and at a bound the force is on the boundary.
        const double terms = weights.cwiseAbs2().maxCoeff() * size +
                             solution.multipliers.norm() * (1. + contact.lever.norm());
        if (is_inside)
          BOOST_TEST(gradient.norm() <= 1e-9 * terms);
        else
          BOOST_TEST(contact.set.excess(force) >= -1e-9 * size);
      }
    }
    BOOST_TEST(at_bounds > 100);
  }
}

BOOST_AUTO_TEST_CASE(messages_name_the_contact) {
  DistributionProblem problem;
  problem.contacts.resize(2);
  problem.contacts[1].lever.setConstant(std::numeric_limits<double>::infinity());
  BOOST_CHECK_EXCEPTION(problem.validate(), std::invalid_argument, [](const auto& error) {
    return std::string(error.what()) == "contacts[1].lever must be finite, got inf inf inf";
  });
}

BOOST_AUTO_TEST_CASE(answers_are_those_of_the_solver_of_pyramids) {
  ProblemGenerator generator(11);
  DistributionSolver solver;
  WrenchDistribution pyramids;
  int answered = 0;
  for (int trial = 0; trial < 1000; ++trial) {
    const Problem problem = generator.next();
    if (problem.nearly_parallel || problem.weights_far_apart) continue;
    const DistributionProblem described = describe(problem);
    const DistributionSolution& solution = solver.solve(described);
    pyramids.clear();
    pyramids.setWrenchWeights(problem.wrench_weights);
    for (const auto& contact : problem.makeContacts()) pyramids.add(*contact);
    pyramids.solve(problem.wrench, problem.minimal_scale);
    const DistributionResult& result = pyramids.result();
    if (solution.status == DistributionStatus::NumericalFailure) continue;
    ++answered;
    BOOST_TEST(solution.isOptimal(described));
    BOOST_TEST((solution.status == result.status));
    const double scale = described.scale();
    BOOST_TEST(problem.wrench_weights.cwiseProduct(solution.achieved - result.achieved).norm() <=
               1e-8 * scale);
    if (problem.place == Place::NearBoundary || problem.place == Place::Nothing) continue;
    BOOST_TEST(std::abs(solution.cost - result.cost) <= 1e-6 * result.cost + 1e-20);
  }
  BOOST_TEST(answered > 800);
}

// What a point below the CoM cannot give of a force that pushes it sideways, harder than friction
// allows.
DistributionSolution slip(const Section& friction) {
  DistributionProblem problem;
  problem.contacts.resize(1);
  problem.contacts[0].set = ContactSet::point(friction);
  problem.wrench << 300., 500., 900., 0., 0., 0.;
  DistributionSolver solver;
  const DistributionSolution& solution = solver.solve(problem);
  BOOST_TEST((solution.status == DistributionStatus::Relaxed));
  BOOST_TEST(solution.isOptimal(problem));
  return solution;
}

BOOST_AUTO_TEST_CASE(a_point_slips_on_its_cone) {
  const double mu = 0.5, sideways = std::hypot(300., 500.);
  const DistributionSolution cone = slip(Section::disc(mu));
  // The nearest point of a cone.
  const double distance = (sideways - mu * 900.) / std::sqrt(1. + mu * mu);
  BOOST_TEST(std::abs(cone.residual.norm() - distance) < 1e-9 * distance);
  const Eigen::Vector3d force = cone.forces[0];
  BOOST_TEST(std::abs(force[2] - (900. + mu * sideways) / (1. + mu * mu)) < 1e-9 * force[2]);
  BOOST_TEST(std::abs(force.head<2>().norm() - mu * force[2]) < 1e-9 * force[2]);
  BOOST_TEST(std::abs(force[0] * 500. - force[1] * 300.) < 1e-6 * force[2]);
  // Facets around it allow more, up to what a cone through their edges would.
  for (const int facets : {4, 8, 16, 32, 64}) {
    const double most = mu / std::cos(3.14159265358979323846 / facets);
    const double least = std::max(0., sideways - most * 900.) / std::sqrt(1. + most * most);
    const double found = slip(Section::facets(mu, facets, 0.03)).residual.norm();
    BOOST_TEST(found < distance);
    BOOST_TEST(found > least);
  }
}

BOOST_AUTO_TEST_CASE(a_hand_that_holds_on_takes_what_feet_cannot) {
  DistributionProblem problem = stand(Section::disc(0.5));
  problem.wrench << 100., 0., 900., 0., 300., 0.;  // leaning far forward
  DistributionSolver solver;
  BOOST_TEST((solver.solve(problem).status == DistributionStatus::Relaxed));
  DistributionProblem::Contact hand;
  Vector6 most;
  most << 200., 200., 200., 10., 10., 10.;
  hand.set = ContactSet::grasp(-most, most);
  hand.lever = Eigen::Vector3d(0.5, 0., 0.2);
  problem.contacts.push_back(hand);
  const DistributionSolution& held = solver.solve(problem);
  BOOST_TEST((held.status == DistributionStatus::Solved));
  BOOST_TEST(held.isOptimal(problem));
  BOOST_TEST(held.forces[2].cwiseAbs().cwiseQuotient(most).maxCoeff() <= 1. + 1e-12);
}

BOOST_AUTO_TEST_CASE(bounds_and_references_hold) {
  DistributionProblem problem = stand(Section::disc(0.5));
  DistributionSolver solver;
  problem.contacts[0].set.boundNormalForce(0., 300.);
  const DistributionSolution bounded = solver.solve(problem);
  // The other foot takes the rest, but for the moment that it would have to make up for.
  BOOST_TEST(bounded.isOptimal(problem));
  BOOST_TEST(bounded.forces[0][2] <= 300. * (1. + 1e-12));
  problem = stand(Section::disc(0.5));
  problem.contacts[0].reference = Vector6::Unit(2) * 700.;
  problem.contacts[1].reference = Vector6::Unit(2) * 200.;
  problem.wrench[3] = 0.1 * 500.;  // which these give
  const DistributionSolution near = solver.solve(problem);
  BOOST_TEST((near.status == DistributionStatus::Solved));
  BOOST_TEST(near.cost < 1e-12);
  BOOST_TEST(std::abs(near.forces[0][2] - 700.) < 1e-6);
}

BOOST_AUTO_TEST_CASE(what_is_no_answer_says_so) {
  DistributionSolver solver;
  DistributionProblem problem = stand(Section::disc(0.5));
  problem.wrench[1] = std::numeric_limits<double>::quiet_NaN();
  BOOST_TEST((solver.solve(problem).status == DistributionStatus::InvalidInput));
  BOOST_TEST(throws<std::invalid_argument>([&] { problem.validate(); }, {"wrench", "nan"}));
  problem.wrench[1] = 0.;
  problem.contacts[1].lever[0] = std::numeric_limits<double>::infinity();
  BOOST_TEST((solver.solve(problem).status == DistributionStatus::InvalidInput));
  BOOST_TEST(throws<std::invalid_argument>([&] { problem.validate(); }, {"lever", "inf"}));
  problem.contacts.clear();
  BOOST_TEST((solver.solve(problem).status == DistributionStatus::NoContact));
  problem.wrench.setZero();
  BOOST_TEST((solver.solve(problem).status == DistributionStatus::Solved));
  BOOST_TEST(throws<std::invalid_argument>([&] { solver.setMaximalIterations(0); }, {"0"}));
  problem = stand(Section::disc(0.5));
  problem.contacts[0].weights = Eigen::Vector3d::Ones();
  BOOST_TEST(throws<std::invalid_argument>([&] { problem.validate(); }, {"weights", "6", "3"}));
}

BOOST_AUTO_TEST_CASE(a_proof_is_none_for_other_forces) {
  DistributionSolver solver;
  const DistributionProblem problem = stand(Section::disc(0.5));
  DistributionSolution solution = solver.solve(problem);
  BOOST_TEST(solution.isOptimal(problem));
  DistributionSolution other = solution;
  other.forces[0][2] += 1.;
  other.forces[1][2] -= 1.;
  BOOST_TEST(!other.isOptimal(problem));
  other = solution;
  other.multipliers[2] *= 1.01;
  BOOST_TEST(!other.isOptimal(problem));
  other = solution;
  other.forces[0][0] = 0.6 * other.forces[0][2];
  BOOST_TEST(!other.isOptimal(problem));
}

BOOST_AUTO_TEST_CASE(what_has_only_moved_has_the_same_answer) {
  for (std::size_t kind = 0; kind < kSetKindNames.size(); ++kind) {
    SetProblemGenerator generator(31);
    DistributionSolver moved, fresh;
    moved.setWarmStart(false);
    for (int trial = 0; trial < 20; ++trial) {
      DistributionProblem problem = generator.next(static_cast<SetKind>(kind)).problem;
      moved.solve(problem);
      for (DistributionProblem::Contact& contact : problem.contacts)
        contact.lever += Eigen::Vector3d(0.01, -0.02, 0.03);
      problem.wrench *= 1.1;
      problem.wrench_weights[0] *= 2.;
      const DistributionSolution& one = moved.solveMoved(problem);
      const DistributionSolution& other = fresh.solve(problem);
      fresh.forget();
      BOOST_TEST((one.status == other.status));
      BOOST_TEST(one.achieved == other.achieved);
      BOOST_TEST(one.cost == other.cost);
    }
  }
  DistributionSolver solver;
  DistributionProblem problem = stand(Section::disc(0.5));
  solver.solve(problem);
  problem.contacts[1].set = ContactSet::point(Section::disc(0.5));
  BOOST_TEST(throws<std::invalid_argument>([&] { solver.solveMoved(problem); },
                                           {"solveMoved()", "contacts[1]"}));
  problem.contacts.pop_back();
  BOOST_TEST(throws<std::invalid_argument>([&] { solver.solveMoved(problem); },
                                           {"solveMoved()", "2", "1"}));
}

// Without multipliers of its own, since those of what is out of reach grow without limit.
BOOST_AUTO_TEST_CASE(what_is_hardly_out_of_reach_is_answered_by_the_closest) {
  for (const Section& friction : {Section::disc(0.5), Section::rectangle({-0.5, -0.5}, {0.5, 0.5})})
    for (const double beyond : {1e-6, 1e-7, 1e-9, 1e-10}) {
      DistributionProblem problem = stand(friction);
      problem.wrench << 450., 0., 900., 0., -405., 0.;  // all that friction holds
      problem.wrench[0] += beyond * problem.scale();
      problem.wrench[4] -= 0.9 * beyond * problem.scale();
      DistributionSolver solver;
      const DistributionSolution& solution = solver.solve(problem);
      const bool is_told = beyond > 1e-8;
      BOOST_TEST((solution.status ==
                  (is_told ? DistributionStatus::Relaxed : DistributionStatus::Solved)));
      BOOST_TEST(solution.is_clear);
      BOOST_TEST(!solution.is_accurate);
      BOOST_TEST(solution.isOptimal(problem, 1e-8));
      BOOST_TEST(solution.residual.norm() > 0.5 * beyond * problem.scale());
      BOOST_TEST(solution.iterations <= 20);
    }
}
