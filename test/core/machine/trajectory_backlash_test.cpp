#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/refusal.h"
#include "support/trajectory_bench.h"

// Trajectories of an axis x with 30 steps of backlash, and an axis y without backlash.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::CoordinatedMove;
using machine::CoordinatedResult;
using motion::TrajectoryRequest;
using test::Crossing;
using test::trajectoryAxis;

constexpr std::int64_t kBacklash = 30;

class TrajectoryWithBacklash : public test::TrajectoryBench {
 protected:
  void SetUp() override { buildWith(0.0); }
  void buildWith(double jerk) {
    std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
    axes[0].backlash = kBacklash / axes[0].steps_per_unit;
    axes[0].jerk = jerk;
    build(axes);
  }

  void expectWithin(double speed, double acceleration) {
    const test::Differences seen = differences("x", 0.01);
    EXPECT_LE(seen.speed, speed * 1000.0 * 1.01);
    // A deviation from the curve by 0.01 steps over 10 ms is 400 steps/s^2.
    EXPECT_LE(seen.acceleration, acceleration * 1000.0 * 1.01 + 400.0);
  }
};

/// The joint's position by the motor's steps: it is at rest while the backlash is taken up.
double jointAfter(const std::vector<Crossing>& steps, double time_s) {
  std::int64_t motor = 0;
  std::int64_t slack = 0;
  for (const Crossing& step : steps) {
    if (static_cast<double>(step.time_ns) * 1e-9 > time_s) break;
    const std::int64_t way = step.position > static_cast<double>(motor) ? 1 : -1;
    motor += way;
    slack = std::clamp<std::int64_t>(slack + way, 0, kBacklash);
  }
  return static_cast<double>(motor - slack);
}

TrajectoryRequest thereAndBack() {
  return {{"x", "y"},
          {{1.0, {0.5, 0.1}, {0.0, 0.3}, {0.0, 0.0}}, {2.0, {0.2, 0.4}, {0.0, 0.0}, {0.0, 0.0}}}};
}

// In steps.
double thereAndBackAt(double t) {
  const auto quintic = [](double u) { return u * u * u * (10.0 + u * (6.0 * u - 15.0)); };
  return t < 1.0 ? 500.0 * quintic(t) : 500.0 - 300.0 * quintic(t - 1.0);
}

// The joint crosses 250 steps on its way up half a second after the trajectory began.
double beginOf(const std::vector<Crossing>& steps) {
  const auto middle = std::find_if(steps.begin(), steps.end(), [](const Crossing& step) {
    return step.position >= 250.0 + kBacklash;
  });
  return static_cast<double>(middle->time_ns) * 1e-9 - 0.5;
}

TEST_F(TrajectoryWithBacklash, TakesItUpAtEachTurnWithinTheLimits) {
  const CoordinatedMove move = follow(thereAndBack());
  EXPECT_NEAR(move.duration, 2.0, 1e-9);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.positions, (std::vector<double>{0.2, 0.4}));
  EXPECT_EQ(bench->pulses("x"), 200);
  EXPECT_EQ(bench->pulses("y"), 400);
  expectWithin(2.0, 10.0);
  expectClean();

  // While the backlash is taken up, for 0.16 s, the joint lags behind by at most the backlash.
  const auto steps = crossings("x");
  const double begin = beginOf(steps);
  for (double t = 0.0; t < 2.0; t += 0.01) {
    const double lag = std::abs(jointAfter(steps, begin + t) - thereAndBackAt(t));
    const bool taken_up = (t > 0.16 && t < 1.0) || t > 1.16;
    EXPECT_LE(lag, taken_up ? 1.01 : kBacklash + 1.0) << t;
  }
}

TEST_F(TrajectoryWithBacklash, TakesNothingUpWhereItGoesOnTheSameWay) {
  EXPECT_EQ(bench->move(0.1).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 100 + kBacklash);
  const CoordinatedMove move = follow({{"x"}, {{0.6, {0.7}, {0.0}, {}}}});  // at 10 m/s^2
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 700 + kBacklash);
  expectClean();
}

TEST_F(TrajectoryWithBacklash, EndsLaterWhereItTurnsAtTheEnd) {
  const CoordinatedMove move = follow({{"x", "y"}, {{0.05, {0.001, 0.002}, {0.0, 0.0}, {}}}});
  EXPECT_GT(move.duration, 0.1);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), 1 + kBacklash);
  EXPECT_EQ(bench->pulses("y"), 2);
  EXPECT_DOUBLE_EQ(state("x").position, 0.001);
  expectWithin(2.0, 10.0);
  expectClean();
}

TEST_F(TrajectoryWithBacklash, TakesNothingUpForATurnThatMovesNothing) {
  EXPECT_EQ(bench->move(0.1).end, MoveEnd::kReached);
  const CoordinatedMove move =
      follow({{"x"}, {{0.5, {0.0997}, {0.0}, {}}, {1.5, {0.2}, {0.0}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 200 + kBacklash);
  EXPECT_EQ(bench->report("x").pulses_backward, 0);
}

TEST_F(TrajectoryWithBacklash, RefusesATurnThatLeavesNoRoom) {
  EXPECT_REFUSED(
      follow({{"x"}, {{0.6, {0.6}, {0.0}, {}}}}),
      "x: the trajectory turns 0 s after its start, and continues so close to the axis's "
      "limits that its backlash of 0.03 m can't be taken up meanwhile");
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(TrajectoryWithBacklash, KeepsToTheJerkLimitToo) {
  buildWith(60.0);
  EXPECT_EQ(machine().wait(follow(thereAndBack())).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 200);
  EXPECT_LE(differences("x", 0.06).jerk, 60.0 * 1000.0 + 400.0);
}

TEST_F(TrajectoryWithBacklash, IsReplacedWhileItIsTakenUp) {
  const CoordinatedMove first = follow(thereAndBack());
  advance(0.06);
  EXPECT_GT(bench->pulses("x"), 3);
  EXPECT_LT(bench->pulses("x"), kBacklash);
  const CoordinatedMove down = follow({{"x", "y"}, {{1.0, {-0.3, 0.0}, {0.0, 0.0}, {0.0, 0.0}}}});
  EXPECT_EQ(machine().wait(first).end, MoveEnd::kReplaced);
  EXPECT_EQ(machine().wait(down).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), -300);
  EXPECT_DOUBLE_EQ(state("x").position, -0.3);
  expectWithin(2.0, 10.0);
  expectClean();
}

TEST_F(TrajectoryWithBacklash, IsHeldWhileItIsTakenUpAndResumed) {
  const CoordinatedMove move = follow(thereAndBack());
  advance(0.06);
  machine().hold();
  awaitRest();
  EXPECT_LT(bench->pulses("x"), kBacklash + 20);
  machine().resume();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 200);
  expectWithin(2.0, 10.0);
  expectClean();
}

}  // namespace
}  // namespace stepdriver
