#include <gtest/gtest.h>
#include <rosgraph_msgs/Clock.h>
#include <sensor_msgs/JointState.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisState.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Endstops.h>
#include <stepdriver/Microstep.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <future>
#include <string>
#include <vector>

#include "support/control_msgs_client.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using action_msgs::JointTrajectoryControllerState;
using sensor_msgs::JointState;

TEST(JointStates, KeepTheirRateWhileClientsWait) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<JointState> joint_states(node.beside("joint_states"));
  ASSERT_TRUE(waitUntil([&] { return joint_states.count() > 0; }));
  const std::size_t before = joint_states.count();
  const auto begin = std::chrono::steady_clock::now();
  EXPECT_TRUE(node.moveTo(0.2, true).success);
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const auto count = static_cast<double>(joint_states.count() - before);
  EXPECT_GT(took.count(), 2.0) << "0.2 m at 0.1 m/s";
  EXPECT_GT(count, 0.6 * 50.0 * took.count());
  EXPECT_LT(count, 1.2 * 50.0 * took.count());
}

TEST(JointStates, ComeAtTheConfiguredRate) {
  NodeUnderTest node;
  node.set("joint_state_rate", 200);
  node.start();
  const Recorder<JointState> joint_states(node.beside("joint_states"));
  ASSERT_TRUE(waitUntil([&] { return joint_states.count() >= 200; }));
  const auto messages = joint_states.messages();
  std::vector<double> gaps;
  for (std::size_t i = 1; i < messages.size(); ++i) {
    gaps.push_back((messages[i].header.stamp - messages[i - 1].header.stamp).toSec());
  }
  std::nth_element(gaps.begin(), gaps.begin() + gaps.size() / 2, gaps.end());
  EXPECT_NEAR(gaps[gaps.size() / 2], 0.005, 0.0015);
}

TEST(JointStates, ShowJointPositionAndActualVelocity) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<JointState> joint_states(node.beside("joint_states"));
  EXPECT_TRUE(node.moveTo(0.1, true).success);
  EXPECT_TRUE(joint_states.waitForLatest([](const JointState& state) {
    return std::abs(state.position.at(0) - 0.1) < 1e-9 && state.velocity.at(0) == 0.0;
  }));
  double fastest = 0.0;
  double last = 0.0;
  for (const JointState& state : joint_states.messages()) {
    ASSERT_EQ(state.name, std::vector<std::string>{"x_joint"});
    EXPECT_GE(state.position.at(0), last) << "it went back";
    last = state.position.at(0);
    fastest = std::max(fastest, state.velocity.at(0));
  }
  EXPECT_NEAR(fastest, 0.1, 0.002);
}

TEST(LatchedTopics, ReachALateSubscriber) {
  NodeUnderTest node;
  node.start();
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  const Recorder<Endstops> endstops(node.full("endstops"));
  const Recorder<AxisStates> states(node.full("axis_states"));
  ASSERT_TRUE(endstops.waitFor([](const Endstops&) { return true; }));
  const Endstops first = endstops.messages().front();
  EXPECT_EQ(first.name, std::vector<std::string>{"x"});
  EXPECT_EQ(first.min.at(0), 0);
  EXPECT_EQ(first.max.at(0), 0);
  EXPECT_FALSE(first.header.stamp.isZero());
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& state) {
    return state.name.at(0) == "x" && state.enabled.at(0) != 0 && state.moving.at(0) == 0 &&
           state.homed.at(0) == 0 && state.microsteps.at(0) == 16 &&
           std::abs(state.position.at(0) - 0.01) < 1e-9 && state.fault.at(0).empty();
  }));
}

TEST(LatchedTopics, ReadFalseWhereThereIsNoSwitch) {
  NodeUnderTest node;
  node.erase("axes/x/endstops");
  node.start();
  const Recorder<Endstops> endstops(node.full("endstops"));
  ASSERT_TRUE(endstops.waitFor([](const Endstops& e) { return e.name.size() == 1; }));
  EXPECT_EQ(endstops.messages().front().min.at(0), 0);
  EXPECT_EQ(endstops.messages().front().max.at(0), 0);
}

TEST(AxisStateTopic, ShowsOneAxisByItself) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<AxisState> states(node.full("x/state"));
  ASSERT_TRUE(states.waitFor([](const AxisState& s) { return s.enabled && !s.moving; }));
  const auto answer = node.moveTo(0.05, false);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_TRUE(states.waitFor([](const AxisState& s) {
    return s.moving && s.position > 0.001 && s.velocity > 0.0 && s.target == 0.05 &&
           s.time_left > 0.0 && std::abs(s.planned - s.position) < 0.001;
  }));
  EXPECT_TRUE(states.waitForLatest([](const AxisState& s) {
    return !s.moving && s.velocity == 0.0 && s.position == 0.05 && s.position == s.target;
  }));
}

TEST(AxisStatesTopic, ShowsAMoveUnderWay) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(node.moveTo(0.1, true).success);
  EXPECT_TRUE(states.waitFor([](const AxisStates& s) {
    return s.moving.at(0) != 0 && std::abs(s.target.at(0) - 0.1) < 1e-9 && s.velocity.at(0) > 0.0;
  }));
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.moving.at(0) == 0 && std::abs(s.position.at(0) - 0.1) < 1e-9 &&
           std::abs(s.target.at(0) - 0.1) < 1e-9;
  }));
}

TEST(AxisStatesTopic, SaysTheStateInWords) {
  NodeUnderTest node;
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto says = [&](const std::string& motor, const std::string& state, bool remedy) {
    return states.waitForLatest([&](const AxisStates& s) {
      return s.motor.at(0) == motor && s.state.at(0) == state && s.remedy.at(0).empty() != remedy;
    });
  };
  EXPECT_TRUE(says("on", "rest unverified", false));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("hold").success);
  EXPECT_TRUE(says("on", "HELD unverified", false));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("emergency_stop").success);
  EXPECT_TRUE(says("on", "FAULT", true));
}

TEST(WaitingClients, HoldUpNoOtherCall) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  auto waiting = std::async(std::launch::async, [&node] { return node.moveTo(0.2, true); });
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 100; }));
  // Each of these calls is answered long before the move ends, at 2.2 s.
  for (int i = 0; i < 10; ++i) {
    EXPECT_FALSE(node.moveTo(0.3, true).success);
    Microstep::Request request;
    request.microsteps = 8;
    EXPECT_FALSE(node.call<Microstep>("x/microstep", request).success);
    EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  }
  EXPECT_NE(waiting.wait_for(std::chrono::seconds(0)), std::future_status::ready)
      << "the calls took as long as the move";
  EXPECT_TRUE(waiting.get().success);
}

TEST(ControllerState, IsThePlanAndWhatThePulsesDid) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<JointTrajectoryControllerState> states(node.full("state"));
  ASSERT_TRUE(waitUntil([&] { return states.count() > 0; }));
  EXPECT_TRUE(node.moveTo(0.05, true).success);
  EXPECT_TRUE(states.waitForLatest([](const JointTrajectoryControllerState& state) {
    return state.actual.positions.at(0) == 0.05;
  }));
  double fastest = 0.0;
  for (const JointTrajectoryControllerState& state : states.messages()) {
    ASSERT_EQ(state.joint_names, std::vector<std::string>{"x_joint"});
    const double off = state.desired.positions.at(0) - state.actual.positions.at(0);
    EXPECT_DOUBLE_EQ(state.error.positions.at(0), off);
    EXPECT_LT(std::abs(off), 3.0 / 80'000.0) << "within the pulses of a few milliseconds";
    EXPECT_EQ(state.actual.velocities.at(0), state.desired.velocities.at(0));
    EXPECT_EQ(state.error.velocities.at(0), 0.0);
    fastest = std::max(fastest, state.desired.velocities.at(0));
  }
  EXPECT_NEAR(fastest, 0.1, 1e-9);
}

TEST(RigClock, IsPublishedIfItIsAskedFor) {
  NodeUnderTest node;
  node.set("simulation/speed", 10.0);
  node.set("publish_clock", true);
  node.start();
  const Recorder<rosgraph_msgs::Clock> clock("/clock");
  const auto now = [&] { return clock.messages().back().clock; };
  ASSERT_TRUE(waitUntil([&] { return clock.count() > 1; }));
  const ros::Time before = now();
  const auto moved = node.moveTo(0.2, true);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_TRUE(waitUntil([&] { return (now() - before).toSec() >= moved.duration; }))
      << "the move took " << moved.duration << " s of the rig";
  const auto messages = clock.messages();
  for (std::size_t i = 1; i < messages.size(); ++i) {
    EXPECT_GE(messages[i].clock, messages[i - 1].clock) << "it went back";
  }
}

TEST(RigClock, IsMissedIfNothingPublishesIt) {
  ros::param::set("/use_sim_time", true);
  NodeUnderTest node;
  node.start();
  ros::param::del("/use_sim_time");
  EXPECT_TRUE(waitUntil([&] {
    return node.process().output().find("use_sim_time is true, but nothing publishes /clock") !=
           std::string::npos;
  })) << node.process().output();
}

// Nodes with use_sim_time take their time from it, this one too.
TEST(RigClock, StampsTheStatesWithSimulatedTime) {
  ros::param::set("/use_sim_time", true);
  NodeUnderTest node;
  node.set("simulation/speed", 100.0);
  node.set("publish_clock", true);
  node.start();
  ros::param::del("/use_sim_time");
  const Recorder<JointState> states(node.beside("joint_states"));
  const Recorder<rosgraph_msgs::Clock> clock("/clock");
  ASSERT_TRUE(waitUntil([&] { return clock.count() > 0 && states.count() > 0; }));
  EXPECT_TRUE(node.moveTo(0.2, true).success);
  const ros::Time first = clock.messages().front().clock;
  EXPECT_TRUE(states.waitForLatest([&](const JointState& state) {
    return state.header.stamp >= first + ros::Duration(2.0) &&
           state.header.stamp <= clock.messages().back().clock;
  })) << "0.2 m take more than 2 s of the rig";
}

}  // namespace
}  // namespace stepdriver::node_test
