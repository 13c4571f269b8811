#pragma once

#include <vector>

#include "profile/profile.h"
#include "spline.h"

namespace stepdriver::motion {

/// What interpolate() keeps continuous at a waypoint that gives only a position.
enum class Smoothness {
  kAcceleration,  ///< cubics of the smallest integral of the squared acceleration
  kJerk,          ///< quintics of the smallest integral of the squared jerk
};

/// Gives a velocity to each waypoint without one and, for kJerk, an acceleration. The last waypoint
/// gets 0 and, if one has no velocity, the restingCount() of its position. At the others, the curve
/// of planSpline() for the result
/// - has a continuous acceleration (kAcceleration): the cubic spline with given end slopes of
///   C. de Boor, A Practical Guide to Splines, chapter IV. For slopes m = (p1 - p0)/T of the two
///   segments, v- /T- + 2 v (1/T- + 1/T+) + v+ /T+ = 3 (m- /T- + m+ /T+);
/// - has a continuous jerk and snap (kJerk): the quintic spline, whose third and fourth derivatives
///   at the ends of a segment follow from c3, c4 and c5 (docs/motion.md).
/// Of all curves through the positions, these have the smallest integral of the squared
/// acceleration or jerk (Holladay's theorem and its form for quintics). Between two waypoints the
/// curve can lie beyond both.
///
/// Waypoints with velocities stay as they are, and separate the curves. An acceleration without a
/// velocity doesn't count. Takes time in proportion to the number of waypoints.
///
/// @param from the state at time 0; it replaces a first of several waypoints at time 0.
/// @pre planSpline() accepts the arguments.
std::vector<Waypoint> interpolate(const MotionState& from, std::vector<Waypoint> waypoints,
                                  Smoothness smoothness);

}  // namespace stepdriver::motion
