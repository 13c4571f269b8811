#pragma once

#include <cstdint>
#include <optional>
#include <string>

namespace stepdriver {

/// A PWM output of the kernel, as an output line with two levels: each level is a length of its
/// pulses.
struct PwmLine {
  int chip = 0;     ///< the number of the folder /sys/class/pwm/pwmchip<number>
  int channel = 0;  ///< of the chip
  std::int64_t period_ns = 0;
  std::int64_t off_ns = 0;  ///< [ns] how long each pulse is while the line is low, 0 to period_ns
  std::int64_t on_ns = 0;   ///< [ns] the same while it is high

  /// [ns] How long they are while it is high in part: see gpio::LineWrite.
  std::int64_t lengthOf(std::uint16_t part) const;
  /// The channel as messages name it: "pwmchip0:1".
  std::string name() const;
  /// The name of the line, which contains all of it: "pwmchip0:1/20000000/1000000/2000000".
  std::string text() const;
};

/// @return empty: the name of the line is that of another one.
std::optional<PwmLine> pwmLineOf(const std::string& line);

}  // namespace stepdriver
