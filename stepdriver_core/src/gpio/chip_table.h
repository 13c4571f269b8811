#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/libgpiod_lines.h"
#include "stepdriver_core/gpio/lines.h"

/// The GPIO chips of a machine as plain data, and how the names of lines are found in it.
namespace stepdriver::gpio {

/// The address of a line.
struct LineAddress {
  std::size_t chip;  ///< index in the table
  unsigned offset;

  bool operator==(const LineAddress& other) const {
    return chip == other.chip && offset == other.offset;
  }
};

/// Finds a line: `chip:offset`, `label:offset`, or the kernel's name of the line. A chip's name
/// takes precedence over a label, and both take precedence over the name of a line that looks like
/// one of them.
///
/// @throw GpioError if there is no such chip or line, if several have that label or name, or if the
///   offset is beyond the chip's lines; it lists the existing ones.
LineAddress findLine(const std::vector<ChipInfo>& chips, const std::string& line);

/// The lines of a request, outputs first.
///
/// @throw GpioError as findLine(), if two names refer to the same line, and if a line is in use.
std::vector<LineAddress> findLines(const std::vector<ChipInfo>& chips,
                                   const std::vector<OutputRequest>& outputs,
                                   const std::vector<InputRequest>& inputs);

/// A line as messages name it: `ENABLE_X (gpiochip0:17, pinctrl-bcm2711)`.
std::string describe(const std::vector<ChipInfo>& chips, const std::string& line,
                     LineAddress address);

/// Who holds a line, and what to do about it; continues a sentence that begins with the line's
/// description.
std::string busyText(const LineInfo& line);

/// An errno in words: `EACCES, permission denied`.
std::string errorText(int error);

/// The remedy for an errno about missing permissions; empty for others.
std::string remedyFor(int error);

}  // namespace stepdriver::gpio
