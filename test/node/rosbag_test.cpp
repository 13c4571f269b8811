#include <actionlib/client/simple_action_client.h>
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/network.h>
#include <ros/this_node.h>
#include <sensor_msgs/JointState.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Jog.h>
#include <stepdriver/MoveAction.h>
#include <unistd.h>
#include <xmlrpcpp/XmlRpc.h>

#include <algorithm>
#include <array>
#include <csignal>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "support/node_process.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

// Topics below the node's namespace; the others have no messages in this test.
constexpr std::array<const char*, 8> kPublished = {"/joint_states",
                                                   "/stepdriver/axis_states",
                                                   "/stepdriver/endstops",
                                                   "/stepdriver/jog",
                                                   "/stepdriver/x/move/goal",
                                                   "/stepdriver/x/move/result",
                                                   "/stepdriver/x/homing/status",
                                                   "/stepdriver/follow_joint_trajectory/status"};
constexpr const char* kEnv = "/usr/bin/env";  // finds rosrun, as a shell does

std::set<std::string> topicsBelow(const std::string& name_space) {
  ros::master::V_TopicInfo topics;
  ros::master::getTopics(topics);
  std::set<std::string> names;
  for (const auto& topic : topics) {
    if (topic.name.rfind(name_space + "/", 0) == 0) names.insert(topic.name);
  }
  return names;
}

/// Topics that a node publishes to rosbag's recorder over an existing connection.
std::set<std::string> topicsToTheRecorder(const std::string& node) {
  XmlRpc::XmlRpcValue request;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue uri;
  request[0] = ros::this_node::getName();
  request[1] = node;
  if (!ros::master::execute("lookupNode", request, response, uri, false)) return {};
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(uri, host, port)) return {};
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue caller;
  caller[0] = ros::this_node::getName();
  if (!client.execute("getBusInfo", caller, response) || client.isFault()) return {};
  std::set<std::string> topics;
  for (int i = 0; i < response[2].size(); ++i) {
    XmlRpc::XmlRpcValue& connection = response[2][i];
    const std::string to = connection[1];
    if (to.rfind("/record_", 0) == 0) topics.insert(static_cast<std::string>(connection[4]));
  }
  return topics;
}

class Bag : public testing::Test {
 public:
  ~Bag() override { std::filesystem::remove(file); }

 protected:
  void record() {
    recorder = std::make_unique<NodeProcess>(
        std::vector<std::string>{"rosrun", "rosbag", "record", "-O", file, "-e",
                                 space + "/.*|/diagnostics"},
        kEnv);
    EXPECT_TRUE(waitUntil([this] {
      std::set<std::string> heard = topicsToTheRecorder(node.name());
      heard.merge(topicsToTheRecorder(ros::this_node::getName()));
      return heard.count("/diagnostics") == 1 &&
             std::all_of(kPublished.begin(), kPublished.end(),
                         [&](const char* topic) { return heard.count(space + topic) == 1; });
    })) << recorder->output();
  }

  NodeUnderTest node;
  const std::string space = node.name().substr(0, node.name().rfind('/'));
  const std::string file =
      std::filesystem::temp_directory_path() / ("stepdriver_" + std::to_string(getpid()) + ".bag");
  std::unique_ptr<NodeProcess> recorder;
};

TEST_F(Bag, RecordsEveryTopicOfTheNodeAndPlaysItBack) {
  auto jog = ros::NodeHandle().advertise<Jog>(node.full("jog"), 1);
  node.start();
  actionlib::SimpleActionClient<MoveAction> client(node.full("x/move"), false);
  ASSERT_TRUE(client.waitForServer(ros::Duration(kBound.count())));
  const std::set<std::string> topics = topicsBelow(space);
  for (const char* topic : kPublished) EXPECT_EQ(topics.count(space + topic), 1U) << topic;
  const Recorder<AxisStates> live(node.full("axis_states"));
  record();
  MoveGoal goal;
  goal.position = 0.05;
  client.sendGoal(goal);
  ASSERT_TRUE(client.waitForResult(ros::Duration(kBound.count())));
  Jog message;
  message.name = {"x"};
  message.velocity = {-0.01};
  EXPECT_TRUE(live.waitForLatest([&](const AxisStates& now) {
    jog.publish(message);
    return now.position.at(0) < 0.0499;
  }));
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics(std::string("/diagnostics"));
  ASSERT_TRUE(waitUntil([&] { return diagnostics.count() > 1; }));
  recorder->signal(SIGINT);
  EXPECT_EQ(recorder->waitForExit(kBound), 0) << recorder->output();

  const Recorder<AxisStates> played("/again" + node.full("axis_states"));
  const Recorder<MoveActionResult> result("/again" + node.full("x/move/result"));
  const Recorder<Jog> jogs("/again" + node.full("jog"));
  const Recorder<diagnostic_msgs::DiagnosticArray> health(std::string("/again/diagnostics"));
  NodeProcess player({"rosrun", "rosbag", "play", "--quiet", "--delay=3", "--prefix=/again", file},
                     kEnv);
  EXPECT_TRUE(waitUntil([&] {
    const auto again = topicsBelow("/again");
    return std::all_of(kPublished.begin(), kPublished.end(), [&](const char* topic) {
      return again.count("/again" + space + topic) == 1;
    });
  })) << player.output();
  EXPECT_EQ(player.waitForExit(3 * kBound), 0) << player.output();

  EXPECT_GT(jogs.count(), 0U);
  EXPECT_GT(health.count(), 0U);
  ASSERT_EQ(result.count(), 1U);
  EXPECT_EQ(result.messages()[0].result.end, MoveResult::REACHED);
  const auto again = played.messages();
  ASSERT_GT(again.size(), 5U);
  const auto were = live.messages();
  for (const AxisStates& state : again) {
    EXPECT_TRUE(std::any_of(were.begin(), were.end(), [&state](const AxisStates& was) {
      return was.header.stamp == state.header.stamp && was.position == state.position &&
             was.fault == state.fault;
    })) << state.header.stamp;
  }
}

}  // namespace
}  // namespace stepdriver::node_test
