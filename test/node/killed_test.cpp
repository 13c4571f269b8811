#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Home.h>
#include <stepdriver/Jog.h>
#include <stepdriver/MoveLine.h>
#include <stepdriver/SetPosition.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <csignal>
#include <cstdint>
#include <string>
#include <vector>

#include "support/contents_of.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_folder.h"
#include "support/two_axes.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// A node with a state file and two axes, of which x stands at 8 mm and y at 0.
class KilledNode : public testing::Test {
 protected:
  void SetUp() override {
    addSecondAxis(node);
    node.set("state_file", file());
    node.set("simulation/speed", 1.0);
    node.set("jog_timeout", 60.0);
    for (const char* axis : {"x", "y"}) {
      node.set(std::string("axes/") + axis + "/holds_position_unpowered", true);
    }
    node.set("axes/x/homing/switch", "min");
    node.set("axes/x/require_homing", false);
    node.set("axes/x/homing/seek_speed_mm_s", 0.01);  // takes minutes
    node.set("axes/x/homing/latch_speed_mm_s", 0.01);
    node.set("axes/x/homing/pull_off_mm", 1.0);
    node.set("axes/x/homing/max_travel_mm", 250.0);
    node.start();
    for (const char* axis : {"x", "y"}) {
      EXPECT_TRUE(node.call<SetPosition>(std::string(axis) + "/set_position").success);
    }
    EXPECT_TRUE(node.moveTo(0.008, true).success);
  }

  std::string file() const { return folder_.path() + "/state"; }
  std::string kept() const { return test::contentsOf(file()); }

  /// Kills the node when these axes move, and expects that the next one says so, and from which
  /// positions.
  void killAndExpect(bool x_moves, bool y_moves) {
    const std::int64_t before = node.pulses();
    const auto says_moving = [this](const char* axis) {
      const std::string text = kept();
      const std::size_t begin = text.find(std::string("\n") + axis + " ");
      if (begin == std::string::npos) return false;
      return text[text.find('\n', begin + 1) - 1] == '1';
    };
    ASSERT_TRUE(waitUntil([&] {
      return node.pulses() > before && says_moving("x") == x_moves && says_moving("y") == y_moves;
    })) << kept();
    node.process().signal(SIGKILL);
    ASSERT_TRUE(node.process().waitForExit(kBound));
    node.start();
    const Recorder<AxisStates> states(node.full("axis_states"));
    ASSERT_TRUE(states.waitFor([](const AxisStates&) { return true; }));
    const AxisStates first = states.messages().front();
    EXPECT_EQ(first.name, (std::vector<std::string>{"x", "y"}));
    expectAfter(first, 0, 0.008, x_moves ? "was moving, from 0.008 m" : "wasn't shut down");
    expectAfter(first, 1, 0.0, y_moves ? "was moving, from 0 m" : "wasn't shut down");
    EXPECT_EQ(node.pulses(), 0) << "nobody has asked it to move";
  }
  static void expectAfter(const AxisStates& states, std::size_t axis, double position,
                          const std::string& note) {
    EXPECT_FALSE(states.position_valid.at(axis));
    EXPECT_FALSE(states.homed.at(axis));
    EXPECT_FALSE(states.moving.at(axis));
    EXPECT_DOUBLE_EQ(states.position.at(axis), position);
    expectSays(states.position_note.at(axis), note);
  }

  const test::TemporaryFolder folder_;
  NodeUnderTest node;
};

TEST_F(KilledNode, DuringAHomingSaysFromWhereTheAxisMoved) {
  Home::Request request;
  request.wait = 0;
  const auto answer = node.call<Home>("x/home", request);
  ASSERT_TRUE(answer.success) << answer.message;
  killAndExpect(true, false);
}

TEST_F(KilledNode, DuringALineSaysFromWhereEachAxisMoved) {
  MoveLine::Request request;
  request.name = {"x", "y"};
  request.position = {0.15, 0.1};
  request.velocity = 0.001;  // takes minutes
  const auto answer = node.call<MoveLine>("move_line", request);
  ASSERT_TRUE(answer.success) << answer.message;
  killAndExpect(true, true);
}

TEST_F(KilledNode, DuringATrajectorySaysFromWhereEachAxisMoved) {
  ros::Publisher commands =
      ros::NodeHandle().advertise<trajectory_msgs::JointTrajectory>(node.full("command"), 1);
  ASSERT_TRUE(waitUntil([&commands] { return commands.getNumSubscribers() == 1; }));
  trajectory_msgs::JointTrajectory wanted;
  wanted.joint_names = {"x_joint", "y_joint"};
  wanted.points.resize(1);
  wanted.points[0].positions = {0.15, 0.1};
  wanted.points[0].velocities = {0.0, 0.0};
  wanted.points[0].time_from_start = ros::Duration(300.0);
  commands.publish(wanted);
  killAndExpect(true, true);
}

TEST_F(KilledNode, DuringAJogSaysFromWhereTheAxisMoved) {
  {
    ros::Publisher jogs = ros::NodeHandle().advertise<Jog>(node.full("jog"), 1);
    ASSERT_TRUE(waitUntil([&jogs] { return jogs.getNumSubscribers() == 1; }));
    Jog jog;
    jog.name = {"y"};
    jog.velocity = {0.001};
    const std::int64_t before = node.pulses();
    ASSERT_TRUE(waitUntil([&] {
      jogs.publish(jog);
      return node.pulses() > before;
    }));
  }  // The next node hears nothing of it.
  killAndExpect(false, true);
}

}  // namespace
}  // namespace stepdriver::node_test
