// The configurations of config/ on the rig, each axis as fast as it may.
#include <gtest/gtest.h>

#include <algorithm>
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

class ShippedConfiguration : public testing::TestWithParam<const char*> {};

TEST_P(ShippedConfiguration, LosesNoStep) {
  setup::MachineConfig config =
      readFile(std::string(STEPDRIVER_CONFIGS "/") + GetParam(), setup::BackendChoice::kSimulated);
  config.simulation.speed = 0.0;
  config.simulation.trace.clear();
  config.state_file.clear();
  setup::Hardware hardware(config);
  machine::MachineOptions options = config.options();
  test::UnthreadedMachine machine(config.axes, hardware.backend(), hardware.clock(), options);
  for (const config::AxisConfig& axis_config : config.axes) {
    axis::Axis& axis = machine.axis(axis_config.name);
    axis.enable(true);
    if (axis_config.homing) {
      const axis::HomingResult homed = axis.home();
      EXPECT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
    }
    const double range = axis_config.kind == config::Kind::kLinear ? 0.2 : 6.0;
    const double low = axis_config.min_position.value_or(-range);
    const double high = axis_config.max_position.value_or(range);
    for (const double target : {low, high, 0.5 * (low + high)}) {
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

INSTANTIATE_TEST_SUITE_P(Shipped, ShippedConfiguration,
                         testing::Values("a4988.yaml", "board.yaml", "camera.yaml", "corexy.yaml",
                                         "drv8825.yaml", "gantry.yaml", "pen_plotter.yaml",
                                         "plotter.yaml", "rotary_axis.yaml", "tb6600.yaml",
                                         "tmc2209.yaml", "tmc5160.yaml", "two_axes.yaml",
                                         "uln2003.yaml", "wheel.yaml"));

}  // namespace
}  // namespace stepdriver::yaml
