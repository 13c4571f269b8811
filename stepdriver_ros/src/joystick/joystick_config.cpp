#include "joystick_config.h"

#include <fmt/format.h>

#include "config/config_reader.h"

namespace stepdriver::joystick {
namespace {

using config::ConfigReader;
using config::ConfigValue;
using config::Kind;
using config::Presence;
using config::Range;

constexpr Range kRates{1.0, 1000.0};
constexpr Range kTimeouts{0.02, 60.0};
constexpr Range kDeadBands{0.0, 0.99};
constexpr Range kExponents{0.1, 10.0};
constexpr Range kDisableTimes{0.0, 3600.0};
constexpr int kLastIndex = 255;

void readMaxSpeed(ConfigReader& reader, JogAxis& axis) {
  const std::string linear_key = speedKey(Kind::kLinear);
  const std::string rotary_key = speedKey(Kind::kRotary);
  const auto linear = reader.findNumber(linear_key, Range::positive(), Presence::kOptional);
  const auto rotary = reader.findNumber(rotary_key, Range::positive(), Presence::kOptional);
  if (reader.has(linear_key) && reader.has(rotary_key)) {
    reader.issue(rotary_key,
                 fmt::format("is {}, but {} must not be given with it: an axis is linear or rotary",
                             reader.shown(rotary_key), linear_key));
  } else if (reader.isMap() && !reader.has(linear_key) && !reader.has(rotary_key)) {
    reader.issue(linear_key,
                 fmt::format("is missing; it, or {} of a rotary axis, must be a number above 0",
                             rotary_key));
  }
  axis.kind = rotary ? Kind::kRotary : Kind::kLinear;
  axis.max_speed = linear.value_or(rotary.value_or(0.0));
  axis.stick.max_speed = axis.max_speed / config::configUnitsPerUnit(axis.kind);
}

JogAxis readAxis(const std::string& name, ConfigReader reader) {
  config::checkAxisName(name, reader);
  JogAxis axis;
  axis.name = name;
  axis.joystick_axis = reader.integer("joystick_axis", 0, kLastIndex);
  readMaxSpeed(reader, axis);
  axis.stick.inverted = reader.boolean("inverted", axis.stick.inverted);
  axis.stick.dead_band = reader.number("dead_band", kDeadBands, axis.stick.dead_band);
  axis.stick.exponent = reader.number("exponent", kExponents, axis.stick.exponent);
  axis.disable_in_dead_band = reader.boolean("disable_in_dead_band", axis.disable_in_dead_band);
  axis.disable_after = reader.number("disable_after_s", kDisableTimes, axis.disable_after);
  reader.rejectUnknown();
  return axis;
}

std::vector<JogAxis> readAxes(ConfigReader& reader, const ConfigValue& tree) {
  std::vector<JogAxis> axes;
  if (!reader.isMap()) return axes;
  reader.allow("axes");
  if (!reader.has("axes")) {
    reader.issue("axes", "is missing; it must be a map of at least one axis");
    return axes;
  }
  ConfigReader each = reader.map("axes");
  if (!each.isMap()) return axes;
  const auto& map =
      *tree.as<ConfigValue::Map>()->at("axes").as<ConfigValue::Map>();  // both exist: checked above
  if (map.empty()) each.issue("", "is empty, but must be a map of at least one axis");
  for (const auto& entry : map) axes.push_back(readAxis(entry.first, each.map(entry.first)));
  return axes;
}

}  // namespace

const char* speedKey(Kind kind) {
  return kind == Kind::kLinear ? "max_speed_mm_s" : "max_speed_deg_s";
}

JoystickConfig readJoystickConfig(const ConfigValue& tree, const std::string& name,
                                  std::vector<ConfigIssue>& issues) {
  JoystickConfig config;
  ConfigReader reader(tree, name, issues);
  config.driver = reader.text("driver", config.driver);
  config.rate = reader.number("rate", kRates, config.rate);
  config.joy_timeout = reader.number("joy_timeout", kTimeouts, config.joy_timeout);
  config.deadman_button = reader.integer("deadman_button", -1, kLastIndex, config.deadman_button);
  config.axes = readAxes(reader, tree);
  reader.rejectUnknown();
  return config;
}

}  // namespace stepdriver::joystick
