#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <ros/time.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Jog.h>
#include <trajectory_msgs/JointTrajectory.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <future>
#include <string>

#include "support/control_msgs_client.h"
#include "support/fault_injection.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

// Somebody sets the clock of the computer, or ntpd does: to the node's eyes only.

namespace stepdriver::node_test {
namespace {

struct Jump {
  const char* name;
  std::int64_t seconds;
};
void PrintTo(const Jump& jump, std::ostream* out) { *out << jump.name; }  // NOLINT: its name

/// A node whose wall clock is set forward or back.
class WallClock : public testing::TestWithParam<Jump> {
 protected:
  WallClock() {
    node.set("simulation/speed", 1.0);
    node.set("jog_timeout", 0.3);
  }
  void SetUp() override {
#ifndef _GLIBCXX_USE_PTHREAD_COND_CLOCKWAIT  // before gcc 10 and glibc 2.30
    GTEST_SKIP() << "waits with a timeout follow the wall clock in this C++ library";
#endif
  }

  void jump() const { faults->wall_clock_ns = GetParam().seconds * 1'000'000'000; }
  static double offset() { return static_cast<double>(GetParam().seconds); }
  std::int64_t pulsesOf(double position) const { return std::llround(position * 80000.0); }

  const FaultInjection faults;
  NodeUnderTest node;
};

TEST_P(WallClock, ThatIsSetDuringAMoveChangesNothingOfIt) {
  const std::string trace = node.traced();
  node.start();
  const Recorder<sensor_msgs::JointState> states(node.beside("joint_states"));
  auto waiting = std::async(std::launch::async, [this] { return node.moveTo(0.15, true); });
  ASSERT_TRUE(waitUntil([this] { return node.pulses() > 3000; }));
  jump();
  // The stamps are those of the new time, and the states keep coming.
  EXPECT_TRUE(states.waitForLatest([](const sensor_msgs::JointState& state) {
    return std::abs((state.header.stamp - ros::Time::now()).toSec() - offset()) < 60.0;
  }));
  const auto answer = waiting.get();
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.pulses(), pulsesOf(0.15));
  EXPECT_NEAR(answer.duration, 0.15 / 0.1 + 0.1 / 0.5, 0.01);
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST_P(WallClock, ThatIsSetKeepsNoClientWaiting) {
  node.start();
  jump();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const Recorder<diagnostic_msgs::DiagnosticArray> diagnostics("/diagnostics");
  EXPECT_TRUE(states.waitFor([](const AxisStates&) { return true; }));
  EXPECT_TRUE(diagnostics.waitFor([](const diagnostic_msgs::DiagnosticArray&) { return true; }));
  EXPECT_TRUE(node.moveTo(0.002, true).success);
  for (const char* name : {"hold", "resume", "stop", "x/stop", "emergency_stop", "recover"}) {
    EXPECT_TRUE(node.call<std_srvs::Trigger>(name).success) << name;
  }
  EXPECT_EQ(node.pulses(), pulsesOf(0.002));
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
}

TEST_P(WallClock, ThatIsSetDuringAJogLetsItEndAfterTheLastMessage) {
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  ros::Publisher jogs = ros::NodeHandle().advertise<Jog>(node.full("jog"), 1);
  ASSERT_TRUE(waitUntil([&jogs] { return jogs.getNumSubscribers() == 1; }));
  Jog jog;
  jog.name = {"x"};
  jog.velocity = {0.01};
  ASSERT_TRUE(waitUntil([&] {
    jogs.publish(jog);
    return node.pulses() > 100;
  }));
  jump();
  // The publisher falls silent.
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
  const std::int64_t pulses = node.pulses();
  EXPECT_LT(pulses, 16000) << "soft limit";
  const AxisStates last = states.messages().back();
  EXPECT_EQ(last.fault.at(0), "");
  EXPECT_EQ(pulses, pulsesOf(last.position.at(0)));
}

// When it is accepted, its start becomes a time of the machine.
TEST_P(WallClock, ThatIsSetDoesNotChangeTheStartOfATrajectoryThatWaits) {
  node.start();
  TrajectoryClient client(node.full("follow_joint_trajectory"), false);
  ASSERT_TRUE(client.waitForServer(ros::Duration(kBound.count())));
  action_msgs::FollowJointTrajectoryGoal goal;
  trajectory_msgs::JointTrajectory& wanted = goal.trajectory;
  wanted.header.stamp = ros::Time::now() + ros::Duration(3.0);
  wanted.joint_names = {"x_joint"};
  wanted.points.resize(1);
  wanted.points[0].positions = {0.01};
  wanted.points[0].velocities = {0.0};
  wanted.points[0].time_from_start = ros::Duration(0.5);
  client.sendGoal(goal);
  ASSERT_TRUE(
      waitUntil([&] { return client.getState() == actionlib::SimpleClientGoalState::ACTIVE; }));
  EXPECT_EQ(node.pulses(), 0);
  jump();
  EXPECT_TRUE(waitUntil([this] { return node.pulses() == pulsesOf(0.01); }));
  EXPECT_TRUE(client.waitForResult(ros::Duration(kBound.count())));
  EXPECT_EQ(client.getState(), actionlib::SimpleClientGoalState::SUCCEEDED);
}

INSTANTIATE_TEST_SUITE_P(By, WallClock,
                         testing::Values(Jump{"OneHourForward", 3600}, Jump{"OneHourBack", -3600}),
                         [](const auto& value) { return std::string(value.param.name); });

}  // namespace
}  // namespace stepdriver::node_test
