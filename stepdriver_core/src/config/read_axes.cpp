#include "config/read_axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstddef>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "config/config_reader.h"
#include "message_text.h"
#include "printable.h"
#include "read_chip.h"
#include "read_homing.h"
#include "read_motion.h"
#include "read_motors.h"
#include "read_pins.h"
#include "read_power.h"
#include "read_shaper.h"
#include "read_shared_switches.h"

namespace stepdriver::config {
namespace {

bool isLetter(char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); }

/// All motors have the same mode: one that each driver has.
std::optional<int> readMicrosteps(ConfigReader& axis, const std::vector<MotorChip>& chips) {
  std::optional<std::vector<int>> modes;
  for (const MotorChip& motor : chips) {
    const auto& chip = motor.chip;
    if (!chip || chip->microsteps.empty()) continue;
    if (!modes) modes = chip->microsteps;
    const auto is_missing = [&own = chip->microsteps](int mode) {
      return std::find(own.begin(), own.end(), mode) == own.end();
    };
    modes->erase(std::remove_if(modes->begin(), modes->end(), is_missing), modes->end());
  }
  if (modes && modes->empty()) {
    axis.allow("microsteps");
    axis.contradiction("motors", "have drivers with no number of microsteps in common");
    return {};
  }
  const auto has_unused_registers = [](const MotorChip& motor) {
    return motor.chip && !motor.tmc &&
           driver::registerBusOf(*motor.chip) != driver::RegisterBus::kNone;
  };
  if (modes) {
    const bool by_registers = std::all_of(chips.begin(), chips.end(), has_unused_registers);
    return axis.findOneOf("microsteps", *modes, Presence::kRequired,
                          by_registers ? "; with a section tmc: also by registers, 1 to 256" : "");
  }
  return axis.findInteger("microsteps", 1, kFinestMicrosteps, Presence::kRequired);
}

/// A mode that the chip has only with a strapped pin can't be selected by lines.
void checkSelectable(ConfigReader& axis, const AxisConfig& config, const MotorConfig& motor) {
  if (!motor.pins.ms1.wired() || driver::codeOf(motor.driver, config.microsteps)) return;
  std::vector<std::string> modes;
  for (const int mode : driver::selectableMicrosteps(motor.driver)) {
    modes.push_back(std::to_string(mode));
  }
  axis.contradiction("microsteps",
                     fmt::format("is {}, but with the microstep pins wired it must be {}: lines "
                                 "that are high or low select no other mode of the {}",
                                 axis.shown("microsteps"), listText(modes), motor.driver.title));
}

/// The key of the time that bounds the steps' interval: that of the driver whose DIR must be held
/// longest.
std::string dirHoldKey(const AxisConfig& config, const std::vector<MotorChip>& chips) {
  std::size_t longest = 0;
  for (std::size_t i = 1; i < config.motors(); ++i) {
    const auto hold = [&config](std::size_t motor) {
      return config.motorAt(motor).driver.timing.dir_hold_ns;
    };
    if (hold(i) > hold(longest)) longest = i;
  }
  return chips.at(longest).key + "timing/dir_hold_us";
}

class AxesReader {
 public:
  AxesReader(const std::vector<ConfigIssue>& issues, UsedLines& used, const OwnChips& own)
      : issues_(issues), used_(used), own_(own) {}

  AxisConfig read(const std::string& name, ConfigReader axis) {
    AxisConfig config;
    config.name = name;
    checkAxisName(name, axis);
    const std::size_t issues_of_chip = issues_.size();
    const std::vector<MotorChip> chips = readMotorChips(axis, own_, ports_);
    const bool chips_are_right = issues_.size() == issues_of_chip;
    MotionContext context;
    context.microsteps = readMicrosteps(axis, chips);
    config.microsteps = context.microsteps.value_or(1);
    config.joint = readJoint(name, axis);
    const std::size_t issues_before = issues_.size();
    readMotors(axis, chips, config, used_);
    for (std::size_t i = 0; i < config.motors(); ++i) {
      if (chips[i].chip && context.microsteps) checkSelectable(axis, config, config.motorAt(i));
    }
    const bool pins_are_right = issues_.size() == issues_before;
    if (chips_are_right) context.timing = config.timing();
    context.both_edges = config.stepsOnBothEdges();
    const std::string titles = config.driverTitles();
    context.drivers_take =
        "the " + titles + (titles == config.driver.title ? " takes" : " together take");
    context.dir_hold_key = dirHoldKey(config, chips);
    readPower(axis, pins_are_right, config);
    readBrake(axis, pins_are_right, config, used_);
    const std::optional<Kind> kind = readMotion(axis, context, config);
    readSpeedsOfChips(axis, config);
    readSharedEnds(axis, kind, config);
    readShaper(axis, kind, config);
    readHoming(axis, kind, config);
    readSquaring(axis, kind, config);
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
  const OwnChips& own_;
  UsedPorts ports_;
  std::map<std::string, std::string> joints_;  ///< joint -> full name of its axis
};

}  // namespace

bool isName(const std::string& name) {
  if (name.empty() || !isLetter(name.front())) return false;
  for (const char c : name) {
    if (!isLetter(c) && !(c >= '0' && c <= '9') && c != '_') return false;
  }
  return true;
}

void checkAxisName(const std::string& name, ConfigReader& axis) {
  if (isName(name)) return;
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
                                 std::vector<ConfigIssue>& issues, UsedLines& used,
                                 const OwnChips& own) {
  if (axes.isNothing()) {
    issues.push_back({name, "is missing; it must be a map of at least one axis"});
    return {};
  }
  ConfigReader reader(axes, name, issues);
  std::vector<AxisConfig> configs;
  if (!reader.isMap()) return configs;
  const auto& map = *axes.as<ConfigValue::Map>();
  if (map.empty()) reader.issue("", "is empty, but must be a map of at least one axis");
  AxesReader each(issues, used, own);
  for (const std::string& key : axes.orderedKeys()) {
    configs.push_back(each.read(key, reader.map(key)));
  }
  checkSharedSwitches(configs, name, issues);
  return configs;
}

}  // namespace stepdriver::config
