#include "node_start.h"

#include <ros/console.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/param.h>

#include <chrono>
#include <cstdio>
#include <vector>

#include "printable.h"
#include "xmlrpc_value.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kMasterPoll{200};

/// The parameter server keeps the order in which parameters were set, and tells it in the list of
/// their names; in the values it is lost, because roscpp sorts them.
std::vector<std::string> keysInOrder(const std::string& space) {
  std::vector<std::string> names;
  std::vector<std::string> keys;
  if (!ros::param::getParamNames(names)) return keys;
  for (const std::string& name : names) {
    if (name.rfind(space + "/", 0) != 0) continue;
    const std::string key = name.substr(space.size() + 1);
    keys.push_back(key.substr(0, key.find('/')));
  }
  return keys;
}

}  // namespace

std::optional<int> handleArguments(int argc, char** argv, const std::string& usage) {
  // A program that reads the output through a pipe, such as roslaunch, must see each line at once.
  std::setvbuf(stdout, nullptr, _IOLBF, 0);
  std::vector<std::string> arguments;
  ros::removeROSArgs(argc, argv, arguments);
  if (arguments.size() < 2) return {};
  const bool help = arguments[1] == "--help" || arguments[1] == "-h";
  if (!help) {
    std::fprintf(stderr, "%s isn't an option; parameters are given as _name:=value\n",
                 printable(arguments[1]).c_str());
  }
  std::fputs(usage.c_str(), help ? stdout : stderr);
  return help ? kExitOk : kExitUsage;
}

bool waitForMaster(EndRequests& end_requests) {
  while (!ros::master::check()) {
    ROS_WARN_ONCE_NAMED("node", "Waiting for the ROS master at %s", ros::master::getURI().c_str());
    if (!end_requests.waitFor(kMasterPoll).empty()) return false;
  }
  return true;
}

config::ConfigValue privateParameters(const std::string& node_name) {
  XmlRpc::XmlRpcValue tree;
  if (!ros::param::get(node_name, tree)) return config::ConfigValue::Map{};
  config::ConfigValue parameters = configValue(tree);
  auto* const map = parameters.as<config::ConfigValue::Map>();
  if (map == nullptr) return parameters;
  const auto axes = map->find("axes");
  if (axes != map->end()) axes->second.setKeyOrder(keysInOrder(node_name + "/axes"));
  return parameters;
}

void explain(const ConfigError& error, const std::string& node_name,
             const std::string& what_follows) {
  const std::size_t count = error.issues().size();
  ROS_FATAL_NAMED("node", "%s: %zu %s in the parameters", what_follows.c_str(), count,
                  count == 1 ? "error" : "errors");
  bool left_over = false;
  for (const ConfigIssue& issue : error.issues()) {
    ROS_ERROR_NAMED("node", "%s %s", issue.key.c_str(), issue.message.c_str());
    left_over = left_over || issue.may_be_left_over;
  }
  if (!left_over) return;
  ROS_ERROR_NAMED("node",
                  "Parameters of an earlier launch may still be on the master. To delete them: "
                  "rosparam delete %s; then load yours again",
                  node_name.c_str());
}

}  // namespace stepdriver::ros_node
