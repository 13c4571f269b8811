#pragma once

#include <cstddef>
#include <vector>

#include "motion/spline.h"

namespace stepdriver::motion {

/// All that planSpline() asks of its arguments.
/// @throw std::invalid_argument, std::range_error as it does.
void requirePlannable(const MotionState& from, const std::vector<Waypoint>& waypoints);

/// The same of the waypoints, and of where the motion begins.
void requireWaypoints(const std::vector<Waypoint>& waypoints);
void requireStart(const MotionState& from);

/// @param reach what the curve up to waypoint `index` may have in it [microsteps].
/// @throw std::invalid_argument where a double has no half microsteps there.
void requireReach(double reach, std::size_t index);

}  // namespace stepdriver::motion
