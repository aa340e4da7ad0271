// SPDX-License-Identifier: BSD-2-Clause
// Forces that frames share in lanes, against one WrenchDistribution after the other, and certified
// from the contacts' geometry alone.
#define BOOST_TEST_MODULE lane_distribution
#include <algorithm>
#include <cmath>
#include <map>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/motion_analysis.hpp"
#include "problem_checker.hpp"
#include "random_problems.hpp"
#include "random_robot.hpp"
#include "set_problems.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

/// A body at the world's origin that moves as if a wrench acted on it in each frame, and contacts
/// that are fixed to it, some of which take part in a frame.
class Stand {
 public:
  Stand(const Problem& problem, const std::vector<Vector6>& wrenches, Random& random,
        bool all_active = false)
      : problem_(problem) {
    const double force = problem.wrench.head<3>().norm();
    mass_ = force > 0. ? force / 9.81 : 1.;
    std::vector<SE3> places;
    for (const ProblemContact& contact : problem.contacts)
      places.emplace_back(contact.rotation, contact.lever);
    const pinocchio::Model model = singleBody(mass_, places);
    robot_.initialize(model);
    robot_.setWarmStart(false);
    robot_.setWrenchWeights(problem.wrench_weights);
    for (std::size_t k = 0; k < problem.contacts.size(); ++k) addContact(k);

    const auto frames = static_cast<Index>(wrenches.size());
    const auto contacts = static_cast<Index>(problem.contacts.size());
    const State rest = restState(model);
    motion_ = {VectorXd::LinSpaced(frames, 0., 1.), rest.q.replicate(1, frames),
               MatrixXd::Zero(model.nv, frames), MatrixXd::Zero(model.nv, frames)};
    const Matrix3d inertia = model.inertias[1].inertia().matrix();
    for (Index frame = 0; frame < frames; ++frame) {
      const Vector6& wrench = wrenches[static_cast<std::size_t>(frame)];
      motion_.a.col(frame) << wrench.head<3>() / mass_ + model.gravity.linear(),
          inertia.inverse() * wrench.tail<3>();
    }
    schedule_.names = robot_.getKnownContacts();
    schedule_.active.resize(contacts, frames);
    schedule_.readiness = MatrixXd::Ones(contacts, frames);
    for (Index frame = 0; frame < frames; ++frame)
      for (Index k = 0; k < contacts; ++k) {
        schedule_.active(k, frame) = all_active || k == frame % contacts || random.coin();
        if (!all_active) schedule_.readiness(k, frame) = random.uniform(0.1, 1.);
      }
  }

  const DynaCoM& robot() const { return robot_; }
  Index frames() const { return motion_.time.size(); }

  MotionAnalysis analyze(int lanes) const {
    AnalysisSettings settings;
    settings.lanes = lanes;
    settings.flat_horizontal_ground = false;
    return analyzeMotion(robot_, motion_, schedule_, settings);
  }

  /// The problem of a frame.
  Problem problem(const MotionAnalysis& analysis, Index frame) const {
    Problem problem = problem_;
    problem.contacts.clear();
    problem.distance.reset();
    problem.wrench << analysis.ground_force.col(frame), analysis.ground_torque.col(frame);
    problem.minimal_scale = 9.81 * mass_ * problem.wrench_weights.head<3>().maxCoeff();
    for (std::size_t k = 0; k < problem_.contacts.size(); ++k) {
      const auto row = static_cast<Index>(k);
      if (!schedule_.active(row, frame)) continue;
      problem.contacts.push_back(problem_.contacts[k]);
      problem.contacts.back().weights /= std::sqrt(schedule_.readiness(row, frame));
    }
    return problem;
  }

  /// An answer with the forces of an analysis. Its multipliers, which an analysis does not have,
  /// are those of a WrenchDistribution of this frame.
  DistributionResult answer(const MotionAnalysis& analysis, Index frame) const {
    const Problem problem = this->problem(analysis, frame);
    WrenchDistribution distribution;
    distribution.setWrenchWeights(problem.wrench_weights);
    for (const auto& contact : problem.makeContacts()) distribution.add(*contact);
    distribution.solve(problem.wrench, 9.81 * mass_);
    DistributionResult result = distribution.result();
    result.status = analysis.status[static_cast<std::size_t>(frame)];
    result.residual = analysis.residual.col(frame);
    std::size_t next = 0;
    for (std::size_t k = 0; k < analysis.contacts.size(); ++k) {
      if (!schedule_.active(static_cast<Index>(k), frame)) continue;
      DistributionResult::Contact& contact = result.contacts[next++];
      contact.force = analysis.contacts[k].wrench.col(frame).head(contact.force.size());
    }
    return result;
  }

  /// One of its frames.
  Stand only(Index frame) const {
    Stand one = *this;
    one.motion_ = {motion_.time.segment(frame, 1), motion_.q.col(frame), motion_.v.col(frame),
                   motion_.a.col(frame)};
    one.schedule_.active = schedule_.active.col(frame);
    one.schedule_.readiness = schedule_.readiness.col(frame);
    return one;
  }

  /// Takes the frames from last to first.
  void reverse() {
    motion_.a = motion_.a.rowwise().reverse().eval();
    schedule_.active = schedule_.active.rowwise().reverse().eval();
    schedule_.readiness = schedule_.readiness.rowwise().reverse().eval();
  }

 private:
  void addContact(std::size_t k) {
    const ProblemContact& contact = problem_.contacts[k];
    const std::string frame = "sole" + std::to_string(k), name = "contact" + std::to_string(k);
    if (contact.is_point) {
      ContactPointSettings settings;
      settings.mu = contact.mu;
      settings.weights = contact.weights;
      settings.frame_name = frame;
      if (contact.is_cone) settings.friction = FrictionModel::Cone;
      robot_.addContact(std::make_shared<ContactPoint>(settings), name);
    } else {
      Contact6DSettings settings;
      settings.mu = contact.mu;
      settings.gu = contact.gu;
      settings.half_length = contact.half_length;
      settings.half_width = contact.half_width;
      settings.weights = contact.weights;
      settings.frame_name = frame;
      if (contact.is_cone) settings.friction = FrictionModel::Cone;
      robot_.addContact(std::make_shared<Contact6D>(settings), name);
    }
  }

  const Problem problem_;
  double mass_;
  DynaCoM robot_;
  Motion motion_;
  ContactSchedule schedule_;
};

/// The numbers of lanes that there are on this machine, beside one.
std::vector<int> findLanes(const DynaCoM& robot) {
  std::vector<int> found;
  for (const int lanes : {4, 8})
    if (countLanes(robot, lanes) == lanes) found.push_back(lanes);
  return found;
}

struct Tally {
  long solved = 0, relaxed = 0, failed = 0, uncertified = 0;
  long bound = 0;     // frames in which an inequality is active
  long in_lanes = 0;  // those of them that differ from one frame at a time: lanes round otherwise
};

/// Checks the forces of all frames, for each number of lanes.
void check(const Stand& stand, Tally& tally) {
  const MotionAnalysis alone = stand.analyze(1);
  for (const int lanes : findLanes(stand.robot())) {
    const MotionAnalysis analysis = stand.analyze(lanes);
    for (Index frame = 0; frame < stand.frames(); ++frame) {
      BOOST_TEST_CONTEXT(lanes << " lanes, frame " << frame) {
        const Problem problem = stand.problem(analysis, frame);
        const DistributionResult expected = stand.answer(alone, frame);
        const DistributionResult actual = stand.answer(analysis, frame);
        BOOST_TEST(actual.status == expected.status);
        // One frame at a time is judged, with the multipliers of its forces, and lanes by that.
        BOOST_TEST(dynacom_tests::check(problem, expected).error == "");
        const double unit = expected.scale / problem.wrench_weights.maxCoeff();
        BOOST_TEST(close(actual.forces() / unit, expected.forces() / unit, 1e-10));
        BOOST_TEST(close(actual.residual / unit, expected.residual / unit, 1e-10));
        tally.solved += actual.status == DistributionStatus::Solved;
        tally.relaxed += actual.status == DistributionStatus::Relaxed;
        const bool is_bound = std::any_of(expected.contacts.begin(), expected.contacts.end(),
                                          [](const auto& contact) { return contact.active.any(); });
        tally.bound += is_bound;
        tally.in_lanes += is_bound && actual.forces() != expected.forces();
      }
    }
  }
}

/// A contact as the judge of sets knows it.
SetContact describe(const ProblemContact& contact) {
  const auto corners = [](double x, double y) {
    const Eigen::Vector2d half(x, y);
    Eigen::Matrix2Xd vertices(2, 4);
    vertices << x, -x, -x, x, y, y, -y, -y;
    if (x > 0. && y > 0.) return vertices;
    vertices.conservativeResize(2, half.isZero(0.) ? 1 : 2);
    vertices.col(0) = half;
    if (!half.isZero(0.)) vertices.col(1) = -half;
    return vertices;
  };
  SetContact set;
  set.size = contact.is_point ? 3 : 6;
  if (contact.is_cone) set.radius = contact.mu;
  set.friction = corners(contact.mu, contact.mu);
  set.places = corners(contact.half_length, contact.half_width);
  set.gamma = contact.gu;
  set.rotation = contact.rotation;
  set.lever = contact.lever;
  set.weights = contact.weights;
  set.reference = VectorXd::Zero(set.size);
  return set;
}

SetProblem describe(const Problem& problem) {
  SetProblem sets;
  for (const ProblemContact& contact : problem.contacts) {
    sets.contacts.push_back(describe(contact));
    sets.problem.contacts.push_back(sets.contacts.back().make());
  }
  sets.problem.wrench = problem.wrench;
  sets.problem.wrench_weights = problem.wrench_weights;
  sets.problem.minimal_scale = problem.minimal_scale / problem.wrench_weights.head<3>().maxCoeff();
  return sets;
}

/// Whether a force is on the boundary of its set, but for a part of a unit.
bool isOnBoundary(const ProblemContact& contact, const DistributionProblem::Components& force,
                  double unit) {
  const double normal = force[2], along = contact.is_cone
                                              ? force.head<2>().norm()
                                              : force.head<2>().lpNorm<Eigen::Infinity>();
  double slack = std::min(normal, contact.mu * normal - along);
  if (!contact.is_point)
    slack = std::min({slack, contact.half_width * normal - std::abs(force[3]),
                      contact.half_length * normal - std::abs(force[4]),
                      contact.gu * normal - std::abs(force[5])});
  return slack < 1e-9 * unit;
}

/// Checks the forces of all frames where some contacts are cones. Where these are at their limit,
/// forces move with the square root of what wrenches are off: wrenches and costs are compared, with
/// those of a DistributionSolver, which has no answer to some, as far as a judge certifies it.
void checkCones(const Stand& stand, Tally& tally) {
  const MotionAnalysis alone = stand.analyze(1);
  for (const int lanes : findLanes(stand.robot())) {
    const MotionAnalysis analysis = stand.analyze(lanes);
    for (Index frame = 0; frame < stand.frames(); ++frame) {
      BOOST_TEST_CONTEXT(lanes << " lanes, frame " << frame) {
        const Problem problem = stand.problem(analysis, frame);
        const SetProblem sets = describe(problem);
        DistributionSolver solver;
        const DistributionSolution expected = solver.solve(sets.problem);
        DistributionSolution actual = expected;
        actual.status = analysis.status[static_cast<std::size_t>(frame)];
        actual.residual = analysis.residual.col(frame);
        actual.achieved = problem.wrench - actual.residual;
        const double unit = sets.problem.scale() / problem.wrench_weights.maxCoeff();
        bool is_bound = false, differs = false;
        double cost = 0.;
        std::size_t next = 0;
        for (std::size_t k = 0; k < analysis.contacts.size(); ++k) {
          if (!analysis.contacts[k].active[frame]) continue;
          const ProblemContact& contact = problem.contacts[next];
          DistributionProblem::Components& force = actual.forces[next++];
          const auto own = [&](const MotionAnalysis& found) {
            return found.contacts[k].wrench.col(frame).head(force.size());
          };
          force = own(analysis);
          cost += 0.5 * contact.weights.cwiseProduct(force).squaredNorm();
          is_bound = is_bound || isOnBoundary(contact, force, unit);
          differs = differs || force != own(alone);
        }
        const bool is_answered = actual.status != DistributionStatus::NumericalFailure;
        tally.failed += !is_answered;
        tally.solved += actual.status == DistributionStatus::Solved;
        tally.relaxed += actual.status == DistributionStatus::Relaxed;
        tally.bound += is_bound;
        tally.in_lanes += is_answered && is_bound && differs;
        if (!is_answered) continue;
        const SetVerdict verdict = dynacom_tests::check(sets, actual);
        BOOST_TEST(verdict.outside < 1e-9);
        const bool is_expected = dynacom_tests::check(sets, expected).error == "";
        // Lanes leave frames to a DistributionSolver: next to the boundary it has fewer digits now
        // and then, and for its own problem, with other rounding, others.
        const bool is_certified = verdict.distance_gap < 1e-8;
        tally.uncertified += !is_certified;
        if (!is_expected || !is_certified) continue;
        BOOST_TEST(actual.status == expected.status);
        BOOST_TEST(close(actual.residual / unit, expected.residual / unit, 1e-9));
        BOOST_TEST(std::abs(cost - expected.cost) <= 1e-6 * expected.cost);
      }
    }
  }
}

/// A wrench, and others near it and far from it.
std::vector<Vector6> makeWrenches(const Vector6& wrench, Random& random, int count) {
  std::vector<Vector6> wrenches = {wrench};
  while (static_cast<int>(wrenches.size()) < count) {
    const double part = random.coin() ? 0.05 : 0.5;
    const Vector6 change = part * wrench.norm() * random.vector(6);
    wrenches.push_back(random.uniform(0.5, 2.) * (wrench + change));
  }
  return wrenches;
}

ProblemContact makePoint(const Vector3d& lever, double mu = 0.6) {
  ProblemContact point;
  point.rotation.setIdentity();
  point.lever = lever;
  point.is_point = true;
  point.mu = mu;
  point.weights.setOnes(3);
  return point;
}

ProblemContact makeSole(const Vector3d& lever, double mu = 0.6, double gu = 0.05) {
  ProblemContact sole;
  sole.rotation.setIdentity();
  sole.lever = lever;
  sole.mu = mu;
  sole.gu = gu;
  sole.half_length = 0.1;
  sole.half_width = 0.05;
  sole.weights.setOnes(6);
  return sole;
}

/// What a motion's contacts are: those of a robot of 35 kg whose CoM is 0.7 m above the ground.
Problem makeProblem(const std::vector<ProblemContact>& contacts) {
  Problem problem = {};
  problem.contacts = contacts;
  problem.wrench << 20., -10., 343., 5., -3., 1.;
  problem.wrench_weights.setOnes();
  return problem;
}

/// The corners of two soles.
std::vector<ProblemContact> makeCorners() {
  std::vector<ProblemContact> corners;
  for (const double foot : {-0.12, 0.12})
    for (const double x : {-0.1, 0.1})
      for (const double y : {-0.04, 0.04}) corners.push_back(makePoint({x, foot + y, -0.7}));
  return corners;
}

std::vector<ProblemContact> makeCones(std::vector<ProblemContact> contacts) {
  for (ProblemContact& contact : contacts) contact.is_cone = true;
  return contacts;
}

}  // namespace

BOOST_AUTO_TEST_CASE(forces_are_those_of_one_frame_at_a_time) {
  ProblemGenerator generator(301);
  Random random(302);
  Tally tally;
  int problems = 0;
  while (problems < 1000) {
    const Problem problem = generator.next();
    if (problem.nearly_parallel || problem.weights_far_apart) continue;
    BOOST_TEST_CONTEXT("problem " << problems++)
    check(Stand(problem, makeWrenches(problem.wrench, random, 13), random), tally);
  }
  if (tally.solved + tally.relaxed == 0) return;  // a machine without lanes
  BOOST_TEST(tally.solved > 2000);
  BOOST_TEST(tally.relaxed > 10000);
  BOOST_TEST(tally.in_lanes > 0.9 * tally.bound);
}

BOOST_AUTO_TEST_CASE(contacts_of_each_kind_are_shared_in_lanes) {
  const Vector3d left(0., 0.12, -0.7), right(0., -0.12, -0.7), along(0.1, 0., 0.);
  std::vector<ProblemContact> slopes = makeCorners(), slippery = makeCorners();
  for (ProblemContact& corner : slopes)
    corner.rotation = Eigen::AngleAxisd(0.3, Vector3d(1., 2., 0.).normalized()).matrix();
  for (ProblemContact& corner : slippery) corner.mu = 0.;
  ProblemContact ball = makePoint(left);  // of a hand, and easier to press
  ball.rotation = Eigen::AngleAxisd(-1.2, Vector3d::UnitX()).matrix();
  ball.weights << 0.3, 0.3, 0.2;
  ProblemContact line = makeSole(left);
  line.half_width = 0.;
  const std::map<std::string, std::vector<ProblemContact>> sorts = {
      {"corners of two soles", makeCorners()},
      {"corners on a slope", slopes},
      {"corners without friction", slippery},
      {"a point", {makePoint(left)}},
      {"a point without friction", {makePoint(left, 0.)}},
      {"two points", {makePoint(left), makePoint(right)}},
      {"points on an edge",
       {makePoint(left - along), makePoint(left), makePoint(left + along),
        makePoint(left + 2. * along)}},
      {"points at one place", {makePoint(left), makePoint(left), makePoint(right)}},
      {"a sole", {makeSole(left)}},
      {"two soles", {makeSole(left), makeSole(right)}},
      {"a sole without friction", {makeSole(left, 0., 0.)}},
      {"a sole without width", {line}},
      {"a sole and a hand", {makeSole(right), ball}},
  };
  for (const auto& [name, contacts] : sorts) BOOST_TEST_CONTEXT(name) {
      Random random(303);
      Tally tally;
      for (const bool all_active : {true, false}) {
        const Problem problem = makeProblem(contacts);
        check(Stand(problem, makeWrenches(problem.wrench, random, 101), random, all_active), tally);
      }
      if (tally.solved + tally.relaxed == 0) return;  // a machine without lanes
      BOOST_TEST(tally.relaxed > 20);
      BOOST_TEST(tally.in_lanes > 0.4 * tally.bound);  // single forces may round alike
    }
}

BOOST_AUTO_TEST_CASE(forces_in_cones_are_those_of_one_frame_at_a_time) {
  ProblemGenerator generator(311);
  Random random(312);
  Tally tally;
  int problems = 0;
  while (problems < 500) {
    Problem problem = generator.next();
    if (problem.nearly_parallel || problem.weights_far_apart) continue;
    for (ProblemContact& contact : problem.contacts) {
      contact.is_cone = contact.mu > 0.;
      contact.weights[1] = contact.weights[0];
    }
    BOOST_TEST_CONTEXT("problem " << problems++)
    checkCones(Stand(problem, makeWrenches(problem.wrench, random, 13), random), tally);
  }
  if (tally.solved + tally.relaxed == 0) return;  // a machine without lanes
  BOOST_TEST(tally.solved > 1000);
  BOOST_TEST(tally.relaxed > 5000);
  BOOST_TEST(tally.failed < 0.005 * (tally.solved + tally.relaxed));
  BOOST_TEST(tally.uncertified < 0.005 * (tally.solved + tally.relaxed));
  BOOST_TEST(tally.in_lanes > 0.9 * tally.bound);
}

BOOST_AUTO_TEST_CASE(contacts_of_each_kind_with_cones_are_shared_in_lanes) {
  const Vector3d left(0., 0.12, -0.7), right(0., -0.12, -0.7), along(0.1, 0., 0.);
  std::vector<ProblemContact> slopes = makeCorners(), mixed = makeCorners();
  for (ProblemContact& corner : slopes)
    corner.rotation = Eigen::AngleAxisd(0.3, Vector3d(1., 2., 0.).normalized()).matrix();
  for (ProblemContact& corner : mixed) corner.is_cone = corner.lever.y() > 0.;
  const std::map<std::string, std::vector<ProblemContact>> sorts = {
      {"corners of two soles", makeCones(makeCorners())},
      {"corners on a slope", makeCones(slopes)},
      {"a point", makeCones({makePoint(left)})},
      {"two points", makeCones({makePoint(left), makePoint(right)})},
      {"points on an edge", makeCones({makePoint(left - along), makePoint(left),
                                       makePoint(left + along), makePoint(left + 2. * along)})},
      {"a sole", makeCones({makeSole(left)})},
      {"two soles", makeCones({makeSole(left), makeSole(right)})},
      {"a sole and a point", makeCones({makeSole(right), makePoint(left)})},
      {"pyramids and cones", mixed},
  };
  for (const auto& [name, contacts] : sorts) BOOST_TEST_CONTEXT(name) {
      Random random(313);
      Tally tally;
      for (const bool all_active : {true, false}) {
        const Problem problem = makeProblem(contacts);
        checkCones(Stand(problem, makeWrenches(problem.wrench, random, 101), random, all_active),
                   tally);
      }
      if (tally.solved + tally.relaxed == 0) return;  // a machine without lanes
      BOOST_TEST(tally.relaxed > 20);
      BOOST_TEST(tally.uncertified < 0.005 * (tally.solved + tally.relaxed));
      // A point alone gives most by its normal force, which may round alike.
      BOOST_TEST(tally.in_lanes > (name == "a point" ? 0.5 : 0.95) * tally.bound);
    }
}

BOOST_AUTO_TEST_CASE(cones_with_unequal_weights_are_left_to_one_frame_at_a_time) {
  Problem problem = makeProblem(makeCones(makeCorners()));
  for (ProblemContact& contact : problem.contacts) contact.weights << 1., 2., 1.;
  Random random(314);
  Tally tally;
  checkCones(Stand(problem, makeWrenches(problem.wrench, random, 21), random, true), tally);
  BOOST_TEST(tally.failed == 0);
  BOOST_TEST(tally.uncertified == 0);
}

BOOST_AUTO_TEST_CASE(a_foot_that_is_all_but_level_tips_over_its_side_in_lanes) {
  // Its other side is pulled sideways by less than counts, and by more than rounding.
  std::vector<ProblemContact> corners = makeCorners();
  corners.resize(4);
  for (const std::size_t k : {1, 3}) corners[k].lever.z() += 1e-10;
  Problem problem = makeProblem(corners);
  problem.wrench << 7., 10., 343., 28., 7., 3.;
  Random random(305);
  std::vector<Vector6> wrenches;
  for (int k = 0; k < 101; ++k) wrenches.push_back(problem.wrench + 3. * Vector6(random.vector(6)));
  Tally tally;
  check(Stand(problem, wrenches, random, true), tally);
  BOOST_TEST(tally.solved == 0);
  BOOST_TEST(tally.in_lanes > 0.9 * tally.bound);
}

BOOST_AUTO_TEST_CASE(a_frame_does_not_depend_on_those_beside_it) {
  // Bit for bit, whatever they need.
  Random random(304);
  const Problem problem = makeProblem(makeCorners());
  Stand stand(problem, makeWrenches(problem.wrench, random, 301), random);
  for (const int lanes : findLanes(stand.robot())) {
    const MotionAnalysis forwards = stand.analyze(lanes);
    stand.reverse();
    const MotionAnalysis backwards = stand.analyze(lanes);
    stand.reverse();
    for (std::size_t k = 0; k < problem.contacts.size(); ++k)
      BOOST_TEST((forwards.contacts[k].wrench == backwards.contacts[k].wrench.rowwise().reverse()));
    BOOST_TEST((forwards.residual == backwards.residual.rowwise().reverse()));
  }
}

BOOST_AUTO_TEST_CASE(a_frame_has_the_forces_that_it_has_alone) {
  // Bit for bit, also where those beside it have contacts that it does not have.
  const Vector3d left(0., 0.12, -0.7), right(0., -0.12, -0.7), behind(-0.2, 0., -0.7);
  const std::map<std::string, std::vector<ProblemContact>> sorts = {
      {"corners of two soles", makeCorners()},
      {"points", {makePoint(left), makePoint(right), makePoint(behind)}},
      {"soles and a point", {makeSole(left), makeSole(right), makePoint(behind, 0.)}},
      {"corners with cones", makeCones(makeCorners())},
      {"soles and a point with cones",
       makeCones({makeSole(left), makeSole(right), makePoint(behind, 0.3)})},
  };
  for (const auto& [name, contacts] : sorts) BOOST_TEST_CONTEXT(name) {
      Random random(306);
      const Problem problem = makeProblem(contacts);
      const Stand stand(problem, makeWrenches(problem.wrench, random, 301), random);
      for (const int lanes : findLanes(stand.robot())) {
        const MotionAnalysis together = stand.analyze(lanes);
        for (Index frame = 0; frame < stand.frames(); ++frame) {
          BOOST_TEST_CONTEXT(lanes << " lanes, frame " << frame) {
            const MotionAnalysis alone = stand.only(frame).analyze(lanes);
            BOOST_TEST(alone.status[0] == together.status[static_cast<std::size_t>(frame)]);
            BOOST_TEST((alone.residual == together.residual.col(frame)));
            for (std::size_t k = 0; k < contacts.size(); ++k)
              BOOST_TEST((alone.contacts[k].wrench == together.contacts[k].wrench.col(frame)));
          }
        }
      }
    }
}
