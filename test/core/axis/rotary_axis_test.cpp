#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/refusal.h"

// Axes that turn without end: a rotary one without soft limits, and a wheel.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::kPi;
using test::linearAxis;
using test::violationsOf;

constexpr double kRound = 2.0 * kPi;

/// Full steps, without endstops and soft limits, 10 rounds/s.
config::AxisConfig turning(double steps_per_round) {
  config::AxisConfig config = linearAxis("x");
  config.kind = config::Kind::kRotary;
  config.microsteps = 1;
  config.steps_per_round = 200.0;
  config.steps_per_unit = steps_per_round / kRound;
  config.max_speed = 10.0 * kRound;
  config.acceleration = config.deceleration = 100.0 * kRound;
  config.endstop_min.reset();
  config.endstop_max.reset();
  return config;
}

TEST(RotaryAxis, WithoutSoftLimitsTurnsOnBeyondARoundAndBack) {
  Bench bench({turning(200.0)});
  EXPECT_EQ(bench.move(1000.0 * kRound).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 200'000);
  EXPECT_DOUBLE_EQ(bench.axis().state().position, 1000.0 * kRound);
  EXPECT_EQ(bench.move(-3.0 * kRound).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), -600);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(RotaryAxis, LosesNothingOverManyRoundsOneByOne) {
  Bench bench({turning(200.0)});
  for (int i = 0; i < 200; ++i) {
    axis::Axis& x = bench.axis();
    ASSERT_EQ(x.wait(x.moveTo(kRound, true)).end, MoveEnd::kReached);
  }
  EXPECT_EQ(bench.pulses(), 40'000);
}

TEST(RotaryAxis, StaysOnItsStepFarFromTheOrigin) {
  Bench bench({turning(200.0)});
  const double far = 1e9 * kRound;  // 2e11 steps
  bench.axis().setPosition(far);
  EXPECT_EQ(bench.move(far + 0.25 * kRound).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 50);
  EXPECT_EQ(bench.move(far).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
}

TEST(RotaryAxis, ThatTakesNoWholeStepsForARoundStaysWithinHalfAStep) {
  Bench bench({turning(200.0 / 3.0)});  // the motor turns once for three rounds of the axis
  for (int round = 1; round <= 100; ++round) {
    ASSERT_EQ(bench.move(round * kRound).end, MoveEnd::kReached);
    ASSERT_EQ(bench.pulses(), std::llround(round * 200.0 / 3.0)) << round;
  }
}

TEST(RotaryAxis, KeepsTheSoftLimitsThatItHas) {
  config::AxisConfig config = turning(200.0);
  config.min_position = -2.0 * kRound;
  config.max_position = 2.0 * kRound;
  Bench bench({config});
  EXPECT_REFUSED(bench.axis().moveTo(2.1 * kRound), "above the soft limit max_position");
  EXPECT_EQ(bench.move(2.0 * kRound).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 400);
}

TEST(WheelAxis, TravelsPiTimesItsDiameterInARoundOfTheMotor) {
  config::AxisConfig config = linearAxis("x");
  config.microsteps = 8;
  config.steps_per_round = 1600.0;
  config.steps_per_unit = 1600.0 / (0.1 * kPi);
  config.max_speed = 10.0;
  config.acceleration = config.deceleration = 10.0;
  config.endstop_min.reset();
  config.endstop_max.reset();
  Bench bench({config});
  axis::Axis& wheel = bench.axis();
  EXPECT_EQ(wheel.wait(wheel.moveRounds(20.0)).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 32'000);
  EXPECT_NEAR(wheel.state().position, 6.283185307, 1e-9);
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

config::AxisConfig continuous(double steps_per_round) {
  config::AxisConfig config = turning(steps_per_round);
  config.continuous = true;
  return config;
}

// From 1000 turns and a bit: to the same angle on the near side, without unwinding.
TEST(RotaryAxis, ContinuousGoesToTheNearestPlaceOfAPosition) {
  Bench bench({continuous(200.0)});
  axis::Axis& x = bench.axis();
  x.setPosition(1000.25 * kRound);
  const auto go = [&](double rounds) {
    const std::int64_t before = bench.pulses();
    EXPECT_EQ(x.wait(x.moveTo(rounds * kRound, false, 0.0, true)).end, MoveEnd::kReached);
    return bench.pulses() - before;
  };
  EXPECT_EQ(go(0.5), 50);
  EXPECT_NEAR(x.state().position, 1000.5 * kRound, 1e-9);
  EXPECT_EQ(go(-700.25), 50);
  EXPECT_EQ(go(0.5), -50);
  EXPECT_EQ(go(123.5), 0);
  EXPECT_NEAR(x.plan(0.75 * kRound, false, 0.0, true).move.target, 1000.75 * kRound, 1e-9);
  EXPECT_EQ(x.wait(x.moveTo(999.0 * kRound)).end, MoveEnd::kReached)
      << "whole turns count otherwise";
  EXPECT_EQ(bench.pulses(), -250);
}

TEST(RotaryAxis, RefusesTheShortestWayIfItHasNone) {
  Bench bench({turning(200.0)});
  EXPECT_EQ(test::refusal([&] { bench.axis().moveTo(1.0, false, 0.0, true); }),
            "x: shortest: the axis doesn't turn without end, see continuous in its parameters");
  Bench other({continuous(200.0)});
  EXPECT_EQ(test::refusal([&] { other.axis().moveTo(1.0, true, 0.0, true); }),
            "x: shortest: the position is relative, but must be absolute");
  EXPECT_NE(test::refusal([&] { other.axis().moveTo(1e300, false, 0.0, true); }), "");
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(other.pulses(), 0);
}

TEST(RotaryAxis, ContinuousFollowsATrajectoryFromTheNearestTurn) {
  struct Case {
    double stands;
    std::vector<double> points;
    double ends;
  };
  const std::vector<Case> cases = {
      {-3.14159, {3.1412, 3.0}, 3.0 - kRound},
      {7.0, {0.5}, 0.5 + kRound},
      {7.0, {0.6, 0.5, 0.4 + 3.0 * kRound}, 0.4 + 4.0 * kRound},
      {0.2, {0.1}, 0.1},
      {kPi, {-kPi}, kPi},
  };
  for (const Case& each : cases) {
    Bench bench({continuous(20000.0)});
    bench.axis().setPosition(each.stands);
    const double stood = bench.axis().state().position;
    std::vector<motion::TrajectoryPoint> points;
    double time = 0.0;
    for (const double position : each.points) {
      points.push_back({time += 10.0, {position}, {0.0}, {}});
    }
    const auto move = bench.machine->followTrajectory({{"x"}, points});
    EXPECT_EQ(bench.machine->wait(move).end, MoveEnd::kReached);
    EXPECT_NEAR(bench.axis().state().position, each.ends, kRound / 20000.0) << each.stands;
    EXPECT_EQ(bench.pulses(), std::llround((each.ends - stood) * 20000.0 / kRound)) << each.stands;
  }
}

}  // namespace
}  // namespace stepdriver
