// The configurations of config/ on the rig, each axis as fast as it may.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "stepdriver_core/setup/hardware.h"
#include "stepdriver_core/yaml.h"
#include "support/bench.h"

namespace stepdriver::yaml {
namespace {

/// Its rotor has been blocked.
bool isHomedToAStall(const std::vector<config::AxisConfig>& axes, const std::string& name) {
  return std::any_of(axes.begin(), axes.end(), [&name](const config::AxisConfig& axis) {
    return axis.name == name && axis.homing && axis.homing->kind == config::HomingKind::kStall;
  });
}

class ShippedConfiguration : public testing::TestWithParam<const char*> {
 protected:
  static setup::MachineConfig read() {
    setup::MachineConfig config = readFile(std::string(STEPDRIVER_CONFIGS "/") + GetParam(),
                                           setup::BackendChoice::kSimulated);
    config.simulation.speed = 0.0;
    config.simulation.trace.clear();
    config.state_file.clear();
    return config;
  }

  /// Enables the axes; each that can be homed is.
  void bringUp() {
    for (const config::AxisConfig& axis_config : config.axes) {
      axis::Axis& axis = machine.axis(axis_config.name);
      axis.enable(true);
      if (!axis_config.homing) continue;
      const axis::HomingResult homed = axis.home();
      EXPECT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
    }
  }

  static double low(const config::AxisConfig& axis) {
    return axis.min_position.value_or(-rangeOf(axis));
  }
  static double high(const config::AxisConfig& axis) {
    return axis.max_position.value_or(rangeOf(axis));
  }

  setup::MachineConfig config = read();
  setup::Hardware hardware{config};
  test::UnthreadedMachine machine{config.axes, hardware.backend(), hardware.clock(),
                                  config.options()};

 private:
  static double rangeOf(const config::AxisConfig& axis) {
    return axis.kind == config::Kind::kLinear ? 0.2 : 6.0;
  }
};

TEST_P(ShippedConfiguration, LosesNoStep) {
  bringUp();
  for (const config::AxisConfig& axis_config : config.axes) {
    axis::Axis& axis = machine.axis(axis_config.name);
    const double begin = low(axis_config);
    const double end = high(axis_config);
    for (const double target : {begin, end, 0.5 * (begin + end)}) {
      const axis::MoveResult result = axis.wait(axis.moveTo(target));
      EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
    }
  }
  sim::Rig& rig = hardware.simulation()->rig();
  for (const std::string& name : rig.axes()) {
    const sim::RigAxisReport seen = rig.report(name);
    EXPECT_EQ(seen.totalViolations(), 0) << name << ": " << test::violationsOf(seen);
    if (isHomedToAStall(config.axes, name)) continue;
    EXPECT_EQ(seen.lost_steps, 0) << name << ", largest lag " << seen.largest_lag;
    EXPECT_GT(seen.largest_lag, 1.0) << name;
    EXPECT_LT(seen.largest_lag, 120.0) << name;
  }
}

// A homing leaves microsteps beside the round positions, and these in the middle of two.
TEST_P(ShippedConfiguration, ReachesTheEndsOfStraightLinesAfterItsHoming) {
  bringUp();
  motion::LineRequest line;
  for (const config::AxisConfig& axis : config.axes) line.names.push_back(axis.name);
  for (const double part : {0.5, 0.25, 0.3, 0.7, 0.4}) {
    line.positions.clear();
    for (const config::AxisConfig& axis : config.axes) {
      const double at = low(axis) + part * (high(axis) - low(axis));
      line.positions.push_back(0.001 * std::round(1e3 * at));
    }
    const machine::CoordinatedResult result = machine.wait(machine.moveLine(line));
    EXPECT_EQ(result.end, axis::MoveEnd::kReached) << part << ": " << result.message;
    EXPECT_NE(result.message, "");
  }
}

INSTANTIATE_TEST_SUITE_P(Shipped, ShippedConfiguration,
                         testing::Values("a4988.yaml", "board.yaml", "camera.yaml", "corexy.yaml",
                                         "drv8825.yaml", "gantry.yaml", "pen_plotter.yaml",
                                         "plotter.yaml", "rotary_axis.yaml", "shared_switch.yaml",
                                         "tb6600.yaml", "tmc2209.yaml", "tmc5160.yaml",
                                         "two_axes.yaml", "uln2003.yaml", "wheel.yaml"));

}  // namespace
}  // namespace stepdriver::yaml
