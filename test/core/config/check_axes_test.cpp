#include <gtest/gtest.h>

#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
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

/// An axis with a homing of this order.
AxisConfig homedAxis(const std::string& name, int order, bool brake) {
  AxisConfig axis;
  axis.name = name;
  axis.homing.emplace();
  axis.homing->order = order;
  if (brake) axis.brake.emplace();
  return axis;
}

TEST(HomingWarnings, NameAnAxisWithABrakeThatIsHomedTogetherWithOthers) {
  EXPECT_EQ(homingWarnings({homedAxis("x", 0, false), homedAxis("y", 0, false)}),
            std::vector<std::string>{});
  EXPECT_EQ(homingWarnings({homedAxis("x", 1, false), homedAxis("z", 0, true)}),
            std::vector<std::string>{});
  EXPECT_EQ(
      homingWarnings({homedAxis("x", 0, false), homedAxis("y", 0, false), homedAxis("z", 0, true)}),
      std::vector<std::string>{
          "axis z has a brake, so it may be vertical, but it is homed together with x and y: "
          "each has the homing/order 0. If z must be out of the way first, give it a lower "
          "homing/order"});
  AxisConfig unhomed = homedAxis("x", 0, false);
  unhomed.homing.reset();
  EXPECT_EQ(homingWarnings({unhomed, homedAxis("z", 0, true)}), std::vector<std::string>{});
}

/// Both axes share their motors.
void share(Axes& axes, const std::vector<std::string>& names, const Matrix& matrix) {
  auto shared = std::make_shared<Kinematics>();
  *shared = {names, matrix, inverseOf(matrix).value_or(matrix)};
  for (AxisConfig& axis : axes) axis.kinematics = shared;
  axes[0].homing.reset();
}

struct Wrong {
  std::function<void(Axes&)> change;
  const char* issue;
};

const std::vector<Wrong>& wrongs() {
  static const std::vector<Wrong> all = {
      {[](Axes& axes) { axes[0].deceleration = 0.0; },
       "axes/x/deceleration_mm_s2: is 0.0, but must be above 0\n"},
      {[](Axes& axes) { axes[1].acceleration = test::kNan; },
       "axes/y/acceleration_mm_s2: is nan, but must be a finite number above 0\n"},
      {[](Axes& axes) { axes[0].acceleration = 1e9; },
       "axes/x/acceleration_mm_s2: is 1000000000000.0, but must be from"},
      {[](Axes& axes) { axes[0].max_speed = 0.0; },
       "axes/x/max_speed_mm_s: is 0.0, but must be above 0\n"},
      {[](Axes& axes) { axes[0].max_speed = 8.0; },
       "axes/x/max_speed_mm_s: is 8000.0, but must be at most"},
      {[](Axes& axes) { axes[0].driver.timing.dir_hold_ns = 200'000; },
       "axes/x/timing/dir_hold_us: is 200, but must be at most 125: at max_speed_mm_s"},
      {[](Axes& axes) { axes[0].start_speed = 5e-324; }, "axes/x/start_speed_mm_s: is"},
      {[](Axes& axes) { axes[0].start_speed = -1.0; },
       "axes/x/start_speed_mm_s: is -1000.0, but must be 0 or more\n"},
      {[](Axes& axes) { axes[0].start_speed = 0.11; },
       "axes/x/start_speed_mm_s: is 110.0, but must be at most max_speed_mm_s, which is 100.0\n"},
      {[](Axes& axes) { axes[0].stop_deceleration = 0.5; },
       "axes/x/stop_deceleration_mm_s2: is 500.0, but must be at least deceleration_mm_s2"},
      {[](Axes& axes) { axes[0].jerk = -1.0; }, "axes/x/jerk_mm_s3: is -1000.0, but must be"},
      {[](Axes& axes) { axes[0].steps_per_unit = 0.0; },
       "axes/x/steps_per_mm: is 0.0, but must be above 0\n"},
      {[](Axes& axes) { axes[0].steps_per_unit = test::kInfinity; }, "axes/x/steps_per_mm: is inf"},
      {[](Axes& axes) { axes[0].steps_per_round = 3201.0; },
       "axes/x/steps_per_round: is 3201, but must be a multiple of microsteps"},
      {[](Axes& axes) { axes[0].steps_per_round = 0.5; },
       "axes/x/steps_per_round: is 0.5 (a number with a decimal point), but must be an integer"},
      {[](Axes& axes) { axes[0].backlash = -1e-3; },
       "axes/x/backlash_mm: is -1.0, but must be 0 or more\n"},
      {[](Axes& axes) { axes[1].min_position = axes[1].max_position = 0.1; },
       "axes/y/min_position_mm: is 100.0, but must be below max_position_mm, which is 100.0\n"},
      {[](Axes& axes) { axes[1].max_position = 1e12; }, "axes/y/max_position_mm: is"},
      {[](Axes& axes) { axes[1].continuous = true; },
       "axes/y/continuous: is true, but must be false: only a rotary axis"},
      {[](Axes& axes) { axes[0].microsteps = 3; },
       "axes/x/microsteps: is 3, but must be 1, 2, 4, 8 or 16\n"},
      {[](Axes& axes) { axes[0].microsteps = 0; }, "axes/x/microsteps: is 0, but"},
      {[](Axes& axes) { axes[0].joint = "y"; }, "axes/y/joint: is \"y\", but must be another"},
      {[](Axes& axes) { axes[0].pins.step.line.clear(); }, "axes/x/pins/step: is missing"},
      {[](Axes& axes) { axes[0].pins.step.line = "chip:x"; },
       "axes/x/pins/step: is \"chip:x\", but must be a line"},
      {[](Axes& axes) { axes[1].pins.step.line = "x.dir"; },
       "axes/y/pins/step: is \"x.dir\", which is used twice: it is axes/x/pins/dir already"},
      {[](Axes& axes) { axes[0].pins.ms2 = {}; }, "axes/x/pins/ms2: is missing; wire all three"},
      {[](Axes& axes) {
         axes[1].pins.enable.line = "x.enable", axes[1].pins.enable.inverted = true;
       },
       "axes/y/pins/enable: is \"x.enable\", which is axes/x/pins/enable too, but"},
      {[](Axes& axes) { axes[0].fault = FaultPin{"x.fault"}; },
       "axes/x/pins/fault: is \"x.fault\", but the A4988 has no fault pin\n"},
      {[](Axes& axes) { axes[0].in_position = InPositionPin{"x.pend"}; },
       "axes/x/pins/in_position: is \"x.pend\", but the A4988 has no in-position output\n"},
      {[](Axes& axes) {
         axes[0].driver.in_position_active = true;
         axes[0].in_position = InPositionPin{"x.pend", Bias::kAsIs, 1000.0};
       },
       "axes/x/in_position_timeout_ms: is 1000000.0, but must be above 0 and at most 60000\n"},
      {[](Axes& axes) { axes[0].driver = {}; },
       "axes/x/timing/step_high_us: is 0.0, but must be from 0.001 to"},
      {[](Axes& axes) { axes[0].driver.timing.enable_ns = -1; }, "axes/x/timing/enable_ms: is"},
      {[](Axes& axes) {
         axes[0].driver.step_inputs = driver::StepInputs::kCwCcw;
         axes[0].driver.both_edges = true;
       },
       "axes/x/chip/step_edges: is \"both\", but each edge can be a step only on a STEP input"},
      {[](Axes& axes) { axes[0].driver.modes[1].code = axes[0].driver.modes[0].code; },
       "axes/x/driver: is the A4988, but its codes must use each code once: LLL selects"},
      {[](Axes& axes) { axes[0].driver.mode_pins = 4; },
       "axes/x/driver: is the A4988, but has 5 modes and 4 microstep pins"},
      {[](Axes& axes) {
         axes[0].brake = BrakeConfig{"x.brake", true, -1, 0};
       },
       "axes/x/brake/release_ms: is"},
      {[](Axes& axes) {
         axes[0].brake = BrakeConfig{"x.brake"}, axes[0].pins.enable = axes[0].pins.sleep = {};
       },
       "axes/x/brake: is given, but needs axes/x/pins/enable or axes/x/pins/sleep"},
      {[](Axes& axes) { axes[0].homing->at_max = true, axes[0].endstop_max.reset(); },
       "axes/x/homing/switch: is \"max\", but must be a switch that the axis has"},
      {[](Axes& axes) { axes[0].homing->seek_speed = 0.0; },
       "axes/x/homing/seek_speed_mm_s: is 0.0, but must be above 0\n"},
      {[](Axes& axes) { axes[0].homing->seek_speed = 0.2; },
       "axes/x/homing/seek_speed_mm_s: is 200.0, but must be at most max_speed_mm_s"},
      {[](Axes& axes) { axes[0].homing->latch_speed = 0.03; },
       "axes/x/homing/latch_speed_mm_s: is 30.0, but must be at most 20"},
      {[](Axes& axes) { axes[0].homing->pull_off = 0.4; },
       "axes/x/homing/pull_off_mm: is 400.0, but must be at most max_travel_mm"},
      {[](Axes& axes) { axes[0].min_position = 0.01; },
       "axes/x/homing/offset_mm: is 0.0, so that the axis stands at 0 when it is homed"},
      {[](Axes& axes) { axes[0].homing->timeout = 0.0; },
       "axes/x/homing/timeout_s: is 0.0, but must be above 0"},
      {[](Axes& axes) { axes[0].homing->debounce = 2.0; },
       "axes/x/homing/debounce_ms: is 2000.0, but must be from 0 to 1000\n"},
      {[](Axes& axes) { axes[0].homing->order = -1; },
       "axes/x/homing/order: is -1, but must be from 0 to 1000\n"},
      {[](Axes& axes) { axes[1].require_homing = true; },
       "axes/y/require_homing: is true, but must be false if there is no homing\n"},
      {[](Axes& axes) { axes[0].max_skew = 0.001; },
       "axes/x/max_skew_mm: is given, but is only for several motors"},
      {[](Axes& axes) { axes[0].idle_timeout = 1.0, axes[0].pins.enable.line.clear(); },
       "axes/x/idle_timeout_s: is 1.0, but with idle_action disable that needs axes/x/pins/enable"},
      {[](Axes& axes) {
         axes[0].input_shaper = {{ShaperType::kZv, 0.0, 0.1}};
       },
       "axes/x/input_shaper[0]/frequency: is 0.0, but must be from 0.5 to 1000\n"},
      {[](Axes& axes) {
         axes[0].input_shaper = {{ShaperType::kMzv, 40.0, 0.1},
                                 {ShaperType::kMzv, 50.0, 0.1},
                                 {ShaperType::kMzv, 60.0, 0.1}};
       },
       "axes/x/input_shaper: divides each motion into 27 parts, but may divide it into 16 at most"},
      {[](Axes& axes) { axes[1].name = "x"; },
       "axes: has an axis named \"x\" twice, but each must have a name of its own\n"},
      {[](Axes& axes) { axes[1].name = "y z"; },
       "axes/y z: has the name \"y z\", but an axis's name must begin with a letter"},
      {[](Axes& axes) {
         axes[0].motor = "left", axes[0].twins = {axes[1], axes[1]};
         axes[0].twins[0].motor = axes[0].twins[1].motor = "right";
       },
       "axes/x/motors: has a motor named \"right\" twice, but each must have a name of its own\n"},
      {[](Axes& axes) {
         share(axes, {"x", "z"}, {{1.0, 1.0}, {1.0, -1.0}});
       },
       "axes/x/kinematics: has x and z, but must name this axis and others that have the same one"},
      {[](Axes& axes) {
         share(axes, {"x", "y"}, {{1.0}});
       },
       "kinematics/matrix: has 1 motors, but must have as many as there are axes, 2\n"},
      {[](Axes& axes) {
         share(axes, {"x", "y"}, {{1.0, 1.0}, {1.0, 1.0}});
       },
       "kinematics/matrix: is singular"},
      {[](Axes& axes) {
         share(axes, {"x", "y"}, {{1.0, 1.0}, {1.0, 0.999}});
       },
       "kinematics/matrix: has the condition"},
      {[](Axes& axes) {
         share(axes, {"x", "y"}, {{1.0, 1.0}, {1.0, -1.0}});
         axes[1].idle_timeout = 1.0;
       },
       "kinematics/axes: has y with idle_timeout_s, which it must not have"},
      {[](Axes& axes) {
         auto shared = std::make_shared<Kinematics>();
         *shared = {{"x", "y"}, {{1.0, 1.0}, {1.0, -1.0}}, {{0.5, 0.5}, {0.5, 0.5}}};
         axes[0].homing.reset();
         axes[0].kinematics = axes[1].kinematics = shared;
       },
       "kinematics/inverse: must be the inverse of the matrix"},
  };
  return all;
}

TEST(CheckAxes, KnowsTheRulesOfAConfigurationFile) {
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

// Values at the ends of what a file may say are the same after they were converted to SI and back.
TEST(CheckAxes, TakesWhatAFileMayContain) {
  for (const bool at_most : {false, true}) {
    Axes axes = goodAxes();
    axes[0].homing.reset();
    for (AxisConfig& axis : axes) {
      axis.driver.timing.step_high_ns = axis.driver.timing.step_low_ns = 500'000'000;
      axis.driver.timing.dir_hold_ns = 0;
      axis.steps_per_unit = (at_most ? 1e9 : 1e-9) * configUnitsPerUnit(axis.kind);
      const double unit = 1.0 / axis.steps_per_unit;
      axis.max_speed = (at_most ? 1.0 : kLowestRate) * unit;
      axis.start_speed = axis.max_speed;
      axis.acceleration = axis.deceleration = (at_most ? 1e12 : kLowestAcceleration) * unit;
      axis.jerk = (at_most ? 1e15 : kLowestJerk) * unit;
      axis.backlash = at_most ? 1e6 * unit : 0.0;
      axis.min_position = -9007199254740992.0 * unit;
      axis.max_position = 9007199254740992.0 * unit;
      axis.idle_timeout = at_most ? 86'400.0 : 0.0;
    }
    EXPECT_EQ(mistakesOf([&](Axes& checked) { checked = axes; }), "");
  }
}

struct WrongOption {
  std::function<void(machine::MachineOptions&)> change;
  const char* issue;
};

TEST(CheckConfiguration, KnowsTheRulesOfAConfigurationFileForOptionsToo) {
  using machine::MachineOptions;
  const std::vector<WrongOption> wrongs_of_options = {
      {[](MachineOptions& options) { options.max_lateness = test::kNan; },
       "realtime/max_lateness_ms: is nan, but must be"},
      {[](MachineOptions& options) { options.late_steps = 0.6; },
       "realtime/late_steps: is 0.6, but must be from 0 to 0.5"},
      {[](MachineOptions& options) { options.max_lateness = 0.0; },
       "realtime/max_lateness_ms: is 0.0, but must be above 0 and at most 60000"},
      {[](MachineOptions& options) { options.write_timeout = 0.001; },
       "gpio/write_timeout_ms: is 1.0, but must be from 10 to 60000"},
      {[](MachineOptions& options) { options.record_seconds = -1.0; },
       "recorder/seconds: is -1.0, but must be from 0 to 600"},
      {[](MachineOptions& options) {
         options.record_seconds = 1.0, options.record_bytes = std::size_t{1} << 62;
       },
       "recorder/memory_mb: is"},
      {[](MachineOptions& options) { options.realtime.cpu = -1; },
       "realtime/cpu: is -1, but must be from 0 to 1023"},
      {[](MachineOptions& options) { options.state_file = "positions"; },
       "state_file: is \"positions\", but must be an absolute path"},
      {[](MachineOptions& options) {
         options.heartbeat = machine::HeartbeatConfig{"beat", 0.0};
       },
       "heartbeat/rate_hz: is 0.0, but must be from 1 to 1000"},
      {[](MachineOptions& options) { options.heartbeat = machine::HeartbeatConfig{"x.step"}; },
       "heartbeat/pin: is \"x.step\", which is used twice: it is axes/x/pins/step already"},
      {[](MachineOptions& options) { options.emergency_stop = InputSwitch{""}; },
       "emergency_stop/pin: is \"\", but must be a line"},
      {[](MachineOptions& options) {
         options.motor_power.emplace();
         options.motor_power->line = "power", options.motor_power->on_ns = -1;
       },
       "motor_power/on_ms: is"},
  };
  pulse::VirtualClock clock;
  sim::Rig rig({});
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  for (const WrongOption& wrong : wrongs_of_options) {
    MachineOptions options;
    wrong.change(options);
    try {
      const test::UnthreadedMachine made(goodAxes(), backend, clock, options);
      ADD_FAILURE() << wrong.issue;
    } catch (const ConfigError& error) {
      EXPECT_NE(std::string(error.what()).find(wrong.issue), std::string::npos) << error.what();
    }
  }
}

}  // namespace
}  // namespace stepdriver::config
