#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>

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

}  // namespace
}  // namespace stepdriver
