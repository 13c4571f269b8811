#pragma once

#include <cstdint>

#include "motion/profile.h"

namespace stepdriver::motion {

/// How fast the rate may change at which a course is run through.
struct RateLimits {
  double slope = 0.0;  ///< [1/s]
  double jerk = 0.0;   ///< [1/s^2] of the slope; 0: none, the slope may jump
};

/// How a course is run through from now on, s(t) in seconds of the course, as composeAlong() takes
/// it: at the rate of now for a time, then with the fastest change that the limits allow to another
/// rate, and on at that to the course's end; at a rate of 0 to rest.
///
/// The rate stays from 0 to 1: where there is a jerk limit, a slope of now that it could not end
/// before is ended by as much more as that takes, first of all.
///
/// @param from the place [s], the rate and its slope [1/s] of now. Without a jerk limit the slope
///   doesn't count.
/// @param after [s] how long it stays at the rate of now.
/// @param end [s] the place of the course's end.
/// @pre rates from 0 to 1
Profile planRate(std::int64_t start_ns, const MotionState& from, double rate,
                 const RateLimits& limits, double after, DoubleDouble end);

}  // namespace stepdriver::motion
