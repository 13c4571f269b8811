#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <random>

#include "point_to_point/motion_limits.h"
#include "profile/profile.h"

namespace stepdriver::motion {

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}

  double within(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(engine_);
  }
  double decades(double low, double high) { return std::pow(10.0, within(low, high)); }
  std::int64_t whole(std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(engine_);
  }
  bool chance(double probability) { return within(0.0, 1.0) < probability; }

 private:
  std::mt19937_64 engine_;
};

inline MotionLimits anyLimits(Random& random) {
  MotionLimits limits;
  limits.max_speed = random.decades(0.0, 5.0);
  limits.acceleration = limits.max_speed * random.decades(-1.5, 2.0);
  limits.deceleration = limits.acceleration * random.decades(-1.0, 1.0);
  if (random.chance(0.8)) limits.jerk = limits.acceleration * random.decades(-1.5, 2.5);
  if (random.chance(0.2)) limits.start_speed = limits.max_speed * random.within(0.0, 1.1);
  return limits;
}

inline MotionState anyState(Random& random, const MotionLimits& limits) {
  MotionState state;
  state.position = DoubleDouble(random.within(-1000.0, 1000.0), random.within(-1e-14, 1e-14));
  state.velocity = limits.max_speed * random.within(-1.5, 1.5);
  if (random.chance(0.1)) state.velocity = 0.0;
  if (random.chance(0.1)) state.velocity = std::copysign(limits.max_speed, state.velocity);
  const double limit = std::max(limits.acceleration, limits.deceleration);
  state.acceleration = limit * random.within(-1.2, 1.2);
  if (random.chance(0.3)) state.acceleration = 0.0;
  if (random.chance(0.1)) state.acceleration = std::copysign(limits.deceleration, -state.velocity);
  return state;
}

inline std::int64_t anyTarget(Random& random, const MotionState& state,
                              const MotionLimits& limits) {
  const double v = std::max(std::abs(state.velocity), limits.max_speed);
  const double braking = v * v / limits.deceleration;
  const double way = random.chance(0.3) ? random.within(-3.0, 3.0)
                                        : random.within(-3.0, 3.0) * std::min(braking, 1e12);
  return std::llround(state.position.hi + way);
}

inline std::ostream& operator<<(std::ostream& out, const MotionLimits& limits) {
  out.precision(17);
  return out << "limits {" << limits.start_speed << ", " << limits.max_speed << ", "
             << limits.acceleration << ", " << limits.deceleration << ", " << limits.jerk << "}";
}

inline std::ostream& operator<<(std::ostream& out, const MotionState& state) {
  out.precision(17);
  return out << "state {" << state.position.hi << ", " << state.velocity << ", "
             << state.acceleration << "}";
}

}  // namespace stepdriver::motion
