#include "storm/storm_machine.h"

#include <initializer_list>

#include "storm/driver_calls.h"

namespace stepdriver::storm {
namespace {

constexpr double kStepsPerMm = 20.0;

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
  node.set(axis + "microsteps", 16);
  node.set(axis + "steps_per_mm", kStepsPerMm);
  node.set(axis + "steps_per_round", 3200);
  node.set(axis + "max_speed_mm_s", dynamics.max_speed);
  node.set(axis + "acceleration_mm_s2", dynamics.acceleration);
  if (dynamics.jerk > 0.0) node.set(axis + "jerk_mm_s3", dynamics.jerk);
  node.set(axis + "min_position_mm", -50.0);
  node.set(axis + "max_position_mm", 150.0);
  node.set(axis + "enable_on_start", true);
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

}  // namespace

std::vector<AxisFacts> setUpMachine(node_test::NodeUnderTest& node) {
  node.set("simulation/speed", 1.0);
  node.set("jog_timeout", kJogTimeout);
  node.set("setpoint/timeout", kJogTimeout);
  node.set("motor_power/pin", "motor_power");
  node.set("motor_power/on_ms", 20.0);
  node.set("motor_power/off_delay_ms", 50.0);
  node.set("motor_power/feedback/pin", "motor_power_feedback");
  node.set("motor_power/feedback/active_level", "high");
  for (const std::string& output : kOutputs) node.set("outputs/" + output + "/pin", output);
  const std::string input = std::string("inputs/") + kInput + "/";
  node.set(input + "pin", kInput);
  node.set(input + "active_level", "high");
  node.set("simulation/" + input + "axis", "x");
  node.set("simulation/" + input + "from_mm", 30.0);
  node.set("simulation/" + input + "to_mm", 40.0);
  const auto pins = {"step", "dir", "ms1", "ms2", "ms3", "sleep", "reset"};
  std::vector<AxisFacts> facts;
  facts.push_back(setUpAxis(node, "x", pins, {100.0, 250.0, 0.0}));
  node.set("axes/x/align_on_microstep_change", true);
  for (const char* end : {"min", "max"}) {
    node.set(std::string("axes/x/endstops/") + end + "/pin", std::string("x_endstop_") + end);
    node.set(std::string("axes/x/endstops/") + end + "/active_level", "high");
  }
  node.set("axes/x/homing/switch", "min");
  node.set("axes/x/require_homing", false);
  node.set("axes/x/homing/seek_speed_mm_s", 60.0);
  node.set("axes/x/homing/latch_speed_mm_s", 5.0);
  node.set("axes/x/homing/pull_off_mm", 2.0);
  node.set("axes/x/homing/max_travel_mm", 250.0);
  node.set("axes/x/homing/offset_mm", -52.0);
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
  facts.push_back(setUpAxis(node, "z", pins, {60.0, 300.0, 3000.0}));
  node.set("axes/z/pins/enable", "z_enable");
  node.set("axes/z/idle_timeout_s", 0.3);
  return facts;
}

}  // namespace stepdriver::storm
