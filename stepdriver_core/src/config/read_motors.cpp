#include "read_motors.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "bounds.h"
#include "message_text.h"
#include "motion_keys.h"
#include "read_chip.h"
#include "read_motion.h"
#include "read_pins.h"

namespace stepdriver::config {
namespace {

/// The keys that a motor has of its own if there are several.
constexpr std::array<const char*, 9> kMotorKeys = {
    "pins",       "tmc",        "invert",           "common_anode",
    "fault_bias", "fault_stop", "in_position_bias", "in_position_timeout_ms",
    "endstops"};

/// The keys of a driver: of the axis's, or of a motor's own.
constexpr std::array<const char*, 3> kChipKeys = {"driver", "chip", "timing"};

std::set<std::string> pinsGiven(const ConfigReader& motor) {
  std::set<std::string> pins;
  const ConfigValue value = motor.value("pins");
  if (const auto* map = value.as<ConfigValue::Map>()) {
    for (const auto& entry : *map) pins.insert(entry.first);
  }
  return pins;
}

/// The pins that switch the current of all motors: either all have them, or no motor.
struct CurrentPin {
  const char* key;
  Pin Pins::*pin;
};
constexpr std::array<CurrentPin, 2> kCurrentPins{
    {{"enable", &Pins::enable}, {"sleep", &Pins::sleep}}};

void checkSamePins(ConfigReader& motors, const AxisConfig& config) {
  for (const MotorConfig& twin : config.twins) {
    for (const CurrentPin& pin : kCurrentPins) {
      const auto is_wired = [&pin](const MotorConfig& motor) {
        return (motor.pins.*pin.pin).wired();
      };
      if (is_wired(config) == is_wired(twin)) continue;
      const bool twin_lacks = is_wired(config);
      const std::string& with = twin_lacks ? config.motor : twin.motor;
      const std::string& without = twin_lacks ? twin.motor : config.motor;
      motors.contradiction(
          without,
          fmt::format("has no pins/{}, but must have one, because {} has one: the motors of "
                      "an axis are switched together",
                      pin.key, motors.fullName(with)));
    }
  }
}

/// Their steps are the same edges.
void checkSameEdges(ConfigReader& motors, const AxisConfig& config) {
  const auto edges = [](const driver::DriverChip& chip) {
    return chip.step_inputs == driver::StepInputs::kPhases  ? "switches the coils of its motor"
           : chip.both_edges                                ? "steps on both edges of STEP"
           : chip.step_inputs == driver::StepInputs::kCwCcw ? "has CW and CCW inputs"
                                                            : "steps on one edge of STEP";
  };
  for (const MotorConfig& twin : config.twins) {
    const std::string own = edges(twin.driver);
    const std::string first = edges(config.driver);
    if (own == first) continue;
    motors.contradiction(
        twin.motor, fmt::format("has a driver, {}, that {}, but must have one like that of {}, {}, "
                                "that {}: the motors of an axis get the same edges",
                                twin.driver.title, own, motors.fullName(config.motor),
                                config.driver.title, first));
  }
}

class SquaringReader {
 public:
  SquaringReader(ConfigReader& axis, Kind kind, AxisConfig& config)
      : axis_(axis),
        keys_(motionKeys(kind)),
        offset_key_(offsetKey(kind)),
        units_per_si_(static_cast<double>(keys_.units_per_si_unit)),
        config_(config) {}

  void read() {
    const std::size_t switches = homeSwitches();
    squares_ = config_.motors() > 1 && switches == config_.motors();
    if (switches > 1 && !squares_) {
      axis_.contradiction("motors",
                          fmt::format("has {} motors with a switch at the home end, but must have "
                                      "{}, to be squared, or 1",
                                      switches, config_.motors()));
    }
    const auto presence = squares_ ? Presence::kRequired : Presence::kOptional;
    const auto skew = axis_.findNumber(keys_.max_skew, Range::positive(), presence);
    config_.max_skew = skew.value_or(0.0) / units_per_si_;
    if (!squares_ && skew) axis_.contradiction(keys_.max_skew, kNothingToSquare);
    if (config_.motors() > 1) readOffsets();
  }

 private:
  static constexpr const char* kNothingToSquare =
      "is given, but is only for several motors that a homing squares, each with a switch at the "
      "home end";

  std::size_t homeSwitches() const {
    if (!config_.homing || config_.homing->kind != HomingKind::kLimit) return 0;
    std::size_t switches = 0;
    for (std::size_t i = 0; i < config_.motors(); ++i) {
      const MotorConfig& motor = config_.motorAt(i);
      if (config_.homing->at_max ? motor.endstop_max : motor.endstop_min) ++switches;
    }
    return switches;
  }

  void readOffsets() {
    ConfigReader motors = axis_.map("motors");
    readOffset(motors, config_);
    for (MotorConfig& twin : config_.twins) readOffset(motors, twin);
  }

  void readOffset(ConfigReader& motors, MotorConfig& motor) {
    ConfigReader reader = motors.map(motor.motor);
    const auto offset = reader.findNumber(offset_key_, Range{}, Presence::kOptional);
    if (!offset) return;
    motor.offset = *offset / units_per_si_;
    if (!squares_) return reader.contradiction(offset_key_, kNothingToSquare);
    const double most = std::min(config_.homing->pull_off, config_.max_skew / 2) * units_per_si_;
    if (std::abs(*offset) > most * kSlack) {
      reader.contradiction(
          offset_key_,
          fmt::format("is {}, but must be from -{} to {}: at most the homing's pull-off "
                      "and half of {}",
                      reader.shown(offset_key_), roughText(most), roughText(most), keys_.max_skew));
    } else if (*offset != 0.0 && config_.backlash > 0.0) {
      reader.contradiction(offset_key_,
                           fmt::format("is {}, but must be 0 if there is {}: one motor can't be "
                                       "moved alone by less than its backlash",
                                       reader.shown(offset_key_), axis_.fullName(keys_.backlash)));
    }
  }

  ConfigReader& axis_;
  const MotionKeys& keys_;
  const char* const offset_key_;
  const double units_per_si_;
  AxisConfig& config_;
  bool squares_ = false;
};

}  // namespace

const char* offsetKey(Kind kind) { return kind == Kind::kLinear ? "offset_mm" : "offset_deg"; }

std::vector<MotorChip> readMotorChips(ConfigReader& axis, const OwnChips& own, UsedPorts& ports) {
  const auto made = [&ports](ConfigReader& motor, std::optional<driver::DriverChip> chip,
                             std::string key) {
    MotorChip read{std::move(chip), std::move(key), {}};
    read.tmc = readTmc(motor, read.chip, ports);
    return read;
  };
  axis.allow("motors");
  const ConfigValue value = axis.value("motors");
  const auto* const map = value.as<ConfigValue::Map>();
  if (map == nullptr || map->empty()) {
    return {made(axis, readChip(axis, pinsGiven(axis), own), "")};
  }
  ConfigReader motors = axis.map("motors");
  std::vector<MotorChip> chips;
  std::set<std::string> pins_without_own;
  bool all_have_own = true;
  for (const std::string& name : motors.keys()) {
    ConfigReader motor = motors.map(name);
    if (!motor.has("driver")) {
      all_have_own = false;
      pins_without_own.merge(pinsGiven(motor));
      for (const char* key : kChipKeys) {
        if (motor.has(key)) {
          motor.contradiction(key, fmt::format("is given, but needs {}: without a driver of its "
                                               "own, the motor has {}",
                                               motor.fullName("driver"), axis.fullName(key)));
        }
      }
    }
  }
  std::optional<driver::DriverChip> common;
  if (!all_have_own) common = readChip(axis, pins_without_own, own);
  for (const char* key : kChipKeys) {
    axis.allow(key);
    if (all_have_own && axis.has(key)) {
      axis.contradiction(key, "is given, but each of motors has a driver of its own");
    }
  }
  for (const std::string& name : motors.keys()) {
    ConfigReader motor = motors.map(name);
    if (motor.has("driver")) {
      chips.push_back(made(motor, readChip(motor, pinsGiven(motor), own), "motors/" + name + "/"));
    } else {
      chips.push_back(made(motor, common, ""));
    }
  }
  return chips;
}

void readMotors(ConfigReader& axis, const std::vector<MotorChip>& chips, AxisConfig& config,
                UsedLines& used) {
  const auto read = [&](ConfigReader& reader, std::size_t number, MotorConfig& motor) {
    const auto& chip = chips.at(number).chip;
    if (chip) motor.driver = *chip;
    motor.tmc = chips.at(number).tmc;
    reader.allow("tmc");
    readPins(reader, chip ? &*chip : nullptr, motor, used);
    readEndstops(reader, !axis.has("motors"), motor, used);
  };
  if (!axis.has("motors")) return read(axis, 0, config);
  for (const char* key : kMotorKeys) {
    axis.allow(key);
    if (!axis.has(key)) continue;
    axis.contradiction(key,
                       "is given, but must stand in each of motors, because there are several");
  }
  ConfigReader motors = axis.map("motors");
  if (!motors.isMap()) return;
  const std::vector<std::string> names = motors.keys();
  if (names.size() < 2 || names.size() > kMostMotors) {
    motors.issue("", fmt::format("has {} motors, but must have 2 to {}; a single one is configured "
                                 "without motors",
                                 names.size(), kMostMotors));
  }
  for (std::size_t i = 0; i < names.size(); ++i) {
    const std::string& name = names[i];
    ConfigReader reader = motors.map(name);
    checkAxisName(name, reader);
    MotorConfig motor;
    motor.motor = name;
    for (const char* key : kChipKeys) reader.allow(key);
    read(reader, i, motor);
    for (const Kind kind : {Kind::kLinear, Kind::kRotary}) reader.allow(offsetKey(kind));
    reader.rejectUnknown();
    if (i == 0) {
      static_cast<MotorConfig&>(config) = std::move(motor);
    } else {
      config.twins.push_back(std::move(motor));
    }
  }
  checkSamePins(motors, config);
  const bool all_known = std::all_of(chips.begin(), chips.end(),
                                     [](const MotorChip& chip) { return chip.chip.has_value(); });
  if (all_known) checkSameEdges(motors, config);
}

void readSpeedsOfChips(ConfigReader& axis, AxisConfig& config) {
  if (config.steps_per_unit <= 0.0) return;
  if (config.twins.empty()) {
    if (config.tmc) readTmcSpeeds(axis, config, config.driver, *config.tmc);
    return;
  }
  ConfigReader motors = axis.map("motors");
  const auto read = [&](MotorConfig& motor) {
    ConfigReader reader = motors.map(motor.motor);
    if (motor.tmc) readTmcSpeeds(reader, config, motor.driver, *motor.tmc);
  };
  read(config);
  for (MotorConfig& twin : config.twins) read(twin);
}

void readSquaring(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config) {
  if (kind) SquaringReader(axis, *kind, config).read();
}

}  // namespace stepdriver::config
