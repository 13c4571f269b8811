// Tests messages that claim longer arrays than they have: read by themselves, and sent to the node.
#include "node/calls/bounded.h"

#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/service_client.h>
#include <std_msgs/Float64MultiArray.h>
#include <stepdriver/FollowJointTrajectoryActionGoal.h>
#include <stepdriver/FollowPath.h>
#include <stepdriver/FollowPathActionGoal.h>
#include <stepdriver/HomeAxes.h>
#include <stepdriver/Jog.h>
#include <stepdriver/MoveLine.h>
#include <sys/resource.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "support/message_bytes.h"
#include "support/node_under_test.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {

/// Any bytes, sent in place of a message M.
template <typename M>
struct Raw {
  std::string bytes;
};

}  // namespace stepdriver::node_test

namespace ros {

namespace serialization {
template <typename M>
struct Serializer<stepdriver::node_test::Raw<M>> {
  template <typename Stream>
  static void write(Stream& stream, const stepdriver::node_test::Raw<M>& message) {
    std::memcpy(stream.advance(serializedLength(message)), message.bytes.data(),
                message.bytes.size());
  }
  static std::uint32_t serializedLength(const stepdriver::node_test::Raw<M>& message) {
    return static_cast<std::uint32_t>(message.bytes.size());
  }
};
}  // namespace serialization

namespace message_traits {
template <typename M>
struct IsMessage<stepdriver::node_test::Raw<M>> : TrueType {};
template <typename M>
struct MD5Sum<stepdriver::node_test::Raw<M>> {
  static const char* value() { return MD5Sum<M>::value(); }
  static const char* value(const stepdriver::node_test::Raw<M>& /*message*/) { return value(); }
};
template <typename M>
struct DataType<stepdriver::node_test::Raw<M>> {
  static const char* value() { return DataType<M>::value(); }
  static const char* value(const stepdriver::node_test::Raw<M>& /*message*/) { return value(); }
};
template <typename M>
struct Definition<stepdriver::node_test::Raw<M>> : Definition<M> {};
}  // namespace message_traits

namespace service_traits {
template <typename M>
struct MD5Sum<stepdriver::node_test::Raw<M>> : MD5Sum<M> {};
}  // namespace service_traits

}  // namespace ros

namespace stepdriver::node_test {
namespace {

using ros_node::Bounded;
using ActionGoal = FollowJointTrajectoryActionGoal;

constexpr long kMegabyte = 1024;  // in the unit of ru_maxrss

long mostMemory() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return usage.ru_maxrss;
}

/// Reads as roscpp does for a subscriber.
template <typename M>
M read(std::string bytes) {
  M message;
  ros::serialization::IStream stream(reinterpret_cast<std::uint8_t*>(bytes.data()),
                                     static_cast<std::uint32_t>(bytes.size()));
  ros::serialization::deserialize(stream, message);
  return message;
}

std::string number(std::uint32_t value) {
  std::string bytes(sizeof(value), '\0');
  std::memcpy(bytes.data(), &value, sizeof(value));
  return bytes;
}

/// What precedes the fields of a goal.
const std::string kGoalId = bytesOf(std_msgs::Header()) + bytesOf(actionlib_msgs::GoalID());
/// What precedes the names of the joints of a trajectory's goal.
const std::string kGoalHeaders = kGoalId + bytesOf(std_msgs::Header());

ActionGoal goal() {
  ActionGoal goal;
  goal.header.frame_id = "frame";
  goal.goal_id.id = "goal";
  goal.goal.trajectory.joint_names = {"x_joint", "y_joint"};
  for (int i = 0; i < 3; ++i) {
    trajectory_msgs::JointTrajectoryPoint point;
    point.positions = {0.1 * i, 0.2 * i};
    point.velocities = {0.0, 0.0};
    point.time_from_start = ros::Duration(i);
    goal.goal.trajectory.points.push_back(point);
  }
  goal.goal.path_tolerance.resize(1);
  goal.goal.path_tolerance[0].name = "x_joint";
  return goal;
}

TEST(BoundedMessage, IsReadAsRoscppReadsIt) {
  const std::string bytes = bytesOf(goal());
  EXPECT_EQ(bytesOf<ActionGoal>(read<Bounded<ActionGoal>>(bytes)), bytes);
}

TEST(BoundedMessage, ThatEndsTooEarlyIsRefusedWhereverItEnds) {
  const std::string bytes = bytesOf(goal());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_ANY_THROW(read<Bounded<ActionGoal>>(bytes.substr(0, size))) << size;
  }
}

TEST(BoundedMessage, ThatClaimsMoreThanItHasCostsNoMemory) {
  const long before = mostMemory();
  const std::string many = number(100'000'000);
  const std::string header = bytesOf(std_msgs::Header());
  EXPECT_THROW(read<Bounded<Jog>>(header + many), Refused);
  EXPECT_THROW(read<Bounded<Jog>>(header + number(0) + many), Refused);
  EXPECT_THROW(read<Bounded<HomeAxes::Request>>(many + std::string(5, 'a')), Refused);
  EXPECT_THROW(read<Bounded<MoveLine::Request>>(many), Refused);
  EXPECT_THROW(read<Bounded<FollowPath::Request>>(number(0) + many), Refused);
  EXPECT_THROW(
      read<Bounded<FollowPath::Request>>(number(0) + number(1) + std::string(1, '\0') + many),
      Refused);
  EXPECT_THROW(read<Bounded<FollowPathActionGoal>>(kGoalId + many), Refused);
  const std::string names = kGoalHeaders + number(0);
  EXPECT_THROW(read<Bounded<ActionGoal>>(kGoalHeaders + many), Refused);
  EXPECT_THROW(read<Bounded<ActionGoal>>(names + many), Refused) << "points";
  EXPECT_THROW(read<Bounded<ActionGoal>>(names + number(1) + many + bytesOf(goal())), Refused)
      << "positions of a point";
  EXPECT_LT(mostMemory() - before, 20 * kMegabyte);
}

TEST(BoundedMessage, OfRandomBytesCostsNoMemory) {
  const long before = mostMemory();
  std::mt19937 random(20261122);
  int refused = 0;
  for (int i = 0; i < 3000; ++i) {
    std::string bytes(random() % 5000, '\0');
    for (char& byte : bytes) byte = static_cast<char>(random() % 4 == 0 ? random() : 0);
    try {
      read<Bounded<ActionGoal>>(bytes);
    } catch (const std::exception&) {
      ++refused;
    }
  }
  EXPECT_GT(refused, 1000);
  EXPECT_LT(mostMemory() - before, 100 * kMegabyte);
}

TEST(BoundedMessage, HasAMostNumberOfNamesAndElements) {
  Jog jog;
  jog.name.resize(ros_node::kMostNames);
  EXPECT_EQ(read<Bounded<Jog>>(bytesOf(jog)).name.size(), ros_node::kMostNames);
  jog.name.resize(ros_node::kMostNames + 1);
  try {
    read<Bounded<Jog>>(bytesOf(jog));
    FAIL() << "no refusal";
  } catch (const Refused& refused) {
    expectSays(refused.what(), "an array of 1001 elements; at most 1000 are allowed");
  }
  jog.name.clear();
  jog.velocity.resize(ros_node::kMostElements + 1);
  EXPECT_THROW(read<Bounded<Jog>>(bytesOf(jog)), Refused);
}

class LyingClient : public testing::Test {
 protected:
  LyingClient() {
    node.start();
    before = node.process().kilobytes("VmHWM");
  }
  void TearDown() override {
    EXPECT_LT(node.process().kilobytes("VmHWM") - before, 30'000U) << "kB more";
    EXPECT_TRUE(node.moveTo(0.01, true).success) << "afterwards";
  }

  template <typename M>
  void publish(const std::string& topic, const std::string& bytes) {
    auto publisher = ros::NodeHandle().advertise<Raw<M>>(node.full(topic), 1);
    ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() == 1; }));
    publisher.publish(Raw<M>{bytes});
    EXPECT_TRUE(waitUntil([this] {
      return node.process().output().find("claims an array of 100000000") != std::string::npos;
    })) << topic;
  }
  template <typename Service>
  void call(const std::string& service, const std::string& bytes) {
    Raw<typename Service::Request> request{bytes};
    typename Service::Response response;
    ros::ServiceClient client = ros::NodeHandle().serviceClient<Service>(node.full(service), true);
    ASSERT_TRUE(client.isValid());
    EXPECT_FALSE(client.call(request, response, ros::service_traits::md5sum<Service>()));
  }

  NodeUnderTest node;
  std::size_t before = 0;
};

const std::string kLie = number(100'000'000) + std::string(5, '\0');

TEST_F(LyingClient, OfHomeIsRefused) { call<HomeAxes>("home", kLie); }
TEST_F(LyingClient, OfMoveLineIsRefused) { call<MoveLine>("move_line", kLie); }
TEST_F(LyingClient, OfFollowPathIsRefused) { call<FollowPath>("follow_path", kLie); }
TEST_F(LyingClient, OfJogIsRefused) { publish<Jog>("jog", bytesOf(std_msgs::Header()) + kLie); }
TEST_F(LyingClient, OfSetpointIsRefused) {
  // An empty list of dimensions, no offset, and the numbers.
  publish<std_msgs::Float64MultiArray>("setpoint", number(0) + number(0) + kLie);
}
TEST_F(LyingClient, OfTheDimensionsOfSetpointIsRefused) {
  publish<std_msgs::Float64MultiArray>("setpoint", kLie);
}
TEST_F(LyingClient, OfCommandIsRefused) {
  publish<trajectory_msgs::JointTrajectory>("command", bytesOf(std_msgs::Header()) + kLie);
}
TEST_F(LyingClient, OfAPathActionIsRefused) {
  publish<FollowPathActionGoal>("follow_path/goal", kGoalId + kLie);
}
TEST_F(LyingClient, OfATrajectoryActionIsRefused) {
  publish<ActionGoal>("follow_joint_trajectory/goal", kGoalHeaders + kLie);
}

}  // namespace
}  // namespace stepdriver::node_test
