#include <fmt/format.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/names.h>
#include <ros/node_handle.h>
#include <ros/service.h>

#include <algorithm>
#include <cstdio>
#include <exception>
#include <string>
#include <vector>

#include "common/end_requests.h"
#include "common/loopback_only.h"
#include "common/node_start.h"
#include "console.h"
#include "driver_parameters.h"
#include "options.h"
#include "stepdriver_core/error.h"

namespace stepdriver::console {
namespace {

using ros_node::EndRequests;

constexpr int kExitNothingWritten = 2;

void complain(const std::string& text) { std::fprintf(stderr, "console: %s\n", text.c_str()); }

/// @throw Error if there is no such driver.
void findDriver(const std::string& driver) {
  const std::vector<std::string> running = runningDrivers();
  if (std::find(running.begin(), running.end(), driver) != running.end()) return;
  std::string others;
  for (const std::string& name : running) others += (others.empty() ? "" : ", ") + name;
  throw Error(fmt::format(
      "no stepdriver_node is running as {}. {}", driver,
      others.empty() ? "None is running at all: roslaunch stepdriver axis.launch starts one"
                     : "There is " + others + ": give its name by --driver"));
}

int run(const Options& options, EndRequests& end_requests) {
  const ros::NodeHandle node;
  ros_node::closeToOtherComputers();
  end_requests.takeOverShutdownCall();
  try {
    std::string why;
    if (!ros::names::validate(options.driver, why) || options.driver.empty()) {
      throw Error(fmt::format("--driver {}: it must be the name of a node{}", options.driver,
                              why.empty() ? "" : ": " + why));
    }
    const std::string driver = node.resolveName(options.driver);
    findDriver(driver);
    if (!options.wizard) {
      runConsole(node, driver, options, end_requests);
      return ros_node::kExitOk;
    }
    const bool written = runWizard(node, driver, options.wizard_options, end_requests);
    ros::shutdown();
    return written ? ros_node::kExitOk : kExitNothingWritten;
  } catch (const std::exception& error) {
    complain(error.what());
  }
  ros::shutdown();
  return ros_node::kExitConfig;
}

int start(int argc, char** argv, EndRequests& end_requests) {
  Options options;
  try {
    std::vector<std::string> arguments;
    ros::removeROSArgs(argc, argv, arguments);
    options = parseOptions({arguments.begin() + 1, arguments.end()});
  } catch (const Error& error) {
    complain(error.what());
    std::fputs(kUsage, stderr);
    return ros_node::kExitUsage;
  }
  if (options.help) {
    std::fputs(kUsage, stdout);
    return ros_node::kExitOk;
  }
  // Two consoles can show one machine.
  ros::init(argc, argv, "console",
            ros::init_options::NoSigintHandler | ros::init_options::AnonymousName);
  if (!ros::master::check()) {
    complain(
        fmt::format("there is no ROS master at {}: start the driver first, for example with "
                    "roslaunch stepdriver axis.launch",
                    ros::master::getURI()));
    return ros_node::kExitConfig;
  }
  return run(options, end_requests);
}

}  // namespace
}  // namespace stepdriver::console

int main(int argc, char** argv) {
  stepdriver::ros_node::EndRequests end_requests;
  return stepdriver::console::start(argc, argv, end_requests);
}
