#pragma once

#include <cstddef>
#include <vector>

#include "spline.h"

namespace stepdriver::motion {

/// Checks everything that planSpline() requires of its arguments.
/// @throw motion::Malformed, motion::TooLong as planSpline().
void requirePlannable(const MotionState& from, const std::vector<Waypoint>& waypoints);

/// The same checks for the waypoints alone, and for the beginning of the motion alone.
void requireWaypoints(const std::vector<Waypoint>& waypoints);
void requireStart(const MotionState& from);

/// @param reach [microsteps] a bound of the curve up to waypoint `index`.
/// @throw motion::Malformed if a double has no half microsteps there.
void requireReach(double reach, std::size_t index);

}  // namespace stepdriver::motion
