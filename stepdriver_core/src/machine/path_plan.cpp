#include "path_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <limits>
#include <stdexcept>
#include <string>
#include <utility>

#include "message_text.h"
#include "motion/contour.h"
#include "motion/contour_motion.h"
#include "motion/smooth_contour_motion.h"
#include "motion/spline.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
namespace {

using axis::PathAxis;
using axis::TrajectoryPoint;
using motion::ContourSegment;
using Shape = PathSegment::Shape;

// The rest of the limits is left for the backlash.
constexpr double kShareWithBacklash = 0.8;
constexpr double kShortestSegment = 1e-3;  // microsteps of one of its axes

std::string nameOf(std::size_t segment) { return fmt::format("segment {} of the path", segment); }

// Reads the segments of a request.
class SegmentReader {
 public:
  SegmentReader(const PathRequest& request, const std::vector<PathAxis>& axes,
                const std::vector<PathOrigin>& origins)
      : request_(request), axes_(axes) {
    for (std::size_t i = 0; i < axes.size(); ++i) {
      start_.push_back(axes[i].positionOf(origins[i].rest));
      zero_.push_back(request.relative ? origins[i].commanded : 0.0);
    }
    before_ = start_;
  }

  const std::vector<double>& start() const { return start_; }

  ContourSegment read(std::size_t index) {
    index_ = index;
    const PathSegment& given = request_.segments[index];
    ContourSegment segment;
    segment.end = positions(given.end, "positions");
    switch (given.shape) {
      case Shape::kLine:
        break;
      case Shape::kArcAround:
      case Shape::kArcThrough:
        readArc(given, segment);
        break;
      case Shape::kBezier:
        segment.shape = ContourSegment::Shape::kBezier;
        segment.control1 = positions(given.control1, "numbers in control1");
        segment.control2 = positions(given.control2, "numbers in control2");
        break;
    }
    requireLength(given, segment);
    readSpeed(given, segment);
    segment.tolerance = given.tolerance.value_or(request_.tolerance);
    requirePositive("tolerance", segment.tolerance);
    before_ = segment.end;
    return segment;
  }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    throw Refused(nameOf(index_) + " " + why);
  }

  std::vector<double> positions(const std::vector<double>& given, const char* what) const {
    if (given.size() != axes_.size()) {
      refuse(fmt::format("has {} {}, but must have {}", given.size(), what, axes_.size()));
    }
    std::vector<double> positions;
    positions.reserve(given.size());
    for (std::size_t i = 0; i < given.size(); ++i) {
      positions.push_back(place(i, given[i], what));
    }
    return positions;
  }

  double place(std::size_t axis, double given, const char* what) const {
    if (std::isfinite(given)) return zero_[axis] + given;
    axes_[axis].refuse(fmt::format("{} has {} among its {}, but they must be finite",
                                   nameOf(index_), numberText(given), what));
  }

  void requirePositive(const char* what, double value) const {
    if (std::isfinite(value) && value >= 0.0) return;
    refuse(fmt::format("has the {} {}, but it must be a finite number from 0 on", what,
                       numberText(value)));
  }

  void readArc(const PathSegment& given, ContourSegment& segment) const {
    segment.shape = ContourSegment::Shape::kArc;
    std::array<double, 2> from{};
    std::array<double, 2> point{};
    std::array<double, 2> to{};
    for (std::size_t k = 0; k < 2; ++k) {
      const std::size_t axis = axisOf(given.plane[k]);
      segment.plane[k] = axis;
      from[k] = before_[axis];
      to[k] = segment.end[axis];
      point[k] = place(axis, given.point[k], "numbers in point");
    }
    const auto [a, b] = segment.plane;
    if (a == b || axes_[a].kind != axes_[b].kind) {
      refuse(
          fmt::format("is an arc in the plane of {} and {}, but must have two different axes "
                      "of the same kind",
                      given.plane[0], given.plane[1]));
    }
    const bool around = given.shape == Shape::kArcAround;
    if (around) requireCircle(axes_[a], from, point, to);
    const motion::Arc arc = around ? motion::arcAround(from, point, to, given.clockwise)
                                   : motion::arcThrough(from, point, to);
    if (arc.angle == 0.0) {
      refuse("is an arc through three points that are in line, or of which two are the same");
    }
    segment.centre = arc.centre;
    segment.angle = arc.angle;
  }

  std::size_t axisOf(const std::string& name) const {
    const auto found = std::find(request_.names.begin(), request_.names.end(), name);
    if (found != request_.names.end()) {
      return static_cast<std::size_t>(found - request_.names.begin());
    }
    refuse(fmt::format("is an arc in a plane of '{}', which isn't among the path's axes, {}", name,
                       listText(request_.names, "and")));
  }

  void requireCircle(const PathAxis& axis, const std::array<double, 2>& from,
                     const std::array<double, 2>& centre, const std::array<double, 2>& to) const {
    const double begin = std::hypot(from[0] - centre[0], from[1] - centre[1]);
    const double end = std::hypot(to[0] - centre[0], to[1] - centre[1]);
    if (begin * axis.steps_per_unit < 1.0 || end * axis.steps_per_unit < 1.0) {
      refuse(fmt::format("is an arc with a radius of {}, but it must be a microstep or more",
                         axis.show(std::min(begin, end))));
    }
    if (std::abs(begin - end) <= kArcMismatch) return;
    refuse(
        fmt::format("is an arc that begins {} from its centre and ends {} from it; these may "
                    "differ by {}",
                    axis.show(begin), axis.show(end), axis.show(kArcMismatch)));
  }

  void requireLength(const PathSegment& given, const ContourSegment& segment) const {
    if (segment.shape == ContourSegment::Shape::kArc) return;
    double longest = 0.0;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      const auto take = [&](double position) {
        const double way = std::abs(position - before_[i]) * axes_[i].steps_per_unit;
        longest = std::max(longest, way);
      };
      take(segment.end[i]);
      if (given.shape != Shape::kBezier) continue;
      take(segment.control1[i]);
      take(segment.control2[i]);
    }
    if (longest < kShortestSegment) refuse("has a length of 0, but must lead away from its begin");
  }

  void readSpeed(const PathSegment& given, ContourSegment& segment) const {
    requirePositive("velocity", given.velocity);
    const double velocity = given.velocity > 0.0 ? given.velocity : request_.velocity;
    if (velocity == 0.0) return;
    segment.speed = velocity;
    bool linear_moves = false;
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      linear_moves = linear_moves || (isLinear(i) && moves(segment, i));
    }
    for (std::size_t i = 0; i < axes_.size(); ++i) {
      segment.measured.push_back(isLinear(i) == linear_moves);
    }
  }

  bool isLinear(std::size_t axis) const { return axes_[axis].kind == config::Kind::kLinear; }

  bool moves(const ContourSegment& segment, std::size_t axis) const {
    if (segment.end[axis] != before_[axis]) return true;
    switch (segment.shape) {
      case ContourSegment::Shape::kLine:
        return false;
      case ContourSegment::Shape::kArc:
        return segment.plane[0] == axis || segment.plane[1] == axis;
      case ContourSegment::Shape::kBezier:
        return segment.control1[axis] != before_[axis] || segment.control2[axis] != before_[axis];
    }
    return false;
  }

  const PathRequest& request_;
  const std::vector<PathAxis>& axes_;
  std::vector<double> start_;   // unit
  std::vector<double> zero_;    // [unit] positions of the request count from here
  std::vector<double> before_;  // [unit] the end of the segment before
  std::size_t index_ = 0;
};

void requireRequest(const PathRequest& request) {
  const std::size_t size = request.segments.size();
  if (size == 0 || size > kMostPathSegments) {
    throw Refused(
        fmt::format("the path has {} segments, but must have 1 to {}", size, kMostPathSegments));
  }
  const auto require = [](const char* what, double value) {
    if (std::isfinite(value) && value >= 0.0) return;
    throw Refused(fmt::format("the {} of the path is {}, but must be a finite number from 0 on",
                              what, numberText(value)));
  };
  require("velocity", request.velocity);
  require("tolerance", request.tolerance);
}

bool isSmooth(const std::vector<PathAxis>& axes) {
  return std::any_of(axes.begin(), axes.end(),
                     [](const PathAxis& axis) { return axis.limits.jerk > 0.0; });
}

// [unit]
motion::ContourLimits limitsOf(const PathAxis& axis) {
  const double share = axis.backlash > 0 ? kShareWithBacklash : 1.0;
  const double unit = share / axis.steps_per_unit;
  motion::ContourLimits limits{axis.limits.max_speed * unit, axis.limits.acceleration * unit,
                               axis.limits.deceleration * unit};
  if (axis.limits.jerk > 0.0) limits.jerk = axis.limits.jerk * unit;
  return limits;
}

void requireRange(const motion::Contour& contour, const std::vector<PathAxis>& axes) {
  for (std::size_t i = 0; i < contour.size(); ++i) {
    for (std::size_t k = 0; k < axes.size(); ++k) {
      const auto [low, high] = contour.range(i, k);
      axes[k].refuseBeyondLimits(low, nameOf(i) + " leads to");
      axes[k].refuseBeyondLimits(high, nameOf(i) + " leads to");
    }
  }
}

// [s] How long an axis takes to move by a part of a microstep from rest to rest: on a quintic,
// which has a speed of 1.875 way/T, an acceleration of 5.77 way/T^2 and a jerk of 60 way/T^3, or on
// a cubic, which has a speed of 1.5 way/T and an acceleration of 6 way/T^2.
double restTime(double way, const motion::MotionLimits& limits, bool smooth) {
  const double acceleration = std::min(limits.acceleration, limits.deceleration);
  if (!smooth) return std::max(1.5 * way / limits.max_speed, std::sqrt(6.0 * way / acceleration));
  const double time =
      std::max(1.875 * way / limits.max_speed, std::sqrt(5.78 * way / acceleration));
  return limits.jerk > 0.0 ? std::max(time, std::cbrt(60.0 * way / limits.jerk)) : time;
}

// From the end of the path to the microsteps at which the axes come to rest. That is half a
// microstep or less: no step.
void appendRest(std::vector<TrajectoryPoint>& points, const std::vector<PathAxis>& axes) {
  TrajectoryPoint rest = points.back();
  double duration = 0.0;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const double count = axes[k].countOf(rest.positions[k]);
    const auto whole = static_cast<double>(motion::restingCount(count));
    duration = std::max(
        duration, restTime(std::abs(whole - count), axes[k].limits, !rest.accelerations.empty()));
    rest.positions[k] = axes[k].positionOf(whole);
  }
  constexpr double kRounding = 1e-6;  // s
  if (duration < kRounding) return;
  rest.time = std::ceil((rest.time + duration) * 1e9) * 1e-9;
  points.push_back(std::move(rest));
}

std::vector<TrajectoryPoint> pointsOf(std::vector<motion::ContourKnot> knots,
                                      const std::vector<PathAxis>& axes) {
  std::vector<TrajectoryPoint> points;
  points.reserve(knots.size() + 1);
  for (motion::ContourKnot& knot : knots) {
    for (std::size_t k = 0; k < axes.size(); ++k) {
      axes[k].refuseBeyondLimits(knot.positions[k],
                                 nameOf(knot.segment) + ", rounded at its corners, leads to");
    }
    points.push_back({static_cast<double>(knot.time_ns) * 1e-9, std::move(knot.positions),
                      std::move(knot.velocities), std::move(knot.accelerations)});
  }
  appendRest(points, axes);
  return points;
}

}  // namespace

PathPlan planPath(const PathRequest& request, const std::vector<PathAxis>& axes,
                  const std::vector<PathOrigin>& origins) {
  requireRequest(request);
  SegmentReader reader(request, axes, origins);
  std::vector<ContourSegment> segments;
  segments.reserve(request.segments.size());
  for (std::size_t i = 0; i < request.segments.size(); ++i) segments.push_back(reader.read(i));
  double resolution = std::numeric_limits<double>::infinity();
  std::vector<motion::ContourLimits> limits;
  for (const PathAxis& axis : axes) {
    resolution = std::min(resolution, 1.0 / axis.steps_per_unit);
    limits.push_back(limitsOf(axis));
  }
  try {
    const bool smooth = isSmooth(axes);
    const motion::Contour contour(
        reader.start(), segments, resolution,
        smooth ? motion::Continuity::kCurvature : motion::Continuity::kDirection);
    requireRange(contour, axes);
    PathPlan plan;
    plan.points = pointsOf(
        smooth ? motion::planSmoothContour(contour, limits) : motion::planContour(contour, limits),
        axes);
    for (std::size_t k = 0; k < axes.size(); ++k) {
      plan.targets.push_back(axes[k].countOf(segments.back().end[k]));
    }
    return plan;
  } catch (const std::invalid_argument& error) {
    throw Refused(error.what());
  } catch (const std::range_error& error) {
    throw Refused(error.what());
  }
}

}  // namespace stepdriver::machine
