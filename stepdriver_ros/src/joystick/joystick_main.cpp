#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <ros/console.h>
#include <ros/init.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <ros/param.h>
#include <ros/this_node.h>

#include <chrono>
#include <cmath>
#include <exception>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "common/end_requests.h"
#include "common/loopback_only.h"
#include "common/node_start.h"
#include "common/xml_depth.h"
#include "common/xmlrpc_value.h"
#include "driver_axes.h"
#include "joystick.h"
#include "joystick_config.h"

namespace stepdriver::joystick {
namespace {

using ros_node::EndRequests;

constexpr double kPoll = 0.02;  // [s]
// Time for the last message, which roscpp sends in a thread of its own.
constexpr std::chrono::milliseconds kLastWords{50};
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

/// @param driver receives the driver's full name.
/// @throw ConfigError
JoystickConfig readParameters(std::string& driver) {
  std::vector<ConfigIssue> issues;
  const std::string& name = ros::this_node::getName();
  JoystickConfig config = readJoystickConfig(ros_node::privateParameters(name), name, issues);
  std::string why;
  if (config.driver.empty() || !ros::names::validate(config.driver, why)) {
    issues.push_back({name + "/driver", fmt::format("is \"{}\", but must be the name of a node{}",
                                                    config.driver, why.empty() ? "" : ": " + why)});
  }
  if (!issues.empty()) throw ConfigError(issues);
  driver = ros::names::resolve(config.driver);
  XmlRpc::XmlRpcValue axes;
  if (ros::param::get(driver + "/axes", axes)) {
    checkDriverAxes(config, name, ros_node::configValue(axes), driver, issues);
  }
  if (!issues.empty()) throw ConfigError(issues);
  return config;
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

int run(EndRequests& end_requests) {
  std::optional<ros::NodeHandle> node;  // with it roscpp and its console end
  try {
    // Before the handle registers this node, which ends a running node with the same name.
    std::string driver;
    const JoystickConfig config = readParameters(driver);
    node.emplace();
    ros_node::closeToOtherComputers();
    end_requests.takeOverShutdownCall();
    warnOfTooLowRate(driver, config.rate);
    Joystick joystick(*node, driver, config);
    ROS_INFO_NAMED("joystick", "Ready: %s jogs %zu %s of %s", node->resolveName("joy").c_str(),
                   config.axes.size(), config.axes.size() == 1 ? "axis" : "axes", driver.c_str());
    std::string who;
    while (who.empty()) {
      ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kPoll));
      who = end_requests.waitFor(std::chrono::milliseconds(0));
    }
    ROS_INFO_NAMED("joystick", "Ending on %s", who.c_str());
    joystick.rest();
    std::this_thread::sleep_for(kLastWords);
    ros::shutdown();  // also ends unanswered calls
    return ros_node::kExitOk;
  } catch (const ConfigError& error) {
    ros_node::explain(error, ros::this_node::getName(), "Not started");
  } catch (const std::exception& error) {
    ROS_FATAL_NAMED("joystick", "Not started: %s", error.what());
  }
  return ros_node::kExitConfig;
}

}  // namespace
}  // namespace stepdriver::joystick

int main(int argc, char** argv) {
  namespace joystick = stepdriver::joystick;
  namespace ros_node = stepdriver::ros_node;
  ros_node::limitXmlDepth();
  ros_node::EndRequests end_requests;
  if (const auto code = ros_node::handleArguments(argc, argv, joystick::kUsage)) return *code;
  ros::init(argc, argv, "joystick", ros::init_options::NoSigintHandler);
  if (!ros_node::waitForMaster(end_requests)) return ros_node::kExitOk;
  return joystick::run(end_requests);
}
