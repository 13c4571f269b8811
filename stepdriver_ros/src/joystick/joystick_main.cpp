#include <ros/console.h>
#include <ros/init.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "common/client_node.h"
#include "common/end_requests.h"
#include "common/node_start.h"
#include "common/xmlrpc_value.h"
#include "driver_axes.h"
#include "joystick.h"
#include "joystick_config.h"

namespace stepdriver::joystick {
namespace {

// How many messages should arrive in the driver's jog_timeout, so that a late one ends no jog.
constexpr double kMessagesInTimeout = 3.0;
constexpr double kRounding = 1e-9;

constexpr const char* kUsage = R"(usage: stepdriver_joystick [--help] [name:=value ...]

Jogs the axes of a stepdriver_node with the sticks of a joystick.

  topics      joy (subscribed)  DRIVER/jog
  services    DRIVER/AXIS/enable (called if disable_in_dead_band is set)
  parameters  ~driver  ~rate  ~joy_timeout  ~deadman_button  ~axes

Exit codes: 0 ended as asked, 1 wrong configuration, 64 wrong usage.
Start it with: roslaunch stepdriver joystick.launch
)";

struct Parameters {
  std::string driver;  // full name
  JoystickConfig config;
};

/// @throw ConfigError
Parameters readParameters() {
  std::vector<ConfigIssue> issues;
  const std::string& name = ros::this_node::getName();
  Parameters parameters;
  parameters.config = readJoystickConfig(ros_node::privateParameters(name), name, issues);
  ros_node::checkDriverName(parameters.config.driver, name, issues);
  if (!issues.empty()) throw ConfigError(issues);
  parameters.driver = ros::names::resolve(parameters.config.driver);
  XmlRpc::XmlRpcValue axes;
  if (ros::param::get(parameters.driver + "/axes", axes)) {
    checkDriverAxes(parameters.config, name, ros_node::configValue(axes), parameters.driver,
                    issues);
  }
  if (!issues.empty()) throw ConfigError(issues);
  return parameters;
}

void warnOfTooLowRate(const std::string& driver, double rate) {
  double timeout = 0.0;
  if (!ros::param::get(driver + "/jog_timeout", timeout)) return;
  if (rate * timeout >= kMessagesInTimeout) return;
  ROS_WARN_NAMED(
      "joystick",
      "~rate is %g Hz and %s/jog_timeout is %g s, so the driver ends a jog if a message is late. "
      "Use %g Hz or more",
      rate, driver.c_str(), timeout, std::ceil(kMessagesInTimeout / timeout - kRounding));
}

std::unique_ptr<Joystick> start(ros::NodeHandle& node, const Parameters& parameters) {
  const auto& [driver, config] = parameters;
  warnOfTooLowRate(driver, config.rate);
  auto joystick = std::make_unique<Joystick>(node, driver, config);
  ROS_INFO_NAMED("joystick", "Ready: %s jogs %zu %s of %s", node.resolveName("joy").c_str(),
                 config.axes.size(), config.axes.size() == 1 ? "axis" : "axes", driver.c_str());
  return joystick;
}

}  // namespace
}  // namespace stepdriver::joystick

int main(int argc, char** argv) {
  namespace joystick = stepdriver::joystick;
  namespace ros_node = stepdriver::ros_node;
  ros_node::EndRequests end_requests;
  if (const auto code = ros_node::handleArguments(argc, argv, joystick::kUsage)) return *code;
  ros::init(argc, argv, "joystick", ros::init_options::NoSigintHandler);
  if (!ros_node::waitForMaster(end_requests)) return ros_node::kExitOk;
  return ros_node::runClientNode(end_requests, joystick::readParameters, joystick::start);
}
