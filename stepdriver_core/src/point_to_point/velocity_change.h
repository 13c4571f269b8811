#pragma once

#include "end_state.h"
#include "motion_limits.h"
#include "phases.h"

namespace stepdriver::motion {

/// The fastest changes of velocity, from any velocity and acceleration at the end of a sequence of
/// phases.
///
/// Over a change in one direction the acceleration is a function of the velocity, and a jerk is the
/// slope of half its square: d(a^2/2)/dv = a da/dv = j. So in the plane of v and a^2/2 a phase of
/// constant jerk is a straight line of slope +-j, one of constant acceleration is level, and as the
/// time is the integral of dv/a, the fastest change is the highest curve that stays below the
/// limits and is nowhere steeper than the jerk: the lower envelope of a few lines. Its corners give
/// the phases; without a jerk limit only the level lines remain.
///
/// `End` is Phases, or an EndState of doubles or of DoubleDouble.

/// The velocity at which the acceleration reaches 0 as soon as the jerk allows.
template <typename End>
typename End::Real levelVelocity(const End& phases, const MotionLimits& limits);

/// Changes the velocity to `velocity`, with no acceleration there. An acceleration beyond the limit
/// is first reduced at the jerk limit.
template <typename End>
void changeVelocity(End& phases, typename End::Real velocity, const MotionLimits& limits);

/// The accelerations, against the motion, that a motion can have at its turning point. Jerk above
/// 0; the motion has the direction `-sign`, or will have it.
struct TurnRange {
  DoubleDouble softest;
  DoubleDouble hardest;  ///< turns the earliest; the motion back stays below the maximum speed
};
TurnRange turnRange(DoubleDouble v, DoubleDouble a, double sign, const MotionLimits& limits);

/// Reaches the turning point with an acceleration of that range, `sign * a_end`.
template <typename End>
void turn(End& phases, double sign, typename End::Real a_end, const MotionLimits& limits);

/// Comes to rest: to a velocity of 0, or to the start speed and from there at once to 0.
template <typename End>
void comeToRest(End& phases, const MotionLimits& limits);

/// Changes the velocity to the maximum in the direction `sign`. With a start speed, the motion
/// already has that direction, or is at most that fast.
template <typename End>
void changeToMaximum(End& phases, double sign, const MotionLimits& limits);

}  // namespace stepdriver::motion
