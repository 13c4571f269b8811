#include "feed_deceleration.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "feed_rate.h"
#include "math/double_double.h"

namespace stepdriver::motion {
namespace {

constexpr double kGentlerSlope = 0.9;
constexpr int kSlopeTries = 20;

// [1/s] The steepest fall of the rate that a motor allows at a place.
double steepestAt(const LimitedCurve& curve, DoubleDouble place, double rate) {
  const MotionState state = curve.curve->stateAt(splitNanoseconds(place).whole);
  const double speed = std::abs(state.velocity);
  const double with = std::copysign(state.acceleration, state.acceleration * state.velocity);
  const double room = curve.bounds.acceleration + with * rate * rate;
  return kSteepestSlope * speed <= room ? kSteepestSlope : std::max(room, 0.0) / speed;
}

// How the rate falls in a slice, at most to a lower rate.
struct Fall {
  DoubleDouble from;
  double to = 0.0;
  double slice = 0.0;

  bool endsWith(double slope) const { return (from - DoubleDouble(to)).value() <= slope * slice; }
  Piece piece(DoubleDouble place, double slope) const {
    const DoubleDouble duration =
        endsWith(slope) ? (from - DoubleDouble(to)) / DoubleDouble(slope) : DoubleDouble(slice);
    return {duration, place, from.hi, -slope, 0.0, from.lo};
  }
};

// The steepest slope that all motors allow in the whole slice.
double steepestSlope(const std::vector<LimitedCurve>& curves, DoubleDouble place,
                     const Fall& fall) {
  double slope = kSteepestSlope;
  const auto limit_at = [&](DoubleDouble there, double rate_there) {
    for (const LimitedCurve& curve : curves) {
      slope = std::min(slope, steepestAt(curve, there, rate_there));
    }
  };
  limit_at(place, fall.from.value());
  const Piece first = fall.piece(place, slope);
  limit_at(first.positionAt(first.duration), first.velocityAt(first.duration).value());
  for (int i = 0; i < kSlopeTries; ++i, slope *= kGentlerSlope) {
    if (staysWithin(curves, fall.piece(place, slope))) return slope;
  }
  return 0.0;
}

}  // namespace

bool staysWithin(const std::vector<LimitedCurve>& curves, const Piece& piece) {
  const Profile path(0, {piece});
  return std::all_of(curves.begin(), curves.end(), [&](const LimitedCurve& curve) {
    return staysWithin(*curve.curve, path, curve.bounds);
  });
}

void keepToTheEnd(std::vector<Piece>& pieces, DoubleDouble place, double rate, DoubleDouble end) {
  if (rate > 0.0) pieces.push_back({(end - place) / DoubleDouble(rate), place, rate, 0.0, 0.0});
}

std::optional<Profile> planFeedDeceleration(std::int64_t start_ns, const MotionState& from,
                                            double rate, const std::vector<LimitedCurve>& curves,
                                            double slice, double most, DoubleDouble end) {
  std::vector<Piece> pieces;
  DoubleDouble place = from.position;
  Fall fall{from.velocity, rate, slice};
  for (double time = 0.0; time < most; time += slice) {
    if (!(place + fall.from * DoubleDouble(slice) < end)) return std::nullopt;
    const double slope = steepestSlope(curves, place, fall);
    const Piece& piece = pieces.emplace_back(fall.piece(place, slope));
    place = piece.positionAt(piece.duration);
    if (fall.endsWith(slope)) {
      if (time + piece.duration.value() >= most) return std::nullopt;
      keepToTheEnd(pieces, place, rate, end);
      return Profile(start_ns, std::move(pieces));
    }
    fall.from = piece.velocityAt(piece.duration);
  }
  return std::nullopt;
}

}  // namespace stepdriver::motion
