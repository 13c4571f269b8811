#pragma once

#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/lines.h"

/// The lines of the computer's GPIO chips, through libgpiod. A line has the name
/// `chip:offset`, `label:offset`, or the one that the kernel gives it.
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

/// A line of a chip.
struct LineInfo {
  std::string name;      ///< the kernel's name of the line; most have none
  bool used = false;     ///< held by a program or by the kernel
  std::string consumer;  ///< the name under which its holder requested it; may be empty
};

/// A chip, whether it could be opened or not.
struct ChipInfo {
  std::string name;             ///< `gpiochip0`; may change from one boot to the next
  std::string label;            ///< such as `pinctrl-bcm2711`; doesn't change
  int error = 0;                ///< errno if it couldn't be opened or read; it then has no lines
  std::vector<LineInfo> lines;  ///< by offset
};

/// `1.6.3`; empty if stepdriver was built without libgpiod.
std::string libgpiodVersion();

/// @throw GpioError if stepdriver was built without libgpiod.
std::unique_ptr<Backend> makeLibgpiodBackend();

/// The current chips of the computer, by number, including those that may not be opened.
///
/// @throw GpioError if stepdriver was built without libgpiod.
///
/// @code{.cpp}
/// for (const gpio::ChipInfo& chip : gpio::gpioChips()) {
///   std::cout << chip.name << " (" << chip.label << "): " << chip.lines.size() << " lines\n";
/// }
/// @endcode
std::vector<ChipInfo> gpioChips();

}  // namespace stepdriver::gpio
