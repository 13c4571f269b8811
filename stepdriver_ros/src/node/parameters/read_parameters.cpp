#include "read_parameters.h"

#include <fmt/format.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <string>
#include <vector>

#include "common/node_start.h"
#include "common/xmlrpc_value.h"
#include "robot_description.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

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

}  // namespace

Parameters readParameters() {
  std::vector<ConfigIssue> issues;
  const std::string& name = ros::this_node::getName();
  const config::ConfigValue tree = privateParameters(name);
  Parameters parameters;
  NodeConfig& config = parameters.config;
  config = readNodeConfig(tree, name, issues);
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
