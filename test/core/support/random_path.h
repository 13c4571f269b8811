#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <random>
#include <utility>
#include <vector>

#include "geometry/path.h"
#include "path_timing/acceleration_limited.h"

namespace stepdriver::test {

/// A path with its limits; a unit is a microstep.
struct RandomPath {
  std::vector<double> start;
  std::vector<motion::CurveSegment> segments;
  std::vector<motion::TimingLimits> limits;

  motion::Path path(motion::Continuity continuity = motion::Continuity::kDirection) const {
    return {start, segments, 1.0, continuity};
  }
};

/// A path of 1 to 4 axes and 1 to 10 segments of every shape, with ends on whole microsteps.
/// Tolerances are 0, or half a microstep or more: rounding by less makes no step.
inline RandomPath randomPath(std::mt19937& random) {
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  const auto chance = [&](double probability) { return number(0.0, 1.0) < probability; };
  RandomPath made;
  const auto axes = static_cast<std::size_t>(number(1.0, 5.0));
  const double size = std::pow(10.0, number(1.5, 4.0));
  made.start.assign(axes, 0.0);
  for (std::size_t i = 0; i < axes; ++i) {
    const double acceleration = std::pow(10.0, number(3.0, 5.0));
    made.limits.push_back({std::pow(10.0, number(2.5, 4.5)), acceleration,
                           chance(0.5) ? acceleration : acceleration * number(0.5, 2.0)});
  }
  const int count = static_cast<int>(number(1.0, 11.0));
  const double tolerance =
      chance(0.1) ? 0.0 : std::max(0.5, size * std::pow(10.0, number(-3.0, -0.5)));
  std::vector<double> from = made.start;
  const auto place = [&] {
    std::vector<double> to = from;
    for (double& x : to) x = std::round(x + number(-size, size));
    return to;
  };
  for (int i = 0; i < count; ++i) {
    motion::CurveSegment segment;
    segment.end = place();
    if (segment.end == from) segment.end[0] += 1.0;
    segment.tolerance = chance(0.1) ? 0.0 : tolerance;
    if (chance(0.3)) segment.speed = std::pow(10.0, number(2.0, 4.0));
    if (axes > 1 && chance(0.3)) {
      const motion::Arc arc = motion::arcThrough(
          {from[0], from[1]}, {from[0] + number(-size, size), from[1] + number(-size, size)},
          {segment.end[0], segment.end[1]});
      if (arc.angle != 0.0) {
        segment.shape = motion::CurveSegment::Shape::kArc;
        segment.plane = {0, 1};
        segment.centre = arc.centre;
        segment.angle = arc.angle;
      }
    } else if (axes > 1 && chance(0.3)) {
      segment.shape = motion::CurveSegment::Shape::kBezier;
      segment.control1 = place();
      segment.control2 = place();
    }
    from = segment.end;
    made.segments.push_back(std::move(segment));
  }
  return made;
}

/// Puts control points of its Beziers at their ends: the first one, the second one or both.
inline void dropHandles(RandomPath& path) {
  const std::vector<double>* from = &path.start;
  for (std::size_t i = 0; i < path.segments.size(); ++i) {
    motion::CurveSegment& segment = path.segments[i];
    if (segment.shape == motion::CurveSegment::Shape::kBezier) {
      if (i % 3 != 1) segment.control1 = *from;
      if (i % 3 != 0) segment.control2 = segment.end;
    }
    from = &segment.end;
  }
}

}  // namespace stepdriver::test
