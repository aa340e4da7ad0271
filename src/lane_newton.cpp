// SPDX-License-Identifier: BSD-2-Clause
#include "lane_newton.hpp"

#include <algorithm>

namespace dynacom::lanes {
namespace {

// All of these are for a problem whose weighted wrench has unit size, as in dual_newton.cpp.

constexpr int kNormal = Cone::kNormal;
// How many steps a search may take.
constexpr int kMaximalSteps = 20;
// Along a step, what part of the slope at its start is as good as none.
constexpr double kFlat = 0.6;
// How often a step is cut, and how often until it is enough to have come to another state.
constexpr int kMaximalCuts = 30;
constexpr int kEasyCuts = 3;
// For which ratio of two lengths their middle is the geometric one.
constexpr double kFarApart = 4.;
// What part of the largest pivot the least must be, so that nothing needs to be asked about the
// rank.
constexpr double kFullRank = 1e-6;
// Of a direction of the wrenches that the contacts give, what remains outside of the others: more
// than the first, it is one of its own, less than the second, it is rounding.
constexpr double kIndependent = 1e-5;
constexpr double kDependent = 1e-11;
// The distance from the closest wrench: more than the first, times how far wrench weights are
// apart, it has digits enough, less than the second, it is rounding.
constexpr double kFar = 1e-4;
constexpr double kReached = 1e-13;
// What an answer may lack, and how often it is corrected.
constexpr double kMissing = 1e-12;
constexpr int kCorrections = 3;
// By how much the signs of an answer may be wrong, beside the terms that make them up.
constexpr double kRounding = 1e-12;
// Of the distance, a multiplier that is not zero, and one that is.
constexpr double kHeld = 1e-8;
constexpr double kFree = 1e-12;
// By how much terms may be larger than the costs that they make up.
constexpr double kCancellation = 1e6;

inline Wrench difference(const Wrench& a, const Wrench& b) {
  Wrench c;
  for (int i = 0; i < 6; ++i) c[i] = a[i] - b[i];
  return c;
}

inline void setZero(Wrench& a) {
  for (Lanes& number : a.at) number = 0.;
}

inline Lanes select(const Mask& mask, const Lanes& so, const Lanes& otherwise) {
  Lanes chosen = otherwise;
  stdx::where(mask, chosen) = so;
  return chosen;
}

// Calls a function with the number of a contact's components, which the compiler knows then.
template <class Function>
inline void withSize(int size, Function function) {
  if (size == 6)
    function(std::integral_constant<int, 6>());
  else
    function(std::integral_constant<int, 3>());
}

// The state that a pull wants, and the forces in it. What x_z would have to be less,
//
//     x_z − g_z − Σ βᵢ max(0, |gᵢ| − βᵢ x_z),
//
// rises, ever less steeply: from zero on, where all that pull sideways are at their bounds,
// Newton's method comes from the left, and lets go of one bound at least with each step.
template <int kSize>
inline void followPull(Cone& cone) {
  Lanes sizes[kSize], normal = 0., stiffness = 1.;
  for (int i = 0; i < kSize; ++i) sizes[i] = stdx::abs(cone.pull[i]);
  for (int step = 0; step < kSize; ++step) {
    Lanes resisting = cone.pull[kNormal];
    stiffness = 1.;
    for (int i = 0; i < kSize; ++i) {
      if (i == kNormal) continue;
      const Lanes held = select(sizes[i] > cone.betas[i] * normal, cone.betas[i], 0.);
      resisting += held * sizes[i];
      stiffness += held * cone.betas[i];
    }
    normal = stdx::max(Lanes(0.), resisting / stiffness);
  }
  const Mask loaded = normal > 0.;
  cone.loaded = select(loaded, 1., 0.);
  cone.inverse_stiffness = 1. / stiffness;
  for (int i = 0; i < kSize; ++i) {
    const Lanes& pull = cone.pull[i];
    const Lanes most = cone.betas[i] * normal;
    const Mask held = loaded && sizes[i] > most;
    cone.force[i] = stdx::max(-most, stdx::min(most, pull));
    // What has no extent is always at a bound.
    cone.bounds[i] =
        cone.betas[i] == 0. ? cone.loaded : select(held, select(pull < 0., -1., 1.), 0.);
  }
  cone.force[kNormal] = normal;
  cone.bounds[kNormal] = cone.loaded;
}

template <int kSize>
inline void findPull(const Cone& cone, const Wrench& multipliers, Lanes* pull) {
  for (int i = 0; i < kSize; ++i) pull[i] = dot(cone.e[i], multipliers);
}

template <int kSize>
inline void addWrench(const Cone& cone, Wrench& wrench) {
  for (int i = 0; i < kSize; ++i) add(cone.force[i], cone.e[i], wrench);
}

// The wrench of a unit of the normal force, and what goes with it.
inline Wrench normalWrench(const Cone& cone) {
  Wrench wrench = cone.e[kNormal];
  for (int i = 0; i < cone.size; ++i)
    if (i != kNormal) add(cone.bounds[i] * cone.betas[i], cone.e[i], wrench);
  return wrench;
}

}  // namespace

DualNewton::DualNewton(const std::vector<Contact>& contacts) : cones_(contacts.size()) {
  for (std::size_t k = 0; k < contacts.size(); ++k) {
    const Contact& contact = contacts[k];
    cones_[k].size = contact.size;
    for (int i = 0; i < contact.size; ++i)
      if (i != kNormal)
        cones_[k].betas[i] = contact.betas[i] * contact.weights[i] / contact.weights[kNormal];
  }
  directions_.reserve(6 * contacts.size());
}

// Enters the state in which no component is at its bound, but where the last search ended in one
// that led to an answer.
void DualNewton::begin() {
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    for (int i = 0; i < cone.size; ++i)
      stdx::where(!is_warm_, cone.bounds[i]) = i == kNormal || cone.betas[i] == 0. ? 1. : 0.;
    stdx::where(!is_warm_, cone.loaded) = 1.;
    stdx::where(!is_warm_, cone.inverse_stiffness) = 1.;
  }
}

void DualNewton::keepStates() {
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    cone.former_loaded = cone.loaded;
    for (int i = 0; i < cone.size; ++i) cone.former_bounds[i] = cone.bounds[i];
  }
}

// The forces for the multipliers at hand, in the state that they want. Returns where that is
// another than at the last keepStates().
Mask DualNewton::evaluate() {
  Mask changed(false);
  setZero(achieved_);
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    withSize(cone.size, [&](auto size) {
      findPull<size>(cone, multipliers_, cone.pull);
      followPull<size>(cone);
      addWrench<size>(cone, achieved_);
      changed = changed || cone.loaded != cone.former_loaded;
      for (int i = 0; i < size; ++i) changed = changed || cone.bounds[i] != cone.former_bounds[i];
    });
  }
  return changed;
}

// How the wrench rises with its multipliers, as long as the state stays.
void DualNewton::assembleCompliance() {
  for (auto& row : compliance_)
    for (Lanes& number : row) number = 0.;
  const auto addSquare = [&](const Lanes& scale, const Wrench& column) {
    for (int j = 0; j < 6; ++j) {
      const Lanes scaled = scale * column[j];
      for (int i = j; i < 6; ++i) compliance_[i][j] += scaled * column[i];
    }
  };
  for (const Cone& cone : cones_) {
    if (!cone.is_there || stdx::none_of(cone.loaded != 0.)) continue;
    addSquare(cone.loaded * cone.inverse_stiffness, normalWrench(cone));
    for (int i = 0; i < cone.size; ++i) {
      const Lanes is_free = cone.isFree(i);
      if (stdx::any_of(is_free != 0.)) addSquare(is_free, cone.e[i]);
    }
  }
}

// Newton's method with ε, until the state stays. Returns where it does.
Mask DualNewton::search(const Mask& wanted) {
  Mask searching = wanted, found(false), is_fresh = wanted;
  Lanes slack = slacks_[0];
  setZero(multipliers_);
  setZero(achieved_);
  const auto findGradient = [&] {
    Wrench gradient;
    for (int i = 0; i < 6; ++i) gradient[i] = achieved_[i] + slack * multipliers_[i] - target_[i];
    return gradient;
  };
  Wrench gradient = findGradient();
  for (int step = 0; step < kMaximalSteps && stdx::any_of(searching); ++step) {
    assembleCompliance();
    Factors factors;
    for (int j = 0; j < 6; ++j)
      for (int i = j; i < 6; ++i) factors.m[i][j] = compliance_[i][j];
    for (int i = 0; i < 6; ++i) factors.m[i][i] += slack;
    factors.compute();
    Wrench change;
    for (int i = 0; i < 6; ++i) change[i] = select(searching, -gradient[i], 0.);
    factors.solve(change.at);
    const Lanes slope = dot(gradient, change);
    const Mask is_down = slope < 0.;
    searching = searching && is_down;

    // The slope along the step rises from negative on. The full step is taken unless the slope is
    // positive there; else one is sought where it has nearly vanished, or at least the state is
    // another.
    const Wrench start = multipliers_;
    keepStates();
    Lanes length = 1., lower = 0., upper = 1., lower_slope = slope, upper_slope = 0.;
    Mask cutting = searching, settled(false);
    for (int cut = 0; stdx::any_of(cutting); ++cut) {
      if (cut == kMaximalCuts) {
        searching = searching && !cutting;
        break;
      }
      for (int i = 0; i < 6; ++i) multipliers_[i] = start[i] + length * change[i];
      const Mask changed = evaluate();
      gradient = findGradient();
      const Lanes end_slope = dot(gradient, change);
      const Mask descends = end_slope < 0.;
      Mask enough = stdx::abs(end_slope) <= -kFlat * slope;
      if (cut == 0) {
        settled = searching && !changed;
        enough = enough || settled || descends || is_fresh;
      } else if (cut >= kEasyCuts) {
        enough = enough || (descends && changed);
      }
      cutting = cutting && !enough;
      const Mask lies_low = cutting && descends, lies_high = cutting && !descends;
      stdx::where(lies_low, lower) = length;
      stdx::where(lies_low, lower_slope) = end_slope;
      stdx::where(lies_high, upper) = length;
      stdx::where(lies_high, upper_slope) = end_slope;
      // By turns where a straight line between both would vanish, and in the middle.
      const Lanes next = cut % 2 == 0
                             ? lower + (upper - lower) * lower_slope / (lower_slope - upper_slope)
                             : select(upper > kFarApart * lower && lower > 0.,
                                      stdx::sqrt(lower * upper), 0.5 * (lower + upper));
      stdx::where(cutting, length) = next;
    }
    // Down to the last ε, it begins anew from the state.
    is_fresh = settled && slack > slacks_[1];
    found = found || (settled && !is_fresh);
    searching = searching && !(settled && !is_fresh);
    if (stdx::any_of(is_fresh)) {
      stdx::where(is_fresh, slack) = slacks_[1];
      for (int i = 0; i < 6; ++i) {
        stdx::where(is_fresh, multipliers_[i]) = 0.;
        stdx::where(is_fresh, gradient[i]) = -target_[i];
      }
    }
  }
  return found;
}

// Changes the multipliers in the state at hand. The forces change by what they respond to the
// change, which is more accurate than what they respond to the sum.
void DualNewton::correct(const Wrench& change) {
  for (int i = 0; i < 6; ++i) multipliers_[i] += change[i];
  setZero(achieved_);
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    withSize(cone.size, [&](auto size) {
      Lanes pull[size], along = 0.;
      findPull<size>(cone, change, pull);
      for (int i = 0; i < size; ++i) along += cone.edge(i) * pull[i];
      along *= cone.inverse_stiffness;
      for (int i = 0; i < size; ++i) {
        cone.pull[i] += pull[i];
        cone.force[i] += cone.isFree(i) * pull[i] + along * cone.edge(i);
      }
      addWrench<size>(cone, achieved_);
    });
  }
}

// An orthonormal basis of the wrenches that the state can give, whatever it costs: one direction
// after the other, of which the most is new; and zeros behind. Returns where the rank is certain.
Mask DualNewton::findRange() {
  directions_.clear();
  const auto append = [&](const Lanes& is_one, const Wrench& direction) {
    const Lanes size = norm(direction);
    const Lanes scale = select(size > 0., is_one / size, 0.);
    Wrench& added = directions_.emplace_back();
    for (int i = 0; i < 6; ++i) added[i] = scale * direction[i];
  };
  for (const Cone& cone : cones_) {
    if (!cone.is_there || stdx::none_of(cone.loaded != 0.)) continue;
    append(cone.loaded, normalWrench(cone));
    for (int i = 0; i < cone.size; ++i)
      if (stdx::any_of(cone.isFree(i) != 0.)) append(cone.isFree(i), cone.e[i]);
  }
  Mask is_certain(true), is_complete(false);
  for (int rank = 0; rank < 6; ++rank) {
    Lanes most = 0.;
    Wrench& basis = range_[rank];
    setZero(basis);
    for (const Wrench& direction : directions_) {
      const Lanes size = dot(direction, direction);
      const Mask is_more = size > most;
      stdx::where(is_more, most) = size;
      for (int i = 0; i < 6; ++i) stdx::where(is_more, basis[i]) = direction[i];
    }
    most = stdx::sqrt(most);
    is_complete = is_complete || most <= kDependent;
    is_certain = is_certain && (is_complete || most >= kIndependent);
    for (int k = 0; k < rank; ++k) add(-dot(range_[k], basis), range_[k], basis);
    const Lanes scale = select(is_complete, 0., 1. / norm(basis));
    for (int i = 0; i < 6; ++i) basis[i] *= scale;
    for (Wrench& direction : directions_) add(-dot(basis, direction), basis, direction);
  }
  return is_certain;
}

// From the state to the answer, without ε. Returns where there is one.
Mask DualNewton::finish(double spread) {
  Mask answered = findRange();
  // The closest wrench is the projection on what the directions span.
  missing_ = target_;
  for (int twice = 0; twice < 2; ++twice)
    for (const Wrench& direction : range_) add(-dot(direction, missing_), direction, missing_);
  Lanes distance = norm(missing_);
  is_reached_ = distance <= kReached;
  stdx::where(is_reached_, distance) = 0.;
  for (Lanes& number : missing_.at) stdx::where(is_reached_, number) = 0.;
  answered = answered && (is_reached_ || distance >= kFar * spread);
  const Wrench closest = difference(target_, missing_);

  // In the coordinates of the range: beyond its rank, all zeros, the diagonal is 1.
  Factors factors;
  for (int j = 0; j < 6; ++j) {
    Wrench product;
    for (int i = 0; i < 6; ++i) {
      product[i] = 0.;
      for (int k = 0; k < 6; ++k)
        product[i] += compliance_[std::max(i, k)][std::min(i, k)] * range_[j][k];
    }
    for (int i = j; i < 6; ++i) factors.m[i][j] = dot(range_[i], product);
    factors.m[j][j] += select(dot(range_[j], range_[j]) > 0., 0., 1.);
  }
  factors.compute();
  setZero(multipliers_);
  setZero(achieved_);
  for (Cone& cone : cones_)
    for (int i = 0; i < 6; ++i) cone.pull[i] = cone.force[i] = 0.;
  for (int correction = 0; correction < kCorrections; ++correction) {
    const Wrench lacking = difference(closest, achieved_);
    Lanes coordinates[6];
    for (int j = 0; j < 6; ++j) coordinates[j] = dot(range_[j], lacking);
    factors.solve(coordinates);
    Wrench change;
    setZero(change);
    for (int j = 0; j < 6; ++j) add(coordinates[j], range_[j], change);
    correct(change);
  }
  answered = answered && norm(difference(closest, achieved_)) <= kMissing;
  return answered && provesItself();
}

// Where multipliers of both stages have the signs that they must have, and forces are in their
// cones; of a contact whose forces and pulls are sums of these terms, without signs.
Mask DualNewton::provesItself(const Cone& cone, const Lanes (&terms)[6], const Lanes& costs) const {
  const Lanes distance = norm(missing_);
  const auto sizeOf = [&](int i) { return distance * norm(cone.e[i]); };
  const Mask loaded = cone.loaded > 0.;
  Mask proven(true);
  const Lanes of_distance = dot(cone.e[kNormal], missing_);
  // What makes a normal force expensive, its size, and what its rounding may be.
  Lanes resistance_of_distance = -of_distance, resistance = -cone.pull[kNormal];
  Lanes size = sizeOf(kNormal), rounding = kRounding * terms[kNormal];
  double largest_beta = 1.;
  for (int i = 0; i < cone.size; ++i) {
    if (i == kNormal) continue;
    const double beta = cone.betas[i];
    const Lanes pull_of_distance = dot(cone.e[i], missing_), own_size = sizeOf(i);
    const Lanes own_rounding = kRounding * terms[i];
    const Lanes& force = cone.force[i];
    const Lanes& pull = cone.pull[i];
    const Mask is_held = stdx::abs(pull_of_distance) > kFree * own_size;
    proven = proven && (!is_held || stdx::abs(pull_of_distance) >= kHeld * own_size);
    const Mask is_bound = loaded && cone.bounds[i] != 0. && Mask(beta > 0.);
    const Mask is_free = loaded && cone.bounds[i] == 0.;
    proven = proven && (!is_free || (!is_held && stdx::abs(force) <= beta * cone.force[kNormal] +
                                                                         kRounding * costs));
    const Mask pulls_outwards = (is_held && cone.bounds[i] * pull_of_distance >= 0.) ||
                                (!is_held && cone.bounds[i] * (pull - force) >= -own_rounding);
    proven = proven && (!is_bound || pulls_outwards);
    const Lanes bound = select(is_bound, cone.bounds[i],
                               select(select(is_held, pull_of_distance, pull) < 0., -1., 1.));
    resistance_of_distance -= select(is_free, 0., bound * beta * pull_of_distance);
    resistance -= select(is_free, 0., bound * beta * pull);
    size += beta * own_size;
    rounding += beta * own_rounding;
    largest_beta = std::max(largest_beta, beta);
  }
  const Mask is_held = resistance_of_distance >= kHeld * size && distance > 0.;
  const Mask stays_unloaded =
      is_held || (stdx::abs(resistance_of_distance) <= kFree * size && resistance >= -rounding);
  const Mask pushes = largest_beta * cone.force[kNormal] >= -kRounding * costs;
  return proven && ((loaded && pushes) || (!loaded && stays_unloaded));
}

Mask DualNewton::provesItself() const {
  Lanes costs = kRounding;
  for (const Cone& cone : cones_)
    if (cone.is_there)
      for (int i = 0; i < cone.size; ++i) costs = stdx::max(costs, stdx::abs(cone.force[i]));
  Mask proven(true);
  for (const Cone& cone : cones_) {
    if (!cone.is_there) continue;
    Lanes terms[6];
    for (int i = 0; i < cone.size; ++i) {
      terms[i] = stdx::abs(cone.force[i]);
      for (int j = 0; j < 6; ++j) terms[i] += stdx::abs(cone.e[i][j] * multipliers_[j]);
      proven = proven && terms[i] <= kCancellation * costs;
    }
    proven = proven && provesItself(cone, terms, costs);
  }
  return proven;
}

Mask DualNewton::solve(const Wrench& target, double spread, const double (&slacks)[2],
                       const Mask& wanted) {
  target_ = target;
  Lanes mean_compliance = 0.;
  for (const Cone& cone : cones_)
    if (cone.is_there)
      for (int i = 0; i < cone.size; ++i) mean_compliance += dot(cone.e[i], cone.e[i]);
  for (int k = 0; k < 2; ++k) slacks_[k] = slacks[k] / 6. * mean_compliance;
  begin();
  const Mask found = search(wanted);
  is_warm_ = Mask(false);
  return found && finish(spread);
}

}  // namespace dynacom::lanes
