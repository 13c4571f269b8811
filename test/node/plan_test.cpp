#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/Plan.h>

#include "support/node_under_test.h"
#include "support/says.h"

namespace stepdriver::node_test {
namespace {

Plan::Response plan(NodeUnderTest& node, double position, double velocity = 0.0) {
  Plan::Request request;
  request.position = position;
  request.velocity = velocity;
  return node.call<Plan>("x/plan", request);
}

TEST(PlanService, AnswersWithThePiecesOfAMoveAndMovesNothing) {
  NodeUnderTest node;
  node.start();
  const auto answer = plan(node, 0.1);
  EXPECT_TRUE(answer.success) << answer.message;
  expectSays(answer.message, "x: would move to 0.1 m in 1.2 s");
  EXPECT_NEAR(answer.position, 0.1, 1e-9);
  EXPECT_NEAR(answer.duration, 1.2, 1e-6);
  EXPECT_NEAR(answer.steps_per_unit, 80000.0, 1e-6);
  ASSERT_EQ(answer.pieces.size(), 3U);
  EXPECT_NEAR(answer.pieces[0].acceleration, 0.5, 1e-9);
  EXPECT_NEAR(answer.pieces[0].duration, 0.2, 1e-9);
  EXPECT_NEAR(answer.pieces[1].position, 0.01, 1e-9);
  EXPECT_NEAR(answer.pieces[1].velocity, 0.1, 1e-9);
  EXPECT_NEAR(answer.pieces[2].acceleration, -0.5, 1e-9);
  EXPECT_EQ(answer.pieces[2].jerk, 0.0);
  const auto moved = node.moveTo(0.1, true);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_EQ(node.pulses(), 8000) << "the plan has moved nothing";
}

TEST(PlanService, SaysThatTheAxisIsAlreadyThere) {
  NodeUnderTest node;
  node.start();
  EXPECT_EQ(plan(node, 0.0).message, "x: is already at 0 m");
  EXPECT_EQ(node.moveTo(0.0, false).message, "x: is already at 0 m");
  expectSays(plan(node, 0.0002).message, "to 0.0002 m in 0.04 s");
  EXPECT_EQ(node.call<std_srvs::Trigger>("recover").message, "all faults cleared");
  EXPECT_EQ(node.call<HomeAxes>("home").message, "no axis has homing configured (axes: x)");
  std_srvs::SetBool::Request release;
  EXPECT_EQ(node.call<std_srvs::SetBool>("rig/x/press_min", release).message,
            "x: the switch at the min end is released");
}

TEST(PlanService, RefusesWhatTheMoveRefuses) {
  NodeUnderTest node;
  node.start();
  const auto answer = plan(node, 0.3);
  EXPECT_FALSE(answer.success);
  EXPECT_EQ(answer.message, node.moveTo(0.3, false).message);
  expectSays(answer.message, "above the soft limit");
  EXPECT_TRUE(answer.pieces.empty());
  EXPECT_EQ(answer.duration, 0.0);
}

}  // namespace
}  // namespace stepdriver::node_test
