#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/chip_table.h"
#include "stepdriver_core/gpio/lines.h"

/// The lines of the machine's GPIO chips, through libgpiod. Lines are named as findLine() says.
///
/// A request takes the inputs first, and then the outputs chip by chip, each chip's in one call of
/// the kernel. It looks for all lines, and for who holds them, before it takes the first: where one
/// can't be had nothing was touched, but for outputs that the kernel refuses only when it is asked.
/// The kernel knows the lines as held by `stepdriver`.
///
/// A write is one call of the kernel for each chip that it names, and a read is one. Where a chip
/// was removed they fail with ENODEV. Before it is released each output is driven to its safe
/// level, in the order of the request.
namespace stepdriver::gpio {

/// `1.6.3`; empty where stepdriver was built without libgpiod.
std::string libgpiodVersion();

/// @throw GpioError where stepdriver was built without libgpiod.
std::unique_ptr<Backend> makeLibgpiodBackend();

/// The machine's chips as they are now, by number; those too that may not be opened.
///
/// @throw GpioError where stepdriver was built without libgpiod.
std::vector<ChipInfo> gpioChips();

}  // namespace stepdriver::gpio
