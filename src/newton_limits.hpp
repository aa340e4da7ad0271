// SPDX-License-Identifier: BSD-2-Clause
#pragma once

/// What Newton's method on the dual has in common for one problem and for those that lanes share:
/// plain numbers only, because lanes are compiled with other flags than all else. All of them are
/// for a problem whose weighted wrench has unit size.
namespace dynacom::newton {

// Along a step, what part of the slope at its start is as good as none.
constexpr double kFlat = 0.6;
// How often a step is cut, and how often until it is enough to have come to another state.
constexpr int kMaximalCuts = 30;
constexpr int kEasyCuts = 3;
// For which ratio of two lengths their middle is the geometric one.
constexpr double kFarApart = 4.;
// What part of the largest pivot of the compliance the least must be, so that the contacts give all
// wrenches, and nothing needs to be asked about the rank.
constexpr double kFullRank = 1e-6;
// Of a direction of the wrenches that the contacts give, what remains outside of the others: more
// than the first, it is one of its own, less than the second, it is rounding.
constexpr double kIndependent = 1e-5;
constexpr double kDependent = 1e-11;
// The distance from the closest wrench: more than the first, times how far wrench weights are
// apart, it has digits enough, less than the second, it is rounding.
constexpr double kFar = 1e-4;
constexpr double kReached = 1e-13;
// What an answer may lack.
constexpr double kMissing = 1e-12;
// By how much the signs of an answer may be wrong, beside the terms that make them up.
constexpr double kRounding = 1e-12;
// Of the distance, a multiplier that is not zero, and one that is.
constexpr double kHeld = 1e-8;
constexpr double kFree = 1e-12;
// By how much terms may be larger than the costs that they make up.
constexpr double kCancellation = 1e6;

}  // namespace dynacom::newton
