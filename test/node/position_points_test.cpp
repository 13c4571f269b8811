#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <stepdriver/AxisStates.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/two_axes.h"
#include "support/wait.h"

// The messages that rqt_joint_trajectory_controller and MoveIt Servo publish while the axes move.

namespace stepdriver::node_test {
namespace {

using trajectory_msgs::JointTrajectory;

class PositionPointsNode : public testing::Test {
 protected:
  PositionPointsNode() { addSecondAxis(node); }

  void start(bool allow_slower) {
    node.set("simulation/speed", 1.0);
    node.set("trajectory/allow_slower", allow_slower);
    node.start();
    publisher = ros::NodeHandle().advertise<JointTrajectory>(node.full("command"), 10);
    ASSERT_TRUE(waitUntil([this] { return publisher.getNumSubscribers() == 1; }));
  }
  static JointTrajectory message(const std::vector<double>& x, double step) {
    JointTrajectory made;
    made.joint_names = {"x_joint", "y_joint"};
    for (std::size_t i = 0; i < x.size(); ++i) {
      trajectory_msgs::JointTrajectoryPoint point;
      point.positions = {x[i], x[i] / 3.0};
      point.time_from_start = ros::Duration(step * static_cast<double>(i + 1));
      made.points.push_back(point);
    }
    return made;
  }
  /// A target that moves to 0.03 m in 1.5 s, at a rate.
  void stream(double rate, double time_from_start, const std::vector<double>& velocities = {}) {
    const int messages = static_cast<int>(1.5 * rate);
    ros::WallRate pace(rate);
    for (int i = 1; i <= messages; ++i) {
      JointTrajectory each = message({0.03 * i / messages}, time_from_start);
      each.points[0].velocities = velocities;
      publisher.publish(each);
      pace.sleep();
    }
  }
  void expectAtTheTarget() {
    EXPECT_TRUE(waitUntil([this] { return node.pulses() == 2400 + 800; })) << node.pulses();
    EXPECT_EQ(node.rig().violations, (std::vector<std::int64_t>{0, 0}));
  }
  bool says(const std::string& words) {
    return node.process().output().find(words) != std::string::npos;
  }

  NodeUnderTest node;
  ros::Publisher publisher;
};

TEST_F(PositionPointsNode, FollowsASpline) {
  start(false);
  publisher.publish(message({0.01, 0.02, 0.03}, 0.5));
  expectAtTheTarget();
}

TEST_F(PositionPointsNode, SlowsDownASplineThatIsTooFast) {
  start(true);
  publisher.publish(message({0.01, 0.02, 0.03}, 0.02));
  expectAtTheTarget();
}

TEST_F(PositionPointsNode, RefusesASplineThatIsTooFastWithTheRemedy) {
  start(false);
  publisher.publish(message({0.01, 0.02, 0.03}, 0.02));
  EXPECT_TRUE(waitUntil([this] { return says("with allow_slower it takes"); }));
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(PositionPointsNode, FollowsTheMessagesOfRqtJointTrajectoryController) {
  start(true);
  stream(15.0, 0.3);
  expectAtTheTarget();
  EXPECT_FALSE(says("command: ")) << node.process().output();
}

TEST_F(PositionPointsNode, FollowsTheMessagesOfMoveItServo) {
  start(true);
  stream(60.0, 1.0 / 60.0, {0.02, 0.02 / 3.0});
  expectAtTheTarget();
  EXPECT_FALSE(says("command: ")) << node.process().output();
}

TEST_F(PositionPointsNode, FollowsTheMessagesOfMoveItServoWithoutVelocities) {
  start(true);
  stream(60.0, 1.0 / 60.0);
  expectAtTheTarget();
  EXPECT_FALSE(says("command: ")) << node.process().output();
}

}  // namespace
}  // namespace stepdriver::node_test
