// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE dyna_com
#include <unistd.h>

#include <algorithm>
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
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

std::shared_ptr<Contact6D> makeSole(const std::string& frame, double mu = 0.7) {
  Contact6DSettings settings;
  settings.mu = mu;
  settings.gu = 0.1;
  settings.half_length = 0.1;
  settings.half_width = 0.06;
  settings.frame_name = frame;
  return std::make_shared<Contact6D>(settings);
}

std::shared_ptr<ContactPoint> makePoint(const std::string& frame, double mu = 0.7) {
  ContactPointSettings settings;
  settings.mu = mu;
  settings.frame_name = frame;
  return std::make_shared<ContactPoint>(settings);
}

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
  see("VRP", dynacom.getVRP().transpose());
  see("NL", dynacom.getNL().transpose());
  see("status", dynacom.getDistributionStatus());
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
  const Biped biped(5);
  const DynaCoM& dynacom = biped.dynacom;
  BOOST_TEST(allNaN(dynacom.getGroundCoMForce()));
  BOOST_TEST(allNaN(dynacom.getGroundCoMTorque()));
  BOOST_TEST(allNaN(dynacom.getCoM()));
  BOOST_TEST(allNaN(dynacom.getVCoM()));
  BOOST_TEST(allNaN(dynacom.getACoM()));
  BOOST_TEST(allNaN(dynacom.getAM()));
  BOOST_TEST(allNaN(dynacom.getAMVariation()));
  BOOST_TEST(allNaN(dynacom.getCoP()));
  BOOST_TEST(allNaN(dynacom.getVRP()));
  BOOST_TEST(allNaN(dynacom.getNL()));
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::NoContact);
  BOOST_TEST(close(dynacom.getMass(), totalMass(biped.model)));
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
  int solved = 0, different = 0;
  for (int trial = 0; trial < 100; ++trial) {
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
    if (dynacom.getDistributionStatus() != DistributionStatus::Solved) {
      BOOST_TEST(allNaN(dynacom.getCoP()));
      continue;
    }
    ++solved;
    // A contact without load has no centre of pressure; the next test is about those.
    if (std::any_of(contacts.begin(), contacts.end(),
                    [](const auto& contact) { return contact->appliedForce().z() < 1e-3; }))
      continue;
    const Vector2d uneven = dynacom.getCoP();
    BOOST_TEST(close(uneven, meanPressure(contacts), 1e-10));
    compute(dynacom, x, external, true);
    if ((uneven - dynacom.getCoP()).norm() > 1e-3) ++different;
  }
  BOOST_TEST(solved > 50);
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
  Biped biped(14);
  const State x = biped.moving();
  for (const bool flat : {true, false}) {
    for (const double fz : {0.9, 0., -100.}) {
      Vector6 wanted = Vector6::Zero();
      wanted.z() = fz;
      compute(biped.dynacom, x, externalFor(biped.dynacom, x, wanted), flat);
      BOOST_TEST(allNaN(biped.dynacom.getCoP()));
    }
  }
}

BOOST_AUTO_TEST_CASE(on_uneven_ground_pressure_needs_a_distribution) {
  Biped biped(15);
  const State x = biped.moving();
  // Out of reach: no soles lie that far out.
  Vector6 wanted = Vector6::Zero();
  wanted.z() = 500.;
  wanted[3] = 500.;
  const Vector6 external = externalFor(biped.dynacom, x, wanted);
  compute(biped.dynacom, x, external, false);
  BOOST_TEST(biped.dynacom.getDistributionStatus() == DistributionStatus::Infeasible);
  BOOST_TEST(allNaN(biped.dynacom.getCoP()));
  BOOST_TEST(close(biped.dynacom.allForces(), VectorXd::Zero(12), 0.));
  compute(biped.dynacom, x, external, true);
  BOOST_TEST(biped.dynacom.getCoP().allFinite());

  biped.dynacom.deactivateContact("left");
  biped.dynacom.deactivateContact("right");
  compute(biped.dynacom, x, Vector6::Zero(), false);
  BOOST_TEST(biped.dynacom.getDistributionStatus() == DistributionStatus::NoContact);
  BOOST_TEST(allNaN(biped.dynacom.getCoP()));
  compute(biped.dynacom, x, Vector6::Zero(), true);
  BOOST_TEST(biped.dynacom.getCoP().allFinite());
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

BOOST_AUTO_TEST_CASE(out_of_reach_all_forces_are_zero) {
  Biped biped(21);
  compute(biped.dynacom, restState(biped.model));
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
  BOOST_TEST(biped.left->appliedForce().norm() > 1.);

  Vector6 wrench = groundWrench(biped.dynacom);
  wrench.z() *= -1.;
  const auto status = distribute(biped.dynacom, wrench, biped.dynacom.getCoM());
  BOOST_TEST(status == DistributionStatus::Infeasible);
  BOOST_TEST(biped.dynacom.getDistributionStatus() == DistributionStatus::Infeasible);
  BOOST_TEST(close(biped.dynacom.ne_b(), wrench, 0.));
  BOOST_TEST(close(biped.left->appliedForce(), Vector6::Zero(), 0.));
  BOOST_TEST(close(biped.right->appliedForce(), Vector6::Zero(), 0.));
}

BOOST_AUTO_TEST_CASE(numbers_that_are_not_finite_are_a_status_not_an_exception) {
  Biped biped(22);
  State x = restState(biped.model);
  x.a[0] = kNaN;
  compute(biped.dynacom, x, Vector6::Zero(), false);
  BOOST_TEST(biped.dynacom.getDistributionStatus() == DistributionStatus::NumericalFailure);
  BOOST_TEST(allNaN(biped.dynacom.getCoP()));
  BOOST_TEST(close(biped.dynacom.allForces(), VectorXd::Zero(12), 0.));

  x = restState(biped.model);
  x.q[0] = kNaN;
  compute(biped.dynacom, x);
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::NumericalFailure);
  BOOST_TEST(close(biped.dynacom.allForces(), VectorXd::Zero(12), 0.));

  // Sensors recover, and so does it.
  compute(biped.dynacom, restState(biped.model));
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
  BOOST_TEST(biped.dynacom.getCoP().allFinite());
}

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
  BOOST_TEST(distribute(biped.dynacom, wrench, com) == DistributionStatus::Infeasible);
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
    BOOST_REQUIRE((status == DistributionStatus::Solved) ==
                  (freshStatus == DistributionStatus::Solved));
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
  for (const auto& [omega, text] :
       {std::pair<double, const char*>(0., "0"), {-0.25, "-0.25"}, {kNaN, "nan"}}) {
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
  for (const auto& action : {std::function<void()>([&] { dynacom.removeContact("left"); }),
                             std::function<void()>([&] { dynacom.activateContact("left"); }),
                             std::function<void()>([&] { dynacom.deactivateContact("left"); }),
                             std::function<void()>([&] { dynacom.getContact("left"); })})
    BOOST_CHECK_THROW(action(), std::logic_error);
  BOOST_TEST(dynacom.getKnownContacts().empty());
  BOOST_TEST(dynacom.getActiveContacts().empty());
  BOOST_TEST(dynacom.getDistributionStatus() == DistributionStatus::NoContact);

  const auto model = singleBody(50., stance(2));
  dynacom.initialize(model);
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
  BOOST_TEST(throws<std::invalid_argument>([] { DynaCoM dynacom(singleBody(0., {})); }, {"mass"}));
}

BOOST_AUTO_TEST_CASE(initialize_takes_another_robot_and_forgets_the_contacts) {
  Biped biped(60);
  const State x = biped.moving();
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
  BOOST_TEST(allNaN(biped.dynacom.getCoM()));
  BOOST_TEST(allNaN(biped.dynacom.getCoP()));
  BOOST_TEST(allNaN(biped.dynacom.getNL()));
  BOOST_TEST(close(biped.dynacom.getMass(), totalMass(other)));

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

BOOST_AUTO_TEST_CASE(a_text_may_begin_with_white_space) {
  const DynaCoM dynacom(settingsOf("\n  \t" + kUrdf.substr(kUrdf.find("<robot"))));
  BOOST_TEST(close(dynacom.getMass(), 15.));
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
  const std::string truncated = directory.write("truncated.urdf", kUrdf.substr(0, 400));
  const std::string empty = directory.write("empty.urdf", "");
  const std::string massless =
      directory.write("massless.urdf", "<robot name=\"ghost\"><link name=\"sheet\"/></robot>");

  Biped biped(70);
  compute(biped.dynacom, restState(biped.model));
  const View before = everythingSeen(biped.dynacom);
  const auto refused = [&](const std::string& urdf, std::initializer_list<std::string> words) {
    boost::test_tools::predicate_result result(false);
    const std::string printed = printedBy([&] {
      result =
          throws<std::invalid_argument>([&] { biped.dynacom.initialize(settingsOf(urdf)); }, words);
    });
    BOOST_TEST_CONTEXT("URDF: " << urdf) {
      BOOST_TEST(result);
      BOOST_TEST(printed == "");
      BOOST_TEST(same(everythingSeen(biped.dynacom), before));
    }
  };
  refused("", {"urdf"});
  refused(missing, {"urdf", missing});
  refused(directory.path(), {"urdf", directory.path(), "directory"});
  refused(noXml, {"urdf", noXml});
  refused(truncated, {"urdf", truncated});
  refused(empty, {"urdf", empty});
  refused(massless, {"mass"});
  refused("This is a shopping list.", {"urdf"});
  refused(kUrdf.substr(0, 400), {"urdf"});
  refused("<robot", {"urdf"});
  refused("<html><body>Not found</body></html>", {"urdf"});
  refused("<robot name=\"nothing\"></robot>", {"urdf"});
  // A joint that leads nowhere, and a link that nobody holds.
  refused(
      "<robot name=\"odd\"><link name=\"a\"/><joint name=\"j\" type=\"fixed\">"
      "<parent link=\"a\"/><child link=\"b\"/></joint></robot>",
      {"urdf"});
  refused("<robot name=\"odd\"><link name=\"a\"/><link name=\"b\"/></robot>", {"urdf"});

  // The robot that was there still works.
  BOOST_TEST(distribute(biped.dynacom) == DistributionStatus::Solved);
}
