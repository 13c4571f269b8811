#include "stepdriver_core/motion/along.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "hermite.h"
#include "root.h"

namespace stepdriver::motion {
namespace {

constexpr double kNoTime = 1e-15;  // s
constexpr int kSlices = 8;         // of a part, to look at

DoubleDouble velocityOf(const Piece& piece) { return {piece.v0, piece.v0_rest}; }
DoubleDouble accelerationOf(const Piece& piece) { return {piece.a, piece.a_rest}; }

// A part of a piece of a course, and the part of a piece of the path that runs through it.
struct Part {
  const Piece& course;
  DoubleDouble from;  // s in the course's piece
  const Piece& path;
  DoubleDouble begin;  // t in the path's piece
  DoubleDouble end;
  DoubleDouble length;  // in s

  bool atConstantRate() const { return path.a == 0.0 && path.j == 0.0; }
  DoubleDouble placeAt(DoubleDouble t) const {
    return from + (path.positionAt(t) - path.positionAt(begin));
  }
};

// Run through at a constant rate.
Piece atRate(const Part& part) {
  const DoubleDouble rate = velocityOf(part.path);
  const DoubleDouble velocity = rate * part.course.velocityAt(part.from);
  const DoubleDouble acceleration = rate * rate * part.course.accelerationAt(part.from);
  const double jerk = (rate * rate * rate * DoubleDouble(part.course.j)).value();
  return {part.length / rate,
          part.course.positionAt(part.from),
          velocity.hi,
          acceleration.hi,
          jerk,
          velocity.lo,
          acceleration.lo};
}

// Of q(s(t)), and of its absolute value, from above.
double largestFourthDerivative(const Part& part) {
  const auto largest = [](double a, double b) { return std::max(std::abs(a), std::abs(b)); };
  const Piece& path = part.path;
  double rate = largest(path.velocityAt(part.begin).value(), path.velocityAt(part.end).value());
  const double level = path.j != 0.0 ? -path.a / path.j : 0.0;
  if (part.begin.value() < level && level < part.end.value()) {
    rate = std::max(rate, std::abs(path.velocityAt(level).value()));
  }
  const double slope =
      largest(path.accelerationAt(part.begin).value(), path.accelerationAt(part.end).value());
  const double acceleration = largest(part.course.accelerationAt(part.from).value(),
                                      part.course.accelerationAt(part.from + part.length).value());
  return acceleration * (3.0 * slope * slope + 4.0 * rate * std::abs(path.j)) +
         6.0 * std::abs(part.course.j) * slope * rate * rate;
}

void appendCubics(std::vector<Piece>& pieces, const Part& part) {
  const DoubleDouble duration = part.end - part.begin;
  const double count = cubicsFor(duration.value(), largestFourthDerivative(part), kAlongError);
  const DoubleDouble slice = duration / DoubleDouble(count);
  const auto state = [&](double k) {
    const DoubleDouble t = part.begin + DoubleDouble(k) * slice;
    const DoubleDouble s = part.placeAt(t);
    return std::pair{part.course.positionAt(s),
                     (part.course.velocityAt(s) * part.path.velocityAt(t)).value()};
  };
  auto from = state(0.0);
  for (double k = 1.0; k <= count; ++k) {
    const auto to = state(k);
    pieces.push_back(cubic(slice, from.first, from.second, to.first, to.second));
    from = to;
  }
}

// The time in a piece of the path, from its beginning, at which it has gone so far.
DoubleDouble timeTo(const Piece& path, DoubleDouble way) {
  if (path.j != 0.0) {
    const auto left = [&](DoubleDouble t) { return way - (path.positionAt(t) - path.p0); };
    return rootOf(left, path.duration.value());
  }
  const DoubleDouble rate = velocityOf(path);
  if (path.a == 0.0) return way / rate;
  // Of the two roots the stable form gives the one that comes first.
  const DoubleDouble under = rate * rate + DoubleDouble(2.0) * accelerationOf(path) * way;
  const DoubleDouble root = under.hi > 0.0 ? sqrt(under) : DoubleDouble();
  return DoubleDouble(2.0) * way / (rate + root);
}

// All parts, in the order in which the path runs through them, as long as they are wanted.
template <typename Take>
void forEachPart(const Profile& course, const Profile& path, const Take& take) {
  std::size_t index = 0;  // of the course's piece
  for (const Piece& stretch : path.pieces()) {
    const DoubleDouble end = stretch.positionAt(stretch.duration);
    DoubleDouble s = stretch.p0;
    DoubleDouble t;
    while ((stretch.duration - t).hi > kNoTime) {
      while (index + 1 < course.pieces().size() &&
             !((course.pieceStart(index + 1) - s).hi > kNoTime)) {
        ++index;
      }
      const DoubleDouble knot = course.pieceStart(index + 1);
      const bool ends_here = index + 1 == course.pieces().size() || !(knot < end);
      const DoubleDouble next = ends_here ? end : knot;
      const DoubleDouble until = ends_here ? stretch.duration : timeTo(stretch, next - stretch.p0);
      const Part part{
          course.pieces()[index], s - course.pieceStart(index), stretch, t, until, next - s};
      if (!take(part)) return;
      s = next;
      t = until;
    }
  }
}

bool keeps(const Part& part, DoubleDouble t, const AlongLimits& limits) {
  const DoubleDouble s = part.placeAt(t);
  const double q1 = part.course.velocityAt(s).value();
  const double q2 = part.course.accelerationAt(s).value();
  const double s1 = part.path.velocityAt(t).value();
  const double s2 = part.path.accelerationAt(t).value();
  const double acceleration = q2 * s1 * s1 + q1 * s2;
  const double jerk = part.course.j * s1 * s1 * s1 + 3.0 * q2 * s1 * s2 + q1 * part.path.j;
  return std::abs(acceleration) <= limits.acceleration &&
         (limits.jerk == 0.0 || std::abs(jerk) <= limits.jerk);
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
                      (scale * DoubleDouble(piece.j)).value(), velocity.lo, acceleration.lo});
  }
  return {path.startNs(), std::move(pieces)};
}

Profile along(const Profile& course, const Profile& path) {
  std::vector<Piece> pieces;
  forEachPart(course, path, [&](const Part& part) {
    if (part.atConstantRate()) {
      pieces.push_back(atRate(part));
    } else {
      appendCubics(pieces, part);
    }
    return true;
  });
  if (pieces.empty()) {
    const std::int64_t s_ns = splitNanoseconds(path.endPosition()).whole;
    return {path.startNs(), course.stateAt(course.startNs() + s_ns).position};
  }
  return {path.startNs(), std::move(pieces)};
}

bool staysWithin(const Profile& course, const Profile& path, const AlongLimits& limits) {
  bool within = true;
  forEachPart(course, path, [&](const Part& part) {
    if (part.atConstantRate()) return true;
    const DoubleDouble slice = (part.end - part.begin) / DoubleDouble(kSlices);
    for (int i = 0; i <= kSlices && within; ++i) {
      within = keeps(part, part.begin + DoubleDouble(i) * slice, limits);
    }
    return within;
  });
  return within;
}

}  // namespace stepdriver::motion
