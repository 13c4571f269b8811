#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::ros_node {

/// All parameters of the node: those of its machine, and its own.
struct NodeConfig : setup::MachineConfig {
  double joint_state_rate = 50.0;    ///< [Hz]
  double jog_timeout = 0.5;          ///< [s] without a jog message until the axis comes to rest
  bool urdf_limits = true;           ///< the limits of robot_description apply as well
  bool publish_clock = false;        ///< the time of the simulated rig on /clock
  bool stop_on_master_lost = false;  ///< if the ROS master doesn't answer, all axes come to rest
  bool allow_slower = false;         ///< motion::TrajectoryRequest::allow_slower
  machine::SetpointMode setpoint_mode = machine::SetpointMode::kPosition;
  double setpoint_timeout = 0.2;  ///< [s] without a setpoint until the axis comes to rest
  std::string hardware_id;        ///< for diagnostics; empty: made from the other facts
};

/// Reads the node's private parameters: in addition to those of setup::readMachineConfig()
///
/// @code{.yaml}
/// joint_state_rate: 50.0         # [Hz] from 1 to 1000
/// jog_timeout: 0.5               # [s] from 0.02 to 60
/// urdf_limits: true              # apply the limits of robot_description as well
/// publish_clock: false           # true: publish the time of the simulated rig on /clock
/// on_master_lost: continue       # or stop: all axes come to rest
/// trajectory:
///   allow_slower: false          # true: what the limits don't allow is slowed down
/// setpoint:
///   mode: position               # or velocity: what the setpoints are
///   timeout: 0.2                 # [s] from 0.02 to 60
/// hardware_id: ""                # for diagnostics; empty: the host and the driver chips
/// @endcode
///
/// @param tree all of them, as one map.
/// @param name the node's full name.
/// @param issues every mistake is added here.
/// @return to be used only if no issue was added.
NodeConfig readNodeConfig(const config::ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues);

/// The keys that readNodeConfig() knows.
std::vector<std::string> parameterNames();

}  // namespace stepdriver::ros_node
