#include <gtest/gtest.h>

#include <string>

#include "node/diagnostics/axis_diagnostics.h"
#include "node/diagnostics/engine_diagnostics.h"
#include "node/diagnostics/named_lines_diagnostics.h"
#include "support/says.h"

// Tests that one cause alone is enough for each level, and that the level ends with the cause.

namespace stepdriver::ros_node {
namespace {

using diagnostic_msgs::DiagnosticStatus;
using diagnostic_updater::DiagnosticStatusWrapper;
using node_test::expectSays;

std::string valueOf(const DiagnosticStatusWrapper& status, const std::string& key) {
  for (const auto& value : status.values) {
    if (value.key == key) return value.value;
  }
  return "there is no " + key;
}

class AxisReport : public testing::Test {
 protected:
  AxisReport() {
    config.name = "x";
    config.steps_per_unit = 80'000.0;
    config.min_position = 0.0;
    config.max_position = 0.2;
    reading.state.enabled = true;
    reading.state.position_valid = true;
    reading.state.position = 0.1;
    reading.limits = {0.1, 0.5, 0.4, 0.0};
    reading.endstops = {false, false};
  }

  void expect(int level, const std::string& words) const {
    DiagnosticStatusWrapper status;
    reportAxis(config, reading, status);
    EXPECT_EQ(static_cast<int>(status.level), level) << status.message;
    expectSays(status.message, words);
  }

  config::AxisConfig config;
  AxisReading reading;
};

TEST_F(AxisReport, IsOkWhateverItDoes) {
  expect(DiagnosticStatus::OK, "at rest");
  reading.state.moving = true;
  expect(DiagnosticStatus::OK, "moves");
  reading.state.held = true;
  expect(DiagnosticStatus::OK, "on hold");
  reading.state.homing = axis::HomingPhase::kSeeking;
  expect(DiagnosticStatus::OK, "is being homed: seeking");
  reading.state = {};
  reading.state.position = 0.1;
  reading.state.position_valid = true;
  expect(DiagnosticStatus::OK, "disabled");
}

TEST_F(AxisReport, WarnsOfAnUnverifiedPositionWithItsNote) {
  reading.state.position_valid = false;
  expect(DiagnosticStatus::WARN, "the position is unverified: home it, or set its position");
  reading.state.position_note = "the node was killed";
  expect(DiagnosticStatus::WARN, "(the node was killed)");
}

TEST_F(AxisReport, WarnsOfAnActiveEndstop) {
  reading.endstops.min = true;
  expect(DiagnosticStatus::WARN, "the min endstop is active");
  reading.endstops = {false, true};
  expect(DiagnosticStatus::WARN, "the max endstop is active");
  reading.endstops = {};
  expect(DiagnosticStatus::OK, "at rest");
}

TEST_F(AxisReport, WarnsNearASoftLimit) {
  reading.state.position = 0.0021;
  expect(DiagnosticStatus::OK, "at rest");
  reading.state.position = 0.0019;
  expect(DiagnosticStatus::WARN, "near the soft limit min_position, 0 m");
  reading.state.position = 0.199;
  expect(DiagnosticStatus::WARN, "near the soft limit max_position, 0.2 m");
  config.min_position.reset();
  expect(DiagnosticStatus::OK, "at rest");
  reading.state.position = 0.2;
  expect(DiagnosticStatus::WARN, "near the soft limit max_position, 0.2 m");
}

TEST_F(AxisReport, TellsAFaultAndItsRemedyBeforeAllElse) {
  reading.state.fault = "emergency stop";
  reading.state.remedy = "call recover when all is safe";
  reading.endstops.min = true;
  expect(DiagnosticStatus::ERROR, "emergency stop: call recover when all is safe; the min endstop");
}

TEST_F(AxisReport, TellsAnEndstopThatCannotBeRead) {
  reading.endstop_error = "x: the min endstop's line gpiochip0:5 can't be read";
  expect(DiagnosticStatus::ERROR, "gpiochip0:5 can't be read");
}

TEST_F(AxisReport, HasTheNumbers) {
  reading.endstops.max.reset();
  reading.state.target = 6.9e-18;
  DiagnosticStatusWrapper status;
  reportAxis(config, reading, status);
  EXPECT_EQ(valueOf(status, "position [m]"), "0.1");
  EXPECT_EQ(valueOf(status, "target [m]"), "0") << "not the rounding of sums";
  EXPECT_EQ(valueOf(status, "min endstop"), "inactive");
  EXPECT_EQ(valueOf(status, "max endstop"), "none");
  EXPECT_EQ(valueOf(status, "deceleration [m/s^2]"), "0.4");
}

class EngineReport : public testing::Test {
 protected:
  EngineReport() {
    reading.max_lateness = 0.005;
    reading.figures.slips = reading.slips_before = 7;
    reading.rates = {{"x", 8000.0, 20'000.0, 16'000.0, "calls", 3200.0},
                     {"y", 1000.0, 20'000.0, 10'000.0, "calls"}};
    reading.rates_in_motion = {{"x", 4000.0, 20'000.0, 20'000.0, "calls"}};
  }

  void expect(int level, const std::string& words) const {
    DiagnosticStatusWrapper status;
    reportEngine(reading, status);
    EXPECT_EQ(static_cast<int>(status.level), level) << status.message;
    expectSays(status.message, words);
  }

  EngineReading reading;
};

TEST_F(EngineReport, IsOkWherePulsesAreInTime) {
  expect(DiagnosticStatus::OK, "pulses in time");
  reading.figures.lateness.max = 50'000'000;  // long ago
  expect(DiagnosticStatus::OK, "pulses in time");
}

TEST_F(EngineReport, WarnsOfSlipsSinceTheLastReading) {
  reading.figures.slips = 9;
  expect(DiagnosticStatus::WARN, "2 times in the last second");
}

TEST_F(EngineReport, WarnsOfLatenessBeforeItIsAFault) {
  reading.figures.lateness_last_second.max = 2'400'000;
  expect(DiagnosticStatus::OK, "pulses in time");
  reading.figures.lateness_last_second.max = 2'600'000;
  expect(DiagnosticStatus::WARN, "a pulse was 2.6 ms late; beyond realtime/max_lateness_ms, 5 ms");
  reading.figures.lateness_last_second.max = 5'100'000;
  expect(DiagnosticStatus::ERROR, "a pulse was 5.1 ms late");
}

TEST_F(EngineReport, WarnsOfALittleMarginBeforeThereIsNone) {
  machine::StepRate& moving = reading.rates_in_motion[0];
  moving.asked = 15'900.0;
  expect(DiagnosticStatus::OK, "pulses in time");
  moving.asked = 16'100.0;
  expect(DiagnosticStatus::WARN,
         "little margin: x needs 16100 steps/s, and this computer can sustain 20000");
  moving.asked = 20'100.0;
  expect(DiagnosticStatus::ERROR,
         "too fast a motion: x needs 20100 steps/s, but this computer can sustain 20000");
}

TEST_F(EngineReport, WarnsOfATopSpeedThatTheMachineDoesNotHoldThoughNothingMoves) {
  reading.rates_in_motion.clear();
  reading.rates[0].asked = 15'900.0;
  expect(DiagnosticStatus::OK, "pulses in time");
  reading.rates[0].asked = 16'100.0;
  expect(DiagnosticStatus::WARN, "at top speed x needs 16100 steps/s");
}

TEST_F(EngineReport, HasTheNumbers) {
  reading.figures.edges = 42;
  reading.figures.lateness_last_second = {20, 1000, 2000, 3000, 4500};
  DiagnosticStatusWrapper status;
  reportEngine(reading, status);
  EXPECT_EQ(valueOf(status, "edges"), "42");
  EXPECT_EQ(valueOf(status, "slips"), "7");
  EXPECT_EQ(valueOf(status, "pulses in the last second"), "20");
  EXPECT_EQ(valueOf(status, "lateness in the last second p99 [us]"), "2");
  EXPECT_EQ(valueOf(status, "lateness in the last second max [us]"), "4.5");
  EXPECT_EQ(valueOf(status, "x: steps/s"), "4000");
  EXPECT_EQ(valueOf(status, "x: margin"), "5");
  EXPECT_EQ(valueOf(status, "x: margin at top speed"), "2");
  EXPECT_EQ(valueOf(status, "x: steps/s that this computer sustains"), "16000");
  EXPECT_EQ(valueOf(status, "x: rpm"), "75");
  EXPECT_EQ(valueOf(status, "x: rpm at top speed"), "150");
  EXPECT_EQ(valueOf(status, "x: rpm that this computer sustains"), "300");
  EXPECT_EQ(valueOf(status, "y: rpm at top speed"), "-");
  EXPECT_EQ(valueOf(status, "y: steps/s"), "0");
  EXPECT_EQ(valueOf(status, "y: margin"), "at rest");
  reading.rates.clear();
  DiagnosticStatusWrapper simulated;
  reportEngine(reading, simulated);
  expectSays(valueOf(simulated, "margin"), "not measured");
}

TEST(NamedLinesReport, TellsEachLineAndThoseThatCannotBeWrittenOrRead) {
  machine::IoStates states;
  states.outputs.resize(2);
  states.outputs[0].name = "pen";
  states.outputs[1].name = "laser";
  states.outputs[1].on = true;
  states.outputs[1].value = 0.4;
  states.inputs.resize(2);
  states.inputs[0].name = "probe";
  states.inputs[1].name = "button";
  states.inputs[1].active = true;
  DiagnosticStatusWrapper status;
  reportNamedLines(states, status);
  EXPECT_EQ(static_cast<int>(status.level), DiagnosticStatus::OK) << status.message;
  EXPECT_EQ(valueOf(status, "output pen"), "off");
  EXPECT_EQ(valueOf(status, "output laser"), "on at 0.4");
  EXPECT_EQ(valueOf(status, "input probe"), "inactive");
  EXPECT_EQ(valueOf(status, "input button"), "active");
  states.outputs[0].note = "was switched off";
  DiagnosticStatusWrapper noted;
  reportNamedLines(states, noted);
  EXPECT_EQ(static_cast<int>(noted.level), DiagnosticStatus::WARN);
  expectSays(noted.message, "pen was switched off");
  states.inputs[0].error = "the line GPIO5 of the input probe can't be read: EIO";
  DiagnosticStatusWrapper failed;
  reportNamedLines(states, failed);
  EXPECT_EQ(static_cast<int>(failed.level), DiagnosticStatus::ERROR);
  expectSays(failed.message, "the line GPIO5 of the input probe can't be read: EIO");
  EXPECT_EQ(valueOf(failed, "input probe"), "inactive (uncertain)");
  EXPECT_EQ(valueOf(failed, "input button"), "active");
}

}  // namespace
}  // namespace stepdriver::ros_node
