#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/motion_trace.h"
#include "support/trajectory_bench.h"

// The motion of scripts/demo.sh, and a path of every shape. scripts/cross.sh compares their traces
// with those that another processor makes.

namespace stepdriver {
namespace {

using motion::PathRequest;
using motion::PathSegment;

class DemoTraces : public test::TrajectoryBench {
 protected:
  /// The axis of config/a4988.yaml, with room on both sides.
  static config::AxisConfig demoAxis(const std::string& name) {
    config::AxisConfig config = test::linearAxis(name, 80'000.0, 0.1, 0.5);
    config.endstop_min.reset();
    config.min_position = -0.1;
    return config;
  }
};

TEST_F(DemoTraces, AThousandStepsOutAndBack) {
  build({demoAxis("x")});
  const test::MotionTrace trace(*bench);
  for (const double target : {0.0125, 0.0}) {
    const axis::MoveResult result = bench->move(target);
    EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
    EXPECT_NEAR(result.duration, 2.0 * std::sqrt(0.0125 / 0.5), 1e-8);
  }
  const sim::RigAxisReport report = bench->report();
  EXPECT_EQ(report.pulses_forward, 1000);
  EXPECT_EQ(report.pulses_backward, 1000);
  EXPECT_EQ(test::violationsOf(report), "");
  trace.keep("demo");
}

TEST_F(DemoTraces, APathOfEveryShape) {
  build({demoAxis("x"), demoAxis("y")});
  const test::MotionTrace trace(*bench);
  const auto to = [](double x, double y) {
    PathSegment segment;
    segment.end = {x, y};
    return segment;
  };
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
  request.segments = {to(0.0101, 0.0007), to(0.0103, 0.0107), to(0.0003, 0.0207),
                      to(-0.0107, 0.0103)};
  request.segments[2].shape = PathSegment::Shape::kArcAround;
  request.segments[2].plane = {"x", "y"};
  request.segments[2].point = {0.0003, 0.0107};
  request.segments[3].shape = PathSegment::Shape::kBezier;
  request.segments[3].control1 = {-0.0051, 0.0303};
  request.segments[3].control2 = {-0.0153, 0.0201};
  const machine::CoordinatedResult result = machine().wait(machine().followPath(request));
  EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), std::lround(-0.0107 * 80'000.0));
  EXPECT_EQ(bench->pulses("y"), std::lround(0.0103 * 80'000.0));
  EXPECT_EQ(test::violationsOf(bench->report("x")), "");
  EXPECT_EQ(test::violationsOf(bench->report("y")), "");
  trace.keep("path");
}

}  // namespace
}  // namespace stepdriver
