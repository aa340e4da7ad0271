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
      robot_.addContact(std::make_shared<ContactPoint>(settings), name);
    } else {
      Contact6DSettings settings;
      settings.mu = contact.mu;
      settings.gu = contact.gu;
      settings.half_length = contact.half_length;
      settings.half_width = contact.half_width;
      settings.weights = contact.weights;
      settings.frame_name = frame;
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
  long solved = 0, relaxed = 0;
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
        BOOST_TEST(dynacom_tests::check(problem, actual).error == "");
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
