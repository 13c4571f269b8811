#pragma once

#include <algorithm>
#include <cmath>

#include "acceleration_limited.h"
#include "jerk_limited_knots.h"

namespace stepdriver::motion {

/// The largest parts of their limits that the axes use, or 1.
struct LimitUsage {
  double speed = 1.0;
  double acceleration = 1.0;
  double jerk = 1.0;

  void include(const LimitUsage& other) {
    speed = std::max(speed, other.speed);
    acceleration = std::max(acceleration, other.acceleration);
    jerk = std::max(jerk, other.jerk);
  }
  double most() const { return std::max({speed, acceleration, jerk}); }
  /// The factor by which the motion has to be slower.
  double slowdown() const { return std::max({speed, std::sqrt(acceleration), std::cbrt(jerk)}); }
};

/// What the quintic between the states of two knots needs of an axis, anywhere in its duration [s].
LimitUsage usageOf(const JerkLimitedKnots::State& begin, const JerkLimitedKnots::State& end,
                   double duration, const TimingLimits& limits);

}  // namespace stepdriver::motion
