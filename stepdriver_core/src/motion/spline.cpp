#include "stepdriver_core/motion/spline.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "hermite.h"
#include "spline_refusals.h"
#include "spline_segment.h"

namespace stepdriver::motion {
namespace {

Piece line(DoubleDouble duration, DoubleDouble from, DoubleDouble to) {
  return {duration, from, ((to - from) / duration).value(), 0.0, 0.0};
}

double reach(const Piece& piece) {
  const double t = piece.duration.value();
  return std::abs(piece.v0) * t + std::abs(piece.a) * t * t / 2.0 +
         std::abs(piece.j) * t * t * t / 6.0;
}

void appendQuintic(std::vector<Piece>& pieces, const Segment& segment) {
  const Quintic curve = segment.quintic();
  requireReach(curve.reach(), segment.index);
  const DoubleDouble duration = segment.duration();
  const double count = cubicsFor(1.0, curve.largestFourthDerivative(), kQuinticError);
  const DoubleDouble part = duration / DoubleDouble(count);
  DoubleDouble from = segment.begin.position;
  double v0 = *segment.begin.velocity;
  for (double k = 1.0; k < count; ++k) {
    const DoubleDouble u = DoubleDouble(k) / DoubleDouble(count);
    const DoubleDouble to = curve.positionAt(u);
    const double v1 = (curve.slopeAt(u) / duration).value();
    pieces.push_back(cubic(part, from, v0, to, v1));
    from = to;
    v0 = v1;
  }
  pieces.push_back(cubic(part, from, v0, segment.end.position, *segment.end.velocity));
}

void append(std::vector<Piece>& pieces, const Segment& segment) {
  const Knot& begin = segment.begin;
  const Knot& end = segment.end;
  const DoubleDouble duration = segment.duration();
  switch (segment.kind()) {
    case SegmentKind::kLine:
      pieces.push_back(line(duration, begin.position, end.position));
      break;
    case SegmentKind::kCubic:
      pieces.push_back(
          cubic(duration, begin.position, *begin.velocity, end.position, *end.velocity));
      requireReach(reach(pieces.back()), segment.index);
      break;
    case SegmentKind::kQuintic:
      appendQuintic(pieces, segment);
      break;
  }
}

// The accelerations at a segment's ends [microsteps/s^2].
struct Ends {
  double begin = 0.0;
  double end = 0.0;
};

Ends takeJerk(SplineJerk& worst, const Segment& segment) {
  const double start = static_cast<double>(segment.begin.time_ns) * 1e-9;
  const double duration = segment.duration().value();
  const auto take = [&](double jerk, double time_s) {
    if (std::abs(jerk) > std::abs(worst.jerk.value)) worst.jerk = {jerk, time_s};
  };
  if (segment.kind() == SegmentKind::kLine) return {};
  if (segment.kind() == SegmentKind::kCubic) {
    const Piece piece = cubic(segment.duration(), segment.begin.position, *segment.begin.velocity,
                              segment.end.position, *segment.end.velocity);
    take(piece.j, start);
    return {piece.a, piece.accelerationAt(piece.duration).value()};
  }
  const Quintic curve = segment.quintic();
  const auto consider = [&](double u) {
    take(curve.thirdDerivativeAt(u) / (duration * duration * duration), start + u * duration);
  };
  consider(0.0);
  consider(1.0);
  const double level = -curve.c4.value() / (5.0 * curve.c5.value());
  if (level > 0.0 && level < 1.0) consider(level);
  return {*segment.begin.acceleration, *segment.end.acceleration};
}

}  // namespace

Profile planSpline(std::int64_t start_ns, const MotionState& from,
                   const std::vector<Waypoint>& waypoints) {
  requirePlannable(from, waypoints);
  std::vector<Piece> pieces;
  pieces.reserve(waypoints.size());
  for (const Segment& segment : segmentsOf(from, waypoints)) append(pieces, segment);
  return {start_ns, std::move(pieces)};
}

SplineJerk splineJerk(const MotionState& from, const std::vector<Waypoint>& waypoints) {
  requirePlannable(from, waypoints);
  SplineJerk worst;
  const auto jump = [&](double change, double time_s) {
    if (std::abs(change) > std::abs(worst.acceleration_jump.value)) {
      worst.acceleration_jump = {change, time_s};
    }
  };
  double before = from.acceleration;
  double time_s = 0.0;
  for (const Segment& segment : segmentsOf(from, waypoints)) {
    const Ends ends = takeJerk(worst, segment);
    jump(ends.begin - before, time_s);
    before = ends.end;
    time_s = static_cast<double>(segment.end.time_ns) * 1e-9;
  }
  jump(-before, time_s);
  return worst;
}

}  // namespace stepdriver::motion
