#pragma once

#include <memory>
#include <vector>

#include "gpiod_calls.h"
#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::gpio::gpiod {

/// The machine's chips, by number. Symbolic links in /dev are left out: they are second names,
/// which some systems have for a chip that has moved.
struct OpenChips {
  std::vector<ChipInfo> table;
  std::vector<std::unique_ptr<Chip>> chips;  // null where it couldn't be opened or read
};

OpenChips openChips();

}  // namespace stepdriver::gpio::gpiod
