#pragma once

#include "motion/limits.h"
#include "path.h"

namespace stepdriver::motion {

/// The fastest way to rest from a velocity and an acceleration [microsteps].
struct Stop {
  DoubleDouble length;
  /// What the rounding of the velocity and the acceleration to doubles makes of the length. A
  /// target is met where it is no farther off. At most a thousandth of a microstep.
  double doubt = 0.0;
};
Stop stopFrom(DoubleDouble v, DoubleDouble a, const MotionLimits& limits);

/// A motion to rest, in two parts: the first lies where the motion begins, the second where it
/// ends.
struct Approach {
  Path path;
  std::size_t first_part = 0;  ///< phases of it
};

/// The fastest motion to rest over `length` from a velocity and an acceleration: it takes the
/// fastest change to the maximum speed, and leaves it for the fastest way to rest at the last
/// moment from which that ends where it should. (The control of a time-optimal motion is always at
/// one limit or another, and changes from one such arc to the next once.) The later it leaves, the
/// farther it comes, so there is one such moment; it is found by bracketing, in the phase in which
/// it lies.
///
/// Where there is a start speed, the motion is at most that fast or goes towards the end of
/// `length` and can rest there.
Approach approach(DoubleDouble v, DoubleDouble a, DoubleDouble length, const MotionLimits& limits);

}  // namespace stepdriver::motion
