#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/setup/simulation_config.h"

/// Makes the parts of a machine from a configuration: its lines, its clock and its options.
namespace stepdriver::setup {

/// The lines that a machine drives.
enum class GpioBackend {
  kSimulated,  ///< those of the simulated rig
  kLibgpiod,   ///< the GPIO lines of this computer
};

/// The flight recorder.
struct RecorderConfig {
  double seconds = 10.0;    ///< [s] that it keeps; 0: nothing is recorded
  double memory_mb = 16.0;  ///< [MB] for edges, at most
  std::string folder;       ///< absolute path of its files; empty: the program decides
  int keep = 20;            ///< recordings in that folder
};

/// A board with Klipper's firmware, which plays the pulses of motors ahead of time.
struct BoardConfig {
  std::string name;         ///< its lines are `name:pin`
  std::string port;         ///< path of its serial port; on the rig it isn't opened
  int baud = 250'000;       ///< only of ports that aren't USB
  double ahead = 0.05;      ///< [s] how long before its time a step is sent
  double step_error = 0.0;  ///< [s] how far a step may be from its time; 0: a tick of its clock
  bool reset = false;       ///< whether a board that another program has configured is reset
};

/// The configuration of a machine. The node reads it from its parameters, and yaml::readFile() from
/// a file.
struct MachineConfig {
  GpioBackend backend{};
  SimulationConfig simulation;           ///< only for the simulated backend
  std::vector<config::AxisConfig> axes;  ///< in the order of their names
  double max_lateness = 0.005;           ///< [s] a pulse that is later is a fault
  double late_steps = 0.25;              ///< [full steps] see machine::MachineOptions
  double write_timeout = 0.5;            ///< [s] for a line other than STEP and DIR
  bool enforce_realtime = false;         ///< don't start if the computer is too slow for the axes
  bool keep_cpus_awake = true;           ///< see pulse::kCpuLatencyDevice
  std::optional<int> cpu;                ///< see pulse::RealtimeRequest
  std::optional<config::InputSwitch> emergency_stop;  ///< see machine::MachineOptions
  machine::EmergencyDisable emergency_disable{};
  std::optional<machine::HeartbeatConfig> heartbeat;    ///< see machine::MachineOptions
  std::optional<config::MotorPowerConfig> motor_power;  ///< see machine::MachineOptions
  std::vector<config::OutputConfig> outputs;            ///< in the order of the file
  std::vector<config::InputConfig> inputs;
  std::vector<BoardConfig> boards;
  std::string state_file;  ///< see machine::MachineOptions
  RecorderConfig recorder;

  /// What a machine::Machine of this configuration takes, in addition to the axes.
  machine::MachineOptions options() const;
};

/// Which backend to use for a configuration file.
enum class BackendChoice {
  kAsInTheFile,  ///< libgpiod if the file names no backend
  kSimulated,    ///< the simulated rig, whatever the file says
  kLibgpiod,     ///< GPIO lines, whatever the file says; the rig's trace is left out
};

/// Writes the chosen backend into a configuration. Everything else remains, right or wrong.
void chooseBackend(config::ConfigValue& tree, BackendChoice choice);

/// Reads a whole configuration, with or without the keys that only the ROS node uses.
///
/// @throw ConfigError listing every mistake.
///
/// @code{.cpp}
/// const config::ConfigValue tree = yaml::load("a4988.yaml");
/// const auto config = setup::machineConfigOf(tree, setup::BackendChoice::kSimulated);
/// @endcode
MachineConfig machineConfigOf(config::ConfigValue tree,
                              BackendChoice choice = BackendChoice::kAsInTheFile);

}  // namespace stepdriver::setup
