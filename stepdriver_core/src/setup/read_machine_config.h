#pragma once

#include <vector>

#include "config/config_reader.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::setup {

/// Reads the keys of a machine from a map that may contain other keys too.
///
/// @code{.yaml}
/// gpio:
///   backend: simulated           # or libgpiod: the GPIO lines of this computer
///   write_timeout_ms: 500.0      # of a line other than STEP and DIR
/// realtime:                      # or `enforce` or `warn` alone
///   policy: warn                 # if the computer is too slow for its axes: warn, or enforce:
///                                # don't start
///   max_lateness_ms: 5.0
///   late_steps: 0.25             # full steps by which pulses may be behind their plan
///   keep_cpus_awake: true        # with libgpiod; false: they may sleep, and wake late
///   cpu: 3                       # the processor of the pulse thread; left out: any
/// emergency_stop:
///   disable: hold                # what it does to the motors: hold, ramp or off (also false)
///   pin: "gpiochip0:25"          # optional: a button
///   active_level: high
///   bias: pull_up                # optional: as_is, pull_up, pull_down or disabled
/// motor_power:                   # optional: a relay that switches the power of all motors
///   pin: "gpiochip0:23"
///   active_level: high           # optional
///   on_ms: 200.0                 # until the power is there and the drivers have started
///   off_delay_ms: 0.0            # after an emergency stop
///   feedback: {pin: "gpiochip0:22", active_level: low, bias: pull_up}  # optional: a contact
///   feedback_timeout_ms: 1000.0
/// heartbeat:                     # optional: an output for an external monostable or safety relay
///   {pin: "gpiochip0:24", rate_hz: 100.0}
/// outputs:                       # optional: by their names
///   pen:
///     pin: "gpiochip0:5"
///     active_level: high         # optional
///     initial: off               # or on: from the start
///     at_stop: keep              # or off, on: at a stop of all axes
///     at_fault: off              # or on: the safe state
///     max_on_s: 10.0             # optional: then it is switched off
///     min_on_ms: 0.0
///     min_off_ms: 0.0
/// inputs:                        # optional: by their names
///   probe:
///     {pin: "gpiochip0:6", active_level: low, bias: pull_up, debounce_ms: 2.0}
/// state_file: ""                 # absolute path of the file that keeps positions; empty: no file
/// recorder:                      # the flight recorder
///   seconds: 10.0                # that it keeps; 0: nothing is recorded
///   memory_mb: 16.0              # for edges, at most
///   folder: ""                   # absolute path of its files; empty: the program decides
///   keep: 20                     # recordings in that folder
/// boards: {...}                  # see readBoards()
/// simulation: {...}              # see readSimulation(); only a simulated machine reads it
/// axes: {...}                    # see config::readAxes()
/// kinematics:                    # optional: axes that share motors
///   {type: corexy, axes: [x, y]} # or h_bot, differential, or matrix: [[1, 1], [1, -1]]
/// @endcode
///
/// @param reader of that map. It takes every issue.
/// @return to be used only if there was no issue.
MachineConfig readMachineConfig(config::ConfigReader& reader);

/// @throw ConfigError if there are issues. Their names are relative to the map that was read.
void throwIssues(std::vector<ConfigIssue> issues);

}  // namespace stepdriver::setup
