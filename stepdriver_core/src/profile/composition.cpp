#include "composition.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "double_piece.h"
#include "hermite_cubic.h"
#include "math/root_finding.h"
#include "negligible_time.h"

namespace stepdriver::motion {
namespace {

constexpr int kSlices = 8;  // the points of a part at which the limits are checked

DoubleDouble velocityOf(const Piece& piece) { return {piece.v0, piece.v0_rest}; }
DoubleDouble accelerationOf(const Piece& piece) { return {piece.a, piece.a_rest}; }

bool hasConstantRate(const Piece& path) { return path.a == 0.0 && path.j == 0.0; }

// A part of a piece of a curve, and the corresponding part of a piece of the path.
struct Part {
  Piece curve;
  DoubleDouble from;  // the place s in the curve's piece
  Piece path;
  DoubleDouble begin;  // [s] the time in the path's piece
  DoubleDouble end;
  DoubleDouble length;  // the distance along s

  DoubleDouble placeAt(DoubleDouble t) const {
    return from + (path.positionAt(t) - path.positionAt(begin));
  }
};

// An upper bound of |d^4 q(s(t))/dt^4|.
double largestFourthDerivative(const Part& part) {
  const DoublePiece path(part.path);
  const DoublePiece curve(part.curve);
  const double begin = part.begin.value();
  const double end = part.end.value();
  const double rate = path.highestSpeed(begin, end);
  const double slope = path.highestAcceleration(begin, end);
  const double acceleration =
      curve.highestAcceleration(part.from.value(), (part.from + part.length).value());
  return acceleration * (3.0 * slope * slope + 4.0 * rate * std::abs(path.j)) +
         6.0 * std::abs(curve.j) * slope * rate * rate;
}

void appendCubics(std::vector<Piece>& pieces, const Part& part) {
  const DoubleDouble duration = part.end - part.begin;
  const double count = cubicsFor(duration.value(), largestFourthDerivative(part), kComposeError);
  const DoubleDouble slice = duration / DoubleDouble(count);
  const auto state = [&](double k) {
    const DoubleDouble t = part.begin + DoubleDouble(k) * slice;
    const DoubleDouble s = part.placeAt(t);
    return std::pair{part.curve.positionAt(s),
                     (part.curve.velocityAt(s) * part.path.velocityAt(t)).value()};
  };
  auto from = state(0.0);
  for (double k = 1.0; k <= count; ++k) {
    const auto to = state(k);
    pieces.push_back(cubic(slice, from.first, from.second, to.first, to.second));
    from = to;
  }
}

// The time at which a piece of the path has covered a distance, as exactly as a double can be. The
// path only goes forwards, so Newton's method is used, within a bracket.
double roughTimeTo(const DoublePiece& path, double way) {
  double low = 0.0;
  double high = path.duration;
  double t = path.v0 > 0.0 ? std::min(high, way / path.v0) : high / 2.0;
  for (int i = 0; i < 100; ++i) {
    const double error = path.displacement(t) - way;
    if (error == 0.0) return t;
    (error < 0.0 ? low : high) = t;
    double better = t - error / path.velocity(t);
    if (!(better > low && better < high)) better = low + (high - low) / 2.0;
    if (std::abs(better - t) <= 2e-16 * high) return better;
    t = better;
  }
  return t;
}

// The time from the beginning of a piece of the path at which it has covered a distance.
DoubleDouble timeTo(const Piece& path, DoubleDouble way) {
  if (path.j != 0.0) {
    // Two steps of Newton's method give all bits, unless the path is nearly at rest there.
    const DoublePiece rough(path);
    const double near = roughTimeTo(rough, way.value());
    if (rough.velocity(near) > 1e-3) {
      DoubleDouble t = near;
      for (int i = 0; i < 2; ++i) {
        t = t + (way - (path.positionAt(t) - path.p0)) / path.velocityAt(t);
      }
      return t;
    }
    const auto left = [&](DoubleDouble t) { return way - (path.positionAt(t) - path.p0); };
    return rootOf(left, path.duration.value());
  }
  const DoubleDouble rate = velocityOf(path);
  // The stable form gives the first one of the two roots.
  const DoubleDouble under = rate * rate + DoubleDouble(2.0) * accelerationOf(path) * way;
  const DoubleDouble root = under.hi > 0.0 ? sqrt(under) : DoubleDouble();
  return DoubleDouble(2.0) * way / (rate + root);
}

// The motion along the curve during a piece of the path whose rate changes.
std::vector<Piece> cubicsAlong(const Profile& curve, const Piece& stretch) {
  std::vector<Piece> pieces;
  const DoubleDouble end = stretch.positionAt(stretch.duration);
  std::size_t index = curve.pieceAt(stretch.p0);
  DoubleDouble s = stretch.p0;
  DoubleDouble t;
  while ((stretch.duration - t).hi > kNegligibleTime) {
    while (index + 1 < curve.pieceCount() &&
           !((curve.pieceStart(index + 1) - s).hi > kNegligibleTime)) {
      ++index;
    }
    const DoubleDouble knot = curve.pieceStart(index + 1);
    const bool ends_here = index + 1 == curve.pieceCount() || !(knot < end);
    const DoubleDouble next = ends_here ? end : knot;
    const DoubleDouble until = ends_here ? stretch.duration : timeTo(stretch, next - stretch.p0);
    appendCubics(pieces,
                 {curve.piece(index), s - curve.pieceStart(index), stretch, t, until, next - s});
    s = next;
    t = until;
  }
  return pieces;
}

// The same parts, for checking the limits.
struct RoughPart {
  DoublePiece curve;
  double from;
  double length;
  DoublePiece path;
  double begin;
  double end;

  bool keeps(const MotorBounds& bounds) const {
    if (surelyKeeps(bounds)) return true;
    for (int i = 0; i <= kSlices; ++i) {
      if (!keepsAt(begin + i * ((end - begin) / kSlices), bounds)) return false;
    }
    return true;
  }

 private:
  // Uses the largest value of each factor anywhere in the part.
  bool surelyKeeps(const MotorBounds& bounds) const {
    const double to = from + length;
    const double q1 = curve.highestSpeed(from, to);
    const double q2 = curve.highestAcceleration(from, to);
    const double s1 = path.highestSpeed(begin, end);
    const double s2 = path.highestAcceleration(begin, end);
    if (q2 * s1 * s1 + q1 * s2 > bounds.acceleration) return false;
    const double jerk =
        std::abs(curve.j) * s1 * s1 * s1 + 3.0 * q2 * s1 * s2 + q1 * std::abs(path.j);
    return bounds.jerk == 0.0 || jerk <= bounds.jerk;
  }

  bool keepsAt(double t, const MotorBounds& bounds) const {
    const double s = from + (path.displacement(t) - path.displacement(begin));
    const double q1 = curve.velocity(s);
    const double q2 = curve.acceleration(s);
    const double s1 = path.velocity(t);
    const double s2 = path.acceleration(t);
    const double acceleration = q2 * s1 * s1 + q1 * s2;
    const double jerk = curve.j * s1 * s1 * s1 + 3.0 * q2 * s1 * s2 + q1 * path.j;
    return std::abs(acceleration) <= bounds.acceleration &&
           (bounds.jerk == 0.0 || std::abs(jerk) <= bounds.jerk);
  }
};

bool staysWithin(const Profile& curve, const Piece& stretch, const MotorBounds& bounds) {
  const DoublePiece path(stretch);
  const double length = (stretch.positionAt(stretch.duration) - stretch.p0).value();
  double t = 0.0;
  double way = 0.0;  // the distance along the path from the beginning of the stretch
  for (std::size_t index = curve.pieceAt(stretch.p0);; ++index) {
    const bool last = index + 1 == curve.pieceCount();
    const double knot = (curve.pieceStart(index + 1) - stretch.p0).value();
    const bool ends_here = last || !(knot < length);
    if (!ends_here && knot - way <= kNegligibleTime) continue;
    const double next = ends_here ? length : knot;
    const double until = ends_here ? path.duration : roughTimeTo(path, next);
    const double from = way + (stretch.p0 - curve.pieceStart(index)).value();
    const RoughPart part{DoublePiece(curve.piece(index)), from, next - way, path, t, until};
    if (!part.keeps(bounds)) return false;
    if (ends_here) return true;
    way = next;
    t = until;
  }
}

}  // namespace

Profile scaled(const Profile& path, DoubleDouble origin, DoubleDouble scale) {
  if (path.pieces().empty()) return {path.startNs(), origin + scale * path.endPosition()};
  std::vector<Piece> pieces;
  pieces.reserve(path.pieces().size());
  for (const Piece& piece : path.pieces()) {
    const DoubleDouble velocity = scale * velocityOf(piece);
    const DoubleDouble acceleration = scale * accelerationOf(piece);
    pieces.push_back({piece.duration, origin + scale * piece.p0, velocity.hi, acceleration.hi,
                      (scale * piece.j).value(), velocity.lo, acceleration.lo});
  }
  return {path.startNs(), std::move(pieces)};
}

Profile composeAlong(const std::shared_ptr<const Profile>& curve, const Profile& path) {
  Sections sections;
  for (const Piece& stretch : path.pieces()) {
    // A rest on the path has a duration that isn't that of any part of the curve.
    if (hasConstantRate(stretch) && stretch.v0 > 0.0) {
      const DoubleDouble end = stretch.positionAt(stretch.duration);
      sections.add(Excerpt{curve, stretch.p0, end, velocityOf(stretch)});
    } else {
      sections.add(cubicsAlong(*curve, stretch));
    }
  }
  if (sections.empty()) {
    const std::int64_t s_ns = splitNanoseconds(path.endPosition()).whole;
    return {path.startNs(), curve->stateAt(curve->startNs() + s_ns).position};
  }
  return {path.startNs(), std::move(sections)};
}

bool staysWithin(const Profile& curve, const Profile& path, const MotorBounds& bounds) {
  for (const Piece& stretch : path.pieces()) {
    if (!hasConstantRate(stretch) && !staysWithin(curve, stretch, bounds)) return false;
  }
  return true;
}

}  // namespace stepdriver::motion
