#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_value.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/sim/rig.h"

/// Makes the parts of a machine from a configuration: its lines, its clock and its options.
namespace stepdriver::setup {

/// How the rig is really wired if the configuration is wrong about it. Whatever isn't set is as
/// configured.
struct SimulatedWiring {
  std::optional<bool> dir_inverted;      ///< DIR, on its way to the chip
  std::optional<double> steps_per_unit;  ///< [microsteps/mm|deg] at the configured microsteps
  std::optional<std::string> min_pin;    ///< the line of the switch at the min end
  std::optional<std::string> max_pin;
  std::optional<bool> min_active_level;  ///< that line's level while the switch is pressed
  std::optional<bool> max_active_level;
};

/// A motor of the rig: a hybrid stepper, see sim::MotorSpec.
struct SimulatedMotor {
  int pole_pairs = 50;
  /// [Nm] Empty: as much as loses no step, see sim::soundMotor().
  std::optional<double> holding_torque;
  double rotor_inertia = 54.0;  ///< [g cm^2]
  double load_inertia = 54.0;   ///< [g cm^2] the inertia of all that it moves, at the motor's shaft
  double friction = 0.0;        ///< [Nm]
  double damping = 0.2;         ///< damping ratio
};

/// How the rig of one axis is built, and what is wrong with it. Lengths are in mm on a linear axis,
/// in degrees on a rotary one.
struct SimulatedAxis {
  double start = 0.0;              ///< [mm|deg] position of the carriage at the start
  double switch_hysteresis = 0.0;  ///< [mm|deg]
  int bounces = 0;                 ///< extra on-off pairs after each change of a switch
  double bounce_ms = 0.2;          ///< [ms] from one bounce edge to the next
  /// [mm|deg] Position of the switch; empty: outside the soft limit.
  std::optional<double> min_switch;
  std::optional<double> max_switch;
  /// [mm|deg] Where a block stops the carriage; empty: nowhere.
  std::optional<double> block_min;
  std::optional<double> block_max;
  double settling_ms = 10.0;  ///< [ms] from the last pulse until the driver is in position
  double load_falls = 0.0;  ///< [mm/s|deg/s] how fast a load falls that nothing holds, towards min
  /// [Hz] frequency of a mass that the carriage pulls by a spring; 0: none.
  double spring_hz = 0.0;
  double spring_damping = 0.1;  ///< its damping ratio: what an input shaper expects by default
  SimulatedMotor motor;
  SimulatedWiring wiring;
  sim::RigFaults faults;
  /// How many writes to STEP succeed before all others fail.
  std::optional<int> fail_step_write_after;
  /// By name, the rigs of those motors of an axis with several that differ from the axis's.
  std::map<std::string, SimulatedAxis> motors;

  const SimulatedAxis& ofMotor(const std::string& name) const {
    const auto own = motors.find(name);
    return own != motors.end() ? own->second : *this;
  }
};

/// An output with a name on the rig.
struct SimulatedOutput {
  /// How many writes succeed before all others fail.
  std::optional<int> fail_write_after;
};

/// An input with a name on the rig: a switch.
struct SimulatedInput {
  bool pressed = false;    ///< at the start
  int bounces = 0;         ///< extra on-off pairs after each change
  double bounce_ms = 0.2;  ///< [ms] from one bounce edge to the next
  /// The axis whose carriage presses it between two places; empty: only a hand does.
  std::string axis;
  double from = 0.0;        ///< [mm|deg]
  double to = 0.0;          ///< [mm|deg]
  double every = 0.0;       ///< [mm|deg] and again so often; 0: once
  double hysteresis = 0.0;  ///< [mm|deg] it is released this far outside of that
};

/// The configuration of the simulated rig.
///
/// @code{.cpp}
/// setup::SimulationConfig simulation;
/// simulation.speed = 0.0;  // as fast as possible
/// simulation.trace = "/tmp/axis.vcd";
/// simulation.axes["x"].start = 10.0;  // [mm]
/// @endcode
struct SimulationConfig {
  double speed = 1.0;  ///< seconds of the rig per second; 0: as fast as possible
  std::string trace;   ///< path of the VCD file; empty: no trace
  /// It may replace a file that isn't a trace.
  bool trace_overwrites_any_file = false;
  bool emergency_stop = false;  ///< its button is pressed at the start
  std::map<std::string, SimulatedAxis> axes;
  std::map<std::string, SimulatedOutput> outputs;
  std::map<std::string, SimulatedInput> inputs;
};

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
