#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/Microstep.h>
#include <stepdriver/MoveTo.h>
#include <stepdriver/SetPosition.h>

#include <cmath>
#include <limits>
#include <string>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/vcd_reader.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

std_srvs::SetBool::Response setBool(NodeUnderTest& node, const std::string& service, bool data) {
  std_srvs::SetBool::Request request;
  request.data = data;
  return node.call<std_srvs::SetBool>(service, request);
}

Microstep::Response microstep(NodeUnderTest& node, int microsteps) {
  Microstep::Request request;
  request.microsteps = microsteps;
  return node.call<Microstep>("x/microstep", request);
}

SetPosition::Response setPosition(NodeUnderTest& node, double position) {
  SetPosition::Request request;
  request.position = position;
  return node.call<SetPosition>("x/set_position", request);
}

void makeTb6600(NodeUnderTest& node) {
  node.erase("axes/x");
  node.set("axes/x/driver", "tb6600");
  node.set("axes/x/pins/step", "x_step");
  node.set("axes/x/pins/dir", "x_dir");
  node.set("axes/x/common_anode", true);
  node.set("axes/x/microsteps", 8);
  node.set("axes/x/steps_per_mm", 80.0);
  node.set("axes/x/max_speed_mm_s", 50.0);
  node.set("axes/x/acceleration_mm_s2", 500.0);
}

TEST(ChipServices, AFaultOfTheChipEndsAMoveAndRecoverResetsTheChip) {
  NodeUnderTest node;
  node.set("axes/x/driver", "drv8825");
  node.set("axes/x/pins/fault", "x_fault");
  node.set("simulation/axes/x/chip_fault_after", 100);
  node.start();
  MoveTo::Request request;
  request.position = 0.05;
  request.wait = true;
  const auto failed = node.call<MoveTo>("x/move_to", request);
  EXPECT_FALSE(failed.success);
  expectSays(failed.message, "nFAULT");
  const auto refused = node.call<MoveTo>("x/move_to", request);
  EXPECT_FALSE(refused.success);
  expectSays(refused.message, "recover");
  EXPECT_TRUE(node.call<std_srvs::Trigger>("recover").success);
  const auto moved = node.call<MoveTo>("x/move_to", request);
  EXPECT_TRUE(moved.success) << moved.message;
}

/// Replaces the axis x by one with a driver that only its configuration knows: no microstep pins,
/// 8000 steps/s at most.
void describe(NodeUnderTest& node) {
  node.erase("axes/x");
  node.set("axes/x/driver", "step_dir");
  for (const char* pin : {"step", "dir", "enable"}) {
    node.set(std::string("axes/x/pins/") + pin, std::string("x_") + pin);
  }
  node.set("axes/x/chip/enable_active", "high");
  node.set("axes/x/timing/enable_ms", 2.0);
  for (const char* time : {"step_high_us", "step_low_us", "dir_setup_us", "dir_hold_us"}) {
    node.set(std::string("axes/x/timing/") + time, 2.5);
  }
  node.set("axes/x/microsteps", 25);
  node.set("axes/x/steps_per_mm", 80.0);
  node.set("axes/x/max_speed_mm_s", 100.0);
  node.set("axes/x/acceleration_mm_s2", 500.0);
  node.set("axes/x/enable_on_start", true);
}

TEST(ChipServices, AnAlarmOfADriverWithoutANameEndsAMoveByItsRampAndEnableEndsTheAlarm) {
  NodeUnderTest node;
  describe(node);
  node.set("axes/x/pins/fault", "x_alarm");
  node.set("axes/x/chip/fault_active", "high");
  node.set("axes/x/chip/fault_ended_by", "enable");
  node.set("axes/x/timing/reset_low_ms", 5.0);
  node.set("axes/x/fault_stop", "ramp");
  node.set("simulation/axes/x/chip_fault_after", 2000);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(setPosition(node, 0.0).success);
  const auto failed = node.moveTo(0.1, true);
  EXPECT_FALSE(failed.success);
  expectSays(failed.message, "the step_dir driver reports a fault on its fault output");
  EXPECT_GT(node.pulses(), 2700) << "from 8000 steps/s it needs 800 to stop";
  EXPECT_LT(node.pulses(), 4000);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return !s.fault.at(0).empty() && !s.position_valid.at(0); }));
  expectSays(node.moveTo(0.0, true).message, "recover");
  const auto recovered = node.call<std_srvs::Trigger>("recover");
  EXPECT_TRUE(recovered.success) << recovered.message;
  const auto moved = node.moveTo(0.0, true);
  EXPECT_TRUE(moved.success) << moved.message;
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST(ChipServices, AMoveWaitsUntilTheDriverIsInPositionAndNotForEver) {
  for (const bool never : {false, true}) {
    NodeUnderTest node;
    describe(node);
    node.set("axes/x/pins/in_position", "x_in_position");
    node.set("axes/x/in_position_timeout_ms", 900.0);
    node.set("axes/x/chip/in_position_active", "high");
    node.set("simulation/axes/x/settling_ms", 400.0);
    node.set("simulation/axes/x/never_in_position", never);
    node.start();
    const Recorder<AxisStates> states(node.full("axis_states"));
    const auto moved = node.moveTo(0.01, true);
    EXPECT_EQ(moved.success, !never) << moved.message;
    EXPECT_EQ(node.pulses(), 800);
    if (never) {
      expectSays(moved.message,
                 "the step_dir driver isn't in position: its in-position output was still inactive "
                 "900 ms after the end of the motion");
      EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return !s.fault.at(0).empty(); }));
    }
    EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
  }
}

TEST(ChipServices, DriversWithCwAndCcwOrBothEdgesMoveAndAreTraced) {
  for (const bool both_edges : {false, true}) {
    NodeUnderTest node;
    describe(node);
    if (both_edges) {
      node.set("axes/x/chip/step_edges", "both");
    } else {
      node.erase("axes/x/pins/step");
      node.erase("axes/x/pins/dir");
      node.set("axes/x/pins/cw", "x_cw");
      node.set("axes/x/pins/ccw", "x_ccw");
      node.set("axes/x/chip/step_inputs", "cw_ccw");
    }
    const std::string trace = node.traced();
    node.start();
    EXPECT_TRUE(node.moveTo(0.01, true).success);
    EXPECT_TRUE(node.moveTo(-0.005, true).success);
    const auto report = node.rig();
    EXPECT_EQ(report.pulses_forward.at(0), 800);
    EXPECT_EQ(report.pulses_backward.at(0), 1200);
    EXPECT_NEAR(report.carriage.at(0), -0.005, 1e-9);
    EXPECT_EQ(report.violations.at(0), 0) << report.violation_kinds.at(0);
    const auto waveforms = readVcd(trace);
    if (both_edges) {
      EXPECT_EQ(waveforms.at("x/step").edges.size(), 1U + 2000U);
      EXPECT_TRUE(waveforms.at("x/step").both_edges);
    } else {
      EXPECT_EQ(waveforms.at("x/cw").edges.size(), 1U + 1600U);
      EXPECT_EQ(waveforms.at("x/ccw").edges.size(), 1U + 2400U);
    }
  }
}

TEST(ChipServices, EnableAndDisableShowInTheStateAndInTheTrace) {
  NodeUnderTest node;
  node.set("axes/x/enable_on_start", false);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return !s.enabled.at(0); }));
  EXPECT_TRUE(setBool(node, "x/enable", true).success);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.enabled.at(0) != 0; }));
  EXPECT_TRUE(setBool(node, "x/enable", true).success) << "enabling twice is no mistake";
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  EXPECT_TRUE(setBool(node, "x/enable", false).success);
  EXPECT_TRUE(states.waitForLatest(
      [](const AxisStates& s) { return !s.enabled.at(0) && !s.position_valid.at(0); }));
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST(ChipServices, DisablingStopsAMoveFirst) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  EXPECT_TRUE(node.moveTo(0.2, false).success);
  ASSERT_TRUE(waitUntil([&] { return node.pulses() > 500; }));
  EXPECT_TRUE(setBool(node, "x/enable", false).success);
  const std::int64_t pulses = node.pulses();
  EXPECT_LT(pulses, 16000);
  const auto answer = node.moveTo(0.0, true);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "disabled");
  EXPECT_EQ(node.pulses(), pulses);
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST(ChipServices, SleepsAndWakes) {
  NodeUnderTest node;
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(setBool(node, "x/sleep", true).success);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return s.asleep.at(0) != 0; }));
  EXPECT_TRUE(setBool(node, "x/sleep", false).success);
  const auto answer = node.moveTo(0.01, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST(ChipServices, AnIdleAxisIsShownAndWakesForTheNextMove) {
  NodeUnderTest node;
  node.set("axes/x/idle_timeout_s", 2.0);
  node.set("axes/x/idle_action", "sleep");
  node.set("axes/x/holds_position_unpowered", true);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(setPosition(node, 0.0).success);
  EXPECT_TRUE(node.moveTo(0.0008, true).success);
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) {
    return s.idle.at(0) && s.asleep.at(0) && s.enabled.at(0) && s.position_valid.at(0) &&
           s.position.at(0) > 0.0;
  }));
  const auto answer = node.moveTo(0.01, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST(ChipServices, ResetTakesTheTrustInThePosition) {
  NodeUnderTest node;
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  EXPECT_TRUE(setPosition(node, 0.05).success);
  EXPECT_TRUE(
      states.waitForLatest([](const AxisStates& s) { return s.position_valid.at(0) != 0; }));
  const auto answer = node.call<std_srvs::Trigger>("x/reset");
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_TRUE(states.waitForLatest([](const AxisStates& s) { return !s.position_valid.at(0); }));
  EXPECT_TRUE(node.moveTo(0.06, true).success);
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST(ChipServices, ChangesMicrostepsAndKeepsThePosition) {
  NodeUnderTest node;
  node.start();
  EXPECT_TRUE(node.moveTo(0.01, true).success);  // 800 steps: 50 full steps
  const auto answer = microstep(node, 4);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_EQ(answer.microsteps, 4);
  EXPECT_TRUE(node.moveTo(0.02, true).success);
  const auto report = node.rig();
  EXPECT_EQ(report.pulses_forward.at(0), 800 + 200);
  EXPECT_EQ(report.microsteps.at(0), 4);
  EXPECT_NEAR(report.carriage.at(0), 0.02, 1e-9);
  EXPECT_EQ(report.violations.at(0), 0) << report.violation_kinds.at(0);
}

TEST(ChipServices, RefusesMicrostepsThatTheChipHasNot) {
  NodeUnderTest node;
  node.start();
  for (const int unknown : {0, -1, 3, 32, 256, std::numeric_limits<int>::max()}) {
    const auto answer = microstep(node, unknown);
    EXPECT_FALSE(answer.success) << unknown;
    EXPECT_FALSE(answer.message.empty());
    EXPECT_EQ(answer.microsteps, 16);
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST(ChipServices, RefusesMicrostepsThatHaveNoPlaceHere) {
  NodeUnderTest node;
  node.start();
  EXPECT_TRUE(node.moveTo(3.0 / 80000.0, true).success);
  const auto answer = microstep(node, 1);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "align_on_microstep_change");
  EXPECT_EQ(answer.microsteps, 16);
  EXPECT_EQ(node.pulses(), 3);
}

TEST(ChipServices, RefusesMicrostepsOfADipSwitchedModuleWithTheReason) {
  NodeUnderTest node;
  makeTb6600(node);
  node.start();
  const auto answer = microstep(node, 16);
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "switches");
  EXPECT_EQ(answer.microsteps, 8);
}

TEST(ChipServices, RefusesWhatIsNotWired) {
  NodeUnderTest node;
  makeTb6600(node);
  node.start();
  EXPECT_FALSE(setBool(node, "x/enable", true).success);
  EXPECT_FALSE(setBool(node, "x/sleep", true).success);
  const auto answer = node.call<std_srvs::Trigger>("x/reset");
  EXPECT_FALSE(answer.success);
  expectSays(answer.message, "RESET");
}

TEST(ChipServices, DeclaresThePositionAndMovesFromThere) {
  NodeUnderTest node;
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  const auto answer = setPosition(node, 0.1);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_NEAR(answer.position, 0.1, 1e-12);
  EXPECT_TRUE(
      states.waitForLatest([](const AxisStates& s) { return s.position_valid.at(0) != 0; }));
  EXPECT_EQ(node.pulses(), 0);
  EXPECT_TRUE(node.moveTo(0.101, true).success);
  EXPECT_EQ(node.pulses(), 80);
}

TEST(ChipServices, RefusesPositionsThatCannotBe) {
  NodeUnderTest node;
  node.start();
  for (const double bad : {kNan, kInfinity, -kInfinity, -0.01, 0.3}) {
    const auto answer = setPosition(node, bad);
    EXPECT_FALSE(answer.success) << bad;
    EXPECT_FALSE(answer.message.empty());
    EXPECT_EQ(answer.position, 0.0);
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST(ChipServices, RefusesAllThatNeedsRestWhileMoving) {
  NodeUnderTest node;
  node.set("simulation/speed", 1.0);
  node.start();
  EXPECT_TRUE(node.moveTo(0.1, false).success);
  expectSays(setBool(node, "x/sleep", true).message, "busy");
  expectSays(node.call<std_srvs::Trigger>("x/reset").message, "busy");
  expectSays(microstep(node, 8).message, "busy");
  expectSays(setPosition(node, 0.0).message, "busy");
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 8000; }));
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

}  // namespace
}  // namespace stepdriver::node_test
