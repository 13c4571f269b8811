#include "description_parameter.h"

#include <fmt/format.h>
#include <ros/param.h>

#include "robot_description.h"
#include "xmlrpc_value.h"

namespace stepdriver::ros_node {

std::optional<std::vector<std::string>> applyDescriptionParameter(
    const std::string& name_space, std::vector<config::AxisConfig>& axes,
    std::vector<ConfigIssue>& issues) {
  std::string name;
  XmlRpc::XmlRpcValue value;
  if (!ros::param::search(name_space, "robot_description", name) || !ros::param::get(name, value)) {
    return {};
  }
  const config::ConfigValue description = configValue(value);
  const auto* urdf = description.as<std::string>();
  if (urdf == nullptr) {
    issues.push_back(
        {name, fmt::format("is {}, but must be the XML of a URDF", description.shown())});
    return std::vector<std::string>();
  }
  return applyRobotDescription(*urdf, name, axes, issues);
}

}  // namespace stepdriver::ros_node
