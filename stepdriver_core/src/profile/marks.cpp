#include "marks.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {
namespace {

// [s] A motion that ends nearer to a place than this is there: its end is a sum of rounded
// durations, and places are whole nanoseconds.
constexpr double kSamePlace = 0.25e-9;

// When a piece in which the speed is never below 0 has gone a way. The position at both ends and
// the speeds between them may miss that by a rounding, so the bracket decides.
double timeOfWay(const Piece& piece, double way) {
  double low = 0.0;
  double high = piece.duration.value();
  if (!(way > 0.0)) return low;
  const auto way_at = [&piece](double t) {
    return t * (piece.v0 + t * (piece.a / 2.0 + t * (piece.j / 6.0)));
  };
  const auto speed_at = [&piece](double t) {
    return piece.v0 + t * (piece.a + t * (piece.j / 2.0));
  };
  double t = piece.v0 > 0.0 ? std::min(way / piece.v0, high) : high;
  // 100 halvings reach the last bit even if each of Newton's steps leaves the bracket.
  for (int i = 0; i < 100; ++i) {
    const double error = way_at(t) - way;
    if (error == 0.0) return t;
    (error < 0.0 ? low : high) = t;
    double better = t - error / speed_at(t);
    if (!(better > low && better < high)) better = low + (high - low) / 2.0;
    if (better == t || std::abs(better - t) <= 2e-16 * high) return better;
    t = better;
  }
  return t;
}

// One step with all bits: a piece may last for days.
DoubleDouble refinedTime(const Piece& piece, DoubleDouble way, double rough) {
  const DoubleDouble t(rough);
  const double speed = piece.velocityAt(t).value();
  const double error = (way - (piece.positionAt(t) - piece.p0)).value();
  const double correction = speed > 0.0 ? error / speed : 0.0;
  // At a speed that is only a residual, rounding would be any time.
  return std::abs(correction) < 1e-6 ? t + DoubleDouble(correction) : t;
}

}  // namespace

std::optional<std::int64_t> timeAtPlace(const Profile& along, std::int64_t place_ns,
                                        std::size_t& piece) {
  const DoubleDouble place = secondsOf(place_ns);
  if (!(along.startPosition() < place)) return along.startNs();
  const std::size_t count = along.pieceCount();
  for (; piece < count; ++piece) {
    const Piece at = along.piece(piece);
    const DoubleDouble missing = place - at.positionAt(at.duration);
    const bool is_last = piece + 1 == count;
    if (missing.hi > 0.0 && !(is_last && missing.value() < kSamePlace)) continue;
    const DoubleDouble way = place - at.p0;
    DoubleDouble time = refinedTime(at, way, timeOfWay(at, way.value()));
    if (!(time.hi > 0.0)) time = 0.0;
    if (at.duration < time) time = at.duration;
    const Split ns = splitNanoseconds(along.pieceStart(piece) + time);
    const std::int64_t time_ns = along.startNs() + ns.whole + std::llrint(ns.rest);
    return std::min(time_ns, along.endNs());
  }
  return std::nullopt;
}

}  // namespace stepdriver::motion
