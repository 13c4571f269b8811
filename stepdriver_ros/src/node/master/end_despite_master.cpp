#include "end_despite_master.h"

#include <ros/master.h>
#include <ros/this_node.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <system_error>

#include "common/xmlrpc_caller.h"

namespace stepdriver::ros_node {
namespace {

constexpr std::chrono::milliseconds kRetryPeriod{1000};

}  // namespace

EndDespiteMaster::~EndDespiteMaster() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    ended_ = true;
  }
  change_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void EndDespiteMaster::begin(int exit_code) try {
  thread_ = std::thread([this, exit_code, name = ros::this_node::getName()] {
    XmlRpcCaller master(ros::master::getHost(), ros::master::getPort(), kMasterPatience);
    std::unique_lock<std::mutex> lock(mutex_);
    while (!change_.wait_for(lock, kRetryPeriod, [this] { return ended_; })) {
      lock.unlock();
      if (!master.call("getPid", name)) {
        std::fputs("The ROS master doesn't answer: the node ends without telling it\n", stderr);
        std::_Exit(exit_code);
      }
      lock.lock();
    }
  });
} catch (const std::system_error& error) {
  std::fprintf(stderr, "If the ROS master hangs, so does the end of this node: no thread: %s\n",
               error.what());
}

}  // namespace stepdriver::ros_node
