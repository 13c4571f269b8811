#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/setup/machine_config.h"

namespace stepdriver::setup {

/// What a check of the drivers has found: "x: the TMC2209 answers on /dev/serial0 at address 0".
struct DriverFinding {
  bool is_right = false;
  std::string text;  ///< with the likely cause if it isn't right
};

/// Asks the drivers that have a config::TmcConfig whether they are there, and which chip they are,
/// while no machine uses them.
///
/// @param wiring whether to test the lines to ENABLE, STEP and DIR too. Nothing moves: the outputs
///   of all these chips are switched off by their registers first, and stay off until a
///   machine::Machine has set them up. If one of them can't be switched off, no line is touched.
///   Then each line is driven to both levels, and the chips are asked which of their pins follows.
/// @return for each driver one finding, and then one for each of its lines.
/// @throw GpioError if a line can't be requested or written.
///
/// @code{.cpp}
/// for (const setup::DriverFinding& found : setup::checkDrivers(config.axes, backend, true)) {
///   std::cout << (found.is_right ? "   " : "!! ") << found.text << "\n";
/// }
/// @endcode
std::vector<DriverFinding> checkDrivers(const std::vector<config::AxisConfig>& axes,
                                        gpio::Backend& backend, bool wiring);

/// Asks the boards which firmware they have, while no machine uses them. Nothing is configured, and
/// nothing moves.
///
/// @return for each board one finding: "mcu: rp2040 at 12 MHz, firmware v0.12.0".
std::vector<DriverFinding> checkBoards(const std::vector<BoardConfig>& boards);

}  // namespace stepdriver::setup
