#pragma once

#include <diagnostic_updater/diagnostic_updater.h>
#include <ros/node_handle.h>
#include <ros/steady_timer.h>

#include <cstdint>
#include <string>
#include <vector>

#include "common/master_watch.h"
#include "common/node_config.h"
#include "node/calls/call_queues.h"
#include "node/flight_recorder_service.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::ros_node {

/// The topic /diagnostics at 1 Hz: a status for each axis, and one each for the pulse engine, the
/// ROS master, the lines with a name, the state file and the flight recorder, if there are these.
class Diagnostics {
 public:
  /// @param node, private_node handles of the node, and of its private names.
  /// @param machine, queues, master outlive the diagnostics.
  /// @param hardware_id name of the hardware.
  Diagnostics(ros::NodeHandle node, const ros::NodeHandle& private_node,
              const machine::Machine& machine, CallQueues& queues, const MasterWatch& master,
              const std::string& hardware_id, const NodeConfig& config,
              const FlightRecorderService& recorder);
  Diagnostics(const Diagnostics&) = delete;
  Diagnostics& operator=(const Diagnostics&) = delete;

 private:
  using Status = diagnostic_updater::DiagnosticStatusWrapper;

  static void fillAxisStatus(const axis::Axis& axis, Status& status);
  void fillEngineStatus(Status& status);
  void fillMasterStatus(Status& status) const;
  void fillStateFileStatus(Status& status) const;
  void fillRecorderStatus(Status& status) const;

  const machine::Machine& machine_;
  const MasterWatch& master_;
  const FlightRecorderService& recorder_;
  const double max_lateness_;
  const std::string state_file_;
  std::uint64_t slips_before_ = 0;  // for the timer only
  diagnostic_updater::Updater updater_;
  ros::SteadyTimer timer_;
};

/// The host and its driver chips: "printer: x A4988, y DRV8825, on the simulated rig".
///
/// @param on setup::Hardware::description()
std::string hardwareId(const std::vector<config::AxisConfig>& axes, const std::string& on);

}  // namespace stepdriver::ros_node
