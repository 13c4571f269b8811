#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>

#include <string>
#include <vector>

#include "node/calls/call_queues.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/setup/hardware.h"

namespace stepdriver::ros_node {

/// The services of the whole machine. Any thread of their queues calls them.
class MachineServices {
 public:
  /// @param node the node's private handle.
  /// @param queues outlive the services.
  /// @param machine outlives the queues.
  MachineServices(const ros::NodeHandle& node, machine::Machine& machine, CallQueues& queues);

  /// Adds the services of the simulated rig. @param simulation outlives the services.
  void advertiseRig(setup::Simulation& simulation);

 private:
  void advertiseEndstop(setup::Simulation& simulation, const std::string& axis,
                        setup::Simulation::End end);
  void advertiseInput(setup::Simulation& simulation, const std::string& name);
  void advertiseSetOutput(machine::Machine& machine);
  void advertiseSetPositionCompare(machine::Machine& machine);
  void advertiseSpeedOverride(machine::Machine& machine);
  void advertiseCoordinatedMoves(machine::Machine& machine);

  ros::NodeHandle node_;
  CallQueues& queues_;
  std::vector<ros::ServiceServer> servers_;
};

}  // namespace stepdriver::ros_node
