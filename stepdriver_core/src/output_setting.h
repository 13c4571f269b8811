#pragma once

#include <cmath>
#include <cstdint>
#include <string>

#include "stepdriver_core/gpio/lines.h"

namespace stepdriver {

/// What an output with a name is switched to.
struct OutputSetting {
  bool on = false;
  /// Of a PWM output that is on: see gpio::LineWrite. Otherwise all of it.
  std::uint16_t part = gpio::LineWrite::kWhole;

  /// @param value of an output that is on: above 0, to 1.
  static OutputSetting of(bool on, double value) {
    OutputSetting setting{on};
    if (on) setting.part = static_cast<std::uint16_t>(std::lround(value * setting.part));
    return setting;
  }
  /// 0: it is off; 1: it is on as far as it can be.
  double value() const { return on ? static_cast<double>(part) / gpio::LineWrite::kWhole : 0.0; }
};

inline bool operator==(const OutputSetting& one, const OutputSetting& other) {
  return one.on == other.on && one.part == other.part;
}
inline bool operator!=(const OutputSetting& one, const OutputSetting& other) {
  return !(one == other);
}

/// "off", "on" or "on at 0.25".
std::string switchText(bool on, double value);
/// Why an output can't be switched to a value; empty: it can.
std::string whyNoValue(bool on, double value, bool is_pwm);

}  // namespace stepdriver
