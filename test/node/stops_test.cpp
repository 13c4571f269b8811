#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Endstops.h>

#include <chrono>
#include <cmath>
#include <csignal>
#include <future>
#include <string>
#include <thread>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

constexpr double kMetresPerStep = 1.0 / 80000.0;

std_srvs::Trigger::Response trigger(NodeUnderTest& node, const std::string& service) {
  return node.call<std_srvs::Trigger>(service);
}

/// A client that waits for a long move, which is under way when this returns.
std::future<MoveTo::Response> longMove(NodeUnderTest& node) {
  auto answer = std::async(std::launch::async, [&node] { return node.moveTo(0.2, true); });
  EXPECT_TRUE(waitUntil([&] { return node.pulses() > 500; })) << "it doesn't move";
  return answer;
}

class Stops : public testing::TestWithParam<std::string> {};

TEST_P(Stops, DecelerateAndTellTheWaitingClient) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  auto waiting = longMove(node);
  EXPECT_TRUE(trigger(node, GetParam()).success);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "stop");
  EXPECT_GT(answer.position, 0.0);
  EXPECT_LT(answer.position, 0.2);
  EXPECT_EQ(node.pulses(), std::llround(answer.position / kMetresPerStep));
  EXPECT_TRUE(node.moveTo(0.2, true).success) << "a stop is no fault";
}

TEST_P(Stops, DoNothingAtRest) {
  NodeUnderTest node;
  node.start();
  EXPECT_TRUE(trigger(node, GetParam()).success);
  EXPECT_EQ(node.pulses(), 0);
  EXPECT_TRUE(node.moveTo(0.001, true).success);
}

INSTANTIATE_TEST_SUITE_P(Service, Stops, testing::Values("x/stop", "stop"),
                         [](const auto& value) { return value.index == 0 ? "axis" : "machine"; });

TEST(EmergencyStop, SendsNoOtherPulseAndHoldsUntilRecover) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  auto waiting = longMove(node);
  EXPECT_TRUE(trigger(node, "emergency_stop").success);
  const std::int64_t pulses = node.pulses();
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "emergency stop");
  EXPECT_EQ(std::llround(answer.position / kMetresPerStep), pulses);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.fault.at(0).find("emergency stop") != std::string::npos && s.enabled.at(0);
  }));

  const auto refused = node.moveTo(0.0, true);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "recover");
  EXPECT_EQ(node.pulses(), pulses);

  EXPECT_TRUE(trigger(node, "recover").success);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.fault.at(0).empty(); }));
  EXPECT_EQ(node.pulses(), pulses) << "recover moves nothing";
  const auto back = node.moveTo(0.0, true);
  EXPECT_TRUE(back.success) << back.message;
  EXPECT_EQ(node.pulses(), 2 * pulses);
}

// YAML 1.1, which rosparam reads, takes off for false.
TEST(EmergencyStop, SwitchesTheMotorsOffIfItIsConfiguredSo) {
  for (const bool as_text : {true, false}) {
    NodeUnderTest node;
    if (as_text) {
      node.set("emergency_stop/disable", "off");
    } else {
      node.set("emergency_stop/disable", false);
    }
    node.start();
    const Recorder<AxisStates> states(node.full("axis_states"));
    EXPECT_TRUE(trigger(node, "emergency_stop").success);
    EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return !s.enabled.at(0); }));
    EXPECT_TRUE(trigger(node, "recover").success);
    expectSays(node.moveTo(0.01, true).message, "disabled");
    EXPECT_EQ(node.pulses(), 0);
  }
}

TEST(EmergencyStop, AtRestStopsWhatComesLater) {
  NodeUnderTest node;
  node.start();
  EXPECT_TRUE(trigger(node, "emergency_stop").success);
  EXPECT_FALSE(node.moveTo(0.01, true).success);
  EXPECT_EQ(node.pulses(), 0);
  EXPECT_TRUE(trigger(node, "recover").success);
  EXPECT_TRUE(node.moveTo(0.01, true).success);
}

std_srvs::SetBool::Response press(NodeUnderTest& node, bool pressed) {
  std_srvs::SetBool::Request request;
  request.data = pressed;
  return node.call<std_srvs::SetBool>("rig/emergency_stop", request);
}

void wireEmergencyStop(NodeUnderTest& node) {
  node.set("emergency_stop/pin", "stop");
  node.set("emergency_stop/active_level", "low");
}

TEST(EmergencyStopInput, StopsLikeTheServiceUntilItIsReleasedAndRecovered) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  wireEmergencyStop(node);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  auto waiting = longMove(node);
  EXPECT_TRUE(press(node, true).success);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "emergency stop input");
  const std::int64_t pulses = node.pulses();
  EXPECT_EQ(std::llround(answer.position / kMetresPerStep), pulses);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.fault.at(0) == "emergency stop input" && s.enabled.at(0);
  }));
  const auto too_early = trigger(node, "recover");
  EXPECT_FALSE(too_early.success);
  expectSays(too_early.message, "stop is active");
  EXPECT_FALSE(node.moveTo(0.0, true).success);
  EXPECT_TRUE(press(node, false).success);
  expectSays(node.moveTo(0.0, true).message, "recover");
  EXPECT_TRUE(trigger(node, "recover").success);
  EXPECT_EQ(node.pulses(), pulses) << "recover moves nothing";
  EXPECT_TRUE(node.moveTo(0.0, true).success);
}

TEST(EmergencyStopInput, ThatIsActiveAtTheStartLetsTheNodeStartAtFault) {
  NodeUnderTest node;
  wireEmergencyStop(node);
  node.set("simulation/emergency_stop", true);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.fault.at(0) == "emergency stop input" && !s.enabled.at(0);
  }));
  EXPECT_FALSE(trigger(node, "recover").success);
  EXPECT_TRUE(press(node, false).success);
  EXPECT_TRUE(trigger(node, "recover").success);
  expectSays(node.moveTo(0.01, true).message, "disabled");
  EXPECT_EQ(node.pulses(), 0);
}

TEST(EmergencyStopInput, ThatIsntConfiguredHasNoButtonOnTheRig) {
  NodeUnderTest node;
  node.start();
  const auto answer = press(node, true);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "emergency_stop isn't configured");
}

TEST(Endstop, EndsAMoveByNameWithTheExactCountAndLetsItGoAway) {
  NodeUnderTest node;
  node.set("simulation/axes/x/max_switch_mm", 20.0);
  node.start();
  const Recorder<Endstops> endstops(node.full("endstops"));
  const auto answer = node.moveTo(0.1, true);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "max endstop");
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0), 1600) << "20 mm at 80 steps/mm";
  EXPECT_EQ(report.violations.at(0), 0) << report.violation_kinds.at(0);
  EXPECT_NEAR(answer.position, 0.02, kMetresPerStep / 2);
  EXPECT_TRUE(endstops.waitForLatest(
      [](const Endstops& e) { return e.max.at(0) != 0 && e.min.at(0) == 0; }));

  const auto towards = node.moveTo(0.15, true);
  EXPECT_FALSE(towards.success);
  expectSays(towards.message, "max endstop");
  EXPECT_EQ(node.pulses(), 1600);

  const auto away = node.moveTo(0.01, true);
  EXPECT_TRUE(away.success) << away.message;
  EXPECT_EQ(node.pulses(), 2400);
  EXPECT_TRUE(endstops.waitForLatest([](const Endstops& e) { return e.max.at(0) == 0; }));
}

TEST(Endstop, ThatIsActiveAtStartIsKnown) {
  NodeUnderTest node;
  node.set("simulation/axes/x/min_switch_mm", 0.0);
  node.start();
  const Recorder<Endstops> endstops(node.full("endstops"));
  EXPECT_TRUE(endstops.waitForLatest([](const Endstops& e) { return e.min.at(0) != 0; }));
  const auto answer = node.moveTo(0.01, true);
  EXPECT_TRUE(answer.success) << answer.message;
  const auto back = node.moveTo(0.0, true);
  // The switch is pressed at 0: the target is reached and the switch pressed in the same step.
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
  EXPECT_NEAR(back.position, 0.0, kMetresPerStep);
}

TEST(Endstop, ThatIsStuckBlocksOnlyTheMotionTowardsIt) {
  NodeUnderTest node;
  node.set("simulation/axes/x/min_stuck", "active");
  node.start();
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  const auto answer = node.moveTo(0.0, true);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "min endstop");
  EXPECT_EQ(node.pulses(), 800);
}

TEST(Fault, OfALineThatFailsEndsTheMoveAndIsShown) {
  NodeUnderTest node;
  node.set("simulation/axes/x/fail_step_write_after", 1000);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto answer = node.moveTo(0.1, true);
  EXPECT_FALSE(answer.success);
  EXPECT_FALSE(answer.message.empty());
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return !s.fault.at(0).empty(); }));
  const std::int64_t pulses = node.pulses();
  EXPECT_LE(pulses, 500);
  const auto refused = node.moveTo(0.0, true);
  EXPECT_FALSE(refused.success);
  EXPECT_EQ(node.pulses(), pulses);
}

// On the rig's clock it looks the same as with real lines: the next pulse is late.
TEST(SuspendedNode, EndsItsMoveByAFault) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  auto waiting = longMove(node);
  node.process().signal(SIGSTOP);
  std::this_thread::sleep_for(std::chrono::seconds(3));
  node.process().signal(SIGCONT);
  const auto answer = waiting.get();
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "late");
  EXPECT_EQ(node.pulses(), std::llround(answer.position / kMetresPerStep));
}

}  // namespace
}  // namespace stepdriver::node_test
