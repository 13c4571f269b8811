#include <gtest/gtest.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/MoveLineAction.h>

#include <cmath>
#include <csignal>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "support/motion_client.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/two_axes.h"
#include "support/wait.h"

// x: 100 mm/s and 500 mm/s^2; y: half the speed.

namespace stepdriver::node_test {
namespace {

using LineClient = MotionClient<MoveLineAction>;

MoveLineGoal lineTo(const std::vector<double>& position) {
  MoveLineGoal goal;
  goal.name = {"x", "y"};
  goal.position = position;
  return goal;
}

class LineActionTest : public testing::Test {
 protected:
  void start(double speed = 20.0) {
    node.set("simulation/speed", speed);
    addSecondAxis(node);
    node.start();
    client = std::make_unique<LineClient>(node.full("move_line"));
  }
  std::vector<std::int64_t> positions() {
    const auto report = node.rig();
    return {report.pulses_forward.at(0) - report.pulses_backward.at(0),
            report.pulses_forward.at(1) - report.pulses_backward.at(1)};
  }
  std_srvs::Trigger::Response trigger(const std::string& service) {
    return node.call<std_srvs::Trigger>(service);
  }

  NodeUnderTest node;
  std::unique_ptr<LineClient> client;
};

TEST_F(LineActionTest, ReachesItsTargetsAndTellsHowFarItIs) {
  start(1.0);
  std::vector<MoveLineFeedback> told;
  client->sendGoal(lineTo({0.06, 0.04}), {}, {},
                   [&](const MoveLineFeedbackConstPtr& feedback) { told.push_back(*feedback); });
  EXPECT_EQ(client->await(), State::SUCCEEDED);
  client->expectEnd(MoveLineResult::REACHED, "reached");
  const auto result = client->getResult();
  ASSERT_EQ(result->position.size(), 2U);
  EXPECT_NEAR(result->position[0], 0.06, 1e-12);
  EXPECT_NEAR(result->position[1], 0.04, 1e-12);
  EXPECT_EQ(positions(), (std::vector<std::int64_t>{4800, 3200}));
  ASSERT_GT(told.size(), 3U);
  double progress = 0.0;
  for (const MoveLineFeedback& now : told) {
    ASSERT_EQ(now.position.size(), 2U);
    EXPECT_NEAR(now.position[1], now.position[0] * 2.0 / 3.0, 1e-4) << "not on the line";
    EXPECT_NEAR(now.progress, now.position[0] / 0.06, 1e-3);
    EXPECT_GE(now.progress, progress);
    EXPECT_LE(now.time_left, result->duration + 1e-3);
    progress = now.progress;
  }
}

TEST_F(LineActionTest, IsRejectedWithTheReason) {
  start();
  client->sendGoal(lineTo({0.06, 0.5}));
  EXPECT_EQ(client->await(), State::REJECTED);
  client->expectEnd(MoveLineResult::REFUSED, "0.5");
  MoveLineGoal unknown = lineTo({0.01, 0.01});
  unknown.name[1] = "w";
  client->sendGoal(unknown);
  EXPECT_EQ(client->await(), State::REJECTED);
  client->expectEnd(MoveLineResult::REFUSED, "there is no axis w");
  EXPECT_EQ(positions(), (std::vector<std::int64_t>{0, 0}));
}

TEST_F(LineActionTest, DeceleratesAlongTheLineWhenItIsCancelled) {
  start(1.0);
  client->sendGoal(lineTo({0.18, 0.12}));
  ASSERT_TRUE(waitUntil([&] { return positions().at(0) > 2000; }));
  client->cancelGoal();
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(MoveLineResult::STOPPED, "stop");
  const auto result = client->getResult();
  const std::vector<std::int64_t> end = positions();
  EXPECT_EQ(end.at(0), std::llround(result->position.at(0) * 80'000.0));
  EXPECT_EQ(end.at(1), std::llround(result->position.at(1) * 80'000.0));
  EXPECT_LT(end.at(0), 14'400);
  EXPECT_NEAR(static_cast<double>(end.at(1)), static_cast<double>(end.at(0)) * 2.0 / 3.0, 1.0);
}

TEST_F(LineActionTest, EndsIfAnotherCommandTakesOver) {
  start(1.0);
  client->sendGoal(lineTo({0.18, 0.12}));
  ASSERT_TRUE(waitUntil([&] { return positions().at(0) > 2000; }));
  EXPECT_TRUE(node.moveTo(0.0, false).success);
  EXPECT_EQ(client->await(), State::PREEMPTED);
  client->expectEnd(MoveLineResult::REPLACED, "x");
}

TEST_F(LineActionTest, IsCancelledWhileItsAxesComeToRest) {
  start(1.0);
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  ASSERT_TRUE(waitUntil([&] { return positions().at(0) > 2000; }));
  client->sendGoal(lineTo({0.0, 0.1}));
  // In a hold the line waits for as long as the hold lasts.
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(trigger("hold").success);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
  client->cancelGoal();
  const State end = client->await();
  EXPECT_TRUE(end == State::RECALLED || end == State::REJECTED) << end.toString();
  const std::vector<std::int64_t> rest = positions();
  EXPECT_TRUE(trigger("resume").success);
  EXPECT_EQ(rest.at(1), 0) << "the line began";
  EXPECT_TRUE(node.moveTo(0.1, true).success);
  EXPECT_EQ(positions(), (std::vector<std::int64_t>{8000, 0}));
}

TEST_F(LineActionTest, IsToldIfTheNodeEnds) {
  start(1.0);
  client->sendGoal(lineTo({0.18, 0.12}));
  ASSERT_TRUE(waitUntil([&] { return positions().at(0) > 2000; }));
  node.process().signal(SIGTERM);
  EXPECT_EQ(client->await(), State::ABORTED);
  client->expectEnd(MoveLineResult::STOPPED, "shut down");
}

}  // namespace
}  // namespace stepdriver::node_test
