#pragma once

#include <optional>
#include <string>
#include <vector>

#include "gpio/chip_table.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::check {

/// A line of an axis or of the machine.
struct NamedLine {
  std::string pin;   ///< x/step, emergency_stop
  std::string line;  ///< its name in the file
};

/// @param machine its lines count too.
std::vector<NamedLine> linesOf(const std::vector<config::AxisConfig>& axes,
                               const machine::MachineOptions& machine = {});

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
