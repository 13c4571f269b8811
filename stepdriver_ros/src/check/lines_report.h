#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::check {

/// A line of an axis or of the emergency stop.
struct NamedLine {
  std::string pin;   ///< x/step, emergency_stop
  std::string line;  ///< its name in the file
};

std::vector<NamedLine> linesOf(const std::vector<config::AxisConfig>& axes,
                               const std::optional<config::InputSwitch>& emergency_stop = {});

/// The existing chips, and the lines that the file names.
struct LinesReport {
  std::string text;
  std::size_t missing = 0;  ///< lines that aren't available
};

LinesReport linesReport(const std::vector<gpio::ChipInfo>& chips,
                        const std::vector<NamedLine>& lines);

/// Only the chips.
std::string chipsText(const std::vector<gpio::ChipInfo>& chips);

}  // namespace stepdriver::check
