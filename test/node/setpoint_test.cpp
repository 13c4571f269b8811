#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <std_msgs/Float64.h>
#include <std_msgs/Float64MultiArray.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Jog.h>

#include <chrono>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/two_axes.h"
#include "support/wait.h"

// Two axes of 80 microsteps/mm each, on a rig whose time is real.

namespace stepdriver::node_test {
namespace {

class SetpointTest : public testing::Test {
 protected:
  SetpointTest() {
    addSecondAxis(node);
    node.set("simulation/speed", 1.0);
  }

  void start() {
    node.start();
    ros::NodeHandle handle;
    of_x = handle.advertise<std_msgs::Float64>(node.full("x/setpoint"), 1);
    of_all = handle.advertise<std_msgs::Float64MultiArray>(node.full("setpoint"), 1);
    ASSERT_TRUE(waitUntil(
        [this] { return of_x.getNumSubscribers() == 1 && of_all.getNumSubscribers() == 1; }));
  }
  void send(double value) {
    std_msgs::Float64 message;
    message.data = value;
    of_x.publish(message);
  }
  void sendAll(const std::vector<double>& values) {
    std_msgs::Float64MultiArray message;
    message.data = values;
    of_all.publish(message);
  }
  /// Sends a message again and again, at 50 Hz, until a condition is true.
  static bool sendUntil(const std::function<void()>& message,
                        const std::function<bool()>& happened) {
    return waitUntil([&] {
      message();
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
      return happened();
    });
  }
  /// The position of x, by its pulses.
  std::int64_t steps() {
    const auto report = node.rig();
    return report.pulses_forward.at(0) - report.pulses_backward.at(0);
  }
  bool says(const std::string& words) {
    return node.process().output().find(words) != std::string::npos;
  }
  void expectNoViolations() {
    const auto report = node.rig();
    for (std::size_t i = 0; i < report.violations.size(); ++i) {
      EXPECT_EQ(report.violations[i], 0U) << report.violation_kinds.at(i);
    }
  }

  NodeUnderTest node;
  ros::Publisher of_x;
  ros::Publisher of_all;
};

TEST_F(SetpointTest, FollowsAStreamOfPositionsAndRestsOnTheLastOne) {
  start();
  ros::WallRate rate(100.0);
  double position = 0.0;
  for (int i = 0; i < 100; ++i) {
    position += 0.0002;
    send(position);
    rate.sleep();
  }
  EXPECT_TRUE(waitUntil([this] { return steps() == 1600; })) << steps();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
  EXPECT_EQ(steps(), 1600);
  EXPECT_FALSE(says("setpoint: ")) << node.process().output();
  expectNoViolations();
}

TEST_F(SetpointTest, OfAllAxesComesInTheirOrder) {
  start();
  EXPECT_TRUE(sendUntil([this] { sendAll({0.004, -0.002}); }, [this] { return steps() == 320; }));
  EXPECT_TRUE(waitUntil([this] {
    const auto report = node.rig();
    return report.pulses_backward.at(1) - report.pulses_forward.at(1) == 160;
  }));
  for (const std::vector<double>& wrong : {std::vector<double>{0.01}, {0.01, 0.01, 0.01}, {}}) {
    const std::string words = "the message has " + std::to_string(wrong.size()) + " numbers";
    EXPECT_TRUE(sendUntil([&] { sendAll(wrong); }, [&] { return says(words); })) << words;
  }
  EXPECT_EQ(steps(), 320);
  expectNoViolations();
}

TEST_F(SetpointTest, ThatIsNoNumberIsIgnoredAndSaidOnce) {
  start();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(sendUntil(
      [&] {
        sendAll({nan, 0.001});
      },
      [this] { return node.rig().pulses_forward.at(1) == 80; }));
  EXPECT_TRUE(sendUntil(
      [&] {
        sendAll({nan, 0.002});
      },
      [this] { return node.rig().pulses_forward.at(1) >= 160; }));
  const std::string words = "x: setpoints that aren't finite numbers are ignored";
  EXPECT_TRUE(waitUntil([&] { return says(words); }));
  const std::string output = node.process().output();
  EXPECT_EQ(output.find(words), output.rfind(words)) << output;
  EXPECT_TRUE(sendUntil([this] { send(0.001); }, [this] { return steps() == 80; }));
}

TEST_F(SetpointTest, OfAPositionBeyondTheSoftLimitEndsAtTheLimit) {
  start();
  EXPECT_TRUE(sendUntil([this] { send(5.0); }, [this] { return steps() == 16000; }));
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_EQ(steps(), 16000);
  EXPECT_EQ(node.rig().pulses_backward.at(0), 0);
}

TEST_F(SetpointTest, OfAVelocityRunsWhileMessagesComeAndRestsWhenNoneDoes) {
  node.set("setpoint/mode", "velocity");
  node.set("setpoint/timeout", 0.1);
  start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(sendUntil([this] { send(0.02); }, [this] { return steps() > 800; }));
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
  const std::int64_t pulses = steps();
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  EXPECT_EQ(steps(), pulses);
  EXPECT_TRUE(
      sendUntil([this] { send(0.3); }, [this] { return says("above the maximum 0.1 m/s"); }));
  EXPECT_EQ(steps(), pulses);
  expectNoViolations();
}

TEST_F(SetpointTest, OfAStreamThatGoesOnIsRefusedAfterAStopUntilItPauses) {
  node.set("setpoint/timeout", 2.0);
  start();
  double position = 0.0;
  const auto next = [&] { send(position += 0.0001); };
  ASSERT_TRUE(sendUntil(next, [this] { return steps() > 80; }));
  EXPECT_TRUE(node.call<std_srvs::Trigger>("x/stop").success);
  const Recorder<AxisStates> states(node.full("axis_states"));
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
  const std::int64_t pulses = steps();
  ASSERT_TRUE(sendUntil(next, [this] { return says("the setpoints were stopped"); }));
  // By the other topic too.
  for (int i = 0; i < 20; ++i) sendAll({position, 0.0});
  EXPECT_EQ(steps(), pulses) << "the stream has not paused";
  std::this_thread::sleep_for(std::chrono::milliseconds(2300));
  send(0.0);
  EXPECT_TRUE(waitUntil([this] { return steps() == 0; })) << "it has paused";
}

TEST_F(SetpointTest, TakesOverFromAMoveAndTheOtherWayRound) {
  start();
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  EXPECT_TRUE(sendUntil([this] { send(0.001); }, [this] { return steps() == 80; }));
  EXPECT_TRUE(node.moveTo(0.003, false).success);
  EXPECT_TRUE(waitUntil([this] { return steps() == 240; }));
  expectNoViolations();
}

TEST_F(SetpointTest, OneMessageOfAJogStartsBothAxes) {
  start();
  auto publisher = ros::NodeHandle().advertise<Jog>(node.full("jog"), 1);
  ASSERT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() == 1; }));
  Jog jog;
  jog.name = {"y", "x"};
  jog.velocity = {0.02, 0.02};
  EXPECT_TRUE(sendUntil([&] { publisher.publish(jog); }, [this] { return steps() > 400; }));
  const auto report = node.rig();
  EXPECT_NEAR(static_cast<double>(report.pulses_forward.at(1)),
              static_cast<double>(report.pulses_forward.at(0)), 1.0);
  jog.velocity = {0.02, 0.5};
  EXPECT_TRUE(sendUntil([&] { publisher.publish(jog); },
                        [this] { return says("x: the velocity 0.5 m/s is above the maximum"); }));
  const auto before = node.rig().pulses_forward.at(1);
  EXPECT_TRUE(sendUntil([&] { publisher.publish(jog); },
                        [&] { return node.rig().pulses_forward.at(1) > before + 100; }))
      << "y moves although x refuses";
}

}  // namespace
}  // namespace stepdriver::node_test
