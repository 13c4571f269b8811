#include "storm/storm_machine.h"

#include <initializer_list>

#include "storm/driver_calls.h"

namespace stepdriver::storm {
namespace {

constexpr double kStepsPerMm = 20.0;
constexpr int kMicrosteps = 16;
constexpr int kHalfSteps = 2;
constexpr double kTurn = 40.0;  // [mm] of the motor with an index
constexpr const char* kFlag = "flag";
constexpr const char* kIndex = "z_index";
constexpr const char* kBlock = "x_block";

struct Dynamics {
  double max_speed;     // [mm/s]
  double acceleration;  // [mm/s^2]
  double jerk;          // [mm/s^3] 0: none
};

AxisFacts setUpAxis(node_test::NodeUnderTest& node, const std::string& name,
                    std::initializer_list<const char*> pins, const Dynamics& dynamics) {
  const std::string axis = "axes/" + name + "/";
  node.erase("axes/" + name);
  node.set(axis + "driver", "a4988");
  node.set(axis + "joint", name + "_joint");
  for (const char* pin : pins) node.set(axis + "pins/" + pin, name + "_" + pin);
  node.set(axis + "microsteps", kMicrosteps);
  node.set(axis + "steps_per_mm", kStepsPerMm);
  node.set(axis + "steps_per_round", 3200);
  node.set(axis + "max_speed_mm_s", dynamics.max_speed);
  node.set(axis + "acceleration_mm_s2", dynamics.acceleration);
  if (dynamics.jerk > 0.0) node.set(axis + "jerk_mm_s3", dynamics.jerk);
  node.set(axis + "min_position_mm", -50.0);
  node.set(axis + "max_position_mm", 150.0);
  node.set(axis + "enable_on_start", true);
  node.set(axis + "require_homing", false);
  AxisFacts facts;
  facts.name = name;
  facts.steps_per_metre = kStepsPerMm * 1e3;
  facts.min_position = -0.05;
  facts.max_position = 0.15;
  // A stop first has to reduce the present acceleration.
  facts.longest_stop = dynamics.max_speed / dynamics.acceleration;
  if (dynamics.jerk > 0.0) facts.longest_stop += 2.5 * dynamics.acceleration / dynamics.jerk;
  return facts;
}

// An input that is active while the carriage of an axis is between two places [mm].
void setUpInput(node_test::NodeUnderTest& node, const std::string& name, const std::string& axis,
                double from, double to) {
  const std::string input = "inputs/" + name + "/";
  node.set(input + "pin", name);
  node.set(input + "active_level", "high");
  node.set("simulation/" + input + "axis", axis);
  node.set("simulation/" + input + "from_mm", from);
  node.set("simulation/" + input + "to_mm", to);
}

void setUpEndstop(node_test::NodeUnderTest& node, const std::string& axis, const std::string& end,
                  const std::string& line) {
  const std::string endstop = "axes/" + axis + "/endstops/" + end + "/";
  node.set(endstop + "pin", line);
  node.set(endstop + "active_level", "high");
}

// Of any kind that moves the axis, towards a place [mm].
void setUpHoming(node_test::NodeUnderTest& node, const std::string& axis, double place) {
  const std::string homing = "axes/" + axis + "/homing/";
  node.set(homing + "seek_speed_mm_s", 40.0);
  node.set(homing + "latch_speed_mm_s", 5.0);
  node.set(homing + "pull_off_mm", 2.0);
  node.set(homing + "max_travel_mm", 250.0);
  node.set(homing + "offset_mm", place);
}

void setUpSwitches(node_test::NodeUnderTest& node) {
  setUpEndstop(node, "x", "min", "x_endstop_min");
  setUpHoming(node, "x", -52.0);
  node.set("axes/x/homing/switch", "min");
  node.set("axes/y/homing/kind", "direct");
  node.set("axes/y/homing/offset_mm", 10.0);
  setUpInput(node, kFlag, "z", 20.0, 25.0);
  setUpInput(node, kIndex, "z", 32.0, 32.5);
  node.set(std::string("simulation/inputs/") + kIndex + "/every_mm", kTurn);
  node.set("axes/z/steps_per_round", static_cast<int>(kTurn * kStepsPerMm));
  setUpHoming(node, "z", 32.0);
  node.set("axes/z/homing/kind", "index");
  node.set("axes/z/homing/towards", "max");
  node.set("axes/z/homing/flag", kFlag);
  node.set("axes/z/homing/input", kIndex);
  // No step is ever lost while it is homed.
  node.set("axes/z/homing/check_at_flag", "fault");
  node.set("axes/z/homing/check_tolerance_mm", 0.2);
}

void setUpPhases(node_test::NodeUnderTest& node) {
  node.set(std::string("inputs/") + kBlock + "/pin", kBlock);
  node.set(std::string("inputs/") + kBlock + "/active_level", "high");
  node.set("simulation/axes/x/block_min_mm", -52.0);
  setUpHoming(node, "x", -52.0);
  node.set("axes/x/homing/kind", "block");
  node.set("axes/x/homing/towards", "min");
  node.set("axes/x/homing/input", kBlock);
  node.set("axes/x/homing/approaches", 2);
  setUpInput(node, kFlag, "y", 20.0, 25.0);
  setUpHoming(node, "y", 22.5);
  node.set("axes/y/homing/kind", "flag_centre");
  node.set("axes/y/homing/towards", "max");
  node.set("axes/y/homing/input", kFlag);
  node.set("axes/z/driver", "uln2003");
  node.set("axes/z/microsteps", kHalfSteps);
  for (const char* end : {"min", "max"}) {
    setUpEndstop(node, "z", end, "z_ends");
    node.set(std::string("axes/z/endstops/") + end + "/shared", true);
  }
  node.set("axes/z/endstops/release_mm", 1.0);
  setUpHoming(node, "z", 152.0);
  node.set("axes/z/homing/switch", "max");
}

}  // namespace

StormMachine machineOf(std::uint64_t seed) {
  return seed % 2 == 1 ? StormMachine::kSwitches : StormMachine::kPhases;
}

std::vector<std::string> switchesOf(StormMachine machine) {
  if (machine == StormMachine::kSwitches) return {"rig/x/press_min", "rig/x/press_max"};
  // A hand on z's switches would tell of the wrong end.
  return {"rig/x/press_max"};
}

std::vector<int> microstepsOfZ(StormMachine machine) {
  if (machine == StormMachine::kSwitches) return {kMicrosteps, kMicrosteps / 2};
  return {kHalfSteps, kHalfSteps / 2};
}

std::vector<AxisFacts> setUpMachine(node_test::NodeUnderTest& node, StormMachine machine) {
  const bool has_phases = machine == StormMachine::kPhases;
  node.set("simulation/speed", 1.0);
  node.set("jog_timeout", kJogTimeout);
  node.set("setpoint/timeout", kJogTimeout);
  node.set("motor_power/pin", "motor_power");
  node.set("motor_power/on_ms", 20.0);
  node.set("motor_power/off_delay_ms", 50.0);
  node.set("motor_power/feedback/pin", "motor_power_feedback");
  node.set("motor_power/feedback/active_level", "high");
  for (const std::string& output : kOutputs) {
    if (output == kPwmOutput) {
      node.set("outputs/" + output + "/pwm/chip", 0);
      node.set("outputs/" + output + "/pwm/channel", 0);
      node.set("outputs/" + output + "/pwm/frequency_hz", 1000.0);
    } else {
      node.set("outputs/" + output + "/pin", output);
    }
  }
  const std::string timed = std::string("outputs/") + kTimedOutput + "/";
  node.set(timed + "max_on_s", kMaxOn);
  node.set(timed + "min_on_ms", 1e3 * kMinOn);
  node.set(timed + "min_off_ms", 1e3 * kMinOff);
  setUpInput(node, kInput, "x", 4.0, 6.0);
  node.set(std::string("simulation/inputs/") + kInput + "/every_mm", 10.0);
  const std::initializer_list<const char*> pins = {"step", "dir",   "ms1",  "ms2",
                                                   "ms3",  "sleep", "reset"};
  std::vector<AxisFacts> facts;
  facts.push_back(setUpAxis(node, "x", pins, {100.0, 250.0, 0.0}));
  node.set("axes/x/align_on_microstep_change", true);
  setUpEndstop(node, "x", "max", "x_endstop_max");
  facts.push_back(setUpAxis(node, "y", {"step", "dir"}, {40.0, 200.0, 0.0}));
  node.set("axes/y/driver", "tmc2209");
  node.set("axes/y/tmc/port", "/dev/serial0");
  node.set("axes/y/tmc/address", 0);
  node.set("axes/y/tmc/sense_resistor_mohm", 110.0);
  node.set("axes/y/tmc/run_current_a", kHighestCurrent);
  node.set("axes/y/backlash_mm", 8.0);
  facts.back().backlash = 8e-3;
  for (const char* axis : {"x", "y"}) {
    node.set(std::string("axes/") + axis + "/pins/enable", "xy_enable");
  }
  const std::initializer_list<const char*> coils = {"in1", "in2", "in3", "in4"};
  facts.push_back(setUpAxis(node, "z", has_phases ? coils : pins, {60.0, 300.0, 3000.0}));
  if (!has_phases) node.set("axes/z/pins/enable", "z_enable");
  node.set("axes/z/idle_timeout_s", 0.3);
  has_phases ? setUpPhases(node) : setUpSwitches(node);
  return facts;
}

}  // namespace stepdriver::storm
