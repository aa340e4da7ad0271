// SPDX-License-Identifier: BSD-2-Clause
#include "lane_newton.hpp"

#include <algorithm>

#include "newton_limits.hpp"

namespace dynacom::lanes {
namespace {

using namespace newton;

constexpr int kNormal = Cone::kNormal;
// ε of each attempt, as parts of the mean compliance, at first and at last.
constexpr double kSlacks[DualNewton::kAttempts][2] = {{1e-5, 1e-8}, {1e-4, 1e-9}};
// How many steps a search may take.
constexpr int kMaximalSteps = 20;
// How often an answer is corrected: where no inequality is active, and else.
constexpr int kFreeCorrections = 2;
constexpr int kCorrections = 3;
// The same where discs turn, at most, and until so much is missing.
constexpr int kTurningCorrections = 8;
constexpr double kCorrected = 1e-14;
// By how much a disc's direction may turn along a step, as 1 − cos, for its state to stay.
constexpr double kTurning = 1e-6;
// ε where discs are held, of an attempt after the first, as a part of the mean compliance.
constexpr double kRefined = 1e-7;
// From which residual on, over ε and times the mean compliance, it may be what holds discs, and
// which response along the circle is that of one that is held by what it costs.
constexpr double kResidual = 30.;
constexpr double kHeldByCost = 0.02;
// How often the residual is corrected where discs turn with it, at most, and until its change is
// so small.
constexpr int kTurns = 6;
constexpr double kTurned = 1e-15;
// The sine of the angle between the direction of a disc and what the residual pulls at it with.
constexpr double kParallel = 1e-9;

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

// Calls a function with the number of a contact's components, and whether the first two are a disc,
// which the compiler knows then.
template <class Function>
inline void withShape(const Cone& cone, Function function) {
  const auto withSize = [&](auto is_disc) {
    if (cone.size == 6)
      function(std::integral_constant<int, 6>(), is_disc);
    else
      function(std::integral_constant<int, 3>(), is_disc);
  };
  if (cone.is_disc)
    withSize(std::true_type());
  else
    withSize(std::false_type());
}

// The state that a pull wants, and the forces in it. What x_z would have to be less,
//
//     x_z − g_z − Σ βᵢ max(0, |gᵢ| − βᵢ x_z),
//
// rises, ever less steeply: from zero on, where all that pull sideways are at their bounds,
// Newton's method comes from the left, and lets go of one bound at least with each step. A disc is
// one of them, with the length of what pulls at it.
template <int kSize, bool kDisc>
inline void followPull(Cone& cone) {
  constexpr auto isIncluded = [](int i) { return i != kNormal && !(kDisc && i == 1); };
  Lanes sizes[kSize], resisting = 0., stiffness = 1.;  // x_z is their ratio
  for (int i = 0; i < kSize; ++i) sizes[i] = stdx::abs(cone.pull[i]);
  if (kDisc) sizes[0] = stdx::sqrt(cone.pull[0] * cone.pull[0] + cone.pull[1] * cone.pull[1]);
  for (int step = 0; step < kSize - kDisc; ++step) {
    Lanes next_resisting = cone.pull[kNormal], next_stiffness = 1.;
    for (int i = 0; i < kSize; ++i) {
      if (!isIncluded(i)) continue;
      const double beta = cone.betas[i];
      const Mask held = sizes[i] * stiffness > beta * resisting;
      stdx::where(held, next_resisting) = next_resisting + beta * sizes[i];
      stdx::where(held, next_stiffness) = next_stiffness + beta * beta;
    }
    resisting = stdx::max(Lanes(0.), next_resisting);
    stiffness = next_stiffness;
  }
  cone.inverse_stiffness = 1. / stiffness;
  const Lanes normal = resisting * cone.inverse_stiffness;
  const Mask loaded = normal > 0.;
  cone.loaded = select(loaded, 1., 0.);
  if (kDisc) {
    const Lanes most = cone.betas[0] * normal;
    const Mask held = loaded && sizes[0] > most;
    const Lanes inverse = select(held, 1. / sizes[0], 0.);
    cone.held = select(held, 1., 0.);
    cone.curve = most * inverse;
    for (int i = 0; i < kNormal; ++i) {
      cone.bounds[i] = inverse * cone.pull[i];
      cone.force[i] = select(held, most * cone.bounds[i], cone.loaded * cone.pull[i]);
    }
  }
  for (int i = kDisc ? kNormal : 0; i < kSize; ++i) {
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

// How forces respond to a pull, as long as the state stays.
template <int kSize, bool kDisc>
inline void respond(const Cone& cone, const Lanes* pull, Lanes* force) {
  Lanes along = 0.;
  for (int i = 0; i < kSize; ++i) along += cone.edge(i) * pull[i];
  along *= cone.inverse_stiffness;
  for (int i = 0; i < kSize; ++i) force[i] = cone.isFree(i) * pull[i] + along * cone.edge(i);
  if (!kDisc) return;
  const Lanes around = cone.curve * (cone.bounds[0] * pull[1] - cone.bounds[1] * pull[0]);
  force[0] -= around * cone.bounds[1];
  force[1] += around * cone.bounds[0];
}

// After a change of the pull, and of the forces by what they respond to it, moves those of a disc
// that is held by its cost on along its circle, on which they have left it straight ahead.
template <int kSize>
inline void followCircle(Cone& cone) {
  const Mask turns = cone.held - cone.exposed > 0.;
  if (stdx::none_of(turns)) return;
  const Lanes x = cone.bounds[0], y = cone.bounds[1];
  const Lanes ahead = x * cone.pull[0] + y * cone.pull[1];
  const Lanes aside = x * cone.pull[1] - y * cone.pull[0];
  const Lanes size = stdx::sqrt(ahead * ahead + aside * aside);
  // By so much the pull is longer than it is straight ahead, which takes the normal force along.
  const Lanes longer = aside * aside / (size + ahead);
  const Lanes growth = cone.betas[0] * cone.inverse_stiffness * longer;
  for (int i = kNormal; i < kSize; ++i)
    stdx::where(turns, cone.force[i]) = cone.force[i] + growth * cone.edge(i);
  const Lanes most = cone.betas[0] * cone.force[kNormal], inverse = 1. / size;
  stdx::where(turns, cone.curve) = most * inverse;
  for (int i = 0; i < kNormal; ++i) {
    stdx::where(turns, cone.bounds[i]) = inverse * cone.pull[i];
    stdx::where(turns, cone.force[i]) = most * cone.bounds[i];
  }
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
    cones_[k].is_disc = contact.is_disc && contact.betas[0] > 0.;
  }
  directions_.reserve(6 * contacts.size());
}

// Enters the state in which all contacts that are there bear a load and no component is at its
// bound, from which the first step leads to the closed form for forces without inequalities; with
// multipliers of zero.
void DualNewton::begin() {
  setZero(multipliers_);
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    cone.loaded = select(cone.isPresent(), 1., 0.);
    cone.inverse_stiffness = 1.;
    cone.held = cone.curve = cone.exposed = 0.;
    for (int i = 0; i < cone.size; ++i) {
      cone.bounds[i] = i == kNormal || cone.betas[i] == 0. ? cone.loaded : Lanes(0.);
      cone.pull[i] = 0.;
    }
  }
}

// Begins a step that changes the multipliers.
void DualNewton::startStep(const Wrench& change) {
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    withShape(cone, [&](auto size, auto) { findPull<size>(cone, change, cone.pull_change); });
    cone.start_loaded = cone.loaded;
    cone.start_held = cone.held;
    for (int i = 0; i < cone.size; ++i) {
      cone.start_bounds[i] = cone.bounds[i];
      cone.start_pull[i] = cone.pull[i];
    }
  }
}

// The forces after a part of a step, in the state that they want then.
DualNewton::Along DualNewton::followStep(const Lanes& length) {
  Along along = {0., 0., Mask(false)};
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    withShape(cone, [&](auto size, auto is_disc) {
      for (int i = 0; i < size; ++i)
        cone.pull[i] = cone.start_pull[i] + length * cone.pull_change[i];
      followPull<size, is_disc>(cone);
      Lanes change[size];
      respond<size, is_disc>(cone, cone.pull_change, change);
      along.changed = along.changed || cone.loaded != cone.start_loaded;
      for (int i = 0; i < size; ++i) {
        along.slope += cone.force[i] * cone.pull_change[i];
        along.curvature += change[i] * cone.pull_change[i];
      }
      for (int i = is_disc ? kNormal : 0; i < size; ++i)
        along.changed = along.changed || cone.bounds[i] != cone.start_bounds[i];
      if (!is_disc) return;
      const Lanes cosine =
          cone.bounds[0] * cone.start_bounds[0] + cone.bounds[1] * cone.start_bounds[1];
      along.changed =
          along.changed || cone.held != cone.start_held || cone.held - cosine > kTurning;
    });
  }
  return along;
}

void DualNewton::sumUp() {
  setZero(achieved_);
  for (const Cone& cone : cones_)
    if (cone.is_there) withShape(cone, [&](auto size, auto) { addWrench<size>(cone, achieved_); });
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
    if (stdx::any_of(cone.curve != 0.)) addSquare(cone.curve, cone.around());
  }
}

// Factors of the compliance with ε.
Factors DualNewton::factorise(const Lanes& slack) const {
  Factors factors;
  for (int j = 0; j < 6; ++j) {
    for (int i = j; i < 6; ++i) factors.m[i][j] = compliance_[i][j];
    factors.m[j][j] += slack;
  }
  factors.compute();
  return factors;
}

// Takes a step, or a part of it: the slope along it rises from negative on, and the full step is
// taken unless the slope is positive there; else one is sought where it has nearly vanished, or at
// least the state is another. From a state that is not the one of the multipliers at hand, where
// slopes say nothing, it is the full step. Returns where that leaves the state as it is; where no
// length is found, nobody searches any more.
Mask DualNewton::takeStep(const Wrench& change, const Wrench& gradient, const Lanes& slack,
                          const Mask& is_full, Mask& searching) {
  const Lanes slope = dot(gradient, change);
  searching = searching && slope < 0.;
  startStep(change);
  const Lanes slope_of_rest = slack * dot(multipliers_, change) - dot(target_, change);
  const Lanes curvature_of_rest = slack * dot(change, change);
  Lanes length = 1., lower = 0., upper = 1.;
  Mask cutting = searching, stays(false);
  for (int cut = 0; stdx::any_of(cutting); ++cut) {
    if (cut == kMaximalCuts) {
      searching = searching && !cutting;
      break;
    }
    Along along = followStep(length);
    along.slope += slope_of_rest + length * curvature_of_rest;
    along.curvature += curvature_of_rest;
    const Mask descends = along.slope < 0.;
    Mask enough = stdx::abs(along.slope) <= -kFlat * slope;
    if (cut == 0) {
      stays = searching && !along.changed;
      enough = enough || stays || descends || is_full;
    } else if (cut >= kEasyCuts) {
      enough = enough || (descends && along.changed);
    }
    cutting = cutting && !enough;
    stdx::where(cutting && descends, lower) = length;
    stdx::where(cutting && !descends, upper) = length;
    // Where the slope would vanish if the state stayed, unless that is known to be too far.
    const Lanes next = length - along.slope / along.curvature;
    const Lanes middle = select(upper > kFarApart * lower && lower > 0., stdx::sqrt(lower * upper),
                                0.5 * (lower + upper));
    stdx::where(cutting, length) =
        select(next > lower && next < upper && Mask(cut % 3 != 2), next, middle);
  }
  for (int i = 0; i < 6; ++i) multipliers_[i] += length * change[i];
  return stays;
}

// Newton's method with ε, until the state stays. Returns where it does.
//
// Out of reach, multipliers are as large as 1/ε, and from those that belong to a wrong state it
// takes many small steps. With an ε that is not that small there are few, and its state is nearly
// that of the last ε, which begins anew from there: with multipliers of zero, so that the first
// step leads to those that belong to this state. Where discs are held, that does not follow from
// the state, and it is over with the first.
Mask DualNewton::search(const Lanes& first_slack, const Lanes& last_slack) {
  begin();
  Wrench gradient;  // of the dual
  for (int i = 0; i < 6; ++i) gradient[i] = -target_[i];
  return descend(first_slack, last_slack, gradient, Mask(true), Mask(true));
}

// The same with a smaller ε from the multipliers at hand, where discs are held. Multipliers grow
// along the residual then, by as much as is known of it.
Mask DualNewton::refine(const Mask& found) {
  const Lanes slack = kRefined * mean_compliance_;
  const Mask refined = found && isHeld() && slack_ > slack;
  if (stdx::none_of(refined)) return found;
  expose();
  findMissing();
  const Lanes growth = select(refined, 1. / slack - 1. / slack_, 0.);
  Wrench change;
  Mask is_far(false);
  for (const Cone& cone : cones_)
    if (cone.is_there && cone.is_disc) is_far = is_far || cone.exposed > 0.;
  for (int i = 0; i < 6; ++i) change[i] = select(is_far, growth * missing_[i], 0.);
  startStep(change);
  followStep(1.);
  for (int i = 0; i < 6; ++i) multipliers_[i] += change[i];
  sumUp();
  const Lanes now = select(refined, slack, slack_);
  Wrench gradient;
  for (int i = 0; i < 6; ++i) gradient[i] = achieved_[i] + now * multipliers_[i] - target_[i];
  const Mask is_found = descend(now, now, gradient, Mask(false), refined);
  return (refined && is_found) || (!refined && found);
}

// @param gradient   of the dual
// @param fresh      where the multipliers at hand are not those of the state
// @param searching  where anything is sought
Mask DualNewton::descend(const Lanes& first_slack, const Lanes& last_slack, Wrench gradient,
                         const Mask& fresh, Mask searching) {
  Mask found(false), is_fresh = fresh;
  Lanes slack = first_slack;
  for (int step = 0; step < kMaximalSteps && stdx::any_of(searching); ++step) {
    assembleCompliance();
    Wrench change;
    for (int i = 0; i < 6; ++i) change[i] = select(searching, -gradient[i], 0.);
    factorise(slack).solve(change.at);
    const Mask stays = takeStep(change, gradient, slack, is_fresh, searching);
    is_fresh = stays && slack > last_slack && !isHeld();
    found = found || (stays && !is_fresh);
    searching = searching && !found;
    sumUp();
    stdx::where(is_fresh, slack) = last_slack;
    for (int i = 0; i < 6; ++i) {
      stdx::where(is_fresh, multipliers_[i]) = 0.;
      gradient[i] = achieved_[i] + slack * multipliers_[i] - target_[i];
      stdx::where(is_fresh, gradient[i]) = -target_[i];
    }
    for (Cone& cone : cones_)
      if (cone.is_there)
        for (Lanes& number : cone.pull) stdx::where(is_fresh, number) = 0.;
  }
  slack_ = slack;
  return found;
}

// Where discs are held.
Mask DualNewton::isHeld() const {
  Mask held(false);
  for (const Cone& cone : cones_)
    if (cone.is_there && cone.is_disc) held = held || cone.held > 0.;
  return held;
}

// Changes the multipliers in the state at hand. The forces change by what they respond to the
// change, which is more accurate than what they respond to the sum.
void DualNewton::correct(const Wrench& change) {
  for (int i = 0; i < 6; ++i) multipliers_[i] += change[i];
  for (Cone& cone : cones_) {
    if (!cone.is_there) continue;
    withShape(cone, [&](auto size, auto is_disc) {
      Lanes pull[size], force[size];
      findPull<size>(cone, change, pull);
      respond<size, is_disc>(cone, pull, force);
      for (int i = 0; i < size; ++i) {
        cone.pull[i] += pull[i];
        cone.force[i] += force[i];
      }
      if (is_disc) followCircle<size>(cone);
    });
  }
  sumUp();
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
      if (stdx::any_of(cone.isGiven(i) != 0.)) append(cone.isGiven(i), cone.e[i]);
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

// Factors of the compliance in the coordinates of the range: beyond its rank, all zeros, the
// diagonal is 1.
Factors DualNewton::factoriseRange() const {
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
  return factors;
}

void DualNewton::startFromNothing() {
  setZero(multipliers_);
  setZero(achieved_);
  for (Cone& cone : cones_)
    for (int i = 0; i < 6; ++i) cone.pull[i] = cone.force[i] = 0.;
}

// Corrects the forces in the state at hand towards a wrench within its range.
void DualNewton::approach(const Wrench& wrench, const Factors& factors, const Mask& where) {
  const Wrench lacking = difference(wrench, achieved_);
  Lanes coordinates[6];
  for (int j = 0; j < 6; ++j) coordinates[j] = dot(range_[j], lacking);
  factors.solve(coordinates);
  Wrench change;
  setZero(change);
  for (int j = 0; j < 6; ++j) add(select(where, coordinates[j], 0.), range_[j], change);
  correct(change);
}

// The forces in the state at hand that give a wrench within its range. Returns where they do. With
// discs that are held by what they cost it is Newton's method: since what responds to a pull is
// homogeneous, its first step from nothing is that from the multipliers of the state.
Mask DualNewton::reach(const Wrench& wrench) {
  Mask turning(false);
  for (const Cone& cone : cones_)
    if (cone.is_there && cone.is_disc) turning = turning || cone.held - cone.exposed > 0.;
  const bool any_turning = stdx::any_of(turning);
  if (stdx::any_of(isHeld())) assembleCompliance();
  startFromNothing();
  Factors factors = factoriseRange();
  Mask busy(true);
  for (int correction = 0; correction < kTurningCorrections && stdx::any_of(busy); ++correction) {
    if (correction > 0 && any_turning) {
      assembleCompliance();
      factors = factoriseRange();
    }
    approach(wrench, factors, busy);
    const Mask lacks = turning && norm(difference(wrench, achieved_)) > kCorrected;
    busy = busy && (Mask(correction + 1 < kCorrections) || lacks);
  }
  return norm(difference(wrench, achieved_)) <= kMissing;
}

// Of the discs that are held, tells those that the residual holds, which is ε ν as far as that is
// known: these are pulled at by 1/ε, and so hardly respond along their circle. They are to respond
// along their direction only.
void DualNewton::expose() {
  for (int i = 0; i < 6; ++i) missing_[i] = slack_ * multipliers_[i];
  const Lanes distance = norm(missing_);
  const Mask is_far = distance * mean_compliance_ > kResidual * slack_;
  for (Cone& cone : cones_) {
    if (!cone.is_there || !cone.is_disc) continue;
    const Mask exposed = is_far && cone.held > 0. && cone.curve < kHeldByCost;
    cone.exposed = select(exposed, 1., 0.);
    stdx::where(exposed, cone.curve) = 0.;
  }
}

// Turns discs to the residual that exposes them. Returns where there are any.
Mask DualNewton::turn(const Mask& where) {
  Mask any(false);
  for (Cone& cone : cones_) {
    if (!cone.is_there || !cone.is_disc) continue;
    const Mask turns = where && cone.exposed > 0.;
    if (stdx::none_of(turns)) continue;
    const Lanes x = dot(cone.e[0], missing_), y = dot(cone.e[1], missing_);
    const Lanes inverse = 1. / stdx::sqrt(x * x + y * y);
    stdx::where(turns, cone.bounds[0]) = inverse * x;
    stdx::where(turns, cone.bounds[1]) = inverse * y;
    any = any || turns;
  }
  return any;
}

// The closest wrench is the projection on what the directions span.
Wrench DualNewton::projectTarget() const {
  Wrench missing = target_;
  for (int twice = 0; twice < 2; ++twice)
    for (const Wrench& direction : range_) add(-dot(direction, missing), direction, missing);
  return missing;
}

// A step of Newton's method for the residual where discs turn with it: r and c with
//
//     (1 + Σ (μ z/‖p‖) e_t e_tᵀ) (r − r₀) + Q c = w − r₀,   Qᵀ r = 0
//
// with p what r₀ pulls at a disc, t along its circle, and Q the range.
Wrench DualNewton::findTurned() const {
  Factors bend;
  for (int j = 0; j < 6; ++j)
    for (int i = j; i < 6; ++i) bend.m[i][j] = i == j ? 1. : 0.;
  for (const Cone& cone : cones_) {
    if (!cone.is_there || !cone.is_disc || stdx::none_of(cone.exposed > 0.)) continue;
    const Lanes x = dot(cone.e[0], missing_), y = dot(cone.e[1], missing_);
    const Lanes size = stdx::sqrt(x * x + y * y);
    const Lanes bent = select(cone.exposed > 0., cone.betas[0] * cone.force[kNormal] / size, 0.);
    const Wrench around = cone.around();
    for (int j = 0; j < 6; ++j) {
      const Lanes scaled = bent * around[j];
      for (int i = j; i < 6; ++i) bend.m[i][j] += scaled * around[i];
    }
  }
  bend.compute();
  Wrench free = difference(target_, missing_);
  bend.solve(free.at);
  for (int i = 0; i < 6; ++i) free[i] += missing_[i];
  // The same in the coordinates of the range.
  Wrench bent[6];
  Factors factors;
  Lanes coordinates[6];
  for (int j = 0; j < 6; ++j) {
    bent[j] = range_[j];
    bend.solve(bent[j].at);
    for (int i = j; i < 6; ++i) factors.m[i][j] = dot(range_[i], bent[j]);
    factors.m[j][j] += select(dot(range_[j], range_[j]) > 0., 0., 1.);
    coordinates[j] = dot(range_[j], free);
  }
  factors.compute();
  factors.solve(coordinates);
  for (int j = 0; j < 6; ++j) add(-coordinates[j], bent[j], free);
  return free;
}

// What is missing of the closest wrench, in the state at hand. Returns where that is certain.
Mask DualNewton::findMissing() {
  Mask turning = turn(Mask(true));
  Mask is_certain = findRange();
  Wrench projected = projectTarget();
  for (int i = 0; i < 6; ++i) stdx::where(!turning, missing_[i]) = projected[i];
  for (int step = 0; step < kTurns && stdx::any_of(turning); ++step) {
    const Wrench turned = findTurned();
    const Lanes change = norm(difference(turned, missing_));
    for (int i = 0; i < 6; ++i) stdx::where(turning, missing_[i]) = turned[i];
    turning = turning && change > kTurned;
    if (stdx::none_of(turning)) break;
    turn(turning);
    const Mask is_certain_now = findRange();
    is_certain = (turning && is_certain_now) || (!turning && is_certain);
  }
  return is_certain;
}

// From the state to the answer, without ε. Returns where there is one.
Mask DualNewton::finish(double spread) {
  expose();
  const Mask is_certain = findMissing();
  const Lanes distance = norm(missing_);
  is_reached_ = distance <= kReached;
  for (Lanes& number : missing_.at) stdx::where(is_reached_, number) = 0.;
  const Mask is_given = reach(difference(target_, missing_));
  return is_certain && is_given && (is_reached_ || distance >= kFar * spread) && provesItself();
}

// Where multipliers of both stages have the signs that they must have, and forces are in their
// cones: the conditions of Karush, Kuhn and Tucker of one contact, as DualNewton::provesItself() of
// dual_newton.cpp asks for them.
// @param terms  what forces and pulls are sums of, without signs
// @param costs  the largest of all forces
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
  if (cone.is_disc) {
    const double beta = cone.betas[0];
    const Lanes x = dot(cone.e[0], missing_), y = dot(cone.e[1], missing_);
    const Lanes pull_of_distance = stdx::sqrt(x * x + y * y);
    const Lanes pull = stdx::sqrt(cone.pull[0] * cone.pull[0] + cone.pull[1] * cone.pull[1]);
    const Lanes force = stdx::sqrt(cone.force[0] * cone.force[0] + cone.force[1] * cone.force[1]);
    const Lanes own_size = sizeOf(0) + sizeOf(1);
    const Lanes own_rounding = kRounding * (terms[0] + terms[1]);
    const Mask is_one = pull_of_distance > kFree * own_size;
    const Mask is_held = is_one && pull_of_distance >= kHeld * own_size;
    proven = proven && (!loaded || is_held || !is_one);
    const Mask is_bound = loaded && cone.held > 0., is_free = loaded && cone.held == 0.;
    proven = proven &&
             (!is_free || (!is_held && force <= beta * cone.force[kNormal] + kRounding * costs));
    const Lanes u = cone.bounds[0], v = cone.bounds[1];
    const Mask is_along_residual = cone.exposed > 0. && is_held && u * x + v * y > 0. &&
                                   stdx::abs(u * y - v * x) <= kParallel * pull_of_distance;
    const Mask is_along_pull =
        cone.exposed == 0. && !is_held &&
        u * cone.pull[0] + v * cone.pull[1] - beta * cone.force[kNormal] >= -own_rounding &&
        stdx::abs(u * cone.pull[1] - v * cone.pull[0]) <= own_rounding;
    proven = proven && (!is_bound || is_along_residual || is_along_pull);
    // Of what bears no load, it is the side on which it is bound.
    const Lanes along =
        select(is_held, (x * cone.pull[0] + y * cone.pull[1]) / pull_of_distance, pull);
    resistance_of_distance -= select(is_free, 0., beta * pull_of_distance);
    resistance -= select(is_free, 0., beta * along);
    size += beta * own_size;
    rounding += beta * own_rounding;
    largest_beta = std::max(largest_beta, beta);
  }
  for (int i = 0; i < cone.size; ++i) {
    if (i == kNormal || cone.isOfDisc(i)) continue;
    const double beta = cone.betas[i];
    const Lanes pull_of_distance = dot(cone.e[i], missing_), own_size = sizeOf(i);
    const Lanes own_rounding = kRounding * terms[i];
    const Lanes& force = cone.force[i];
    const Lanes& pull = cone.pull[i];
    const Mask is_one = stdx::abs(pull_of_distance) > kFree * own_size;
    const Mask is_held = is_one && stdx::abs(pull_of_distance) >= kHeld * own_size;
    // Of what bears no load, such a pull only says on which side it is bound.
    const Mask decides = loaded && Mask(beta > 0.);
    proven = proven && (!decides || is_held || !is_one);
    const Mask is_bound = decides && cone.bounds[i] != 0.;
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

// Where forces are inside of their cones, so that nothing else needs a proof.
Mask DualNewton::isInside() const {
  Mask inside(true);
  for (const Cone& cone : cones_) {
    if (!cone.is_there) continue;
    const Lanes& normal = cone.force[kNormal];
    Mask own = normal > 0.;
    for (int i = 0; i < cone.size; ++i)
      if (i != kNormal && !cone.isOfDisc(i))
        own = own && stdx::abs(cone.force[i]) <= cone.betas[i] * normal;
    if (cone.is_disc) {
      const Lanes most = cone.betas[0] * normal;
      own = own && cone.force[0] * cone.force[0] + cone.force[1] * cone.force[1] <= most * most;
    }
    inside = inside && (own || !cone.isPresent());
  }
  return inside;
}

Mask DualNewton::provesItself() const {
  Lanes costs = kRounding;  // of what bears nothing
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

Mask DualNewton::solveFreely(const Wrench& target) {
  target_ = target;
  is_reached_ = Mask(true);
  begin();
  assembleCompliance();
  const Factors factors = factorise(0.);
  for (int i = 0; i < 6; ++i)
    for (int j = 0; j < 6; ++j) range_[i][j] = i == j ? 1. : 0.;
  const Mask gives_all = factors.least_pivot > kFullRank * factors.largest_pivot;
  startFromNothing();
  for (int correction = 0; correction < kFreeCorrections; ++correction)
    approach(target, factors, Mask(true));
  const Mask is_given = norm(difference(target, achieved_)) <= kMissing;
  return gives_all && is_given && isInside();
}

Mask DualNewton::solve(const Wrench& target, double spread, int attempt) {
  target_ = target;
  mean_compliance_ = 0.;
  for (const Cone& cone : cones_)
    if (cone.is_there)
      for (int i = 0; i < cone.size; ++i) mean_compliance_ += dot(cone.e[i], cone.e[i]) / 6.;
  const Mask found =
      search(kSlacks[attempt][0] * mean_compliance_, kSlacks[attempt][1] * mean_compliance_);
  const Mask refined = attempt == 0 ? found : refine(found);
  return refined && finish(spread);
}

}  // namespace dynacom::lanes
