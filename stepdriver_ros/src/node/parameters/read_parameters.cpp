#include "read_parameters.h"

#include <fmt/format.h>
#include <ros/console.h>
#include <ros/param.h>

#include <string>
#include <vector>

#include "common/node_start.h"
#include "common/xmlrpc_value.h"
#include "robot_description.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

/// @return warnings.
std::vector<std::string> applyDescriptionParameter(const ros::NodeHandle& node,
                                                   std::vector<config::AxisConfig>& axes,
                                                   std::vector<ConfigIssue>& issues) {
  std::string name;
  XmlRpc::XmlRpcValue value;
  if (!node.searchParam("robot_description", name) || !ros::param::get(name, value)) {
    ROS_INFO_NAMED(
        "limits", "There is no robot_description: the limits are those of the axes' configuration");
    return {};
  }
  const config::ConfigValue description = configValue(value);
  const auto* urdf = description.as<std::string>();
  if (urdf == nullptr) {
    issues.push_back(
        {name, fmt::format("is {}, but must be the XML of a URDF", description.shown())});
    return {};
  }
  return applyRobotDescription(*urdf, name, axes, issues);
}

}  // namespace

NodeConfig readParameters(const ros::NodeHandle& node, const ros::NodeHandle& private_node) {
  std::vector<ConfigIssue> issues;
  const std::string& name = private_node.getNamespace();
  const config::ConfigValue tree = privateParameters(private_node);
  NodeConfig config = readNodeConfig(tree, name, issues);
  // Values that depend on the axes can be checked only if the axes are right.
  if (!issues.empty()) throw ConfigError(issues);
  std::vector<std::string> warnings;
  if (config.urdf_limits) warnings = applyDescriptionParameter(node, config.axes, issues);
  if (issues.empty() && config.backend == setup::GpioBackend::kSimulated) {
    setup::checkSimulation(config.axes, config.simulation, name + "/simulation", issues);
  }
  if (!issues.empty()) throw ConfigError(issues);
  for (const config::AxisConfig& axis : config.axes) {
    ROS_INFO_NAMED("limits", "%s", limitsText(axis).c_str());
  }
  for (const std::string& warning : warnings) ROS_WARN_NAMED("limits", "%s", warning.c_str());
  return config;
}

}  // namespace stepdriver::ros_node
