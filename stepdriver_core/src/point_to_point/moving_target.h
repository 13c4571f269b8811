#pragma once

#include <vector>

#include "motion_limits.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// A point that moves at a constant velocity.
struct MovingTarget {
  DoubleDouble position;  ///< [microsteps] when the motion begins
  double velocity = 0.0;  ///< [microsteps/s]
};

/// Joins a moving point: the motion ends at its position and with its velocity, without
/// acceleration. Seen from the point, this is a move to rest, and the plan of such a move plus the
/// motion of the point is again a sequence of cubic pieces. The speed is at most max_speed, apart
/// from a higher one at the beginning. The acceleration is at most the lower one of acceleration
/// and deceleration, because a change of speed as seen from the point may be either. The start
/// speed is not used.
///
/// @param within [s] If the fastest motion takes less, a lower acceleration is used, so that it
///   takes up to about this time: small corrections are then smooth.
/// @return empty if the motion is there already. @pre |point.velocity| < max_speed
std::vector<Piece> planIntercept(const MotionState& from, const MovingTarget& point,
                                 const MotionLimits& limits, double within);

/// The state at the end of pieces; `from` if there are none.
MotionState endOf(const std::vector<Piece>& pieces, const MotionState& from);

/// The part of the pieces in the first `seconds`.
std::vector<Piece> firstPart(std::vector<Piece> pieces, DoubleDouble seconds);

}  // namespace stepdriver::motion
