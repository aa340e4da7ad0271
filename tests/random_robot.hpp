// SPDX-License-Identifier: BSD-2-Clause
// Robots made of random numbers, and Pinocchio's algorithms on them, compiled once for all tests.
#pragma once

#include <pinocchio/multibody.hpp>
#include <string>
#include <vector>

#include "test_tools.hpp"

namespace dynacom_tests {

/// A free-flyer that carries random bodies on joints of every kind.
pinocchio::Model randomTree(Random& random, int joints = 10);

/// Pinocchio's own random robot: a free-flyer with two legs, a trunk and two arms. Its numbers come
/// from std::rand(), which is seeded here.
pinocchio::Model randomHumanoid(unsigned seed);

/// A random tree that stands: below its CoM, in its neutral configuration, are the frames sole0,
/// sole1, ... on bodies that differ, at the places given relative to the CoM's projection on the
/// world's plane z = 0.
pinocchio::Model standingRobot(Random& random, const std::vector<SE3>& soles);

/// Where an animal's n feet stand: around the origin, alternating left and right, and horizontal.
std::vector<SE3> stance(int n);

/// A single free-flying body of a mass, its CoM at its origin, with the frames sole0, sole1, ...
pinocchio::Model singleBody(double mass, const std::vector<SE3>& soles);

/// A configuration with its velocity and its acceleration.
struct State {
  VectorXd q, v, a;
};

/// Far from the neutral configuration by about scale, in every joint; v and a are of that size too.
State randomState(const pinocchio::Model& model, Random& random, double scale = 1.);

/// Many of them, a column each: (nq, frames), (nv, frames).
struct States {
  MatrixXd q, v, a;
};

/// As randomState(), one after the other.
States randomStates(const pinocchio::Model& model, Random& random, Index frames, double scale = 1.);

/// The neutral configuration, not in motion.
State restState(const pinocchio::Model& model);

/// Of Pinocchio, each with Data of its own.
Vector3d comOf(const pinocchio::Model& model, const VectorXd& q);
SE3 framePlacement(const pinocchio::Model& model, const VectorXd& q, const std::string& frame);
double totalMass(const pinocchio::Model& model);
/// The force on the free-flyer, by rnea(), taken to the CoM and the world's axes.
Vector6 rootWrench(const pinocchio::Model& model, const State& state);
/// The same with external forces, each in its joint's frame.
Vector6 rootWrench(const pinocchio::Model& model, const State& state,
                   const std::vector<pinocchio::Force>& external);
/// Linear and angular momentum about the CoM, the sum over all bodies.
Vector6 momentum(const pinocchio::Model& model, const VectorXd& q, const VectorXd& v);
/// q ⊕ v
VectorXd moved(const pinocchio::Model& model, const VectorXd& q, const VectorXd& v);

/// Pinocchio's forwardKinematics() and framesForwardKinematics().
void runForwardKinematics(const pinocchio::Model& model, pinocchio::Data& data, const VectorXd& q);
void runFramesForwardKinematics(const pinocchio::Model& model, pinocchio::Data& data,
                                const VectorXd& q);

/// And computeCentroidalMomentumTimeVariation().
void runCentroidalDynamics(const pinocchio::Model& model, pinocchio::Data& data,
                           const State& state);

}  // namespace dynacom_tests
