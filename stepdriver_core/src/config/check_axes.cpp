#include "stepdriver_core/config/check_axes.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <set>
#include <string>
#include <tuple>
#include <utility>

#include "bounds.h"
#include "message_text.h"
#include "stepdriver_core/config/farthest_limit.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/printable.h"

namespace stepdriver::config {
namespace {

constexpr double kSlack = 1.0 + 2e-5;  // bounds in messages have six digits
constexpr double kUnlimited = std::numeric_limits<double>::infinity();

/// Checks one axis by itself.
class AxisCheck {
 public:
  AxisCheck(const AxisConfig& axis, std::vector<ConfigIssue>& issues)
      : axis_(axis), issues_(issues) {}

  void check() {
    for (std::size_t i = 0; i < axis_.motors(); ++i) checkMotor(axis_.motorAt(i));
    if (axis_.motors() > kMostMotors) {
      issue("twins", fmt::format("has {} motors, but may have {}", axis_.motors(), kMostMotors));
    }
    const double units = configUnitsPerUnit(axis_.kind);
    if (!number("steps_per_unit", axis_.steps_per_unit, kLowestScale * units, kHighestScale * units,
                "steps/")) {
      return;
    }
    number("steps_per_round", axis_.steps_per_round, 0.0, kUnlimited, "steps");
    checkSpeeds();
    checkPositions();
    checkShaper();
    checkHoming();
    number("backlash", axis_.backlash, 0.0, kMostBacklash / axis_.steps_per_unit, "");
    number("idle_timeout", axis_.idle_timeout, 0.0, kLongestTime, nullptr);
    const bool sleeps = axis_.idle_action == IdleAction::kSleep;
    if (axis_.idle_timeout > 0.0 && !(sleeps ? axis_.pins.sleep : axis_.pins.enable).wired()) {
      issue("idle_timeout",
            fmt::format("is {} s, but its idle action needs {}, which isn't wired",
                        numberText(axis_.idle_timeout), sleeps ? "pins.sleep" : "pins.enable"));
    }
  }

 private:
  void issue(const std::string& key, const std::string& message) {
    issues_.push_back({printable(axis_.name) + "/" + key, message});
  }

  /// @param per "/s" after the axis's unit, "steps/" before it, "steps" without it; nullptr: "s"
  bool number(const std::string& key, double value, double least, double most, const char* per) {
    if (std::isfinite(value) && value * kSlack >= least && value <= most * kSlack) return true;
    const std::string kind = unitOf(axis_.kind);
    const std::string unit = per == nullptr                 ? "s"
                             : per == std::string("steps")  ? "steps"
                             : per == std::string("steps/") ? "steps/" + kind
                                                            : kind + per;
    issue(key,
          fmt::format("is {}, but must be {} {}", numberText(value),
                      most == kUnlimited ? roughText(least) + " or more"
                                         : "from " + roughText(least) + " to " + roughText(most),
                      unit));
    return false;
  }

  void checkMotor(const MotorConfig& motor) {
    const std::string of = motor.motor.empty() ? "" : motor.motor + "/";
    if (!motor.pins.step.wired()) issue(of + "pins.step", "has no line, but must have one");
    if (!motor.pins.dir.wired()) issue(of + "pins.dir", "has no line, but must have one");
    const std::vector<int>& modes = motor.driver.microsteps;
    const bool has_mode =
        modes.empty() ? axis_.microsteps >= 1
                      : std::find(modes.begin(), modes.end(), axis_.microsteps) != modes.end();
    if (!has_mode) {
      issue("microsteps",
            modes.empty()
                ? fmt::format("is {}, but must be 1 or more", axis_.microsteps)
                : fmt::format("is {}, but the {} has {}", axis_.microsteps, motor.driver.title,
                              joinedText(modes, [](int mode) { return std::to_string(mode); })));
    }
  }

  void checkSpeeds() {
    const double unit = 1.0 / axis_.steps_per_unit;
    if (axis_.shortestStepNs() <= 0) {
      return issue("driver.timing", "has pulses of 0 ns, but they must last longer");
    }
    // The chip's highest rate bounds it anyway.
    number("max_speed", axis_.max_speed, kLowestRate * unit, kUnlimited, "/s");
    if (axis_.start_speed != 0.0) {
      number("start_speed", axis_.start_speed, kLowestRate * unit, axis_.max_speed, "/s");
    }
    const double lowest = kLowestAcceleration * unit;
    const double highest = kHighestAcceleration * unit;
    number("acceleration", axis_.acceleration, lowest, highest, "/s^2");
    const bool slows = number("deceleration", axis_.deceleration, lowest, highest, "/s^2");
    if (axis_.stop_deceleration && slows) {
      number("stop_deceleration", *axis_.stop_deceleration, axis_.deceleration, highest, "/s^2");
    }
    if (axis_.jerk != 0.0) {
      number("jerk", axis_.jerk, kLowestJerk * unit, kHighestJerk * unit, "/s^3");
    }
  }

  void checkPositions() {
    const double farthest = kFarthestLimit / axis_.steps_per_unit;
    const auto& [low, high] = std::tie(axis_.min_position, axis_.max_position);
    const bool low_is_right = !low || number("min_position", *low, -farthest, farthest, "");
    const bool high_is_right = !high || number("max_position", *high, -farthest, farthest, "");
    if (!low || !high || !low_is_right || !high_is_right || *low < *high) return;
    issue("min_position", fmt::format("is {}, but must be below max_position, which is {}",
                                      numberText(*low), numberText(*high)));
  }

  void checkShaper() {
    for (const ShaperConfig& shaper : axis_.input_shaper) {
      const bool right = shaper.frequency >= kLowestShaperFrequency &&
                         shaper.frequency <= kHighestShaperFrequency && shaper.damping >= 0.0 &&
                         shaper.damping <= kMostShaperDamping;
      if (right) continue;
      issue("input_shaper",
            fmt::format("is for {} Hz with a damping of {}, but must be from {} to {} Hz with one "
                        "from 0 to {}",
                        numberText(shaper.frequency), numberText(shaper.damping),
                        numberText(kLowestShaperFrequency), numberText(kHighestShaperFrequency),
                        numberText(kMostShaperDamping)));
    }
    if (axis_.input_shaper.empty()) return;
    if (axis_.start_speed != 0.0) issue("start_speed", "must be 0 with an input_shaper");
    if (axis_.backlash != 0.0) issue("backlash", "must be 0 with an input_shaper");
  }

  void checkHoming() {
    if (!axis_.homing) {
      if (axis_.require_homing) issue("require_homing", "is true, but there is no homing");
      return;
    }
    const HomingConfig& homing = *axis_.homing;
    if (!axis_.hasEndstop(homing.at_max)) {
      issue("homing.at_max",
            fmt::format("needs endstop_{}, but there is none", homing.at_max ? "max" : "min"));
    }
    const double unit = 1.0 / axis_.steps_per_unit;
    // A robot_description may have lowered the top speed below that of the homing.
    number("homing.seek_speed", homing.seek_speed, kLowestRate * unit, kUnlimited, "/s");
    number("homing.latch_speed", homing.latch_speed, kLowestRate * unit, homing.seek_speed, "/s");
    number("homing.max_travel", homing.max_travel, 0.0, kFarthestTravel * unit, "");
    number("homing.pull_off", homing.pull_off, 0.0, homing.max_travel, "");
    number("homing.offset", homing.offset, -kUnlimited, kUnlimited, "");
    number("homing.timeout", homing.timeout, 0.0, kLongestTime, nullptr);
    number("homing.debounce", homing.debounce, 0.0, kLongestTime, nullptr);
  }

  const AxisConfig& axis_;
  std::vector<ConfigIssue>& issues_;
};

void checkKinematics(const AxisConfig& axis, const std::vector<AxisConfig>& axes,
                     std::vector<ConfigIssue>& issues) {
  const Kinematics& shared = *axis.kinematics;
  const auto is_square = [size = shared.axes.size()](const Matrix& matrix) {
    return matrix.size() == size && std::all_of(matrix.begin(), matrix.end(), [&](const auto& row) {
             return row.size() == size && std::all_of(row.begin(), row.end(), [](double number) {
                      return std::isfinite(number);
                    });
           });
  };
  const auto is_there = [&axes, &axis](const std::string& name) {
    return std::any_of(axes.begin(), axes.end(), [&](const AxisConfig& other) {
      return other.name == name && other.kinematics == axis.kinematics;
    });
  };
  const std::string key = printable(axis.name) + "/kinematics";
  if (shared.axes.size() < 2 || shared.axes.size() > kMostMotors || !is_square(shared.matrix) ||
      !is_square(shared.inverse)) {
    return issues.push_back(
        {key, fmt::format("has {} axes, but must have 2 to {}, and matrices of as many rows and "
                          "columns, whose numbers are finite",
                          shared.axes.size(), kMostMotors)});
  }
  if (shared.numberOf(axis.name) == shared.axes.size() ||
      !std::all_of(shared.axes.begin(), shared.axes.end(), is_there)) {
    issues.push_back({key, fmt::format("has {}, but must name this axis and others that have the "
                                       "same one",
                                       listText(shared.axes, "and"))});
  }
}

}  // namespace

void checkAxes(const std::vector<AxisConfig>& axes) {
  std::vector<ConfigIssue> issues;
  std::set<std::string> names;
  for (const AxisConfig& axis : axes) {
    if (axis.name.empty() || !names.insert(axis.name).second) {
      issues.push_back({"axes", fmt::format("has an axis named \"{}\", but each must have a name "
                                            "of its own",
                                            printable(axis.name))});
    }
    AxisCheck(axis, issues).check();
    if (axis.kinematics) checkKinematics(axis, axes, issues);
  }
  if (!issues.empty()) throw ConfigError(std::move(issues));
}

}  // namespace stepdriver::config
