#pragma once

#include <vector>

#include "config/config_reader.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::setup {

/// Reads the map `boards` of a configuration, with the names of boards as keys.
///
/// @code{.yaml}
/// boards:                        # optional: boards with Klipper's firmware, by their names
///   mcu:                         # its lines are mcu:gpio12 and so on
///     port: /dev/serial/by-id/usb-Klipper_rp2040_E6605838834E3A2F-if00
///     baud: 250000               # of a port that isn't USB
///     ahead_ms: 50.0             # how long before its time a step is sent, and a stop begins
///     step_error_us: 0.0         # how far a step may be from its time; 0: a tick of its clock
///     reset: false               # true: a board that another program has configured is reset
/// @endcode
std::vector<BoardConfig> readBoards(config::ConfigReader boards);

}  // namespace stepdriver::setup
