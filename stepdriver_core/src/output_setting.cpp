#include "output_setting.h"

#include <fmt/format.h>

#include "message_text.h"

namespace stepdriver {

std::string switchText(bool on, double value) {
  if (!on || value == 1.0) return on ? "on" : "off";
  return "on at " + numberText(value);
}

std::string whyNoValue(bool on, double value, bool is_pwm) {
  if (!on || value == 1.0) return "";
  const std::string wrong = "the value " + numberText(value);
  // As small a part as there is.
  constexpr double least = 1.0 / gpio::LineWrite::kWhole;
  if (!(value >= least && value <= 1.0)) {
    return fmt::format("{} must be from {} to 1; to switch it off, don't switch it on", wrong,
                       lowerBoundText(least));
  }
  return is_pwm ? "" : wrong + " is one of a PWM output, and this is none";
}

}  // namespace stepdriver
