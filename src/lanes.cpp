// SPDX-License-Identifier: BSD-2-Clause
#include "lanes.hpp"

#include <algorithm>
#include <new>
#include <vector>

#include "lane_math.hpp"
#include "lane_newton.hpp"

namespace dynacom::lanes {
namespace {

// By how much a quaternion's squared norm may differ from 1: more, and algorithms differ.
constexpr double kNormalized = 1e-12;
// From which angle on sine and cosine of stdx overflow [rad].
constexpr double kLargestAngle = 1e9;

// How a joint's frame moves, in the world's axes: velocity and acceleration are those of its origin
// as a point.
struct Moving {
  Matrix rotation;
  Vector position, angular_velocity, velocity, angular_acceleration, acceleration;
};

// ---- What a motion needs, and how its contacts lie and move ----

class Sweeper : Block {
 public:
  explicit Sweeper(const Robot& robot)
      : robot_(robot),
        joints_(robot.joint, robot.joint + robot.joints),
        contacts_(robot.contact, robot.contact + robot.contacts),
        carries_(joints_.size()),
        moving_(joints_.size()) {
    mass_ = 0.;
    for (const Joint& joint : joints_) mass_ += joint.mass;
    for (const Fixture& contact : contacts_)
      for (int joint = contact.parent; joint >= 0; joint = joints_[std::size_t(joint)].parent)
        carries_[std::size_t(joint)] = true;
  }

  void run(const Sweep& sweep) {
    for (std::ptrdiff_t first = 0; first < sweep.count; first += kLanes) {
      take(first, sweep.count);
      takeMotion(sweep);
      for (std::size_t k = 0; k < joints_.size(); ++k)
        if (sweep.a || carries_[k]) moving_[k] = move(joints_[k]);
      if (sweep.a) computeDynamics(sweep);
      for (std::size_t k = 0; k < contacts_.size(); ++k) place(contacts_[k], sweep.contacts[k]);
      store(sweep.known, normalized_ && nothing_ == 0.);
    }
  }

 private:
  void takeMotion(const Sweep& sweep) {
    for (int lane = 0; lane < kLanes; ++lane) {
      const std::ptrdiff_t frame = frameOf(lane);
      q_[lane] = sweep.q + frame * robot_.nq;
      v_[lane] = sweep.v + frame * robot_.nv;
      a_[lane] = (sweep.a ? sweep.a : sweep.v) + frame * robot_.nv;
    }
    nothing_ = 0.;
    normalized_ = Mask(true);
  }

  // The numbers of a component, which must be finite.
  Lanes load(const double* const* columns, int row) {
    const Lanes numbers([&](auto lane) { return columns[lane][row]; });
    nothing_ += 0. * numbers;
    return numbers;
  }
  Vector loadVector(const double* const* columns, int row) {
    const Lanes x = load(columns, row), y = load(columns, row + 1);
    return {x, y, load(columns, row + 2)};
  }
  void requireNormalized(const Lanes& squared_norm) {
    normalized_ = normalized_ && stdx::abs(squared_norm - 1.) <= kNormalized;
  }
  Matrix loadRotation(int row) {
    const Lanes x = load(q_, row), y = load(q_, row + 1), z = load(q_, row + 2),
                w = load(q_, row + 3);
    requireNormalized(x * x + y * y + z * z + w * w);
    return rotationOf(x, y, z, w);
  }

  Moving move(const Joint& joint);
  void addBody(const Joint& joint, const Moving& moving);
  void computeDynamics(const Sweep& sweep);
  void place(const Fixture& contact, const PlaceRows& rows) const;

  const Robot robot_;
  const std::vector<Joint> joints_;
  const std::vector<Fixture> contacts_;
  double mass_;
  std::vector<bool> carries_;   // which joints have contacts beyond them
  std::vector<Moving> moving_;  // by joint

  // Of the frames at hand.
  const double *q_[kLanes], *v_[kLanes], *a_[kLanes];
  Lanes nothing_;    // zero, if all numbers are finite
  Mask normalized_;  // all quaternions, and no angle is huge
  // Sums over the bodies, about the first joint: mass times place, velocity, acceleration; angular
  // momentum and its rate.
  Vector centre_, places_, momentum_, momentum_rate_, angular_momentum_, angular_momentum_rate_;
};

Moving Sweeper::move(const Joint& joint) {
  Moving at;  // the joint, before it moves
  Vector arm;
  const Vector offset = broadcast(joint.placement + 9);
  const Moving* parent = nullptr;
  if (joint.parent < 0) {
    at.rotation = broadcastMatrix(joint.placement);
    at.position = arm = offset;
    at.angular_velocity = at.velocity = at.angular_acceleration = at.acceleration = zero();
  } else {
    parent = &moving_[static_cast<std::size_t>(joint.parent)];
    at = *parent;
    at.rotation = parent->rotation * broadcastMatrix(joint.placement);
    arm = parent->rotation * offset;
    at.position += arm;
  }
  // What a point of the parent does, at an arm from its joint.
  const auto carry = [&] {
    if (!parent) return;
    const Vector around = cross(parent->angular_velocity, arm);
    at.velocity = parent->velocity + around;
    at.acceleration = parent->acceleration + cross(parent->angular_acceleration, arm) +
                      cross(parent->angular_velocity, around);
  };

  switch (joint.kind) {
    case JointKind::Revolute:
    case JointKind::UnboundedRevolute: {
      Lanes cosine, sine;
      if (joint.kind == JointKind::Revolute) {
        const Lanes angle = load(q_, joint.q);
        normalized_ = normalized_ && stdx::abs(angle) < kLargestAngle;
        cosine = stdx::cos(angle);
        sine = stdx::sin(angle);
      } else {
        cosine = load(q_, joint.q);
        sine = load(q_, joint.q + 1);
        requireNormalized(cosine * cosine + sine * sine);
      }
      carry();
      const Vector x = at.rotation.x, y = at.rotation.y;
      at.rotation.x = cosine * x + sine * y;
      at.rotation.y = cosine * y - sine * x;
      const Vector rate = load(v_, joint.v) * at.rotation.z;
      at.angular_acceleration += load(a_, joint.v) * at.rotation.z;
      at.angular_acceleration += cross(at.angular_velocity, rate);
      at.angular_velocity += rate;
      return at;
    }
    case JointKind::Prismatic: {
      const Vector moved = load(q_, joint.q) * at.rotation.z;
      at.position += moved;
      arm += moved;
      carry();
      const Vector rate = load(v_, joint.v) * at.rotation.z;
      at.velocity += rate;
      at.acceleration += load(a_, joint.v) * at.rotation.z;
      at.acceleration += Lanes(2.) * cross(at.angular_velocity, rate);
      return at;
    }
    default:
      break;
  }

  // Those with several components: of which velocities are in the moving frame's axes.
  Matrix rotation = identity();
  Vector position = zero(), velocity = zero(), spin = zero();
  Vector velocity_rate = zero(), spin_rate = zero();
  switch (joint.kind) {
    case JointKind::FreeFlyer:
      position = loadVector(q_, joint.q);
      rotation = loadRotation(joint.q + 3);
      velocity = loadVector(v_, joint.v);
      velocity_rate = loadVector(a_, joint.v);
      spin = loadVector(v_, joint.v + 3);
      spin_rate = loadVector(a_, joint.v + 3);
      break;
    case JointKind::Spherical:
      rotation = loadRotation(joint.q);
      spin = loadVector(v_, joint.v);
      spin_rate = loadVector(a_, joint.v);
      break;
    case JointKind::Translation:
      position = loadVector(q_, joint.q);
      velocity = loadVector(v_, joint.v);
      velocity_rate = loadVector(a_, joint.v);
      break;
    default: {  // planar
      position.x = load(q_, joint.q);
      position.y = load(q_, joint.q + 1);
      const Lanes cosine = load(q_, joint.q + 2), sine = load(q_, joint.q + 3);
      requireNormalized(cosine * cosine + sine * sine);
      rotation.x = {cosine, sine, 0.};
      rotation.y = {-sine, cosine, 0.};
      velocity = {load(v_, joint.v), load(v_, joint.v + 1), 0.};
      velocity_rate = {load(a_, joint.v), load(a_, joint.v + 1), 0.};
      spin.z = load(v_, joint.v + 2);
      spin_rate.z = load(a_, joint.v + 2);
    }
  }
  const Vector moved = at.rotation * position;
  at.position += moved;
  arm += moved;
  carry();
  at.rotation = at.rotation * rotation;
  const Vector rate = at.rotation * velocity, turning = at.rotation * spin;
  at.velocity += rate;
  at.acceleration += Lanes(2.) * cross(at.angular_velocity, rate) +
                     at.rotation * (velocity_rate + cross(spin, velocity));
  at.angular_acceleration += at.rotation * spin_rate + cross(at.angular_velocity, turning);
  at.angular_velocity += turning;
  return at;
}

void Sweeper::addBody(const Joint& joint, const Moving& moving) {
  if (joint.massless) return;
  const Vector arm = moving.rotation * broadcast(joint.com);
  const Vector around = cross(moving.angular_velocity, arm);
  const Lanes mass = joint.mass;
  const Vector place = moving.position - centre_ + arm;
  const Vector momentum = mass * (moving.velocity + around);
  const Vector momentum_rate =
      mass * (moving.acceleration + cross(moving.angular_acceleration, arm) +
              cross(moving.angular_velocity, around));
  places_ += mass * place;
  momentum_ += momentum;
  momentum_rate_ += momentum_rate;

  const double* I = joint.inertia;
  const auto times = [I](const Vector& a) {
    return Vector{I[0] * a.x + I[1] * a.y + I[3] * a.z, I[1] * a.x + I[2] * a.y + I[4] * a.z,
                  I[3] * a.x + I[4] * a.y + I[5] * a.z};
  };
  const Vector spin = transposed(moving.rotation, moving.angular_velocity);
  const Vector own = times(spin);
  const Vector own_rate =
      times(transposed(moving.rotation, moving.angular_acceleration)) + cross(spin, own);
  angular_momentum_ += moving.rotation * own + cross(place, momentum);
  angular_momentum_rate_ += moving.rotation * own_rate + cross(place, momentum_rate);
}

// Newton and Euler (1, 2).
void Sweeper::computeDynamics(const Sweep& sweep) {
  places_ = momentum_ = momentum_rate_ = angular_momentum_ = angular_momentum_rate_ = zero();
  centre_ = moving_[0].position;
  for (std::size_t k = 0; k < joints_.size(); ++k) addBody(joints_[k], moving_[k]);
  const Lanes inverse_mass = 1. / mass_;
  const Vector place = inverse_mass * places_;
  const Vector com = centre_ + place;
  const Vector am = angular_momentum_ - cross(place, momentum_);
  const Vector force = momentum_rate_ - Lanes(mass_) * broadcast(robot_.gravity);
  const Vector torque = angular_momentum_rate_ - cross(place, momentum_rate_);
  store(sweep.com, com);
  store(sweep.vcom, inverse_mass * momentum_);
  store(sweep.acom, inverse_mass * momentum_rate_);
  store(sweep.am, am);
  store(sweep.dam, torque);
  store(sweep.force, force);
  store(sweep.torque, torque);
  for (const Vector& vector : {com, momentum_, am, force, torque})
    nothing_ += 0. * (vector.x + vector.y + vector.z);
}

void Sweeper::place(const Fixture& contact, const PlaceRows& rows) const {
  const Moving& parent = moving_[static_cast<std::size_t>(contact.parent)];
  const Vector arm = parent.rotation * broadcast(contact.placement + 9);
  const Matrix rotation =
      contact.world_aligned ? identity() : parent.rotation * broadcastMatrix(contact.placement);
  // From the frame's origin to that of the surface, and on to its lowest corner.
  const Vector down = Lanes(-contact.radius) * rotation.z;
  const Vector position = parent.position + arm + down;
  const auto lower = [](double half_size, const Lanes& height) {
    Lanes size = half_size;
    stdx::where(height > 0., size) = -half_size;
    return size;
  };
  const Vector to_corner = lower(contact.half_length, rotation.x.z) * rotation.x +
                           lower(contact.half_width, rotation.y.z) * rotation.y;
  store(rows.position, position);
  store(rows.height, {position.z + to_corner.z});
  store(rows.velocity, parent.velocity + cross(parent.angular_velocity, arm + down + to_corner));
  if (!rows.rotation) return;
  Lanes quaternion[4];
  findQuaternion(rotation, quaternion);
  store(rows.rotation, quaternion);
}

// ---- How contacts share a wrench ----

class Distributor : Block {
 public:
  explicit Distributor(const Carrier& carrier)
      : carrier_(carrier),
        contacts_(carrier.contact, carrier.contact + carrier.contacts),
        standing_(contacts_.size()),
        newton_(contacts_) {
    const double* D = carrier.wrench_weights;
    spread_ = *std::max_element(D, D + 6) / *std::min_element(D, D + 6);
    minimal_scale_ = carrier.minimal_scale * *std::max_element(D, D + 3);
    for (const Contact& contact : contacts_)
      largest_weight_ = std::max(
          largest_weight_, *std::max_element(contact.weights, contact.weights + contact.size));
  }

  // First the forces that no inequality holds back. Frames without an answer are gathered, so that
  // none waits for others that have theirs.
  void run(const Distributions& distributions) {
    left_.clear();
    for (std::ptrdiff_t first = 0; first < distributions.count; first += kLanes) {
      take(first, distributions.count);
      takeProblem(distributions);
      if (carrier_.flat_horizontal_ground) findCentreOfPressure(distributions);
      write(distributions, newton_.solveFreely(target_));
    }
    for (int attempt = 0; attempt < DualNewton::kAttempts; ++attempt) {
      candidates_.swap(left_);
      left_.clear();
      for (std::size_t first = 0; first < candidates_.size(); first += kLanes) {
        take(candidates_, static_cast<std::ptrdiff_t>(first));
        takeProblem(distributions);
        write(distributions, newton_.solve(target_, spread_, attempt));
      }
    }
  }

 private:
  // A contact as it stands in the frames at hand.
  struct Standing {
    Lanes is_active;  // its readiness, or 0
    bool takes_part;  // in any frame
    Matrix rotation;  // of its surface
    Vector lever;     // from the CoM to the surface's origin
    Vector moments[3];
    Lanes inverse_weights[6];  // W⁻¹ times the unit of force
    Lanes force[6];
  };

  void takeProblem(const Distributions& distributions);
  void stand(const ContactRows& rows, Standing& standing) const;
  void scaleProblem();
  void findCentreOfPressure(const Distributions& distributions) const;
  void takeForces();
  void write(const Distributions& distributions, const Mask& answered);
  void writeMeanPressure(const Distributions& distributions, const Mask& answered) const;
  void writeContact(const Distributions& distributions, std::size_t k, const Mask& answered) const;

  const Carrier carrier_;
  const std::vector<Contact> contacts_;
  double spread_;                   // the largest wrench weight over the least
  double minimal_scale_;            // of weighted wrenches
  double largest_weight_ = 0.;      // of all contacts
  std::vector<Standing> standing_;  // by contact
  DualNewton newton_;
  std::vector<std::ptrdiff_t> left_, candidates_;  // frames without an answer, now and before

  // Of the frames at hand.
  Vector com_, force_, torque_;
  Wrench wrench_, achieved_;
  Mask is_carried_;       // by any contact
  Wrench target_, unit_;  // D w over its unit, and that
};

void Distributor::takeProblem(const Distributions& distributions) {
  com_ = loadVector(distributions.com);
  force_ = loadVector(distributions.force);
  torque_ = loadVector(distributions.torque);
  wrench_ = {{force_.x, force_.y, force_.z, torque_.x, torque_.y, torque_.z}};
  is_carried_ = Mask(false);
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    stand(distributions.contacts[k], standing_[k]);
    if (standing_[k].takes_part) is_carried_ = is_carried_ || standing_[k].is_active > 0.;
  }
  scaleProblem();
}

// Gives Newton's method the problem over its units, as WrenchDistribution has them.
void Distributor::scaleProblem() {
  const double* D = carrier_.wrench_weights;
  for (int i = 0; i < 6; ++i) target_[i] = D[i] * wrench_[i];
  const Lanes size = norm(target_);
  const Lanes scale = stdx::max(size, Lanes(minimal_scale_)), inverse_scale = 1. / scale;
  for (int i = 0; i < 6; ++i) {
    target_[i] *= inverse_scale;
    unit_[i] = scale / D[i];
  }
  const Lanes inverse_overall_weight = norm(wrench_) / size;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    Standing& standing = standing_[k];
    Cone& cone = newton_.cones()[k];
    cone.is_there = standing.takes_part;
    if (!standing.takes_part) continue;
    const Vector axes[3] = {standing.rotation.x, standing.rotation.y, standing.rotation.z};
    const Lanes ease = stdx::sqrt(standing.is_active) * inverse_overall_weight;
    for (int i = 0; i < cone.size; ++i) {
      const Lanes inverse_weight = ease * (largest_weight_ / contacts_[k].weights[i]);
      standing.inverse_weights[i] = scale * inverse_weight;
      const Vector force = i < 3 ? axes[i] : zero();
      const Vector moment = i < 3 ? standing.moments[i] : axes[i - 3];
      cone.e[i] = {{force.x, force.y, force.z, moment.x, moment.y, moment.z}};
      for (int j = 0; j < 6; ++j) cone.e[i][j] *= D[j] * inverse_weight;
    }
  }
}

void Distributor::stand(const ContactRows& rows, Standing& standing) const {
  bool any = false;
  for (int lane = 0; lane < count_; ++lane) any = any || rows.active[frameOf(lane)];
  standing.takes_part = any;
  if (!any) return;
  standing.is_active = Lanes([&](auto lane) {
    const std::ptrdiff_t frame = frameOf(lane);
    if (!rows.active[frame]) return 0.;
    return rows.readiness ? rows.readiness[frame] : 1.;
  });
  standing.rotation = identity();
  if (rows.rotation) {
    Lanes quaternion[4];
    load(rows.rotation, quaternion);
    standing.rotation = rotationOf(quaternion[0], quaternion[1], quaternion[2], quaternion[3]);
  }
  standing.lever = loadVector(rows.position) - com_;
  standing.moments[0] = cross(standing.lever, standing.rotation.x);
  standing.moments[1] = cross(standing.lever, standing.rotation.y);
  standing.moments[2] = cross(standing.lever, standing.rotation.z);
}

// The centre of pressure (5).
void Distributor::findCentreOfPressure(const Distributions& distributions) const {
  const Lanes height = com_.z - carrier_.ground_height;
  Lanes x = com_.x + (-torque_.y - force_.x * height) / force_.z;
  Lanes y = com_.y + (torque_.x - force_.y * height) / force_.z;
  const Mask undefined = !(force_.z >= carrier_.minimal_vertical_force) || !(0. * (x + y) == 0.);
  stdx::where(undefined, x) = kNaN;
  stdx::where(undefined, y) = kNaN;
  store(distributions.cop, {x, y});
}

// Takes over what Newton's method has found.
void Distributor::takeForces() {
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    Standing& standing = standing_[k];
    const Cone& cone = newton_.cones()[k];
    if (!cone.is_there) continue;
    for (int i = 0; i < 6; ++i)
      standing.force[i] = i < cone.size ? standing.inverse_weights[i] * cone.force[i] : Lanes(0.);
  }
  for (int i = 0; i < 6; ++i) achieved_[i] = unit_[i] * newton_.achieved()[i];
}

// Writes what was found, where it is an answer, and says of other frames that they are left.
void Distributor::write(const Distributions& distributions, const Mask& answered) {
  takeForces();
  const Mask& reached = newton_.isReached();
  for (int lane = 0; lane < count_; ++lane) {
    const std::ptrdiff_t frame = frameOf(lane);
    const Answer answer = reached[lane] ? Answer::Solved : Answer::Relaxed;
    distributions.answers[frame] = answered[lane] ? answer : Answer::None;
    if (!answered[lane] && is_carried_[lane]) left_.push_back(frame);
  }
  const Lanes inverse_mass = 1. / carrier_.mass;
  const Vector acom =
      inverse_mass * Vector{achieved_[0], achieved_[1], achieved_[2]} + broadcast(carrier_.gravity);
  storeWhere(answered, distributions.feasible_acom, acom);
  storeWhere(answered, distributions.feasible_dam,
             Vector{achieved_[3], achieved_[4], achieved_[5]});
  Lanes residual[6];
  for (int i = 0; i < 6; ++i) residual[i] = wrench_[i] - achieved_[i];
  storeWhere(answered, distributions.residual, residual);
  for (std::size_t k = 0; k < contacts_.size(); ++k)
    if (standing_[k].takes_part) writeContact(distributions, k, answered);
  if (!carrier_.flat_horizontal_ground) writeMeanPressure(distributions, answered);
}

// The mean of the contacts' own centres of pressure, weighted by their vertical forces (6).
void Distributor::writeMeanPressure(const Distributions& distributions,
                                    const Mask& answered) const {
  Vector moment = zero();
  Lanes vertical_force = 0.;
  for (std::size_t k = 0; k < contacts_.size(); ++k) {
    const Standing& standing = standing_[k];
    if (!standing.takes_part) continue;
    const Lanes* f = standing.force;
    const Matrix& R = standing.rotation;
    const Mask is_loaded = standing.is_active > 0. && f[2] > 0.;
    Lanes inverse = 0., vertical = 0.;
    stdx::where(is_loaded, inverse) = 1. / f[2];
    stdx::where(is_loaded, vertical) = R.x.z * f[0] + R.y.z * f[1] + R.z.z * f[2];
    const Vector centre = com_ + standing.lever + (-f[4] * inverse) * R.x + (f[3] * inverse) * R.y;
    moment += vertical * centre;
    vertical_force += vertical;
  }
  Lanes x = moment.x / vertical_force, y = moment.y / vertical_force;
  const Mask undefined =
      !(vertical_force >= carrier_.minimal_vertical_force) || !(0. * (x + y) == 0.);
  stdx::where(undefined, x) = kNaN;
  stdx::where(undefined, y) = kNaN;
  storeWhere<2>(answered, distributions.cop, {x, y});
}

// As ContactBase and DynaCoM have it.
void Distributor::writeContact(const Distributions& distributions, std::size_t k,
                               const Mask& answered) const {
  const Contact& contact = contacts_[k];
  const Standing& standing = standing_[k];
  const ContactRows& rows = distributions.contacts[k];
  const Lanes* f = standing.force;
  const Matrix& R = standing.rotation;
  const Mask written = answered && standing.is_active > 0.;
  const Mask unloaded = !(f[2] >= carrier_.minimal_vertical_force && f[2] > 0.);
  const Lanes inverse = 1. / f[2];
  const bool is_surface = contact.size == 6;

  storeWhere(written, rows.wrench, standing.force);
  storeWhere<1>(written, rows.vertical_force, {R.x.z * f[0] + R.y.z * f[1] + R.z.z * f[2]});
  Lanes x = is_surface ? -f[4] * inverse : Lanes(0.), y = is_surface ? f[3] * inverse : Lanes(0.);
  Lanes margin = is_surface
                     ? stdx::min(contact.betas[4] - stdx::abs(x), contact.betas[3] - stdx::abs(y))
                     : Lanes(kNaN);
  for (Lanes* number : {&x, &y, &margin}) stdx::where(unloaded, *number) = kNaN;
  storeWhere<2>(written, rows.cop, {x, y});
  storeWhere<1>(written, rows.cop_margin, {margin});
  const auto usage = [&](const Lanes& size, double beta) {
    if (!(beta > 0.)) return Lanes(kNaN);
    Lanes part = size * inverse / beta;
    stdx::where(unloaded, part) = 0.;
    return part;
  };
  const Lanes tangential = contact.is_disc ? stdx::sqrt(f[0] * f[0] + f[1] * f[1])
                                           : stdx::max(stdx::abs(f[0]), stdx::abs(f[1]));
  storeWhere<1>(written, rows.friction_usage, {usage(tangential, contact.betas[0])});
  storeWhere<1>(written, rows.yaw_usage,
                {usage(stdx::abs(f[5]), is_surface ? contact.betas[5] : 0.)});
}

// What crosses to the library and back.
template <class Worker, class Description>
void* create(const Description* description) {
  try {
    return new Worker(*description);
  } catch (const std::bad_alloc&) {
    return nullptr;
  }
}
template <class Worker, class Frames>
void run(void* worker, const Frames* frames) {
  static_cast<Worker*>(worker)->run(*frames);
}
template <class Worker>
void destroy(void* worker) {
  delete static_cast<Worker*>(worker);
}

constexpr Interface kInterface = {kVersion,
                                  kLanes,
                                  &create<Sweeper, Robot>,
                                  &run<Sweeper, Sweep>,
                                  &destroy<Sweeper>,
                                  &create<Distributor, Carrier>,
                                  &run<Distributor, Distributions>,
                                  &destroy<Distributor>};

}  // namespace
}  // namespace dynacom::lanes

extern "C" [[gnu::visibility("default")]] const dynacom::lanes::Interface* dynacom_lanes() {
  return &dynacom::lanes::kInterface;
}
