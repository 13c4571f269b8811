#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/this_node.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/RigReport.h>

#include <algorithm>
#include <memory>
#include <string>
#include <vector>

#include "support/call_service.h"
#include "support/node_process.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

bool isPublished(const std::string& topic) {
  ros::master::V_TopicInfo topics;
  ros::master::getTopics(topics);
  return std::any_of(topics.begin(), topics.end(),
                     [&topic](const auto& info) { return info.name == topic; });
}

/// Starts another node with the configuration of an existing one, and with the arguments that a
/// user would give.
std::unique_ptr<NodeProcess> startAs(const NodeUnderTest& like, const std::string& name,
                                     const std::vector<std::string>& arguments) {
  XmlRpc::XmlRpcValue parameters;
  EXPECT_TRUE(ros::param::get(like.name(), parameters));
  ros::param::set(name, parameters);
  auto process = std::make_unique<NodeProcess>(arguments);
  EXPECT_TRUE(waitUntil([&] { return process->output().find("Ready") != std::string::npos; }))
      << process->output();
  return process;
}

MoveTo::Response moveTo(const std::string& node, double position) {
  MoveTo::Request request;
  request.position = position;
  request.wait = true;
  return callWhenThere<MoveTo>(node + "/x/move_to", request);
}

std::int64_t pulsesOf(const std::string& node) {
  return callWhenThere<RigReport>(node + "/rig/report").pulses_forward.at(0);
}

TEST(Names, FollowTheNodesNameAndNamespace) {
  const NodeUnderTest like;
  const auto process =
      startAs(like, "/names/cell_1/feeder", {"__ns:=/names/cell_1", "__name:=feeder"});
  const Recorder<sensor_msgs::JointState> states(std::string("/names/cell_1/joint_states"));
  EXPECT_TRUE(moveTo("/names/cell_1/feeder", 0.01).success);
  EXPECT_TRUE(states.waitForLatest(
      [](const sensor_msgs::JointState& state) { return state.position.at(0) == 0.01; }));
  for (const char* topic : {"/names/cell_1/feeder/axis_states", "/names/cell_1/feeder/endstops",
                            "/names/cell_1/feeder/x/move/status", "/diagnostics"}) {
    EXPECT_TRUE(isPublished(topic)) << topic;
  }
  process->signal(SIGTERM);
  process->waitForExit(kBound);
  ros::param::del("/names");
}

TEST(Names, CanBeRemapped) {
  const NodeUnderTest like;
  const auto process =
      startAs(like, "/remapped/stepdriver",
              {"__ns:=/remapped", "__name:=stepdriver", "joint_states:=/robot/arm_states",
               "~axis_states:=axes", "~x/move_to:=/robot/go", "~x/stop:=/robot/halt",
               "~emergency_stop:=/robot/kill", "/diagnostics:=/robot/health"});
  const Recorder<sensor_msgs::JointState> states(std::string("/robot/arm_states"));
  const Recorder<AxisStates> axes(std::string("/remapped/axes"));
  MoveTo::Request request;
  request.position = 0.01;
  request.wait = true;
  EXPECT_TRUE(callWhenThere<MoveTo>("/robot/go", request).success);
  EXPECT_TRUE(states.waitForLatest(
      [](const sensor_msgs::JointState& state) { return state.position.at(0) == 0.01; }));
  EXPECT_TRUE(axes.waitForLatest([](const AxisStates& now) { return now.target.at(0) == 0.01; }));
  EXPECT_TRUE(isPublished("/robot/health"));
  EXPECT_FALSE(isPublished("/remapped/joint_states"));
  EXPECT_FALSE(isPublished("/remapped/stepdriver/axis_states"));
  for (const char* service : {"/robot/halt", "/robot/kill"}) {
    EXPECT_TRUE(callWhenThere<std_srvs::Trigger>(service).success) << service;
  }
  for (const char* service : {"x/move_to", "x/stop", "emergency_stop"}) {
    const std::string name = std::string("/remapped/stepdriver/") + service;
    EXPECT_FALSE(ros::service::exists(name, false)) << name;
  }
  process->signal(SIGTERM);
  process->waitForExit(kBound);
  ros::param::del("/remapped");
}

TEST(Names, KeepTwoRobotsOfOneConfigurationApart) {
  const NodeUnderTest like;
  const auto left = startAs(like, "/left/stepdriver", {"__ns:=/left", "__name:=stepdriver"});
  const auto right = startAs(like, "/right/stepdriver", {"__ns:=/right", "__name:=stepdriver"});
  const Recorder<sensor_msgs::JointState> left_states(std::string("/left/joint_states"));
  const Recorder<sensor_msgs::JointState> right_states(std::string("/right/joint_states"));
  EXPECT_TRUE(moveTo("/left/stepdriver", 0.02).success);
  EXPECT_TRUE(moveTo("/right/stepdriver", 0.01).success);
  EXPECT_EQ(pulsesOf("/left/stepdriver"), 1600);
  EXPECT_EQ(pulsesOf("/right/stepdriver"), 800);
  const auto stands = [](double at) {
    return [at](const sensor_msgs::JointState& state) { return state.position.at(0) == at; };
  };
  EXPECT_TRUE(left_states.waitForLatest(stands(0.02)));
  EXPECT_TRUE(right_states.waitForLatest(stands(0.01)));

  left->signal(SIGTERM);
  EXPECT_EQ(left->waitForExit(kBound), 0);
  EXPECT_TRUE(moveTo("/right/stepdriver", 0.03).success) << "the other one goes on";
  right->signal(SIGTERM);
  EXPECT_EQ(right->waitForExit(kBound), 0);
  ros::param::del("/left");
  ros::param::del("/right");
}

}  // namespace
}  // namespace stepdriver::node_test
