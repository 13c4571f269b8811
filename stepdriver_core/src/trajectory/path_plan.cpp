#include "path_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>

#include "count_rounding.h"
#include "message_text.h"
#include "nanoseconds.h"
#include "path_timing/jerk_limited.h"
#include "profile/errors.h"
#include "stepdriver_core/error.h"

namespace stepdriver::motion {
namespace {

// The plan leaves the rest of the limits to the backlash.
constexpr double kShareWithBacklash = 0.8;

double shareOf(const PathAxis& axis) { return axis.backlash > 0 ? kShareWithBacklash : 1.0; }

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

}  // namespace

bool hasJerkLimit(const std::vector<PathAxis>& axes) {
  return std::any_of(axes.begin(), axes.end(),
                     [](const PathAxis& axis) { return axis.limits.jerk > 0.0; });
}

std::vector<TimingLimits> timingLimits(const std::vector<PathAxis>& axes, double share) {
  std::vector<TimingLimits> limits;
  limits.reserve(axes.size());
  for (const PathAxis& axis : axes) {
    const double unit = share * shareOf(axis) / axis.steps_per_unit;
    TimingLimits& limit = limits.emplace_back();
    limit.speed = axis.limits.max_speed * unit;
    limit.acceleration = axis.limits.acceleration * unit;
    limit.deceleration = axis.limits.deceleration * unit;
    if (axis.limits.jerk > 0.0) limit.jerk = axis.limits.jerk * unit;
  }
  return limits;
}

double resolutionOf(const std::vector<PathAxis>& axes) {
  double resolution = std::numeric_limits<double>::infinity();
  for (const PathAxis& axis : axes) resolution = std::min(resolution, 1.0 / axis.steps_per_unit);
  return resolution;
}

void requireRange(const Path& path, const std::vector<PathAxis>& axes,
                  const std::vector<CurveSegment>& segments) {
  for (std::size_t i = 0; i < path.size(); ++i) {
    for (std::size_t k = 0; k < axes.size(); ++k) {
      const auto [low, high] = path.range(i, k);
      const auto text = [&] { return segmentText(segments[i].number) + " at"; };
      axes[k].refuseBeyondLimits(low, text);
      axes[k].refuseBeyondLimits(high, text);
    }
  }
}

// [s] The time that an axis needs to move by a part of a microstep from rest to rest: on a quintic,
// which has a speed of 1.875 way/T, an acceleration of 5.77 way/T^2 and a jerk of 60 way/T^3, or on
// a cubic, which has a speed of 1.5 way/T and an acceleration of 6 way/T^2. A part of the limits is
// left for the backlash. A very short way takes longer, because a rounded position may add a
// thousandth of the limits, and the rounded time of a point after a hundred years half a percent of
// the duration.
double restTime(double way, const PathAxis& axis, double count, bool smooth) {
  constexpr double kShortest = 1e-4;      // [s]
  constexpr double kMostRounding = 1e-3;  // as a part of a limit
  const MotionLimits& limits = axis.limits;
  way = std::max(way, roundingOf(count) / kMostRounding);
  const double wanted = way / shareOf(axis);
  const double acceleration = std::min(limits.acceleration, limits.deceleration);
  if (!smooth) {
    return std::max(
        {kShortest, 1.5 * wanted / limits.max_speed, std::sqrt(6.0 * wanted / acceleration)});
  }
  const double time = std::max(
      {kShortest, 1.875 * wanted / limits.max_speed, std::sqrt(5.78 * wanted / acceleration)});
  return limits.jerk > 0.0 ? std::max(time, std::cbrt(60.0 * wanted / limits.jerk)) : time;
}

RestOfPath restOf(const std::vector<PathAxis>& axes, const std::vector<double>& end, bool smooth) {
  RestOfPath rest{0.0, end};
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const double count = axes[k].countOf(end[k]);
    const double whole = axes[k].restAt(count);
    const double way = std::abs(whole - count);
    // An axis that stays isn't moved by rounding in the time that another one needs.
    if (way <= roundingOf(count)) continue;
    rest.duration = std::max(rest.duration, restTime(way, axes[k], count, smooth));
    rest.positions[k] = axes[k].positionOf(whole);
  }
  return rest;
}

// The begin of the first segment, and the way to it from the place at which the axes rest.
struct BeginOfPath {
  std::vector<double> rest;  // [unit]
  std::vector<double> place;
  std::int64_t delay_ns = 0;
};

// A line or a Bezier begins at the place at which the axes rest. An arc begins at the commanded
// position, to which its centre belongs: from half a microstep away it would be another arc.
BeginOfPath beginOf(const PathSegment& first, const std::vector<PathAxis>& axes,
                    const std::vector<PathOrigin>& origins, bool smooth) {
  constexpr double kRounding = 1e-6;     // [microsteps]
  constexpr double kBeforeStep = 0.499;  // [microsteps] a shorter way to it makes no step
  const bool arc = first.shape == PathSegment::Shape::kArcAround ||
                   first.shape == PathSegment::Shape::kArcThrough;
  BeginOfPath begin;
  double duration = 0.0;
  for (std::size_t k = 0; k < axes.size(); ++k) {
    const double rest = origins[k].rest;
    const double away = axes[k].countOf(origins[k].commanded) - rest;
    begin.rest.push_back(axes[k].positionOf(rest));
    begin.place.push_back(begin.rest.back());
    if (!arc || std::abs(away) < kRounding || std::abs(away) > 0.5 + kRounding) continue;
    const double way = std::clamp(away, -kBeforeStep, kBeforeStep);
    begin.place.back() = axes[k].positionOf(rest + way);
    duration = std::max(duration, restTime(std::abs(way), axes[k], rest, smooth));
  }
  begin.delay_ns = static_cast<std::int64_t>(std::ceil(duration * 1e9));
  return begin;
}

// After 50 days, a double isn't exact to a nanosecond: the point is where the motion is at its
// time.
TrajectoryPoint pointOf(TimingKnot knot) {
  const double time = static_cast<double>(knot.time_ns) * 1e-9;
  const double later = static_cast<double>(nanoseconds(time) - knot.time_ns) * 1e-9;
  for (std::size_t k = 0; later != 0.0 && k < knot.positions.size(); ++k) {
    const double acceleration = knot.accelerations.empty() ? 0.0 : knot.accelerations[k];
    knot.positions[k] += later * (knot.velocities[k] + later * acceleration / 2.0);
    knot.velocities[k] += later * acceleration;
  }
  return {time, std::move(knot.positions), std::move(knot.velocities),
          std::move(knot.accelerations)};
}

std::vector<TrajectoryPoint> pointsOf(std::vector<TimingKnot> knots,
                                      const std::vector<PathAxis>& axes,
                                      const std::vector<double>& end,
                                      const std::vector<CurveSegment>& segments) {
  std::vector<TrajectoryPoint> points;
  points.reserve(knots.size() + 1);
  for (TimingKnot& knot : knots) {
    for (std::size_t k = 0; k < axes.size(); ++k) {
      axes[k].refuseBeyondLimits(knot.positions[k], [&] {
        return segmentText(segments[knot.segment].number) + ", rounded at its corners, at";
      });
    }
    points.push_back(pointOf(std::move(knot)));
  }
  RestOfPath rest = restOf(axes, end, !points.back().accelerations.empty());
  if (rest.duration > 0.0) {
    TrajectoryPoint last = points.back();
    last.time = std::ceil((last.time + rest.duration) * 1e9) * 1e-9;
    last.positions = std::move(rest.positions);
    points.push_back(std::move(last));
  }
  return points;
}

void appendKnots(std::vector<PathWindow::Knot>& window, const std::vector<TimingKnot>& knots,
                 std::int64_t time_ns, std::size_t segment) {
  window.reserve(window.size() + knots.size());
  for (const TimingKnot& knot : knots) {
    window.push_back({time_ns + knot.time_ns, segment + knot.segment, knot.parameter, knot.speed,
                      knot.acceleration, knot.average, knot.may_begin, knot.straight});
  }
}

void setBlends(std::vector<CurveSegment>& segments, const Path& path, std::size_t first,
               const std::vector<std::size_t>& stops) {
  for (std::size_t i = 0; i < segments.size(); ++i) {
    segments[i].kept = 0.0;
    segments[i].blend = path.blendAfter(first + i);
  }
  for (const std::size_t stop : stops) segments[stop].blend = 0.0;
}

// @param segments their `blend` becomes that of the plan if more follows.
// @param marks their places are set.
PathTiming planAlong(std::vector<CurveSegment>& segments, const std::vector<double>& start,
                     const std::vector<PathAxis>& axes, bool more_follows,
                     std::vector<PathMark>& marks) {
  const bool smooth = hasJerkLimit(axes);
  const Path path(start, segments, resolutionOf(axes),
                  smooth ? Continuity::kCurvature : Continuity::kDirection, more_follows);
  requireRange(path, axes, segments);
  const std::vector<TimingLimits> limits =
      timingLimits(axes, more_follows ? QueuedPath::kShareOfLimits : 1.0);
  PathTiming plan = smooth ? planJerkLimited(path, limits) : planAccelerationLimited(path, limits);
  if (more_follows) setBlends(segments, path, 0, plan.stops);
  if (!marks.empty()) setPlaces(marks, 0, path, plan.knots, 0);
  return plan;
}

// The way to rest if no segment makes a step: the axes stay at rest.
PathTiming restAt(const std::vector<double>& place, bool smooth) {
  PathTiming plan;
  const std::vector<double> none(place.size(), 0.0);
  TimingKnot& knot = plan.knots.emplace_back();
  knot.positions = place;
  knot.velocities = none;
  if (smooth) knot.accelerations = none;
  plan.knots.push_back(knot);
  plan.knots.back().time_ns = 1;
  return plan;
}

PathPlan planPath(const PathRequest& request, const std::vector<PathAxis>& axes,
                  const std::vector<PathOrigin>& origins,
                  const std::vector<config::OutputConfig>& outputs) {
  requireRequest(request);
  const bool smooth = hasJerkLimit(axes);
  PathWindow window;
  window.frame = {
      request.names,
      {},
      request.velocity,
      request.tolerance,
      std::make_shared<const std::vector<PathOutput>>(pathOutputs(outputs, request.leads))};
  window.axes = axes;
  const BeginOfPath begin = beginOf(request.segments.front(), axes, origins, smooth);
  window.start = begin.place;
  for (std::size_t i = 0; i < axes.size(); ++i) {
    window.frame.zero.push_back(request.relative ? origins[i].commanded : 0.0);
  }
  PathReader reader(window.frame, axes, window.start);
  window.segments.reserve(request.segments.size());
  for (const PathSegment& given : request.segments) reader.read(given, window.segments);
  window.marks = reader.takeMarks();
  try {
    PathTiming planned;
    if (window.segments.empty()) {
      planned = restAt(window.start, smooth);
    } else {
      planned = planAlong(window.segments, window.start, axes, request.more_follows, window.marks);
    }
    for (PathMark& mark : window.marks) mark.place_ns += begin.delay_ns;
    requireRates(window.marks, *window.frame.outputs);
    for (TimingKnot& knot : planned.knots) knot.time_ns += begin.delay_ns;
    planned.settled_ns += begin.delay_ns;
    const std::vector<double> end = window.end();
    PathPlan plan;
    for (std::size_t k = 0; k < axes.size(); ++k) {
      plan.targets.push_back(axes[k].countOf(end[k]));
    }
    plan.points = pointsOf(planned.knots, axes, end, window.segments);
    plan.marks = marksByOutput(window.marks, *window.frame.outputs, window.marks_passed);
    if (request.more_follows) {
      window.settled_ns = planned.settled_ns;
      appendKnots(window.knots, planned.knots, 0, 0);
      plan.window = std::make_shared<const PathWindow>(std::move(window));
    }
    if (begin.delay_ns > 0) {
      TrajectoryPoint first = plan.points.front();
      first.time = 0.0;
      first.positions = begin.rest;
      plan.points.insert(plan.points.begin(), std::move(first));
    }
    return plan;
  } catch (const Malformed& error) {
    throw Refused(error.what());
  } catch (const TooLong& error) {
    throw Refused(error.what());
  }
}

}  // namespace stepdriver::motion
