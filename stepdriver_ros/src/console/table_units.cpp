#include "table_units.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <regex>

#include "common/text.h"
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
  return fmt::format(
      "{} moves to {} in {} s{}", axis, place, ros_node::roundedText(duration),
      nearest == place ? "" : "; it comes to rest at " + nearest + ", the nearest microstep");
}

std::string inTableUnits(const std::string& text) {
  // A number, its unit, and what it is per: none for a position, `/s` for a speed.
  static const std::regex quantity(
      R"((^|[^\w.])(-?\d+(?:\.\d+)?(?:e[-+]?\d+)?) (m|rad)((?:/s(?:\^\d)?)?)(?![\w/^]))");
  std::string converted;
  auto rest = text.cbegin();
  for (std::sregex_iterator match(text.begin(), text.end(), quantity), end; match != end; ++match) {
    const bool linear = (*match)[3] == "m";
    const auto kind = linear ? config::Kind::kLinear : config::Kind::kRotary;
    const double value =
        std::strtod((*match)[2].str().c_str(), nullptr) * config::configUnitsPerUnit(kind);
    const std::string unit = linear ? "mm" : "deg";
    const std::string per = (*match)[4];
    converted.append(rest, (*match)[0].first);
    converted += (*match)[1].str() +
                 (per.empty() ? positionText(value, unit)
                              : fmt::format("{} {}{}", ros_node::roundedText(value), unit, per));
    rest = (*match)[0].second;
  }
  return converted.append(rest, text.cend());
}

}  // namespace stepdriver::console
