// A message that a publisher has latched before the node could receive it moves nothing.
#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/this_node.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <stepdriver/Jog.h>
#include <stepdriver/MoveActionGoal.h>
#include <stepdriver/MoveLineActionGoal.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <csignal>
#include <cstdint>
#include <functional>
#include <memory>
#include <ostream>
#include <string>
#include <vector>

#include "support/control_msgs_client.h"
#include "support/cut_connections.h"
#include "support/node_process.h"
#include "support/node_under_test.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

trajectory_msgs::JointTrajectory trajectory() {
  trajectory_msgs::JointTrajectory message;
  message.joint_names = {"x_joint"};
  message.points.resize(1);
  message.points[0].positions = {0.01};
  message.points[0].velocities = {0.0};
  message.points[0].time_from_start = ros::Duration(1.0);
  return message;
}

/// A topic whose message moves x.
struct Topic {
  std::string name;
  std::function<ros::Publisher(const std::string& topic)> advertise;
  std::function<void(ros::Publisher&)> publish;
};

void PrintTo(const Topic& topic, std::ostream* out) {  // NOLINT: GoogleTest's name for it
  *out << topic.name;
}

template <typename Message>
Topic topicOf(const std::string& name, const std::function<void(Message&)>& fill) {
  return {
      name,
      [](const std::string& topic) { return ros::NodeHandle().advertise<Message>(topic, 1, true); },
      [fill](ros::Publisher& publisher) {
        Message message;
        fill(message);
        publisher.publish(message);
      }};
}

std::vector<Topic> topics() {
  return {
      topicOf<trajectory_msgs::JointTrajectory>("command", [](auto& m) { m = trajectory(); }),
      topicOf<std_msgs::Float64>("x/setpoint", [](auto& m) { m.data = 0.01; }),
      topicOf<std_msgs::Float64MultiArray>("setpoint", [](auto& m) { m.data = {0.01}; }),
      topicOf<Jog>("jog",
                   [](auto& m) {
                     m.name = {"x"};
                     m.velocity = {0.05};
                   }),
      topicOf<MoveActionGoal>("x/move/goal", [](auto& m) { m.goal.position = 0.01; }),
      topicOf<MoveLineActionGoal>("move_line/goal",
                                  [](auto& m) {
                                    m.goal.name = {"x"};
                                    m.goal.position = {0.01};
                                  }),
      topicOf<action_msgs::FollowJointTrajectoryActionGoal>(
          "follow_joint_trajectory/goal", [](auto& m) { m.goal.trajectory = trajectory(); }),
  };
}

class LatchedMessage : public testing::TestWithParam<Topic> {
 protected:
  std::string topic() const { return node.full(GetParam().name); }
  /// What the log says about an old message.
  std::string words() const {
    return topic() + ": a message of " + ros::this_node::getName() + ", which latches";
  }
  int timesSaid(const std::string& what) {
    const std::string output = node.process().output();
    int times = 0;
    for (auto at = output.find(what); at != std::string::npos; at = output.find(what, at + 1)) {
      ++times;
    }
    return times;
  }

  NodeUnderTest node;
};

TEST_P(LatchedMessage, FromBeforeTheStartMovesNothingUntilANewerOneComes) {
  ros::Publisher publisher = GetParam().advertise(topic());
  GetParam().publish(publisher);
  node.start();
  EXPECT_TRUE(waitUntil([&] { return timesSaid(words()) > 0 || node.pulses() > 0; }));
  EXPECT_EQ(timesSaid(words()), 1) << node.process().output();
  EXPECT_EQ(node.pulses(), 0);
  GetParam().publish(publisher);
  EXPECT_TRUE(waitUntil([&] { return node.pulses() >= 800; })) << node.pulses();
  EXPECT_EQ(timesSaid(words()), 1) << node.process().output();
}

TEST_P(LatchedMessage, ThatComesAgainWithANewConnectionMovesNothing) {
  node.start();
  ros::Publisher publisher = GetParam().advertise(topic());
  GetParam().publish(publisher);
  EXPECT_TRUE(waitUntil([&] { return node.pulses() >= 800; })) << "its publisher is new";
  EXPECT_EQ(timesSaid(words()), 0) << node.process().output();
  // Elsewhere, so that the same message would move it.
  EXPECT_TRUE(node.moveTo(0.03, true).success);
  const std::int64_t pulses = node.pulses();
  cutConnections();
  EXPECT_TRUE(waitUntil([&] { return timesSaid(words()) > 0 || node.pulses() != pulses; }));
  EXPECT_EQ(timesSaid(words()), 1) << node.process().output();
  EXPECT_EQ(node.pulses(), pulses);
  GetParam().publish(publisher);
  EXPECT_TRUE(waitUntil([&] { return node.pulses() > pulses; }));
}

INSTANTIATE_TEST_SUITE_P(Of, LatchedMessage, testing::ValuesIn(topics()), [](const auto& value) {
  std::string name = value.param.name;
  for (char& c : name) c = c == '/' ? '_' : c;
  return name;
});

class TypedMessage : public testing::Test {
 protected:
  /// `rostopic pub`, which latches, with a command to a position.
  std::unique_ptr<NodeProcess> type(double position, const std::vector<std::string>& options) {
    std::vector<std::string> words{
        "rostopic", "pub", node.full("command"), "trajectory_msgs/JointTrajectory",
        "{joint_names: [x_joint], points: [{positions: [" + std::to_string(position) +
            "], velocities: [0], time_from_start: {secs: 1}}]}"};
    words.insert(words.end(), options.begin(), options.end());
    return std::make_unique<NodeProcess>(words, "/usr/bin/env");
  }

  NodeUnderTest node;
};

TEST_F(TypedMessage, MovesWheneverItIsTypedAfterTheStart) {
  node.start();
  auto first = type(0.01, {"-1"});
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 800; })) << node.process().output();
  auto second = type(0.02, {"-1"});
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 1600; })) << node.process().output();
  EXPECT_EQ(first->waitForExit(kBound).value_or(-1), 0);
  EXPECT_EQ(second->waitForExit(kBound).value_or(-1), 0);
}

TEST_F(TypedMessage, MovesIfItsPublisherIsStartedAgainUnderItsName) {
  const std::string name = "__name:=a_publisher_of_this_name";
  auto before = type(0.01, {name});
  ASSERT_TRUE(waitUntil([&] {
    return before->output().find("publishing and latching") != std::string::npos;
  })) << before->output();
  node.start();
  EXPECT_TRUE(waitUntil([&] {
    return node.process().output().find("/a_publisher_of_this_name, which latches") !=
           std::string::npos;
  })) << node.process().output();
  EXPECT_EQ(node.pulses(), 0);
  before->signal(SIGINT);
  EXPECT_TRUE(before->waitForExit(kBound));
  auto again = type(0.02, {name});
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 1600; })) << node.process().output();
}

// As roslaunch does with respawn.
TEST_F(TypedMessage, FromBeforeTheNodeWasStartedAgainMovesNothing) {
  node.start();
  auto typed = type(0.01, {});
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 800; })) << node.process().output();
  node.process().signal(SIGTERM);
  EXPECT_TRUE(node.process().waitForExit(kBound));
  node.start();
  EXPECT_TRUE(waitUntil([&] {
    return node.pulses() > 0 ||
           node.process().output().find(", which latches") != std::string::npos;
  }));
  EXPECT_EQ(node.pulses(), 0);
}

}  // namespace
}  // namespace stepdriver::node_test
