// SPDX-License-Identifier: BSD-2-Clause
#define BOOST_TEST_MODULE centroidal
#include <limits>

#include "dynacom/centroidal.hpp"
#include "random_robot.hpp"

using namespace dynacom;
using namespace dynacom_tests;

namespace {

const double kNaN = std::numeric_limits<double>::quiet_NaN();

/// Trees with joints of every kind, and Pinocchio's humanoids.
std::vector<pinocchio::Model> randomRobots(Random& random, unsigned count) {
  std::vector<pinocchio::Model> robots;
  for (unsigned i = 0; i < count; ++i) {
    robots.push_back(randomTree(random));
    robots.push_back(randomHumanoid(i));
  }
  return robots;
}

CentroidalState stateOf(const pinocchio::Model& model, const State& x) {
  pinocchio::Data data(model);
  return computeCentroidalState(model, data, x.q, x.v, x.a);
}

Vector6 stacked(const CentroidalWrench& wrench) {
  return (Vector6() << wrench.force, wrench.torque).finished();
}

CentroidalState someState() {
  CentroidalState state;
  state.mass = 10.;
  state.com << 1., 2., 0.8;
  state.vcom << 0.1, 0.2, 0.3;
  state.acom << 0.5, -1., 2.;
  state.am << 3., 4., 5.;
  state.amVariation << 6., 7., 8.;
  return state;
}

}  // namespace

BOOST_AUTO_TEST_CASE(state_is_mass_com_and_momentum_of_all_bodies) {
  Random random(1);
  for (const auto& model : randomRobots(random, 10)) {
    const State x = randomState(model, random);
    const CentroidalState state = stateOf(model, x);
    const Vector6 momentum = dynacom_tests::momentum(model, x.q, x.v);
    BOOST_TEST(close(state.mass, totalMass(model)));
    BOOST_TEST(close(state.com, comOf(model, x.q)));
    BOOST_TEST(close(state.mass * state.vcom, momentum.head<3>()));
    BOOST_TEST(close(state.am, momentum.tail<3>()));
  }
}

BOOST_AUTO_TEST_CASE(rates_are_the_derivatives_of_the_momentum) {
  // Central differences of the sum over bodies, along q ⊕ (v t + ½ a t²), v + a t.
  Random random(2);
  const double dt = 1e-5;
  for (const auto& model : randomRobots(random, 5)) {
    const State x = randomState(model, random, 0.5);
    const CentroidalState state = stateOf(model, x);
    const auto momentumAt = [&](double t) {
      // The velocity at t, to first order, and the configuration, to second.
      const VectorXd q = moved(model, x.q, t * x.v + 0.5 * t * t * x.a);
      return dynacom_tests::momentum(model, q, x.v + t * x.a);
    };
    const Vector6 rate = (momentumAt(dt) - momentumAt(-dt)) / (2. * dt);
    BOOST_TEST(close(state.mass * state.acom, rate.head<3>(), 1e-6));
    BOOST_TEST(close(state.amVariation, rate.tail<3>(), 1e-6));
  }
}

BOOST_AUTO_TEST_CASE(state_may_be_read_from_data_where_pinocchio_has_run) {
  Random random(3);
  const auto model = randomTree(random);
  const State x = randomState(model, random);
  pinocchio::Data data(model);
  const CentroidalState computed = computeCentroidalState(model, data, x.q, x.v, x.a);
  const CentroidalState read = readCentroidalState(data);
  BOOST_TEST(read.mass == computed.mass);
  BOOST_TEST(close(read.com, computed.com, 0.));
  BOOST_TEST(close(read.vcom, computed.vcom, 0.));
  BOOST_TEST(close(read.acom, computed.acom, 0.));
  BOOST_TEST(close(read.am, computed.am, 0.));
  BOOST_TEST(close(read.amVariation, computed.amVariation, 0.));
}

BOOST_AUTO_TEST_CASE(kinematics_are_left_in_data) {
  Random random(4);
  const auto model = randomTree(random);
  const State x = randomState(model, random);
  pinocchio::Data data(model), expected(model);
  computeCentroidalState(model, data, x.q, x.v, x.a);
  runForwardKinematics(model, expected, x.q);
  for (std::size_t joint = 1; joint < static_cast<std::size_t>(model.njoints); ++joint)
    BOOST_TEST(
        close(data.oMi[joint].toHomogeneousMatrix(), expected.oMi[joint].toHomogeneousMatrix()));
}

BOOST_AUTO_TEST_CASE(vectors_of_the_wrong_size_are_refused) {
  Random random(5);
  const auto model = randomTree(random);
  pinocchio::Data data(model);
  const State good = randomState(model, random);
  const auto refused = [&](const State& bad, const std::string& name, Index expected, Index got) {
    BOOST_TEST(throws<std::invalid_argument>(
        [&] { computeCentroidalState(model, data, bad.q, bad.v, bad.a); },
        {name, std::to_string(expected), std::to_string(got)}));
  };
  State bad = good;
  bad.q.conservativeResize(model.nq - 1);
  refused(bad, "q", model.nq, model.nq - 1);
  bad = good;
  bad.v.conservativeResize(model.nv + 1);
  refused(bad, "v", model.nv, model.nv + 1);
  bad = good;
  bad.a.resize(0);
  refused(bad, "a", model.nv, 0);
}

BOOST_AUTO_TEST_CASE(ground_wrench_is_that_of_recursive_newton_euler) {
  // The force that RNEA wants at the free-flyer is what the ground must give. Newton and Euler say
  // so for every robot, motion and gravity.
  Random random(6);
  for (auto model : randomRobots(random, 20)) {
    for (const double g : {-9.81, 0., -1.62, -100.}) {
      model.gravity.linear() << 0., 0., g;
      const State x = randomState(model, random);
      const auto wrench =
          computeGroundWrench(stateOf(model, x), model.gravity.linear(), Vector6::Zero());
      BOOST_TEST(close(stacked(wrench), rootWrench(model, x), 1e-12));
    }
  }
}

BOOST_AUTO_TEST_CASE(external_wrench_is_taken_off_what_the_ground_must_give) {
  // Forces on random bodies, given to RNEA in the joints' frames, and here as one wrench about the
  // CoM in the world's axes.
  Random random(7);
  for (const auto& model : randomRobots(random, 20)) {
    const State x = randomState(model, random);
    pinocchio::Data data(model);
    runForwardKinematics(model, data, x.q);
    std::vector<pinocchio::Force> external(1, pinocchio::Force::Zero());
    pinocchio::Force sum = pinocchio::Force::Zero();
    for (std::size_t joint = 1; joint < static_cast<std::size_t>(model.njoints); ++joint) {
      external.emplace_back(Vector6(random.vector(6, 50.)));
      sum += data.oMi[joint].act(external.back());
    }
    const SE3 cMo(Matrix3d::Identity(), -comOf(model, x.q));
    const auto wrench =
        computeGroundWrench(stateOf(model, x), model.gravity.linear(), cMo.act(sum).toVector());
    BOOST_TEST(close(stacked(wrench), rootWrench(model, x, external), 1e-12));
  }
}

BOOST_AUTO_TEST_CASE(ground_wrench_by_hand) {
  const CentroidalState state = someState();
  Vector6 external;
  external << 1., 2., 3., 4., 5., 6.;
  const auto wrench = computeGroundWrench(state, Vector3d(0., 0., -10.), external);
  BOOST_TEST(close(wrench.force, Vector3d(10. * 0.5 - 1., 10. * -1. - 2., 10. * 12. - 3.)));
  BOOST_TEST(close(wrench.torque, Vector3d(2., 2., 2.)));

  // Without an external wrench.
  const auto free = computeGroundWrench(state, Vector3d(0., 0., -10.));
  BOOST_TEST(close(free.force, Vector3d(5., -10., 120.)));
  BOOST_TEST(close(free.torque, Vector3d(6., 7., 8.)));
}

BOOST_AUTO_TEST_CASE(accelerations_that_a_ground_wrench_causes_by_hand) {
  // c̈ = (f + f_e)/m + g, L̇ = τ + τ_e
  const CentroidalState state = someState();
  const CentroidalWrench wrench{Vector3d(20., -30., 80.), Vector3d(1., 2., 3.)};
  const Vector3d gravity(0.5, 0., -10.);
  Vector6 external;
  external << 10., 20., 30., 4., 5., 6.;
  const CentroidalState caused = applyGroundWrench(state, wrench, gravity, external);
  BOOST_TEST(close(caused.acom, Vector3d(3.5, -1., 1.)));
  BOOST_TEST(close(caused.amVariation, Vector3d(5., 7., 9.)));

  // Without an external wrench.
  const CentroidalState free = applyGroundWrench(state, wrench, gravity);
  BOOST_TEST(close(free.acom, Vector3d(2.5, -3., -2.)));
  BOOST_TEST(close(free.amVariation, Vector3d(1., 2., 3.)));

  // All else is the state's.
  for (const CentroidalState& same : {caused, free}) {
    BOOST_TEST(same.mass == state.mass);
    BOOST_TEST(close(same.com, state.com, 0.));
    BOOST_TEST(close(same.vcom, state.vcom, 0.));
    BOOST_TEST(close(same.am, state.am, 0.));
  }
}

BOOST_AUTO_TEST_CASE(the_ground_wrench_of_a_motion_causes_that_motion) {
  Random random(10);
  for (const auto& model : randomRobots(random, 10)) {
    const CentroidalState state = stateOf(model, randomState(model, random));
    const Vector3d gravity = random.vector3(10.);
    const Vector6 external = random.vector(6, 100.);
    const auto wrench = computeGroundWrench(state, gravity, external);
    const CentroidalState caused = applyGroundWrench(state, wrench, gravity, external);
    BOOST_TEST(close(caused.acom, state.acom, 1e-12));
    BOOST_TEST(close(caused.amVariation, state.amVariation, 1e-12));
    // A push of 1 N more accelerates by 1/m, and no ground at all leaves free fall.
    CentroidalWrench more = wrench;
    more.force.x() += 1.;
    BOOST_TEST(close(applyGroundWrench(state, more, gravity, external).acom - caused.acom,
                     Vector3d(1. / totalMass(model), 0., 0.), 1e-12));
    const CentroidalWrench none{Vector3d::Zero(), Vector3d::Zero()};
    BOOST_TEST(close(applyGroundWrench(state, none, gravity).acom, gravity, 0.));
    BOOST_TEST(close(applyGroundWrench(state, none, gravity).amVariation, Vector3d::Zero(), 0.));
  }
}

BOOST_AUTO_TEST_CASE(at_rest_the_ground_carries_the_weight_below_the_com) {
  Random random(8);
  for (const auto& model : randomRobots(random, 5)) {
    State x = randomState(model, random);
    x.v.setZero();
    x.a.setZero();
    const CentroidalState state = stateOf(model, x);
    const auto wrench = computeGroundWrench(state, Vector3d(0., 0., -9.81), Vector6::Zero());
    BOOST_TEST(close(wrench.force, Vector3d(0., 0., 9.81 * totalMass(model))));
    BOOST_TEST(close(wrench.torque, Vector3d::Zero(), 1e-10));
    BOOST_TEST(close(computeFlatGroundCoP(wrench, state.com), state.com.head<2>()));
  }
}

BOOST_AUTO_TEST_CASE(centre_of_pressure_by_hand) {
  // p = c + (S τ − f (c_z − h)) / f_z with S τ = (−τ_y, τ_x)
  const CentroidalWrench wrench{Vector3d(10., -20., 100.), Vector3d(5., 7., 9.)};
  const Vector3d com(1., 2., 0.8);
  BOOST_TEST(close(computeFlatGroundCoP(wrench, com),
                   Vector2d(1. + (-7. - 10. * 0.8) / 100., 2. + (5. + 20. * 0.8) / 100.)));
  BOOST_TEST(close(computeFlatGroundCoP(wrench, com, 0.3),
                   Vector2d(1. + (-7. - 10. * 0.5) / 100., 2. + (5. + 20. * 0.5) / 100.)));
}

BOOST_AUTO_TEST_CASE(about_the_centre_of_pressure_no_horizontal_moment_is_left) {
  Random random(9);
  for (int trial = 0; trial < 100; ++trial) {
    CentroidalWrench wrench{random.vector3(100.), random.vector3(100.)};
    wrench.force.z() = random.uniform(50., 500.);
    const Vector3d com = random.vector3();
    const double height = random.uniform(-1., 1.);
    Vector3d cop;
    cop << computeFlatGroundCoP(wrench, com, height), height;
    const Vector3d moment = wrench.torque + (com - cop).cross(wrench.force);
    BOOST_TEST(close(moment.head<2>(), Vector2d::Zero(), 1e-10));
  }
}

BOOST_AUTO_TEST_CASE(without_vertical_force_there_is_no_centre_of_pressure) {
  BOOST_TEST(kMinimalVerticalForce == 1.);
  CentroidalWrench wrench{Vector3d::Ones(), Vector3d::Ones()};
  for (const double fz : {0.999, 0., -0.5, -1000., kNaN}) {
    wrench.force.z() = fz;
    BOOST_TEST(allNaN(computeFlatGroundCoP(wrench, Vector3d::Ones())));
  }
  for (const double fz : {1., 1.001}) {
    wrench.force.z() = fz;
    BOOST_TEST(computeFlatGroundCoP(wrench, Vector3d::Ones()).allFinite());
  }
}

BOOST_AUTO_TEST_CASE(the_least_vertical_force_is_up_to_the_caller) {
  const Vector3d com(1., 2., 0.8);
  for (const double least : {1e-6, 0.5, 1., 50., 1e6}) {
    CentroidalWrench wrench{Vector3d(0.1, 0.2, 0.), Vector3d(0.3, 0.4, 0.5)};
    for (const double fz : {0.999 * least, 0., -2. * least, kNaN}) {
      wrench.force.z() = fz;
      BOOST_TEST(allNaN(computeFlatGroundCoP(wrench, com, 0.3, least)));
    }
    for (const double fz : {least, 2. * least}) {
      wrench.force.z() = fz;
      BOOST_TEST(close(computeFlatGroundCoP(wrench, com, 0.3, least),
                       Vector2d(1. + (-0.4 - 0.1 * 0.5) / fz, 2. + (0.3 - 0.2 * 0.5) / fz)));
    }
  }
}

BOOST_AUTO_TEST_CASE(a_centre_of_pressure_beyond_the_largest_numbers_is_none) {
  CentroidalWrench wrench{Vector3d(0., 0., 1e-300), Vector3d(0., 1e10, 0.)};
  BOOST_TEST(allNaN(computeFlatGroundCoP(wrench, Vector3d::Zero(), 0., 1e-305)));
  wrench.torque << 1e10, 0., 0.;
  BOOST_TEST(allNaN(computeFlatGroundCoP(wrench, Vector3d::Zero(), 0., 1e-305)));
  // What is not finite comes from sensors, too.
  wrench.force.z() = 100.;
  wrench.torque.x() = std::numeric_limits<double>::infinity();
  BOOST_TEST(allNaN(computeFlatGroundCoP(wrench, Vector3d::Zero())));
  wrench.torque.x() = kNaN;
  BOOST_TEST(allNaN(computeFlatGroundCoP(wrench, Vector3d::Zero())));
}

BOOST_AUTO_TEST_CASE(virtual_repellent_point_by_hand) {
  // v = c − c̈ / ω²
  BOOST_TEST(close(computeVRP(someState(), 2.), Vector2d(1. - 0.5 / 4., 2. + 1. / 4.)));
  BOOST_TEST(close(computeVRP(someState(), 0.5), Vector2d(1. - 0.5 * 4., 2. + 1. * 4.)));
}

BOOST_AUTO_TEST_CASE(repellent_points_in_three_dimensions_by_hand) {
  // v = c − c̈ / ω², e = c − (c̈ − g) / ω², which is g / ω² below.
  const Vector3d gravity(0., 0., -10.);
  BOOST_TEST(
      close(computeVRP3D(someState(), 2.), Vector3d(1. - 0.5 / 4., 2. + 1. / 4., 0.8 - 2. / 4.)));
  BOOST_TEST(close(computeECMP(someState(), gravity, 2.),
                   Vector3d(1. - 0.5 / 4., 2. + 1. / 4., 0.8 - 12. / 4.)));
}

BOOST_AUTO_TEST_CASE(repellent_points_say_what_forces_there_are) {
  Random random(11);
  for (const auto& model : randomRobots(random, 10)) {
    const Vector3d gravity = random.vector3(10.);
    const double omega = random.uniform(0.5, 5.), mass = totalMass(model);
    const CentroidalState state = stateOf(model, randomState(model, random));
    const Vector3d vrp = computeVRP3D(state, omega), ecmp = computeECMP(state, gravity, omega);
    BOOST_TEST(close(vrp.head<2>(), computeVRP(state, omega), 0.));
    BOOST_TEST(close(vrp, ecmp - gravity / (omega * omega)));
    // All forces, and those of the ground.
    const double stiffness = mass * omega * omega;
    const Vector3d total = mass * state.acom;
    BOOST_TEST(close(stiffness * (state.com - vrp), total, 1e-10));
    BOOST_TEST(
        close(stiffness * (state.com - ecmp), computeGroundWrench(state, gravity).force, 1e-10));
  }
}

BOOST_AUTO_TEST_CASE(repellent_points_beyond_the_largest_numbers_are_none) {
  CentroidalState far = someState();
  far.acom.z() = 1e300;
  BOOST_TEST(computeVRP(far, 1e-10).allFinite());
  BOOST_TEST(allNaN(computeVRP3D(far, 1e-10)));
  BOOST_TEST(allNaN(computeECMP(far, Vector3d::Zero(), 1e-10)));
}

BOOST_AUTO_TEST_CASE(divergent_component_of_motion_by_hand) {
  // ξ = c + ċ / ω, of which the derivative is ω (ξ − v).
  const CentroidalState state = someState();
  const Vector2d c = state.com.head<2>(), velocity = state.vcom.head<2>();
  BOOST_TEST(close(computeDCM(state, 2.), c + velocity / 2.));
  const Vector2d derivative = velocity + state.acom.head<2>() / 2.;
  BOOST_TEST(close(derivative, 2. * (computeDCM(state, 2.) - computeVRP(state, 2.))));
  CentroidalState far = state;
  far.vcom.setConstant(1e300);
  BOOST_TEST(allNaN(computeDCM(far, 1e-100)));
}

BOOST_AUTO_TEST_CASE(virtual_repellent_point_wants_a_positive_omega) {
  for (const auto& [omega, text] : {std::pair<double, const char*>(0., "0"),
                                    {-0.25, "-0.25"},
                                    {kNaN, "nan"},
                                    {std::numeric_limits<double>::infinity(), "inf"}}) {
    BOOST_TEST(throws<std::invalid_argument>([&, w = omega] { computeVRP(someState(), w); },
                                             {"omega", text}));
    BOOST_TEST(throws<std::invalid_argument>([&, w = omega] { computeDCM(someState(), w); },
                                             {"omega", text}));
    BOOST_TEST(throws<std::invalid_argument>([&, w = omega] { computeVRP3D(someState(), w); },
                                             {"omega", text}));
    BOOST_TEST(throws<std::invalid_argument>(
        [&, w = omega] { computeECMP(someState(), Vector3d::Zero(), w); }, {"omega", text}));
  }
}
