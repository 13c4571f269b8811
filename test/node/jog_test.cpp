#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/publisher.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Jog.h>
#include <stepdriver/SpeedOverride.h>

#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <thread>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

class JogTest : public testing::Test {
 protected:
  void start() {
    node.start();
    publisher = ros::NodeHandle().advertise<Jog>(node.full("jog"), 1);
    ASSERT_TRUE(waitUntil([this] { return publisher.getNumSubscribers() == 1; }));
  }

  void jog(const std::vector<std::string>& names, const std::vector<double>& velocities) {
    Jog message;
    message.name = names;
    message.velocity = velocities;
    publisher.publish(message);
  }

  /// Publishes the message again and again until a condition is true.
  bool jogUntil(double velocity, const std::function<bool()>& happened) {
    return waitUntil([&] {
      jog({"x"}, {velocity});
      return happened();
    });
  }

  /// Stops the axis in a stream of messages. It makes no pulse although the stream continues until
  /// the node has said these words, and it is refused again after that.
  void expectRestInAStreamThatGoesOn(const std::string& words) {
    node.set("simulation/speed", 1.0);
    start();
    const Recorder<AxisStates> states(node.full("axis_states"));
    ASSERT_TRUE(jogUntil(0.005, [&] { return node.pulses() > 80; }));
    EXPECT_TRUE(node.call<std_srvs::Trigger>("x/stop").success);
    ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }));
    const std::int64_t pulses = node.pulses();
    ASSERT_TRUE(
        jogUntil(0.005, [&] { return node.process().output().find(words) != std::string::npos; }));
    const std::size_t said = node.process().output().size();
    EXPECT_TRUE(jogUntil(0.005, [&] {
      return node.process().output().find("the jog was stopped", said) != std::string::npos;
    })) << "it is no longer refused";
    EXPECT_EQ(node.pulses(), pulses) << "the stream has not paused";
  }

  NodeUnderTest node;
  ros::Publisher publisher;
};

TEST_F(JogTest, MovesWhileMessagesComeAndRestsWhenNoneDoes) {
  node.set("simulation/speed", 1.0);
  node.set("jog_timeout", 0.3);
  start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  ASSERT_TRUE(jogUntil(0.02, [&] { return node.pulses() > 800; }));
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.moving.at(0) == 0; }))
      << "no message comes any more";
  const std::int64_t pulses = node.pulses();
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_backward.at(0), 0);
  EXPECT_EQ(report.violations.at(0), 0U) << report.violation_kinds.at(0);
  std::this_thread::sleep_for(std::chrono::milliseconds(500));
  EXPECT_EQ(node.pulses(), pulses) << "nothing moves until the next message";
  expectSays(node.process().output(), "no jog for 0.3 s");
}

TEST_F(JogTest, RestsAtTheSoftLimit) {
  start();
  ASSERT_TRUE(jogUntil(0.1, [&] { return node.pulses() == 16000; }));
  EXPECT_EQ(node.rig().pulses_backward.at(0), 0);
  ASSERT_TRUE(waitUntil([&] {
    jog({"x"}, {0.1});
    return node.process().output().find("it stands at the soft limit 0.2 m") != std::string::npos;
  }));
}

TEST_F(JogTest, TakesOverFromAMove) {
  start();
  node.set("simulation/speed", 1.0);
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  ASSERT_TRUE(
      jogUntil(-0.05, [&] { return node.pulses() > 0 && node.rig().pulses_backward.at(0) > 0; }));
}

TEST_F(JogTest, OfAStreamThatGoesOnIsRefusedAfterAStopUntilItPauses) {
  node.set("jog_timeout", 2.0);
  ASSERT_NO_FATAL_FAILURE(expectRestInAStreamThatGoesOn("the jog was stopped"));
  const std::int64_t pulses = node.pulses();
  ASSERT_TRUE(waitUntil([&] {
    jog({"x"}, {0.0});
    jog({"x"}, {0.005});
    return node.pulses() > pulses;
  })) << "it has sent 0";
}

TEST_F(JogTest, OfAStreamIsRefusedAfterAStopForAsLongAsItGoesOn) {
  node.set("jog_timeout", 0.5);
  // The last accepted message is old by then.
  ASSERT_NO_FATAL_FAILURE(expectRestInAStreamThatGoesOn("no jog for 0.5 s"));
}

TEST_F(JogTest, MovesNothingByAMessageThatItCannotUnderstand) {
  start();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::pair<Jog, std::string>> bad = [&] {
    std::vector<std::pair<Jog, std::string>> messages(5);
    messages[0].first.name = {"x"};
    messages[0].second = "each name must have one velocity";
    messages[1].first.name = {"y"};
    messages[1].first.velocity = {0.01};
    messages[1].second = "there is no axis y (axes: x)";
    messages[2].first.name = {"x", "x"};
    messages[2].first.velocity = {0.01, 0.02};
    messages[2].second = "named twice";
    messages[3].first.name = {"x"};
    messages[3].first.velocity = {nan};
    messages[3].second = "finite";
    messages[4].first.name = {"x"};
    messages[4].first.velocity = {0.2};
    messages[4].second = "above the maximum 0.1 m/s";
    return messages;
  }();
  for (const auto& [message, words] : bad) {
    const std::string& said = words;
    const Jog& sent = message;
    EXPECT_TRUE(waitUntil([&] {
      publisher.publish(sent);
      return node.process().output().find(said) != std::string::npos;
    })) << words;
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST_F(JogTest, SpeedOverrideHoldsForTheMotionUnderWay) {
  node.set("simulation/speed", 1.0);
  start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto set_override = [this](double factor) {
    SpeedOverride::Request request;
    request.factor = factor;
    return node.call<SpeedOverride>("speed_override", request);
  };
  for (const double factor : {0.0, 0.009, 2.01, -1.0, std::nan("")}) {
    const auto answer = set_override(factor);
    EXPECT_FALSE(answer.success);
    expectSays(answer.message, "must be from 0.01 to 2");
  }
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  ASSERT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.velocity.at(0) > 0.09; }));
  EXPECT_TRUE(set_override(0.25).success);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return std::abs(s.velocity.at(0) - 0.025) < 1e-9; }));
  EXPECT_TRUE(set_override(2.0).success);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return std::abs(s.velocity.at(0) - 0.1) < 1e-9; }));
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 16000; }));
}

}  // namespace
}  // namespace stepdriver::node_test
