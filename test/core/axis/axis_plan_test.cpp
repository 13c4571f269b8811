#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <string>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

// Plans of moves, at 80 microsteps/mm, 100 mm/s and 1000 mm/s^2.

namespace stepdriver {
namespace {

using axis::MovePiece;
using axis::MovePlan;
using test::Bench;
using test::linearAxis;
using test::refusal;

double endOf(const MovePiece& piece) {
  const double t = piece.duration;
  return piece.position +
         t * (piece.velocity + t * (piece.acceleration / 2.0 + t * piece.jerk / 6.0));
}

double endSpeedOf(const MovePiece& piece) {
  return piece.velocity + piece.duration * (piece.acceleration + piece.duration * piece.jerk / 2.0);
}

/// Expects pieces that join, from the first state to rest at the target.
void expectJoined(const MovePlan& plan, double from, double speed) {
  double duration = 0.0;
  for (const MovePiece& piece : plan.pieces) {
    EXPECT_NEAR(piece.position, from, 1e-9);
    EXPECT_NEAR(piece.velocity, speed, 1e-6);
    from = endOf(piece);
    speed = endSpeedOf(piece);
    duration += piece.duration;
  }
  EXPECT_NEAR(from, plan.move.target, 1e-9);
  EXPECT_NEAR(speed, 0.0, 1e-6);
  EXPECT_NEAR(duration, plan.move.duration, 2e-9);
}

TEST(AxisPlan, IsWhatTheMoveThenIs) {
  Bench bench({linearAxis("x")});
  const MovePlan plan = bench.axis().plan(0.05, false, 0.08);
  ASSERT_EQ(plan.pieces.size(), 3U);
  EXPECT_NEAR(plan.pieces[0].acceleration, 1.0, 1e-9);
  EXPECT_NEAR(plan.pieces[1].velocity, 0.08, 1e-9);
  EXPECT_NEAR(plan.pieces[2].acceleration, -1.0, 1e-9);
  EXPECT_EQ(plan.steps_per_unit, 80'000.0);
  expectJoined(plan, 0.0, 0.0);
  const axis::Move move = bench.axis().moveTo(0.05, false, 0.08);
  EXPECT_EQ(move.target, plan.move.target);
  EXPECT_NEAR(move.duration, plan.move.duration, 1e-9);
}

TEST(AxisPlan, MovesNothing) {
  Bench bench({linearAxis("x")});
  bench.axis().plan(0.05);
  bench.machine->advance(2.0);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_FALSE(bench.axis().state().moving);
  EXPECT_EQ(bench.axis().state().target, 0.0);
}

TEST(AxisPlan, HasTheJerkOfAnSCurve) {
  config::AxisConfig config = linearAxis("x");
  config.jerk = 20.0;
  Bench bench({config});
  const MovePlan plan = bench.axis().plan(-0.05);
  ASSERT_GE(plan.pieces.size(), 5U);
  EXPECT_NEAR(plan.pieces.front().jerk, -20.0, 1e-9);
  expectJoined(plan, 0.0, 0.0);
}

TEST(AxisPlan, BeginsWithTheSpeedOfAMotionUnderWayAndLeavesItAlone) {
  Bench bench({linearAxis("x")});
  const axis::Move move = bench.axis().moveTo(0.09);
  bench.machine->advance(0.5);
  const axis::AxisState state = bench.axis().state();
  const MovePlan back = bench.axis().plan(-0.05);
  expectJoined(back, state.planned, state.velocity);
  EXPECT_NEAR(state.velocity, 0.1, 1e-9);
  EXPECT_GT(back.move.duration, 1.0);
  const axis::MoveResult result = bench.axis().wait(move);
  EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench.pulses(), 7200);
}

TEST(AxisPlan, SaysHowFarItPassesATargetThatItCannotStopBefore) {
  Bench bench({linearAxis("x")});
  bench.axis().moveTo(0.09);
  bench.machine->advance(0.5);
  const double at = bench.axis().state().planned;
  const MovePlan plan = bench.axis().plan(at + 0.001);
  EXPECT_NEAR(plan.move.overshoot, 0.005 - 0.001, 1e-4) << "v^2 / 2a less the way";
}

TEST(AxisPlan, IsRefusedAsTheMoveIs) {
  config::AxisConfig config = linearAxis("x");
  config.max_position = 0.08;
  Bench bench({config});
  const auto expect_same = [&](double position, double velocity, const std::string& words) {
    const std::string said = refusal([&] { bench.axis().plan(position, false, velocity); });
    EXPECT_EQ(said, refusal([&] { bench.axis().moveTo(position, false, velocity); }));
    EXPECT_NE(said.find(words), std::string::npos) << said;
  };
  expect_same(0.09, 0.0, "above the soft limit");
  expect_same(std::numeric_limits<double>::quiet_NaN(), 0.0, "finite");
  expect_same(0.05, 0.2, "above the maximum");
  expect_same(-0.05, -0.1, "velocity");
  bench.axis().enable(false);
  expect_same(0.05, 0.0, "disabled");
}

}  // namespace
}  // namespace stepdriver
