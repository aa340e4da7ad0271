// SPDX-License-Identifier: BSD-2-Clause
#pragma once

#include <vector>

#include "lane_math.hpp"
#include "lanes.hpp"

namespace dynacom::lanes {

// Force and moment.
struct Wrench {
  Lanes at[6];

  Lanes& operator[](int i) { return at[i]; }
  const Lanes& operator[](int i) const { return at[i]; }
};

inline Lanes dot(const Wrench& a, const Wrench& b) {
  Lanes sum = a[0] * b[0];
  for (int i = 1; i < 6; ++i) sum += a[i] * b[i];
  return sum;
}
inline Lanes norm(const Wrench& a) { return stdx::sqrt(dot(a, a)); }
// sum += s a
inline void add(const Lanes& s, const Wrench& a, Wrench& sum) {
  for (int i = 0; i < 6; ++i) sum[i] += s * a[i];
}

// A contact's forces in units of their cost, x = W λ, within a box that grows with the normal
// force: |xᵢ| ≤ βᵢ x_z for all components but x_z itself, and x_z ≥ 0. Or the first two are within
// a disc, ‖(x₀, x₁)‖ ≤ β₀ x_z.
struct Cone {
  static constexpr int kNormal = 2;

  int size = 0;           // 3 or 6 components
  bool is_there = false;  // in any frame
  bool is_disc = false;
  double betas[6] = {};
  Wrench e[6];  // D NE W⁻¹ over its unit, by columns; zero where the contact is not there

  // Whether the contact bears a load, 1 or 0, and at which of its bounds a component is, 1 or −1,
  // or 0 at neither: that is what decides how forces respond to a pull. Without a load, bounds are
  // 0. Of a disc, the bounds are the direction in which it is held, if it is, 1 or 0: that turns
  // with the pull, so that forces respond along the circle, too, by `curve`.
  Lanes loaded, bounds[6];
  Lanes held = 0., curve = 0.;
  Lanes exposed = 0.;       // 1 if it is held by the residual, whose direction is that, and not by
                            // what it costs
  Lanes inverse_stiffness;  // 1 / ‖edge‖², of the direction in which x_z takes bounds along
  Lanes pull[6], force[6];  // eᵀ ν, and x
  // At the start of a step, and what that changes.
  Lanes start_loaded, start_held = 0., start_bounds[6], start_pull[6], pull_change[6];

  // Where it is there.
  Mask isPresent() const { return dot(e[kNormal], e[kNormal]) > 0.; }
  bool isOfDisc(int i) const { return is_disc && i < kNormal; }
  // 1 where a component responds on its own.
  Lanes isFree(int i) const { return isOfDisc(i) ? loaded - held : loaded - bounds[i] * bounds[i]; }
  // 1 where it can be given without the others. Held by what it costs, a disc has all of its sides.
  Lanes isGiven(int i) const { return isOfDisc(i) ? loaded - exposed : isFree(i); }
  Lanes edge(int i) const { return i == kNormal ? loaded : bounds[i] * betas[i]; }
  // Of a disc, that of a unit of force along the circle.
  Wrench around() const {
    Wrench wrench;
    for (int j = 0; j < 6; ++j) wrench[j] = bounds[0] * e[1][j] - bounds[1] * e[0][j];
    return wrench;
  }
};

// Both stages of a wrench distribution, as internal::DualNewton solves them, for as many problems
// as there are lanes. To know the state of the contacts,
//
//     minimise ½ ‖x‖² + ½ ‖r‖² / ε   subject to   e x + r = w,   x in the cones
//
// by Newton's method on the dual. Its gradient e x(ν) + ε ν − w is piecewise linear in the six
// multipliers ν = r / ε of the wrench, but for discs; within a state, it rises by e P eᵀ + ε, the
// compliance and ε, with P what x responds to a pull eᵀ ν. Each step is one of semismooth Newton
// methods (Qi and Sun, Mathematical Programming 58, 1993), with a length for which the dual falls.
// The forces follow from the state by equations without ε, linear but for discs: those of least
// cost among those that give the closest wrench, which is the target's projection on what the state
// can give. They are an answer only where they prove themselves.
//
// On discs, where directions turn, both are found by Newton's method, too (docs/algorithm.md): the
// residual r with the directions that it exposes, and the multipliers with those of what is held by
// its cost.
//
// Lanes share nothing but the time that they take: what one says does not depend on the others.
class DualNewton {
 public:
  static constexpr int kAttempts = 2;

  explicit DualNewton(const std::vector<Contact>& contacts);

  // Contacts, of which is_there and e are to be set before solve().
  std::vector<Cone>& cones() { return cones_; }

  // Finds the forces that give a wrench if no inequality holds them back.
  // @param target  D w over its unit
  // @returns where there is an answer
  Mask solveFreely(const Wrench& target);

  // The same if any do, and for the closest wrench.
  // @param spread   how far wrench weights are apart, the largest over the least
  // @param attempt  the first, 0, finds nearly all
  Mask solve(const Wrench& target, double spread, int attempt);

  // Of the answer: whether all of the target is given, and what is.
  const Mask& isReached() const { return is_reached_; }
  const Wrench& achieved() const { return achieved_; }

 private:
  // Along a step: the dual's slope and how that rises, and where the state is another than at its
  // start.
  struct Along {
    Lanes slope, curvature;
    Mask changed;
  };

  void begin();
  Mask search(const Lanes& first_slack, const Lanes& last_slack);
  Mask descend(const Lanes& first_slack, const Lanes& last_slack, Wrench gradient,
               const Mask& fresh, Mask searching);
  Mask refine(const Mask& found);
  Factors factorise(const Lanes& slack) const;
  Mask takeStep(const Wrench& change, const Wrench& gradient, const Lanes& slack,
                const Mask& is_free, Mask& searching);
  void startStep(const Wrench& change);
  Along followStep(const Lanes& length);
  void assembleCompliance();
  void sumUp();
  Mask findRange();
  Factors factoriseRange() const;
  Mask isHeld() const;
  void expose();
  Mask turn(const Mask& where);
  Mask findMissing();
  Wrench projectTarget() const;
  Wrench findTurned() const;
  void startFromNothing();
  void approach(const Wrench& wrench, const Factors& factors, const Mask& where);
  Mask reach(const Wrench& wrench);
  Mask finish(double spread);
  Mask isInside() const;
  void correct(const Wrench& change);
  Mask provesItself() const;
  Mask provesItself(const Cone& cone, const Lanes (&terms)[6], const Lanes& costs) const;

  std::vector<Cone> cones_;
  Wrench target_, multipliers_, achieved_;
  Lanes mean_compliance_, slack_;  // ε, of the last search
  Wrench missing_;                 // of the closest wrench
  Mask is_reached_;
  Lanes compliance_[6][6];  // the lower half
  Wrench range_[6];
  std::vector<Wrench> directions_;
};

}  // namespace dynacom::lanes
