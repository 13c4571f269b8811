#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <functional>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/refusal.h"
#include "support/trajectory_bench.h"

// Trajectories that begin later, while their axes move. 1000 steps/m, 2 m/s, 10 m/s^2.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::CoordinatedMove;
using machine::CoordinatedResult;
using machine::SetpointMode;
using motion::TrajectoryRequest;
using test::refusal;
using test::trajectoryAxis;

TrajectoryRequest later(double begin_in, const std::vector<std::string>& names,
                        const std::vector<motion::TrajectoryPoint>& points) {
  TrajectoryRequest request{names, points};
  request.begin_in = begin_in;
  return request;
}

// To rest at 2 m, in a second.
TrajectoryRequest toTwo(double begin_in) {
  return later(begin_in, {"x"}, {{1.0, {2.0}, {0.0}, {}}});
}

class LaterTrajectory : public test::TrajectoryBench {
 protected:
  std::int64_t now() { return bench->clock.now(); }
  axis::Axis& x() { return bench->axis("x"); }
  std::vector<std::int64_t> edges(const std::string& axis = "x") {
    return bench->trace->times(axis, "step", true);
  }
  /// x in the middle of a move to 3 m at 1 m/s.
  axis::Move move() {
    const axis::Move begun = x().moveTo(3.0, false, 1.0);
    advance(0.3);
    return begun;
  }
  /// Compares rising edges of x from the n-th on with the times at which a curve crosses the lines
  /// between microsteps. @param place [steps] at a time [ns]; it rises from `from` to `to`.
  void expectEdges(std::size_t first, std::size_t last, std::int64_t from, std::int64_t to,
                   const std::function<double(double)>& place) {
    const std::vector<std::int64_t> found = edges();
    ASSERT_LE(last, found.size());
    for (std::size_t k = first; k < last; ++k) {
      auto low = static_cast<double>(from);
      auto high = static_cast<double>(to);
      for (int i = 0; i < 80; ++i) {
        const double middle = (low + high) / 2.0;
        (place(middle) < static_cast<double>(k) + 0.5 ? low : high) = middle;
      }
      ASSERT_NEAR(static_cast<double>(found[k]), low, 2.0) << "edge " << k;
    }
  }
  void expectDropped(const CoordinatedMove& dropped, MoveEnd end, const std::string& why) {
    const auto result = machine().result(dropped);
    ASSERT_TRUE(result.has_value()) << why;
    EXPECT_EQ(result->end, end) << result->message;
    EXPECT_NE(result->message.find(why), std::string::npos) << result->message;
  }
};

TEST_F(LaterTrajectory, TakesOverFromAMoveAtItsNanosecond) {
  const axis::Move before = move();
  const double stamp = static_cast<double>(now()) + 0.7e9;
  const CoordinatedMove wanted = follow(toTwo(0.7));
  EXPECT_NEAR(wanted.duration, 1.0, 1e-9);
  EXPECT_FALSE(x().result(before).has_value()) << "it continues until then";
  advance(0.699);
  const std::size_t until_then = edges().size();
  const CoordinatedResult result = machine().wait(wanted);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(x().result(before)->end, MoveEnd::kReplaced);
  ASSERT_EQ(bench->pulses("x"), 2000);
  // At 1 m/s from its 51st step on: from there to the stamp each step takes a millisecond.
  const std::vector<std::int64_t> found = edges();
  for (std::size_t k = 60; k < until_then; ++k) {
    EXPECT_NEAR(static_cast<double>(found[k] - found[k - 1]), 1e6, 2.0) << k;
  }
  // From the position and the velocity of that nanosecond on, a cubic to 2000 steps at rest.
  const double at = static_cast<double>(found[until_then - 1]);
  const double place = static_cast<double>(until_then) - 0.5 + (stamp - at) * 1e-6;
  const double way = 2000.0 - place;
  const auto cubic = [&](double time) {
    const double t = (time - stamp) * 1e-9;
    return place + 1000.0 * t + t * t * (3.0 * way - 2000.0) + t * t * t * (1000.0 - 2.0 * way);
  };
  expectEdges(until_then + 2, 2000, static_cast<std::int64_t>(stamp),
              static_cast<std::int64_t>(stamp) + 1'000'000'000, cubic);
  expectClean();
}

TEST_F(LaterTrajectory, BeginsAtRestIfTheMotionBeforeItHasEnded) {
  const axis::Move before = x().moveTo(1.0);
  const std::int64_t began = now();
  const CoordinatedMove wanted = follow(toTwo(3.0));
  EXPECT_EQ(machine().wait(wanted).end, MoveEnd::kReached);
  EXPECT_EQ(x().result(before)->end, MoveEnd::kReached);
  const double stamp = static_cast<double>(began) + 3e9;
  expectEdges(1000, 2000, began + 3'000'000'000, began + 4'000'000'000, [stamp](double time) {
    const double s = (time - stamp) * 1e-9;
    return 1000.0 + 1000.0 * s * s * (3.0 - 2.0 * s);
  });
  expectClean();
}

TEST_F(LaterTrajectory, TakesOverFromATrajectoryAndItsOtherAxesComeToRestThen) {
  const CoordinatedMove first = follow({{"x", "y"}, {{3.0, {2.0, 1.0}, {0.0, 0.0}, {}}}});
  advance(0.5);
  const CoordinatedMove second = follow(later(1.0, {"x"}, {{1.0, {0.5}, {0.0}, {0.0}}}));
  advance(0.99);
  EXPECT_FALSE(machine().result(first).has_value());
  const double velocity = state("x").velocity;
  EXPECT_NEAR(velocity, 1.0, 0.01);
  EXPECT_NEAR(state("y").velocity, 0.5, 0.01);
  advance(0.02);
  EXPECT_NEAR(state("x").velocity, velocity, 0.1);
  EXPECT_EQ(machine().wait(second).end, MoveEnd::kReached);
  awaitRest();
  ASSERT_TRUE(machine().result(first).has_value());
  EXPECT_EQ(machine().result(first)->end, MoveEnd::kReplaced);
  EXPECT_EQ(bench->pulses("x"), 500);
  EXPECT_LT(bench->pulses("y"), 1000);
  const test::Differences found = differences("x", 0.02);
  EXPECT_LE(found.acceleration, 10'000.0 * 1.05);
  expectClean();
}

TEST_F(LaterTrajectory, LeavesAStreamOfSetpointsAsItIsUntilThen) {
  const auto send = [this](double position) {
    const auto refusals =
        machine().followSetpoints(SetpointMode::kPosition, 0.2, {{"x", position, {}}});
    EXPECT_EQ(refusals.front(), "");
  };
  CoordinatedMove wanted;
  for (int i = 0; i < 50; ++i) {
    send(0.01 * i);  // 0.5 m/s
    if (i == 20) wanted = follow(later(0.6, {"x"}, {{1.5, {2.0}, {0.0}, {}}}));
    advance(0.02);
  }
  EXPECT_EQ(machine().result(wanted), std::nullopt);
  EXPECT_NEAR(state("x").velocity, 0.5, 0.05);
  EXPECT_EQ(machine().wait(wanted).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 2000);
  EXPECT_LE(differences("x", 0.02).acceleration, 10'000.0 * 1.05);
  expectClean();
}

TEST_F(LaterTrajectory, TakesOverFromAJog) {
  x().jog(0.5);
  advance(0.2);
  const CoordinatedMove wanted = follow(later(0.5, {"x"}, {{2.0, {2.0}, {0.0}, {}}}));
  x().jog(0.8);
  advance(0.4);
  EXPECT_NEAR(state("x").velocity, 0.8, 1e-3);
  EXPECT_EQ(machine().wait(wanted).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 2000);
  expectClean();
}

// Something that comes before a trajectory begins, and ends it.
struct Between {
  std::string name;
  std::function<void(LaterTrajectory&, machine::Machine&)> act;
  MoveEnd end;
  std::string why;
};

class DroppedTrajectory : public LaterTrajectory, public testing::WithParamInterface<Between> {};

TEST_P(DroppedTrajectory, MovesNothingAndItsCallerIsTold) {
  move();
  const CoordinatedMove wanted =
      follow(later(0.7, {"x", "y"}, {{1.0, {2.0, 0.3}, {0.0, 0.0}, {}}}));
  advance(0.2);
  GetParam().act(*this, machine());
  advance(0.001);
  expectDropped(wanted, GetParam().end, GetParam().why);
  advance(3.0);
  EXPECT_EQ(bench->pulses("y"), 0);
  EXPECT_NE(bench->pulses("x"), 2000);
}

INSTANTIATE_TEST_SUITE_P(
    By, DroppedTrajectory,
    testing::Values(
        Between{"AStop", [](auto&, auto& m) { m.stop(); }, MoveEnd::kStopped, "it was stopped"},
        Between{"AStopOfOneAxis", [](auto&, auto& m) { m.axis("x").stop(); }, MoveEnd::kStopped,
                "x: the trajectory did not begin: it was stopped"},
        Between{"AStopOfAnAxisAtRest", [](auto&, auto& m) { m.axis("y").stop(); },
                MoveEnd::kStopped, "y: the trajectory did not begin: it was stopped"},
        Between{"AHold", [](auto&, auto& m) { m.hold(); }, MoveEnd::kStopped, "put on hold"},
        Between{"ADisable", [](auto&, auto& m) { m.axis("y").enable(false); }, MoveEnd::kStopped,
                "it was disabled"},
        Between{"AnEmergencyStop", [](auto&, auto& m) { m.emergencyStop(); },
                MoveEnd::kEmergencyStop, "emergency stop"},
        Between{"AMove", [](auto&, auto& m) { m.axis("y").moveTo(0.0, true); }, MoveEnd::kReplaced,
                "another command took over"},
        Between{"ALineOfAnAxis",
                [](auto&, auto& m) {
                  m.moveLine({{"x"}, {0.1}});
                },
                MoveEnd::kStopped, "a line was to begin"},
        Between{"ATrajectory",
                [](auto&, auto& m) {
                  m.followTrajectory({{"x"}, {{2.0, {1.0}, {0.0}, {}}}});
                },
                MoveEnd::kReplaced, "another command took over"},
        Between{"AnEarlierTrajectory",
                [](auto&, auto& m) {
                  m.followTrajectory(later(0.4, {"x"}, {{1.0, {1.5}, {0.0}, {}}}));
                },
                MoveEnd::kReplaced, "another trajectory was to begin before it"},
        Between{"NewLimits",
                [](auto&, auto& m) {
                  m.axis("y").setLimits({1.0, 5.0, 5.0, 0.0});
                },
                MoveEnd::kStopped, "limits"},
        Between{"Sleep", [](auto&, auto& m) { m.axis("y").sleep(true); }, MoveEnd::kReplaced,
                "another command took over"},
        Between{"Another position", [](auto&, auto& m) { m.axis("y").setPosition(0.1); },
                MoveEnd::kStopped, "position were changed"},
        Between{"TheEnd", [](auto&, auto& m) { m.shutdown(); }, MoveEnd::kStopped,
                "the machine was shut down"}),
    [](const auto& test) {
      std::string name = test.param.name;
      for (char& letter : name) {
        if (letter == ' ') letter = '_';
      }
      return name;
    });

TEST_F(LaterTrajectory, IsDroppedByAnEndstop) {
  config::AxisConfig config = trajectoryAxis("x");
  config.max_position.reset();
  std::vector<config::AxisConfig> axes{config, trajectoryAxis("y")};
  std::vector<sim::RigAxisSpec> specs = test::Bench::rigAxes(axes);
  specs[0].max_switch->position = 800.0;
  specs[1].max_switch->position = 100'000.0;
  bench = std::make_unique<test::Bench>(axes, specs);
  x().moveTo(3.0, false, 1.0);
  advance(0.3);
  const CoordinatedMove wanted = follow(toTwo(1.0));
  advance(2.0);
  expectDropped(wanted, MoveEnd::kStopped, "an endstop was met");
  EXPECT_LT(bench->pulses("x"), 900);
}

TEST_F(LaterTrajectory, IsCancelledWithoutAStopOfTheMotionBeforeIt) {
  const axis::Move before = move();
  const CoordinatedMove wanted = follow(toTwo(0.5));
  machine().stop(wanted);
  expectDropped(wanted, MoveEnd::kStopped, "it was stopped");
  EXPECT_EQ(x().wait(before).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 3000);
}

TEST_F(LaterTrajectory, TakesOverFromAnotherOneInItsTurn) {
  move();
  const std::int64_t began = now();
  const CoordinatedMove first = follow(later(0.5, {"x", "y"}, {{1.0, {2.0, 1.0}, {0.0, 0.0}, {}}}));
  const CoordinatedMove second =
      follow(later(1.0, {"x", "y"}, {{1.0, {2.2, 0.2}, {0.0, 0.0}, {}}}));
  const CoordinatedMove third = follow(later(2.5, {"x"}, {{1.0, {1.5}, {0.0}, {}}}));
  advance(0.9);
  EXPECT_FALSE(machine().result(first).has_value());
  EXPECT_EQ(machine().wait(second).end, MoveEnd::kReached);
  EXPECT_EQ(machine().result(first)->end, MoveEnd::kReplaced);
  EXPECT_NEAR(static_cast<double>(now() - began) * 1e-9, 2.0, 1e-3);
  EXPECT_EQ(bench->pulses("x"), 2200);
  EXPECT_EQ(bench->pulses("y"), 200);
  EXPECT_EQ(machine().wait(third).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 1500);
  for (const std::string axis : {"x", "y"}) {
    EXPECT_LE(differences(axis, 0.02).acceleration, 10'000.0 * 1.05) << axis;
  }
  expectClean();
}

TEST_F(LaterTrajectory, IsRefusedIfTheLimitsDoNotAllowItFromTheStateThen) {
  move();
  // From 1 m/s at 0.95 m back to 0 in 0.2 s.
  const std::string why = refusal([&] { follow(later(0.7, {"x"}, {{0.2, {0.0}, {0.0}, {}}})); });
  EXPECT_NE(why.find("the trajectory's"), std::string::npos) << why;
  // At rest it would be possible.
  const std::string never = refusal([&] { follow(later(-1.0, {"x"}, {{0.2, {0.0}, {0.0}, {}}})); });
  EXPECT_NE(never.find("begins in -1 s"), std::string::npos) << never;
  const std::string homed = refusal([&] { follow(later(1.0, {"x"}, {{2.0, {9e9}, {0.0}, {}}})); });
  EXPECT_NE(homed.find("x"), std::string::npos);
  advance(5.0);
  EXPECT_EQ(bench->pulses("x"), 3000);
}

TEST_F(LaterTrajectory, IsCheckedAgainIfThePlanChanges) {
  x().jog(0.5);
  advance(0.2);
  const CoordinatedMove wanted = follow(later(1.0, {"x"}, {{0.4, {0.65}, {0.0}, {}}}));
  x().jog(-1.9);
  advance(0.5);
  expectDropped(wanted, MoveEnd::kStopped, "the trajectory's");
  x().stop();
}

TEST_F(LaterTrajectory, WaitsAtRestAndChecksWhereItBegins) {
  const std::int64_t began = now();
  const std::string why = refusal([&] {
    follow(later(1.0, {"x"}, {{0.0, {0.7}, {}, {}}, {1.0, {1.0}, {0.0}, {}}}));
  });
  EXPECT_NE(why.find("begins at 0.7 m"), std::string::npos) << why;
  const CoordinatedMove wanted =
      follow(later(2.0, {"x"}, {{0.0, {0.0}, {0.0}, {}}, {1.0, {1.0}, {0.0}, {}}}));
  EXPECT_FALSE(state("x").moving);
  EXPECT_EQ(machine().wait(wanted).end, MoveEnd::kReached);
  EXPECT_NEAR(static_cast<double>(now() - began) * 1e-9, 3.0, 1e-3);
  EXPECT_NEAR(static_cast<double>(edges().front() - began) * 1e-9, 2.0, 0.03);
  expectClean();
}

TEST_F(LaterTrajectory, WakesAnIdleMotorInTime) {
  config::AxisConfig y = trajectoryAxis("y");
  y.idle_timeout = 0.1;
  y.idle_action = config::IdleAction::kDisable;
  build({trajectoryAxis("x"), y});
  move();
  ASSERT_TRUE(state("y").idle);
  const CoordinatedMove wanted =
      follow(later(0.7, {"x", "y"}, {{1.0, {2.0, 0.3}, {0.0, 0.0}, {}}}));
  advance(0.6);
  EXPECT_FALSE(state("y").idle);
  EXPECT_NEAR(state("x").velocity, 1.0, 1e-3);
  EXPECT_EQ(machine().wait(wanted).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), 300);
  expectClean();
}

TEST_F(LaterTrajectory, TakesUpTheBacklashAfterAReversalBeforeIt) {
  config::AxisConfig config = trajectoryAxis("x");
  config.backlash = 0.05;
  build({config, trajectoryAxis("y")});
  x().moveTo(1.0);
  advance(0.6);
  const axis::Move back = x().moveTo(-1.0);  // it turns on the way
  const CoordinatedMove wanted = follow(later(0.8, {"x"}, {{1.5, {1.0}, {0.0}, {}}}));
  EXPECT_EQ(machine().wait(wanted).end, MoveEnd::kReached);
  EXPECT_EQ(x().result(back)->end, MoveEnd::kReplaced);
  EXPECT_NEAR(state("x").position, 1.0, 1e-9);
  EXPECT_EQ(bench->pulses("x"), 1050);
  expectClean();
}

}  // namespace
}  // namespace stepdriver
