#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "feed_deceleration.h"

namespace stepdriver::motion {

/// The same as planFeedDeceleration() for motors with jerk limits: the slope of the rate never
/// jumps, and its jerk is constant during each slice.
///
/// The slope has to be 0 when the lower rate is reached. In each slice the rate therefore falls
/// more and more steeply, as long as all motors keep to their limits and the slope can still be
/// ended within them afterwards. The axes could then continue at the rate that is reached, which
/// needs less of each limit than a higher one. Several slices may have an end from which the slope
/// can be ended exactly at the lower rate; the one that reaches this rate first is used.
///
/// @param from the current position [s], rate and slope of the rate [1/s]
/// @return nothing also if the rate is rising.
std::optional<Profile> planJerkLimitedFeedDeceleration(std::int64_t start_ns,
                                                       const MotionState& from, double rate,
                                                       const std::vector<LimitedCurve>& curves,
                                                       double slice, double most, DoubleDouble end);

}  // namespace stepdriver::motion
