#include "stepdriver_core/config/check_axes.h"

#include <gtest/gtest.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/hardware.h"
#include "support/bench.h"
#include "support/constants.h"

// Axes that a program has made itself, not readAxes().

namespace stepdriver::config {
namespace {

using Axes = std::vector<AxisConfig>;

Axes goodAxes() {
  Axes axes{test::linearAxis("x"), test::linearAxis("y")};
  axes[0].homing = HomingConfig{};
  axes[0].homing->seek_speed = 0.02;
  axes[0].homing->latch_speed = 0.002;
  axes[0].homing->max_travel = 0.3;
  return axes;
}

std::string mistakesOf(const std::function<void(Axes&)>& change) {
  Axes axes = goodAxes();
  change(axes);
  try {
    checkAxes(axes);
  } catch (const ConfigError& error) {
    std::string text;
    for (const ConfigIssue& issue : error.issues()) text += issue.key + ": " + issue.message + "\n";
    return text;
  }
  return "";
}

struct Wrong {
  std::function<void(Axes&)> change;
  const char* issue;
};

const std::vector<Wrong>& wrongs() {
  static const std::vector<Wrong> all = {
      {[](Axes& axes) { axes[0].deceleration = 0.0; },
       "x/deceleration: is 0, but must be from 1.25e-08 to 12500000 m/s^2"},
      {[](Axes& axes) { axes[1].acceleration = test::kNan; },
       "y/acceleration: is nan, but must be"},
      {[](Axes& axes) { axes[0].max_speed = 0.0; },
       "x/max_speed: is 0, but must be 1.25e-08 or more m/s"},
      {[](Axes& axes) { axes[0].start_speed = 5e-324; }, "x/start_speed: is"},
      {[](Axes& axes) { axes[0].start_speed = -1.0; }, "x/start_speed: is -1, but must be from"},
      {[](Axes& axes) { axes[0].stop_deceleration = 0.5; },
       "x/stop_deceleration: is 0.5, but must be from 1 to"},
      {[](Axes& axes) { axes[0].jerk = -1.0; }, "x/jerk: is -1, but must be from"},
      {[](Axes& axes) { axes[0].steps_per_unit = 0.0; }, "x/steps_per_unit: is 0, but must be"},
      {[](Axes& axes) { axes[0].steps_per_unit = test::kInfinity; }, "x/steps_per_unit: is inf"},
      {[](Axes& axes) { axes[0].backlash = -1e-3; }, "x/backlash: is -0.001, but must be from 0"},
      {[](Axes& axes) { axes[0].min_position = axes[0].max_position = 0.1; },
       "x/min_position: is 0.1, but must be below max_position, which is 0.1"},
      {[](Axes& axes) { axes[0].microsteps = 3; }, "x/microsteps: is 3, but the A4988 has"},
      {[](Axes& axes) { axes[0].microsteps = 0; }, "x/microsteps: is 0, but"},
      {[](Axes& axes) { axes[0].pins.step.line.clear(); }, "x/pins.step: has no line"},
      {[](Axes& axes) { axes[0].driver = {}; }, "x/driver.timing: has pulses of 0 ns"},
      {[](Axes& axes) { axes[0].homing->at_max = true, axes[0].endstop_max.reset(); },
       "x/homing.at_max: needs endstop_max, but there is none"},
      {[](Axes& axes) { axes[0].homing->seek_speed = 0.0; }, "x/homing.seek_speed: is 0, but must"},
      {[](Axes& axes) { axes[1].require_homing = true; },
       "y/require_homing: is true, but there is no homing"},
      {[](Axes& axes) { axes[0].idle_timeout = 1.0, axes[0].pins.enable.line.clear(); },
       "x/idle_timeout: is 1 s, but its idle action needs pins.enable, which isn't wired"},
      {[](Axes& axes) {
         axes[0].input_shaper = {{ShaperType::kZv, 0.0, 0.1}};
       },
       "x/input_shaper: is for 0 Hz"},
      {[](Axes& axes) { axes[1].name = "x"; }, "axes: has an axis named \"x\", but each"},
      {[](Axes& axes) {
         axes[0].kinematics = std::make_shared<Kinematics>(
             Kinematics{{"x", "z"}, {{1.0, 1.0}, {1.0, -1.0}}, {{0.5, 0.5}, {0.5, -0.5}}});
       },
       "x/kinematics: has x and z, but must name this axis and others that have the same one"},
      {[](Axes& axes) {
         axes[0].kinematics = std::make_shared<Kinematics>(Kinematics{{"x", "y"}, {{1.0}}, {}});
       },
       "x/kinematics: has 2 axes, but must have"},
  };
  return all;
}

TEST(CheckAxes, ReportsWhatNoMotionCanBePlannedWith) {
  EXPECT_EQ(mistakesOf([](Axes&) {}), "");
  for (const Wrong& wrong : wrongs()) {
    const std::string issues = mistakesOf(wrong.change);
    EXPECT_NE(issues.find(wrong.issue), std::string::npos) << wrong.issue << "\n" << issues;
  }
}

// Nothing else than an Error comes out of either, whatever is wrong.
TEST(CheckAxes, IsDoneByAMachineAndItsHardware) {
  setup::MachineConfig config;
  config.backend = setup::GpioBackend::kSimulated;
  config.axes = goodAxes();
  setup::Hardware hardware(config);
  EXPECT_NO_THROW(machine::Machine(config.axes, hardware.backend(), hardware.clock()));
  for (const Wrong& wrong : wrongs()) {
    config.axes = goodAxes();
    wrong.change(config.axes);
    EXPECT_THROW(setup::Hardware{config}, ConfigError) << wrong.issue;
    EXPECT_THROW(machine::Machine(config.axes, hardware.backend(), hardware.clock()), ConfigError)
        << wrong.issue;
  }
}

}  // namespace
}  // namespace stepdriver::config
