#include "driver_axes.h"

#include <fmt/format.h>

#include <optional>

namespace stepdriver::joystick {
namespace {

using config::ConfigValue;

std::optional<double> numberAt(const ConfigValue::Map& map, const std::string& key) {
  const auto found = map.find(key);
  if (found == map.end()) return {};
  if (const int* integer = found->second.as<int>()) return *integer;
  if (const double* real = found->second.as<double>()) return *real;
  return {};
}

std::string namesOf(const ConfigValue::Map& axes) {
  std::string names;
  for (const auto& entry : axes) names += (names.empty() ? "" : ", ") + entry.first;
  return names;
}

}  // namespace

void checkDriverAxes(const JoystickConfig& joystick, const std::string& name,
                     const ConfigValue& driver_axes, const std::string& driver,
                     std::vector<ConfigIssue>& issues) {
  const auto* axes = driver_axes.as<ConfigValue::Map>();
  if (axes == nullptr) return;
  for (const JogAxis& axis : joystick.axes) {
    const std::string key = name + "/axes/" + axis.name;
    const auto found = axes->find(axis.name);
    if (found == axes->end()) {
      issues.push_back(
          {key, fmt::format("isn't an axis of {}, which has {}", driver, namesOf(*axes)), true});
      continue;
    }
    const auto* own = found->second.as<ConfigValue::Map>();
    if (own == nullptr) continue;
    const char* const wanted = speedKey(axis.kind);
    const char* const other = speedKey(axis.kind == config::Kind::kLinear ? config::Kind::kRotary
                                                                          : config::Kind::kLinear);
    const std::string theirs = fmt::format("{}/axes/{}/", driver, axis.name);
    const auto most = numberAt(*own, wanted);
    if (!most && numberAt(*own, other)) {
      issues.push_back({key + "/" + wanted,
                        fmt::format("must be {0}, because there is a {1}{0}", other, theirs)});
    } else if (most && axis.max_speed > *most) {
      issues.push_back(
          {key + "/" + wanted, fmt::format("is {}, but must be at most {}{}, which is {}",
                                           ConfigValue(axis.max_speed).shown(), theirs, wanted,
                                           ConfigValue(*most).shown())});
    }
  }
}

}  // namespace stepdriver::joystick
