#include "node_start.h"

#include <ros/console.h>
#include <ros/master.h>
#include <ros/param.h>

#include <chrono>

#include "xmlrpc_value.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kMasterPoll{200};

}  // namespace

bool waitForMaster(EndRequests& end_requests) {
  while (!ros::master::check()) {
    ROS_WARN_ONCE("Waiting for the ROS master at %s", ros::master::getURI().c_str());
    if (!end_requests.waitFor(kMasterPoll).empty()) return false;
  }
  return true;
}

axis::ConfigValue privateParameters(const ros::NodeHandle& private_node) {
  XmlRpc::XmlRpcValue tree;
  if (!ros::param::get(private_node.getNamespace(), tree)) return axis::ConfigValue::Map{};
  return configValue(tree);
}

void explain(const ConfigError& error, const std::string& what_follows) {
  const std::size_t count = error.issues().size();
  ROS_FATAL("%s: %zu %s wrong in the parameters", what_follows.c_str(), count,
            count == 1 ? "thing is" : "things are");
  for (const ConfigIssue& issue : error.issues()) {
    ROS_ERROR("%s %s", issue.key.c_str(), issue.message.c_str());
  }
}

}  // namespace stepdriver::ros_node
