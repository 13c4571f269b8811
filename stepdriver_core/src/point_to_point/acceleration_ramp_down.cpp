#include "acceleration_ramp_down.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "moving_target.h"
#include "profile/position_range.h"

namespace stepdriver::motion {
namespace {

constexpr double kJerkRounding = 1e-9;

// The lowest jerk that takes the acceleration back before the speed falls to the start speed or
// rises to its maximum: a speed changes by a^2/(2 j) meanwhile.
double jerkToRampDown(const MotionState& from, const MotionLimits& limits) {
  const double speed = std::abs(from.velocity);
  const bool slows_down = from.velocity * from.acceleration < 0.0;
  if (slows_down && speed <= limits.start_speed) return 0.0;  // the axis can stop at once
  const double room = slows_down ? speed - limits.start_speed : limits.max_speed - speed;
  if (room <= 0.0) return std::numeric_limits<double>::infinity();
  return from.acceleration * from.acceleration / (2.0 * room);
}

}  // namespace

AccelerationRampDown::AccelerationRampDown(std::int64_t start_ns, const MotionState& from,
                                           const MotionLimits& limits, double most_jerk)
    : start_ns_(start_ns), end_(from), end_ns_(start_ns) {
  if (from.acceleration == 0.0 || limits.jerk == 0.0) return;
  const double most = most_jerk > 0.0 ? most_jerk : std::numeric_limits<double>::infinity();
  const double jerk = std::min(jerkToRampDown(from, limits), most);
  if (jerk <= limits.jerk * (1.0 + kJerkRounding)) return;
  const double size = std::abs(from.acceleration);
  const auto duration_ns = static_cast<std::int64_t>(size / jerk * 1e9);
  // A longer time would take the speed past its maximum: without a jerk limit, the acceleration may
  // be as high as any.
  if (duration_ns == 0) {
    end_.acceleration = 0.0;
    return;
  }
  end_ns_ += duration_ns;
  Piece piece;
  piece.duration = DoubleDouble(static_cast<double>(duration_ns)) / 1e9;
  piece.p0 = from.position;
  piece.v0 = from.velocity;
  piece.a = from.acceleration;
  piece.j = -from.acceleration / piece.duration.hi;
  pieces_.push_back(piece);
  end_ = endOf(pieces_, from);
  end_.acceleration = 0.0;
}

Plan AccelerationRampDown::followedBy(Plan rest) const {
  if (!isNeeded()) return rest;
  std::vector<Piece> pieces = pieces_;
  for (const Piece& piece : rest.profile.pieces()) pieces.push_back(piece);
  rest.profile = Profile(start_ns_, std::move(pieces));
  rest.overshoot = std::max(rest.overshoot, overshootOf(rest.profile));
  return rest;
}

}  // namespace stepdriver::motion
