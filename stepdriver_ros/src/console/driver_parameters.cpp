#include "driver_parameters.h"

#include <ros/master.h>
#include <ros/message_traits.h>
#include <ros/names.h>
#include <stepdriver/AxisStates.h>

#include <algorithm>

#include "common/node_config.h"
#include "common/node_start.h"

namespace stepdriver::console {

DriverParameters readDriverParameters(const std::string& driver) {
  std::vector<ConfigIssue> issues;
  ros_node::NodeConfig config = ros_node::readNodeConfig(
      ros_node::privateParameters(ros::names::resolve(driver)), driver, issues);
  if (!issues.empty()) throw ConfigError(issues);
  return {std::move(config.axes), config.jog_timeout};
}

std::vector<std::string> runningDrivers() {
  static const std::string topic = "/axis_states";
  ros::master::V_TopicInfo topics;
  std::vector<std::string> drivers;
  if (!ros::master::getTopics(topics)) return drivers;
  for (const ros::master::TopicInfo& info : topics) {
    if (info.datatype != ros::message_traits::datatype<AxisStates>()) continue;
    if (info.name.size() <= topic.size()) continue;
    drivers.push_back(info.name.substr(0, info.name.size() - topic.size()));
  }
  std::sort(drivers.begin(), drivers.end());
  return drivers;
}

}  // namespace stepdriver::console
