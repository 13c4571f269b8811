#include "configuration.h"

#include <vector>

#include "../text.h"
#include "stepdriver_core/chip/chip.h"
#include "stepdriver_core/error.h"
#include "table.h"
#include "yaml_value.h"

namespace stepdriver::check {
namespace {

using axis::ConfigValue;
using ros_node::numberText;

ConfigValue* childOf(ConfigValue& tree, const std::string& key) {
  auto* map = tree.as<ConfigValue::Map>();
  if (map == nullptr || map->count(key) == 0) return nullptr;
  return &map->at(key);
}

/// Writes the backend that is meant into the tree. What else is wrong there stays.
void choose(ConfigValue& tree, BackendChoice choice) {
  auto* map = tree.as<ConfigValue::Map>();
  if (map == nullptr) return;
  auto* gpio = map->emplace("gpio", ConfigValue::Map{}).first->second.as<ConfigValue::Map>();
  if (gpio == nullptr) return;
  if (choice == BackendChoice::kAsInTheFile) {
    gpio->emplace("backend", "libgpiod");
    return;
  }
  const bool simulated = choice == BackendChoice::kSimulated;
  (*gpio)["backend"] = simulated ? "simulated" : "libgpiod";
  // Real lines have no trace, and the node says so: here nobody asked for both.
  ConfigValue* simulation = simulated ? nullptr : childOf(tree, "simulation");
  if (simulation != nullptr && simulation->as<ConfigValue::Map>() != nullptr) {
    simulation->as<ConfigValue::Map>()->erase("trace");
  }
}

std::string speedText(const axis::AxisConfig& axis) {
  return numberText(axis.max_speed * axis::configUnitsPerUnit(axis.kind)) +
         (axis.kind == axis::Kind::kLinear ? " mm/s" : " deg/s");
}

std::string endstopsText(const axis::AxisConfig& axis) {
  if (axis.endstop_min && axis.endstop_max) return "min and max";
  if (axis.endstop_min) return "min";
  return axis.endstop_max ? "max" : "none";
}

}  // namespace

ros_node::NodeConfig readConfiguration(const std::string& path, BackendChoice choice) {
  ConfigValue tree = loadYaml(path);
  choose(tree, choice);
  std::vector<ConfigIssue> issues;
  ros_node::NodeConfig config = ros_node::readNodeConfig(tree, "", issues);
  if (issues.empty()) return config;
  // Names of parameters begin below the node.
  for (ConfigIssue& issue : issues) issue.key.erase(0, issue.key.find_first_not_of('/'));
  throw ConfigError(issues);
}

std::string configurationText(const ros_node::NodeConfig& config) {
  std::vector<std::vector<std::string>> rows = {
      {"axis", "driver", "kind", "microsteps", "top speed", "steps/s", "endstops"}};
  for (const axis::AxisConfig& axis : config.axes) {
    rows.push_back({axis.name, chip::chipOf(axis.driver).title,
                    axis.kind == axis::Kind::kLinear ? "linear" : "rotary",
                    std::to_string(axis.microsteps), speedText(axis),
                    numberText(axis.max_speed * axis.steps_per_unit), endstopsText(axis)});
  }
  return table(rows);
}

}  // namespace stepdriver::check
