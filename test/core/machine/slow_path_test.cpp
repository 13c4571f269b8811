#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/machine/coordinated_move.h"
#include "support/constants.h"
#include "support/planned_path.h"

// Paths on which a ramp lasts microseconds and the way at constant speed minutes: what the plan
// leaves out of the ramp must not change the way.

namespace stepdriver {
namespace {

using motion::PathRequest;
using motion::PathSegment;
using test::AxisSteps;
using test::pathAxis;
using test::PathAxisLimits;
using test::planned;
using test::PlannedPath;

PathRequest lines(const std::vector<std::pair<double, double>>& ends_and_speeds) {
  PathRequest request{{"x"}, {}, false, 0.0, 0.0};
  for (const auto& [end, speed] : ends_and_speeds) {
    PathSegment& segment = request.segments.emplace_back();
    segment.end = {end};
    segment.velocity = speed;
  }
  return request;
}

/// Each step leads ahead, the last one to the end, and none comes sooner than the speeds allow.
void expectSteadySteps(const PathRequest& request, const PathAxisLimits& limits) {
  const PlannedPath path = planned(request, {pathAxis("x", limits)});
  const AxisSteps steps = path.steps(0);
  const double scale = limits.steps_per_unit;
  ASSERT_EQ(static_cast<std::int64_t>(steps.size()),
            std::llround(request.segments.back().end[0] * scale));
  double fastest = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    ASSERT_EQ(steps[i].second, 1) << "step " << i;
    if (i == 0) continue;
    const double interval = static_cast<double>(steps[i].first - steps[i - 1].first) * 1e-9;
    const double place = (static_cast<double>(i) - 0.5) / scale;
    // The last microstep of a segment may already have the speed of the next one.
    double allowed = 0.0;
    for (std::size_t k = 0; k < request.segments.size(); ++k) {
      const double begin = k == 0 ? 0.0 : request.segments[k - 1].end[0];
      const bool touches =
          begin <= place + 1.5 / scale && request.segments[k].end[0] >= place - 1.5 / scale;
      if (touches) allowed = std::max(allowed, request.segments[k].velocity);
    }
    fastest = std::max(fastest, 1.0 / (scale * interval) / allowed);
  }
  EXPECT_LE(fastest, 1.0001);
  double shortest = 0.0;
  double before = 0.0;
  for (const PathSegment& segment : request.segments) {
    shortest += (segment.end[0] - before) / segment.velocity;
    before = segment.end[0];
  }
  EXPECT_LE(path.duration(), shortest + 0.2);
}

TEST(SlowPath, OfAHalfMillimetreMakesItsFortySteps) {
  expectSteadySteps(lines({{0.0005, 7e-6}}), {80'000.0, 0.1, 3.0, 100.0});
}

TEST(SlowPath, OfARotaryAxisTurnsOnlyToItsEnd) {
  // 3200 microsteps a revolution.
  motion::PathAxis axis = pathAxis("x", {3200.0 / (2.0 * test::kPi), 10.0, 3000.0, 1e5});
  axis.kind = config::Kind::kRotary;
  const PlannedPath path = planned(lines({{0.5, 1e-3}}), {axis});
  const AxisSteps steps = path.steps(0);
  EXPECT_EQ(steps.size(), 255U);
  EXPECT_TRUE(std::all_of(steps.begin(), steps.end(), [](const auto& s) { return s.second == 1; }));
}

TEST(SlowPath, ThatSlowsDownOnTheWayStaysOnIt) {
  for (const double jerk : {10'000.0, 0.0}) {
    SCOPED_TRACE(jerk);
    expectSteadySteps(lines({{0.010, 1e-3}, {0.110, 1e-4}}), {80'000.0, 0.1, 60.0, jerk});
  }
}

TEST(SlowPath, KeepsItsSpeedAllAlongALine) {
  for (const double jerk : {1000.0, 0.0}) {
    SCOPED_TRACE(jerk);
    expectSteadySteps(lines({{0.002, 1e-5}}), {80'000.0, 0.1, 3.0, jerk});
  }
}

}  // namespace
}  // namespace stepdriver
