#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/chip_table.h"
#include "stepdriver_core/gpio/lines.h"

/// The lines of the computer's GPIO chips, through libgpiod. Lines have the names that findLine()
/// accepts.
///
/// A request takes the inputs first, and then the outputs chip by chip, each chip's in one kernel
/// call. It finds all lines and their holders before it takes the first: if one isn't available,
/// nothing was touched, except if the kernel itself refuses an output. The kernel lists
/// `stepdriver` as the holder of the lines.
///
/// A write makes one kernel call for each chip that it names, and a read makes one. If a chip was
/// removed they fail with ENODEV. Each output is driven to its safe level before it is released, in
/// the order of the request.
namespace stepdriver::gpio {

/// `1.6.3`; empty if stepdriver was built without libgpiod.
std::string libgpiodVersion();

/// @throw GpioError if stepdriver was built without libgpiod.
std::unique_ptr<Backend> makeLibgpiodBackend();

/// The current chips of the computer, by number, including those that may not be opened.
///
/// @throw GpioError if stepdriver was built without libgpiod.
std::vector<ChipInfo> gpioChips();

}  // namespace stepdriver::gpio
