#pragma once

#include <string>
#include <vector>

#include "config/config_reader.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::setup {

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
///       block_min_mm: -5.0       # a block that stops the carriage; default: none
///       block_max_mm: 205.0
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
///     home: {axis: x, from_mm: 20.0, to_mm: 30.0, every_mm: 0.0, hysteresis_mm: 0.0}
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
