#pragma once

#include <optional>
#include <string>
#include <vector>

#include "simulation_config.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/axis/config_value.h"
#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {

enum class GpioBackend { kSimulated, kLibgpiod };

/// All parameters of the node.
struct NodeConfig {
  GpioBackend backend = GpioBackend::kSimulated;
  double joint_state_rate = 50.0;  ///< [Hz]
  double jog_timeout = 0.5;        ///< [s] without a jog message; then the axis comes to rest
  double max_lateness = 0.005;     ///< [s] of a pulse; beyond it is a fault
  bool enforce_realtime = false;   ///< don't start where the machine is too slow for its axes
  bool keep_cpus_awake = true;     ///< see machine::MachineOptions::latency_device
  SimulationConfig simulation;
  std::vector<axis::AxisConfig> axes;
  std::optional<axis::InputSwitch> emergency_stop;  ///< see machine::MachineOptions
  std::string state_file;                           ///< the same
  std::string hardware_id;                          ///< of diagnostics; empty: made from the rest
};

/// @return machine::MachineOptions::latency_device
std::string latencyDevice(const NodeConfig& config);

/// Reads the node's private parameters.
///
/// @code{.yaml}
/// gpio: {backend: simulated}     # simulated, or libgpiod: the machine's own lines
/// joint_state_rate: 50.0         # [Hz] from 1 to 1000
/// jog_timeout: 0.5               # [s] from 0.02 to 60
/// realtime:                      # or `enforce` or `warn` alone
///   policy: warn                 # where the machine is too slow for its axes: warn, or enforce:
///                                # not start
///   max_lateness_ms: 5.0
///   keep_cpus_awake: true        # on real lines; false: they may sleep, and wake late
/// emergency_stop:                # optional; see axis::readInputSwitch()
///   {pin: "gpiochip0:25", active_level: high, bias: pull_up}
/// state_file: ""                 # absolute path of a file that keeps the positions; empty: none
/// hardware_id: ""                # of diagnostics; empty: the host and the driver chips
/// simulation: {...}              # see readSimulation(); only a simulated node heeds it
/// axes: {...}                    # see axis::readAxes()
/// @endcode
///
/// @param tree all of them, as one map.
/// @param name the node's full name.
/// @param issues everything that is wrong is added here.
/// @return to be used only where no issue was added.
NodeConfig readNodeConfig(const axis::ConfigValue& tree, const std::string& name,
                          std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::ros_node
