#include <console_bridge/console.h>
#include <fmt/format.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "common/robot_description.h"
#include "fuzz/fuzz_input.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"

// The input is a robot description. It only tightens the limits of the axes, and with the limits
// that are left the machine starts and moves.

namespace stepdriver::fuzz {
namespace {

using config::AxisConfig;

/// One with soft limits, one without, and one that turns without end.
std::vector<AxisConfig> axes() {
  AxisConfig x = test::linearAxis("x", 1000.0, 0.1, 1.0);
  x.joint = "x_joint";
  x.min_position = -0.05;
  x.max_position = 0.1;
  AxisConfig y = test::linearAxis("y", 1000.0, 0.1, 1.0);
  y.joint = "y_joint";
  y.start_speed = 0.01;
  AxisConfig turntable = test::linearAxis("turntable", 200.0, 1.0, 10.0);
  turntable.kind = config::Kind::kRotary;
  turntable.joint = "turntable_joint";
  std::vector<AxisConfig> all{x, y, turntable};
  for (AxisConfig& axis : all) {
    axis.endstop_min.reset();
    axis.endstop_max.reset();
  }
  return all;
}

void checkTightened(const AxisConfig& before, const AxisConfig& after) {
  const std::string& name = before.name;
  require(after.max_speed > 0.0 && after.max_speed <= before.max_speed,
          fmt::format("the speed of {} isn't raised to {}", name, after.max_speed));
  require(after.max_speed * after.steps_per_unit >= config::kLowestRate * (1.0 - 1e-4),
          fmt::format("the speed {} of {} is one that can be timed", after.max_speed, name));
  require(after.start_speed <= after.max_speed, name + " starts within its speed");
  require(
      !before.min_position || (after.min_position && *after.min_position >= *before.min_position),
      name + " doesn't get a lower min limit");
  require(
      !before.max_position || (after.max_position && *after.max_position <= *before.max_position),
      name + " doesn't get a higher max limit");
  require(!after.min_position || !after.max_position || *after.min_position < *after.max_position,
          name + " has a min limit below its max limit");
}

/// Tries moves and jogs with these limits.
void move(const std::vector<AxisConfig>& configs) {
  test::Bench bench(configs);
  for (const AxisConfig& config : configs) {
    // A stop ends on a microstep: at the lowest speeds, minutes later.
    if (config.max_speed * config.steps_per_unit < 10.0) continue;
    axis::Axis& axis = bench.axis(config.name);
    for (const double sign : {1.0, -1.0}) {
      try {
        axis.jog(sign * config.max_speed);
        bench.machine->advance(0.02);
        const axis::AxisState state = axis.state();
        require(std::isfinite(state.target) && std::isfinite(state.time_left),
                config.name + " jogs to a place that it can tell");
        axis.stop();
        bench.machine->advance(0.5);
        require(!axis.state().moving, config.name + " stops");
      } catch (const Refused& refused) {
        requireMessage(refused.what());
      }
    }
    require(test::violationsOf(bench.report(config.name)).empty(), "the chip sees no violation");
  }
}

}  // namespace
}  // namespace stepdriver::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): the name that libFuzzer calls
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stepdriver;
  console_bridge::noOutputHandler();
  const std::string urdf(reinterpret_cast<const char*>(data), size);
  const std::vector<config::AxisConfig> before = fuzz::axes();
  std::vector<config::AxisConfig> after = before;
  std::vector<ConfigIssue> issues;
  const auto warnings = ros_node::applyRobotDescription(urdf, "/robot_description", after, issues);
  for (const std::string& warning : warnings) fuzz::requireMessage(warning);
  for (const ConfigIssue& issue : issues) fuzz::requireMessage(issue.message);
  if (!issues.empty()) return 0;
  for (std::size_t i = 0; i < before.size(); ++i) {
    fuzz::checkTightened(before[i], after[i]);
    fuzz::requireMessage(ros_node::limitsText(after[i]));
  }
  fuzz::move(after);
  return 0;
}
