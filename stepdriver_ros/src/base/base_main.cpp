#include <ros/init.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <memory>
#include <string>
#include <vector>

#include "base.h"
#include "base_config.h"
#include "common/client_node.h"
#include "common/description_parameter.h"
#include "common/end_requests.h"
#include "common/node_config.h"
#include "common/node_start.h"
#include "driver_wheels.h"

namespace stepdriver::base {
namespace {

constexpr const char* kUsage = R"(usage: stepdriver_base [--help] [name:=value ...]

Drives a base on wheels that are axes of a stepdriver_node.

  topics      cmd_vel  DRIVER/axis_states  joint_states (subscribed)
              odom  tf  DRIVER/jog  diagnostics (published)
  services    DRIVER/AXIS/move_to (called for a steering)
  parameters  ~driver  ~rate  ~cmd_vel_timeout  ~driver_timeout  ~odom_frame  ~base_frame
              ~publish_tf  ~pose_covariance_diagonal  ~twist_covariance_diagonal
              ~separation_mm  ~wheels  ~steering

Exit codes: 0 ended as asked, 1 wrong configuration, 64 wrong usage.
Start it with: roslaunch stepdriver base.launch
)";

struct Parameters {
  BaseConfig config;
  DriverWheels wheels;
  std::string driver;  // full name
};

/// The driver's parameters, as the driver itself applies them.
ros_node::NodeConfig readDriver(const std::string& driver, std::vector<ConfigIssue>& issues) {
  if (!ros::param::has(driver + "/axes")) {
    issues.push_back({driver + "/axes",
                      "isn't on the master, but a base needs the scale and the limits of its "
                      "wheels: start the node that drives them first"});
    return {};
  }
  ros_node::NodeConfig config =
      ros_node::readNodeConfig(ros_node::privateParameters(driver), driver, issues);
  if (issues.empty() && config.urdf_limits) {
    ros_node::applyDescriptionParameter(ros::names::parentNamespace(driver), config.axes, issues);
  }
  return config;
}

/// @throw ConfigError
Parameters readParameters() {
  std::vector<ConfigIssue> issues;
  const std::string& name = ros::this_node::getName();
  Parameters parameters;
  BaseConfig& config = parameters.config;
  config = readBaseConfig(ros_node::privateParameters(name), name, issues);
  ros_node::checkDriverName(config.driver, name, issues);
  if (!issues.empty()) throw ConfigError(issues);
  parameters.driver = ros::names::resolve(config.driver);
  const ros_node::NodeConfig driver = readDriver(parameters.driver, issues);
  if (!issues.empty()) throw ConfigError(issues);
  parameters.wheels = driverWheels(config, name, driver, parameters.driver, issues);
  if (!issues.empty()) throw ConfigError(issues);
  return parameters;
}

}  // namespace
}  // namespace stepdriver::base

int main(int argc, char** argv) {
  namespace base = stepdriver::base;
  namespace ros_node = stepdriver::ros_node;
  ros_node::EndRequests end_requests;
  if (const auto code = ros_node::handleArguments(argc, argv, base::kUsage)) return *code;
  ros::init(argc, argv, "base", ros::init_options::NoSigintHandler);
  if (!ros_node::waitForMaster(end_requests)) return ros_node::kExitOk;
  return ros_node::runClientNode(end_requests, base::readParameters,
                                 [](ros::NodeHandle& node, const base::Parameters& parameters) {
                                   return std::make_unique<base::Base>(node, parameters.driver,
                                                                       parameters.config,
                                                                       parameters.wheels);
                                 });
}
