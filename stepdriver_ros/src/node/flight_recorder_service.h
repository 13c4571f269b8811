#pragma once

#include <ros/node_handle.h>
#include <ros/service_server.h>

#include <optional>
#include <string>

#include "node/calls/call_queues.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/recorder/dumper.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::ros_node {

/// The node's side of the flight recorder: writes a recording at each fault, on the service `dump`
/// and on request, and names its files in the log.
class FlightRecorderService {
 public:
  /// @param machine outlives this object.
  /// @param node full name of the node, for the names of files.
  FlightRecorderService(machine::Machine& machine, const setup::RecorderConfig& config,
                        const std::string& node);

  /// Offers the service `dump`. @param node the node's private handle. @param queues outlive the
  ///   recorder.
  void advertise(ros::NodeHandle node, CallQueues& queues);

  /// Returns at once.
  void request(const std::string& reason);

  /// See recorder::Dumper.
  std::string error() const { return dumper_ ? dumper_->error() : ""; }
  recorder::Dump last() const { return dumper_ ? dumper_->last() : recorder::Dump{}; }

 private:
  void report(const recorder::Dump& dump);

  bool failed_ = false;                     // the last recording; of the dumper's thread
  std::optional<recorder::Dumper> dumper_;  // empty: nothing is recorded
  ros::ServiceServer server_;
};

}  // namespace stepdriver::ros_node
