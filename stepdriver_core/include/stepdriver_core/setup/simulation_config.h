#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/config_reader.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/sim/rig.h"

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
};

/// The configuration of the simulated rig.
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

/// Reads the map `simulation` of a configuration; every key is optional.
///
/// @code{.yaml}
/// simulation:
///   speed: 1.0                   # seconds of the rig per second; 0: as fast as possible
///   trace: /tmp/axis.vcd         # path of the pin trace; default: no trace
///   trace_overwrites_any_file: false  # true: also one that isn't a trace
///   emergency_stop: false        # true: the emergency-stop button is pressed at the start
///   axes:
///     x:                         # `deg` instead of `mm` on a rotary axis
///       start_mm: 0.0            # position of the carriage at the start
///       min_switch_mm: -2.0      # default: 2 mm (2 degrees) outside the soft limit
///       max_switch_mm: 202.0
///       switch_hysteresis_mm: 0.0
///       bounces: 0
///       bounce_ms: 0.2
///       settling_ms: 10.0        # until the in-position output is active after a pulse
///       never_in_position: false # true: it stays inactive
///       load_falls_mm_s: 0.0     # how fast the load sinks towards min while nothing holds it
///       motor:                 # the rotor between the chip and the carriage
///         pole_pairs: 50
///         holding_torque_nm: 0.3      # default: as much as loses no step, at least 0.3
///         rotor_inertia_g_cm2: 54.0
///         load_inertia_g_cm2: 54.0    # of all that it moves, at the motor's shaft
///         friction_nm: 0.0
///         damping: 0.2                # damping ratio of its small oscillations
///       wiring:                # what the configuration is wrong about; default: nothing
///         dir_inverted: true
///         steps_per_mm: 100.0  # steps_per_degree
///         min_pin: GPIO24      # the line of the switch at the min end
///         max_pin: GPIO23
///         min_active_level: low
///         max_active_level: low
///       min_stuck: none          # active, inactive or none
///       max_stuck: none
///       lose_every: 0            # every n-th step slips; 0: no step
///       chip_fault_after: 1000        # steps of the motor; then the chip reports over-current
///       chip_fault_ms: 0.0       # how long its cause lasts if a fault ends by itself; 0: for ever
///       fail_step_write_after: 1000   # writes to STEP; those after them fail. Default: none fails
///       motors:                  # of an axis with several: what is different at one of them
///         right: {start_mm: 3.5} # any of the keys above; no other fault or wrong wire applies
///         then
///   outputs:
///     pen: {fail_write_after: 10}  # writes; those after them fail. Default: none fails
///   inputs:
///     probe: {pressed: false, bounces: 0, bounce_ms: 0.2}
/// @endcode
///
/// @param reader of that map.
/// @param axes the axes that are simulated.
/// @param axes_are_right false: the axes have issues. Values that depend on them are then not
///   checked.
/// @param outputs, inputs those with a name.
SimulationConfig readSimulation(config::ConfigReader reader,
                                const std::vector<config::AxisConfig>& axes, bool axes_are_right,
                                const std::vector<config::OutputConfig>& outputs = {},
                                const std::vector<config::InputConfig>& inputs = {});

/// Checks what depends on the limits of the axes: the min switch must be below the max switch.
///
/// @param name full name of the map `simulation`.
/// @param issues every mistake is added here.
void checkSimulation(const std::vector<config::AxisConfig>& axes, const SimulationConfig& config,
                     const std::string& name, std::vector<ConfigIssue>& issues);

}  // namespace stepdriver::setup
