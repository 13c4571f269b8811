#include "table_units.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <string_view>

#include "common/text.h"
#include "pattern.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::console {

std::string positionText(double value, const std::string& unit) {
  constexpr double kShownAsZero = 0.5e-4;
  return fmt::format("{:.4f} {}", std::abs(value) < kShownAsZero ? 0.0 : value, unit);
}

std::string moveText(const std::string& axis, const TableUnits& units, double target, double rest,
                     double duration) {
  const std::string place = units.place(target);
  const std::string nearest = units.place(rest);
  if (duration == 0.0) return fmt::format("{} is already at {}", axis, nearest);
  return fmt::format(
      "{} moves to {} in {} s{}", axis, place, ros_node::durationText(duration),
      nearest == place ? "" : "; it comes to rest at " + nearest + ", the nearest microstep");
}

std::string inTableUnits(const std::string& text) {
  // A number, its unit, and what it is per: none for a position, `/s` for a speed.
  static const Pattern quantity(
      "(^|[^[:alnum:]_.])(-?[0-9]+([.][0-9]+)?(e[-+]?[0-9]+)?) (m|rad)((/s(\\^[0-9])?)?)"
      "([^[:alnum:]_/^]|$)");
  std::string converted;
  std::size_t done = 0;
  for (auto parts = quantity.find(text); !parts.empty(); parts = quantity.find(text, done)) {
    const bool linear = parts[5] == "m";
    const auto kind = linear ? config::Kind::kLinear : config::Kind::kRotary;
    const double value =
        std::strtod(std::string(parts[2]).c_str(), nullptr) * config::configUnitsPerUnit(kind);
    const std::string unit = linear ? "mm" : "deg";
    const std::string_view per = parts[6];
    const auto begin = static_cast<std::size_t>(parts[2].data() - text.data());
    converted.append(text, done, begin - done);
    converted += per.empty() ? positionText(value, unit)
                             : fmt::format("{} {}{}", ros_node::roundedText(value), unit, per);
    // The character after it may be the one before the next.
    done = static_cast<std::size_t>(per.data() + per.size() - text.data());
  }
  return converted.append(text, done);
}

}  // namespace stepdriver::console
