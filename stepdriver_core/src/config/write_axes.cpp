#include "write_axes.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "motion_keys.h"
#include "read_homing.h"
#include "read_motors.h"
#include "read_pins.h"
#include "read_power.h"
#include "read_shaper.h"
#include "read_tmc.h"

namespace stepdriver::config {
namespace {

double milliseconds(std::int64_t nanoseconds) { return static_cast<double>(nanoseconds) / 1e6; }

const char* levelText(bool level) { return level ? "high" : "low"; }

ConfigValue::Map writeChip(const driver::DriverChip& chip) {
  ConfigValue::Map map{{"enable_active", levelText(chip.enable_on)},
                       {"step_inputs", stepInputsText(chip.step_inputs)},
                       {"step_edges", chip.both_edges ? "both" : "one"}};
  if (chip.fault_active) map["fault_ended_by"] = faultEndText(chip.fault_end);
  return map;
}

/// A whole number as an integer, which is what a file has for a count.
ConfigValue countOrNumber(double number) {
  const bool is_int = number == std::floor(number) &&
                      std::abs(number) <= static_cast<double>(std::numeric_limits<int>::max());
  return is_int ? ConfigValue(static_cast<int>(number)) : ConfigValue(number);
}

class AxisWriter {
 public:
  AxisWriter(const AxisConfig& axis, OwnChips& chips)
      : axis_(axis), keys_(motionKeys(axis.kind)), chips_(chips) {}

  ConfigValue::Map write() {
    if (axis_.twins.empty()) {
      map_ = writeMotor(axis_);
    } else {
      ConfigValue::Map motors;
      for (std::size_t i = 0; i < axis_.motors(); ++i) {
        const MotorConfig& motor = axis_.motorAt(i);
        ConfigValue::Map written = writeMotor(motor);
        if (motor.offset != 0.0) written[offsetKey(axis_.kind)] = units(motor.offset);
        motors.emplace(motor.motor, std::move(written));
      }
      map_["motors"] = std::move(motors);
    }
    if (!axis_.joint.empty()) map_["joint"] = axis_.joint;
    writeScale();
    writeMotion();
    writePower();
    if (axis_.homing) map_["homing"] = writeHoming(*axis_.homing);
    map_["require_homing"] = axis_.require_homing;
    return map_;
  }

 private:
  double units(double si) const { return static_cast<double>(si * keys_.units_per_si_unit); }

  ConfigValue::Map writeMotor(const MotorConfig& motor) {
    ConfigValue::Map map;
    const std::string driver = axis_.name + (motor.motor.empty() ? "" : " " + motor.motor);
    chips_[driver] = motor.driver;
    if (motor.driver.title.empty()) chips_[driver].title = "driver";
    map["driver"] = driver;
    map["chip"] = writeChip(motor.driver);
    map["timing"] = writtenTiming(motor.driver.timing);
    if (motor.tmc) map["tmc"] = writeTmc(*motor.tmc, axis_);
    writePins(motor, map);
    ConfigValue::Map endstops;
    if (motor.endstop_min) endstops["min"] = writeEndstop(*motor.endstop_min);
    if (motor.endstop_max) endstops["max"] = writeEndstop(*motor.endstop_max);
    if (axis_.motors() == 1) {
      if (axis_.switch_release != 0.0) {
        endstops[axis_.kind == Kind::kLinear ? "release_mm" : "release_deg"] =
            units(axis_.switch_release);
      }
      if (axis_.assumed_end_is_max) {
        endstops["assumed_end"] = *axis_.assumed_end_is_max ? "max" : "min";
      }
    }
    map["endstops"] = std::move(endstops);
    return map;
  }

  static ConfigValue::Map writeEndstop(const Endstop& endstop) {
    ConfigValue::Map map = writeSwitch(endstop);
    map["shared"] = endstop.shared;
    return map;
  }

  static void writePins(const MotorConfig& motor, ConfigValue::Map& map) {
    ConfigValue::Map pins;
    ConfigValue::Map invert;
    for (const auto& [key, pin] : pinsByKey(motor)) {
      if (!pin.wired()) continue;
      pins[key] = pin.line;
      if (pin.inverted) invert[key] = true;
    }
    if (motor.fault) {
      pins["fault"] = motor.fault->line;
      map["fault_bias"] = biasText(motor.fault->bias);
    }
    if (motor.fault || motor.tmc) map["fault_stop"] = motor.fault_ramps ? "ramp" : "at_once";
    if (motor.in_position) {
      pins["in_position"] = motor.in_position->line;
      map["in_position_bias"] = biasText(motor.in_position->bias);
      map["in_position_timeout_ms"] = motor.in_position->timeout * 1e3;
    }
    map["pins"] = std::move(pins);
    map["invert"] = std::move(invert);
  }

  void writeScale() {
    map_["microsteps"] = axis_.microsteps;
    map_[keys_.steps_per_unit] =
        static_cast<double>(axis_.steps_per_unit / keys_.units_per_si_unit);
    if (axis_.steps_per_round != 0.0) {
      map_["steps_per_round"] = countOrNumber(axis_.steps_per_round);
    }
  }

  void writeMotion() {
    map_[keys_.max_speed] = units(axis_.max_speed);
    map_[keys_.start_speed] = units(axis_.start_speed);
    map_[keys_.acceleration] = units(axis_.acceleration);
    map_[keys_.deceleration] = units(axis_.deceleration);
    if (axis_.stop_deceleration) map_[keys_.stop_deceleration] = units(*axis_.stop_deceleration);
    map_[keys_.jerk] = units(axis_.jerk);
    map_[keys_.backlash] = units(axis_.backlash);
    map_["continuous"] = axis_.continuous;
    if (axis_.max_skew != 0.0) map_[keys_.max_skew] = units(axis_.max_skew);
    writeLimit(keys_.min_position, axis_.min_position, axis_.min_position_source,
               [](double limit, double rest) { return std::min(limit, rest); });
    writeLimit(keys_.max_position, axis_.max_position, axis_.max_position_source,
               [](double limit, double rest) { return std::max(limit, rest); });
    if (axis_.input_shaper.empty()) return;
    ConfigValue::List shapers;
    for (const ShaperConfig& shaper : axis_.input_shaper) {
      shapers.emplace_back(ConfigValue::Map{{"type", shaperText(shaper.type)},
                                            {"frequency", shaper.frequency},
                                            {"damping", shaper.damping}});
    }
    map_["input_shaper"] = std::move(shapers);
  }

  /// A robot description may set a limit that an axis is beyond when it has been homed: it then
  /// moves back into its range.
  template <typename Wider>
  void writeLimit(const std::string& key, std::optional<double> limit, LimitSource source,
                  const Wider& wider) {
    if (!limit) return;
    if (axis_.homing && source == LimitSource::kRobotDescription) {
      limit = wider(*limit, restOf(*axis_.homing));
    }
    map_[key] = units(*limit);
  }

  void writePower() {
    map_["enable_on_start"] = axis_.enable_on_start;
    map_["disable_on_shutdown"] = axis_.disable_on_shutdown;
    map_["holds_position_unpowered"] = axis_.holds_position_unpowered;
    map_["align_on_microstep_change"] = axis_.align_on_microstep_change;
    map_["idle_timeout_s"] = axis_.idle_timeout;
    map_["idle_action"] = textOf(axis_.idle_action);
    if (!axis_.brake) return;
    map_["brake"] = ConfigValue::Map{{"pin", axis_.brake->line},
                                     {"release_level", levelText(axis_.brake->release_level)},
                                     {"release_ms", milliseconds(axis_.brake->release_ns)},
                                     {"engage_ms", milliseconds(axis_.brake->engage_ns)}};
  }

  ConfigValue::Map writeHoming(const HomingConfig& homing) const {
    const auto key = [this](const char* what) { return homingKey(what, axis_.kind); };
    ConfigValue::Map map{{"kind", textOf(homing.kind)},
                         {key("offset"), units(homing.offset)},
                         {"order", homing.order}};
    if (homing.kind == HomingKind::kDirect) return map;
    const bool is_limit = homing.kind == HomingKind::kLimit;
    map[is_limit ? "switch" : "towards"] = homing.at_max ? "max" : "min";
    map[key("seek_speed") + "_s"] = units(homing.seek_speed);
    map[key("pull_off")] = units(homing.pull_off);
    map[key("max_travel")] = units(homing.max_travel);
    map["timeout_s"] = homing.timeout;
    if (homing.final_position) map[key("final_position")] = units(*homing.final_position);
    if (is_limit) map["debounce_ms"] = homing.debounce * 1e3;
    if (!homing.input.empty()) map["input"] = homing.input;
    if (!homing.flag.empty()) map["flag"] = homing.flag;
    if (homing.check_at_flag != FlagCheck::kNone) {
      map["check_at_flag"] = textOf(homing.check_at_flag);
      map[key("check_tolerance")] = units(homing.flag_tolerance);
    }
    if (homing.kind == HomingKind::kBlock) map["approaches"] = homing.approaches;
    if (homing.latch_speed > 0.0) map[key("latch_speed") + "_s"] = units(homing.latch_speed);
    return map;
  }

  const AxisConfig& axis_;
  const MotionKeys& keys_;
  OwnChips& chips_;
  ConfigValue::Map map_;
};

}  // namespace

WrittenAxes writeAxes(const std::vector<AxisConfig>& axes) {
  WrittenAxes written;
  for (const AxisConfig& axis : axes) {
    written.axes.emplace(axis.name, AxisWriter(axis, written.chips).write());
  }
  return written;
}

ConfigValue::Map writeSwitch(const InputSwitch& input) {
  return {{"pin", input.line},
          {"active_level", levelText(input.active_level)},
          {"bias", biasText(input.bias)}};
}

ConfigValue::List writeMatrix(const Matrix& matrix) {
  ConfigValue::List rows;
  for (const std::vector<double>& row : matrix) {
    rows.emplace_back(ConfigValue::List(row.begin(), row.end()));
  }
  return rows;
}

}  // namespace stepdriver::config
