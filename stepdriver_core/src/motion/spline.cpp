#include "stepdriver_core/motion/spline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "hermite.h"
#include "spline_refusals.h"

namespace stepdriver::motion {
namespace {

// One end of a segment.
struct Knot {
  std::int64_t time_ns;
  DoubleDouble position;
  std::optional<double> velocity;
  std::optional<double> acceleration;
};

// A quintic over u from 0 to 1: p0 + c1 u + ... + c5 u^5 [microsteps].
struct Quintic {
  DoubleDouble p0, c1, c2, c3, c4, c5;

  DoubleDouble positionAt(DoubleDouble u) const {
    return p0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
  }
  DoubleDouble slopeAt(DoubleDouble u) const {
    return c1 + u * (DoubleDouble(2.0) * c2 +
                     u * (DoubleDouble(3.0) * c3 +
                          u * (DoubleDouble(4.0) * c4 + u * (DoubleDouble(5.0) * c5))));
  }
  // The fourth derivative is linear: it is largest at an end.
  double largestFourthDerivative() const {
    const double begin = 24.0 * c4.value();
    return std::max(std::abs(begin), std::abs(begin + 120.0 * c5.value()));
  }
  double reach() const {
    return std::abs(c1.hi) + std::abs(c2.hi) + std::abs(c3.hi) + std::abs(c4.hi) + std::abs(c5.hi);
  }
};

Quintic quintic(DoubleDouble duration, const Knot& begin, const Knot& end) {
  const DoubleDouble way = end.position - begin.position;
  const DoubleDouble v0 = duration * *begin.velocity;
  const DoubleDouble v1 = duration * *end.velocity;
  const DoubleDouble a0 = duration * duration * DoubleDouble(*begin.acceleration / 2.0);
  const DoubleDouble a1 = duration * duration * DoubleDouble(*end.acceleration / 2.0);
  const auto times = [](double factor, DoubleDouble x) { return DoubleDouble(factor) * x; };
  return {begin.position,
          v0,
          a0,
          times(10.0, way) - times(6.0, v0) - times(4.0, v1) - times(3.0, a0) + a1,
          times(-15.0, way) + times(8.0, v0) + times(7.0, v1) + times(3.0, a0) - times(2.0, a1),
          times(6.0, way) - times(3.0, v0) - times(3.0, v1) - a0 + a1};
}

Piece line(DoubleDouble duration, DoubleDouble from, DoubleDouble to) {
  return {duration, from, ((to - from) / duration).value(), 0.0, 0.0};
}

double reach(const Piece& piece) {
  const double t = piece.duration.value();
  return std::abs(piece.v0) * t + std::abs(piece.a) * t * t / 2.0 +
         std::abs(piece.j) * t * t * t / 6.0;
}

void appendQuintic(std::vector<Piece>& pieces, DoubleDouble duration, const Knot& begin,
                   const Knot& end, std::size_t index) {
  const Quintic curve = quintic(duration, begin, end);
  requireReach(curve.reach(), index);
  const double count = cubicsFor(1.0, curve.largestFourthDerivative(), kQuinticError);
  const DoubleDouble part = duration / DoubleDouble(count);
  DoubleDouble from = begin.position;
  double v0 = *begin.velocity;
  for (double k = 1.0; k < count; ++k) {
    const DoubleDouble u = DoubleDouble(k) / DoubleDouble(count);
    const DoubleDouble to = curve.positionAt(u);
    const double v1 = (curve.slopeAt(u) / duration).value();
    pieces.push_back(cubic(part, from, v0, to, v1));
    from = to;
    v0 = v1;
  }
  pieces.push_back(cubic(part, from, v0, end.position, *end.velocity));
}

void append(std::vector<Piece>& pieces, const Knot& begin, const Knot& end, std::size_t index) {
  const DoubleDouble duration = fromInteger(end.time_ns - begin.time_ns) / DoubleDouble(1e9);
  if (!begin.velocity || !end.velocity) {
    pieces.push_back(line(duration, begin.position, end.position));
  } else if (!begin.acceleration || !end.acceleration) {
    pieces.push_back(cubic(duration, begin.position, *begin.velocity, end.position, *end.velocity));
    requireReach(reach(pieces.back()), index);
  } else {
    appendQuintic(pieces, duration, begin, end, index);
  }
}

}  // namespace

Profile planSpline(std::int64_t start_ns, const MotionState& from,
                   const std::vector<Waypoint>& waypoints) {
  requirePlannable(from, waypoints);
  std::vector<Piece> pieces;
  pieces.reserve(waypoints.size());
  Knot begin{0, from.position, from.velocity, from.acceleration};
  for (std::size_t index = waypoints.front().time_ns == 0 ? 1 : 0; index < waypoints.size();
       ++index) {
    const Waypoint& waypoint = waypoints[index];
    const bool last = index + 1 == waypoints.size();
    const double position = last ? std::nearbyint(waypoint.position) : waypoint.position;
    const Knot end{waypoint.time_ns, position, waypoint.velocity, waypoint.acceleration};
    append(pieces, begin, end, index);
    begin = end;
  }
  return {start_ns, std::move(pieces)};
}

}  // namespace stepdriver::motion
