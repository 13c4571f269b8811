#include "config/read_axes.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <map>
#include <optional>
#include <string>

#include "read_homing.h"
#include "read_motion.h"
#include "read_pins.h"
#include "read_power.h"
#include "stepdriver_core/config/config_reader.h"
#include "stepdriver_core/printable.h"

namespace stepdriver::config {
namespace {

constexpr double kNsPerUs = 1e3;
constexpr double kNsPerMs = 1e6;
constexpr double kLongestUs = 1e6;
constexpr double kLongestMs = 1e4;
// A nanosecond: a shorter pulse would be no pulse.
constexpr double kShortestPulseUs = 1e-3;

struct TimingKey {
  const char* key;
  std::int64_t driver::Timing::*time;
  double ns_per_unit;
  double min;
  double max;
};

constexpr std::array<TimingKey, 10> kTimingKeys{
    {{"step_high_us", &driver::Timing::step_high_ns, kNsPerUs, kShortestPulseUs, kLongestUs},
     {"step_low_us", &driver::Timing::step_low_ns, kNsPerUs, kShortestPulseUs, kLongestUs},
     {"dir_setup_us", &driver::Timing::dir_setup_ns, kNsPerUs, 0.0, kLongestUs},
     {"dir_hold_us", &driver::Timing::dir_hold_ns, kNsPerUs, 0.0, kLongestUs},
     {"mode_setup_us", &driver::Timing::mode_setup_ns, kNsPerUs, 0.0, kLongestUs},
     {"mode_hold_us", &driver::Timing::mode_hold_ns, kNsPerUs, 0.0, kLongestUs},
     {"enable_ms", &driver::Timing::enable_ns, kNsPerMs, 0.0, kLongestMs},
     {"wake_ms", &driver::Timing::wake_ns, kNsPerMs, 0.0, kLongestMs},
     {"reset_low_ms", &driver::Timing::reset_low_ns, kNsPerMs, 0.0, kLongestMs},
     {"reset_wait_ms", &driver::Timing::reset_wait_ns, kNsPerMs, 0.0, kLongestMs}}};

bool isLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

bool isAxisName(const std::string& name) {
  if (name.empty() || !isLetter(name.front())) return false;
  for (const char c : name) {
    if (!isLetter(c) && !(c >= '0' && c <= '9') && c != '_') return false;
  }
  return true;
}

/// Overrides the chip's timings. @return empty if one is wrong.
std::optional<driver::Timing> readTiming(ConfigReader& axis, const driver::Timing& of_chip) {
  ConfigReader reader = axis.map("timing");
  driver::Timing timing = of_chip;
  bool all_right = reader.isMap();
  for (const TimingKey& key : kTimingKeys) {
    const auto time = reader.findNumber(key.key, {key.min, key.max}, Presence::kOptional);
    if (time) timing.*key.time = std::llround(*time * key.ns_per_unit);
    all_right = all_right && time.has_value() == reader.has(key.key);
  }
  reader.rejectUnknown();
  if (!all_right) return {};
  return timing;
}

const driver::DriverChip* readDriver(ConfigReader& axis) {
  const auto* name = axis.value("driver").as<std::string>();
  const auto* chip = name != nullptr ? driver::findDriverChip(*name) : nullptr;
  if (chip == nullptr) axis.findOneOf("driver", driver::driverChipNames(), Presence::kRequired);
  axis.allow("driver");
  return chip;
}

std::optional<int> readMicrosteps(ConfigReader& axis, const driver::DriverChip* chip) {
  if (chip != nullptr) return axis.findOneOf("microsteps", chip->microsteps, Presence::kRequired);
  return axis.findInteger("microsteps", 1, 256, Presence::kRequired);
}

class AxesReader {
 public:
  AxesReader(const std::vector<ConfigIssue>& issues, UsedLines& used)
      : issues_(issues), used_(used) {}

  AxisConfig read(const std::string& name, ConfigReader axis) {
    AxisConfig config;
    config.name = name;
    checkAxisName(name, axis);
    const driver::DriverChip* chip = readDriver(axis);
    MotionContext context;
    context.microsteps = readMicrosteps(axis, chip);
    context.timing = readTiming(axis, chip != nullptr ? chip->timing : driver::Timing{});
    if (chip != nullptr) {
      config.driver = chip->model;
      context.chip_title = chip->title;
    } else {
      context.timing.reset();
    }
    config.microsteps = context.microsteps.value_or(1);
    config.timing = context.timing.value_or(driver::Timing{});
    config.joint = readJoint(name, axis);
    const std::size_t issues_before = issues_.size();
    readPins(axis, chip, config, used_);
    readPower(axis, issues_.size() == issues_before, config);
    readEndstops(axis, config, used_);
    readHoming(axis, readMotion(axis, context, config), config);
    config.align_on_microstep_change =
        axis.boolean("align_on_microstep_change", config.align_on_microstep_change);
    axis.rejectUnknown();
    return config;
  }

 private:
  std::string readJoint(const std::string& axis_name, ConfigReader& axis) {
    const auto given = axis.findText("joint", Presence::kOptional);
    // A wrong joint or axis name has been reported already.
    if (axis.has("joint") ? !given : axis_name.empty()) return axis_name;
    std::string joint = given.value_or(axis_name);
    if (joint.empty()) {
      axis.issue("joint", "is \"\", but must be the name of a joint");
      return axis_name;
    }
    const auto [user, is_new] = joints_.emplace(joint, axis.fullName(""));
    if (!is_new) {
      axis.contradiction(
          "joint", fmt::format("is \"{}\"{}, but must be another: it is the joint of {} already",
                               joint, given ? "" : ", the axis's name", user->second));
    }
    return joint;
  }

  const std::vector<ConfigIssue>& issues_;
  UsedLines& used_;
  std::map<std::string, std::string> joints_;  ///< joint -> full name of its axis
};

}  // namespace

void checkAxisName(const std::string& name, ConfigReader& axis) {
  if (isAxisName(name)) return;
  axis.issue("", fmt::format("has the name \"{}\", but an axis's name must begin with a letter and "
                             "continue with letters, digits and _ only",
                             printable(name)));
}

std::vector<AxisConfig> readAxes(const ConfigValue& axes, const std::string& name,
                                 std::vector<ConfigIssue>& issues) {
  UsedLines used(issues);
  return readAxes(axes, name, issues, used);
}

std::vector<AxisConfig> readAxes(const ConfigValue& axes, const std::string& name,
                                 std::vector<ConfigIssue>& issues, UsedLines& used) {
  if (axes.isNothing()) {
    issues.push_back({name, "is missing; it must be a map of at least one axis"});
    return {};
  }
  ConfigReader reader(axes, name, issues);
  std::vector<AxisConfig> configs;
  if (!reader.isMap()) return configs;
  const auto& map = *axes.as<ConfigValue::Map>();
  if (map.empty()) reader.issue("", "is empty, but must be a map of at least one axis");
  AxesReader each(issues, used);
  for (const auto& entry : map) configs.push_back(each.read(entry.first, reader.map(entry.first)));
  return configs;
}

}  // namespace stepdriver::config
