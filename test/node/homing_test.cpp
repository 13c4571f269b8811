#include <actionlib/client/simple_action_client.h>
#include <actionlib_msgs/GoalStatus.h>
#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Home.h>
#include <stepdriver/HomeAction.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/HomeAxesAction.h>

#include <future>
#include <memory>
#include <mutex>
#include <set>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// A node whose axis x has its trigger point at the min switch of the rig, at -2 mm. It is at 2 mm
/// when its homing begins.
class Homing : public testing::Test {
 protected:
  Homing() {
    node.set("axes/x/homing/switch", "min");
    node.set("axes/x/homing/seek_speed_mm_s", 50.0);
    node.set("axes/x/homing/latch_speed_mm_s", 5.0);
    node.set("axes/x/homing/pull_off_mm", 4.0);
    node.set("axes/x/homing/offset_mm", -2.0);
    node.set("axes/x/homing/max_travel_mm", 250.0);
    node.set("simulation/axes/x/start_mm", 37.5);
  }

  Home::Response home(bool wait = true) {
    Home::Request request;
    request.wait = wait;
    return node.call<Home>("x/home", request);
  }

  void expectStandsHomed(double position) {
    EXPECT_NEAR(position, 0.002, 2.0 * kHalfStep);
    const auto report = node.rig();
    EXPECT_NEAR(report.carriage.at(0), position, 2.0 * kHalfStep);
    EXPECT_EQ(report.violations.at(0), 0U) << report.violation_kinds.at(0);
  }

  NodeUnderTest node;
};

TEST_F(Homing, FindsTheZeroAndThenMovesToAbsolutePositions) {
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto refused = node.moveTo(0.1, true);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "require_homing");
  EXPECT_EQ(node.pulses(), 0);

  const auto answer = home();
  EXPECT_TRUE(answer.success) << answer.message;
  expectStandsHomed(answer.position);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& now) { return now.homed.at(0) != 0 && now.position_valid.at(0) != 0; }));
  const auto moved = node.moveTo(0.1, true);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_NEAR(node.rig().carriage.at(0), 0.1, 2.0 * kHalfStep);
}

TEST_F(Homing, LetsRelativeMovesBeBeforeItIsHomed) {
  node.set("axes/x/require_homing", true);
  node.start();
  MoveTo::Request request;
  request.position = 0.01;
  request.relative = true;
  request.wait = true;
  const auto moved = node.call<MoveTo>("x/move_to", request);
  EXPECT_TRUE(moved.success) << moved.message;
}

TEST_F(Homing, AnswersOnAcceptanceWhereNobodyWaits) {
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto answer = home(false);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& now) { return now.homed.at(0) != 0; }));
}

TEST_F(Homing, SaysThatTheSwitchNeverCloses) {
  node.set("simulation/axes/x/min_stuck", "inactive");
  node.set("axes/x/homing/max_travel_mm", 50.0);
  node.start();
  const auto answer = home();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "the min switch didn't close within max_travel, 0.05 m");
}

TEST_F(Homing, RefusesWhereItCannotBegin) {
  node.set("axes/x/enable_on_start", false);
  node.start();
  for (const bool wait : {true, false}) {
    const auto answer = home(wait);
    EXPECT_FALSE(answer.success);
    expectSays(answer.message, "disabled");
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(Homing, RefusesWhereItIsNotConfigured) {
  node.erase("axes/x/homing");
  node.start();
  const auto answer = home();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "homing isn't configured");
}

TEST_F(Homing, DoesNotStartWithABadConfiguration) {
  node.set("axes/x/homing/latch_speed_mm_s", 500.0);
  node.set("axes/x/homing/sped", 1);
  NodeProcess& process = node.launch();
  EXPECT_EQ(process.waitForExit(kBound), 1);
  expectSays(process.output(), "axes/x/homing/latch_speed_mm_s is 500.0, but must be at most");
  expectSays(process.output(), "axes/x/homing/sped is not known");
}

TEST_F(Homing, HomesAllAxesThatHaveAHomingOrThoseThatAreNamed) {
  node.start();
  HomeAxes::Request request;
  request.wait = true;
  const auto all = node.call<HomeAxes>("home", request);
  EXPECT_TRUE(all.success) << all.message;
  expectStandsHomed(0.002);
  request.name = {"x"};
  EXPECT_TRUE(node.call<HomeAxes>("home", request).success);
  request.name = {"x", "w"};
  const auto unknown = node.call<HomeAxes>("home", request);
  EXPECT_FALSE(unknown.success);
  expectSays(unknown.message, "there is no axis w");
  request.name = {"x"};
  request.wait = false;
  const auto accepted = node.call<HomeAxes>("home", request);
  EXPECT_TRUE(accepted.success) << accepted.message;
}

TEST_F(Homing, EndsWithAStopWhileAnotherCallWaitsForIt) {
  node.set("simulation/speed", 1.0);
  node.start();
  auto waiting = std::async(std::launch::async, [this] { return home(); });
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 100; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("x/stop").success);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "it was stopped");
}

class HomingAction : public Homing {
 protected:
  using Client = actionlib::SimpleActionClient<HomeAction>;

  void start() {
    node.start();
    client = std::make_unique<Client>(node.full("x/homing"), true);
    ASSERT_TRUE(client->waitForServer(ros::Duration(kBound.count())));
  }

  void send() {
    client->sendGoal(HomeGoal(), {}, {}, [this](const HomeFeedbackConstPtr& feedback) {
      const std::lock_guard<std::mutex> lock(mutex);
      phases.insert(feedback->phase);
    });
  }

  std::size_t toldPhases() {
    const std::lock_guard<std::mutex> lock(mutex);
    return phases.size();
  }

  bool told(const std::string& phase) {
    const std::lock_guard<std::mutex> lock(mutex);
    return phases.count(phase) > 0;
  }

  std::mutex mutex;
  std::set<std::string> phases;
  std::unique_ptr<Client> client;
};

TEST_F(HomingAction, TellsItsPhasesAndItsEnd) {
  node.set("simulation/speed", 1.0);
  start();
  // The feedback consists of samples: a test that had to wait for a processor meanwhile misses
  // some.
  for (int homings = 0; homings < 5 && toldPhases() < 4; ++homings) {
    send();
    ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count())));
    EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
    const auto result = client->getResult();
    expectSays(result->message, "x is homed");
    expectStandsHomed(result->position);
  }
  for (const std::string phase : {"seeking", "backing off", "latching", "pulling off"}) {
    EXPECT_TRUE(told(phase)) << phase;
  }
}

TEST_F(HomingAction, DeceleratesWhenItIsCancelled) {
  node.set("simulation/speed", 1.0);
  start();
  send();
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 100 && told("seeking"); }));
  client->cancelGoal();
  ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  expectSays(client->getResult()->message, "it was cancelled");
  const auto report = node.rig();
  EXPECT_EQ(report.violations.at(0), 0U) << report.violation_kinds.at(0);
  EXPECT_NEAR(client->getResult()->position, report.carriage.at(0) - 0.0375, 2.0 * kHalfStep)
      << "it stood when the result came";
}

TEST_F(HomingAction, AbortsWithTheReason) {
  node.set("axes/x/enable_on_start", false);
  start();
  send();
  ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::ABORTED);
  expectSays(client->getResult()->message, "disabled");
}

TEST_F(HomingAction, TakesGoalAfterGoal) {
  start();
  for (int i = 0; i < 5; ++i) {
    send();
    ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count()))) << "goal " << i;
    EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
  }
}

TEST_F(HomingAction, IsReplacedByANewerGoal) {
  node.set("simulation/speed", 4.0);
  start();
  Client newer(node.full("x/homing"), true);
  ASSERT_TRUE(newer.waitForServer(ros::Duration(kBound.count())));
  send();
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 100 && told("seeking"); }));
  newer.sendGoal(HomeGoal());
  ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  ASSERT_TRUE(newer.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(newer.getState(), actionlib::SimpleClientGoalState::SUCCEEDED)
      << newer.getResult()->message;
  expectStandsHomed(newer.getResult()->position);
}

TEST_F(HomingAction, IsNotReplacedByAnOlderGoalThatComesLater) {
  node.set("simulation/speed", 4.0);
  start();
  const Recorder<HomeActionResult> results(node.full("x/homing/result"));
  auto goals = ros::NodeHandle().advertise<HomeActionGoal>(node.full("x/homing/goal"), 1);
  ASSERT_TRUE(waitUntil([&] { return goals.getNumSubscribers() > 0 && results.connected(); }));
  send();
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 100 && told("seeking"); }));
  HomeActionGoal older;
  older.goal_id.id = "older";
  older.goal_id.stamp = ros::Time::now() - ros::Duration(60.0);
  goals.publish(older);
  EXPECT_TRUE(results.waitFor([](const HomeActionResult& result) {
    return result.status.goal_id.id == "older" &&
           result.status.status == actionlib_msgs::GoalStatus::RECALLED;
  }));
  ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::SUCCEEDED)
      << client->getResult()->message;
}

class MachineHomingAction : public Homing {
 protected:
  using Client = actionlib::SimpleActionClient<HomeAxesAction>;

  void start() {
    node.start();
    client = std::make_unique<Client>(node.full("homing"), true);
    ASSERT_TRUE(client->waitForServer(ros::Duration(kBound.count())));
  }
  actionlib::SimpleClientGoalState run(const HomeAxesGoal& goal) {
    client->sendGoal(goal);
    EXPECT_TRUE(client->waitForResult(ros::Duration(kBound.count()))) << "no result comes";
    return client->getState();
  }

  std::unique_ptr<Client> client;
};

TEST_F(MachineHomingAction, HomesTheAxesAndTellsEachOne) {
  start();
  const Recorder<HomeAxesActionFeedback> feedback(node.full("homing/feedback"));
  ASSERT_TRUE(waitUntil([&] { return feedback.connected(); }));
  EXPECT_EQ(run({}), actionlib::SimpleClientGoalState::SUCCEEDED);
  const auto result = client->getResult();
  expectSays(result->message, "x is homed");
  ASSERT_EQ(result->name, std::vector<std::string>{"x"});
  EXPECT_TRUE(result->homed.at(0));
  expectStandsHomed(result->position.at(0));
  std::set<std::string> phases;
  for (const auto& message : feedback.messages()) {
    for (const std::string& phase : message.feedback.phase) phases.insert(phase);
    for (const std::string& name : message.feedback.name) EXPECT_EQ(name, "x");
  }
  EXPECT_EQ(phases.count("seeking"), 1U);
}

TEST_F(MachineHomingAction, AbortsWithTheReason) {
  start();
  HomeAxesGoal goal;
  goal.name = {"x", "w"};
  EXPECT_EQ(run(goal), actionlib::SimpleClientGoalState::ABORTED);
  expectSays(client->getResult()->message, "there is no axis w");
  EXPECT_TRUE(client->getResult()->name.empty());
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(MachineHomingAction, DeceleratesWhenItIsCancelled) {
  node.set("simulation/speed", 1.0);
  start();
  client->sendGoal({});
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 100; }));
  client->cancelGoal();
  ASSERT_TRUE(client->waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(client->getState(), actionlib::SimpleClientGoalState::PREEMPTED);
  expectSays(client->getResult()->message, "it was cancelled");
  EXPECT_FALSE(client->getResult()->homed.at(0));
}

}  // namespace
}  // namespace stepdriver::node_test
