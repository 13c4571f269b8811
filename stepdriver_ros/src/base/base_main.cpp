#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <chrono>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "base.h"
#include "base_config.h"
#include "common/description_parameter.h"
#include "common/end_requests.h"
#include "common/loopback_only.h"
#include "common/node_config.h"
#include "common/node_start.h"
#include "common/xml_depth.h"
#include "driver_wheels.h"

namespace stepdriver::base {
namespace {

using ros_node::EndRequests;

constexpr double kPoll = 0.02;  // [s]
// Time for the last message, which roscpp sends in a thread of its own.
constexpr std::chrono::milliseconds kLastWords{50};

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
  std::string why;
  if (config.driver.empty() || !ros::names::validate(config.driver, why)) {
    issues.push_back({name + "/driver", fmt::format("is \"{}\", but must be the name of a node{}",
                                                    config.driver, why.empty() ? "" : ": " + why)});
  }
  if (!issues.empty()) throw ConfigError(issues);
  parameters.driver = ros::names::resolve(config.driver);
  const ros_node::NodeConfig driver = readDriver(parameters.driver, issues);
  if (!issues.empty()) throw ConfigError(issues);
  parameters.wheels = driverWheels(config, name, driver, parameters.driver, issues);
  if (!issues.empty()) throw ConfigError(issues);
  return parameters;
}

int run(EndRequests& end_requests) {
  std::optional<ros::NodeHandle> node;  // with it roscpp and its console end
  try {
    // Before the handle registers this node, which ends a running node with the same name.
    const Parameters parameters = readParameters();
    node.emplace();
    ros_node::closeToOtherComputers();
    end_requests.takeOverShutdownCall();
    Base base(*node, parameters.driver, parameters.config, parameters.wheels);
    std::string who;
    while (who.empty()) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kPoll));
      who = end_requests.waitFor(std::chrono::milliseconds(0));
    }
    ROS_INFO_NAMED("base", "Ending on %s", who.c_str());
    base.rest();
    std::this_thread::sleep_for(kLastWords);
    ros::shutdown();  // also ends unanswered calls
    return ros_node::kExitOk;
  } catch (const ConfigError& error) {
    ros_node::explain(error, ros::this_node::getName(), "Not started");
  } catch (const std::exception& error) {
    ROS_FATAL_NAMED("base", "Not started: %s", error.what());
  }
  return ros_node::kExitConfig;
}

}  // namespace
}  // namespace stepdriver::base

int main(int argc, char** argv) {
  namespace base = stepdriver::base;
  namespace ros_node = stepdriver::ros_node;
  ros_node::limitXmlDepth();
  ros_node::EndRequests end_requests;
  if (const auto code = ros_node::handleArguments(argc, argv, base::kUsage)) return *code;
  ros::init(argc, argv, "base", ros::init_options::NoSigintHandler);
  if (!ros_node::waitForMaster(end_requests)) return ros_node::kExitOk;
  return base::run(end_requests);
}
