#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/SetPosition.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/control_msgs_client.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/rotary_axis.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/wait.h"

// The client here was built with control_msgs, like MoveIt.

namespace stepdriver::node_test {
namespace {

using Goal = action_msgs::FollowJointTrajectoryGoal;
using Result = action_msgs::FollowJointTrajectoryResult;
using Feedback = action_msgs::FollowJointTrajectoryActionFeedback;
using State = actionlib::SimpleClientGoalState;

struct Point {
  double time;
  std::vector<double> positions;
  std::vector<double> velocities;
};

Goal goalOf(const std::vector<Point>& points) {
  Goal goal;
  goal.trajectory.joint_names = {"x_joint", "y_joint"};
  for (const Point& point : points) {
    trajectory_msgs::JointTrajectoryPoint added;
    added.time_from_start = ros::Duration(point.time);
    added.positions = point.positions;
    added.velocities = point.velocities;
    goal.trajectory.points.push_back(added);
  }
  return goal;
}

/// A trajectory of one joint alone, which ends at rest.
Goal ofOne(const std::string& joint, double position, double duration) {
  Goal goal = goalOf({{duration, {position}, {0.0}}});
  goal.trajectory.joint_names = {joint};
  return goal;
}

/// From rest at 0 to rest at the target, with x at twice the speed of y.
Goal there(double x, double duration) {
  return goalOf({{0.0, {0.0, 0.0}, {0.0, 0.0}}, {duration, {x, 0.5 * x}, {0.0, 0.0}}});
}

template <typename Tolerances>
void tolerate(Tolerances& tolerances, const std::string& joint, double position) {
  tolerances.emplace_back();
  tolerances.back().name = joint;
  tolerances.back().position = position;
}

class TrajectoryActionTest : public testing::Test {
 protected:
  TrajectoryActionTest() { addSecondAxis(node); }

  void start(double speed = 20.0) {
    node.set("simulation/speed", speed);
    node.start();
    client = std::make_unique<TrajectoryClient>(node.full("follow_joint_trajectory"), false);
    ASSERT_TRUE(client->waitForServer(ros::Duration(kBound.count())));
  }

  void send(const Goal& goal) { client->sendGoal(goal); }
  State await() {
    EXPECT_TRUE(client->waitForResult(ros::Duration(kBound.count()))) << "no result comes";
    return client->getState();
  }
  State run(const Goal& goal) {
    send(goal);
    return await();
  }
  std::string said() { return client->getResult()->error_string; }

  void expectRejected(const Goal& goal, int code, const std::string& words) {
    EXPECT_EQ(run(goal), State::REJECTED) << words;
    EXPECT_EQ(client->getResult()->error_code, code) << said();
    expectSays(said(), words);
    EXPECT_EQ(client->getState().getText(), said());
  }
  void expectAborted(int code, const std::string& words) {
    EXPECT_EQ(await(), State::ABORTED) << said();
    EXPECT_EQ(client->getResult()->error_code, code) << said();
    expectSays(said(), words);
  }
  void expectNoViolation() {
    const auto report = node.rig();
    for (std::size_t i = 0; i < report.violations.size(); ++i) {
      EXPECT_EQ(report.violations[i], 0) << report.name[i] << ": " << report.violation_kinds[i];
    }
  }

  NodeUnderTest node;
  std::unique_ptr<TrajectoryClient> client;
};

TEST_F(TrajectoryActionTest, IsKnownByItsNamesOfControlMsgs) {
  EXPECT_STREQ(ros::message_traits::datatype<ControlMsgsAction::_action_goal_type>(),
               "control_msgs/FollowJointTrajectoryActionGoal");
  start();
  EXPECT_EQ(run(there(0.02, 1.0)), State::SUCCEEDED) << said();
  EXPECT_EQ(client->getResult()->error_code, Result::SUCCESSFUL);
}

TEST_F(TrajectoryActionTest, GoesThroughThePointsAndTellsWhereItIs) {
  start(1.0);
  const Recorder<Feedback> feedback(node.full("follow_joint_trajectory/feedback"));
  Goal goal = goalOf({{0.0, {0.0, 0.0}, {0.0, 0.0}},
                      {0.5, {0.02, -0.005}, {0.06, -0.02}},
                      {1.0, {0.04, -0.02}, {0.0, 0.0}}});
  for (auto& point : goal.trajectory.points) point.accelerations = {0.0, 0.0};
  tolerate(goal.path_tolerance, "x_joint", 2.0 * kStep);
  tolerate(goal.goal_tolerance, "y_joint", kStep);
  EXPECT_EQ(run(goal), State::SUCCEEDED) << said();
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{3200, 0}));
  EXPECT_EQ(report.pulses_backward, (std::vector<std::int64_t>{0, 1600}));
  expectNoViolation();

  ASSERT_GT(feedback.count(), 5U) << "20 a second, on a machine that stalls";
  bool moved = false;
  for (const Feedback& message : feedback.messages()) {
    const auto& told = message.feedback;
    EXPECT_EQ(told.joint_names, goal.trajectory.joint_names);
    for (std::size_t i = 0; i < 2; ++i) {
      EXPECT_NEAR(told.actual.positions.at(i), told.desired.positions.at(i), kStep);
      EXPECT_NEAR(told.error.positions.at(i),
                  told.desired.positions.at(i) - told.actual.positions.at(i), 1e-12);
      EXPECT_EQ(told.actual.velocities.at(i), told.desired.velocities.at(i));
      EXPECT_EQ(told.error.velocities.at(i), 0.0);
    }
    moved = moved || told.actual.velocities.at(0) > 0.03;
  }
  EXPECT_TRUE(moved);
}

TEST_F(TrajectoryActionTest, RejectsWhatIsNoTrajectoryForItsAxes) {
  start();
  const auto changed = [](const std::function<void(Goal&)>& change) {
    Goal goal = there(0.02, 1.0);
    change(goal);
    return goal;
  };
  expectRejected(changed([](Goal& g) { g.trajectory.joint_names[1] = "wrist"; }),
                 Result::INVALID_JOINTS, "no joint wrist (joints: x_joint, y_joint)");
  expectRejected(changed([](Goal& g) { g.trajectory.joint_names[1] = "x_joint"; }),
                 Result::INVALID_JOINTS, "named twice");
  expectRejected(Goal(), Result::INVALID_JOINTS, "names no joint");
  expectRejected(changed([](Goal& g) { g.trajectory.points.clear(); }), Result::INVALID_GOAL,
                 "no points");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].positions.pop_back(); }),
                 Result::INVALID_GOAL, "has 1 positions, but must have 2");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].velocities.push_back(0.0); }),
                 Result::INVALID_GOAL, "has 3 velocities");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].positions[0] = kNan; }),
                 Result::INVALID_GOAL, "finite");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].time_from_start = {}; }),
                 Result::INVALID_GOAL, "must be later than the one before it");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].time_from_start.fromSec(-1.0); }),
                 Result::INVALID_GOAL, "is at -1 s");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].positions[0] = 0.25; }),
                 Result::INVALID_GOAL, "0.2 m");
  expectRejected(changed([](Goal& g) { g.trajectory.points[0].positions[0] = 0.01; }),
                 Result::INVALID_GOAL, "but the axis stands at 0 m");
  expectRejected(changed([](Goal& g) { g.trajectory.points[1].time_from_start.fromSec(0.05); }),
                 Result::INVALID_GOAL, "the trajectory's velocity is");
  expectRejected(changed([](Goal& g) { g.trajectory.header.stamp = ros::Time(1.0); }),
                 Result::OLD_HEADER_TIMESTAMP, "all of its points are in the past");
  expectRejected(changed([](Goal& g) { tolerate(g.path_tolerance, "wrist", 1.0); }),
                 Result::INVALID_GOAL, "path_tolerance names the joint wrist");
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(TrajectoryActionTest, DeceleratesToRestWhenItIsCancelled) {
  start(1.0);
  send(there(0.15, 4.0));
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 1000; }));
  client->cancelGoal();
  EXPECT_EQ(await(), State::PREEMPTED);
  expectSays(said(), "cancelled");
  const std::int64_t pulses = node.pulses();
  EXPECT_LT(pulses, 18000) << "not the whole way";
  const auto report = node.rig();
  EXPECT_NEAR(report.carriage.at(1), 0.5 * report.carriage.at(0), 2.0 * kStep) << "on the path";
  expectNoViolation();
  EXPECT_EQ(node.pulses(), pulses) << "it rests";
}

TEST_F(TrajectoryActionTest, ANewerGoalTakesOverWithoutAStop) {
  start(1.0);
  TrajectoryClient other(node.full("follow_joint_trajectory"), false);
  ASSERT_TRUE(other.waitForServer(ros::Duration(kBound.count())));
  const Recorder<AxisStates> states(node.full("axis_states"));
  send(goalOf({{4.0, {0.2, 0.1}, {0.0, 0.0}}}));
  ASSERT_TRUE(states.waitFor([](const AxisStates& s) { return s.velocity.at(0) > 0.02; }));
  other.sendGoal(goalOf({{3.0, {0.19, 0.09}, {0.0, 0.0}}}));
  EXPECT_EQ(await(), State::PREEMPTED) << said();
  expectSays(said(), "a newer goal took over");
  ASSERT_TRUE(other.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(other.getState(), State::SUCCEEDED) << other.getResult()->error_string;
  std::vector<double> velocities;
  for (const AxisStates& s : states.messages()) {
    if (s.position.at(0) > 0.005 && s.position.at(0) < 0.18) velocities.push_back(s.velocity.at(0));
  }
  ASSERT_FALSE(velocities.empty());
  EXPECT_GT(*std::min_element(velocities.begin(), velocities.end()), 0.005);
  expectNoViolation();
}

TEST_F(TrajectoryActionTest, GoalsOfOtherJointsRunSideBySide) {
  start(1.0);
  TrajectoryClient other(node.full("follow_joint_trajectory"), false);
  ASSERT_TRUE(other.waitForServer(ros::Duration(kBound.count())));
  send(ofOne("x_joint", 0.03, 1.0));
  other.sendGoal(ofOne("y_joint", 0.01, 0.5));
  EXPECT_EQ(await(), State::SUCCEEDED) << said();
  ASSERT_TRUE(other.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(other.getState(), State::SUCCEEDED) << other.getResult()->error_string;
  EXPECT_EQ(node.pulses(), 2400 + 800);
}

TEST_F(TrajectoryActionTest, ACancelLeavesTheGoalsOfOtherJointsAlone) {
  start(1.0);
  TrajectoryClient other(node.full("follow_joint_trajectory"), false);
  ASSERT_TRUE(other.waitForServer(ros::Duration(kBound.count())));
  const Recorder<AxisStates> states(node.full("axis_states"));
  send(ofOne("x_joint", 0.15, 4.0));
  other.sendGoal(ofOne("y_joint", 0.08, 4.0));
  ASSERT_TRUE(states.waitFor(
      [](const AxisStates& s) { return s.position.at(0) > 0.001 && s.position.at(1) > 0.001; }));
  other.cancelGoal();
  EXPECT_EQ(await(), State::SUCCEEDED) << said();
  ASSERT_TRUE(other.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(other.getState(), State::PREEMPTED) << other.getResult()->error_string;
}

TEST_F(TrajectoryActionTest, EndsAbortedWhereAMoveTakesOver) {
  start(1.0);
  send(there(0.15, 4.0));
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 1000; }));
  EXPECT_TRUE(node.moveTo(0.0, false).success);
  expectAborted(Result::GOAL_TOLERANCE_VIOLATED, "a move to 0 m took over");
  expectNoViolation();
}

TEST_F(TrajectoryActionTest, EndsAbortedWhereAnEndstopEndsIt) {
  node.set("simulation/axes/x/max_switch_mm", 50.0);
  start();
  send(there(0.15, 4.0));
  expectAborted(Result::GOAL_TOLERANCE_VIOLATED, "endstop");
  const auto report = node.rig();
  EXPECT_NEAR(report.carriage.at(0), 0.05, 2.0 * kStep);
  EXPECT_NEAR(report.carriage.at(1), 0.025, 2.0 * kStep) << "all end together";
}

TEST_F(TrajectoryActionTest, StopsWhereItLeavesThePathTolerance) {
  start(1.0);
  Goal goal = there(0.15, 4.0);
  tolerate(goal.path_tolerance, "y_joint", 0.01 * kStep);
  send(goal);
  expectAborted(Result::PATH_TOLERANCE_VIOLATED, "y_joint is at");
  expectSays(said(), "path_tolerance is 1.25e-07 m");
  EXPECT_LT(node.pulses(), 18000) << "not the whole way";
  const std::int64_t pulses = node.pulses();
  EXPECT_EQ(node.pulses(), pulses);
}

TEST_F(TrajectoryActionTest, ComparesTheVelocityOfThePulsesWithThatOfThePlan) {
  start(1.0);
  Goal goal = there(0.15, 4.0);
  goal.path_tolerance.emplace_back();
  goal.path_tolerance.back().name = "x_joint";
  goal.path_tolerance.back().velocity = 0.01 * kStep;
  send(goal);
  expectAborted(Result::PATH_TOLERANCE_VIOLATED, "x_joint moves at");
  expectSays(said(), "path_tolerance is 1.25e-07 m/s");
  EXPECT_LT(node.pulses(), 18000) << "not the whole way";
  goal = goalOf({{1.0, {0.0, 0.0}, {0.0, 0.0}}});
  goal.path_tolerance.emplace_back();
  goal.path_tolerance.back().name = "x_joint";
  goal.path_tolerance.back().velocity = 0.05;
  goal.trajectory.points.back().time_from_start = ros::Duration(5.0);
  EXPECT_EQ(run(goal), State::SUCCEEDED) << said();
}

TEST_F(TrajectoryActionTest, EndsAbortedOutsideTheGoalTolerance) {
  start();
  Goal goal = goalOf({{1.0, {0.02 + 0.3 * kStep, 0.01}, {0.0, 0.0}}});
  tolerate(goal.goal_tolerance, "x_joint", 0.2 * kStep);
  send(goal);
  expectAborted(Result::GOAL_TOLERANCE_VIOLATED, "x_joint is at 0.02 m, 0.00000");
  expectSays(said(), "m from 0.0200038 m; goal_tolerance is 2.5e-06 m");
  goal.goal_tolerance[0].position = 0.4 * kStep;
  goal.trajectory.points[0].positions[1] = 0.0;
  EXPECT_EQ(run(goal), State::SUCCEEDED) << said();
}

TEST_F(TrajectoryActionTest, GoesToTheNearestTurnOfAContinuousJoint) {
  makeRotary(node);
  node.set("axes/x/continuous", true);
  start();
  SetPosition::Request set;
  set.position = 7.0;
  ASSERT_TRUE(node.call<SetPosition>("x/set_position", set).success);
  Goal goal = ofOne("x_joint", 0.5, 1.0);
  tolerate(goal.goal_tolerance, "x_joint", 0.01);
  EXPECT_EQ(run(goal), State::SUCCEEDED) << said();
  const double turned = 0.5 + 2.0 * std::acos(-1.0);
  MoveTo::Request move;
  move.position = 1.0;
  move.shortest = 1;
  move.wait = 1;
  const MoveTo::Response moved = node.call<MoveTo>("x/move_to", move);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_NEAR(moved.position, turned + 0.5, 0.002);
}

TEST_F(TrajectoryActionTest, GoesOnAfterAHoldAndTellsWhereThatTookTooLong) {
  start(1.0);
  const Recorder<AxisStates> states(node.full("axis_states"));
  Goal goal = there(0.06, 4.0);
  goal.goal_time_tolerance = ros::Duration(0.0);
  const auto hold_on_the_way = [&](std::int64_t pulses) {
    ASSERT_TRUE(waitUntil([&] { return node.pulses() > pulses; }));
    EXPECT_TRUE(node.call<std_srvs::Trigger>("hold").success);
    ASSERT_TRUE(states.waitForLatest(
        [](const AxisStates& s) { return s.held.at(0) != 0 && s.moving.at(0) == 0; }));
    EXPECT_FALSE(client->getState().isDone());
    EXPECT_TRUE(node.call<std_srvs::Trigger>("resume").success);
  };
  send(goal);
  hold_on_the_way(1000);
  EXPECT_EQ(await(), State::SUCCEEDED) << said();
  EXPECT_EQ(node.pulses(), 7200);

  goal = goalOf({{4.0, {0.0, 0.0}, {0.0, 0.0}}});
  goal.goal_time_tolerance = ros::Duration(0.001);
  send(goal);
  hold_on_the_way(7200 + 1000);
  expectAborted(Result::GOAL_TOLERANCE_VIOLATED,
                "later than planned; goal_time_tolerance is 0.001");
  EXPECT_EQ(node.pulses(), 14400) << "it went there all the same";
  expectNoViolation();
}

TEST_F(TrajectoryActionTest, StartsWhenItsStampSays) {
  start(1.0);
  Goal goal = there(0.02, 0.7);
  const ros::Time stamp = ros::Time::now() + ros::Duration(1.5);
  goal.trajectory.header.stamp = stamp;
  send(goal);
  while (ros::Time::now() < stamp) {
    const std::int64_t pulses = node.pulses();
    if (ros::Time::now() < stamp) {
      EXPECT_EQ(pulses, 0);
    }
  }
  EXPECT_EQ(await(), State::SUCCEEDED) << said();
  EXPECT_GE(ros::Time::now(), stamp + ros::Duration(0.7));
  EXPECT_EQ(node.pulses(), 2400);
  expectNoViolation();
}

TEST_F(TrajectoryActionTest, TakesOverFromATrajectoryWhenItsStampSays) {
  start(1.0);
  send(there(0.08, 4.0));
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 500; }));
  TrajectoryClient other(node.full("follow_joint_trajectory"), false);
  ASSERT_TRUE(other.waitForServer(ros::Duration(kBound.count())));
  Goal goal = there(0.06, 2.0);
  const ros::Time stamp = ros::Time::now() + ros::Duration(1.0);
  goal.trajectory.header.stamp = stamp;
  other.sendGoal(goal);
  // The change is settled, and told, some milliseconds before it.
  const ros::Time settled = stamp - ros::Duration(0.1);
  while (ros::Time::now() < settled) {
    const State state = client->getState();
    if (ros::Time::now() < settled) {
      ASSERT_EQ(state, State::ACTIVE) << said();
    }
  }
  EXPECT_EQ(await(), State::PREEMPTED) << said();
  ASSERT_TRUE(other.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(other.getState(), State::SUCCEEDED) << other.getResult()->error_string;
  EXPECT_EQ(node.pulses(), 7200) << "of both axes";
  expectNoViolation();
}

TEST_F(TrajectoryActionTest, ACancelBeforeItsStampLeavesTheMotionBeforeIt) {
  start(1.0);
  send(there(0.08, 2.0));
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 500; }));
  TrajectoryClient other(node.full("follow_joint_trajectory"), false);
  ASSERT_TRUE(other.waitForServer(ros::Duration(kBound.count())));
  Goal goal = ofOne("x_joint", 0.06, 2.0);
  goal.trajectory.header.stamp = ros::Time::now() + ros::Duration(1000.0);
  other.sendGoal(goal);
  ASSERT_TRUE(waitUntil([&other] { return other.getState() == State::ACTIVE; }));
  other.cancelGoal();
  ASSERT_TRUE(other.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(other.getState(), State::PREEMPTED) << other.getResult()->error_string;
  EXPECT_EQ(await(), State::SUCCEEDED) << said();
  EXPECT_EQ(node.pulses(), 9600) << "of both axes";
  expectNoViolation();
}

TEST_F(TrajectoryActionTest, AStopEndsATrajectoryThatWaitsForItsStart) {
  start(1.0);
  Goal goal = there(0.02, 0.7);
  goal.trajectory.header.stamp = ros::Time::now() + ros::Duration(1000.0);
  send(goal);
  ASSERT_TRUE(waitUntil([this] { return client->getState() == State::ACTIVE; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("stop").success);
  expectAborted(Result::GOAL_TOLERANCE_VIOLATED, "stopped");
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(TrajectoryActionTest, TellsItsClientWhenTheNodeEnds) {
  start(1.0);
  send(there(0.15, 4.0));
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 1000; }));
  node.process().signal(SIGTERM);
  expectAborted(Result::GOAL_TOLERANCE_VIOLATED, "the machine was shut down");
  EXPECT_EQ(node.process().waitForExit(kBound), 0);
}

}  // namespace
}  // namespace stepdriver::node_test
