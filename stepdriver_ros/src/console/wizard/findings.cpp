#include "findings.h"

#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <utility>

#include "../driver_view.h"
#include "common/text.h"

namespace stepdriver::console {
namespace {

using config::ConfigValue;
using config::Kind;
using ros_node::roundedText;
using Map = ConfigValue::Map;

/// The map below a key, which is created if it is missing.
Map& below(Map& map, const std::string& key) {
  ConfigValue& value = map[key];
  if (value.as<Map>() == nullptr) value = ConfigValue(Map{});
  return *value.as<Map>();
}

std::optional<double> numberAt(const Map& map, const std::string& key) {
  const auto found = map.find(key);
  if (found == map.end()) return {};
  if (const int* integer = found->second.as<int>()) return *integer;
  if (const double* real = found->second.as<double>()) return *real;
  return {};
}

void invertDirection(Map& axis) {
  const auto found = axis.find("pins");
  Map* const pins = found != axis.end() ? found->second.as<Map>() : nullptr;
  if (pins != nullptr && pins->count("cw") > 0 && pins->count("ccw") > 0) {
    return std::swap((*pins)["cw"], (*pins)["ccw"]);
  }
  if (pins != nullptr && pins->count("in1") > 0 && pins->count("in4") > 0) {
    std::swap((*pins)["in1"], (*pins)["in4"]);
    return std::swap((*pins)["in2"], (*pins)["in3"]);
  }
  Map& invert = below(axis, "invert");
  const bool* const inverted = invert["dir"].as<bool>();
  invert["dir"] = inverted == nullptr || !*inverted;
}

void invertSwitch(Map& endstops, const std::string& end) {
  const auto found = endstops.find(end);
  if (found == endstops.end()) return;
  Map& endstop = below(endstops, end);
  const std::string* const level = endstop["active_level"].as<std::string>();
  endstop["active_level"] = level != nullptr && *level == "low" ? "high" : "low";
}

void swapSwitches(Map& endstops) {
  Map swapped;
  for (auto& [end, endstop] : endstops) {
    swapped[end == "min" ? "max" : end == "max" ? "min" : end] = std::move(endstop);
  }
  endstops = std::move(swapped);
}

/// Rounded to the accuracy of a rule, which is also easy to read.
double rounded(double number) {
  char text[32];
  std::snprintf(text, sizeof text, "%.7g", number);
  return std::strtod(text, nullptr);
}

/// Changes the key that scales the axis: fewer steps per mm mean a longer travel per revolution.
void scale(Map& axis, double factor) {
  for (const char* steps : {"steps_per_mm", "steps_per_degree"}) {
    if (const auto number = numberAt(axis, steps)) {
      axis[steps] = rounded(*number * factor);
      return;
    }
  }
  for (const char* length : {"mm_per_round", "wheel_diameter_mm"}) {
    if (const auto number = numberAt(axis, length)) {
      axis[length] = rounded(*number / factor);
      return;
    }
  }
  axis["gear_ratio"] = rounded(numberAt(axis, "gear_ratio").value_or(1.0) * factor);
}

/// What invertDirection() has done.
const char* turnText(driver::StepInputs inputs) {
  switch (inputs) {
    case driver::StepInputs::kStepDir:
      break;
    case driver::StepInputs::kCwCcw:
      return "pins/cw and pins/ccw are swapped";
    case driver::StepInputs::kPhases:
      return "pins/in1 and pins/in4, and pins/in2 and pins/in3, are swapped";
  }
  return "invert/dir is changed";
}

}  // namespace

ConfigValue corrected(ConfigValue parameters, const Findings& findings) {
  Map& axis = below(below(*parameters.as<Map>(), "axes"), findings.axis);
  if (findings.wrong_way) invertDirection(axis);
  if (findings.min_inverted) invertSwitch(below(axis, "endstops"), "min");
  if (findings.max_inverted) invertSwitch(below(axis, "endstops"), "max");
  if (findings.switches_swapped) swapSwitches(below(axis, "endstops"));
  if (findings.scale) scale(axis, *findings.scale);
  return parameters;
}

std::vector<std::string> changesText(const Findings& findings, const config::AxisConfig& config) {
  std::vector<std::string> changes;
  const std::string& axis = findings.axis;
  if (findings.wrong_way) {
    changes.push_back(axis + ": " + turnText(config.driver.step_inputs) +
                      ", because its plus was your minus");
  }
  if (findings.min_inverted) {
    changes.push_back(axis +
                      ": endstops/min/active_level is changed, because the switch was inverted");
  }
  if (findings.max_inverted) {
    changes.push_back(axis +
                      ": endstops/max/active_level is changed, because the switch was inverted");
  }
  if (findings.switches_swapped) {
    changes.push_back(axis + ": endstops/min and endstops/max are swapped");
  }
  if (findings.scale) {
    const double steps = config.steps_per_unit / config::configUnitsPerUnit(config.kind);
    changes.push_back(fmt::format("{}: {} steps per {} instead of {}", axis,
                                  roundedText(steps * *findings.scale), configUnitOf(config.kind),
                                  roundedText(steps)));
  }
  return changes;
}

}  // namespace stepdriver::console
