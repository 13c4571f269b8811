#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/trajectory_bench.h"

// Paths of several axes, as the pins show them. The axes are the plotter's: 80 microsteps/mm,
// 100 mm/s, 1000 mm/s^2.

namespace stepdriver::test {

using machine::CoordinatedMove;
using machine::CoordinatedResult;
using motion::PathRequest;
using motion::PathSegment;

inline constexpr double kRadius = 0.020;       // m
inline constexpr double kTolerance = 20e-6;    // m
inline constexpr double kMicrostep = 12.5e-6;  // m

using Place = std::array<double, 2>;

inline PathSegment lineTo(std::vector<double> end) {
  PathSegment segment;
  segment.end = std::move(end);
  return segment;
}

inline PathSegment arcTo(std::vector<double> end, Place centre) {
  PathSegment segment = lineTo(std::move(end));
  segment.shape = PathSegment::Shape::kArcAround;
  segment.plane = {"x", "y"};
  segment.point = centre;
  return segment;
}

inline Place onCircle(double turn) {
  return {kRadius * (std::cos(2.0 * kPi * turn) - 1.0), kRadius * std::sin(2.0 * kPi * turn)};
}

/// The circle of 100 lines, around (-20 mm, 0), at the speed of the axes.
inline PathRequest circle() {
  PathRequest request{{"x", "y"}, {}, false, 0.1, kTolerance};
  for (int i = 1; i <= 100; ++i) {
    const Place place = i == 100 ? Place{0.0, 0.0} : onCircle(i / 100.0);
    request.segments.push_back(lineTo({place[0], place[1]}));
  }
  return request;
}

/// Two corners, an arc and a Bezier.
inline PathRequest mixed() {
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
  request.segments = {lineTo({0.010, 0.0}), lineTo({0.010, 0.010}),
                      arcTo({0.0, 0.020}, {0.0, 0.010}), lineTo({-0.010, 0.010})};
  request.segments.back().shape = PathSegment::Shape::kBezier;
  request.segments.back().control1 = {-0.005, 0.030};
  request.segments.back().control2 = {-0.015, 0.020};
  return request;
}

/// 59 mm along x in lines of 1 mm, with a corner after each: the axes are at their limits on all of
/// it.
inline PathRequest corrugated() {
  PathRequest request{{"x", "y"}, {}, false, 0.0, 200e-6};
  for (int i = 1; i < 60; ++i) {
    request.segments.push_back(lineTo({0.001 * i, i % 2 == 1 ? 0.0005 : 0.0}));
  }
  return request;
}

inline double distanceTo(const Place& point, const Place& a, const Place& b) {
  const double x = b[0] - a[0];
  const double y = b[1] - a[1];
  const double along = ((point[0] - a[0]) * x + (point[1] - a[1]) * y) / (x * x + y * y);
  const double part = std::clamp(along, 0.0, 1.0);
  return std::hypot(point[0] - a[0] - part * x, point[1] - a[1] - part * y);
}

/// The outputs of a plotter: a pen, and a laser that a stop switches off.
inline std::vector<config::OutputConfig> penAndLaser() {
  std::vector<config::OutputConfig> outputs(2);
  outputs[0].name = "pen";
  outputs[0].line = "pen.line";
  outputs[1].name = "laser";
  outputs[1].line = "laser.line";
  outputs[1].active_level = false;
  outputs[1].at_stop = false;
  return outputs;
}

/// Two plotter axes, x and y.
class PathBench : public TrajectoryBench {
 protected:
  void SetUp() override { build({plotterAxis("x"), plotterAxis("y")}); }

  static config::AxisConfig plotterAxis(const std::string& name) {
    config::AxisConfig config = linearAxis(name);
    config.endstop_min.reset();
    config.min_position = -0.1;
    config.start_speed = 0.002;
    return config;
  }

  CoordinatedMove followPath(const PathRequest& request) { return machine().followPath(request); }
  CoordinatedResult finish(const PathRequest& request) {
    return machine().wait(followPath(request));
  }

  /// The places at which x and y are after each pulse of either.
  std::vector<Place> pulsePlaces() {
    struct Step {
      double time;
      std::size_t axis;
      std::int64_t count;
    };
    std::vector<Step> steps;
    const MotionTrace trace(*bench);
    const std::array<std::string, 2> names{"x", "y"};
    for (std::size_t k = 0; k < 2; ++k) {
      for (const MotionTrace::Step& step : trace.steps(names[k])) {
        steps.push_back({step.time, k, step.count});
      }
    }
    std::sort(steps.begin(), steps.end(),
              [](const Step& a, const Step& b) { return a.time < b.time; });
    std::vector<Place> places;
    Place now{0.0, 0.0};
    for (const Step& step : steps) {
      now[step.axis] = static_cast<double>(step.count) * kMicrostep;
      places.push_back(now);
    }
    return places;
  }

  /// The farthest that a place of the pulses is from a polyline.
  static double farthest(const std::vector<Place>& places, const std::vector<Place>& polyline) {
    double worst = 0.0;
    for (const Place& place : places) {
      double nearest = std::numeric_limits<double>::infinity();
      for (std::size_t i = 1; i < polyline.size(); ++i) {
        nearest = std::min(nearest, distanceTo(place, polyline[i - 1], polyline[i]));
      }
      worst = std::max(worst, nearest);
    }
    return worst;
  }

  static std::vector<Place> corners(const PathRequest& request) {
    std::vector<Place> places{{0.0, 0.0}};
    for (const PathSegment& segment : request.segments) {
      places.push_back({segment.end[0], segment.end[1]});
    }
    return places;
  }

  void expectAtRest() {
    for (const std::string name : {"x", "y"}) {
      EXPECT_EQ(violationsOf(bench->report(name)), "") << name;
      EXPECT_NEAR(state(name).position, static_cast<double>(bench->pulses(name)) * kMicrostep,
                  1e-12);
    }
  }
};

/// Half a microstep of each axis, the diagonal of half a microstep of both.
inline const double kHalfMicrosteps = std::sqrt(0.5) * kMicrostep;

}  // namespace stepdriver::test
