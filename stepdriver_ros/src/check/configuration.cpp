#include "configuration.h"

#include <utility>
#include <vector>

#include "common/text.h"
#include "setup/read_machine_config.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/yaml.h"
#include "table.h"

namespace stepdriver::check {
namespace {

using ros_node::roundedText;
using ros_node::rpmText;

std::string speedText(const config::AxisConfig& axis) {
  return roundedText(axis.max_speed * config::configUnitsPerUnit(axis.kind)) +
         (axis.kind == config::Kind::kLinear ? " mm/s" : " deg/s");
}

std::string endstopsText(const config::AxisConfig& axis) {
  const bool has_min = axis.hasEndstop(false);
  const bool has_max = axis.hasEndstop(true);
  if (has_min && has_max) return "min and max";
  if (has_min) return "min";
  return has_max ? "max" : "none";
}

}  // namespace

ros_node::NodeConfig readConfiguration(const std::string& path, BackendChoice choice) {
  config::ConfigValue tree = yaml::load(path);
  setup::chooseBackend(tree, choice);
  std::vector<ConfigIssue> issues;
  ros_node::NodeConfig config = ros_node::readNodeConfig(tree, "", issues);
  setup::throwIssues(std::move(issues));
  return config;
}

std::string configurationText(const ros_node::NodeConfig& config) {
  std::vector<std::vector<std::string>> rows = {
      {"axis", "driver", "kind", "microsteps", "top speed", "steps/s", "rpm", "endstops"}};
  for (const config::AxisConfig& axis : config.axes) {
    const double rate = axis.max_speed * axis.steps_per_unit;
    rows.push_back({axis.name, axis.driverTitles(),
                    axis.kind == config::Kind::kLinear ? "linear" : "rotary",
                    std::to_string(axis.microsteps), speedText(axis), roundedText(rate),
                    rpmText(rate, axis.steps_per_round), endstopsText(axis)});
  }
  return table(rows);
}

}  // namespace stepdriver::check
