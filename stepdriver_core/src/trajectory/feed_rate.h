#pragma once

#include <cstdint>

#include "profile/profile.h"

namespace stepdriver::motion {

/// [1/s] No rate changes faster, however slow the motors are: from full rate to 0 in a millisecond.
constexpr double kSteepestSlope = 1000.0;

/// [1/s^2] No slope of a rate changes faster: from 0 to kSteepestSlope in a millisecond.
constexpr double kSteepestJerk = kSteepestSlope * kSteepestSlope;

/// The limits for changes of the rate along a curve.
struct FeedRateLimits {
  double slope = 0.0;  ///< [1/s]
  /// [1/s^2] the limit for the change of the slope; 0: no limit, the slope may jump.
  double jerk = 0.0;
};

/// The path s(t) along a curve, in seconds of the curve, for composeAlong(): it keeps the current
/// rate for a time, then changes to another rate as fast as the limits allow, and keeps that rate
/// to the curve's end; a rate of 0 comes to rest.
///
/// The rate stays between 0 and 1: if a jerk limit wouldn't let the current slope end in time, the
/// jerk is raised first, by as much as that takes.
///
/// @param from the current position [s], rate and slope of the rate [1/s]. Without a jerk limit the
///   slope doesn't count.
/// @param after [s] how long it keeps the current rate.
/// @param end [s] the end of the curve.
/// @pre rates from 0 to 1
Profile planFeedRate(std::int64_t start_ns, const MotionState& from, double rate,
                     const FeedRateLimits& limits, double after, DoubleDouble end);

}  // namespace stepdriver::motion
