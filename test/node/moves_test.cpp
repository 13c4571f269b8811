#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/MoveRounds.h>
#include <stepdriver/SetPosition.h>

#include <cmath>
#include <future>
#include <limits>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/rotary_axis.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

MoveRounds::Request rounds(double count, double velocity = 0.0) {
  MoveRounds::Request request;
  request.rounds = count;
  request.velocity = velocity;
  request.wait = true;
  return request;
}

TEST(Moves, AnswersOnAcceptanceWithTargetAndPlannedDuration) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const auto answer = node.moveTo(0.15, false);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.position, 0.15, 1e-9);
  // 0.1 m/s and 0.5 m/s^2: 0.15 / 0.1 + 0.1 / 0.5
  EXPECT_NEAR(answer.duration, 1.7, 0.01);
  EXPECT_LT(node.pulses(), 12000) << "the answer came after the move";
}

TEST(Moves, WaitingAnswersWhenTheMoveHasEndedAndWhere) {
  NodeUnderTest node;
  node.start();
  const auto answer = node.moveTo(0.0125, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.position, 0.0125, kHalfStep);
  EXPECT_NEAR(answer.duration, 2.0 * std::sqrt(0.0125 / 0.5), 0.01);
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0), 1000);
  EXPECT_EQ(report.pulses_backward.at(0), 0);
  EXPECT_NEAR(report.carriage.at(0), 0.0125, kHalfStep);
  EXPECT_EQ(report.violations.at(0), 0) << report.violation_kinds.at(0);
  EXPECT_EQ(report.violation_kinds.at(0), "none");
}

TEST(Moves, GoesToAbsoluteAndRelativeTargets) {
  NodeUnderTest node;
  node.start();
  MoveTo::Request request;
  request.position = 0.02;
  request.wait = true;
  EXPECT_NEAR(node.call<MoveTo>("x/move_to", request).position, 0.02, kHalfStep);
  request.position = -0.005;
  request.relative = true;
  EXPECT_NEAR(node.call<MoveTo>("x/move_to", request).position, 0.015, kHalfStep);
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0), 1600);
  EXPECT_EQ(report.pulses_backward.at(0), 400);
}

TEST(Moves, KeepsToTheVelocityOfTheRequest) {
  NodeUnderTest node;
  node.start();
  const auto answer = node.moveTo(0.05, true, 0.02);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.duration, 0.05 / 0.02 + 0.02 / 0.5, 0.01);
}

TEST(Moves, TakesAMoveToWhereItStandsAsReached) {
  NodeUnderTest node;
  node.start();
  const auto answer = node.moveTo(0.0, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.pulses(), 0);
}

TEST(Moves, TurnsByRoundsThatNeedNotBeWhole) {
  NodeUnderTest node;
  node.start();
  auto answer = node.call<MoveRounds>("x/move_rounds", rounds(1.5));
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.position, 0.06, kHalfStep);
  answer = node.call<MoveRounds>("x/move_rounds", rounds(-0.25));
  EXPECT_TRUE(answer.success) << answer.message;
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0), 4800);
  EXPECT_EQ(report.pulses_backward.at(0), 800);
}

TEST(Moves, RefusesRoundsWhereTheirStepsAreNotKnown) {
  NodeUnderTest node;
  node.erase("axes/x/steps_per_round");
  node.start();
  const auto answer = node.call<MoveRounds>("x/move_rounds", rounds(1.0));
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "steps_per_round");
  EXPECT_EQ(node.pulses(), 0);
}

struct BadMove {
  double position;
  double velocity;
  std::string words;
};

TEST(Moves, RefusesBadNumbersWithoutAPulse) {
  NodeUnderTest node;
  node.start();
  const std::vector<BadMove> moves = {
      {kNan, 0.0, "finite"},       {kInfinity, 0.0, "finite"},    {-kInfinity, 0.0, "finite"},
      {0.25, 0.0, "max_position"}, {-0.01, 0.0, "min_position"},  {1e300, 0.0, "max_position"},
      {0.01, kNan, "velocity"},    {0.01, kInfinity, "velocity"}, {0.01, -0.05, "velocity"},
      {0.01, 0.2, "maximum"},
  };
  for (const BadMove& move : moves) {
    const auto answer = node.moveTo(move.position, true, move.velocity);
    EXPECT_FALSE(answer.success) << move.position << " at " << move.velocity;
    expectSays(answer.message, move.words);
    EXPECT_EQ(answer.position, 0.0);
    EXPECT_EQ(answer.duration, 0.0);
  }
  for (const double bad : {kNan, kInfinity, -1.0, 1e300}) {
    const auto answer = node.call<MoveRounds>("x/move_rounds", rounds(bad));
    EXPECT_FALSE(answer.success) << bad;
    EXPECT_FALSE(answer.message.empty());
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST(Moves, RefusesWhileDisabled) {
  NodeUnderTest node;
  node.set("axes/x/enable_on_start", false);
  node.start();
  const auto answer = node.moveTo(0.01, true);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "disabled");
  EXPECT_EQ(node.pulses(), 0);
}

TEST(Moves, RefusesWhileAsleep) {
  NodeUnderTest node;
  node.start();
  std_srvs::SetBool::Request on;
  on.data = true;
  EXPECT_TRUE(node.call<std_srvs::SetBool>("x/sleep", on).success);
  const auto answer = node.moveTo(0.01, true);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "asleep");
  EXPECT_EQ(node.pulses(), 0);
}

TEST(Moves, ReplacesATargetWhileMovingAndTellsWhoeverWaitsForTheFirst) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  auto first = std::async(std::launch::async, [&node] { return node.moveTo(0.15, true); });
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 4000; }));
  const auto second = node.moveTo(0.01, true);
  EXPECT_TRUE(second.success) << second.message;
  EXPECT_NEAR(second.position, 0.01, 1e-12);
  const auto replaced = first.get();
  EXPECT_FALSE(replaced.success);
  expectSays(replaced.message, "a move to 0.01 m took over");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0) - report.pulses_backward.at(0), 800);
  EXPECT_EQ(report.violations.at(0), 0U) << report.violation_kinds.at(0);
}

TEST(Moves, SaysWhereItPassesItsTargetFirst) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.set("axes/x/deceleration_mm_s2", 50.0);  // 100 mm to rest
  node.start();
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 2400; }));
  const auto nearer = node.moveTo(0.08, false);
  EXPECT_TRUE(nearer.success) << nearer.message;
  expectSays(nearer.message, "it can't stop before that, overshoots by ");
  expectSays(nearer.message, ", and comes back");
}

TEST(Moves, RefusesABadTargetWhileMovingAndKeepsTheOneItHas) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  EXPECT_TRUE(node.moveTo(0.1, false).success);
  const auto beyond = node.moveTo(0.3, true);
  EXPECT_FALSE(beyond.success);
  expectSays(beyond.message, "soft limit");
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 8000; }));
  EXPECT_EQ(node.rig().pulses_backward.at(0), 0);
}

TEST(Moves, CountsRadiansOnARotaryAxis) {
  NodeUnderTest node;
  makeRotary(node);
  node.start();
  const auto answer = node.moveTo(kPi / 2.0, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.position, kPi / 2.0, 1e-9);
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0), 800);
  EXPECT_NEAR(report.carriage.at(0), kPi / 2.0, 1e-9);
}

}  // namespace
}  // namespace stepdriver::node_test
