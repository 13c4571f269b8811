#include "stepdriver_core/motion/trapezoid.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

namespace stepdriver::motion {
namespace {

// Way that a ramp between two speeds takes [microsteps].
DoubleDouble rampLength(double slow, double fast, double acceleration) {
  const DoubleDouble sum = DoubleDouble(fast) + DoubleDouble(slow);
  const DoubleDouble difference = DoubleDouble(fast) - DoubleDouble(slow);
  return sum * difference / DoubleDouble(2.0 * acceleration);
}

DoubleDouble rampTime(double slow, double fast, double acceleration) {
  return (DoubleDouble(fast) - DoubleDouble(slow)) / DoubleDouble(acceleration);
}

// The highest speed of a triangle, rounded down: a sliver of cruise fills what the rounding leaves,
// so that both ramps keep their exact lengths. The total time is stationary there: it loses
// nothing.
double trianglePeak(double length, double start, const TrapezoidLimits& limits) {
  constexpr double kRoundDown = 1.0 - 8.0 * std::numeric_limits<double>::epsilon();
  const double a = limits.acceleration;
  const double d = limits.deceleration;
  return std::sqrt(start * start + 2.0 * length * (a * (d / (a + d)))) * kRoundDown;
}

}  // namespace

Profile planTrapezoid(std::int64_t start_ns, std::int64_t from, std::int64_t to,
                      const TrapezoidLimits& limits) {
  if (from == to) return {start_ns, fromInteger(from)};
  const double sign = to > from ? 1.0 : -1.0;
  const DoubleDouble length = fromInteger(to > from ? to - from : from - to);
  const double start = std::min(limits.start_speed, limits.max_speed);
  const double peak =
      std::max(start, std::min(limits.max_speed, trianglePeak(length.hi, start, limits)));

  const DoubleDouble up = rampLength(start, peak, limits.acceleration);
  const DoubleDouble down = rampLength(start, peak, limits.deceleration);
  DoubleDouble cruise = length - up - down;
  if (cruise.hi < 0.0) cruise = 0.0;

  std::vector<Piece> pieces;
  pieces.reserve(3);
  const auto signed_length = [sign](DoubleDouble part) { return DoubleDouble(sign) * part; };
  if (peak > start) {
    pieces.push_back({rampTime(start, peak, limits.acceleration), fromInteger(from), sign * start,
                      sign * limits.acceleration, 0.0});
  }
  if (cruise.hi > 0.0) {
    pieces.push_back({cruise / DoubleDouble(peak), fromInteger(from) + signed_length(up),
                      sign * peak, 0.0, 0.0});
  }
  if (peak > start) {
    pieces.push_back({rampTime(start, peak, limits.deceleration),
                      fromInteger(to) - signed_length(down), sign * peak,
                      -sign * limits.deceleration, 0.0});
  }
  return {start_ns, std::move(pieces)};
}

Profile planStop(std::int64_t at_ns, const MotionState& state, const TrapezoidLimits& limits,
                 std::int64_t not_beyond) {
  const double speed = std::abs(state.velocity);
  const double slow = std::min(limits.start_speed, limits.max_speed);
  if (speed <= slow) return {at_ns, state.position};

  const double sign = state.velocity > 0.0 ? 1.0 : -1.0;
  const DoubleDouble shortest = rampLength(slow, speed, limits.deceleration);
  const Split nearest = split(state.position + DoubleDouble(sign) * shortest);
  std::int64_t rest = nearest.whole;
  if (sign * nearest.rest > 0.0) rest += static_cast<std::int64_t>(sign);
  rest = sign > 0.0 ? std::min(rest, not_beyond) : std::max(rest, not_beyond);

  const DoubleDouble length = DoubleDouble(sign) * (fromInteger(rest) - state.position);
  if (!(length.hi > 0.0)) return {at_ns, state.position};
  const DoubleDouble duration =
      DoubleDouble(2.0) * length / (DoubleDouble(speed) + DoubleDouble(slow));
  const double deceleration = ((DoubleDouble(speed) - DoubleDouble(slow)) / duration).value();
  return {at_ns, {{duration, state.position, state.velocity, -sign * deceleration, 0.0}}};
}

}  // namespace stepdriver::motion
