#include "read_parameters.h"

#include <fmt/format.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <string>
#include <vector>

#include "common/node_start.h"
#include "common/xmlrpc_value.h"
#include "robot_description.h"
#include "stepdriver_core/config/config_reader.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

constexpr const char* kActionStatusFrequency = "actionlib_status_frequency";
constexpr config::Range kActionStatusFrequencies{0.0, 1000.0};
constexpr double kLowestActionStatusFrequency = 0.01;

void applyDescriptionParameter(Parameters& parameters, std::vector<ConfigIssue>& issues) {
  std::string name;
  XmlRpc::XmlRpcValue value;
  if (!ros::param::search(ros::this_node::getNamespace(), "robot_description", name) ||
      !ros::param::get(name, value)) {
    parameters.notes.emplace_back(
        "There is no robot_description: the limits are those of the axes' configuration");
    return;
  }
  const config::ConfigValue description = configValue(value);
  const auto* urdf = description.as<std::string>();
  if (urdf == nullptr) {
    issues.push_back(
        {name, fmt::format("is {}, but must be the XML of a URDF", description.shown())});
    return;
  }
  parameters.warnings = applyRobotDescription(*urdf, name, parameters.config.axes, issues);
}

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
  if (config.urdf_limits) applyDescriptionParameter(parameters, issues);
  if (issues.empty() && config.backend == setup::GpioBackend::kSimulated) {
    setup::checkSimulation(config.axes, config.simulation, name + "/simulation", issues);
  }
  if (!issues.empty()) throw ConfigError(issues);
  for (const config::AxisConfig& axis : config.axes) parameters.notes.push_back(limitsText(axis));
  return parameters;
}

}  // namespace stepdriver::ros_node
