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

/// @param pwm_folder with the PWM chips of the kernel.
LinesReport linesReport(const std::vector<gpio::ChipInfo>& chips,
                        const std::vector<NamedLine>& lines,
                        const std::string& pwm_folder = "/sys/class/pwm");

/// Only the chips.
std::string chipsText(const std::vector<gpio::ChipInfo>& chips);

}  // namespace stepdriver::check
