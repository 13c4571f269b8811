#include "moving_target.h"

#include <algorithm>
#include <cmath>

#include "planner.h"

namespace stepdriver::motion {
namespace {

// The smallest acceleration for a correction, as a part of the limit.
constexpr double kSoftest = 0.02;
constexpr double kSpeedRounding = 1e-9;  // relative to the speed

// The motion as seen from the point.
Profile relativeMove(const MotionState& from, const MovingTarget& point, const MotionLimits& limits,
                     double highest, double softness) {
  MotionLimits seen;
  seen.max_speed = highest;
  seen.acceleration = std::min(limits.acceleration, limits.deceleration) * softness;
  seen.deceleration = seen.acceleration;
  seen.jerk = limits.jerk;
  const MotionState start{from.position - point.position, from.velocity - point.velocity,
                          from.acceleration};
  return planMove(0, start, 0, seen).profile;
}

// The motion of a profile plus that of the point.
std::vector<Piece> withPoint(const Profile& seen, const MovingTarget& point) {
  std::vector<Piece> pieces;
  pieces.reserve(seen.pieceCount());
  DoubleDouble time;
  for (Piece piece : seen.pieces()) {
    piece.p0 = piece.p0 + point.position + time * point.velocity;
    const DoubleDouble velocity = exactSum(piece.v0, point.velocity);
    piece.v0 = velocity.hi;
    piece.v0_rest += velocity.lo;
    time = time + piece.duration;
    pieces.push_back(piece);
  }
  return pieces;
}

double highestSpeed(const std::vector<Piece>& pieces) {
  double highest = 0.0;
  for (const Piece& piece : pieces) {
    highest =
        std::max({highest, std::abs(piece.v0), std::abs(piece.velocityAt(piece.duration).value())});
    // Inside a piece the speed has an extreme where the acceleration is 0.
    const double level = piece.j != 0.0 ? -piece.a / piece.j : -1.0;
    if (level > 0.0 && level < piece.duration.hi) {
      highest = std::max(highest, std::abs(piece.velocityAt(level).value()));
    }
  }
  return highest;
}

}  // namespace

std::vector<Piece> planIntercept(const MotionState& from, const MovingTarget& point,
                                 const MotionLimits& limits, double within) {
  const double away = (from.position - point.position).hi;
  const double spare = limits.max_speed - std::abs(point.velocity);
  // The point leaves a motion behind it at its own speed, and comes towards one that is ahead.
  const bool behind = away * point.velocity < 0.0;
  double highest = behind ? spare : limits.max_speed + std::abs(point.velocity);
  const double allowed =
      std::max(limits.max_speed, std::abs(from.velocity)) * (1.0 + kSpeedRounding);
  const auto join = [&](double softness) {
    std::vector<Piece> pieces =
        withPoint(relativeMove(from, point, limits, highest, softness), point);
    if (highestSpeed(pieces) <= allowed) return pieces;
    return withPoint(relativeMove(from, point, limits, spare, softness), point);
  };
  std::vector<Piece> fastest = join(1.0);
  double duration = 0.0;
  for (const Piece& piece : fastest) duration += piece.duration.hi;
  if (fastest.empty() || duration >= within) return fastest;
  return join(std::max(duration / within, kSoftest));
}

MotionState endOf(const std::vector<Piece>& pieces, const MotionState& from) {
  if (pieces.empty()) return from;
  const Piece& last = pieces.back();
  return {last.positionAt(last.duration), last.velocityAt(last.duration).value(),
          last.accelerationAt(last.duration).value()};
}

std::vector<Piece> firstPart(std::vector<Piece> pieces, DoubleDouble seconds) {
  std::vector<Piece> part;
  for (Piece& piece : pieces) {
    if (!(seconds.hi > 0.0)) break;
    if (seconds < piece.duration) piece.duration = seconds;
    seconds = seconds - piece.duration;
    part.push_back(piece);
  }
  return part;
}

}  // namespace stepdriver::motion
