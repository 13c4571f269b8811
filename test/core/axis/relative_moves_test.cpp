#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"

// A relative move counts from the commanded position, which need not be at a microstep.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;

constexpr double kUnevenScale = 80'370.0;  // [microsteps/m]
constexpr double kMicrostep = 1.0 / kUnevenScale;

config::AxisConfig axisNamed(const char* name, double backlash = 0.0) {
  config::AxisConfig config = test::linearAxis(name);
  config.steps_per_unit = kUnevenScale;
  config.backlash = backlash;
  return config;
}

class RelativeMoves : public testing::Test {
 protected:
  void build(double backlash = 0.0) {
    std::vector<config::AxisConfig> axes{axisNamed("x", backlash), axisNamed("y")};
    for (config::AxisConfig& axis : axes) {
      axis.endstop_min.reset();
      axis.endstop_max.reset();
    }
    bench.emplace(axes);
  }
  void SetUp() override { build(); }

  axis::Axis& x() { return bench->axis(); }
  /// [microsteps]
  double position() { return x().state().position * kUnevenScale; }
  void move(double way) {
    const axis::MoveResult result = x().wait(x().moveTo(way, true));
    ASSERT_EQ(result.end, MoveEnd::kReached) << result.message;
  }
  void moveOften(int count, double way) {
    for (int i = 0; i < count; ++i) move(way);
  }

  std::optional<Bench> bench;
};

TEST_F(RelativeMoves, AddUpWithoutRounding) {
  moveOften(1000, 0.0001);
  EXPECT_EQ(bench->pulses(), 8037);
}

TEST_F(RelativeMoves, OfLessThanAMicrostepAddUp) {
  moveOften(1000, 0.4 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 400);
  moveOften(1000, 0.52 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 920);
  moveOften(1000, -0.92 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 0);
}

TEST_F(RelativeMoves, AddUpOverABacklash) {
  build(20.0 * kMicrostep);
  for (int i = 0; i < 300; ++i) {
    move(5.3 * kMicrostep);
    move(-4.9 * kMicrostep);
  }
  EXPECT_DOUBLE_EQ(position(), 120.0);
}

TEST_F(RelativeMoves, OfRoundsAddUp) {
  for (int i = 0; i < 300; ++i) x().wait(x().moveRounds(0.33333));
  EXPECT_EQ(bench->pulses(), std::llround(0.33333 * 3200.0 * 300.0));
}

TEST_F(RelativeMoves, OfLinesAddUp) {
  for (int i = 0; i < 400; ++i) {
    const auto line =
        bench->machine->moveLine({{"x", "y"}, {2.4 * kMicrostep, -1.35 * kMicrostep}, true});
    ASSERT_EQ(bench->machine->wait(line).end, MoveEnd::kReached);
  }
  EXPECT_EQ(bench->pulses("x"), 960);
  EXPECT_EQ(bench->pulses("y"), -540);
}

TEST_F(RelativeMoves, OfMovesThatTakeOverAddUp) {
  for (int i = 0; i < 100; ++i) {
    x().moveTo(30.4 * kMicrostep, true);
    bench->machine->advance(0.001);
  }
  bench->machine->advance(10.0);
  EXPECT_EQ(bench->pulses(), 3040);
}

TEST_F(RelativeMoves, CountFromAnAbsoluteTarget) {
  bench->move(10.4 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 10);
  move(0.4 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 11);
}

TEST_F(RelativeMoves, CountFromTheEndOfATrajectory) {
  motion::TrajectoryRequest request{{"x"}, {{0.5, {10.4 * kMicrostep}, {0.0}, {0.0}}}};
  bench->machine->wait(bench->machine->followTrajectory(request));
  move(0.4 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 11);
}

TEST_F(RelativeMoves, CountFromTheCommandedPositionAfterAHold) {
  const axis::Move first = x().moveTo(1000.4 * kMicrostep, true);
  bench->machine->advance(0.05);
  bench->machine->hold();
  bench->machine->advance(1.0);
  bench->machine->resume();
  ASSERT_EQ(x().wait(first).end, MoveEnd::kReached);
  move(0.4 * kMicrostep);
  EXPECT_EQ(bench->pulses(), 1001);
}

TEST_F(RelativeMoves, AreToldWithTheirTargetAndWhereTheyComeToRest) {
  const axis::Move forward = x().moveTo(2.4 * kMicrostep, true);
  EXPECT_NEAR(forward.target, 2.4 * kMicrostep, 1e-12);
  EXPECT_NEAR(forward.rest, 2.0 * kMicrostep, 1e-12);
  x().wait(forward);
  const axis::Move on = x().moveTo(0.2 * kMicrostep, true);
  EXPECT_NEAR(on.target, 2.6 * kMicrostep, 1e-12);
  EXPECT_NEAR(on.rest, 3.0 * kMicrostep, 1e-12);
}

/// Actions after which the commanded position is the actual position of the axis.
struct Ending {
  const char* name;
  std::function<void(Bench&)> happen;
};

class RelativeMovesAfter : public testing::TestWithParam<Ending> {};

TEST_P(RelativeMovesAfter, CountFromWhereTheAxisStands) {
  Bench bench({axisNamed("x")});
  axis::Axis& x = bench.axis();
  bench.move(10.4 * kMicrostep);
  GetParam().happen(bench);
  bench.machine->advance(10.0);
  const std::int64_t before = bench.pulses();
  const axis::MoveResult result = x.wait(x.moveTo(0.4 * kMicrostep, true));
  ASSERT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench.pulses(), before);
}

INSTANTIATE_TEST_SUITE_P(
    , RelativeMovesAfter,
    testing::Values(
        Ending{"Stop", [](Bench& bench) { bench.axis().stop(); }},
        Ending{"StopOfAll", [](Bench& bench) { bench.machine->stop(); }},
        Ending{"StopInAMove",
               [](Bench& bench) {
                 bench.axis().moveTo(0.01);
                 bench.machine->advance(0.05);
                 bench.axis().stop();
               }},
        Ending{"EmergencyStop",
               [](Bench& bench) {
                 bench.machine->emergencyStop();
                 bench.machine->recover();
               }},
        Ending{"SetPosition",
               [](Bench& bench) { bench.axis().setPosition(bench.axis().state().position); }},
        Ending{"Endstop",
               [](Bench& bench) { ASSERT_EQ(bench.move(0.2).end, MoveEnd::kEndstopMax); }},
        Ending{"Jog",
               [](Bench& bench) {
                 bench.axis().jog(0.05);
                 bench.machine->advance(0.1);
                 bench.axis().jog(0.0);
               }}),
    [](const auto& param) { return std::string(param.param.name); });

}  // namespace
}  // namespace stepdriver
