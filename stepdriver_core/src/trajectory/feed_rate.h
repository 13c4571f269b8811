#pragma once

#include <cstdint>

#include "profile/profile.h"

namespace stepdriver::motion {

/// [1/s] No rate changes faster, however slow the motors are: from full rate to 0 in a millisecond.
constexpr double kSteepestSlope = 1000.0;

/// The limits for changes of the rate along a course.
struct RateLimits {
  double slope = 0.0;  ///< [1/s]
  double jerk = 0.0;   ///< [1/s^2] of the slope; 0: no limit, the slope may jump
};

/// The path s(t) along a course, in seconds of the course, for composeAlong(): it keeps the current
/// rate for a time, then changes to another rate as fast as the limits allow, and keeps that rate
/// to the course's end; a rate of 0 comes to rest.
///
/// The rate stays between 0 and 1: if a jerk limit wouldn't let the current slope end in time, the
/// jerk is raised first, by as much as that takes.
///
/// @param from the current position [s], rate and slope of the rate [1/s]. Without a jerk limit the
///   slope doesn't count.
/// @param after [s] how long it keeps the current rate.
/// @param end [s] the end of the course.
/// @pre rates from 0 to 1
Profile planRate(std::int64_t start_ns, const MotionState& from, double rate,
                 const RateLimits& limits, double after, DoubleDouble end);

}  // namespace stepdriver::motion
