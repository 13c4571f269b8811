#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <stepdriver/Home.h>

#include "node/calls/background_task.h"
#include "node/calls/call_queues.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::ros_node {

/// The service `home` of one axis, below its name.
class AxisHomeService {
 public:
  /// @param node the node's private handle.
  /// @param index of the axis, which determines its queue.
  /// @param axis, queues outlive the service; before its end the machine has been shut down.
  AxisHomeService(const ros::NodeHandle& node, std::size_t index, axis::Axis& axis,
                  CallQueues& queues);
  AxisHomeService(const AxisHomeService&) = delete;
  AxisHomeService& operator=(const AxisHomeService&) = delete;

 private:
  bool home(Home::Request& request, Home::Response& response);

  axis::Axis& axis_;
  ros::ServiceServer service_;
  BackgroundTask task_;
};

}  // namespace stepdriver::ros_node
