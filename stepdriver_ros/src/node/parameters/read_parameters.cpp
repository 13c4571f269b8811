#include "read_parameters.h"

#include <fmt/format.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <string>
#include <utility>
#include <vector>

#include "common/description_parameter.h"
#include "common/node_start.h"
#include "common/robot_description.h"
#include "common/xmlrpc_value.h"
#include "config/config_reader.h"
#include "setup/read_machine_config.h"
#include "setup/read_simulation.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

constexpr const char* kActionStatusFrequency = "actionlib_status_frequency";
constexpr config::Range kActionStatusFrequencies{0.0, 1000.0};
constexpr double kLowestActionStatusFrequency = 0.01;

void readActionStatusFrequency(Parameters& parameters, std::vector<ConfigIssue>& issues) {
  std::string name;
  XmlRpc::XmlRpcValue value;
  if (!ros::param::search(ros::this_node::getNamespace(), kActionStatusFrequency, name) ||
      !ros::param::get(name, value)) {
    return;
  }
  const config::ConfigValue tree(
      config::ConfigValue::Map{{kActionStatusFrequency, configValue(value)}});
  config::ConfigReader reader(tree, name.substr(0, name.rfind('/')), issues);
  const auto frequency = reader.findNumber(kActionStatusFrequency, kActionStatusFrequencies,
                                           config::Presence::kOptional);
  if (!frequency) return;
  if (*frequency > 0.0 && *frequency < kLowestActionStatusFrequency) {
    reader.issue(kActionStatusFrequency,
                 fmt::format("is {}, but must be 0, so that no status is published, or at least {}",
                             reader.shown(kActionStatusFrequency), kLowestActionStatusFrequency));
    return;
  }
  parameters.action_status_frequency = *frequency;
}

}  // namespace

Parameters readParameters() {
  std::vector<ConfigIssue> issues;
  const std::string& name = ros::this_node::getName();
  const config::ConfigValue tree = privateParameters(name);
  Parameters parameters;
  NodeConfig& config = parameters.config;
  config = readNodeConfig(tree, name, issues);
  readActionStatusFrequency(parameters, issues);
  // Values that depend on the axes can be checked only if the axes are right.
  if (!issues.empty()) throw ConfigError(issues);
  if (config.urdf_limits) {
    const auto warnings =
        applyDescriptionParameter(ros::this_node::getNamespace(), config.axes, issues);
    if (warnings) {
      parameters.warnings = *warnings;
    } else {
      parameters.notes.emplace_back(
          "There is no robot_description: the limits are those of the axes' configuration");
    }
  }
  if (issues.empty() && config.backend == setup::GpioBackend::kSimulated) {
    setup::checkSimulation(config.axes, config.simulation, name + "/simulation", issues);
  }
  if (!issues.empty()) throw ConfigError(issues);
  for (std::string& warning : config::homingWarnings(config.axes)) {
    parameters.warnings.push_back(std::move(warning));
  }
  for (const config::AxisConfig& axis : config.axes) parameters.notes.push_back(limitsText(axis));
  return parameters;
}

}  // namespace stepdriver::ros_node
