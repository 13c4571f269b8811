#pragma once

#include <memory>
#include <vector>

#include "gpio/chip_table.h"
#include "gpiod_calls.h"

namespace stepdriver::gpio::gpiod {

/// The computer's chips, by number. Symbolic links in /dev are ignored: some systems have them as
/// second names of a chip whose number has changed.
struct OpenChips {
  std::vector<ChipInfo> table;
  std::vector<std::unique_ptr<Chip>> chips;  // null if it couldn't be opened or read
};

OpenChips openChips();

}  // namespace stepdriver::gpio::gpiod
