#pragma once

#include <cstdint>

#include "goal.h"
#include "point_to_point/motion_limits.h"
#include "point_to_point/planner.h"

namespace stepdriver::activity {

/// The motion for a setpoint, from a state of the axis at a motion time.
///
/// A position is joined as if it moved on at the velocity of the stream, and passed one period
/// after it came: then the next setpoint is there, and continues from that. If there is none, the
/// axis comes to rest on the last position. In any case it slows down when the timeout is over.
///
/// @param slack [microsteps] the part of the backlash that is taken up in the state `from`.
/// @param within the limits of the axis, with the highest speed.
/// @throw motion::TooLong if the motion takes too long.
motion::Plan planSetpoint(const axis::AxisModel& axis, const Goal& goal,
                          const motion::MotionState& from, double slack, std::int64_t at,
                          const motion::MotionLimits& within);

}  // namespace stepdriver::activity
