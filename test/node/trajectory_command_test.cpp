#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <stepdriver/AxisStates.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <functional>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/two_axes.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using trajectory_msgs::JointTrajectory;

/// A trajectory of both axes, to rest at these positions.
JointTrajectory to(double x, double y, double duration) {
  JointTrajectory message;
  message.joint_names = {"x_joint", "y_joint"};
  message.points.resize(1);
  message.points[0].positions = {x, y};
  message.points[0].velocities = {0.0, 0.0};
  message.points[0].time_from_start = ros::Duration(duration);
  return message;
}

class TrajectoryCommandTest : public testing::Test {
 protected:
  TrajectoryCommandTest() { addSecondAxis(node); }

  void start(double speed) {
    node.set("simulation/speed", speed);
    node.start();
    publisher = ros::NodeHandle().advertise<JointTrajectory>(node.full("command"), 1);
    ASSERT_TRUE(waitUntil([this] { return publisher.getNumSubscribers() == 1; }));
  }

  bool saysSoon(const std::string& words) {
    return waitUntil([&] { return node.process().output().find(words) != std::string::npos; });
  }

  NodeUnderTest node;
  ros::Publisher publisher;
};

TEST_F(TrajectoryCommandTest, MovesTheJoints) {
  start(20.0);
  publisher.publish(to(0.03, -0.01, 1.0));
  EXPECT_TRUE(waitUntil([this] { return node.pulses() == 2400 + 800; }));
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward, (std::vector<std::int64_t>{2400, 0}));
  EXPECT_EQ(report.violations, (std::vector<std::int64_t>{0, 0}));
}

TEST_F(TrajectoryCommandTest, StopsTheJointsThatItNamesWithoutPoints) {
  start(1.0);
  const Recorder<AxisStates> states(node.full("axis_states"));
  for (const bool named : {true, false}) {
    publisher.publish(named ? to(0.15, 0.07, 5.0) : to(0.0, 0.0, 5.0));
    ASSERT_TRUE(states.waitForLatest(
        [](const AxisStates& s) { return s.moving.at(0) != 0 && s.velocity.at(1) != 0.0; }));
    JointTrajectory stop;
    if (named) stop.joint_names = {"y_joint"};
    publisher.publish(stop);
    ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) {
      return s.moving.at(0) == 0 && s.moving.at(1) == 0;
    })) << "all of a trajectory";
    EXPECT_LT(states.messages().back().position.at(0), 0.14);
    EXPECT_GT(states.messages().back().position.at(0), 0.0);
  }
}

TEST_F(TrajectoryCommandTest, MovesNothingByWhatItRefusesAndSaysWhy) {
  start(20.0);
  const auto changed = [](const std::function<void(JointTrajectory&)>& change) {
    JointTrajectory message = to(0.03, 0.01, 1.0);
    change(message);
    return message;
  };
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<JointTrajectory, std::string>> bad = {
      {changed([](auto& m) { m.joint_names[0] = "z_joint"; }), "there is no joint z_joint"},
      {changed([](auto& m) {
         m.points.clear();
         m.joint_names = {"w_joint"};
       }),
       "there is no joint w_joint"},
      {changed([](auto& m) { m.joint_names.clear(); }), "it names no joint"},
      {changed([](auto& m) { m.points[0].positions.pop_back(); }), "has 1 positions"},
      {changed([nan](auto& m) { m.points[0].positions[1] = nan; }), "among its positions"},
      {changed([](auto& m) { m.points[0].positions[0] = 0.3; }), "0.2 m"},
      {changed([](auto& m) { m.points[0].time_from_start.fromSec(0.1); }), "velocity is"},
      {changed([](auto& m) { m.header.stamp = ros::Time(1.0); }), "in the past"},
  };
  for (const auto& [message, words] : bad) {
    publisher.publish(message);
    EXPECT_TRUE(saysSoon(words)) << words;
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(TrajectoryCommandTest, SaysTheSameReasonOnceASecondAtMost) {
  start(20.0);
  const ros::SteadyTime begin = ros::SteadyTime::now();
  JointTrajectory old = to(0.03, 0.01, 1.0);
  old.header.stamp = ros::Time(1.0);
  JointTrajectory far = to(0.3, 0.01, 1.0);
  for (int i = 0; i < 50; ++i) {
    publisher.publish(old);
    ros::WallDuration(0.01).sleep();
  }
  publisher.publish(far);
  ASSERT_TRUE(saysSoon("0.2 m")) << "another reason is said at once";
  const std::string output = node.process().output();
  int times = 0;
  for (auto at = output.find("in the past"); at != std::string::npos;
       at = output.find("in the past", at + 1)) {
    ++times;
  }
  EXPECT_GE(times, 1);
  EXPECT_LE(times, 1 + (ros::SteadyTime::now() - begin).toSec());
}

}  // namespace
}  // namespace stepdriver::node_test
