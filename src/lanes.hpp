// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <cstddef>

// What crosses between the library and its lanes: the per-frame mathematics of analyzeMotion() for
// several frames at once, one in each lane of a SIMD register. lanes.cpp is compiled once for each
// width that registers may have, each time with flags of its own, into a shared object of its own:
// hence plain arrays, and nothing of Eigen, Pinocchio or the standard library.
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

/// A contact whose forces are limited by |λᵢ| ≤ βᵢ λ_z.
struct Contact {
  int size;              // 3 or 6 components
  int parent;            // joint
  double placement[12];  // of its frame in the parent joint's
  bool world_aligned;
  double radius;
  double betas[6];    // the third is not used
  double weights[6];  // of the cost
};

struct Robot {
  int nq, nv, joints, contacts;
  const Joint* joint;
  const Contact* contact;
  double gravity[3];
  double wrench_weights[6];
  double ground_height, minimal_vertical_force;
  bool flat_horizontal_ground;
};

/// Which part of a frame's results is there.
enum class Outcome : unsigned char {
  Everything,  // no inequality is active
  Dynamics,    // all but distribution and contacts
  Nothing,     // numbers are not finite, quaternions not of norm 1, or angles huge
};

/// Where results of a contact go; see MotionAnalysis::Contact. Written where it is active and the
/// outcome is Everything.
struct ContactRows {
  const bool* active;
  const double* readiness;  // see ContactSchedule; null for 1
  double *wrench, *vertical_force, *cop, *friction_usage, *yaw_usage, *cop_margin;
};

/// Where frames are, one behind the other, and where results go; see MotionAnalysis. What the
/// outcome says is not there may have been written all the same.
struct Frames {
  std::ptrdiff_t count;
  const double *q, *v, *a;
  double *com, *vcom, *acom, *am, *dam, *force, *torque;
  double* cop;
  double *feasible_acom, *feasible_dam, *residual;
  const ContactRows* contacts;
  double* placements;  // of the contacts' frames in the world: 12 × contacts × frames
  Outcome* outcomes;
};

/// Where frames are, and where it goes how the contacts' frames lie and move in them.
struct Places {
  std::ptrdiff_t count;
  const double *q, *v;
  double* placements;  // in the world: 12 × contacts × frames
  double* velocities;  // linear, of the frame's origin, and angular, in the world: 6 × contacts ×
                       // frames
  Outcome* outcomes;   // Dynamics, or Nothing
};

/// What each shared object gives by the function "dynacom_lanes".
struct Interface {
  int version;  // of what stands here
  int lanes;
  /// Makes what the others take; the robot is copied. Null where there is no memory.
  void* (*create)(const Robot* robot);
  void (*run)(void* analysis, const Frames* frames);
  void (*place)(void* analysis, const Places* places);
  void (*destroy)(void* analysis);
};

constexpr int kVersion = 3;  // grows with each change to this file
constexpr char kEntry[] = "dynacom_lanes";
using Entry = const Interface* (*)();

}  // namespace dynacom::lanes
