#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>
#include <stepdriver/HomeAxes.h>

#include "background.h"
#include "call_queues.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The service `home` of the whole machine.
class MachineHoming {
 public:
  /// @param node the node's private handle.
  /// @param machine outlives the service; before its end it has been shut down.
  MachineHoming(ros::NodeHandle node, machine::Machine& machine, CallQueues& queues);
  MachineHoming(const MachineHoming&) = delete;
  MachineHoming& operator=(const MachineHoming&) = delete;

 private:
  bool home(HomeAxes::Request& request, HomeAxes::Response& response);

  machine::Machine& machine_;
  ros::ServiceServer service_;
  Background background_;
};

}  // namespace stepdriver::ros_node
