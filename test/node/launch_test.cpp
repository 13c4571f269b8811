#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/node_handle.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/Joy.h>
#include <std_srvs/SetBool.h>
#include <stepdriver/Home.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/MoveLine.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/RigReport.h>

#include <cmath>
#include <string>
#include <vector>

#include "support/call_service.h"
#include "support/recorder.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using sensor_msgs::JointState;

/// Enables an axis, moves it, and checks that its pins agree.
void expectMoves(const std::string& node, const std::string& axis, double position,
                 std::int64_t pulses, std::size_t index = 0) {
  std_srvs::SetBool::Request on;
  on.data = true;
  const auto enabled = callWhenThere<std_srvs::SetBool>(node + "/" + axis + "/enable", on);
  EXPECT_TRUE(enabled.success) << enabled.message;
  MoveTo::Request request;
  request.position = position;
  request.wait = true;
  const auto answer = callWhenThere<MoveTo>(node + "/" + axis + "/move_to", request);
  EXPECT_TRUE(answer.success) << answer.message;
  const auto report = callWhenThere<RigReport>(node + "/rig/report");
  EXPECT_EQ(report.name.at(index), axis);
  EXPECT_EQ(report.pulses_forward.at(index), pulses);
  EXPECT_NEAR(report.carriage.at(index), position, 1e-4);
  EXPECT_EQ(report.violations.at(index), 0) << report.violation_kinds.at(index);
}

TEST(Launch, BringsUpEachExampleWithItsOwnScale) {
  expectMoves("/left/stepdriver", "x", 0.01, 800);
  expectMoves("/right/motor", "x", 0.5, std::llround(0.5 * 9600 / (2 * std::acos(-1.0))));
  expectMoves("/screw/stepdriver", "x", 0.01, 8000);
  expectMoves("/module/stepdriver", "x", 0.01, 3200);
  expectMoves("/cart/stepdriver", "x", 0.5, std::llround(0.5 * 1600 / (0.1 * std::acos(-1.0))));
}

TEST(Launch, BringsUpAGantryAndMakesItSquare) {
  const std::string node = "/gantry/stepdriver";
  const auto before = callWhenThere<RigReport>(node + "/rig/report");
  ASSERT_EQ(before.name, (std::vector<std::string>{"y", "y.right"}));
  EXPECT_NEAR(before.carriage[1] - before.carriage[0], 0.003, 1e-9);
  EXPECT_EQ(before.skew[0], 0.0);
  EXPECT_NEAR(before.skew[1], 0.003, 1e-9);
  Home::Request waiting;
  waiting.wait = true;
  const auto homed = callWhenThere<Home>(node + "/y/home", waiting);
  EXPECT_TRUE(homed.success) << homed.message;
  EXPECT_NE(homed.message.find("y is homed, its motors were 0.003"), std::string::npos)
      << homed.message;
  MoveTo::Request request;
  request.position = 0.02;
  request.wait = true;
  EXPECT_TRUE(callWhenThere<MoveTo>(node + "/y/move_to", request).success);
  const auto after = callWhenThere<RigReport>(node + "/rig/report");
  EXPECT_NEAR(after.carriage[0], 0.02, 2.0 / 80'000.0);
  EXPECT_NEAR(after.skew[1], 0.0, 1.01 / 80'000.0);
  EXPECT_EQ(after.violations, (std::vector<std::int64_t>{0, 0}));
}

TEST(Launch, BringsUpACoreXyAndHomesItsAxes) {
  const std::string node = "/corexy/stepdriver";
  HomeAxes::Request waiting;
  waiting.wait = true;
  const auto homed = callWhenThere<HomeAxes>(node + "/home", waiting);
  EXPECT_TRUE(homed.success) << homed.message;
  const auto before = callWhenThere<RigReport>(node + "/rig/report");
  ASSERT_EQ(before.name, (std::vector<std::string>{"x", "y"}));
  MoveTo::Request request;
  request.position = 0.02;
  request.wait = true;
  EXPECT_TRUE(callWhenThere<MoveTo>(node + "/x/move_to", request).success);
  const auto after = callWhenThere<RigReport>(node + "/rig/report");
  EXPECT_NEAR(after.carriage[0], 0.02, 2.0 / 80'000.0);
  EXPECT_NEAR(after.carriage[1], before.carriage[1], 1e-9);
  // Both motors turn for x, from the microstep that is nearest to the end of the homing.
  const auto turned = after.pulses_forward[0] - before.pulses_forward[0];
  EXPECT_NEAR(static_cast<double>(turned), 1600.0, 1.0);
  EXPECT_EQ(after.pulses_forward[1] - before.pulses_forward[1], turned);
  EXPECT_EQ(after.violations, (std::vector<std::int64_t>{0, 0}));
}

TEST(Launch, KeepsNodesInNamespacesApart) {
  const Recorder<JointState> left(std::string("/left/joint_states"));
  const Recorder<JointState> both(std::string("/both/joint_states"));
  ASSERT_TRUE(waitUntil([&] { return left.count() > 0 && both.count() > 0; }));
  EXPECT_EQ(left.messages().back().name, std::vector<std::string>{"x_joint"});
  EXPECT_EQ(both.messages().back().name, (std::vector<std::string>{"x_joint", "r_joint"}))
      << "in the order of the file";

  const auto before = callWhenThere<RigReport>("/both/stepdriver/rig/report");
  MoveTo::Request request;
  request.position = 0.005;
  request.relative = true;
  request.wait = true;
  std_srvs::SetBool::Request on;
  on.data = true;
  EXPECT_TRUE(callWhenThere<std_srvs::SetBool>("/left/stepdriver/x/enable", on).success);
  EXPECT_TRUE(callWhenThere<MoveTo>("/left/stepdriver/x/move_to", request).success);
  const auto after = callWhenThere<RigReport>("/both/stepdriver/rig/report");
  EXPECT_EQ(after.pulses_forward, before.pulses_forward);
}

TEST(Launch, BringsUpTwoAxesThatMoveAtTheSameTime) {
  const std::string node = "/both/stepdriver";
  std_srvs::SetBool::Request on;
  on.data = true;
  EXPECT_TRUE(callWhenThere<std_srvs::SetBool>(node + "/enable", on).success);
  MoveTo::Request request;
  request.position = 0.05;
  const auto refused = callWhenThere<MoveTo>(node + "/x/move_to", request);
  EXPECT_FALSE(refused.success) << "it has a homing, and isn't homed";
  HomeAxes::Request waiting;
  waiting.wait = true;
  const auto homed = callWhenThere<HomeAxes>(node + "/home", waiting);
  EXPECT_TRUE(homed.success) << homed.message;
  EXPECT_TRUE(callWhenThere<MoveTo>(node + "/x/move_to", request).success);
  request.position = 1.0;
  EXPECT_TRUE(callWhenThere<MoveTo>(node + "/r/move_to", request).success);
  const Recorder<JointState> states(std::string("/both/joint_states"));
  EXPECT_TRUE(states.waitForLatest([](const JointState& s) {
    return std::abs(s.position.at(0) - 0.05) < 1e-4 && std::abs(s.position.at(1) - 1.0) < 1e-3;
  }));
}

TEST(Launch, BringsUpAPlotterThatDrawsALine) {
  HomeAxes::Request waiting;
  waiting.wait = true;
  const auto homed = callWhenThere<HomeAxes>("/plotter/stepdriver/home", waiting);
  EXPECT_TRUE(homed.success) << homed.message;
  MoveLine::Request request;
  request.name = {"x", "y"};
  request.position = {0.0, 0.0};
  request.wait = true;
  EXPECT_TRUE(callWhenThere<MoveLine>("/plotter/stepdriver/move_line", request).success);
  const auto before = callWhenThere<RigReport>("/plotter/stepdriver/rig/report");
  request.position = {0.08, 0.06};
  const auto answer = callWhenThere<MoveLine>("/plotter/stepdriver/move_line", request);
  EXPECT_TRUE(answer.success) << answer.message;
  const auto report = callWhenThere<RigReport>("/plotter/stepdriver/rig/report");
  EXPECT_EQ(report.pulses_forward[0] - before.pulses_forward[0], 6400);
  EXPECT_EQ(report.pulses_forward[1] - before.pulses_forward[1], 4800);
  EXPECT_EQ(report.violations, (std::vector<std::int64_t>{0, 0}));
  const Recorder<JointState> states(std::string("/plotter/joint_states"));
  ASSERT_TRUE(states.waitForLatest([](const JointState&) { return true; }));
  EXPECT_EQ(states.messages().back().name, (std::vector<std::string>{"x_joint", "y_joint"}));
}

TEST(Launch, JogsTwoAxesByAJoystick) {
  const std::string node = "/both/stepdriver";
  const auto before = callWhenThere<RigReport>(node + "/rig/report");
  std_srvs::SetBool::Request on;
  on.data = true;
  EXPECT_TRUE(callWhenThere<std_srvs::SetBool>(node + "/x/enable", on).success);
  auto joy = ros::NodeHandle().advertise<sensor_msgs::Joy>("/both/joy", 1);
  sensor_msgs::Joy sticks;
  sticks.axes = {0.5F, 0.5F};
  EXPECT_TRUE(waitUntil([&] {
    joy.publish(sticks);
    const auto now = callWhenThere<RigReport>(node + "/rig/report");
    return now.pulses_backward.at(1) > before.pulses_backward.at(1) &&
           now.pulses_forward.at(0) > before.pulses_forward.at(0);
  })) << "r is inverted, and enabled by the joystick's node";
}

TEST(Launch, StartsARobotStatePublisher) {
  EXPECT_TRUE(waitUntil([] {
    ros::master::V_TopicInfo topics;
    ros::master::getTopics(topics);
    for (const auto& topic : topics) {
      if (topic.name == "/tf") return true;
    }
    return false;
  }));
}

}  // namespace
}  // namespace stepdriver::node_test
