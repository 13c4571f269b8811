#pragma once

#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::check {

/// A line that an axis or the emergency stop is wired to.
struct NamedLine {
  std::string pin;   ///< x/step, emergency_stop
  std::string line;  ///< as the file names it
};

std::vector<NamedLine> linesOf(const std::vector<config::AxisConfig>& axes,
                               const std::optional<config::InputSwitch>& emergency_stop = {});

/// What there is, and what of it the file asks for.
struct LinesReport {
  std::string text;
  std::size_t missing = 0;  ///< lines that can't be had
};

LinesReport linesReport(const std::vector<gpio::ChipInfo>& chips,
                        const std::vector<NamedLine>& lines);

/// The chips alone.
std::string chipsText(const std::vector<gpio::ChipInfo>& chips);

}  // namespace stepdriver::check
