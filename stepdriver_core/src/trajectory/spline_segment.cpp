#include "spline_segment.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::motion {

DoubleDouble Quintic::positionAt(DoubleDouble u) const {
  return p0 + u * (c1 + u * (c2 + u * (c3 + u * (c4 + u * c5))));
}

DoubleDouble Quintic::slopeAt(DoubleDouble u) const {
  return c1 + u * (DoubleDouble(2.0) * c2 +
                   u * (DoubleDouble(3.0) * c3 +
                        u * (DoubleDouble(4.0) * c4 + u * (DoubleDouble(5.0) * c5))));
}

double Quintic::thirdDerivativeAt(double u) const {
  return 6.0 * c3.value() + u * (24.0 * c4.value() + u * 60.0 * c5.value());
}

// The derivative is linear, so it is largest at an end.
double Quintic::largestFourthDerivative() const {
  const double begin = 24.0 * c4.value();
  return std::max(std::abs(begin), std::abs(begin + 120.0 * c5.value()));
}

double Quintic::reach() const {
  return std::abs(c1.hi) + std::abs(c2.hi) + std::abs(c3.hi) + std::abs(c4.hi) + std::abs(c5.hi);
}

SegmentKind SplineSegment::kind() const {
  if (!begin.velocity || !end.velocity) return SegmentKind::kLine;
  return begin.acceleration && end.acceleration ? SegmentKind::kQuintic : SegmentKind::kCubic;
}

DoubleDouble SplineSegment::duration() const { return secondsOf(end.time_ns - begin.time_ns); }

Quintic SplineSegment::quintic() const {
  const DoubleDouble time = duration();
  const DoubleDouble way = end.position - begin.position;
  const DoubleDouble v0 = time * *begin.velocity;
  const DoubleDouble v1 = time * *end.velocity;
  const DoubleDouble a0 = time * time * DoubleDouble(*begin.acceleration / 2.0);
  const DoubleDouble a1 = time * time * DoubleDouble(*end.acceleration / 2.0);
  const auto times = [](double factor, DoubleDouble x) { return DoubleDouble(factor) * x; };
  return {begin.position,
          v0,
          a0,
          times(10.0, way) - times(6.0, v0) - times(4.0, v1) - times(3.0, a0) + a1,
          times(-15.0, way) + times(8.0, v0) + times(7.0, v1) + times(3.0, a0) - times(2.0, a1),
          times(6.0, way) - times(3.0, v0) - times(3.0, v1) - a0 + a1};
}

SplineSegments::SplineSegments(const std::vector<Waypoint>& waypoints)
    : waypoints_(waypoints), skipped_(waypoints.front().time_ns == 0 ? 1 : 0) {}

SplineSegment SplineSegments::first(const MotionState& from) const {
  return {{0, from.position, from.velocity, from.acceleration}, knot(skipped_), skipped_};
}

SplineSegment SplineSegments::at(std::size_t index) const {
  const std::size_t to = skipped_ + index;
  return {knot(to - 1), knot(to), to};
}

void SplineSegments::advance(SplineSegment& segment) const {
  segment.begin = segment.end;
  segment.end = knot(++segment.index);
}

SplineKnot SplineSegments::knot(std::size_t index) const {
  const Waypoint& waypoint = waypoints_[index];
  const bool last = index + 1 == waypoints_.size();
  const double position = last && !waypoint.may_rest
                              ? static_cast<double>(restingCount(waypoint.position))
                              : waypoint.position;
  return {waypoint.time_ns, position, waypoint.velocity, waypoint.acceleration};
}

}  // namespace stepdriver::motion
