#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <stepdriver/Home.h>

#include "action_statuses.h"
#include "background.h"
#include "call_queues.h"
#include "homing_action.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// The homing of one axis: a service `home`, and the action `homing`, below the axis's name.
class HomingServer {
 public:
  /// @param node the node's private handle.
  /// @param index of the axis, which says its queue.
  /// @param axis, queues, statuses outlive the server; before its end the machine has been shut
  ///   down.
  HomingServer(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis, CallQueues& queues,
               ActionStatuses& statuses);
  HomingServer(const HomingServer&) = delete;
  HomingServer& operator=(const HomingServer&) = delete;

 private:
  bool home(Home::Request& request, Home::Response& response);

  axis::Axis& axis_;
  ros::NodeHandle node_;
  ros::ServiceServer service_;
  HomingAction action_;
  Background background_;
};

}  // namespace stepdriver::ros_node
