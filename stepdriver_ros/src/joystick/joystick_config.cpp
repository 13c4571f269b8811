#include "joystick_config.h"

#include "stepdriver_core/axis/config_reader.h"

namespace stepdriver::joystick {
namespace {

using axis::ConfigReader;
using axis::ConfigValue;
using axis::Presence;
using axis::Range;

constexpr Range kRates{1.0, 1000.0};
constexpr Range kTimeouts{0.02, 60.0};
constexpr Range kDeadBands{0.0, 0.99};
constexpr Range kExponents{0.1, 10.0};
constexpr Range kDisableTimes{0.0, 3600.0};
constexpr int kLastIndex = 255;
constexpr double kPi = 3.14159265358979323846;

const char* const kLinearSpeed = "max_speed_mm_s";
const char* const kRotarySpeed = "max_speed_deg_s";

/// @return [m/s|rad/s].
double readMaxSpeed(ConfigReader& axis) {
  const auto linear = axis.findNumber(kLinearSpeed, Range::positive(), Presence::kOptional);
  const auto rotary = axis.findNumber(kRotarySpeed, Range::positive(), Presence::kOptional);
  if (axis.has(kLinearSpeed) && axis.has(kRotarySpeed)) {
    axis.issue(kRotarySpeed, "is " + axis.shown(kRotarySpeed) + ", but " + kLinearSpeed +
                                 " must not be given with it: an axis is linear or rotary");
  } else if (axis.isMap() && !axis.has(kLinearSpeed) && !axis.has(kRotarySpeed)) {
    axis.issue(kLinearSpeed, std::string("is missing; it, or ") + kRotarySpeed +
                                 " of a rotary axis, must be a number above 0");
  }
  return linear ? *linear / 1000.0 : rotary.value_or(0.0) * kPi / 180.0;
}

JogAxis readAxis(const std::string& name, ConfigReader reader) {
  axis::checkAxisName(name, reader);
  JogAxis axis;
  axis.name = name;
  axis.joystick_axis = reader.integer("joystick_axis", 0, kLastIndex);
  axis.stick.max_speed = readMaxSpeed(reader);
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
      *tree.as<ConfigValue::Map>()->at("axes").as<ConfigValue::Map>();  // both were looked at
  if (map.empty()) each.issue("", "is empty, but must be a map of at least one axis");
  for (const auto& entry : map) axes.push_back(readAxis(entry.first, each.map(entry.first)));
  return axes;
}

}  // namespace

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
