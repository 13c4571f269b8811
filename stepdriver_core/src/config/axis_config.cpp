#include "stepdriver_core/config/axis_config.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "message_text.h"

namespace stepdriver::config {
namespace {

constexpr double kLargest = 1e9;    // decimals mean nothing above this
constexpr double kRounding = 1e-6;  // [microsteps] the rounding of sums

std::string roundedTo(int decimals, double number) {
  std::string text = fmt::format("{:.{}f}", number, decimals);
  if (decimals == 0) return text;
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text;
}

}  // namespace

std::string placeText(double position, Kind kind, double steps_per_unit) {
  if (!(std::abs(position) < kLargest)) return fmt::format("{:.9g} {}", position, unitOf(kind));
  // There is no position between two microsteps: up to half a microstep, plus rounding, is 0.
  if (std::abs(position) * steps_per_unit <= 0.5 + kRounding) position = 0.0;
  const int decimals = std::max(0, static_cast<int>(std::ceil(std::log10(steps_per_unit))));
  return fmt::format("{} {}", roundedTo(decimals, position), unitOf(kind));
}

std::string distanceText(double distance, Kind kind, double steps_per_unit) {
  const double steps = std::abs(distance) * steps_per_unit;
  if (!(steps > kRounding && steps < 1.0 - kRounding)) {
    return placeText(distance, kind, steps_per_unit);
  }
  const int decimals = 1 + static_cast<int>(std::ceil(-std::log10(std::abs(distance))));
  return fmt::format("{} {}", roundedTo(std::max(0, decimals), distance), unitOf(kind));
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

driver::Timing AxisConfig::timing() const {
  driver::Timing longest = driver.timing;
  for (const MotorConfig& twin : twins) longest = longestOf(longest, twin.driver.timing);
  return longest;
}

std::string AxisConfig::driverTitles() const {
  std::vector<std::string> titles;
  for (std::size_t i = 0; i < motors(); ++i) {
    const std::string& title = motorAt(i).driver.title;
    if (std::find(titles.begin(), titles.end(), title) == titles.end()) titles.push_back(title);
  }
  return listText(titles, "and");
}

double highestMotorSpeed(const Kinematics& kinematics, std::size_t motor,
                         const std::vector<AxisConfig>& axes) {
  double speed = 0.0;
  for (const AxisConfig& axis : axes) {
    const std::size_t number = kinematics.numberOf(axis.name);
    if (number == kinematics.axes.size()) continue;
    speed += std::abs(kinematics.matrix[motor][number]) * axis.max_speed;
  }
  return speed;
}

}  // namespace stepdriver::config
