#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::check {

/// What to move.
struct MoveOrder {
  std::vector<config::AxisConfig> axes;  ///< all axes: their lines are held
  std::string only;                      ///< name of an axis; empty: all, one after the other
  std::optional<double> distance;        ///< [mm|deg] 1 mm or 10 degrees by default
  /// As configured. Nothing is measured, kept or recorded, whatever it says.
  machine::MachineOptions machine{};
};

/// The position to declare for an axis before a stroke of this length, both in its unit, so that
/// the stroke stays within the soft limits; 0 if that is possible.
double startFor(const config::AxisConfig& axis, double stroke);

/// Drives axes back and forth at their top speeds; each is disabled again afterwards.
///
/// @param say receives each line of text immediately.
/// @return whether each is back where it was. An interrupt (see InterruptWatch, whose signals are
///   blocked in this thread) decelerates, disables, and makes it false.
/// @throw GpioError if a line can't be requested.
bool moveForthAndBack(const MoveOrder& order, gpio::Backend& backend, pulse::Clock& clock,
                      const std::function<void(const std::string&)>& say);

}  // namespace stepdriver::check
