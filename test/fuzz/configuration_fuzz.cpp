#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "common/node_config.h"
#include "fuzz/fuzz_input.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/hardware.h"
#include "stepdriver_core/yaml.h"
#include "support/unthreaded_machine.h"

// The input is a configuration file. It is refused with messages of one line, or every number in it
// is within its bounds, and its machine starts on the rig and moves.

namespace stepdriver::fuzz {
namespace {

using config::AxisConfig;
using config::ConfigValue;

// Limits that are computed in two ways may differ by this part.
constexpr double kRounding = 1e-6;

bool same(const ConfigValue& a, const ConfigValue& b) {
  const auto* list = a.as<ConfigValue::List>();
  const auto* other_list = b.as<ConfigValue::List>();
  if (list != nullptr && other_list != nullptr) {
    if (list->size() != other_list->size()) return false;
    for (std::size_t i = 0; i < list->size(); ++i) {
      if (!same((*list)[i], (*other_list)[i])) return false;
    }
    return true;
  }
  const auto* map = a.as<ConfigValue::Map>();
  const auto* other_map = b.as<ConfigValue::Map>();
  if (map != nullptr && other_map != nullptr) {
    if (map->size() != other_map->size()) return false;
    for (auto i = map->begin(), j = other_map->begin(); i != map->end(); ++i, ++j) {
      if (i->first != j->first || !same(i->second, j->second)) return false;
    }
    return true;
  }
  if (const auto* number = a.as<double>()) {
    const auto* other = b.as<double>();
    return other != nullptr && (*number == *other || (std::isnan(*number) && std::isnan(*other)));
  }
  if (const auto* text = a.as<std::string>()) {
    const auto* other = b.as<std::string>();
    return other != nullptr && *text == *other;
  }
  return a.shown() == b.shown();
}

std::optional<ConfigValue> parsed(const std::string& text) {
  try {
    return yaml::parse(text, "input.yaml");
  } catch (const Error& error) {
    requireMessage(error.what());
    require(std::string(error.what()).rfind("input.yaml:", 0) == 0,
            fmt::format("a refusal names the file: {}", error.what()));
    return std::nullopt;
  }
}

void checkText(const ConfigValue& tree) {
  const std::string text = yaml::textOf(tree);
  const auto again = parsed(text);
  require(again && same(tree, *again),
          "a configuration that is written is read as the same: " + text);
}

void checkRange(const std::string& what, double value, double least, double most) {
  require(value >= least * (1.0 - kRounding) && value <= most * (1.0 + kRounding),
          fmt::format("{} is {:.17g}, from {:.17g} to {:.17g}", what, value, least, most));
}

void checkHoming(const AxisConfig& axis) {
  const config::HomingConfig& homing = *axis.homing;
  if (homing.kind == config::HomingKind::kDirect) return;
  const bool is_limit = homing.kind == config::HomingKind::kLimit;
  require(!is_limit || (homing.at_max ? axis.endstop_max : axis.endstop_min).has_value(),
          axis.name + " has the switch of its homing");
  checkRange("seek_speed", homing.seek_speed, 1e-300, axis.max_speed);
  checkRange("latch_speed", homing.latch_speed, is_limit ? 1e-300 : 0.0, homing.seek_speed);
  checkRange("pull_off", homing.pull_off, 0.0, homing.max_travel);
  checkRange("max_travel", homing.max_travel * axis.steps_per_unit, 0.0, 1099511627776.0);
  checkRange("timeout", homing.timeout, 0.0, 86'400.0);
  checkRange("debounce", homing.debounce, 0.0, 1.0);
}

void checkAxis(const AxisConfig& axis) {
  const double scale = axis.steps_per_unit;
  const driver::DriverChip& chip = axis.driver;
  require(std::isfinite(scale) && scale > 0.0, axis.name + " has a scale above 0");
  bool known = false;
  for (const int mode : chip.microsteps) known = known || mode == axis.microsteps;
  require(known, axis.name + " has a microstep mode of its chip");
  const auto period = static_cast<double>(chip.timing.step_high_ns + chip.timing.step_low_ns);
  checkRange("max_speed", axis.max_speed * scale, config::kLowestRate, 1e9 / period);
  checkRange("start_speed", axis.start_speed, 0.0, axis.max_speed);
  checkRange("acceleration", axis.acceleration * scale, config::kLowestAcceleration, 1e12);
  checkRange("deceleration", axis.deceleration * scale, config::kLowestAcceleration, 1e12);
  if (axis.stop_deceleration) {
    checkRange("stop_deceleration", *axis.stop_deceleration * scale, axis.deceleration * scale,
               1e12);
  }
  if (axis.jerk != 0.0) checkRange("jerk", axis.jerk * scale, config::kLowestJerk, 1e15);
  checkRange("backlash", axis.backlash * scale, 0.0, 1e6);
  for (const auto& limit : {axis.min_position, axis.max_position}) {
    if (limit) checkRange("a soft limit", std::abs(*limit) * scale, 0.0, 9007199254740992.0);
  }
  require(!axis.min_position || !axis.max_position || *axis.min_position < *axis.max_position,
          axis.name + " has a min limit below its max limit");
  require(std::isfinite(axis.idle_timeout) && axis.idle_timeout >= 0.0,
          axis.name + " has an idle timeout of at least 0");
  require(!axis.require_homing || axis.homing, axis.name + " has the homing that it requires");
  if (axis.homing) checkHoming(axis);
}

void checkConfig(const ros_node::NodeConfig& config) {
  require(!config.axes.empty(), "there is an axis");
  std::set<std::string> joints;
  for (const AxisConfig& axis : config.axes) {
    require(joints.insert(axis.joint).second, "each axis has a joint of its own");
    checkAxis(axis);
  }
  checkRange("joint_state_rate", config.joint_state_rate, 1.0, 1000.0);
  checkRange("jog_timeout", config.jog_timeout, 0.02, 60.0);
  checkRange("setpoint/timeout", config.setpoint_timeout, 0.02, 60.0);
  require(std::isfinite(config.simulation.speed) && config.simulation.speed >= 0.0,
          "the speed of the simulation is at least 0");
}

/// Moves an axis by three steps, if that doesn't take too many passes of the virtual clock.
void moveThreeSteps(axis::Axis& axis) {
  const AxisConfig& config = axis.config();
  const double scale = config.steps_per_unit;
  if (config.max_speed * scale < 1.0 || config.acceleration * scale < 1.0 ||
      config.deceleration * scale < 1.0 || (config.jerk > 0.0 && config.jerk * scale < 1.0)) {
    return;
  }
  try {
    const axis::MoveResult result = axis.wait(axis.moveTo(3.0 / scale, true));
    require(std::isfinite(result.position) && std::isfinite(result.duration),
            axis.config().name + " ends at a place and a time");
  } catch (const Error& error) {
    requireMessage(error.what());
  }
}

void startMachine(ros_node::NodeConfig config) {
  config.simulation.speed = 0.0;
  config.simulation.trace.clear();
  config.state_file.clear();
  setup::Simulation simulation(config.axes, config.emergency_stop, config.motor_power,
                               config.simulation);
  machine::MachineOptions options = config.options();
  test::UnthreadedMachine machine(config.axes, simulation.backend(), simulation.clock(), options);
  for (const auto& axis : machine.axes()) {
    const axis::AxisState state = axis->state();
    require(std::isfinite(state.position) && !state.moving, "an axis is at rest at the start");
    moveThreeSteps(*axis);
    if (config.simulation.axes.at(axis->config().name).fail_step_write_after) continue;
    const auto report = simulation.rig().report(axis->config().name);
    require(report.violations.empty(), axis->config().name + " keeps the times of its chip");
  }
}

void readConfig(ConfigValue tree, setup::BackendChoice choice) {
  setup::chooseBackend(tree, choice);
  std::vector<ConfigIssue> issues;
  ros_node::NodeConfig config = ros_node::readNodeConfig(tree, "/stepdriver", issues);
  for (const ConfigIssue& issue : issues) {
    requireMessage(issue.key);
    requireMessage(issue.message);
  }
  if (!issues.empty()) return;
  checkConfig(config);
  if (config.backend == setup::GpioBackend::kSimulated && config.axes.size() <= 6) {
    startMachine(std::move(config));
  }
}

}  // namespace
}  // namespace stepdriver::fuzz

// NOLINTNEXTLINE(readability-identifier-naming): the name that libFuzzer calls
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace stepdriver;
  const std::string text(reinterpret_cast<const char*>(data), size);
  const auto tree = fuzz::parsed(text);
  if (!tree) return 0;
  // yaml-cpp replaces what isn't UTF-8 when it writes.
  const bool is_ascii =
      std::all_of(data, data + size, [](std::uint8_t byte) { return byte < 128; });
  if (is_ascii) fuzz::checkText(*tree);
  fuzz::readConfig(*tree, setup::BackendChoice::kAsInTheFile);
  fuzz::readConfig(*tree, setup::BackendChoice::kSimulated);
  return 0;
}
