#pragma once

#include <actionlib/server/simple_action_server.h>
#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <stepdriver/Home.h>
#include <stepdriver/HomeAction.h>

#include <chrono>
#include <future>
#include <mutex>

#include "background.h"
#include "call_queues.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// The homing of one axis: a service `home`, and an action `homing` with feedback and
/// cancel, below the axis's name. While the action has goals it has a thread of its own, in which
/// it waits.
class HomingServer {
 public:
  /// @param node the node's private handle.
  /// @param index of the axis, which says its queue.
  /// @param axis, queues outlive the server; before its end the machine has been shut down.
  HomingServer(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
               CallQueues& queues);
  HomingServer(const HomingServer&) = delete;
  HomingServer& operator=(const HomingServer&) = delete;

 private:
  using Clock = std::chrono::steady_clock;

  bool home(Home::Request& request, Home::Response& response);
  void takeGoal();
  void executeGoals();
  void execute();
  void tell();

  axis::Axis& axis_;
  ros::NodeHandle node_;
  ros::ServiceServer service_;
  actionlib::SimpleActionServer<HomeAction> action_;
  axis::HomingPhase told_ = axis::HomingPhase::kNone;  // of the action's thread, as told_at_
  Clock::time_point told_at_;
  std::mutex goals_mutex_;
  bool executing_ = false;
  std::future<void> goals_;
  Background background_;
};

}  // namespace stepdriver::ros_node
