// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

// What crosses between the library and its lanes: the per-frame mathematics of analyzeMotion(), in
// its two steps, for several frames at once, one in each lane of a SIMD register. lanes.cpp and
// lane_newton.cpp are compiled once for each width that registers may have, each time with flags of
// their own, into a shared object of its own: hence plain arrays, and nothing of Eigen, Pinocchio
// or the standard library.
//
// Placements are twelve numbers: the rotation, column by column, and the translation.

namespace dynacom::lanes {

enum class JointKind : int {
  Revolute,           // about z
  UnboundedRevolute,  // the same, by cosine and sine
  Prismatic,          // along z
  FreeFlyer,
  Spherical,
  Translation,
  Planar,
};

/// A joint with its body.
struct Joint {
  JointKind kind;
  int parent;            // index of another joint before it, −1 for the world
  int q, v;              // its first components in configuration and velocity
  double placement[12];  // in the parent joint's frame
  bool massless;         // without inertia, too
  double mass;
  double com[3];      // in the joint's frame
  double inertia[6];  // about the CoM, in the joint's axes: xx, xy, yy, xz, yz, zz
};

/// A contact as a body: where it is fixed, and what of it may touch the ground.
struct Fixture {
  int parent;            // joint
  double placement[12];  // of its frame in the parent joint's
  bool world_aligned;
  double radius;                   // of a sphere
  double half_length, half_width;  // of a rectangle
};

struct Robot {
  int nq, nv, joints, contacts;
  const Joint* joint;
  const Fixture* contact;
  double gravity[3];
};

/// Where it goes how a contact lies and moves; see ContactMotion.
struct PlaceRows {
  double *position, *height, *velocity;
  double* rotation;  // null where it is not to be written
};

/// Where a motion's frames are, one behind the other, and where it goes what they are; see
/// MotionAnalysis.
struct Sweep {
  std::ptrdiff_t count;
  const double *q, *v;
  const double* a;  // null where nothing but places is asked for: then all of the next is
  double *com, *vcom, *acom, *am, *dam, *force, *torque;
  const PlaceRows* contacts;
  bool* known;  // false where numbers are not finite, quaternions not of norm 1, or angles huge:
                // what was written there is nothing
};

/// A contact as a force, whose components are limited by |λᵢ| ≤ βᵢ λ_z; or the first two together,
/// where they have the same weight, by ‖(λ_x, λ_y)‖ ≤ β λ_z.
struct Contact {
  int size;           // 3 or 6 components
  bool is_disc;       // whether they are
  double betas[6];    // the third is not used; of a disc, the first two are the same
  double weights[6];  // of the cost
};

/// What shares a wrench.
struct Carrier {
  int contacts;
  const Contact* contact;
  double mass;
  double gravity[3];
  double wrench_weights[6];
  double minimal_scale;  // see WrenchDistribution::solve()
  double ground_height, minimal_vertical_force;
  bool flat_horizontal_ground;
};

/// When a contact is active, where its surface is, and where results go; see
/// MotionAnalysis::Contact. These are written where it is active and there is an answer.
struct ContactRows {
  const bool* active;
  const double* readiness;  // see ContactSchedule; null for 1
  const double* position;
  const double* rotation;  // null for the world's axes
  double *wrench, *vertical_force, *cop, *friction_usage, *yaw_usage, *cop_margin;
};

/// What is known of a frame.
enum class Answer : char {
  None,    // there is none, whatever was written
  Solved,  // see DistributionStatus
  Relaxed,
};

/// Wrenches about CoMs, one behind the other, and where it goes how contacts share them; see
/// MotionAnalysis.
struct Distributions {
  std::ptrdiff_t count;
  const double *com, *force, *torque;
  double* cop;
  double *feasible_acom, *feasible_dam, *residual;
  const ContactRows* contacts;
  Answer* answers;
};

/// What each shared object gives by the function "dynacom_lanes".
struct Interface {
  int version;  // of what stands here
  int lanes;
  /// Makes what the next takes; the robot is copied. Null where there is no memory.
  void* (*create_sweeper)(const Robot* robot);
  void (*sweep)(void* sweeper, const Sweep* sweep);
  void (*destroy_sweeper)(void* sweeper);
  /// The same for a carrier.
  void* (*create_distributor)(const Carrier* carrier);
  void (*distribute)(void* distributor, const Distributions* distributions);
  void (*destroy_distributor)(void* distributor);
};

constexpr int kVersion = 6;  // grows with each change to this file
constexpr char kEntry[] = "dynacom_lanes";
using Entry = const Interface* (*)();

}  // namespace dynacom::lanes
