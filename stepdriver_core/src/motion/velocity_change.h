#pragma once

#include "motion/limits.h"
#include "path.h"

namespace stepdriver::motion {

/// The fastest changes of velocity, from whatever velocity and acceleration a path has come to.
///
/// Over a change in one direction the acceleration is a function of the velocity, and a jerk is the
/// slope of half its square: d(a^2/2)/dv = a da/dv = j. So in the plane of v and a^2/2 a phase of
/// constant jerk is a straight line of slope +-j, one of constant acceleration is level, and as the
/// time is the integral of dv/a, the fastest change is the highest curve that keeps below the
/// limits and is nowhere steeper than the jerk: the lower envelope of a few lines. Its corners give
/// the phases; without a jerk limit only the levels remain.

/// The velocity at which the acceleration comes to 0 as soon as the jerk allows.
DoubleDouble levelVelocity(const Path& path, const MotionLimits& limits);

/// Changes the velocity to `velocity`, with no acceleration there. An acceleration beyond the limit
/// is brought back at the jerk limit first.
void changeVelocity(Path& path, DoubleDouble velocity, const MotionLimits& limits);

/// The accelerations, away from the motion, that a motion which turns round can have at its turning
/// point. Jerk above 0; the motion has the direction `-sign`, or will have.
struct TurnRange {
  DoubleDouble softest;
  DoubleDouble hardest;  ///< turns the earliest; the way back stays below the maximum speed
};
TurnRange turnRange(const Path& path, double sign, const MotionLimits& limits);

/// Comes to the turning point with an acceleration of that range, `sign * a_end`.
void turn(Path& path, double sign, DoubleDouble a_end, const MotionLimits& limits);

/// Comes to rest: to no velocity, or to the start speed and then at once to none.
void comeToRest(Path& path, const MotionLimits& limits);

/// Changes the velocity to the maximum in the direction `sign`. Where there is a start speed the
/// motion has that direction already, or is at most that fast.
void changeToMaximum(Path& path, double sign, const MotionLimits& limits);

double startSpeed(const MotionLimits& limits);

}  // namespace stepdriver::motion
