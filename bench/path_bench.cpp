#include <benchmark/benchmark.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "trajectory/path_axis.h"
#include "trajectory/path_plan.h"
#include "trajectory/prepared_trajectory.h"

// Measures the planning of paths in one thread: from the request to the trajectory that the
// controller only has to join.

namespace stepdriver::bench {
namespace {

using motion::PathRequest;
using motion::PathSegment;

/// The plotter's: 80 microsteps/mm, 100 mm/s, 1 m/s^2.
motion::PathAxis plotterAxis(const char* name) {
  constexpr double kScale = 80'000.0;
  motion::PathAxis axis;
  axis.name = name;
  axis.microsteps = 16;
  axis.steps_per_unit = kScale;
  axis.limits = {0.002 * kScale, 0.1 * kScale, kScale, kScale, 0.0};
  axis.stop_limits = axis.limits;
  return axis;
}

PathRequest emptyRequest(std::size_t axes) {
  const std::vector<std::string> names{"x", "y", "z"};
  return {
      {names.begin(), names.begin() + static_cast<std::ptrdiff_t>(axes)}, {}, false, 0.0, 50e-6};
}

PathSegment lineTo(std::vector<double> end) {
  PathSegment segment;
  segment.end = std::move(end);
  return segment;
}

/// A circle of 20 mm in 100 lines, again and again.
PathRequest circles(std::size_t segments) {
  PathRequest request = emptyRequest(2);
  const double turn = 2.0 * std::acos(-1.0) / 100.0;
  for (std::size_t i = 1; i <= segments; ++i) {
    const double angle = turn * static_cast<double>(i % 100);
    request.segments.push_back(lineTo({0.02 * (std::cos(angle) - 1.0), 0.02 * std::sin(angle)}));
  }
  return request;
}

/// A circle of 20 mm in as many lines.
PathRequest circle(std::size_t segments) {
  PathRequest request = emptyRequest(2);
  for (std::size_t i = 1; i <= segments; ++i) {
    const double angle =
        2.0 * std::acos(-1.0) * static_cast<double>(i) / static_cast<double>(segments);
    request.segments.push_back(lineTo({0.02 * (std::cos(angle) - 1.0), 0.02 * std::sin(angle)}));
  }
  return request;
}

/// Lines of about 2 mm in random directions.
PathRequest zigzag(std::size_t segments) {
  PathRequest request = emptyRequest(3);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> way(-0.002, 0.002);
  std::vector<double> place(3, 0.0);
  for (std::size_t i = 0; i < segments; ++i) {
    for (double& x : place) x += way(random);
    request.segments.push_back(lineTo(place));
  }
  return request;
}

/// A wave with radii of 10 mm and more in chords of 0.1 mm.
PathRequest chords(std::size_t segments) {
  PathRequest request = emptyRequest(2);
  std::vector<double> place(2, 0.0);
  double direction = 0.0;
  for (std::size_t i = 0; i < segments; ++i) {
    direction += 0.01 * std::sin(2.0 * std::acos(-1.0) * static_cast<double>(i) / 700.0);
    place[0] += 1e-4 * std::cos(direction);
    place[1] += 1e-4 * std::sin(direction);
    request.segments.push_back(lineTo(place));
  }
  return request;
}

/// Smooth waves, each half of one a Bezier.
PathRequest waves(std::size_t segments) {
  PathRequest request = emptyRequest(2);
  for (std::size_t i = 0; i < segments; ++i) {
    const auto x = static_cast<double>(i) * 0.004;
    const double up = i % 2 == 0 ? 0.002 : -0.002;
    PathSegment segment = lineTo({x + 0.004, 0.0});
    segment.shape = PathSegment::Shape::kBezier;
    segment.control1 = {x + 0.001, up};
    segment.control2 = {x + 0.003, up};
    request.segments.push_back(segment);
  }
  return request;
}

void plan(benchmark::State& state, PathRequest (*make)(std::size_t), double jerk = 0.0) {
  constexpr std::size_t kSegments = 1000;
  const PathRequest request = make(kSegments);
  std::vector<motion::PathAxis> axes;
  for (const std::string& name : request.names) {
    axes.push_back(plotterAxis(name.c_str()));
    axes.back().limits.jerk = jerk;
  }
  const std::vector<motion::PathOrigin> origins(axes.size());
  std::size_t points = 0;
  double seconds = 0.0;
  for (auto round : state) {
    const motion::PathPlan plan = motion::planPath(request, axes, origins);
    points = plan.points.size();
    seconds = plan.points.back().time;
    const motion::PreparedTrajectory prepared(axes, plan.points,
                                              std::vector<motion::MotionState>(axes.size()));
    benchmark::DoNotOptimize(&prepared);
  }
  const auto rounds = static_cast<std::int64_t>(state.iterations());
  state.SetItemsProcessed(rounds * static_cast<std::int64_t>(kSegments));
  state.counters["points_per_segment"] = static_cast<double>(points) / kSegments;
  state.counters["motion_s"] = seconds;
}
BENCHMARK_CAPTURE(plan, circles, circles)->Name("Path/circles_of_lines");
BENCHMARK_CAPTURE(plan, zigzag, zigzag)->Name("Path/random_lines");
BENCHMARK_CAPTURE(plan, chords, chords)->Name("Path/chords");
BENCHMARK_CAPTURE(plan, waves, waves)->Name("Path/beziers");
constexpr double kJerk = 20.0 * 80'000.0;  // microsteps/s^3
BENCHMARK_CAPTURE(plan, smooth_circles, circles, kJerk)->Name("Path/circles_of_lines_with_jerk");
BENCHMARK_CAPTURE(plan, smooth_circle, circle, kJerk)->Name("Path/circle_of_1000_lines_with_jerk");
BENCHMARK_CAPTURE(plan, smooth_zigzag, zigzag, kJerk)->Name("Path/random_lines_with_jerk");
BENCHMARK_CAPTURE(plan, smooth_chords, chords, kJerk)->Name("Path/chords_with_jerk");
BENCHMARK_CAPTURE(plan, smooth_waves, waves, kJerk)->Name("Path/beziers_with_jerk");

}  // namespace
}  // namespace stepdriver::bench
