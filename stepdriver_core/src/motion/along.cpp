#include "stepdriver_core/motion/along.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <utility>
#include <vector>

#include "hermite.h"

namespace stepdriver::motion {
namespace {

constexpr double kNoTime = 1e-15;  // s

DoubleDouble velocityOf(const Piece& piece) { return {piece.v0, piece.v0_rest}; }
DoubleDouble accelerationOf(const Piece& piece) { return {piece.a, piece.a_rest}; }

// A part of a piece of a course, from `from` [s] in it on, and of this length.
struct Part {
  const Piece& course;
  DoubleDouble from;
  DoubleDouble length;
};

// Run through at a constant rate.
Piece atRate(const Part& part, DoubleDouble rate) {
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

// Run through as a piece of the path does, between two times of that.
void appendCubics(std::vector<Piece>& pieces, const Part& part, const Piece& path,
                  DoubleDouble begin, DoubleDouble end) {
  const double highest_rate =
      std::max(path.velocityAt(begin).value(), path.velocityAt(end).value());
  const double acceleration =
      std::max(std::abs(part.course.accelerationAt(part.from).value()),
               std::abs(part.course.accelerationAt(part.from + part.length).value()));
  const double fourth = 3.0 * acceleration * path.a * path.a +
                        6.0 * std::abs(part.course.j * path.a) * highest_rate * highest_rate;
  const DoubleDouble duration = end - begin;
  const double count = cubicsFor(duration.value(), fourth, kAlongError);
  const DoubleDouble slice = duration / DoubleDouble(count);
  const DoubleDouble origin = path.positionAt(begin) - part.from;
  const auto state = [&](double k) {
    const DoubleDouble t = begin + DoubleDouble(k) * slice;
    const DoubleDouble s = path.positionAt(t) - origin;
    return std::pair{part.course.positionAt(s),
                     (part.course.velocityAt(s) * path.velocityAt(t)).value()};
  };
  auto from = state(0.0);
  for (double k = 1.0; k <= count; ++k) {
    const auto to = state(k);
    pieces.push_back(cubic(slice, from.first, from.second, to.first, to.second));
    from = to;
  }
}

// The time in a piece of the path, from its beginning, at which it has gone so far. Of the two
// roots the stable form gives the one that comes first.
DoubleDouble timeTo(const Piece& path, DoubleDouble way) {
  const DoubleDouble rate = velocityOf(path);
  if (path.a == 0.0) return way / rate;
  const DoubleDouble under = rate * rate + DoubleDouble(2.0) * accelerationOf(path) * way;
  const DoubleDouble root = under.hi > 0.0 ? sqrt(under) : DoubleDouble();
  return DoubleDouble(2.0) * way / (rate + root);
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
  std::size_t index = 0;  // of the course's piece
  for (const Piece& stretch : path.pieces()) {
    const DoubleDouble end = stretch.p0 + (stretch.positionAt(stretch.duration) - stretch.p0);
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
      const Part part{course.pieces()[index], s - course.pieceStart(index), next - s};
      if (stretch.a == 0.0) {
        pieces.push_back(atRate(part, velocityOf(stretch)));
      } else {
        appendCubics(pieces, part, stretch, t, until);
      }
      s = next;
      t = until;
    }
  }
  if (pieces.empty()) {
    const std::int64_t s_ns = splitNanoseconds(path.endPosition()).whole;
    return {path.startNs(), course.stateAt(course.startNs() + s_ns).position};
  }
  return {path.startNs(), std::move(pieces)};
}

}  // namespace stepdriver::motion
