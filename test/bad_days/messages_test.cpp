// Floods of messages that keep the rules, but are too long.
#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <stepdriver/Jog.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <string>

#include "flood.h"
#include "flooded_node.h"
#include "support/tcpros_client.h"
#include "support/wait.h"
#include "tcpros_bytes.h"

namespace stepdriver::bad_days {
namespace {

using node_test::lengthBytes;
using node_test::TcprosClient;
using node_test::waitUntil;
using trajectory_msgs::JointTrajectory;
using trajectory_msgs::JointTrajectoryPoint;

constexpr std::size_t kMuch = 100'000'000;  // bytes

// A service whose request is an array of names.
TEST_F(FloodedNode, ByArraysOf100MegabytesInCalls) {
  const std::string service = node_.full("home");
  const std::uint16_t port = node_test::servicePort(service);
  // Names of one letter.
  std::string names;
  names.reserve(kMuch);
  names += lengthBytes(kMuch / 5);
  while (names.size() + 5 <= kMuch) names += lengthBytes(1) + "x";
  const Flood flood(10.0, [&] {
    const TcprosClient client(port);
    client.resetAtEnd();
    client.send(introduction(service));
    client.receiveHeader();
    client.request(names);
    EXPECT_FALSE(client.answer()) << "more names than allowed";
  });
  endure([&] { return perSecond(flood.rate(), "requests of 100 MB"); });
}

TEST_F(FloodedNode, ByArraysOf100MegabytesInMessages) {
  const auto topic = node_.full("jog");
  ros::Publisher publisher = ros::NodeHandle().advertise<Jog>(topic, 1);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() > 0; }));
  noteBefore();
  Jog jog;
  jog.name = {"x"};
  jog.velocity.resize(kMuch / sizeof(jog.velocity[0]));
  const Flood flood(2.0, [&] { publisher.publish(jog); });
  endure([&] { return perSecond(flood.rate(), "messages of 100 MB"); });
}

/// A slow motion that its axis can follow.
JointTrajectory longTrajectory(std::size_t points) {
  JointTrajectory trajectory;
  trajectory.joint_names = {"x_joint"};
  trajectory.points.reserve(points);
  for (std::size_t i = 1; i <= points; ++i) {
    JointTrajectoryPoint point;
    const double u = static_cast<double>(i) / static_cast<double>(points);
    const double duration = 0.01 * static_cast<double>(points);
    point.positions = {0.05 + 0.01 * u * u * u * (10.0 + u * (6.0 * u - 15.0))};
    point.velocities = {0.01 * 30.0 * u * u * (1.0 - u) * (1.0 - u) / duration};
    point.time_from_start = ros::Duration(duration * u + 10.0);
    trajectory.points.push_back(point);
  }
  return trajectory;
}

TEST_F(FloodedNode, ByTrajectoriesOf100000Points) {
  ros::Publisher publisher = ros::NodeHandle().advertise<JointTrajectory>(node_.full("command"), 1);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() > 0; }));
  noteBefore();
  const JointTrajectory trajectory = longTrajectory(100'000);
  Flood flood(20.0, [&] { publisher.publish(trajectory); });
  endure([&] { return perSecond(flood.rate(), "trajectories of 10^5 points"); });
  flood.end();
  // The node handles them in their order, and has refused the rest when it refuses this.
  JointTrajectory last;
  last.joint_names = {"no_such_joint"};
  EXPECT_TRUE(waitUntil([&] {
    publisher.publish(last);
    return node_.process().output().find("no_such_joint") != std::string::npos;
  }));
}

}  // namespace
}  // namespace stepdriver::bad_days
