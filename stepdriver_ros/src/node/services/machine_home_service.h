#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <stepdriver/HomeAxes.h>

#include "node/calls/background_task.h"
#include "node/calls/call_queues.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The service `home` of the whole machine.
class MachineHomeService {
 public:
  /// @param node the node's private handle.
  /// @param machine outlives the service; before its end it has been shut down.
  MachineHomeService(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues);
  MachineHomeService(const MachineHomeService&) = delete;
  MachineHomeService& operator=(const MachineHomeService&) = delete;

 private:
  bool home(HomeAxes::Request& request, HomeAxes::Response& response);

  machine::Machine& machine_;
  ros::ServiceServer service_;
  BackgroundTask task_;
};

}  // namespace stepdriver::ros_node
