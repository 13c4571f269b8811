#include "stepdriver_core/config/axis_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace stepdriver::config {
namespace {

constexpr double kLargest = 1e9;  // decimals mean nothing above this

std::string roundedTo(int decimals, double number) {
  std::string text = fmt::format("{:.{}f}", number, decimals);
  if (decimals == 0) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

}  // namespace

std::string placeText(double position, Kind kind, double steps_per_unit) {
  const char* const unit = kind == Kind::kLinear ? "m" : "rad";
  if (!(std::abs(position) < kLargest)) return fmt::format("{:.9g} {}", position, unit);
  // There is no position between two microsteps: up to half a microstep, plus rounding, is 0.
  if (std::abs(position) * steps_per_unit <= 0.5 + 1e-6) position = 0.0;
  const int decimals = std::max(0, static_cast<int>(std::ceil(std::log10(steps_per_unit))));
  return fmt::format("{} {}", roundedTo(decimals, position), unit);
}

const char* sourceText(LimitSource source) {
  switch (source) {
    case LimitSource::kRobotDescription:
      return "robot_description";
    case LimitSource::kSetLimits:
      return "set_limits";
    case LimitSource::kChip:
      return "the chip's highest step rate";
    case LimitSource::kConfiguration:
      break;
  }
  return "the configuration";
}

}  // namespace stepdriver::config
