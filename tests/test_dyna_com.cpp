// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE dyna_com
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iostream>
#include <limits>
#include <map>
#include <set>
#include <sstream>
#include <utility>

#include "dynacom/contact6d.hpp"
#include "dynacom/contact_point.hpp"
#include "dynacom/dyna_com.hpp"
#include "feet.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();
const double kInfinity = std::numeric_limits<double>::infinity();

/// A robot with two soles on the ground, and its DynaCoM.
struct Biped {
  explicit Biped(unsigned seed)
      : random(seed), model(standingRobot(random, stance(2))), dynacom(model) {
    dynacom.addContact(left, "left");
    dynacom.addContact(right, "right");
  }

  /// Near to the pose in which the soles are level.
  State moving() { return randomState(model, random, 0.05); }

  Random random;
  pinocchio::Model model;
  DynaCoM dynacom;
  std::shared_ptr<Contact6D> left = makeSole("sole0"), right = makeSole("sole1");
};

void compute(DynaCoM& dynacom, const State& x, const Vector6& external = Vector6::Zero(),
             bool flat = true) {
  dynacom.computeDynamics(x.q, x.v, x.a, external, flat);
}

Vector6 groundWrench(const DynaCoM& dynacom) {
  return (Vector6() << dynacom.getGroundCoMForce(), dynacom.getGroundCoMTorque()).finished();
}

DistributionStatus distribute(DynaCoM& dynacom) {
  return dynacom.distributeForce(dynacom.getGroundCoMForce(), dynacom.getGroundCoMTorque(),
                                 dynacom.getCoM());
}

DistributionStatus distribute(DynaCoM& dynacom, const Vector6& wrench, const Vector3d& com) {
  return dynacom.distributeForce(wrench.head<3>(), wrench.tail<3>(), com);
}

/// What the contacts give, about the CoM that Pinocchio finds.
Vector6 givenWrench(const DynaCoM& dynacom, const VectorXd& q) {
  Vector6 sum = Vector6::Zero();
  for (const auto& name : dynacom.getActiveContacts())
    sum += dynacom.getContact(name)->toWorldForces();
  sum.tail<3>() -= comOf(dynacom.getModel(), q).cross(Vector3d(sum.head<3>()));
  return sum;
}

/// Newton and Euler: the accelerations (c̈, L̇) that a wrench of the ground causes, with another one.
Vector6 accelerationsBy(const pinocchio::Model& model, const Vector6& ground,
                        const Vector6& external) {
  Vector6 accelerations = ground + external;
  accelerations.head<3>() /= totalMass(model);
  accelerations.head<3>() += model.gravity.linear();
  return accelerations;
}

Vector6 feasibleAccelerations(const DynaCoM& dynacom) {
  return (Vector6() << dynacom.getFeasibleACoM(), dynacom.getFeasibleAMVariation()).finished();
}

/// The external wrench with which the ground must give the one that is wanted.
Vector6 externalFor(DynaCoM& dynacom, const State& x, const Vector6& wanted) {
  compute(dynacom, x);
  return groundWrench(dynacom) - wanted;
}

/// Equation (6) in the words of the manual: the mean of the contacts' own centres of pressure, by
/// vertical force. Each is where the moment of the contact's wrench in the world, taken there, is
/// about the surface's normal only.
Vector2d meanPressure(const std::vector<std::shared_ptr<ContactBase>>& contacts) {
  Vector2d sum = Vector2d::Zero();
  double total = 0.;
  for (const auto& contact : contacts) {
    const Vector6 wrench = contact->toWorldForces();
    const Vector3d force = wrench.head<3>(), origin = contact->getSurfacePose().translation();
    const Vector3d normal = contact->getSurfacePose().rotation().col(2);
    const Vector3d moment = wrench.tail<3>() - origin.cross(force);
    const Vector3d centre = origin + normal.cross(moment) / normal.dot(force);
    sum += force.z() * centre.head<2>();
    total += force.z();
  }
  return sum / total;
}

/// All that an outsider can see of a DynaCoM, in words, so that two moments can be compared.
using View = std::map<std::string, std::string>;

View everythingSeen(const DynaCoM& dynacom) {
  View view;
  const auto see = [&](const std::string& what, const auto& value) {
    std::ostringstream out;
    out.precision(17);
    out << value;
    view[what] = out.str();
  };
  see("settings", dynacom.getSettings());
  see("nq", dynacom.getModel().nq);
  see("mass", dynacom.getMass());
  see("ground height", dynacom.getGroundHeight());
  see("ground force", dynacom.getGroundCoMForce().transpose());
  see("ground torque", dynacom.getGroundCoMTorque().transpose());
  see("CoM", dynacom.getCoM().transpose());
  see("VCoM", dynacom.getVCoM().transpose());
  see("ACoM", dynacom.getACoM().transpose());
  see("AM", dynacom.getAM().transpose());
  see("AM variation", dynacom.getAMVariation().transpose());
  see("CoP", dynacom.getCoP().transpose());
  see("CoP in space", dynacom.getCoP3D().transpose());
  see("VRP", dynacom.getVRP().transpose());
  see("VRP in space", dynacom.getVRP3D().transpose());
  see("eCMP", dynacom.getECMP().transpose());
  see("CMP", dynacom.getCMP(GroundPlane()).transpose());
  see("ZMP", dynacom.getZMP(GroundPlane()).transpose());
  see("NL", dynacom.getNL().transpose());
  see("minimal vertical force", dynacom.getMinimalVerticalForce());
  see("CoP is defined", dynacom.isCoPDefined());
  see("feasible ACoM", dynacom.getFeasibleACoM().transpose());
  see("feasible AM variation", dynacom.getFeasibleAMVariation().transpose());
  see("wrench weights", dynacom.getWrenchWeights().transpose());
  see("status", dynacom.getDistributionStatus());
  const DistributionResult& result = dynacom.getDistribution();
  see("achieved", result.achieved.transpose());
  see("residual", result.residual.transpose());
  see("scale", result.scale);
  see("cost", result.cost);
  see("iterations", result.iterations);
  see("forces of the distribution", result.forces().transpose());
  see("multipliers", result.wrench_multipliers.transpose());
  see("forces", dynacom.allForces().transpose());
  see("ne_b", dynacom.ne_b().transpose());
  see("ne_A", dynacom.ne_A());
  see("uni_A", dynacom.uni_A());
  see("fri_A", dynacom.fri_A());
  see("reg_A", dynacom.reg_A().transpose());
  for (const auto& name : dynacom.getActiveContacts()) view["order of the active"] += name + " ";
  for (const auto& name : dynacom.getKnownContacts()) {
    view["order of the known"] += name + " ";
    const ContactBase& contact = *dynacom.getContact(name);
    see("frame of " + name, contact.getFrameID());
    see("pose of " + name, contact.getPose());
    see("force of " + name, contact.appliedForce().transpose());
    see("CoP of " + name, dynacom.getContactCoP(name).transpose());
    see("CoP margin of " + name, dynacom.getContactCoPMargin(name));
    see("friction usage of " + name, dynacom.getContactFrictionUsage(name));
    see("yaw usage of " + name, dynacom.getContactYawUsage(name));
  }
  return view;
}

/// Whether nothing differs; else, what does.
boost::test_tools::predicate_result same(View one, View other) {
  boost::test_tools::predicate_result result(one == other);
  for (const auto& [what, value] : other)
    if (one[what] != value) result.message() << "\n" << what << ": " << one[what] << " | " << value;
  for (const auto& [what, value] : one)
    if (other.count(what) == 0) result.message() << "\n" << what << ": " << value << " | nothing";
  return result;
}

/// Whether nothing at all is known of the motion.
bool motionIsUnknown(const DynaCoM& dynacom) {
  for (const auto& value :
       {dynacom.getGroundCoMForce(), dynacom.getGroundCoMTorque(), dynacom.getCoM(),
        dynacom.getVCoM(), dynacom.getACoM(), dynacom.getAM(), dynacom.getAMVariation(),
        dynacom.getFeasibleACoM(), dynacom.getFeasibleAMVariation(), dynacom.getCoP3D(),
        dynacom.getVRP3D(), dynacom.getECMP(), dynacom.getCMP(GroundPlane())})
    if (!allNaN(value)) return false;
  return allNaN(dynacom.getCoP()) && allNaN(dynacom.getVRP()) && allNaN(dynacom.getNL()) &&
         !dynacom.isCoPDefined();
}

using Names = std::vector<std::string>;

std::set<std::string> asSet(const Names& names) { return {names.begin(), names.end()}; }

}  // namespace

// --- Dynamics --------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(dynamics_are_those_of_the_free_functions) {
  Random random(1);
  for (unsigned seed = 0; seed < 5; ++seed) {
    const auto model = randomHumanoid(seed);
    const State x = randomState(model, random);
    const Vector6 external = random.vector(6, 50.);
    DynaCoM dynacom(model);
    compute(dynacom, x, external);

    pinocchio::Data data(model);
    const auto state = computeCentroidalState(model, data, x.q, x.v, x.a);
    const auto wrench = computeGroundWrench(state, model.gravity.linear(), external);
    BOOST_TEST(close(dynacom.getMass(), state.mass));
    BOOST_TEST(close(dynacom.getCoM(), state.com, 0.));
    BOOST_TEST(close(dynacom.getVCoM(), state.vcom, 0.));
    BOOST_TEST(close(dynacom.getACoM(), state.acom, 0.));
    BOOST_TEST(close(dynacom.getAM(), state.am, 0.));
    BOOST_TEST(close(dynacom.getAMVariation(), state.amVariation, 0.));
    BOOST_TEST(close(dynacom.getGroundCoMForce(), wrench.force, 0.));
    BOOST_TEST(close(dynacom.getGroundCoMTorque(), wrench.torque, 0.));
  }
}

BOOST_AUTO_TEST_CASE(ground_wrench_is_that_of_recursive_newton_euler) {
  Random random(2);
  for (const double g : {-9.81, 0., -1.62, -100.}) {
    auto model = randomTree(random);
    model.gravity.linear() << 0., 0., g;
    DynaCoM dynacom(model);
    const State x = randomState(model, random);
    const Vector6 external = random.vector(6, 50.);
    compute(dynacom, x);
    BOOST_TEST(close(groundWrench(dynacom), rootWrench(model, x)));
    compute(dynacom, x, external);
    BOOST_TEST(close(groundWrench(dynacom), rootWrench(model, x) - external));
  }
}

namespace {

/// Data on which the algorithm has run that computeDynamics(data) wants.
pinocchio::Data knownMotion(const pinocchio::Model& model, const State& x) {
  pinocchio::Data data(model);
  runCentroidalDynamics(model, data, x);
  return data;
}

/// All that two DynaCoM compute of a motion, relative to each number's size.
void checkSameMotion(const DynaCoM& one, const DynaCoM& other) {
  BOOST_TEST(close(groundWrench(one), groundWrench(other)));
  BOOST_TEST(close(one.getCoM(), other.getCoM()));
  BOOST_TEST(close(one.getVCoM(), other.getVCoM()));
  BOOST_TEST(close(one.getACoM(), other.getACoM()));
  BOOST_TEST(close(one.getAM(), other.getAM()));
  BOOST_TEST(close(one.getAMVariation(), other.getAMVariation()));
  BOOST_TEST(one.isCoPDefined() == other.isCoPDefined());
  if (one.isCoPDefined()) BOOST_TEST(close(one.getCoP(), other.getCoP()));
  if (!allNaN(other.getVRP())) BOOST_TEST(close(one.getVRP(), other.getVRP()));
  if (!allNaN(other.getNL())) BOOST_TEST(close(one.getNL(), other.getNL()));
  if (!allNaN(other.getFeasibleACoM()))
    BOOST_TEST(close(feasibleAccelerations(one), feasibleAccelerations(other)));
  BOOST_TEST(one.getDistributionStatus() == other.getDistributionStatus());
  BOOST_TEST(close(one.allForces(), other.allForces()));
  BOOST_TEST(close(one.ne_A(), other.ne_A()));
  for (const auto& name : other.getKnownContacts())
    BOOST_TEST(close(one.getContact(name)->getPose().toHomogeneousMatrix(),
                     other.getContact(name)->getPose().toHomogeneousMatrix()));
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_motion_that_is_known_gives_the_same_results) {
  int solved = 0, relaxed = 0;
  for (unsigned seed = 0; seed < 20; ++seed) {
    Biped computed(100 + seed), known(100 + seed);
    computed.dynacom.addContact(makePoint("sole0"), "idle", false);
    known.dynacom.addContact(makePoint("sole0"), "idle", false);
    for (int trial = 0; trial < 4; ++trial) {
      const State x = computed.moving();
      const Vector6 external = computed.random.vector(6, trial % 2 == 0 ? 2. : 300.);
      const bool flat = trial == 0;
      compute(computed.dynacom, x, external, flat);
      computed.dynacom.computeNL(3.);
      known.dynacom.computeDynamics(knownMotion(known.model, x), external, flat);
      known.dynacom.computeNL(3.);
      checkSameMotion(known.dynacom, computed.dynacom);
      if (flat) continue;
      const auto status = known.dynacom.getDistributionStatus();
      (status == DistributionStatus::Solved ? solved : relaxed) += 1;
    }
    // Without what is not said: no external wrench, on flat ground.
    const State x = computed.moving();
    computed.dynacom.computeDynamics(x.q, x.v, x.a);
    known.dynacom.computeDynamics(knownMotion(known.model, x));
    checkSameMotion(known.dynacom, computed.dynacom);
  }
  BOOST_TEST(solved > 10);
  BOOST_TEST(relaxed > 10);
  // Robots of every kind.
  Random random(101);
  for (unsigned seed = 0; seed < 5; ++seed) {
    const auto model = randomHumanoid(seed);
    const State x = randomState(model, random);
    DynaCoM computed(model), known(model);
    compute(computed, x);
    known.computeDynamics(knownMotion(model, x));
    checkSameMotion(known, computed);
  }
}

BOOST_AUTO_TEST_CASE(a_motion_that_is_known_is_copied) {
  Biped computed(102), known(102);
  const State x = computed.moving();
  compute(computed.dynacom, x);
  {
    pinocchio::Data data = knownMotion(known.model, x);
    known.dynacom.computeDynamics(data);
    const View before = everythingSeen(known.dynacom);
    // It becomes that of another motion, and is gone then.
    runCentroidalDynamics(known.model, data, known.moving());
    for (auto& placement : data.oMi) placement.translation().setConstant(kNaN);
    data.com[0].setConstant(kNaN);
    BOOST_TEST(same(everythingSeen(known.dynacom), before));
  }
  // Contacts are placed by it all the same.
  for (Biped* biped : {&computed, &known}) {
    biped->dynacom.deactivateContact("left");
    biped->dynacom.activateContact("left");
    biped->dynacom.addContact(makePoint("sole1"), "late");
    biped->dynacom.computeNL(3.);
    distribute(biped->dynacom);
  }
  checkSameMotion(known.dynacom, computed.dynacom);
  for (pinocchio::JointIndex joint = 0; joint < known.dynacom.getData().oMi.size(); ++joint)
    BOOST_TEST(close(known.dynacom.getData().oMi[joint].toHomogeneousMatrix(),
                     computed.dynacom.getData().oMi[joint].toHomogeneousMatrix()));
  // It may be the data of the DynaCoM itself.
  const State y = computed.moving();
  runCentroidalDynamics(known.dynacom.getModel(), known.dynacom.getData(), y);
  known.dynacom.computeDynamics(known.dynacom.getData(), Vector6::Zero(), false);
  compute(computed.dynacom, y, Vector6::Zero(), false);
  known.dynacom.computeNL(3.);
  computed.dynacom.computeNL(3.);
  checkSameMotion(known.dynacom, computed.dynacom);
}

BOOST_AUTO_TEST_CASE(a_motion_that_is_not_finite_is_not_known) {
  for (const bool flat : {true, false}) {
    for (int i = 0; i < 3; ++i) {
      Biped biped(103);
      compute(biped.dynacom, restState(biped.model), Vector6::Zero(), false);
      const VectorXd forces = biped.dynacom.allForces();
      State x = restState(biped.model);
      (i == 0 ? x.q : i == 1 ? x.v : x.a)[2] = kNaN;
      biped.dynacom.computeDynamics(knownMotion(biped.model, x), Vector6::Zero(), flat);
      BOOST_TEST(motionIsUnknown(biped.dynacom));
      BOOST_TEST(close(biped.dynacom.allForces(), forces, 0.));
      BOOST_TEST(biped.dynacom.getDistributionStatus() ==
                 (flat ? DistributionStatus::Solved : DistributionStatus::InvalidInput));
    }
    Biped biped(103);
    biped.dynacom.computeDynamics(knownMotion(biped.model, biped.moving()),
                                  Vector6::Constant(kInfinity), flat);
    BOOST_TEST(motionIsUnknown(biped.dynacom));
  }
}

BOOST_AUTO_TEST_CASE(data_of_no_motion_are_refused_and_change_nothing) {
  Biped biped(104);
  DynaCoM& dynacom = biped.dynacom;
  const State x = biped.moving();
  dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  const auto check = [&](const auto& refused) {
    for (const bool flat : {true, false}) {
      const View before = everythingSeen(dynacom);
      const auto placements = dynacom.getData().oMi;
      refused(flat);
      BOOST_TEST(same(everythingSeen(dynacom), before));
      for (std::size_t i = 0; i < placements.size(); ++i)
        BOOST_TEST((dynacom.getData().oMi[i] == placements[i]));
    }
  };
  const std::string joints = std::to_string(biped.model.njoints);
  // Another robot's.
  const auto other = singleBody(10., {});
  const auto wrong_size = [&](const pinocchio::Data& data, const std::string& size) {
    check([&](bool flat) {
      BOOST_TEST(throws<std::invalid_argument>(
          [&] { dynacom.computeDynamics(data, Vector6::Zero(), flat); }, {"oMi", joints, size}));
    });
  };
  wrong_size(knownMotion(other, restState(other)), "2");
  wrong_size(pinocchio::Data(), "0");
  const auto not_ready = [&](const pinocchio::Data& data) {
    check([&](bool flat) {
      BOOST_TEST(
          throws<NotReadyError>([&] { dynacom.computeDynamics(data, Vector6::Zero(), flat); },
                                {"computeCentroidalMomentumTimeVariation", "mass"}));
    });
  };
  // Those of a robot as large, but heavier; those of none; those of a posture.
  auto heavy = biped.model;
  heavy.inertias[1].mass() *= 1.01;
  not_ready(knownMotion(heavy, x));
  not_ready(pinocchio::Data(biped.model));
  pinocchio::Data posture(biped.model);
  runForwardKinematics(biped.model, posture, x.q);
  not_ready(posture);
  auto unknown = knownMotion(biped.model, x);
  unknown.mass[0] = kNaN;
  not_ready(unknown);

  // A contact that cannot be placed is found out before anything changes.
  auto settings = biped.right->getSettings();
  settings.frame_name = "nowhere";
  biped.right->initialize(settings);
  const auto data = knownMotion(biped.model, biped.moving());
  check([&](bool flat) {
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { dynacom.computeDynamics(data, Vector6::Zero(), flat); }, {"nowhere"}));
  });
  settings.frame_name = "sole1";
  biped.right->initialize(settings);
  dynacom.computeDynamics(data);
  BOOST_TEST(close(dynacom.getCoM(), Vector3d(data.com[0]), 0.));

  BOOST_TEST(throws<NotReadyError>([&] { DynaCoM().computeDynamics(data); }, {"initialize"}));
}

BOOST_AUTO_TEST_CASE(at_rest_the_ground_carries_the_weight_below_the_com) {
  Biped biped(3);
  State x = biped.moving();
  x.v.setZero();
  x.a.setZero();
  compute(biped.dynacom, x);
  const double weight = 9.81 * totalMass(biped.model);
  BOOST_TEST(close(biped.dynacom.getMass(), totalMass(biped.model)));
  BOOST_TEST(close(biped.dynacom.getGroundCoMForce(), Vector3d(0., 0., weight)));
  BOOST_TEST(close(biped.dynacom.getGroundCoMTorque(), Vector3d::Zero(), 1e-10));
  BOOST_TEST(close(biped.dynacom.getCoP(), biped.dynacom.getCoM().head<2>()));
}

BOOST_AUTO_TEST_CASE(vectors_may_be_columns_of_a_matrix) {
  Biped biped(4);
  const State x = biped.moving();
  compute(biped.dynacom, x);
  const View expected = everythingSeen(biped.dynacom);
  MatrixXd q(x.q.size(), 2), v(x.v.size(), 2), a(x.a.size(), 2);
  q << x.q, x.q;
  v << x.v, x.v;
  a << x.a, x.a;
  biped.dynacom.computeDynamics(q.col(1), v.col(1), a.col(1));
  BOOST_TEST(same(everythingSeen(biped.dynacom), expected));
}

BOOST_AUTO_TEST_CASE(before_compute_dynamics_all_numbers_are_nan) {
  Biped biped(5);
  DynaCoM& dynacom = biped.dynacom;
  BOOST_TEST(motionIsUnknown(dynacom));
  BOOST_TEST(close(dynacom.getMass(), totalMass(biped.model)));
  // Nor of a distribution.
  const DistributionResult& result = dynacom.getDistribution();
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::NoContact);
  BOOST_TEST(result.status == DistributionStatus::NoContact);
  for (const Vector6& value : {result.wrench, result.achieved, result.residual, dynacom.ne_b()})
    BOOST_TEST(allNaN(value));
  BOOST_TEST(std::isnan(result.cost));
  BOOST_TEST(result.contacts.empty());
  BOOST_TEST(!result.isOptimal());
  BOOST_TEST(std::isnan(dynacom.computeWrenchMargin().margin));
  // Nobody presses on anything yet.
  for (const auto& name : dynacom.getActiveContacts()) {
    BOOST_TEST(allNaN(dynacom.getContactCoP(name)));
    BOOST_TEST(std::isnan(dynacom.getContactCoPMargin(name)));
    BOOST_TEST(dynacom.getContactFrictionUsage(name) == 0.);
    BOOST_TEST(dynacom.getContactYawUsage(name) == 0.);
  }
}

// --- Centre of pressure, virtual repellent point, non-linearity --------------------------------

BOOST_AUTO_TEST_CASE(flat_ground_pressure_by_hand) {
  Biped biped(10);
  const State x = biped.moving();
  for (const double height : {0., 0.25, -0.5}) {
    biped.dynacom.setGroundHeight(height);
    BOOST_TEST(biped.dynacom.getGroundHeight() == height);
    compute(biped.dynacom, x);
    const Vector3d c = biped.dynacom.getCoM(), f = biped.dynacom.getGroundCoMForce();
    const Vector3d tau = biped.dynacom.getGroundCoMTorque();
    const Vector2d expected(c.x() + (-tau.y() - f.x() * (c.z() - height)) / f.z(),
                            c.y() + (tau.x() - f.y() * (c.z() - height)) / f.z());
    BOOST_TEST(close(biped.dynacom.getCoP(), expected));
  }
}

BOOST_AUTO_TEST_CASE(ground_height_must_be_finite) {
  Biped biped(11);
  biped.dynacom.setGroundHeight(0.25);
  for (const auto& [bad, text] : {std::pair<double, const char*>(kNaN, "nan"), {1. / 0., "inf"}})
    BOOST_TEST(throws<std::invalid_argument>([&, h = bad] { biped.dynacom.setGroundHeight(h); },
                                             {"groundHeight", text}));
  BOOST_TEST(biped.dynacom.getGroundHeight() == 0.25);
}

BOOST_AUTO_TEST_CASE(on_flat_ground_both_centres_of_pressure_agree) {
  // Level soles and points, all on one height: equation (5) is equation (6).
  Random random(12);
  int solved = 0;
  for (const double height : {0., 0.3, -0.2}) {
    std::vector<SE3> soles = stance(6);
    for (SE3& sole : soles) {
      sole.translation().z() = height - 0.9;
      // Yaw does not tilt them.
      sole.rotation() =
          Eigen::AngleAxisd(random.uniform(-3., 3.), Vector3d::UnitZ()).toRotationMatrix();
    }
    const auto model = singleBody(50., soles);
    DynaCoM dynacom(model);
    dynacom.setGroundHeight(height);
    for (int i = 0; i < 6; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      if (i < 2)
        dynacom.addContact(makeSole(frame), frame);
      else
        dynacom.addContact(makePoint(frame), frame);
    }
    State x = restState(model);
    x.q.z() = 0.9;  // so that the soles are at the height
    for (int trial = 0; trial < 50; ++trial) {
      Vector6 wanted = random.vector(6, 60.);
      wanted.z() = random.uniform(300., 600.);
      const Vector6 external = externalFor(dynacom, x, wanted);
      compute(dynacom, x, external, true);
      const Vector2d flat = dynacom.getCoP();
      compute(dynacom, x, external, false);
      if (dynacom.getDistributionStatus() != DistributionStatus::Solved) continue;
      ++solved;
      BOOST_TEST(close(dynacom.getCoP(), flat, 1e-8));
    }
  }
  BOOST_TEST(solved > 75);
}

BOOST_AUTO_TEST_CASE(on_uneven_ground_pressure_is_the_mean_by_vertical_force) {
  // Different heights, and soles that tilt: equation (6) is not (5), but still the mean of where
  // the contacts press.
  Random random(13);
  int solved = 0, relaxed = 0, different = 0;
  for (int trial = 0; trial < 200; ++trial) {
    std::vector<SE3> soles = stance(5);
    for (SE3& sole : soles) {
      sole.translation().z() = random.uniform(-1.1, -0.7);
      sole.rotation() =
          Eigen::AngleAxisd(random.uniform(-0.3, 0.3), random.rotation().col(0)).toRotationMatrix();
    }
    const auto model = singleBody(50., soles);
    DynaCoM dynacom(model);
    std::vector<std::shared_ptr<ContactBase>> contacts;
    for (int i = 0; i < 5; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      if (i < 2) {
        contacts.push_back(makeSole(frame));
      } else {
        // Ball feet, too, which touch the ground beside their frame's origin.
        auto settings = makePoint(frame)->getSettings();
        settings.world_aligned = random.coin();
        settings.radius = random.uniform(0., 0.1);
        contacts.push_back(std::make_shared<ContactPoint>(settings));
      }
      dynacom.addContact(contacts.back(), frame);
    }
    State x = restState(model);
    x.q.head<3>() = random.vector3();
    Vector6 wanted = random.vector(6, 40.);
    wanted.z() = random.uniform(300., 600.);
    const Vector6 external = externalFor(dynacom, x, wanted);
    compute(dynacom, x, external, false);
    // A contact without load has no centre of pressure.
    contacts.erase(
        std::remove_if(contacts.begin(), contacts.end(),
                       [](const auto& contact) { return contact->appliedForce().z() < 1e-6; }),
        contacts.end());
    ++(dynacom.getDistributionStatus() == DistributionStatus::Solved ? solved : relaxed);
    BOOST_TEST(dynacom.isCoPDefined());
    const Vector2d uneven = dynacom.getCoP();
    BOOST_TEST(close(uneven, meanPressure(contacts), 1e-8));
    compute(dynacom, x, external, true);
    if ((uneven - dynacom.getCoP()).norm() > 1e-3) ++different;
  }
  BOOST_TEST(solved > 40);
  BOOST_TEST(relaxed > 5);
  BOOST_TEST(different > 25);
}

BOOST_AUTO_TEST_CASE(contacts_without_load_press_nowhere) {
  // The whole weight at the outer edge of the left sole leaves nothing for the right one.
  const auto model = singleBody(50., stance(2));
  DynaCoM dynacom(model);
  const auto left = makeSole("sole0"), right = makeSole("sole1");
  dynacom.addContact(left, "left");
  dynacom.addContact(right, "right");
  const State x = restState(model);
  // The sole's centre is at y = 0.15, half its width is 0.06.
  const double weight = 500., y = 0.15 + 0.06 - 1e-9;
  Vector6 wanted;
  wanted << 0., 0., weight, y * weight, 0., 0.;
  const Vector6 external = externalFor(dynacom, x, wanted);
  compute(dynacom, x, external, false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Solved);
  BOOST_TEST(std::abs(right->appliedForce().z()) < 1e-4);
  BOOST_TEST(close(dynacom.getCoP(), Vector2d(0., y), 1e-8));

  // The same where it takes no part at all.
  dynacom.deactivateContact("right");
  compute(dynacom, x, external, false);
  BOOST_TEST(close(dynacom.getCoP(), Vector2d(0., y), 1e-8));
}

BOOST_AUTO_TEST_CASE(without_vertical_force_there_is_no_centre_of_pressure) {
  // Nor what was there before, nor an infinity.
  Biped biped(14);
  DynaCoM& dynacom = biped.dynacom;
  const State x = biped.moving();
  for (const bool flat : {true, false}) {
    for (const double fz : {0.9, 0., -100.}) {
      compute(dynacom, restState(biped.model), Vector6::Zero(), flat);
      dynacom.computeNL(3.);
      BOOST_TEST(dynacom.isCoPDefined());
      BOOST_TEST(dynacom.getNL().allFinite());

      Vector6 wanted = Vector6::Zero();
      wanted.z() = fz;
      compute(dynacom, x, externalFor(dynacom, x, wanted), flat);
      dynacom.computeNL(3.);
      BOOST_TEST(!dynacom.isCoPDefined());
      BOOST_TEST(allNaN(dynacom.getCoP()));
      BOOST_TEST(dynacom.getVRP().allFinite());
      BOOST_TEST(allNaN(dynacom.getNL()));
    }
  }
}

BOOST_AUTO_TEST_CASE(how_much_vertical_force_it_takes_is_a_setting) {
  Biped biped(15);
  DynaCoM& dynacom = biped.dynacom;
  BOOST_TEST(dynacom.getMinimalVerticalForce() == 1.);
  const State x = restState(biped.model);
  compute(dynacom, x);
  const double fz = dynacom.getGroundCoMForce().z();
  for (const bool flat : {true, false}) {
    // Where forces are summed, the last digits are not known.
    const double margin = flat ? 0. : 1e-9 * fz;
    const double below = std::nextafter(fz - margin, 0.);
    const double above = std::nextafter(fz + margin, kInfinity);
    for (const double threshold : {below, flat ? fz : below}) {
      dynacom.setMinimalVerticalForce(threshold);
      BOOST_TEST(dynacom.getMinimalVerticalForce() == threshold);
      compute(dynacom, x, Vector6::Zero(), flat);
      BOOST_TEST(dynacom.isCoPDefined());
      BOOST_TEST(close(dynacom.getCoP(), dynacom.getCoM().head<2>(), 1e-8));
    }
    dynacom.setMinimalVerticalForce(above);
    compute(dynacom, x, Vector6::Zero(), flat);
    BOOST_TEST(!dynacom.isCoPDefined());
    BOOST_TEST(allNaN(dynacom.getCoP()));
  }
}

BOOST_AUTO_TEST_CASE(how_much_normal_force_it_takes_is_the_same_setting) {
  Biped biped(16);
  DynaCoM& dynacom = biped.dynacom;
  const State x = restState(biped.model);
  compute(dynacom, x, (Vector6() << -20., 10., 0., 0., 0., 1.).finished(), false);
  BOOST_REQUIRE(dynacom.getDistributionStatus() == DistributionStatus::Solved);
  for (const auto& [name, contact] : {std::pair{"left", biped.left}, {"right", biped.right}}) {
    const double fz = contact->appliedForce()[2];
    BOOST_REQUIRE(fz > 1.);
    dynacom.setMinimalVerticalForce(fz);
    BOOST_TEST(dynacom.getContactCoP(name).allFinite());
    BOOST_TEST(dynacom.getContactCoPMargin(name) > 0.);
    BOOST_TEST(dynacom.getContactFrictionUsage(name) > 0.);
    BOOST_TEST(dynacom.getContactYawUsage(name) > 0.);
    dynacom.setMinimalVerticalForce(std::nextafter(fz, kInfinity));
    BOOST_TEST(allNaN(dynacom.getContactCoP(name)));
    BOOST_TEST(std::isnan(dynacom.getContactCoPMargin(name)));
    BOOST_TEST(dynacom.getContactFrictionUsage(name) == 0.);
    BOOST_TEST(dynacom.getContactYawUsage(name) == 0.);
  }
}

BOOST_AUTO_TEST_CASE(a_centre_of_pressure_is_never_infinite) {
  // Without gravity, and at rest, the ground wrench is exactly what is not external.
  auto model = singleBody(1e-3, stance(2));
  model.gravity.setZero();
  DynaCoM dynacom(model);
  dynacom.addContact(makeSole("sole0"), "left");
  dynacom.addContact(makeSole("sole1"), "right");
  for (const double minimum : {1e-320, 1e-300, 1e-3}) {
    dynacom.setMinimalVerticalForce(minimum);
    for (const double fz : {0., 1e-320, 1e-310, 1e-300, 1e-200, 1e-6, 1e3}) {
      for (const double moment : {0., 1e-310, 1., 1e300}) {
        for (const bool flat : {true, false}) {
          const Vector6 wanted = (Vector6() << 0., 0., fz, moment, 0., 0.).finished();
          compute(dynacom, restState(model), -wanted, flat);
          if (dynacom.isCoPDefined())
            BOOST_TEST(dynacom.getCoP().allFinite());
          else
            BOOST_TEST(allNaN(dynacom.getCoP()));
          distribute(dynacom);
          for (const char* name : {"left", "right"}) {
            const Vector2d cop = dynacom.getContactCoP(name);
            BOOST_TEST((cop.allFinite() || allNaN(cop)));
            BOOST_TEST(std::isfinite(dynacom.getContactFrictionUsage(name)));
            BOOST_TEST(std::isfinite(dynacom.getContactYawUsage(name)));
          }
        }
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(out_of_reach_pressure_is_that_of_what_is_achieved) {
  // The ground should give the weight half a metre beside the outer edge of the left sole.
  const auto model = singleBody(50., stance(2));
  DynaCoM dynacom(model);
  const std::shared_ptr<ContactBase> left = makeSole("sole0"), right = makeSole("sole1");
  dynacom.addContact(left, "left");
  dynacom.addContact(right, "right");
  const State x = restState(model);
  const double weight = 500., edge = 0.15 + 0.06, wantedY = edge + 0.5;
  Vector6 wanted;
  wanted << 0., 0., weight, wantedY * weight, 0., 0.;
  const Vector6 external = externalFor(dynacom, x, wanted);
  compute(dynacom, x, external, true);
  BOOST_TEST(close(dynacom.getCoP(), Vector2d(0., wantedY)));
  compute(dynacom, x, external, false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Relaxed);
  BOOST_TEST(std::abs(right->appliedForce().z()) < 1e-6 * weight);
  BOOST_TEST(close(dynacom.getCoP(), Vector2d(0., edge), 1e-8));
  BOOST_TEST(close(dynacom.getCoP(), meanPressure({left}), 1e-8));

  // Who can give nothing presses nowhere.
  wanted << 0., 0., -weight, 0., 0., 0.;
  compute(dynacom, x, externalFor(dynacom, x, wanted), false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Relaxed);
  BOOST_TEST(allNaN(dynacom.getCoP()));
}

// --- Any plane ---------------------------------------------------------------------------------

namespace {

/// A body whose soles and points all stand on one slope, about 0.9 m below it.
struct OnSlope {
  explicit OnSlope(unsigned seed) : random(seed) {
    const Vector3d axis(random.uniform(-1., 1.), random.uniform(-1., 1.), 0.);
    const Matrix3d tilt =
        Eigen::AngleAxisd(random.uniform(0.1, 0.4), axis.normalized()).toRotationMatrix();
    std::vector<SE3> soles = stance(5);
    for (SE3& sole : soles) {
      sole.translation() = tilt * sole.translation() - Vector3d(0., 0., 0.9);
      sole.rotation() = tilt;
    }
    plane = {soles[3].translation(), 2. * tilt.col(2)};
    dynacom.initialize(singleBody(50., soles));
    for (int i = 0; i < 5; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      if (i < 2)
        contacts.push_back(makeSole(frame));
      else
        contacts.push_back(makePoint(frame));
      dynacom.addContact(contacts.back(), frame);
    }
  }

  State rest() const { return restState(dynacom.getModel()); }
  /// An external wrench with which the ground must give about the weight, as it likes to.
  Vector6 external() {
    Vector6 wanted = random.vector(6, 60.);
    wanted.z() = random.uniform(300., 600.);
    return externalFor(dynacom, rest(), wanted);
  }

  Random random;
  GroundPlane plane;
  DynaCoM dynacom;
  std::vector<std::shared_ptr<ContactBase>> contacts;
};

/// Where the moment of all forces of contacts is parallel to the plane's normal, by solving for it:
/// a point p on the plane with n × (τ − p × f) = 0, τ about the world's origin.
Vector3d zeroMomentPoint(const std::vector<std::shared_ptr<ContactBase>>& contacts,
                         const GroundPlane& plane) {
  Vector6 wrench = Vector6::Zero();
  for (const auto& contact : contacts) wrench += contact->toWorldForces();
  const auto skew = [](const Vector3d& v) {
    return (Matrix3d() << 0., -v.z(), v.y(), v.z(), 0., -v.x(), -v.y(), v.x(), 0.).finished();
  };
  const Vector3d n = plane.normal.normalized();
  MatrixXd A(4, 3);
  A << -skew(n) * skew(wrench.head<3>()), n.transpose();
  VectorXd b(4);
  b << n.cross(Vector3d(wrench.tail<3>())), n.dot(plane.point);
  return A.colPivHouseholderQr().solve(b);
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_horizontal_plane_is_flat_ground) {
  for (unsigned seed = 0; seed < 5; ++seed) {
    Biped flat(20 + seed), plane(20 + seed);
    const double height = flat.random.uniform(-0.5, 0.5);
    flat.dynacom.setGroundHeight(height);
    plane.dynacom.setGroundHeight(height);
    const GroundPlane ground{Vector3d(3., -2., height), Vector3d(0., 0., 2.)};
    const State x = flat.moving();
    const Vector6 external = flat.random.vector(6, 50.);
    // To the last digit, and nothing is distributed.
    compute(flat.dynacom, x, external);
    plane.dynacom.computeDynamics(x.q, x.v, x.a, external, ground);
    BOOST_TEST(same(everythingSeen(plane.dynacom), everythingSeen(flat.dynacom)));
    BOOST_TEST(plane.dynacom.getDistributionStatus() == DistributionStatus::NoContact);
    BOOST_TEST(close(flat.dynacom.getCoP3D().z(), height, 1e-15));
    flat.dynacom.computeNL(3., x.q, x.v, x.a, external);
    plane.dynacom.computeNL(3., x.q, x.v, x.a, external, ground);
    BOOST_TEST(same(everythingSeen(plane.dynacom), everythingSeen(flat.dynacom)));
    plane.dynacom.computeDynamics(knownMotion(plane.model, x), external, ground);
    plane.dynacom.computeNL(3.);
    checkSameMotion(plane.dynacom, flat.dynacom);
  }
}

BOOST_AUTO_TEST_CASE(on_a_slope_pressure_is_where_the_contacts_press) {
  // By the force along the normal, each at its own centre of pressure: (6) is by vertical force.
  int solved = 0, relaxed = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    OnSlope slope(seed);
    DynaCoM& dynacom = slope.dynacom;
    const State x = slope.rest();
    const Vector6 external = slope.external();
    dynacom.computeNL(3., x.q, x.v, x.a, external, slope.plane);
    const Vector3d asked = dynacom.getCoP3D();
    BOOST_TEST(close(dynacom.getCoP(), asked.head<2>(), 0.));
    BOOST_TEST(close(dynacom.getNL(), asked.head<2>() - dynacom.getVRP(), 0.));
    BOOST_TEST(close(dynacom.getVRP3D().head<2>(), dynacom.getVRP(), 0.));
    const bool in_reach = distribute(dynacom) == DistributionStatus::Solved;
    ++(in_reach ? solved : relaxed);

    const Vector3d normal = slope.plane.normal.normalized();
    Vector3d sum = Vector3d::Zero();
    double total = 0.;
    for (const auto& contact : slope.contacts) {
      const double pressure = contact->appliedForce().z();
      if (pressure < 1e-6) continue;
      Vector3d at;
      at << contact->getCoP(), 0.;
      sum += pressure * contact->getSurfacePose().act(at);
      total += pressure;
    }
    const Vector3d given = dynacom.getZMP(slope.plane);
    BOOST_TEST(close(given, sum / total, 1e-7));
    BOOST_TEST(close(normal.dot(given - slope.plane.point), 0.));
    if (in_reach) BOOST_TEST(close(given, asked, 1e-6));
  }
  BOOST_TEST(solved > 15);
  BOOST_TEST(relaxed > 5);
}

BOOST_AUTO_TEST_CASE(zero_moment_point_of_contacts_that_stand_anywhere_is_on_any_plane) {
  Random random(21);
  int solved = 0, relaxed = 0;
  for (int trial = 0; trial < 60; ++trial) {
    std::vector<SE3> soles = stance(3);
    for (SE3& sole : soles) {
      sole.translation().z() = random.uniform(-1.1, -0.7);
      sole.rotation() =
          Eigen::AngleAxisd(random.uniform(-0.3, 0.3), random.rotation().col(0)).toRotationMatrix();
    }
    DynaCoM dynacom(singleBody(50., soles));
    std::vector<std::shared_ptr<ContactBase>> contacts;
    for (int i = 0; i < 3; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      contacts.push_back(makeSole(frame));
      dynacom.addContact(contacts.back(), frame);
    }
    State x = restState(dynacom.getModel());
    x.q.head<3>() = random.vector3();
    Vector6 wanted = random.vector(6, 60.);
    wanted.z() = random.uniform(300., 600.);
    const Vector6 external = externalFor(dynacom, x, wanted);
    compute(dynacom, x, external, false);
    ++(dynacom.getDistributionStatus() == DistributionStatus::Solved ? solved : relaxed);
    const GroundPlane plane{random.vector3(), Vector3d::UnitZ() + random.vector3(0.5)};
    const Vector3d expected = zeroMomentPoint(contacts, plane);
    BOOST_TEST(close(dynacom.getZMP(plane), expected, 1e-9));
    // It is of the distribution: what is computed or activated later does not change it, nor which
    // point its moments are about.
    dynacom.computeDynamics(x.q, x.v, Vector6(x.a + random.vector(6)), external, plane);
    dynacom.deactivateContact("sole1");
    BOOST_TEST(close(dynacom.getZMP(plane), expected, 1e-9));
    dynacom.activateContact("sole1");
    const Vector3d other = dynacom.getCoM() + random.vector3();
    distribute(dynacom, wanted, other);
    BOOST_TEST(close(dynacom.getZMP(plane), zeroMomentPoint(contacts, plane), 1e-9));
  }
  BOOST_TEST(solved > 10);
  BOOST_TEST(relaxed > 5);
}

BOOST_AUTO_TEST_CASE(without_forces_of_contacts_there_is_no_zero_moment_point) {
  Biped biped(22);
  DynaCoM& dynacom = biped.dynacom;
  BOOST_TEST(allNaN(dynacom.getZMP(GroundPlane())));
  compute(dynacom, restState(biped.model));
  BOOST_TEST(allNaN(dynacom.getZMP(GroundPlane())));
  distribute(dynacom);
  BOOST_TEST(close(dynacom.getZMP(GroundPlane()), dynacom.getCoP3D(), 1e-8));
  // Nor on the other side of the ground.
  BOOST_TEST(allNaN(dynacom.getZMP({Vector3d::Zero(), -Vector3d::UnitZ()})));
  dynacom.setMinimalVerticalForce(1.001 * dynacom.getGroundCoMForce().z());
  BOOST_TEST(allNaN(dynacom.getZMP(GroundPlane())));
  BOOST_TEST(allNaN(dynacom.getCMP(GroundPlane())));
  dynacom.setMinimalVerticalForce(1.);
  dynacom.deactivateContact("left");
  dynacom.deactivateContact("right");
  distribute(dynacom);
  BOOST_TEST(allNaN(dynacom.getZMP(GroundPlane())));
}

BOOST_AUTO_TEST_CASE(pivots_are_on_the_line_of_the_force_that_presses) {
  int relaxed = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    OnSlope slope(seed);
    DynaCoM& dynacom = slope.dynacom;
    const State x = slope.rest();
    const Vector6 external = slope.external();
    const auto check = [&](const Vector3d& force) {
      const Vector3d c = dynacom.getCoM(), pivot = dynacom.getCMP(slope.plane);
      BOOST_TEST(close(slope.plane.normal.dot(pivot - slope.plane.point), 0.));
      BOOST_TEST(close((c - pivot).cross(force), Vector3d::Zero(), 1e-9));
      // The eCMP has what else acts on the robot, too.
      const Vector3d all = force + external.head<3>();
      const double stiffness = dynacom.getMass() * 3. * 3.;
      BOOST_TEST(close(stiffness * (c - dynacom.getECMP()), all, 1e-9));
      BOOST_TEST(close(dynacom.getVRP3D() - dynacom.getECMP(), Vector3d(0., 0., 9.81 / 9.), 1e-9));
      BOOST_TEST(close(dynacom.getVRP(), dynacom.getVRP3D().head<2>(), 0.));
    };
    dynacom.computeNL(3., x.q, x.v, x.a, external, slope.plane);
    check(dynacom.getGroundCoMForce());
    // On uneven ground it is what the contacts achieve.
    dynacom.computeNL(3., x.q, x.v, x.a, external, false);
    check(dynacom.getDistribution().achieved.head<3>());
    if (dynacom.getDistributionStatus() == DistributionStatus::Relaxed) ++relaxed;
  }
  BOOST_TEST(relaxed > 5);
}

BOOST_AUTO_TEST_CASE(on_the_ground_the_enhanced_pivot_is_the_pivot) {
  // With the ω that puts it there, where nothing else acts on the robot.
  Biped biped(23);
  DynaCoM& dynacom = biped.dynacom;
  for (int trial = 0; trial < 10; ++trial) {
    const State x = biped.moving();
    compute(dynacom, x);
    const double height = dynacom.getCoM().z();
    dynacom.computeNL(std::sqrt(dynacom.getGroundCoMForce().z() / (dynacom.getMass() * height)));
    BOOST_TEST(close(dynacom.getECMP(), dynacom.getCMP(GroundPlane()), 1e-11));
  }
}

BOOST_AUTO_TEST_CASE(on_uneven_ground_pressure_has_a_height) {
  // Two points at different heights, and the weight in the middle between them.
  std::vector<SE3> soles = stance(2);
  soles[0].translation().z() = -0.8;
  soles[1].translation().z() = -1.;
  const auto model = singleBody(50., soles);
  DynaCoM dynacom(model);
  dynacom.addContact(makePoint("sole0"), "left");
  dynacom.addContact(makePoint("sole1"), "right");
  const State x = restState(model);
  compute(dynacom, x, Vector6::Zero(), false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Solved);
  BOOST_TEST(close(dynacom.getCoP3D(), Vector3d(0., 0., -0.9), 1e-8));
}

BOOST_AUTO_TEST_CASE(a_robot_may_press_on_a_wall) {
  // Pulled to the wall behind it by ten times its weight.
  const auto model = singleBody(50., {});
  DynaCoM dynacom(model);
  const double weight = 50. * 9.81;
  Vector6 external = Vector6::Zero();
  external.x() = -10. * weight;
  State x = restState(model);
  x.q.head<3>() << 0.5, 0.2, 2.;
  const GroundPlane wall{Vector3d(-0.5, 0., 0.), Vector3d::UnitX()};
  dynacom.computeDynamics(x.q, x.v, x.a, external, wall);
  BOOST_TEST(close(dynacom.getCoP3D(), Vector3d(-0.5, 0.2, 1.9)));
  BOOST_TEST(close(dynacom.getCMP(wall), dynacom.getCoP3D()));
}

BOOST_AUTO_TEST_CASE(motions_that_are_not_finite_press_nowhere_on_a_plane) {
  Biped biped(24);
  DynaCoM& dynacom = biped.dynacom;
  const State x = restState(biped.model);
  for (int i = 0; i < 3; ++i) {
    dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), GroundPlane());
    BOOST_TEST(dynacom.isCoPDefined());
    State bad = x;
    (i == 0 ? bad.q : i == 1 ? bad.v : bad.a)[2] = kNaN;
    dynacom.computeDynamics(bad.q, bad.v, bad.a, Vector6::Zero(), GroundPlane());
    BOOST_TEST(motionIsUnknown(dynacom));
  }
}

BOOST_AUTO_TEST_CASE(planes_that_are_none_are_refused_and_change_nothing) {
  Biped biped(25);
  DynaCoM& dynacom = biped.dynacom;
  const State x = biped.moving(), y = biped.moving();
  dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  const View before = everythingSeen(dynacom);
  const GroundPlane bad{Vector3d::Zero(), Vector3d::Zero()};
  const auto data = knownMotion(biped.model, y);
  const Vector6 none = Vector6::Zero();
  const std::vector<std::function<void()>> calls = {
      [&] { dynacom.computeDynamics(y.q, y.v, y.a, none, bad); },
      [&] { dynacom.computeDynamics(data, none, bad); },
      [&] { dynacom.computeNL(3., y.q, y.v, y.a, none, bad); }, [&] { dynacom.getCMP(bad); },
      [&] { dynacom.getZMP(bad); }};
  for (const auto& call : calls) {
    BOOST_TEST(throws<std::invalid_argument>(call, {"GroundPlane.normal", "0 0 0"}));
    BOOST_TEST(same(everythingSeen(dynacom), before));
  }
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { dynacom.computeNL(0., y.q, y.v, y.a, none, GroundPlane()); }, {"omega", "0"}));
  BOOST_TEST(same(everythingSeen(dynacom), before));
  BOOST_TEST(throws<NotReadyError>(
      [&] { DynaCoM().computeDynamics(y.q, y.v, y.a, none, GroundPlane()); }, {"initialize"}));
}

BOOST_AUTO_TEST_CASE(minimal_vertical_force_must_be_positive) {
  Biped biped(17);
  biped.dynacom.setMinimalVerticalForce(2.5);
  for (const auto& [bad, text] : {std::pair<double, const char*>(0., "0"),
                                  {-0.25, "-0.25"},
                                  {kNaN, "nan"},
                                  {kInfinity, "inf"},
                                  {-kInfinity, "-inf"}})
    BOOST_TEST(
        throws<std::invalid_argument>([&, f = bad] { biped.dynacom.setMinimalVerticalForce(f); },
                                      {"minimalVerticalForce", text}));
  BOOST_TEST(biped.dynacom.getMinimalVerticalForce() == 2.5);
}

BOOST_AUTO_TEST_CASE(virtual_repellent_point_and_non_linearity_by_hand) {
  Biped biped(16);
  const State x = biped.moving();
  const double omega = 3.5;
  compute(biped.dynacom, x);
  const Vector2d c = biped.dynacom.getCoM().head<2>(), acom = biped.dynacom.getACoM().head<2>();
  const Vector2d vrp = c - acom / (omega * omega);
  biped.dynacom.computeNL(omega);
  BOOST_TEST(close(biped.dynacom.getVRP(), vrp));
  BOOST_TEST(close(biped.dynacom.getNL(), biped.dynacom.getCoP() - vrp));
}

BOOST_AUTO_TEST_CASE(non_linearity_with_a_state_computes_its_dynamics) {
  for (const bool flat : {true, false}) {
    Biped one(17), other(17);
    const State x = one.moving();
    const Vector6 external = one.random.vector(6, 5.);
    compute(one.dynacom, x, external, flat);
    one.dynacom.computeNL(3.);
    other.dynacom.computeNL(3., x.q, x.v, x.a, external, flat);
    BOOST_TEST(same(everythingSeen(one.dynacom), everythingSeen(other.dynacom)));
  }
  // By default without an external wrench, on flat ground.
  Biped one(18), other(18);
  const State x = one.moving();
  compute(one.dynacom, x);
  one.dynacom.computeNL(3.);
  other.dynacom.computeNL(3., x.q, x.v, x.a);
  BOOST_TEST(same(everythingSeen(one.dynacom), everythingSeen(other.dynacom)));
}

BOOST_AUTO_TEST_CASE(the_virtual_repellent_point_is_of_the_motion_that_presses) {
  Biped biped(19);
  DynaCoM& dynacom = biped.dynacom;
  const double omega = 3.5;
  const auto vrpBy = [&](const State& x, const Vector3d& acom) -> Vector2d {
    return (comOf(biped.model, x.q) - acom / (omega * omega)).head<2>();
  };
  int relaxed = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const State x = biped.moving();
    const Vector6 external = biped.random.vector(6, 60.);
    const Vector3d acom =
        accelerationsBy(biped.model, rootWrench(biped.model, x), Vector6::Zero()).head<3>();
    dynacom.computeNL(omega, x.q, x.v, x.a, external, true);
    BOOST_TEST(close(dynacom.getVRP(), vrpBy(x, acom), 1e-10));
    // A distribution does not change what flat ground has to give.
    distribute(dynacom);
    dynacom.computeNL(omega);
    BOOST_TEST(close(dynacom.getVRP(), vrpBy(x, acom), 1e-10));

    dynacom.computeNL(omega, x.q, x.v, x.a, external, false);
    if (dynacom.getDistributionStatus() == DistributionStatus::Relaxed) ++relaxed;
    const Vector6 feasible = accelerationsBy(biped.model, givenWrench(dynacom, x.q), external);
    BOOST_TEST(close(dynacom.getVRP(), vrpBy(x, feasible.head<3>()), 1e-9));
    if (!dynacom.isCoPDefined()) continue;
    BOOST_TEST(close(dynacom.getNL(), dynacom.getCoP() - dynacom.getVRP()));
    // Another distribution is not what p and v are of: both stay those of the same motion.
    const Vector2d nl = dynacom.getNL(), vrp = dynacom.getVRP();
    distribute(dynacom, 2. * dynacom.getDistribution().wrench, dynacom.getCoM());
    BOOST_REQUIRE(!close(dynacom.getFeasibleACoM(), feasible.head<3>(), 1e-3));
    dynacom.computeNL(omega);
    BOOST_TEST(close(dynacom.getVRP(), vrp, 0.));
    BOOST_TEST(close(dynacom.getNL(), nl, 0.));
  }
  BOOST_TEST(relaxed > 5);
  BOOST_TEST(relaxed < 20);
}

// --- What the contacts can cause ---------------------------------------------------------------

BOOST_AUTO_TEST_CASE(feasible_accelerations_are_those_that_the_forces_cause) {
  int solved = 0, relaxed = 0;
  for (unsigned seed = 80; seed < 100; ++seed) {
    Biped biped(seed);
    DynaCoM& dynacom = biped.dynacom;
    for (const bool flat : {true, false}) {
      for (const double size : {2., 200.}) {
        const State x = biped.moving();
        const Vector6 external = biped.random.vector(6, size);
        compute(dynacom, x, external, flat);
        if (flat) {
          // Nobody has asked the contacts yet, although there was a distribution before.
          BOOST_TEST(allNaN(feasibleAccelerations(dynacom)));
          distribute(dynacom);
        }
        const Vector6 feasible = feasibleAccelerations(dynacom);
        BOOST_TEST(close(feasible,
                         accelerationsBy(biped.model, givenWrench(dynacom, x.q), external), 1e-9));
        const Vector6 wanted =
            accelerationsBy(biped.model, rootWrench(biped.model, x), Vector6::Zero());
        if (dynacom.getDistributionStatus() == DistributionStatus::Solved) {
          ++solved;
          BOOST_TEST(close(feasible, wanted, 1e-7));
        } else {
          ++relaxed;
          BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Relaxed);
          BOOST_TEST(!close(feasible, wanted, 1e-7));
        }
        // The motion that was asked for is what it was.
        BOOST_TEST(close(dynacom.getACoM(), wanted.head<3>(), 1e-10));
        BOOST_TEST(close(dynacom.getAMVariation(), wanted.tail<3>(), 1e-10));
      }
    }
  }
  BOOST_TEST(solved > 20);
  BOOST_TEST(relaxed > 20);
}

BOOST_AUTO_TEST_CASE(feasible_accelerations_are_of_the_last_distribution) {
  Biped biped(100);
  DynaCoM& dynacom = biped.dynacom;
  const State x = restState(biped.model);
  const Vector6 external = biped.random.vector(6, 5.);
  compute(dynacom, x, external, false);
  const Vector6 other = (Vector6() << 10., 0., 150., 0., 0., 0.).finished();
  distribute(dynacom, other, dynacom.getCoM());
  BOOST_TEST(close(feasibleAccelerations(dynacom),
                   accelerationsBy(biped.model, givenWrench(dynacom, x.q), external), 1e-9));
}

BOOST_AUTO_TEST_CASE(in_flight_only_gravity_and_what_is_external_accelerate) {
  Biped biped(101);
  DynaCoM& dynacom = biped.dynacom;
  dynacom.deactivateContact("left");
  dynacom.deactivateContact("right");
  for (const bool flat : {true, false}) {
    const State x = biped.moving();
    const Vector6 external = biped.random.vector(6, 50.);
    dynacom.computeNL(3., x.q, x.v, x.a, external, flat);
    if (flat) BOOST_TEST(distribute(dynacom) == DistributionStatus::NoContact);
    BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::NoContact);
    const Vector6 expected = accelerationsBy(biped.model, Vector6::Zero(), external);
    BOOST_TEST(close(feasibleAccelerations(dynacom), expected));
    BOOST_TEST(dynacom.allForces().size() == 0);
    BOOST_TEST(close(dynacom.getDistribution().achieved, Vector6::Zero(), 0.));
    BOOST_TEST(close(dynacom.getDistribution().residual, groundWrench(dynacom), 0.));
    // Equation (5) would know of ground; contacts that are none do not press.
    BOOST_TEST(dynacom.isCoPDefined() == flat);
    if (flat) continue;
    BOOST_TEST(allNaN(dynacom.getCoP()));
    BOOST_TEST(allNaN(dynacom.getNL()));
    const Vector2d vrp = (comOf(biped.model, x.q) - Vector3d(expected.head<3>()) / 9.).head<2>();
    BOOST_TEST(close(dynacom.getVRP(), vrp));
  }
}

BOOST_AUTO_TEST_CASE(a_free_fall_asks_the_ground_for_nothing) {
  // What is left of the ground wrench is rounding, which neither contacts nor their absence mind.
  const auto model = singleBody(50., stance(2));
  for (const bool inContact : {true, false}) {
    DynaCoM dynacom(model);
    if (inContact) {
      dynacom.addContact(makeSole("sole0"), "left");
      dynacom.addContact(makePoint("sole1"), "right");
    }
    Random random(102);
    for (int trial = 0; trial < 20; ++trial) {
      State x = randomState(model, random);
      x.v.setZero();
      x.a.setZero();
      // In the body's axes.
      x.a.head<3>() =
          framePlacement(model, x.q, "sole0").rotation().transpose() * model.gravity.linear();
      dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
      BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Solved);
      BOOST_TEST(close(dynacom.allForces(), VectorXd::Zero(inContact ? 9 : 0), 1e-9));
      BOOST_TEST(close(dynacom.getFeasibleACoM(), model.gravity.linear(), 1e-10));
      BOOST_TEST(close(dynacom.getFeasibleAMVariation(), Vector3d::Zero(), 1e-10));
      BOOST_TEST(!dynacom.isCoPDefined());
      BOOST_TEST(allNaN(dynacom.getNL()));
      compute(dynacom, x);
      BOOST_TEST(!dynacom.isCoPDefined());
    }
  }
}

// --- Distribution ------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(forces_sum_to_the_ground_wrench_within_the_cones) {
  Random random(20);
  int solved = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const auto model = standingRobot(random, stance(4));
    DynaCoM dynacom(model);
    for (int i = 0; i < 4; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      if (i == 0)
        dynacom.addContact(makeSole(frame), frame);
      else
        dynacom.addContact(makePoint(frame), frame);
    }
    const State x = randomState(model, random, 0.05);
    const Vector6 external = random.vector(6, 5.);
    compute(dynacom, x, external);
    const auto status = distribute(dynacom);
    BOOST_TEST(status == dynacom.getDistributionStatus());
    BOOST_TEST(close(dynacom.ne_b(), groundWrench(dynacom), 0.));
    if (status != DistributionStatus::Solved) continue;
    ++solved;

    Vector6 atCoM = Vector6::Zero(), atOrigin = Vector6::Zero();
    for (const auto& name : dynacom.getActiveContacts()) {
      const ContactBase& contact = *dynacom.getContact(name);
      atCoM += contact.toCoMForces();
      atOrigin += contact.toWorldForces();
      const VectorXd& force = contact.appliedForce();
      BOOST_TEST((contact.uni_A() * force).maxCoeff() <= 1e-6);
      BOOST_TEST((contact.fri_A() * force).maxCoeff() <= 1e-6);
    }
    BOOST_TEST(close(atCoM, groundWrench(dynacom), 1e-9));
    const Vector3d force = dynacom.getGroundCoMForce();
    Vector6 expected;
    expected << force, dynacom.getGroundCoMTorque() + dynacom.getCoM().cross(force);
    BOOST_TEST(close(atOrigin, expected, 1e-9));
  }
  BOOST_TEST(solved > 25);
}

BOOST_AUTO_TEST_CASE(out_of_reach_forces_are_the_closest_by_hand) {
  // A point at the CoM gives no moment, and no force outside its pyramid: the closest to one that
  // is beyond is on the edge (μ, 0, 1), where the weighted difference is orthogonal to it.
  const double mu = 0.5;
  const auto model = singleBody(10., {SE3::Identity()});
  DynaCoM dynacom(model);
  const auto point = makePoint("sole0", mu);
  dynacom.addContact(point, "point");
  compute(dynacom, restState(model));
  const Vector6 wrench = (Vector6() << 200., 0., 100., 5., 0., -3.).finished();
  for (const auto& weights :
       {Vector6(Vector6::Ones()), (Vector6() << 3., 1., 0.5, 2., 1., 4.).finished()}) {
    dynacom.setWrenchWeights(weights);
    BOOST_TEST(close(dynacom.getWrenchWeights(), weights, 0.));
    BOOST_TEST(distribute(dynacom, wrench, Vector3d::Zero()) == DistributionStatus::Relaxed);
    const double x = weights[0] * weights[0], z = weights[2] * weights[2];
    const double fz = (x * mu * wrench[0] + z * wrench[2]) / (x * mu * mu + z);
    const Vector3d force(mu * fz, 0., fz);
    BOOST_TEST(close(point->appliedForce(), force, 1e-9));

    const DistributionResult& result = dynacom.getDistribution();
    Vector6 achieved = Vector6::Zero();
    achieved.head<3>() = force;
    BOOST_TEST(result.status == DistributionStatus::Relaxed);
    BOOST_TEST(close(result.wrench, wrench, 0.));
    BOOST_TEST(close(result.achieved, achieved, 1e-9));
    BOOST_TEST(close(result.residual, wrench - achieved, 1e-9));
    BOOST_TEST(close(result.cost, 0.5 * force.squaredNorm(), 1e-9));
    BOOST_TEST(close(result.wrench_weights, weights, 0.));
    BOOST_TEST(result.isOptimal(1e-9));
  }

  // A pull is answered with nothing.
  const Vector6 pull = (Vector6() << 0., 0., -100., 0., 0., 0.).finished();
  BOOST_TEST(distribute(dynacom, pull, Vector3d::Zero()) == DistributionStatus::Relaxed);
  BOOST_TEST(close(point->appliedForce(), Vector3d::Zero(), 1e-9));
  BOOST_TEST(close(dynacom.getDistribution().residual, pull, 1e-9));
}

BOOST_AUTO_TEST_CASE(the_distribution_tells_all_that_the_contacts_do) {
  Random random(21);
  int solved = 0, relaxed = 0;
  for (int trial = 0; trial < 50; ++trial) {
    const auto model = standingRobot(random, stance(4));
    DynaCoM dynacom(model);
    dynacom.addContact(makePoint("sole3"), "b");
    dynacom.addContact(makeSole("sole0"), "idle", false);
    dynacom.addContact(makeSole("sole1"), "a");
    dynacom.addContact(makePoint("sole2"), "c");
    const State x = randomState(model, random, 0.05);
    compute(dynacom, x, random.vector(6, trial % 2 == 0 ? 5. : 200.));
    const auto status = distribute(dynacom);
    ++(status == DistributionStatus::Solved ? solved : relaxed);
    const DistributionResult& result = dynacom.getDistribution();
    BOOST_TEST(result.status == status);
    BOOST_TEST(close(result.wrench, groundWrench(dynacom), 0.));
    BOOST_TEST(close(result.achieved, givenWrench(dynacom, x.q), 1e-10));
    BOOST_TEST(close(result.residual, groundWrench(dynacom) - givenWrench(dynacom, x.q), 1e-10));
    BOOST_TEST(close(result.forces(), dynacom.allForces(), 0.));
    BOOST_TEST(close(result.cost, 0.5 * dynacom.allForces().squaredNorm()));
    BOOST_TEST(
        result.scale == std::max(groundWrench(dynacom).stableNorm(), totalMass(model) * 9.81),
        boost::test_tools::tolerance(1e-12));
    BOOST_TEST(result.isOptimal(1e-8));
    const Names active = dynacom.getActiveContacts();
    BOOST_REQUIRE(result.contacts.size() == 3u);
    BOOST_REQUIRE((active == Names{"b", "a", "c"}));
    for (std::size_t k = 0; k < 3; ++k) {
      const ContactBase& contact = *dynacom.getContact(active[k]);
      const VectorXd& force = contact.appliedForce();
      BOOST_TEST(close(result.contacts[k].force, force, 0.));
      BOOST_TEST(close(result.contacts[k].NE, contact.ne_A(), 0.));
      BOOST_TEST(close(result.contacts[k].weights, contact.reg_A(), 0.));
      // Inside the cone, whatever the status.
      const double tolerance = 1e-9 * result.scale;
      BOOST_TEST((contact.uni_A() * force).maxCoeff() <= tolerance);
      BOOST_TEST((contact.fri_A() * force).maxCoeff() <= tolerance);
    }
    BOOST_TEST(close(dynacom.getContact("idle")->appliedForce(), Vector6::Zero(), 0.));
  }
  BOOST_TEST(solved > 10);
  BOOST_TEST(relaxed > 10);
}

BOOST_AUTO_TEST_CASE(the_distribution_is_that_of_a_wrench_distribution) {
  Biped biped(22);
  DynaCoM& dynacom = biped.dynacom;
  dynacom.setWrenchWeights((Vector6() << 1., 2., 3., 4., 5., 6.).finished());
  for (const double size : {2., 200.}) {
    compute(dynacom, biped.moving(), biped.random.vector(6, size), false);
    WrenchDistribution distribution;
    distribution.setWrenchWeights(dynacom.getWrenchWeights());
    distribution.add(*biped.left);
    distribution.add(*biped.right);
    const auto status = distribution.solve(groundWrench(dynacom), totalMass(biped.model) * 9.81);
    BOOST_TEST(status == dynacom.getDistributionStatus());
    BOOST_TEST(close(dynacom.allForces(), distribution.result().forces(), 0.));
  }
}

BOOST_AUTO_TEST_CASE(the_distribution_is_the_last_one_whatever_has_changed_since) {
  using Change = std::function<void(Biped&)>;
  for (const auto& change :
       {Change([](Biped& biped) { biped.dynacom.addContact(makePoint("sole0"), "new"); }),
        Change([](Biped& biped) { biped.dynacom.removeContact("left"); }),
        Change([](Biped& biped) { biped.dynacom.deactivateContact("left"); }),
        Change([](Biped& biped) { biped.dynacom.activateContact("idle"); }),
        Change([](Biped& biped) { biped.left->setMu(0.1); }),
        Change([](Biped& biped) { biped.dynacom.setWrenchWeights(Vector6::Constant(2.)); })}) {
    Biped biped(23);
    DynaCoM& dynacom = biped.dynacom;
    dynacom.addContact(makePoint("sole1"), "idle", false);
    compute(dynacom, restState(biped.model));
    // Out of reach, where the weights matter.
    const Vector6 wrench = (Vector6() << 500., 0., 300., 0., 0., 0.).finished();
    BOOST_REQUIRE(distribute(dynacom, wrench, dynacom.getCoM()) == DistributionStatus::Relaxed);
    const VectorXd forces = dynacom.allForces();
    const Vector6 achieved = dynacom.getDistribution().achieved;
    change(biped);
    const DistributionResult& result = dynacom.getDistribution();
    BOOST_TEST(result.status == DistributionStatus::Relaxed);
    BOOST_TEST(result.contacts.size() == 2u);
    BOOST_TEST(close(result.forces(), forces, 0.));
    BOOST_TEST(close(result.wrench, wrench, 0.));
    BOOST_TEST(close(result.achieved, achieved, 0.));
    BOOST_TEST(close(result.wrench_weights, Vector6::Ones(), 0.));
    BOOST_TEST(result.isOptimal());
  }
}

BOOST_AUTO_TEST_CASE(forces_are_the_same_far_from_the_origin) {
  // All that differs is that the placements' digits are used up by the distance.
  int relaxed = 0;
  for (unsigned seed = 110; seed < 120; ++seed) {
    Random random(seed);
    const auto model = standingRobot(random, stance(4));
    DynaCoM dynacom(model);
    dynacom.addContact(makeSole("sole0"), "sole");
    for (const char* frame : {"sole1", "sole2", "sole3"})
      dynacom.addContact(makePoint(frame), frame);
    for (const double size : {2., 200.}) {
      State x = randomState(model, random, 0.05);
      const Vector6 external = random.vector(6, size);
      compute(dynacom, x, external, false);
      const auto status = dynacom.getDistributionStatus();
      if (status == DistributionStatus::Relaxed) ++relaxed;
      const VectorXd forces = dynacom.allForces();
      const Vector2d cop = dynacom.getCoP();
      const Vector3d away = 100. * random.rotation().col(0);
      x.q.head<3>() += away;
      dynacom.setGroundHeight(away.z());
      compute(dynacom, x, external, false);
      BOOST_TEST(dynacom.getDistributionStatus() == status);
      BOOST_TEST((dynacom.allForces() - forces).norm() <= 1e-7 * forces.norm());
      if (dynacom.isCoPDefined()) BOOST_TEST(close(dynacom.getCoP() - away.head<2>(), cop, 1e-7));
    }
  }
  BOOST_TEST(relaxed > 5);
}

BOOST_AUTO_TEST_CASE(wrench_weights_must_be_positive) {
  Biped biped(24);
  BOOST_TEST(close(biped.dynacom.getWrenchWeights(), Vector6::Ones(), 0.));
  const Vector6 good = (Vector6() << 1., 2., 3., 4., 5., 6.).finished();
  biped.dynacom.setWrenchWeights(good);
  for (Index i = 0; i < 6; ++i) {
    for (const auto& [bad, text] : {std::pair<double, const char*>(0., "0"),
                                    {-0.25, "-0.25"},
                                    {kNaN, "nan"},
                                    {kInfinity, "inf"}}) {
      Vector6 weights = good;
      weights[i] = bad;
      BOOST_TEST(throws<std::invalid_argument>([&] { biped.dynacom.setWrenchWeights(weights); },
                                               {"weights", text}));
      BOOST_TEST(close(biped.dynacom.getWrenchWeights(), good, 0.));
    }
  }
}

// --- How close to the edge ---------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(usages_and_margins_by_hand) {
  // A sole alone gives what it is asked for, if it can: its force is the wrench about its centre.
  const auto model = singleBody(50., stance(2));
  DynaCoM dynacom(model);
  dynacom.addContact(makeSole("sole0"), "sole");
  dynacom.addContact(makePoint("sole1"), "idle", false);
  compute(dynacom, restState(model));
  const Vector3d centre(0., 0.15, 0.);
  const Vector6 force = (Vector6() << 35., -70., 200., -4., 10., 5.).finished();
  BOOST_TEST(distribute(dynacom, force, centre) == DistributionStatus::Solved);
  BOOST_TEST(close(dynacom.getContactFrictionUsage("sole"), 70. / (0.7 * 200.), 1e-9));
  BOOST_TEST(close(dynacom.getContactCoP("sole"), Vector2d(-10. / 200., -4. / 200.), 1e-9));
  // 5 cm to the front or back edge, 4 cm to one side.
  BOOST_TEST(close(dynacom.getContactCoPMargin("sole"), 0.04, 1e-9));
  BOOST_TEST(close(dynacom.getContactYawUsage("sole"), 5. / (0.1 * 200.), 1e-9));

  // On all edges at once, beyond which it cannot go.
  for (const double beyond : {1., 2.}) {
    const Vector6 edge =
        (Vector6() << 140. * beyond, 0., 200., 0., 20. * beyond, -20. * beyond).finished();
    BOOST_TEST(distribute(dynacom, edge, centre) ==
               (beyond > 1. ? DistributionStatus::Relaxed : DistributionStatus::Solved));
    BOOST_TEST(close(dynacom.getContactFrictionUsage("sole"), 1., 1e-8));
    BOOST_TEST(close(dynacom.getContactCoPMargin("sole"), 0., 1e-8));
    BOOST_TEST(close(dynacom.getContactYawUsage("sole"), 1., 1e-8));
  }

  // Who takes no part uses nothing.
  const auto expectNothing = [&](const std::string& name) {
    BOOST_TEST(dynacom.getContactFrictionUsage(name) == 0.);
    BOOST_TEST(allNaN(dynacom.getContactCoP(name)));
    BOOST_TEST(std::isnan(dynacom.getContactCoPMargin(name)));
  };
  expectNothing("idle");
  dynacom.deactivateContact("sole");
  expectNothing("sole");
  BOOST_TEST(dynacom.getContactYawUsage("sole") == 0.);

  // A point has friction, but neither edges nor yaw.
  dynacom.activateContact("idle");
  const Vector6 push = (Vector6() << 35., -70., 200., 0., 0., 0.).finished();
  BOOST_TEST(distribute(dynacom, push, -centre) == DistributionStatus::Solved);
  BOOST_TEST(close(dynacom.getContactFrictionUsage("idle"), 0.5, 1e-9));
  BOOST_TEST(close(dynacom.getContactCoP("idle"), Vector2d::Zero(), 0.));
  BOOST_TEST(std::isnan(dynacom.getContactCoPMargin("idle")));
  BOOST_TEST(std::isnan(dynacom.getContactYawUsage("idle")));
}

BOOST_AUTO_TEST_CASE(the_wrench_margin_by_hand) {
  // A sole at the CoM: each component has its own bound. The moment about x, which is bounded by
  // ±0.06 m f_z, leans to one side.
  const auto model = singleBody(50., {SE3::Identity()});
  DynaCoM dynacom(model);
  dynacom.addContact(makeSole("sole0"), "sole");
  compute(dynacom, restState(model));
  const double fz = 400.;
  Vector6 wrench = (Vector6() << 0., 0., fz, 0.01 * fz, 0., 0.).finished();
  const auto margin = [&] {
    distribute(dynacom, wrench, Vector3d::Zero());
    return dynacom.computeWrenchMargin();
  };
  WrenchMargin found = margin();
  BOOST_TEST(close(found.margin, 0.05 * fz, 1e-6));
  BOOST_TEST(found.axis == 3);
  BOOST_TEST(found.sign == 1);
  wrench[3] = -wrench[3];
  found = margin();
  BOOST_TEST(close(found.margin, 0.05 * fz, 1e-6));
  BOOST_TEST(found.axis == 3);
  BOOST_TEST(found.sign == -1);

  // In newtons, by the weights: then friction gives way first.
  dynacom.setWrenchWeights((Vector6() << 1., 1., 1., 20., 20., 20.).finished());
  wrench << 0., 0.2 * fz, fz, 0., 0., 0.;
  found = margin();
  BOOST_TEST(close(found.margin, 0.5 * fz, 1e-6));
  BOOST_TEST(found.axis == 1);
  BOOST_TEST(found.sign == 1);

  // Looking changes nothing.
  const View before = everythingSeen(dynacom);
  dynacom.computeWrenchMargin();
  BOOST_TEST(same(everythingSeen(dynacom), before));

  // On the boundary, beyond it, and where there is no answer.
  wrench[1] = 0.7 * fz;
  BOOST_TEST(close(margin().margin, 0., 1e-6));
  wrench[1] = 2. * fz;
  BOOST_TEST(margin().margin == 0.);
  wrench[1] = kNaN;
  found = margin();
  BOOST_TEST(std::isnan(found.margin));
  BOOST_TEST(found.axis == -1);
  BOOST_TEST(found.sign == 0);
}

BOOST_AUTO_TEST_CASE(the_wrench_margin_of_points_and_of_opposite_walls) {
  // One point cannot turn anything about itself, and two not about the line between them.
  const auto points = singleBody(50., stance(2));
  DynaCoM dynacom(points);
  dynacom.addContact(makePoint("sole0"), "left");
  dynacom.addContact(makePoint("sole1"), "right");
  compute(dynacom, restState(points), Vector6::Zero(), false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Solved);
  BOOST_TEST(close(dynacom.computeWrenchMargin().margin, 0., 1e-6));

  // Palms that press against each other hold whatever one wants.
  const auto wall = [](double side) {
    return SE3(Eigen::AngleAxisd(side * M_PI / 2., Vector3d::UnitY()).toRotationMatrix(),
               Vector3d(-side * 0.4, 0., 0.));
  };
  const auto palms = singleBody(50., {wall(1.), wall(-1.)});
  DynaCoM held(palms);
  held.addContact(makeSole("sole0"), "left");
  held.addContact(makeSole("sole1"), "right");
  for (const Vector3d& force : {Vector3d(0., 0., 500.), Vector3d(-300., 200., -500.)}) {
    compute(held, restState(palms));
    BOOST_TEST(held.distributeForce(force, Vector3d(5., -5., 5.), Vector3d::Zero()) ==
               DistributionStatus::Solved);
    const WrenchMargin margin = held.computeWrenchMargin();
    BOOST_TEST(margin.margin == kInfinity);
    BOOST_TEST(margin.axis == -1);
    BOOST_TEST(margin.sign == 0);
  }
}

// --- Numbers that are not finite ---------------------------------------------------------------

namespace {

const double kNotFinite[] = {kNaN, kInfinity, -kInfinity};

/// A name for each number of a state and of an external wrench, and how to reach it.
using Argument = std::pair<std::string, std::function<double&(State&, Vector6&)>>;

std::vector<Argument> argumentsOf(const pinocchio::Model& model) {
  std::vector<Argument> arguments;
  const auto add = [&](const std::string& name, Index size, auto number) {
    for (Index i = 0; i < size; ++i)
      arguments.emplace_back(
          name + "[" + std::to_string(i) + "]",
          [=](State& x, Vector6& external) -> double& { return number(x, external, i); });
  };
  add("q", model.nq, [](State& x, Vector6&, Index i) -> double& { return x.q[i]; });
  add("v", model.nv, [](State& x, Vector6&, Index i) -> double& { return x.v[i]; });
  add("a", model.nv, [](State& x, Vector6&, Index i) -> double& { return x.a[i]; });
  add("extWrench", 6, [](State&, Vector6& external, Index i) -> double& { return external[i]; });
  return arguments;
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_number_that_is_not_finite_leaves_nothing_known_of_the_motion) {
  Biped biped(130);
  DynaCoM& dynacom = biped.dynacom;
  const State good = restState(biped.model);
  dynacom.computeNL(3., good.q, good.v, good.a, Vector6::Zero(), false);
  const View recovered = everythingSeen(dynacom);
  const VectorXd forces = dynacom.allForces();
  BOOST_REQUIRE(dynacom.getNL().allFinite());
  for (const auto& [name, number] : argumentsOf(biped.model)) {
    for (const double bad : kNotFinite) {
      for (const bool flat : {true, false}) {
        BOOST_TEST_CONTEXT(name << " = " << bad << (flat ? ", flat" : "")) {
          State x = good;
          Vector6 external = Vector6::Zero();
          number(x, external) = bad;
          compute(dynacom, x, external, flat);
          BOOST_TEST(motionIsUnknown(dynacom));
          dynacom.computeNL(3.);
          BOOST_TEST(motionIsUnknown(dynacom));
          dynacom.computeNL(3., x.q, x.v, x.a, external, flat);
          BOOST_TEST(motionIsUnknown(dynacom));
          if (flat) distribute(dynacom);
          BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::InvalidInput);
          BOOST_TEST(!dynacom.getDistribution().isOptimal());
          BOOST_TEST(std::isnan(dynacom.computeWrenchMargin().margin));
          BOOST_TEST(motionIsUnknown(dynacom));
          // The last forces are better than none.
          BOOST_TEST(close(dynacom.allForces(), forces, 0.));

          dynacom.computeNL(3., good.q, good.v, good.a, Vector6::Zero(), false);
          BOOST_TEST(same(everythingSeen(dynacom), recovered));
        }
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(a_number_that_becomes_infinite_is_none_either) {
  Biped biped(131);
  DynaCoM& dynacom = biped.dynacom;
  for (const bool flat : {true, false}) {
    State x = biped.moving();
    x.v *= 1e200;
    dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), flat);
    BOOST_TEST(motionIsUnknown(dynacom));
    if (!flat) BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::InvalidInput);
    compute(dynacom, restState(biped.model), Vector6::Zero(), flat);
    BOOST_TEST(dynacom.isCoPDefined());
  }
}

BOOST_AUTO_TEST_CASE(a_distribution_of_numbers_that_are_not_finite_keeps_the_forces) {
  Biped biped(132);
  DynaCoM& dynacom = biped.dynacom;
  compute(dynacom, restState(biped.model));
  const Vector3d com = dynacom.getCoM();
  const Vector6 wrench = groundWrench(dynacom);
  BOOST_REQUIRE(distribute(dynacom) == DistributionStatus::Solved);
  const View recovered = everythingSeen(dynacom);
  const VectorXd forces = dynacom.allForces();
  const auto expectKept = [&](DistributionStatus status) {
    BOOST_TEST(status == DistributionStatus::InvalidInput);
    BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::InvalidInput);
    BOOST_TEST(dynacom.getDistribution().status == DistributionStatus::InvalidInput);
    BOOST_TEST(!dynacom.getDistribution().isOptimal());
    BOOST_TEST(close(dynacom.allForces(), forces, 0.));
    BOOST_TEST(close(dynacom.getDistribution().forces(), forces, 0.));
    BOOST_TEST(std::isnan(dynacom.computeWrenchMargin().margin));
    // What the forces that are kept use is still known.
    for (const char* name : {"left", "right"}) {
      BOOST_TEST(dynacom.getContactCoP(name).allFinite());
      BOOST_TEST(dynacom.getContactCoPMargin(name) > 0.);
    }
  };
  for (Index i = 0; i < 9; ++i) {
    for (const double bad : kNotFinite) {
      BOOST_TEST_CONTEXT("argument " << i << " = " << bad) {
        Eigen::Matrix<double, 9, 1> all;
        all << wrench, com;
        all[i] = bad;
        expectKept(distribute(dynacom, all.head<6>(), all.tail<3>()));
        // And again, although the last call had no answer.
        expectKept(distribute(dynacom, all.head<6>(), all.tail<3>()));
        BOOST_TEST(distribute(dynacom, wrench, com) == DistributionStatus::Solved);
        BOOST_TEST(same(everythingSeen(dynacom), recovered));
      }
    }
  }

  // Also where the contacts are elsewhere meanwhile, which is not what a setting is.
  compute(dynacom, biped.moving());
  expectKept(distribute(dynacom, Vector6::Constant(kNaN), com));
  // And where the frames are nowhere.
  State x = restState(biped.model);
  x.q[0] = kNaN;
  compute(dynacom, x);
  expectKept(distribute(dynacom, wrench, com));

  // The same after a distribution out of reach.
  compute(dynacom, restState(biped.model));
  BOOST_REQUIRE(distribute(dynacom, 3. * Vector6::Ones() * wrench.z(), com) ==
                DistributionStatus::Relaxed);
  const VectorXd relaxed = dynacom.allForces();
  BOOST_TEST(distribute(dynacom, wrench, Vector3d::Constant(kNaN)) ==
             DistributionStatus::InvalidInput);
  BOOST_TEST(close(dynacom.allForces(), relaxed, 0.));
}

BOOST_AUTO_TEST_CASE(forces_are_not_kept_when_contacts_or_settings_have_changed) {
  using Change = std::function<void(Biped&)>;
  const auto moveTo = [](Contact6D& contact, const char* frame) {
    auto settings = contact.getSettings();
    settings.frame_name = frame;
    contact.initialize(settings);
  };
  const std::vector<std::pair<const char*, Change>> changes = {
      {"add", [](Biped& biped) { biped.dynacom.addContact(makePoint("sole0"), "new"); }},
      {"remove", [](Biped& biped) { biped.dynacom.removeContact("right"); }},
      {"activate", [](Biped& biped) { biped.dynacom.activateContact("idle"); }},
      {"deactivate", [](Biped& biped) { biped.dynacom.deactivateContact("right"); }},
      {"deactivate and activate",
       [](Biped& biped) {
         biped.dynacom.deactivateContact("right");
         biped.dynacom.activateContact("right");
       }},
      {"remove and add",
       [](Biped& biped) {
         biped.dynacom.removeContact("right");
         biped.dynacom.addContact(biped.right, "right");
       }},
      {"another of the same settings",
       [](Biped& biped) {
         biped.dynacom.removeContact("right");
         biped.dynacom.addContact(makeSole("sole1"), "right");
       }},
      {"setMu", [](Biped& biped) { biped.right->setMu(0.71); }},
      {"setGu", [](Biped& biped) { biped.right->setGu(0.11); }},
      {"setSurfaceHalfLength", [](Biped& biped) { biped.right->setSurfaceHalfLength(0.11); }},
      {"setSurfaceHalfWidth", [](Biped& biped) { biped.right->setSurfaceHalfWidth(0.07); }},
      {"setForceWeights", [](Biped& biped) { biped.right->setForceWeights(Vector3d(1., 1., 2.)); }},
      {"setTorqueWeights",
       [](Biped& biped) { biped.right->setTorqueWeights(Vector3d(1., 1., 2.)); }},
      {"setWrenchWeights",
       [](Biped& biped) { biped.dynacom.setWrenchWeights(Vector6::Constant(2.)); }},
      {"another frame", [&](Biped& biped) { moveTo(*biped.right, "sole0"); }},
      {"initialized again", [&](Biped& biped) { moveTo(*biped.right, "sole1"); }},
  };
  for (const auto& [what, change] : changes) {
    for (const bool byDynamics : {true, false}) {
      BOOST_TEST_CONTEXT(what) {
        Biped biped(133);
        DynaCoM& dynacom = biped.dynacom;
        dynacom.addContact(makePoint("sole0"), "idle", false);
        const State x = restState(biped.model);
        State bad = x;
        bad.a[0] = kNaN;
        compute(dynacom, x);
        BOOST_REQUIRE(distribute(dynacom) == DistributionStatus::Solved);
        BOOST_REQUIRE(biped.left->appliedForce().norm() > 1.);
        BOOST_REQUIRE(biped.right->appliedForce().norm() > 1.);
        change(biped);
        const auto expectZero = [&] {
          BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::InvalidInput);
          BOOST_TEST(dynacom.allForces().isZero(0.));
          for (const auto& name : dynacom.getKnownContacts())
            BOOST_TEST(dynacom.getContact(name)->appliedForce().isZero(0.));
          BOOST_TEST(dynacom.getDistribution().forces().isZero(0.));
          BOOST_TEST(biped.right->appliedForce().isZero(0.));
        };
        for (int twice = 0; twice < 2; ++twice) {
          if (byDynamics)
            compute(dynacom, bad, Vector6::Zero(), false);
          else
            distribute(dynacom, Vector6::Constant(kNaN), dynacom.getCoM());
          expectZero();
        }

        // The next answer is kept again.
        compute(dynacom, x);
        distribute(dynacom);
        const VectorXd forces = dynacom.allForces();
        BOOST_TEST(forces.norm() > 1.);
        compute(dynacom, bad, Vector6::Zero(), false);
        BOOST_TEST(close(dynacom.allForces(), forces, 0.));
      }
    }
  }

  // What was refused has changed nothing, and what does not concern forces neither.
  Biped biped(134);
  compute(biped.dynacom, restState(biped.model));
  distribute(biped.dynacom);
  const VectorXd forces = biped.dynacom.allForces();
  BOOST_CHECK_THROW(biped.right->setMu(-1.), std::invalid_argument);
  BOOST_CHECK_THROW(biped.right->initialize({}), std::invalid_argument);
  BOOST_CHECK_THROW(biped.dynacom.setWrenchWeights(Vector6::Zero()), std::invalid_argument);
  biped.dynacom.addContact(makePoint("sole0"), "idle", false);
  biped.dynacom.removeContact("idle");
  BOOST_CHECK_THROW(biped.dynacom.addContact(biped.left, "left"), std::invalid_argument);
  BOOST_CHECK_THROW(biped.dynacom.removeContact("tail"), std::invalid_argument);
  biped.dynacom.activateContact("left");
  biped.dynacom.setGroundHeight(0.1);
  biped.dynacom.setMinimalVerticalForce(2.);
  distribute(biped.dynacom, Vector6::Constant(kNaN), biped.dynacom.getCoM());
  BOOST_TEST(close(biped.dynacom.allForces(), forces, 0.));
}

BOOST_AUTO_TEST_CASE(a_copy_keeps_the_forces_too) {
  Biped biped(135);
  compute(biped.dynacom, restState(biped.model));
  distribute(biped.dynacom);
  DynaCoM copy = biped.dynacom;
  const Vector3d com = copy.getCoM();
  copy.deactivateContact("left");
  distribute(copy, Vector6::Constant(kNaN), com);
  BOOST_TEST(copy.allForces().isZero(0.));
  const VectorXd forces = biped.dynacom.allForces();
  for (DynaCoM other : {DynaCoM(biped.dynacom), biped.dynacom}) {
    distribute(other, Vector6::Constant(kNaN), com);
    BOOST_TEST(close(other.allForces(), forces, 0.));
  }
  distribute(biped.dynacom, Vector6::Constant(kNaN), com);
  BOOST_TEST(close(biped.dynacom.allForces(), forces, 0.));
}

BOOST_AUTO_TEST_CASE(a_wrench_beyond_the_largest_numbers_is_a_status) {
  Biped biped(136);
  compute(biped.dynacom, restState(biped.model));
  distribute(biped.dynacom);
  const VectorXd forces = biped.dynacom.allForces();
  const auto status = distribute(biped.dynacom, Vector6::Constant(1.7e308), biped.dynacom.getCoM());
  BOOST_TEST(status == DistributionStatus::NumericalFailure);
  BOOST_TEST(close(biped.dynacom.allForces(), forces, 0.));
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
}

// --- Matrices ----------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(without_active_contacts_matrices_are_empty) {
  Biped biped(23);
  biped.dynacom.deactivateContact("left");
  biped.dynacom.deactivateContact("right");
  compute(biped.dynacom, restState(biped.model));
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::NoContact);
  BOOST_TEST(biped.dynacom.uni_A().size() == 0);
  BOOST_TEST(biped.dynacom.fri_A().size() == 0);
  BOOST_TEST(biped.dynacom.ne_A().rows() == 6);
  BOOST_TEST(biped.dynacom.ne_A().cols() == 0);
  for (const VectorXd& empty : {biped.dynacom.uni_b(), biped.dynacom.fri_b(), biped.dynacom.reg_A(),
                                biped.dynacom.reg_b(), biped.dynacom.allForces()})
    BOOST_TEST(empty.size() == 0);
}

// --- Placements --------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(placements_are_fresh_after_compute_dynamics_whichever_the_flag) {
  // Of contacts that take part and of those that do not.
  for (const bool flat : {true, false}) {
    Biped biped(30);
    biped.dynacom.deactivateContact("right");
    for (int trial = 0; trial < 5; ++trial) {
      const State x = biped.moving();
      compute(biped.dynacom, x, Vector6::Zero(), flat);
      for (const auto& contact : {biped.left, biped.right}) {
        SE3 expected = framePlacement(biped.model, x.q, contact->getFrameName());
        BOOST_TEST(close(contact->getPose().toHomogeneousMatrix(), expected.toHomogeneousMatrix()));
        expected.translation() -= comOf(biped.model, x.q);
        BOOST_TEST(close(contact->ne_A(), expected.toDualActionMatrix()));
      }
    }
  }
}

BOOST_AUTO_TEST_CASE(a_contact_added_after_compute_dynamics_is_placed_at_once) {
  Biped biped(31);
  const State x = biped.moving();
  compute(biped.dynacom, x);
  int index = 0;
  for (const bool active : {true, false}) {
    const auto late = makePoint("sole1");
    biped.dynacom.addContact(late, "late" + std::to_string(index++), active);
    SE3 expected = framePlacement(biped.model, x.q, "sole1");
    BOOST_TEST(close(late->getPose().toHomogeneousMatrix(), expected.toHomogeneousMatrix()));
    expected.translation() -= biped.dynacom.getCoM();
    BOOST_TEST(close(late->ne_A(), expected.toDualActionMatrix().leftCols<3>()));
    BOOST_TEST(late->getFrameID() == biped.model.getFrameId("sole1"));
  }
}

BOOST_AUTO_TEST_CASE(a_contact_activated_after_compute_dynamics_is_placed_then) {
  // Its caller has moved it in between.
  Biped biped(32);
  biped.dynacom.deactivateContact("right");
  const State x = biped.moving();
  compute(biped.dynacom, x);
  biped.right->updateNewtonEuler(Vector3d::Zero(), SE3::Identity());
  biped.dynacom.activateContact("right");
  BOOST_TEST(close(biped.right->getPose().toHomogeneousMatrix(),
                   framePlacement(biped.model, x.q, "sole1").toHomogeneousMatrix()));
}

BOOST_AUTO_TEST_CASE(distribution_is_at_the_placements_in_data) {
  // Whichever of Pinocchio's algorithms has put them there.
  using Kinematics = void (*)(const pinocchio::Model&, pinocchio::Data&, const VectorXd&);
  for (const Kinematics kinematics : {&runForwardKinematics, &runFramesForwardKinematics}) {
    Biped biped(33), expected(33);
    const State before = biped.moving(), after = biped.moving();
    compute(biped.dynacom, before);
    kinematics(biped.dynacom.getModel(), biped.dynacom.getData(), after.q);
    compute(expected.dynacom, after);

    const Vector6 wrench = groundWrench(expected.dynacom);
    const Vector3d com = comOf(biped.model, after.q);
    const auto status = distribute(biped.dynacom, wrench, com);
    BOOST_TEST(status == distribute(expected.dynacom, wrench, com));
    BOOST_TEST(status == DistributionStatus::Solved);
    BOOST_TEST(close(biped.dynacom.allForces(), expected.dynacom.allForces(), 1e-8));
    BOOST_TEST(close(biped.dynacom.ne_A(), expected.dynacom.ne_A()));
    BOOST_TEST(close(biped.left->getPose().toHomogeneousMatrix(),
                     framePlacement(biped.model, after.q, "sole0").toHomogeneousMatrix()));
  }
}

BOOST_AUTO_TEST_CASE(distribution_needs_kinematics_in_data_only) {
  // computeDynamics() has never been called.
  Biped biped(34);
  const State x = restState(biped.model);
  runForwardKinematics(biped.dynacom.getModel(), biped.dynacom.getData(), x.q);
  Vector6 wrench = Vector6::Zero();
  wrench.z() = 500.;
  BOOST_TEST(distribute(biped.dynacom, wrench, comOf(biped.model, x.q)) ==
             DistributionStatus::Solved);
  BOOST_TEST(close(biped.left->toCoMForces() + biped.right->toCoMForces(), wrench, 1e-9));
}

BOOST_AUTO_TEST_CASE(forces_balance_about_the_com_that_is_given) {
  Biped biped(35);
  compute(biped.dynacom, restState(biped.model));
  const Vector3d com = biped.dynacom.getCoM() + Vector3d(0.03, -0.02, 0.1);
  Vector6 wrench = Vector6::Zero();
  wrench.z() = 500.;
  BOOST_TEST(distribute(biped.dynacom, wrench, com) == DistributionStatus::Solved);
  const Vector6 atOrigin = biped.left->toWorldForces() + biped.right->toWorldForces();
  Vector6 expected;
  expected << wrench.head<3>(), com.cross(Vector3d(wrench.head<3>()));
  BOOST_TEST(close(atOrigin, expected, 1e-9));
}

// --- Measured placements -------------------------------------------------------------------------

namespace {

boost::test_tools::predicate_result samePose(const SE3& one, const SE3& other,
                                             double tolerance = 0.) {
  return close(one.toHomogeneousMatrix(), other.toHomogeneousMatrix(), tolerance);
}

/// Where a biped's right sole might be measured: a little higher than expected, and tilted.
SE3 measuredPose(const Biped& biped, const State& x) {
  SE3 pose = framePlacement(biped.model, x.q, "sole1");
  pose.translation() += Vector3d(0.02, -0.03, 0.05);
  pose.rotation() = Eigen::AngleAxisd(0.1, Vector3d::UnitX()).toRotationMatrix() * pose.rotation();
  return pose;
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_contact_is_where_it_was_measured) {
  for (const bool flat : {true, false}) {
    Biped biped(105);
    DynaCoM& dynacom = biped.dynacom;
    State x = restState(biped.model);
    compute(dynacom, x);
    const SE3 pose = measuredPose(biped, x);
    dynacom.setContactPose("right", pose);
    BOOST_TEST(samePose(biped.right->getPose(), pose));
    // Its matrix is that of the new place at once.
    SE3 from_com = pose;
    from_com.translation() -= dynacom.getCoM();
    BOOST_TEST(close(biped.right->ne_A(), from_com.toDualActionMatrix()));
    const auto check = [&] {
      BOOST_TEST(samePose(biped.right->getPose(), pose));
      BOOST_TEST(samePose(biped.left->getPose(), framePlacement(biped.model, x.q, "sole0"), 1e-12));
    };
    // Forces give the wrench from there, about the CoM.
    BOOST_TEST(distribute(dynacom) == DistributionStatus::Solved);
    BOOST_TEST(close(givenWrench(dynacom, x.q), groundWrench(dynacom), 1e-9));
    Vector3d moment = Vector3d::Zero();
    for (const auto& [contact, place] :
         {std::pair(biped.left, biped.left->getPose()), std::pair(biped.right, pose)}) {
      const Vector3d force = place.rotation() * contact->appliedForce().head<3>();
      moment += (place.translation() - dynacom.getCoM()).cross(force) +
                place.rotation() * contact->appliedForce().tail<3>();
    }
    BOOST_TEST(close(moment, dynacom.getGroundCoMTorque(), 1e-9));
    check();

    // The robot moves on, and the contact stays, whatever is computed.
    for (int trial = 0; trial < 5; ++trial) {
      x = biped.moving();
      compute(dynacom, x, Vector6::Zero(), flat);
      check();
      dynacom.computeDynamics(knownMotion(biped.model, x), Vector6::Zero(), flat);
      check();
      distribute(dynacom);
      check();
      BOOST_TEST(close(givenWrench(dynacom, x.q), dynacom.getDistribution().achieved, 1e-9));
      dynacom.deactivateContact("right");
      compute(dynacom, x, Vector6::Zero(), flat);
      check();
      dynacom.activateContact("right");
      check();
      dynacom.addContact(makePoint("sole1"), "point", false);
      dynacom.removeContact("point");
      check();
      // That a contact is given other settings does not move it.
      biped.right->initialize(biped.right->getSettings());
      distribute(dynacom);
      check();
    }
    // About the CoM of the motion, once there is one.
    from_com = pose;
    from_com.translation() -= dynacom.getCoM();
    BOOST_TEST(close(biped.right->ne_A(), from_com.toDualActionMatrix()));
  }
}

BOOST_AUTO_TEST_CASE(a_measured_placement_changes_no_more_than_the_contact) {
  Biped biped(106);
  const State x = biped.moving();
  compute(biped.dynacom, x, Vector6::Zero(), false);
  const View before = everythingSeen(biped.dynacom);
  const SE3 model_pose = biped.right->getPose();
  biped.dynacom.setContactPose("right", measuredPose(biped, x));
  View after = everythingSeen(biped.dynacom);
  for (const std::string what : {"pose of right", "ne_A"}) {
    BOOST_TEST(before.at(what) != after.at(what));
    after[what] = before.at(what);
  }
  BOOST_TEST(same(after, before));
  // Where the model says, it is as if nothing had been measured.
  biped.dynacom.setContactPose("right", model_pose);
  BOOST_TEST(same(everythingSeen(biped.dynacom), before));
}

BOOST_AUTO_TEST_CASE(a_contact_goes_back_to_where_the_model_says) {
  Biped biped(107);
  DynaCoM& dynacom = biped.dynacom;
  const State x = biped.moving(), y = biped.moving();
  const SE3 pose = measuredPose(biped, x);
  const auto byModel = [&](const State& state) {
    return framePlacement(biped.model, state.q, "sole1");
  };
  compute(dynacom, x);
  dynacom.setContactPose("right", pose);
  compute(dynacom, y);
  // From the next computeDynamics() on, of either kind.
  dynacom.resetContactPose("right");
  BOOST_TEST(samePose(biped.right->getPose(), pose));
  compute(dynacom, x);
  BOOST_TEST(samePose(biped.right->getPose(), byModel(x), 1e-12));
  dynacom.setContactPose("right", pose);
  dynacom.resetContactPose("right");
  dynacom.computeDynamics(knownMotion(biped.model, y));
  BOOST_TEST(samePose(biped.right->getPose(), byModel(y), 1e-12));
  // Or distributeForce().
  dynacom.setContactPose("right", pose);
  distribute(dynacom);
  BOOST_TEST(samePose(biped.right->getPose(), pose));
  dynacom.resetContactPose("right");
  distribute(dynacom);
  BOOST_TEST(samePose(biped.right->getPose(), byModel(y), 1e-12));
  BOOST_TEST(close(givenWrench(dynacom, y.q), dynacom.getDistribution().achieved, 1e-9));
  // What was never set can be reset, and what was set can be set again.
  const View before = everythingSeen(dynacom);
  dynacom.resetContactPose("left");
  dynacom.resetContactPose("right");
  BOOST_TEST(same(everythingSeen(dynacom), before));
  dynacom.setContactPose("right", pose);
  dynacom.setContactPose("right", SE3::Identity());
  compute(dynacom, x);
  BOOST_TEST(samePose(biped.right->getPose(), SE3::Identity()));
  // A contact that is removed and comes back was never measured.
  dynacom.removeContact("right");
  dynacom.addContact(biped.right, "right");
  BOOST_TEST(samePose(biped.right->getPose(), byModel(x), 1e-12));
}

BOOST_AUTO_TEST_CASE(a_contact_may_be_measured_before_anything_is_computed) {
  Biped biped(108);
  const State x = restState(biped.model);
  const SE3 pose = measuredPose(biped, x);
  biped.dynacom.deactivateContact("right");
  biped.dynacom.setContactPose("right", pose);
  BOOST_TEST(samePose(biped.right->getPose(), pose));
  biped.dynacom.activateContact("right");
  compute(biped.dynacom, x);
  BOOST_TEST(samePose(biped.right->getPose(), pose));
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
  BOOST_TEST(close(givenWrench(biped.dynacom, x.q), groundWrench(biped.dynacom), 1e-9));

  // Where all contacts are measured, no kinematics are needed.
  Biped blind(108);
  const SE3 left = framePlacement(biped.model, x.q, "sole0");
  blind.dynacom.setContactPose("left", left);
  blind.dynacom.setContactPose("right", pose);
  BOOST_TEST(distribute(blind.dynacom, groundWrench(biped.dynacom), biped.dynacom.getCoM()) ==
             DistributionStatus::Solved);
  BOOST_TEST(close(blind.left->appliedForce(), biped.left->appliedForce(), 1e-8));
  BOOST_TEST(close(blind.right->appliedForce(), biped.right->appliedForce(), 1e-8));
}

BOOST_AUTO_TEST_CASE(a_point_is_measured_by_its_frame) {
  // Its surface is where the settings say, as when the model places it.
  const auto model = singleBody(10., stance(2));
  DynaCoM dynacom(model);
  ContactPointSettings settings = makePoint("sole0")->getSettings();
  settings.radius = 0.02;
  settings.world_aligned = true;
  const auto point = std::make_shared<ContactPoint>(settings);
  dynacom.addContact(point, "point");
  compute(dynacom, restState(model));
  const SE3 pose = Random(109).placement();
  dynacom.setContactPose("point", pose);
  compute(dynacom, restState(model));
  BOOST_TEST(samePose(point->getPose(), pose));
  BOOST_TEST(close(point->getSurfacePose().translation(),
                   Vector3d(pose.translation() - 0.02 * Vector3d::UnitZ())));
}

BOOST_AUTO_TEST_CASE(copies_keep_measured_placements) {
  Biped biped(110);
  const State x = biped.moving(), y = biped.moving();
  compute(biped.dynacom, x);
  const SE3 pose = measuredPose(biped, x);
  biped.dynacom.setContactPose("right", pose);
  DynaCoM assigned;
  assigned = biped.dynacom;
  DynaCoM moved = DynaCoM(biped.dynacom);
  for (DynaCoM* copy : {&assigned, &moved}) {
    compute(*copy, y);
    BOOST_TEST(samePose(copy->getContact("right")->getPose(), pose));
    BOOST_TEST(samePose(copy->getContact("left")->getPose(),
                        framePlacement(biped.model, y.q, "sole0"), 1e-12));
    // Each on its own.
    copy->resetContactPose("right");
    copy->setContactPose("left", pose);
    compute(*copy, y);
    BOOST_TEST(samePose(copy->getContact("right")->getPose(),
                        framePlacement(biped.model, y.q, "sole1"), 1e-12));
    compute(biped.dynacom, y);
    BOOST_TEST(samePose(biped.right->getPose(), pose));
    BOOST_TEST(samePose(biped.left->getPose(), framePlacement(biped.model, y.q, "sole0"), 1e-12));
  }
}

BOOST_AUTO_TEST_CASE(a_measurement_that_fails_is_a_status) {
  Biped biped(111);
  DynaCoM& dynacom = biped.dynacom;
  const State x = restState(biped.model);
  compute(dynacom, x);
  const SE3 pose = measuredPose(biped, x);
  dynacom.setContactPose("right", pose);
  BOOST_REQUIRE(distribute(dynacom) == DistributionStatus::Solved);
  const VectorXd forces = dynacom.allForces();
  for (const double bad : {kNaN, kInfinity}) {
    SE3 wrong = pose;
    wrong.translation()[1] = bad;
    dynacom.setContactPose("right", wrong);
    BOOST_TEST(distribute(dynacom) == DistributionStatus::InvalidInput);
    BOOST_TEST(close(dynacom.allForces(), forces, 0.));
    compute(dynacom, x, Vector6::Zero(), false);
    BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::InvalidInput);
    BOOST_TEST(close(dynacom.allForces(), forces, 0.));
    dynacom.setContactPose("right", pose);
    BOOST_TEST(distribute(dynacom) == DistributionStatus::Solved);
    BOOST_TEST(close(dynacom.allForces(), forces, 1e-9));
  }
  for (const std::string name : {"tail", ""}) {
    const View before = everythingSeen(dynacom);
    BOOST_TEST(throws<std::invalid_argument>([&] { dynacom.setContactPose(name, pose); },
                                             {name.empty() ? "left" : name, "left", "right"}));
    BOOST_TEST(throws<std::invalid_argument>([&] { dynacom.resetContactPose(name); },
                                             {name.empty() ? "left" : name, "left", "right"}));
    BOOST_TEST(same(everythingSeen(dynacom), before));
  }
  BOOST_TEST(throws<std::invalid_argument>(
      [&] { DynaCoM().setContactPose("left", SE3::Identity()); }, {"left", "none"}));
}

// --- Warm start ----------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(what_is_forgotten_has_no_influence) {
  // Of what came before, bit for bit; nor has it if that is forgotten which is not there.
  Random random(111);
  for (int trial = 0; trial < 30; ++trial) {
    const auto model = standingRobot(random, stance(3));
    DynaCoM fresh(model);
    fresh.addContact(makeSole("sole0"), "sole0");
    fresh.addContact(makePoint("sole1"), "sole1");
    fresh.addContact(makePoint("sole2"), "sole2", false);
    const State rest = restState(model);
    compute(fresh, rest, Vector6::Zero(), false);
    DynaCoM used = fresh;
    fresh.forgetAnswers();
    for (int tick = 0; tick < 10; ++tick) {
      if (tick % 3 == 1) used.activateContact("sole2");
      compute(used, rest, random.vector(6, random.coin() ? 50. : 500.), false);
      used.deactivateContact("sole2");
    }
    used.forgetAnswers();
    const Vector6 external = random.vector(6, 300.);
    for (DynaCoM* dynacom : {&fresh, &used}) {
      // What has no answer keeps no forces.
      compute(*dynacom, rest, Vector6::Constant(std::nan("")), false);
      BOOST_TEST(dynacom->allForces().isZero(0.));
      dynacom->forgetAnswers();
      compute(*dynacom, rest, external, false);
    }
    BOOST_TEST(close(used.allForces(), fresh.allForces(), 0.));
    BOOST_TEST(used.getDistribution().iterations == fresh.getDistribution().iterations);
  }
}

BOOST_AUTO_TEST_CASE(how_distributions_iterate_is_a_setting) {
  Biped biped(112);
  DynaCoM& dynacom = biped.dynacom;
  BOOST_TEST(dynacom.getWarmStart());
  BOOST_TEST(dynacom.getMaximalIterations() == +WrenchDistribution::kMaximalIterations);
  dynacom.setWarmStart(false);
  dynacom.setMaximalIterations(1);
  for (const int bad : {0, -3}) {
    const View before = everythingSeen(dynacom);
    BOOST_TEST(throws<std::invalid_argument>([&] { dynacom.setMaximalIterations(bad); },
                                             {"maximalIterations", "> 0", std::to_string(bad)}));
    BOOST_TEST(same(everythingSeen(dynacom), before));
  }
  const DynaCoM copy = dynacom;
  BOOST_TEST(!copy.getWarmStart());
  BOOST_TEST(copy.getMaximalIterations() == 1);

  // At rest one iteration is enough, beyond friction it is not.
  compute(dynacom, restState(biped.model), Vector6::Zero(), false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Solved);
  const VectorXd forces = dynacom.allForces();
  Vector6 external = Vector6::Zero();
  external.head<2>() << -900., -300.;
  compute(dynacom, restState(biped.model), external, false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::NumericalFailure);
  BOOST_TEST(dynacom.getDistribution().iterations == 1);
  BOOST_TEST(close(dynacom.allForces(), forces, 0.));
  dynacom.setMaximalIterations(WrenchDistribution::kMaximalIterations);
  compute(dynacom, restState(biped.model), external, false);
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::Relaxed);

  // They stay when another robot comes.
  dynacom.setMaximalIterations(7);
  dynacom.initialize(biped.model);
  BOOST_TEST(!dynacom.getWarmStart());
  BOOST_TEST(dynacom.getMaximalIterations() == 7);
}

BOOST_AUTO_TEST_CASE(warm_start_never_changes_what_a_robot_does) {
  // It walks and is pushed, and its contacts come and go.
  long warm_iterations = 0, cold_iterations = 0;
  int solved = 0, relaxed = 0;
  for (unsigned seed = 0; seed < 10; ++seed) {
    Random random(120 + seed);
    const auto model = standingRobot(random, stance(4));
    DynaCoM warm(model);
    Names names;
    for (int i = 0; i < 4; ++i) {
      const std::string frame = "sole" + std::to_string(i);
      names.push_back(frame);
      if (i < 2)
        warm.addContact(makeSole(frame), frame);
      else
        warm.addContact(makePoint(frame), frame, false);
    }
    DynaCoM cold = warm;
    cold.setWarmStart(false);
    State x = restState(model);
    Vector6 external = Vector6::Zero();
    for (int tick = 0; tick < 200; ++tick) {
      // A little further; now and then, a push.
      x.q = moved(model, x.q, random.vector(model.nv, 1e-4));
      external += Vector6(random.vector(6, 0.5));
      const bool is_pushed = random.integer(0, 39) == 0;
      if (is_pushed) external = random.vector(6, random.coin() ? 20. : 400.);
      const std::string name = names[static_cast<std::size_t>(random.integer(0, 3))];
      const auto active = asSet(warm.getActiveContacts());
      const bool others = random.integer(0, 9) == 0;
      if (others) {
        for (DynaCoM* dynacom : {&warm, &cold}) {
          if (active.count(name) == 0)
            dynacom->activateContact(name);
          else if (active.size() > 1)
            dynacom->deactivateContact(name);
        }
      }
      compute(warm, x, external, false);
      compute(cold, x, external, false);
      const DistributionResult &result = warm.getDistribution(), &expected = cold.getDistribution();
      BOOST_TEST(result.status == expected.status);
      BOOST_TEST(result.isOptimal());
      BOOST_TEST(expected.isOptimal());
      const double scale = result.scale;
      BOOST_TEST(close(result.forces() / scale, expected.forces() / scale, 1e-9));
      BOOST_TEST(close(result.achieved / scale, expected.achieved / scale, 1e-9));
      BOOST_TEST(close(result.cost / (scale * scale), expected.cost / (scale * scale), 1e-9));
      (result.status == DistributionStatus::Solved ? solved : relaxed) += 1;
      if (is_pushed || others) continue;  // there is nothing to start from
      warm_iterations += result.iterations;
      cold_iterations += expected.iterations;
    }
  }
  BOOST_TEST(solved > 200);
  BOOST_TEST(relaxed > 200);
  BOOST_TEST(warm_iterations < 0.6 * cold_iterations);
  BOOST_TEST_MESSAGE(warm_iterations << " iterations instead of " << cold_iterations);
}

BOOST_AUTO_TEST_CASE(a_foot_that_comes_back_knows_what_it_did) {
  // Lifted and put down again, while it is at the limit of what it can give.
  Biped biped(113);
  DynaCoM& dynacom = biped.dynacom;
  compute(dynacom, restState(biped.model));
  int solved = 0, relaxed = 0;
  long warm_iterations = 0, cold_iterations = 0;
  for (int trial = 0; trial < 200; ++trial) {
    Vector6 wrench = groundWrench(dynacom);
    wrench.head<3>() += biped.random.vector3(100.);
    wrench.tail<3>() += biped.random.vector3(trial % 2 == 0 ? 10. : 100.);
    const auto distributeIt = [&] { return distribute(dynacom, wrench, dynacom.getCoM()); };
    DynaCoM cold = dynacom;
    cold.setWarmStart(false);
    distribute(cold, wrench, dynacom.getCoM());
    const auto status = distributeIt();
    distributeIt();  // if the first one was not by Newton's method, this one is
    distributeIt();
    const DistributionResult before = dynacom.getDistribution();
    if (before.iterations > 1) continue;  // one for the robust solver
    dynacom.deactivateContact("right");
    dynacom.activateContact("right");
    BOOST_TEST(distributeIt() == status);
    BOOST_TEST(dynacom.getDistribution().iterations == 1);
    BOOST_TEST(close(dynacom.getDistribution().forces() / before.scale,
                     before.forces() / before.scale, 1e-9));
    (status == DistributionStatus::Solved ? solved : relaxed) += 1;
    // After a while on the other foot, which has another task then, it still is of use.
    dynacom.deactivateContact("right");
    distributeIt();
    dynacom.activateContact("right");
    BOOST_TEST(distributeIt() == status);
    warm_iterations += dynacom.getDistribution().iterations;
    cold_iterations += cold.getDistribution().iterations;
  }
  BOOST_TEST(solved > 10);
  BOOST_TEST(relaxed > 50);
  BOOST_TEST(solved + relaxed > 195);
  BOOST_TEST(warm_iterations <= cold_iterations);
  BOOST_TEST_MESSAGE(solved << " solved, " << relaxed << " relaxed; after a while "
                            << warm_iterations << " iterations instead of " << cold_iterations);
}

// --- Contacts ----------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(contacts_are_shared_and_any_kind_is_taken) {
  const auto model = singleBody(10., stance(2));
  DynaCoM dynacom(model);
  const std::shared_ptr<ContactBase> sole = makeSole("sole0"), point = makePoint("sole1");
  dynacom.addContact(sole, "sole");
  dynacom.addContact6d(point, "point", false);
  BOOST_TEST(dynacom.getContact("sole") == sole);
  BOOST_TEST(dynacom.getContact("point") == point);
  BOOST_TEST(dynacom.getActiveContacts() == Names{"sole"}, boost::test_tools::per_element());
  BOOST_TEST(dynacom.getKnownContacts() == (Names{"sole", "point"}),
             boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(the_old_names_are_the_same_functions) {
  const auto model = singleBody(10., stance(2));
  DynaCoM dynacom(model);
  dynacom.addContact6d(makeSole("sole0"), "a");
  dynacom.addContact6d(makePoint("sole1"), "b");
  dynacom.deactivateContact6d("a");
  BOOST_TEST(dynacom.getActiveContacts() == Names{"b"}, boost::test_tools::per_element());
  dynacom.activateContact6d("a");
  BOOST_TEST(dynacom.getActiveContacts() == (Names{"b", "a"}), boost::test_tools::per_element());
  dynacom.removeContact6d("b");
  BOOST_TEST(dynacom.getKnownContacts() == Names{"a"}, boost::test_tools::per_element());
}

BOOST_AUTO_TEST_CASE(activating_what_is_active_does_nothing) {
  Biped biped(40);
  compute(biped.dynacom, restState(biped.model));
  distribute(biped.dynacom);
  const View before = everythingSeen(biped.dynacom);
  biped.dynacom.activateContact("left");  // in particular, it does not become the last one
  BOOST_TEST(same(everythingSeen(biped.dynacom), before));

  biped.dynacom.deactivateContact("left");
  const View without = everythingSeen(biped.dynacom);
  biped.dynacom.deactivateContact("left");
  BOOST_TEST(same(everythingSeen(biped.dynacom), without));
}

BOOST_AUTO_TEST_CASE(who_takes_no_part_gives_no_force) {
  Biped biped(41);
  compute(biped.dynacom, restState(biped.model));
  distribute(biped.dynacom);
  BOOST_TEST(biped.left->appliedForce().norm() > 1.);
  biped.dynacom.deactivateContact("left");
  BOOST_TEST(close(biped.left->appliedForce(), Vector6::Zero(), 0.));
  BOOST_TEST(biped.right->appliedForce().norm() > 1.);
  biped.dynacom.removeContact("right");
  BOOST_TEST(close(biped.right->appliedForce(), Vector6::Zero(), 0.));
}

BOOST_AUTO_TEST_CASE(setters_of_a_shared_contact_act_on_the_next_call) {
  Biped biped(42);
  compute(biped.dynacom, restState(biped.model));
  Vector6 wrench = groundWrench(biped.dynacom);
  wrench.x() = 0.3 * wrench.z();
  // The force acts on the ground, so that only friction can refuse it.
  wrench[4] = -wrench.x() * biped.dynacom.getCoM().z();
  const Vector3d com = biped.dynacom.getCoM();
  BOOST_TEST(distribute(biped.dynacom, wrench, com) == DistributionStatus::Solved);
  biped.left->setMu(0.1);
  biped.right->setMu(0.1);
  BOOST_TEST(distribute(biped.dynacom, wrench, com) == DistributionStatus::Relaxed);
  BOOST_TEST(close(biped.dynacom.fri_A().topLeftCorner<6, 6>(), biped.left->fri_A(), 0.));

  biped.left->setMu(0.7);
  biped.right->setMu(0.7);
  biped.left->setForceWeights(Vector3d::Constant(2.));
  biped.left->setTorqueWeights(Vector3d::Constant(2.));
  BOOST_TEST(distribute(biped.dynacom, wrench, com) == DistributionStatus::Solved);
  BOOST_TEST(biped.left->appliedForce().z() < biped.right->appliedForce().z());
}

BOOST_AUTO_TEST_CASE(a_contact_that_moved_to_another_frame_acts_there_on_the_next_call) {
  Biped biped(43);
  const State x = biped.moving();
  compute(biped.dynacom, x);
  auto settings = biped.left->getSettings();
  settings.frame_name = "sole1";
  biped.left->initialize(settings);
  const auto poseMatches = [&](const char* frame) {
    return close(biped.left->getPose().toHomogeneousMatrix(),
                 framePlacement(biped.model, x.q, frame).toHomogeneousMatrix());
  };
  compute(biped.dynacom, x);
  BOOST_TEST(poseMatches("sole1"));
  BOOST_TEST(biped.left->getFrameID() == biped.model.getFrameId("sole1"));

  settings.frame_name = "sole0";
  biped.left->initialize(settings);
  distribute(biped.dynacom);
  BOOST_TEST(poseMatches("sole0"));
}

BOOST_AUTO_TEST_CASE(a_contact_that_moved_to_no_frame_is_refused_on_the_next_call) {
  Biped biped(44);
  const State x = biped.moving();
  compute(biped.dynacom, x);
  auto settings = biped.right->getSettings();
  settings.frame_name = "nowhere";
  biped.right->initialize(settings);
  const View before = everythingSeen(biped.dynacom);
  const State y = biped.moving();
  BOOST_TEST(throws<std::invalid_argument>([&] { compute(biped.dynacom, y); }, {"nowhere"}));
  BOOST_TEST(same(everythingSeen(biped.dynacom), before));
  // Also where the contacts that have a frame would be placed anew.
  runForwardKinematics(biped.dynacom.getModel(), biped.dynacom.getData(), y.q);
  BOOST_TEST(throws<std::invalid_argument>([&] { distribute(biped.dynacom); }, {"nowhere"}));
  BOOST_TEST(same(everythingSeen(biped.dynacom), before));

  settings.frame_name = "sole1";
  biped.right->initialize(settings);
  compute(biped.dynacom, restState(biped.model));
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
}

BOOST_AUTO_TEST_CASE(forces_depend_on_neither_names_nor_history) {
  // Thousands of random steps, beside book-keeping that could not be simpler. After each
  // distribution, every contact's force is what it is in a DynaCoM built anew with the contacts
  // that take part, under other names and in another order.
  Random random(45);
  const auto model = singleBody(50., stance(8));
  std::vector<std::shared_ptr<ContactBase>> contacts;
  Names names;
  for (int i = 0; i < 8; ++i) {
    const std::string frame = "sole" + std::to_string(i);
    if (i % 3 == 0) {
      auto settings = makeSole(frame)->getSettings();
      settings.weights = random.vector(6, 0.5, 2.);
      contacts.push_back(std::make_shared<Contact6D>(settings));
    } else {
      auto settings = makePoint(frame)->getSettings();
      settings.weights = random.vector(3, 0.5, 2.);
      contacts.push_back(std::make_shared<ContactPoint>(settings));
    }
    names.push_back(std::string(1, static_cast<char>('h' - i)) + "_contact");
  }
  const State x = restState(model);
  const Vector3d com(0., 0., 0.8);

  DynaCoM dynacom(model);
  compute(dynacom, x);
  std::vector<std::size_t> active;  // in order of activation
  std::set<std::size_t> known;
  const auto leave = [&](std::size_t i) {
    active.erase(std::remove(active.begin(), active.end(), i), active.end());
  };
  int solved = 0;
  for (int step = 0; step < 4000; ++step) {
    const auto i = static_cast<std::size_t>(random.integer(0, 7));
    const bool isKnown = known.count(i) != 0;
    const auto refused = [&](auto action) {
      BOOST_REQUIRE(throws<std::invalid_argument>(action, {names[i]}));
    };
    switch (random.integer(0, 4)) {
      case 0:
      case 1: {  // more often than removal, so that there are many
        if (isKnown) {
          refused([&] { dynacom.addContact(contacts[i], names[i]); });
          break;
        }
        const bool takesPart = random.coin();
        dynacom.addContact(contacts[i], names[i], takesPart);
        known.insert(i);
        if (takesPart) active.push_back(i);
        break;
      }
      case 2:
        if (!isKnown) {
          refused([&] { dynacom.activateContact(names[i]); });
          break;
        }
        dynacom.activateContact(names[i]);
        if (std::count(active.begin(), active.end(), i) == 0) active.push_back(i);
        break;
      case 3:
        if (!isKnown) {
          refused([&] { dynacom.deactivateContact(names[i]); });
          break;
        }
        dynacom.deactivateContact(names[i]);
        leave(i);
        break;
      default:
        if (!isKnown || random.coin()) break;
        dynacom.removeContact(names[i]);
        known.erase(i);
        leave(i);
    }

    Names expected;
    for (const std::size_t k : active) expected.push_back(names[k]);
    BOOST_REQUIRE(dynacom.getActiveContacts() == expected);
    const Names all = dynacom.getKnownContacts();
    BOOST_REQUIRE(Names(all.begin(), all.begin() + static_cast<long>(active.size())) == expected);
    BOOST_REQUIRE(all.size() == known.size());
    std::set<std::string> knownNames;
    for (const std::size_t k : known) knownNames.insert(names[k]);
    BOOST_REQUIRE(asSet(all) == knownNames);

    Vector6 wrench = random.vector(6, 20.);
    wrench.z() = random.uniform(300., 600.);
    const auto status = distribute(dynacom, wrench, com);

    DynaCoM fresh(model);
    compute(fresh, x);
    std::vector<std::size_t> shuffled = active;
    for (std::size_t k = shuffled.size(); k > 1; --k)
      std::swap(shuffled[k - 1], shuffled[random.integer(0, static_cast<Index>(k) - 1)]);
    for (const std::size_t k : shuffled)
      fresh.addContact(contacts[k]->clone(), "c" + std::to_string(k));
    const auto freshStatus = distribute(fresh, wrench, com);
    BOOST_REQUIRE(status == freshStatus);
    if (status == DistributionStatus::Solved) ++solved;
    if (active.empty()) BOOST_REQUIRE(status == DistributionStatus::NoContact);
    for (std::size_t k = 0; k < contacts.size(); ++k) {
      const bool takesPart = std::count(active.begin(), active.end(), k) != 0;
      const VectorXd force = takesPart ? fresh.getContact("c" + std::to_string(k))->appliedForce()
                                       : VectorXd::Zero(contacts[k]->cols());
      BOOST_REQUIRE(close(contacts[k]->appliedForce(), force, takesPart ? 1e-9 : 0.));
    }

    // The stacked matrices have the contacts' blocks in that order, and nothing else.
    MatrixXd uni = dynacom.uni_A(), fri = dynacom.fri_A();
    Index col = 0, uniRow = 0, friRow = 0;
    for (const std::size_t k : active) {
      const ContactBase& contact = *contacts[k];
      const Index cols = contact.cols(), uniRows = contact.uni_rows(), friRows = contact.fri_rows();
      BOOST_REQUIRE(uni.rows() >= uniRow + uniRows);
      BOOST_REQUIRE(fri.rows() >= friRow + friRows);
      BOOST_REQUIRE(uni.cols() >= col + cols);
      BOOST_REQUIRE(close(uni.block(uniRow, col, uniRows, cols), contact.uni_A(), 0.));
      BOOST_REQUIRE(close(fri.block(friRow, col, friRows, cols), contact.fri_A(), 0.));
      BOOST_REQUIRE(close(dynacom.reg_A().segment(col, cols), contact.reg_A(), 0.));
      BOOST_REQUIRE(close(dynacom.ne_A().middleCols(col, cols), contact.ne_A(), 0.));
      BOOST_REQUIRE(close(dynacom.allForces().segment(col, cols), contact.appliedForce(), 0.));
      uni.block(uniRow, col, uniRows, cols).setZero();
      fri.block(friRow, col, friRows, cols).setZero();
      col += cols;
      uniRow += uniRows;
      friRow += friRows;
    }
    BOOST_REQUIRE(close(uni, MatrixXd::Zero(uniRow, col), 0.));
    BOOST_REQUIRE(close(fri, MatrixXd::Zero(friRow, col), 0.));
    BOOST_REQUIRE(close(dynacom.uni_b(), VectorXd::Zero(uniRow), 0.));
    BOOST_REQUIRE(close(dynacom.fri_b(), VectorXd::Zero(friRow), 0.));
    BOOST_REQUIRE(close(dynacom.reg_b(), VectorXd::Zero(col), 0.));
    BOOST_REQUIRE(dynacom.reg_A().size() == col);
    BOOST_REQUIRE(dynacom.ne_A().cols() == col);
    BOOST_REQUIRE(dynacom.allForces().size() == col);
    BOOST_REQUIRE(close(dynacom.ne_b(), wrench, 0.));
  }
  BOOST_TEST(solved > 1000);
}

// --- Errors ------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(mistakes_are_named_and_change_nothing) {
  Biped biped(50);
  DynaCoM& dynacom = biped.dynacom;
  const State x = biped.moving();
  dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  dynacom.deactivateContact("right");

  const auto mistake = [&](auto action, std::initializer_list<std::string> words) {
    const View before = everythingSeen(dynacom);
    BOOST_TEST(throws<std::invalid_argument>(action, words));
    BOOST_TEST(same(everythingSeen(dynacom), before));
  };
  const auto point = makePoint("sole1");

  // Names that are not known. The message tells those that are.
  mistake([&] { dynacom.getContact("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.removeContact("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.activateContact("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.deactivateContact("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.removeContact6d("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.getContact(""); }, {"left", "right"});
  mistake([&] { dynacom.getContactCoP("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.getContactFrictionUsage("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.getContactCoPMargin("tail"); }, {"tail", "left", "right"});
  mistake([&] { dynacom.getContactYawUsage("tail"); }, {"tail", "left", "right"});
  // A name that is taken, by an active contact and by another.
  mistake([&] { dynacom.addContact(point, "left"); }, {"left"});
  mistake([&] { dynacom.addContact(point, "right"); }, {"right"});
  // A contact that is known already, under another name.
  mistake([&] { dynacom.addContact(biped.left, "again"); }, {"again", "left"});
  mistake([&] { dynacom.addContact(biped.right, "again"); }, {"again", "right"});
  // No contact, or one that knows nothing.
  mistake([&] { dynacom.addContact(nullptr, "nothing"); }, {"nothing", "null"});
  mistake([&] { dynacom.addContact(std::make_shared<Contact6D>(), "empty"); }, {"empty"});
  mistake([&] { dynacom.addContact(std::make_shared<ContactPoint>(), "empty"); }, {"empty"});
  // A frame that the model does not have.
  const auto lost = makePoint("nowhere");
  mistake([&] { dynacom.addContact(lost, "lost"); }, {"lost", "nowhere"});
  BOOST_TEST(lost->getFrameID() == +ContactBase::kUnknownFrame);

  // Sizes: the vector's name, the size expected, and the size that came.
  const auto wrongSize = [&](const State& bad, const std::string& name, Index expected, Index got) {
    for (const bool flat : {true, false})
      mistake([&] { compute(dynacom, bad, Vector6::Zero(), flat); },
              {name, std::to_string(expected), std::to_string(got)});
    mistake([&] { dynacom.computeNL(3., bad.q, bad.v, bad.a); },
            {name, std::to_string(expected), std::to_string(got)});
  };
  const Index nq = biped.model.nq, nv = biped.model.nv;
  State bad = x;
  bad.q = VectorXd::Zero(nq - 1);
  wrongSize(bad, "q", nq, nq - 1);
  bad = x;
  bad.v = VectorXd::Zero(nv + 1);
  wrongSize(bad, "v", nv, nv + 1);
  bad = x;
  bad.a = VectorXd::Zero(0);
  wrongSize(bad, "a", nv, 0);

  // A natural frequency is positive.
  for (const auto& [omega, text] : {std::pair<double, const char*>(0., "0"),
                                    {-0.25, "-0.25"},
                                    {-kInfinity, "-inf"},
                                    {kNaN, "nan"}}) {
    mistake([&, w = omega] { dynacom.computeNL(w); }, {"omega", text});
    const State y = biped.moving();
    mistake([&, w = omega] { dynacom.computeNL(w, y.q, y.v, y.a); }, {"omega", text});
  }

  // Another robot, which cannot be.
  mistake([&] { dynacom.initialize(DynaCoMSettings()); }, {"urdf"});
  mistake([&] { dynacom.initialize(pinocchio::Model()); }, {"mass"});

  // And it still works.
  dynacom.activateContact("right");
  compute(dynacom, restState(biped.model));
  BOOST_TEST(distribute(dynacom) == DistributionStatus::Solved);
}

BOOST_AUTO_TEST_CASE(an_empty_dynacom_waits_for_a_robot) {
  DynaCoM dynacom;
  const VectorXd q = VectorXd::Zero(7), v = VectorXd::Zero(6);
  const auto notYet = [&](auto action) {
    BOOST_TEST(throws<NotReadyError>(action, {"initialize"}));
  };
  notYet([&] { dynacom.computeDynamics(q, v, v); });
  notYet([&] { dynacom.computeNL(3.); });
  notYet([&] { dynacom.computeNL(3., q, v, v); });
  notYet([&] { dynacom.distributeForce(Vector3d::Zero(), Vector3d::Zero(), Vector3d::Zero()); });
  notYet([&] { dynacom.addContact(makeSole("sole0"), "left"); });
  // There are no names that would be known.
  for (const auto& action :
       {std::function<void()>([&] { dynacom.removeContact("left"); }),
        std::function<void()>([&] { dynacom.activateContact("left"); }),
        std::function<void()>([&] { dynacom.deactivateContact("left"); }),
        std::function<void()>([&] { dynacom.getContact("left"); }),
        std::function<void()>([&] { dynacom.getContactCoP("left"); }),
        std::function<void()>([&] { dynacom.getContactFrictionUsage("left"); }),
        std::function<void()>([&] { dynacom.getContactCoPMargin("left"); }),
        std::function<void()>([&] { dynacom.getContactYawUsage("left"); })})
    BOOST_TEST(throws<std::invalid_argument>(action, {"left", "none"}));
  BOOST_TEST(!dynacom.isInitialized());
  BOOST_TEST(motionIsUnknown(dynacom));
  BOOST_TEST(dynacom.allForces().size() == 0);
  BOOST_TEST(dynacom.ne_A().size() == 0);
  BOOST_TEST(allNaN(dynacom.getDistribution().wrench));
  BOOST_TEST(std::isnan(dynacom.computeWrenchMargin().margin));
  BOOST_TEST(dynacom.getKnownContacts().empty());
  BOOST_TEST(dynacom.getActiveContacts().empty());
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::NoContact);
  // Settings do not have to wait.
  const Vector6 weights = Vector6::Constant(2.);
  dynacom.setGroundHeight(0.1);
  dynacom.setMinimalVerticalForce(2.5);
  dynacom.setWrenchWeights(weights);

  const auto model = singleBody(50., stance(2));
  dynacom.initialize(model);
  BOOST_TEST(dynacom.isInitialized());
  BOOST_TEST(dynacom.getGroundHeight() == 0.1);
  BOOST_TEST(dynacom.getMinimalVerticalForce() == 2.5);
  BOOST_TEST(close(dynacom.getWrenchWeights(), weights, 0.));
  compute(dynacom, restState(model));
  BOOST_TEST(close(dynacom.getGroundCoMForce(), Vector3d(0., 0., 490.5)));
}

BOOST_AUTO_TEST_CASE(non_linearity_needs_dynamics_before) {
  Biped biped(51);
  BOOST_TEST(throws<NotReadyError>([&] { biped.dynacom.computeNL(3.); }, {"computeDynamics"}));
  BOOST_TEST(allNaN(biped.dynacom.getVRP()));
  BOOST_TEST(allNaN(biped.dynacom.getNL()));
  // Again after another robot has come.
  compute(biped.dynacom, restState(biped.model));
  BOOST_CHECK_NO_THROW(biped.dynacom.computeNL(3.));
  biped.dynacom.initialize(biped.model);
  BOOST_TEST(throws<NotReadyError>([&] { biped.dynacom.computeNL(3.); }, {"computeDynamics"}));
}

// --- Robots ------------------------------------------------------------------------------------

BOOST_AUTO_TEST_CASE(gravity_of_a_model_lies_along_minus_z) {
  auto model = singleBody(50., {});
  for (const Vector3d& good :
       {Vector3d(0., 0., -9.81), Vector3d(0., 0., 0.), Vector3d(0., 0., -100.)}) {
    model.gravity.linear() = good;
    const DynaCoM dynacom(model);
    BOOST_TEST(close(dynacom.getSettings().gravity, good, 0.));
    BOOST_TEST(close(dynacom.getModel().gravity.linear(), good, 0.));
    BOOST_TEST(dynacom.getSettings().urdf.empty());
  }
  for (const Vector3d& bad :
       {Vector3d(0., 0., 9.81), Vector3d(9.81, 0., 0.), Vector3d(0., 1e-3, -9.81),
        Vector3d(0., 0., kNaN), Vector3d(kNaN, 0., -9.81), Vector3d(0., 0., -1. / 0.)}) {
    model.gravity.linear() = bad;
    BOOST_TEST(throws<std::invalid_argument>([&] { DynaCoM dynacom(model); }, {"gravity"}));
    DynaCoMSettings settings;
    settings.urdf = "robot.urdf";
    settings.gravity = bad;
    BOOST_TEST(throws<std::invalid_argument>([&] { settings.validate(); }, {"gravity"}));
  }
  model.gravity.linear() << 0., 0.25, -9.5;
  BOOST_TEST(
      throws<std::invalid_argument>([&] { DynaCoM dynacom(model); }, {"gravity", "0.25", "-9.5"}));
}

BOOST_AUTO_TEST_CASE(a_robot_has_a_mass) {
  BOOST_TEST(throws<std::invalid_argument>([] { DynaCoM dynacom{pinocchio::Model()}; }, {"mass"}));
  for (const double mass : {0., -1., kNaN, kInfinity}) {
    auto model = singleBody(1., {});
    model.inertias[1].mass() = mass;
    BOOST_TEST(throws<std::invalid_argument>([&] { DynaCoM dynacom(model); }, {"mass"}));
  }
}

BOOST_AUTO_TEST_CASE(initialize_takes_another_robot_and_forgets_the_contacts) {
  Biped biped(60);
  const State x = biped.moving();
  biped.dynacom.setGroundHeight(0.1);
  biped.dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);

  // In the other robot, the frames of the same names have other indices and other places.
  Random random(61);
  const auto other = standingRobot(random, stance(8));
  BOOST_REQUIRE(other.getFrameId("sole0") != biped.model.getFrameId("sole0"));
  biped.dynacom.initialize(other);
  BOOST_TEST(biped.dynacom.getKnownContacts().empty());
  BOOST_TEST(biped.dynacom.getActiveContacts().empty());
  BOOST_TEST(biped.dynacom.allForces().size() == 0);
  BOOST_TEST(biped.dynacom.getDistributionStatus() == DistributionStatus::NoContact);
  BOOST_TEST(motionIsUnknown(biped.dynacom));
  BOOST_TEST(close(biped.dynacom.getMass(), totalMass(other)));
  BOOST_TEST(biped.dynacom.getGroundHeight() == 0.1);
  // The forces of the robot before are not kept for this one.
  BOOST_TEST(biped.left->appliedForce().isZero(0.));

  biped.dynacom.addContact(biped.left, "left");
  biped.dynacom.addContact(biped.right, "right");
  const State y = randomState(other, random, 0.05);
  compute(biped.dynacom, y);
  BOOST_TEST(close(groundWrench(biped.dynacom), rootWrench(other, y)));
  BOOST_TEST(close(biped.left->getPose().toHomogeneousMatrix(),
                   framePlacement(other, y.q, "sole0").toHomogeneousMatrix()));
}

BOOST_AUTO_TEST_CASE(the_model_given_is_copied) {
  auto model = singleBody(50., stance(2));
  DynaCoM dynacom(model);
  model.gravity.linear().setZero();
  model.inertias[1].mass() = 1.;
  compute(dynacom, restState(model));
  BOOST_TEST(close(dynacom.getGroundCoMForce(), Vector3d(0., 0., 490.5)));
}

BOOST_AUTO_TEST_CASE(a_copy_shares_nothing) {
  Biped biped(62);
  biped.dynacom.setGroundHeight(0.1);
  const State x = restState(biped.model);
  biped.dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  BOOST_REQUIRE(biped.dynacom.getDistributionStatus() == DistributionStatus::Solved);

  DynaCoM assigned;
  assigned = biped.dynacom;
  for (DynaCoM copy : {DynaCoM(biped.dynacom), assigned}) {
    const View before = everythingSeen(biped.dynacom);
    BOOST_TEST(same(everythingSeen(copy), before));
    BOOST_TEST(copy.getContact("left") != biped.dynacom.getContact("left"));
    BOOST_TEST(biped.dynacom.getContact("left") == biped.left);

    // What happens to the copy...
    auto left = std::dynamic_pointer_cast<Contact6D>(copy.getContact("left"));
    BOOST_REQUIRE(left);
    left->setMu(0.01);
    copy.setGroundHeight(0.2);
    copy.deactivateContact("right");
    copy.addContact(makePoint("sole0"), "point");
    compute(copy, biped.moving(), Vector6::Zero(), false);
    BOOST_TEST(same(everythingSeen(biped.dynacom), before));
    BOOST_TEST(biped.left->getSettings().mu == 0.7);

    // ... and to the original concerns the other one not.
    const View copied = everythingSeen(copy);
    biped.dynacom.deactivateContact("left");
    biped.dynacom.activateContact("left");
    biped.dynacom.deactivateContact("right");
    biped.dynacom.activateContact("right");
    biped.dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
    BOOST_TEST(same(everythingSeen(copy), copied));
  }
}

BOOST_AUTO_TEST_CASE(a_copy_gives_the_same_results) {
  Biped biped(63);
  compute(biped.dynacom, biped.moving());
  DynaCoM copy = biped.dynacom;
  for (int trial = 0; trial < 5; ++trial) {
    const State x = biped.moving();
    biped.dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
    copy.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
    BOOST_TEST(same(everythingSeen(copy), everythingSeen(biped.dynacom)));
  }
}

BOOST_AUTO_TEST_CASE(a_move_keeps_the_contacts) {
  Biped biped(64);
  compute(biped.dynacom, biped.moving());
  const View before = everythingSeen(biped.dynacom);
  const DynaCoM moved = std::move(biped.dynacom);
  BOOST_TEST(same(everythingSeen(moved), before));
  BOOST_TEST(moved.getContact("left") == biped.left);
}

BOOST_AUTO_TEST_CASE(what_was_moved_from_waits_for_a_robot) {
  Biped biped(66);
  biped.dynacom.setWarmStart(false);
  compute(biped.dynacom, biped.moving(), Vector6::Zero(), false);
  const State x = biped.moving();
  DynaCoM moved = std::move(biped.dynacom), assigned;
  DynaCoM& husk = biped.dynacom;
  for (const bool again : {false, true}) {
    if (again) assigned = std::move(moved);
    for (DynaCoM* dynacom : again ? std::vector{&husk, &moved} : std::vector{&husk}) {
      BOOST_TEST(!dynacom->isInitialized());
      BOOST_TEST(dynacom->getMass() == 0.);
      BOOST_TEST(dynacom->getKnownContacts().empty());
      BOOST_TEST(dynacom->allForces().size() == 0);
      BOOST_TEST(dynacom->getDistributionStatus() == DistributionStatus::NoContact);
      BOOST_TEST(dynacom->getWarmStart());
      BOOST_TEST(throws<NotReadyError>([&] { compute(*dynacom, x); }, {"initialize"}));
      BOOST_TEST(throws<NotReadyError>([&] { distribute(*dynacom); }, {"initialize"}));
      BOOST_TEST(throws<NotReadyError>([&] { dynacom->addContact(makeSole("sole0"), "sole"); },
                                       {"initialize"}));
    }
  }
  BOOST_TEST(assigned.isInitialized());
  BOOST_TEST(!assigned.getWarmStart());
  BOOST_TEST(assigned.getContact("left") == biped.left);
}

BOOST_AUTO_TEST_CASE(a_contact_stays_the_one_that_was_asked_for) {
  Biped biped(67);
  const auto& left = biped.dynacom.getContact("left");
  const auto& right = biped.dynacom.getContact("right");
  biped.dynacom.deactivateContact("left");
  biped.dynacom.activateContact("left");
  biped.dynacom.deactivateContact("right");
  BOOST_TEST(left == biped.left);
  BOOST_TEST(right == biped.right);
  biped.dynacom.removeContact("left");
  BOOST_TEST(left == biped.left);
}

BOOST_AUTO_TEST_CASE(a_contact_serves_one_robot_at_a_time) {
  Biped biped(68);
  DynaCoM other(biped.model);
  const auto expectTaken = [&] {
    BOOST_TEST(throws<std::invalid_argument>([&] { other.addContact(biped.left, "foot"); },
                                             {"foot", "another DynaCoM"}));
    BOOST_TEST(other.getKnownContacts().empty());
  };
  const auto expectFree = [&] {
    BOOST_CHECK_NO_THROW(other.addContact(biped.left, "foot"));
    other.removeContact("foot");
  };
  expectTaken();
  // Where it is inactive, moves with its robot, is initialised again, or assigned to, too.
  biped.dynacom.deactivateContact("left");
  expectTaken();
  DynaCoM moved = std::move(biped.dynacom);
  expectTaken();
  biped.left->initialize(biped.left->getSettings());
  expectTaken();
  const Contact6D copy = *biped.left;
  *biped.left = *makeSole("sole0");
  expectTaken();
  // Copies of it are free, and those that copies of its robot have are not.
  BOOST_CHECK_NO_THROW(other.addContact(std::make_shared<Contact6D>(copy), "foot"));
  DynaCoM copied = moved, assigned;
  assigned = copied;
  for (const DynaCoM* robot : {&copied, &assigned})
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { other.addContact(robot->getContact("left"), "hand"); }, {"another"}));
  const auto old = assigned.getContact("left");
  assigned = moved;
  BOOST_CHECK_NO_THROW(other.addContact(old, "hand"));
  other.initialize(biped.model);
  // It is free when its robot has removed it, knows another robot, or is gone.
  moved.removeContact("left");
  expectFree();
  moved.addContact(biped.left, "left");
  expectTaken();
  moved.initialize(biped.model);
  expectFree();
  {
    DynaCoM short_lived(biped.model);
    short_lived.addContact(biped.left, "left");
    expectTaken();
  }
  expectFree();
  // A contact that was refused is no less free.
  BOOST_CHECK_THROW(other.addContact(makeSole("no frame"), "foot"), std::invalid_argument);
  auto lost = makeSole("no frame");
  BOOST_CHECK_THROW(other.addContact(lost, "foot"), std::invalid_argument);
  lost->initialize(biped.left->getSettings());
  BOOST_CHECK_NO_THROW(other.addContact(lost, "foot"));
}

BOOST_AUTO_TEST_CASE(what_was_never_initialised_has_no_force_to_ask_for) {
  Biped biped(69);
  compute(biped.dynacom, restState(biped.model));
  distribute(biped.dynacom);
  *biped.left = Contact6D();
  BOOST_TEST(allNaN(biped.dynacom.getContactCoP("left")));
  BOOST_TEST(std::isnan(biped.dynacom.getContactCoPMargin("left")));
  BOOST_TEST(std::isnan(biped.dynacom.getContactFrictionUsage("left")));
  BOOST_TEST(std::isnan(biped.dynacom.getContactYawUsage("left")));
  BOOST_TEST(biped.dynacom.allForces().size() == 6);
  BOOST_TEST(throws<std::invalid_argument>([&] { distribute(biped.dynacom); }, {"left", "frame"}));
  *biped.left = *makeSole("sole0");
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
}

BOOST_AUTO_TEST_CASE(a_quaternion_that_is_none_is_a_motion_of_which_nothing_is_known) {
  Biped biped(70);
  DynaCoM& dynacom = biped.dynacom;
  const State good = biped.moving();
  compute(dynacom, good, Vector6::Zero(), false);
  const VectorXd forces = dynacom.allForces();
  for (const double factor : {0., 0.99, 1.01, -2.}) {
    for (const bool flat : {true, false}) {
      State x = good;
      x.q.segment<4>(3) *= factor;
      compute(dynacom, x, Vector6::Zero(), flat);
      BOOST_TEST(motionIsUnknown(dynacom));
      // Nor is it known where contacts are: what is asked of them next is not answered either.
      BOOST_TEST(distribute(dynacom, Vector6::Constant(1.), Vector3d::Zero()) ==
                 DistributionStatus::InvalidInput);
      BOOST_TEST(close(dynacom.allForces(), forces, 1e-9));
      dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), flat);
      BOOST_TEST(motionIsUnknown(dynacom));
      compute(dynacom, good, Vector6::Zero(), flat);
      BOOST_TEST(dynacom.isCoPDefined());
    }
  }
  State x = good;
  x.q.segment<4>(3) *= 1.0005;  // files are often rounded
  compute(dynacom, x);
  BOOST_TEST(dynacom.isCoPDefined());
}

BOOST_AUTO_TEST_CASE(what_was_moved_from_can_be_used_again) {
  Biped biped(65);
  const DynaCoM moved = std::move(biped.dynacom);
  DynaCoM another(moved), assigned(moved);
  const DynaCoM away = std::move(another), gone = std::move(assigned);
  assigned = moved;
  for (DynaCoM* dynacom : {&another, &assigned}) {
    dynacom->initialize(biped.model);
    dynacom->addContact(makeSole("sole0"), "left");
    dynacom->addContact(makeSole("sole1"), "right");
    compute(*dynacom, restState(biped.model));
    BOOST_TEST(distribute(*dynacom) == DistributionStatus::Solved);
  }
}

BOOST_AUTO_TEST_CASE(settings_compare_and_print_by_every_field) {
  DynaCoMSettings settings;
  BOOST_TEST(settings.urdf.empty());
  BOOST_TEST(close(settings.gravity, Vector3d(0., 0., -9.81), 0.));
  settings.urdf = "some_robot.urdf";
  settings.gravity << 0., 0., -1.625;
  DynaCoMSettings same = settings;
  BOOST_TEST((same == settings));
  BOOST_TEST(!(same != settings));
  const std::string text = settings.to_string();
  for (const char* word : {"urdf", "some_robot.urdf", "gravity", "-1.625"})
    BOOST_TEST(mentions(text, word), word << " is missing in " << text);
  std::ostringstream out;
  out << settings;
  BOOST_TEST(out.str() == text);

  DynaCoMSettings other = settings;
  other.urdf = "another_robot.urdf";
  BOOST_TEST((other != settings));
  BOOST_TEST(!(other == settings));
  BOOST_TEST(other.to_string() != text);
  other = settings;
  other.gravity.z() = -1.5;
  BOOST_TEST((other != settings));
  BOOST_TEST(!(other == settings));
  BOOST_TEST(other.to_string() != text);
}

// --- URDF --------------------------------------------------------------------------------------

namespace {

const std::string kUrdf = R"(<?xml version="1.0"?>
<robot name="hopper">
  <link name="trunk">
    <inertial>
      <origin xyz="0.01 0.02 0.03"/><mass value="12.5"/>
      <inertia ixx="0.3" ixy="0.01" ixz="0" iyy="0.2" iyz="0.02" izz="0.4"/>
    </inertial>
  </link>
  <link name="leg">
    <inertial>
      <origin xyz="0 0 -0.2"/><mass value="2.5"/>
      <inertia ixx="0.03" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.04"/>
    </inertial>
  </link>
  <link name="sole"/>
  <joint name="hip" type="revolute">
    <parent link="trunk"/><child link="leg"/><axis xyz="0 1 0"/>
    <origin xyz="0 0 -0.3"/><limit lower="-1" upper="1" effort="100" velocity="10"/>
  </joint>
  <joint name="ankle" type="fixed">
    <parent link="leg"/><child link="sole"/><origin xyz="0 0 -0.4"/>
  </joint>
</robot>
)";

/// A directory of its own for the files of a test, which goes when the test ends.
class TemporaryDirectory {
 public:
  TemporaryDirectory() {
    std::filesystem::remove_all(path_);
    std::filesystem::create_directories(path_);
  }
  ~TemporaryDirectory() { std::filesystem::remove_all(path_); }

  std::string path() const { return path_.string(); }
  std::string write(const std::string& name, const std::string& content) const {
    const auto file = path_ / name;
    std::ofstream(file) << content;
    return file.string();
  }

 private:
  std::filesystem::path path_ = std::filesystem::temp_directory_path() /
                                ("dynacom test of process " + std::to_string(getpid()));
};

/// What is written to standard output and standard error, by whomever, while an action runs.
std::string printedBy(const std::function<void()>& action) {
  std::fflush(nullptr);
  std::FILE* file = std::tmpfile();
  const int output = dup(STDOUT_FILENO), error = dup(STDERR_FILENO);
  dup2(fileno(file), STDOUT_FILENO);
  dup2(fileno(file), STDERR_FILENO);
  action();
  std::fflush(nullptr);
  std::cout.flush();
  std::cerr.flush();
  dup2(output, STDOUT_FILENO);
  dup2(error, STDERR_FILENO);
  close(output);
  close(error);
  std::rewind(file);
  std::string text;
  for (int c = std::fgetc(file); c != EOF; c = std::fgetc(file)) text += static_cast<char>(c);
  std::fclose(file);
  return text;
}

DynaCoMSettings settingsOf(const std::string& urdf) {
  DynaCoMSettings settings;
  settings.urdf = urdf;
  return settings;
}

/// The robot of kUrdf with links and joints added.
std::string hopperWith(const std::string& parts) {
  std::string urdf = kUrdf;
  return urdf.insert(urdf.find("<link"), parts);
}

std::string joint(const std::string& name, const std::string& type, const std::string& parent,
                  const std::string& child, const std::string& origin = "") {
  return "<joint name=\"" + name + "\" type=\"" + type + "\"><parent link=\"" + parent +
         "\"/><child link=\"" + child + "\"/>" + origin + "</joint>";
}

}  // namespace

BOOST_AUTO_TEST_CASE(a_urdf_is_a_path_or_the_text_itself) {
  const TemporaryDirectory directory;
  const std::string path = directory.write("my hopper.urdf", kUrdf);
  DynaCoM fromPath, fromText;
  BOOST_TEST(printedBy([&] {
               fromPath.initialize(settingsOf(path));
               fromText.initialize(settingsOf(kUrdf));
             }) == "");
  BOOST_TEST((fromPath.getModel() == fromText.getModel()));
  BOOST_TEST((fromPath.getSettings() == settingsOf(path)));
  BOOST_TEST((fromText.getSettings() == settingsOf(kUrdf)));

  // The root joint is a free-flyer, and all that the file says is there.
  const auto& model = fromPath.getModel();
  BOOST_TEST(model.nq == 7 + 1);
  BOOST_TEST(model.nv == 6 + 1);
  BOOST_TEST(model.existJointName("hip"));
  BOOST_TEST(model.existFrame("sole"));
  BOOST_TEST(close(fromPath.getMass(), 15.));

  State x = restState(model);
  x.q[2] = 0.7;
  fromPath.addContact(makeSole("sole"), "sole");
  compute(fromPath, x, Vector6::Zero(), false);
  BOOST_TEST(fromPath.getDistributionStatus() == DistributionStatus::Solved);
  BOOST_TEST(close(fromPath.getContact("sole")->getPose().translation(), Vector3d::Zero()));
  BOOST_TEST(close(fromPath.getCoP(), Vector2d(12.5 * 0.01 / 15., 12.5 * 0.02 / 15.), 1e-9));
}

BOOST_AUTO_TEST_CASE(a_path_may_have_spaces_and_odd_letters) {
  const TemporaryDirectory directory;
  for (const char* name : {" leading.urdf", "trailing ", "two  spaces", "r\u00f6bot.urdf", "a'b\"c",
                           "no extension", "percent%20.urdf", "<robot>.urdf"}) {
    const std::string path = directory.write(name, kUrdf);
    BOOST_TEST_CONTEXT(path) {
      DynaCoM dynacom;
      BOOST_TEST(printedBy([&] { dynacom.initialize(settingsOf(path)); }) == "");
      BOOST_TEST(close(dynacom.getMass(), 15.));
    }
  }
}

BOOST_AUTO_TEST_CASE(a_text_may_begin_with_white_space) {
  const DynaCoM dynacom(settingsOf("\n  \t" + kUrdf.substr(kUrdf.find("<robot"))));
  BOOST_TEST(close(dynacom.getMass(), 15.));
}

BOOST_AUTO_TEST_CASE(a_floating_joint_at_the_root_is_the_free_flyer) {
  const DynaCoM plain(settingsOf(kUrdf));
  const std::string origin = "<origin xyz=\"1 2 3\" rpy=\"0.1 0.2 0.3\"/>";
  for (const std::string& root :
       {"<link name=\"world\"/>" + joint("base", "floating", "world", "trunk"),
        "<link name=\"world\"/>" + joint("base", "floating", "world", "trunk", origin),
        "<link name=\"world\"/><link name=\"map\"/>" +
            joint("fix", "fixed", "world", "map", origin) +
            joint("base", "floating", "map", "trunk", origin)}) {
    BOOST_TEST_CONTEXT(root) {
      DynaCoM dynacom;
      BOOST_TEST(printedBy([&] { dynacom.initialize(settingsOf(hopperWith(root))); }) == "");
      const auto& model = dynacom.getModel();
      BOOST_TEST(model.nq == 7 + 1);
      BOOST_TEST(model.nv == 6 + 1);
      BOOST_TEST(model.names[1] == "base");
      BOOST_TEST(close(dynacom.getMass(), 15.));
      // Its coordinates are the pose of the trunk in the world, as those of the one that is added.
      Random random(71);
      const State x = randomState(model, random);
      DynaCoM reference(plain);
      for (DynaCoM* one : {&dynacom, &reference}) {
        one->addContact(makeSole("sole"), "sole");
        compute(*one, x, Vector6::Zero(), false);
      }
      BOOST_TEST(close(framePlacement(model, x.q, "trunk").translation(), x.q.head<3>()));
      BOOST_TEST(close(dynacom.getCoM(), reference.getCoM()));
      BOOST_TEST(close(groundWrench(dynacom), groundWrench(reference)));
      BOOST_TEST(close(dynacom.getContact("sole")->getPose().toHomogeneousMatrix(),
                       reference.getContact("sole")->getPose().toHomogeneousMatrix()));
    }
  }
}

BOOST_AUTO_TEST_CASE(other_floating_joints_are_joints) {
  const std::string mass =
      "<inertial><mass value=\"1\"/>"
      "<inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>";
  const std::string world = "<link name=\"world\"/>",
                    ball = "<link name=\"ball\">" + mass + "</link>";
  const std::string floating = joint("base", "floating", "world", "trunk");
  const auto nq = [](const std::string& part) {
    return DynaCoM(settingsOf(hopperWith(part))).getModel().nq;
  };
  // Below the base.
  BOOST_TEST(nq(ball + joint("throw", "floating", "trunk", "ball")) == 7 + 1 + 7);
  BOOST_TEST(nq(world + floating + ball + joint("throw", "floating", "trunk", "ball")) ==
             7 + 1 + 7);
  // The root link is a body itself, or holds another.
  BOOST_TEST(nq("<link name=\"world\">" + mass + "</link>" + floating) == 7 + 7 + 1);
  BOOST_TEST(nq(world + floating + ball + joint("fix", "fixed", "world", "ball")) == 7 + 7 + 1);
  BOOST_TEST(nq(world + floating + ball + joint("throw", "floating", "world", "ball")) ==
             7 + 7 + 1 + 7);
  // A massless root link with another joint.
  BOOST_TEST(nq(world + joint("fix", "fixed", "world", "trunk")) == 7 + 1);
  BOOST_TEST(nq(world + joint("rail", "continuous", "world", "trunk")) == 7 + 2 + 1);
}

BOOST_AUTO_TEST_CASE(gravity_of_the_settings_is_that_of_the_model) {
  auto settings = settingsOf(kUrdf);
  settings.gravity << 0., 0., -1.625;
  DynaCoM dynacom(settings);
  compute(dynacom, restState(dynacom.getModel()));
  BOOST_TEST(close(dynacom.getGroundCoMForce(), Vector3d(0., 0., 1.625 * 15.)));
  settings.gravity.x() = 0.25;
  BOOST_TEST(
      throws<std::invalid_argument>([&] { dynacom.initialize(settings); }, {"gravity", "0.25"}));
  BOOST_TEST(close(dynacom.getSettings().gravity, Vector3d(0., 0., -1.625), 0.));
}

BOOST_AUTO_TEST_CASE(a_urdf_that_cannot_be_read_is_refused_in_silence) {
  const TemporaryDirectory directory;
  const std::string missing = directory.path() + "/missing.urdf";
  const std::string noXml = directory.write("no xml.urdf", "This is a shopping list.");
  const std::string binary = directory.write("binary.urdf", std::string("\x7f"
                                                                        "ELF\0\x01\x02<",
                                                                        8));
  const std::string truncated = directory.write("truncated.urdf", kUrdf.substr(0, 400));
  const std::string empty = directory.write("empty.urdf", "");
  const std::string blank = directory.write("blank.urdf", " \n\n");
  const std::string ghost = "<robot name=\"ghost\"><link name=\"sheet\"/></robot>";
  const std::string massless = directory.write("massless.urdf", ghost);
  const auto withMass = [](const std::string& mass) {
    return "<robot name=\"odd\"><link name=\"a\"><inertial><mass value=\"" + mass +
           "\"/><inertia ixx=\"1\" ixy=\"0\" ixz=\"0\" iyy=\"1\" iyz=\"0\" izz=\"1\"/></inertial>"
           "</link></robot>";
  };

  Biped biped(70);
  DynaCoM& dynacom = biped.dynacom;
  const State x = restState(biped.model);
  dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
  const View before = everythingSeen(dynacom);
  DynaCoM blankSlate;
  const auto refused = [&](const std::string& urdf, std::initializer_list<std::string> words) {
    boost::test_tools::predicate_result result(false), first(false), constructed(false);
    const std::string printed = printedBy([&] {
      result = throws<std::invalid_argument>([&] { dynacom.initialize(settingsOf(urdf)); }, words);
      first =
          throws<std::invalid_argument>([&] { blankSlate.initialize(settingsOf(urdf)); }, words);
      constructed = throws<std::invalid_argument>([&] { DynaCoM(settingsOf(urdf)); }, words);
    });
    BOOST_TEST_CONTEXT("URDF: " << urdf) {
      BOOST_TEST(result);
      BOOST_TEST(first);
      BOOST_TEST(constructed);
      BOOST_TEST(printed == "");
      BOOST_TEST(!blankSlate.isInitialized());
      BOOST_TEST(same(everythingSeen(dynacom), before));
      // The robot that was there still works.
      dynacom.computeNL(3., x.q, x.v, x.a, Vector6::Zero(), false);
      BOOST_TEST(same(everythingSeen(dynacom), before));
    }
  };
  refused("", {"urdf"});
  refused(missing, {"urdf", missing});
  refused("no_such_robot", {"urdf", "no_such_robot"});
  refused("no such robot.urdf", {"urdf", "no such robot.urdf"});
  refused(directory.path(), {"urdf", directory.path(), "directory"});
  refused(directory.path() + "/", {"urdf", directory.path(), "directory"});
  refused(noXml, {"urdf", noXml});
  refused(binary, {"urdf", binary});
  refused(truncated, {"urdf", truncated});
  refused(empty, {"urdf", empty});
  refused(blank, {"urdf", blank});
  refused(massless, {"mass", "ghost"});
  refused(ghost, {"mass", "ghost"});
  refused(" ", {"urdf"});
  refused("This is a shopping list.", {"urdf"});
  refused(kUrdf.substr(0, 400), {"urdf"});
  refused("<robot", {"urdf"});
  refused("<html><body>Not found</body></html>", {"urdf"});
  refused("<robot name=\"nothing\"></robot>", {"urdf"});
  // Masses that are none.
  refused(withMass("0"), {"mass"});
  refused(withMass("-1"), {"mass"});
  refused(withMass("nan"), {});
  refused(withMass("inf"), {});
  refused(withMass("heavy"), {"urdf"});
  // A joint that leads nowhere, and a link that nobody holds.
  refused(
      "<robot name=\"odd\"><link name=\"a\"/><joint name=\"j\" type=\"fixed\">"
      "<parent link=\"a\"/><child link=\"b\"/></joint></robot>",
      {"urdf"});
  refused("<robot name=\"odd\"><link name=\"a\"/><link name=\"b\"/></robot>", {"urdf"});

  // Neither has been spoilt for another robot.
  for (DynaCoM* one : {&dynacom, &blankSlate}) {
    one->initialize(settingsOf(kUrdf));
    one->addContact(makeSole("sole"), "sole");
    compute(*one, restState(one->getModel()), Vector6::Zero(), false);
    BOOST_TEST(one->getDistributionStatus() == DistributionStatus::Solved);
  }
}
