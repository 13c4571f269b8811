#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "feed_deceleration.h"

namespace stepdriver::motion {

/// The same as planFeedDeceleration() if motors have jerk limits: the slope of the rate has no
/// jump, and its jerk is constant during each slice.
///
/// The slope has to end by the time at which the lower rate is reached. So in each slice the rate
/// falls more and more steeply, as far as all motors keep to their limits, and as after it the
/// slope could still be ended within them: then the axes could continue at that rate, which needs
/// less of each limit than a higher one. Of the slices at whose end the slope can be ended exactly
/// at the lower rate, the one is taken with which that is reached first.
///
/// @param from the current position [s], rate and slope of the rate [1/s]
/// @return nothing also if the rate is rising.
std::optional<Profile> planJerkLimitedFeedDeceleration(std::int64_t start_ns,
                                                       const MotionState& from, double rate,
                                                       const std::vector<LimitedCurve>& curves,
                                                       double slice, double most, DoubleDouble end);

}  // namespace stepdriver::motion
