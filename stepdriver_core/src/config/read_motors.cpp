#include "read_motors.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <utility>
#include <vector>

#include "message_text.h"
#include "motion_keys.h"
#include "read_motion.h"
#include "read_pins.h"

namespace stepdriver::config {
namespace {

/// The keys that a motor has of its own if there are several.
constexpr std::array<const char*, 8> kMotorKeys = {
    "pins",       "invert",           "common_anode",           "fault_bias",
    "fault_stop", "in_position_bias", "in_position_timeout_ms", "endstops"};

const char* offsetKey(Kind kind) { return kind == Kind::kLinear ? "offset_mm" : "offset_deg"; }

/// The pins that either all motors of an axis have, or no motor.
struct OptionalPin {
  const char* key;
  bool (*is_wired)(const MotorConfig& motor);
};
constexpr std::array<OptionalPin, 8> kOptionalPins{
    {{"enable", [](const MotorConfig& motor) { return motor.pins.enable.wired(); }},
     {"ms1", [](const MotorConfig& motor) { return motor.pins.ms1.wired(); }},
     {"ms2", [](const MotorConfig& motor) { return motor.pins.ms2.wired(); }},
     {"ms3", [](const MotorConfig& motor) { return motor.pins.ms3.wired(); }},
     {"sleep", [](const MotorConfig& motor) { return motor.pins.sleep.wired(); }},
     {"reset", [](const MotorConfig& motor) { return motor.pins.reset.wired(); }},
     {"fault", [](const MotorConfig& motor) { return motor.fault.has_value(); }},
     {"in_position", [](const MotorConfig& motor) { return motor.in_position.has_value(); }}}};

void checkSamePins(ConfigReader& motors, const AxisConfig& config) {
  for (const MotorConfig& twin : config.twins) {
    for (const OptionalPin& pin : kOptionalPins) {
      if (pin.is_wired(config) == pin.is_wired(twin)) continue;
      const bool twin_lacks = pin.is_wired(config);
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
    if (!config_.homing) return 0;
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

void readMotors(ConfigReader& axis, const driver::DriverChip* chip, AxisConfig& config,
                UsedLines& used) {
  axis.allow("motors");
  if (!axis.has("motors")) {
    readPins(axis, chip, config, used);
    readEndstops(axis, config, used);
    return;
  }
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
  for (const std::string& name : names) {
    ConfigReader reader = motors.map(name);
    checkAxisName(name, reader);
    MotorConfig motor;
    motor.motor = name;
    readPins(reader, chip, motor, used);
    readEndstops(reader, motor, used);
    for (const Kind kind : {Kind::kLinear, Kind::kRotary}) reader.allow(offsetKey(kind));
    reader.rejectUnknown();
    if (name == names.front()) {
      static_cast<MotorConfig&>(config) = std::move(motor);
    } else {
      config.twins.push_back(std::move(motor));
    }
  }
  checkSamePins(motors, config);
}

void readSquaring(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config) {
  if (kind) SquaringReader(axis, *kind, config).read();
}

}  // namespace stepdriver::config
