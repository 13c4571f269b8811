#include "client_node.h"

#include <fmt/format.h>
#include <ros/callback_queue.h>
#include <ros/init.h>
#include <ros/names.h>

#include <chrono>
#include <thread>

namespace stepdriver::ros_node {
namespace {

constexpr double kPoll = 0.02;  // [s]
// Time for the last message, which roscpp sends in a thread of its own.
constexpr std::chrono::milliseconds kLastWords{50};

}  // namespace

void checkDriverName(const std::string& driver, const std::string& node_name,
                     std::vector<ConfigIssue>& issues) {
  std::string why;
  if (!driver.empty() && ros::names::validate(driver, why)) return;
  issues.push_back(
      {node_name + "/driver", fmt::format("is \"{}\", but must be the name of a node{}", driver,
                                          why.empty() ? "" : ": " + why)});
}

void serveUntilEnd(EndRequests& end_requests) {
  std::string who;
  while (who.empty()) {
    ros::getGlobalCallbackQueue()->callAvailable(ros::WallDuration(kPoll));
    who = end_requests.waitFor(std::chrono::milliseconds(0));
  }
  ROS_INFO_NAMED("node", "Ending on %s", who.c_str());
}

void shutdownAfterLastMessages() {
  std::this_thread::sleep_for(kLastWords);
  ros::shutdown();
}

}  // namespace stepdriver::ros_node
