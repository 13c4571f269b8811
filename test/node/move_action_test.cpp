#include <actionlib_msgs/GoalStatusArray.h>
#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/MoveAction.h>

#include <cmath>
#include <future>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "support/motion_client.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using MoveClient = MotionClient<MoveAction>;

MoveGoal goalTo(double position, double velocity = 0.0, bool relative = false) {
  MoveGoal goal;
  goal.position = position;
  goal.velocity = velocity;
  goal.relative = relative;
  return goal;
}

class MoveActionTest : public testing::Test {
 protected:
  void start(double speed = 20.0) {
    node.set("simulation/speed", speed);
    node.start();
    client = std::make_unique<MoveClient>(node.full("x/move"));
  }
  /// Sends a goal, and returns while the axis is on its way.
  void setOut(const MoveGoal& goal, std::int64_t pulses = 2000) {
    client->sendGoal(goal);
    ASSERT_TRUE(waitUntil([&] { return node.pulses() > pulses; }));
  }
  void expectNoViolation() {
    const auto report = node.rig();
    EXPECT_EQ(report.violations.at(0), 0) << report.violation_kinds.at(0);
  }

  NodeUnderTest node;
  std::unique_ptr<MoveClient> client;
};

TEST_F(MoveActionTest, ReachesItsTargetAndTellsHowFarItIs) {
  start(1.0);
  EXPECT_EQ(client->run(goalTo(0.01)), State::SUCCEEDED);
  const Recorder<MoveActionFeedback> feedback(node.full("x/move/feedback"));
  ASSERT_TRUE(waitUntil([&] { return feedback.connected(); }));
  // 90 mm at 100 mm/s, with ramps of 0.2 s: 1.1 s.
  EXPECT_EQ(client->run(goalTo(0.1)), State::SUCCEEDED);
  client->expectEnd(MoveResult::REACHED, "x reached 0.1 m");
  const auto result = client->getResult();
  EXPECT_NEAR(result->position, 0.1, 1e-12);
  EXPECT_NEAR(result->duration, 1.1, 1e-3);
  EXPECT_EQ(node.pulses(), 8000);

  const auto told = feedback.messages();
  ASSERT_GT(told.size(), 3U) << "20 a second, on a machine that stalls";
  double progress = 0.0;
  double time_left = 1.2;
  bool fast = false;
  for (const auto& message : told) {
    const MoveFeedback& now = message.feedback;
    EXPECT_NEAR(now.progress, (now.position - 0.01) / 0.09, 1e-9);
    EXPECT_GE(now.progress, progress);
    EXPECT_LE(now.time_left, time_left);
    EXPECT_GE(now.time_left, 0.0);
    // The rest of the distance takes at least as long as at full speed, and at most one ramp more.
    const double left = (0.1 - now.position) / 0.1;
    EXPECT_GE(now.time_left, left - 0.001);
    EXPECT_LE(now.time_left, left + 0.201);
    progress = now.progress;
    time_left = now.time_left;
    fast = fast || now.velocity > 0.09;
  }
  EXPECT_TRUE(fast);
  EXPECT_GT(progress, 0.0);
  expectNoViolation();
}

TEST_F(MoveActionTest, MovesRelativeAndAtAVelocity) {
  start();
  EXPECT_EQ(client->run(goalTo(0.02)), State::SUCCEEDED);
  EXPECT_EQ(client->run(goalTo(0.01, 0.01, true)), State::SUCCEEDED);
  EXPECT_NEAR(client->getResult()->position, 0.03, 1e-12);
  EXPECT_GT(client->getResult()->duration, 1.0) << "10 mm at 10 mm/s";
}

TEST_F(MoveActionTest, RejectsWhatMoveToRefusesAndSaysWhy) {
  start();
  struct Bad {
    MoveGoal goal;
    const char* words;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const Bad& bad :
       {Bad{goalTo(nan), "the position is nan m, but must be a finite number"},
        Bad{goalTo(0.3), "above the soft limit max_position 0.2 m"},
        Bad{goalTo(0.1, -1.0), "the velocity is -1 m/s, but must be a finite number"},
        Bad{goalTo(0.1, 0.5), "above the maximum 0.1 m/s"}}) {
    EXPECT_EQ(client->run(bad.goal), State::REJECTED) << bad.words;
    client->expectEnd(MoveResult::REFUSED, bad.words);
    MoveTo::Request request;
    request.position = bad.goal.position;
    request.velocity = bad.goal.velocity;
    EXPECT_EQ(node.call<MoveTo>("x/move_to", request).message, client->getResult()->message);
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(MoveActionTest, DeceleratesWhenCancelled) {
  start(1.0);
  setOut(goalTo(0.15));
  client->cancelGoal();
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(MoveResult::STOPPED, "not at 0.15 m: it was stopped");
  const std::int64_t pulses = node.pulses();
  EXPECT_LT(pulses, 12000) << "not the whole way";
  EXPECT_EQ(node.pulses(), pulses) << "it rests";
  EXPECT_NEAR(client->getResult()->position, static_cast<double>(pulses) * kStep, 1e-9);
  expectNoViolation();
}

TEST_F(MoveActionTest, ANewerGoalTakesOverWithoutAStop) {
  start(1.0);
  MoveClient other(node.full("x/move"));
  const Recorder<AxisStates> states(node.full("axis_states"));
  setOut(goalTo(0.19), 3000);
  other.sendGoal(goalTo(0.18));
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(MoveResult::REPLACED, "a move to 0.18 m took over");
  client->cancelGoal();  // the goal is over
  EXPECT_EQ(other.await(), State::SUCCEEDED);
  EXPECT_EQ(node.pulses(), 14400);
  for (const AxisStates& s : states.messages()) {
    if (s.position.at(0) > 0.05 && s.position.at(0) < 0.15) {
      EXPECT_NEAR(s.velocity.at(0), 0.1, 1e-6);
    }
  }
  expectNoViolation();
}

TEST_F(MoveActionTest, EveryOtherCommandThatTakesOverPreemptsIt) {
  start(1.0);
  setOut(goalTo(0.15));
  const auto moved = node.moveTo(0.01, true);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(MoveResult::REPLACED, "a move to 0.01 m took over");
}

TEST_F(MoveActionTest, PreemptsWhoeverWaitsForAMoveTo) {
  start(1.0);
  auto first = std::async(std::launch::async, [this] { return node.moveTo(0.15, true); });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 2000; }));
  EXPECT_EQ(client->run(goalTo(0.01)), State::SUCCEEDED);
  const auto replaced = first.get();
  EXPECT_FALSE(replaced.success);
  expectSays(replaced.message, "a move to 0.01 m took over");
  expectNoViolation();
}

TEST_F(MoveActionTest, ACancelLeavesWhatHasTakenOverAlone) {
  start(1.0);
  setOut(goalTo(0.15));
  EXPECT_TRUE(node.moveTo(0.1, false).success);
  client->cancelGoal();
  EXPECT_EQ(client->await(), State::PREEMPTED);
  EXPECT_TRUE(waitUntil([this] { return node.pulses() == 8000; })) << "it goes on to 0.1";
}

TEST_F(MoveActionTest, EveryClientSeesTheSameState) {
  start(1.0);
  const Recorder<AxisStates> states(node.full("axis_states"));
  setOut(goalTo(0.1));
  EXPECT_TRUE(states.waitFor(
      [](const AxisStates& s) { return s.moving.at(0) != 0 && s.target.at(0) == 0.1; }));
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return s.moving.at(0) == 0 && s.position.at(0) == 0.1; }));
}

TEST_F(MoveActionTest, AGoalIsInTheStatusUntilFiveSecondsAfterItsEnd) {
  start();
  const Recorder<actionlib_msgs::GoalStatusArray> statuses(node.full("x/move/status"));
  EXPECT_EQ(client->run(goalTo(0.01)), State::SUCCEEDED);
  EXPECT_TRUE(statuses.waitForLatest([](const auto& now) {
    return now.status_list.size() == 1 &&
           now.status_list[0].status == actionlib_msgs::GoalStatus::SUCCEEDED;
  }));
  EXPECT_TRUE(statuses.waitForLatest([](const auto& now) { return now.status_list.empty(); }));
}

// A stamp in 2106 counts as now: the node survives it, and later goals aren't cancelled by it. With
// and without a stamp, a cancel of an unknown goal doesn't stay in the status.
TEST_F(MoveActionTest, ForgetsACancelOfAnUnknownGoalWhateverItsStamp) {
  start();
  const Recorder<actionlib_msgs::GoalStatusArray> statuses(node.full("x/move/status"));
  const ros::Publisher cancels =
      ros::NodeHandle().advertise<actionlib_msgs::GoalID>(node.full("x/move/cancel"), 2);
  ASSERT_TRUE(waitUntil([&] { return cancels.getNumSubscribers() == 1; }));
  actionlib_msgs::GoalID unknown;
  unknown.id = "of the future";
  unknown.stamp = ros::Time(4'294'967'295, 999'999'999);
  cancels.publish(unknown);
  unknown.id = "without a stamp";
  unknown.stamp = ros::Time();
  cancels.publish(unknown);
  EXPECT_TRUE(statuses.waitForLatest([](const auto& now) { return now.status_list.size() == 2; }));
  EXPECT_EQ(client->run(goalTo(0.01)), State::SUCCEEDED);
  EXPECT_TRUE(statuses.waitForLatest([](const auto& now) { return now.status_list.empty(); }));
}

// The stamp of a goal comes from the clock of its client.
TEST_F(MoveActionTest, CancelsGoalsOfAClientWhoseClockIsAhead) {
  start(1.0);
  const ros::Publisher goals =
      ros::NodeHandle().advertise<MoveActionGoal>(node.full("x/move/goal"), 1);
  const ros::Publisher cancels =
      ros::NodeHandle().advertise<actionlib_msgs::GoalID>(node.full("x/move/cancel"), 1);
  ASSERT_TRUE(waitUntil(
      [&] { return goals.getNumSubscribers() == 1 && cancels.getNumSubscribers() == 1; }));
  MoveActionGoal goal;
  goal.goal_id.id = "ahead";
  goal.goal_id.stamp = ros::Time::now() + ros::Duration(3600.0);
  goal.goal = goalTo(0.15);
  goals.publish(goal);
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 500; }));
  const Recorder<MoveActionResult> results(node.full("x/move/result"));
  ASSERT_TRUE(waitUntil([&] { return results.connected(); }));
  actionlib_msgs::GoalID until;
  until.stamp = goal.goal_id.stamp;
  cancels.publish(until);
  EXPECT_TRUE(results.waitFor([](const MoveActionResult& end) {
    return end.status.goal_id.id == "ahead" && end.result.end == MoveResult::STOPPED;
  }));
}

TEST_F(MoveActionTest, EndsAbortedByAStopAnEndstopOrAnEmergencyStop) {
  node.set("simulation/axes/x/max_switch_mm", 100.0);
  start(1.0);
  setOut(goalTo(0.19));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("x/stop").success);
  EXPECT_EQ(client->await(), State::ABORTED);
  client->expectEnd(MoveResult::STOPPED, "it was stopped");

  EXPECT_EQ(client->run(goalTo(0.19)), State::ABORTED);
  client->expectEnd(MoveResult::ENDSTOP_MAX, "the max endstop was met");
  EXPECT_NEAR(client->getResult()->position, 0.1, 2.0 * kStep);

  const std::int64_t pulses = node.pulses();
  setOut(goalTo(0.0), pulses + 500);
  EXPECT_TRUE(node.call<std_srvs::Trigger>("emergency_stop").success);
  EXPECT_EQ(client->await(), State::ABORTED);
  client->expectEnd(MoveResult::EMERGENCY_STOP, "emergency stop");
  EXPECT_EQ(client->run(goalTo(0.0)), State::REJECTED);
  expectSays(client->getResult()->message, "call recover first");
}

TEST_F(MoveActionTest, WaitsOverAHoldAndCanBeCancelledInIt) {
  start(1.0);
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto hold = [&] {
    EXPECT_TRUE(node.call<std_srvs::Trigger>("hold").success);
    EXPECT_TRUE(states.waitForLatest(
        [](const AxisStates& s) { return s.held.at(0) != 0 && s.moving.at(0) == 0; }));
    EXPECT_FALSE(client->getState().isDone());
  };
  setOut(goalTo(0.1));
  hold();
  EXPECT_TRUE(node.call<std_srvs::Trigger>("resume").success);
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  EXPECT_EQ(node.pulses(), 8000);

  setOut(goalTo(0.0), 8000 + 2000);
  hold();
  client->cancelGoal();
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(MoveResult::STOPPED, "it was stopped");
  EXPECT_TRUE(node.call<std_srvs::Trigger>("resume").success);
  EXPECT_EQ(client->run(goalTo(0.1)), State::SUCCEEDED) << "what was held is given up";
}

TEST_F(MoveActionTest, AxesHaveActionsOfTheirOwn) {
  addSecondAxis(node);
  start(1.0);
  MoveClient of_y(node.full("y/move"));
  client->sendGoal(goalTo(0.05));
  of_y.sendGoal(goalTo(0.02));
  EXPECT_EQ(of_y.await(), State::SUCCEEDED);
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  EXPECT_EQ(node.rig().pulses_forward, (std::vector<std::int64_t>{4000, 1600}));
}

TEST_F(MoveActionTest, TellsItsClientWhenTheNodeEnds) {
  start(1.0);
  setOut(goalTo(0.15));
  node.process().signal(SIGTERM);
  EXPECT_EQ(client->await(), State::ABORTED);
  client->expectEnd(MoveResult::STOPPED, "the machine was shut down");
  EXPECT_EQ(node.process().waitForExit(kBound), 0);
}

}  // namespace
}  // namespace stepdriver::node_test
