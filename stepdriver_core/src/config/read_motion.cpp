#include "read_motion.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "bounds.h"
#include "message_text.h"
#include "motion_keys.h"
#include "read_scale.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {
namespace {

const char* const kContinuous = "continuous";

/// The first given key of this unit; empty: there is none.
std::string firstGiven(const ConfigReader& axis, const MotionKeys& keys) {
  for (const std::string& key : keys.all()) {
    if (axis.has(key)) return key;
  }
  return {};
}

/// @return nullopt if the keys don't determine it, which is an issue.
std::optional<Kind> readKind(ConfigReader& axis) {
  const std::string linear = firstGiven(axis, motionKeys(Kind::kLinear));
  const std::string rotary = firstGiven(axis, motionKeys(Kind::kRotary));
  if (!linear.empty() && !rotary.empty()) {
    axis.contradiction(
        "", fmt::format("has {} and {}, but must be either linear, with all keys in mm, or "
                        "rotary, with all keys in degrees",
                        linear, rotary));
    return std::nullopt;
  }
  if (!linear.empty()) return Kind::kLinear;
  if (!rotary.empty()) return Kind::kRotary;
  if (axis.isMap()) {
    axis.issue("",
               "has no key with a unit; it must have steps_per_mm, max_speed_mm_s and "
               "acceleration_mm_s2 if it is linear, or steps_per_degree, max_speed_deg_s and "
               "acceleration_deg_s2 if it is rotary");
  }
  return std::nullopt;
}

/// Reads the keys in one unit.
class MotionReader {
 public:
  /// @param presence kOptional: a missing key isn't reported.
  MotionReader(ConfigReader& axis, const MotionContext& context, Kind kind, Presence presence)
      : axis_(axis), context_(context), keys_(motionKeys(kind)), presence_(presence) {}

  void read(const Rounds& rounds, AxisConfig& config) {
    config.kind = keys_.kind;
    const auto scale = readScale(axis_, keys_, rounds, presence_);
    // If the unit isn't certain, nothing is computed from it.
    if (scale && presence_ == Presence::kRequired) {
      config.steps_per_unit = static_cast<double>(*scale * keys_.units_per_si_unit);
      steps_per_unit_ = static_cast<double>(*scale);
    }
    readSpeeds(config);
    readAccelerations(config);
    readJerk(config);
    readBacklash(config);
    readPositions(config);
    readContinuous(config);
  }

 private:
  double si(double units) const { return static_cast<double>(units / keys_.units_per_si_unit); }

  void mustBe(const std::string& key, const std::string& wanted) {
    axis_.issue(key, fmt::format("is {}, but must be {}", axis_.shown(key), wanted));
  }

  /// @param wanted names another key.
  void contradicts(const std::string& key, const std::string& wanted) {
    axis_.contradiction(key, fmt::format("is {}, but must be {}", axis_.shown(key), wanted));
  }

  void readSpeeds(AxisConfig& config) {
    const auto max = axis_.findNumber(keys_.max_speed, Range::positive(), presence_);
    const auto min = axis_.findNumber(keys_.start_speed, Range::notNegative(), Presence::kOptional);
    if (min && max && *min > *max) {
      contradicts(keys_.start_speed, fmt::format("at most {}, which is {}", keys_.max_speed,
                                                 axis_.shown(keys_.max_speed)));
    }
    if (max) checkRate(*max);
    if (min) checkStart(*min);
    config.max_speed = si(max.value_or(0.0));
    config.start_speed = si(min.value_or(0.0));
  }

  void checkStart(double start_speed) {
    if (!steps_per_unit_ || start_speed == 0.0) return;
    if (start_speed * *steps_per_unit_ * kSlack >= kLowestRate) return;
    mustBe(keys_.start_speed,
           fmt::format("0 or at least {}, which is {} steps/s",
                       lowerBoundText(kLowestRate / *steps_per_unit_), numberText(kLowestRate)));
  }

  void checkRate(double max_speed) {
    if (!steps_per_unit_) return;
    const double rate = max_speed * *steps_per_unit_;
    if (rate * kSlack < kLowestRate) {
      mustBe(keys_.max_speed,
             fmt::format("at least {}, which is {} steps/s",
                         lowerBoundText(kLowestRate / *steps_per_unit_), numberText(kLowestRate)));
    }
    if (!context_.timing) return;
    const double high_us = static_cast<double>(context_.timing->step_high_ns) / 1e3;
    const double low_us = static_cast<double>(context_.timing->step_low_ns) / 1e3;
    const double step_us = context_.both_edges ? std::max(high_us, low_us) : high_us + low_us;
    const double highest = 1e6 / step_us;
    if (rate <= highest * kSlack) return checkHold(rate);
    mustBe(keys_.max_speed,
           fmt::format("at most {}: it is {} steps/s (at {} steps per {}), and {} at "
                       "most {} steps/s ({} us high, {} us low{})",
                       upperBoundText(highest / *steps_per_unit_), roughText(rate),
                       roughText(*steps_per_unit_), keys_.unit, context_.drivers_take,
                       upperBoundText(highest), numberText(high_us), numberText(low_us),
                       context_.both_edges ? ", each edge a step" : ""));
  }

  /// A direction that must stand longer than a step lasts would have to stand over the next one.
  void checkHold(double rate) {
    const double interval_us = 1e6 / rate;
    const double hold_us = static_cast<double>(context_.timing->dir_hold_ns) / 1e3;
    if (hold_us <= interval_us * kSlack) return;
    axis_.contradiction(
        context_.dir_hold_key,
        fmt::format("is {}, but must be at most {}: at {}, which is {}, a step "
                    "follows every {} us",
                    numberText(hold_us), upperBoundText(interval_us), keys_.max_speed,
                    axis_.shown(keys_.max_speed), roughText(interval_us)));
  }

  void readAccelerations(AxisConfig& config) {
    const auto up = axis_.findNumber(keys_.acceleration, Range::positive(), presence_);
    const auto down = axis_.findNumber(keys_.deceleration, Range::positive(), Presence::kOptional);
    const auto stop =
        axis_.findNumber(keys_.stop_deceleration, Range::positive(), Presence::kOptional);
    if (up) checkAcceleration(keys_.acceleration, *up);
    if (down) checkAcceleration(keys_.deceleration, *down);
    if (stop) checkAcceleration(keys_.stop_deceleration, *stop);
    const auto& slowest = down ? down : up;
    if (stop && slowest && *stop < *slowest) {
      const std::string& key = down ? keys_.deceleration : keys_.acceleration;
      contradicts(keys_.stop_deceleration,
                  fmt::format("at least {}, which is {}: a stop must not end beyond the target",
                              key, axis_.shown(key)));
    }
    config.acceleration = si(up.value_or(0.0));
    config.deceleration = down ? si(*down) : config.acceleration;
    if (stop) config.stop_deceleration = si(*stop);
  }

  void readJerk(AxisConfig& config) {
    const double jerk =
        axis_.findNumber(keys_.jerk, Range::notNegative(), Presence::kOptional).value_or(0.0);
    config.jerk = si(jerk);
    if (!steps_per_unit_ || jerk == 0.0) return;
    const double steps = jerk * *steps_per_unit_;
    if (steps * kSlack >= kLowestJerk && steps <= kHighestJerk * kSlack) return;
    mustBe(keys_.jerk, fmt::format("0 for none, or from {} to {}, which is {} to {} steps/s^3",
                                   lowerBoundText(kLowestJerk / *steps_per_unit_),
                                   upperBoundText(kHighestJerk / *steps_per_unit_),
                                   numberText(kLowestJerk), numberText(kHighestJerk)));
  }

  void readBacklash(AxisConfig& config) {
    const double backlash =
        axis_.findNumber(keys_.backlash, Range::notNegative(), Presence::kOptional).value_or(0.0);
    config.backlash = si(backlash);
    if (!steps_per_unit_ || backlash * *steps_per_unit_ <= kMostBacklash * kSlack) return;
    mustBe(keys_.backlash, fmt::format("at most {}, which is {} steps",
                                       upperBoundText(kMostBacklash / *steps_per_unit_),
                                       numberText(kMostBacklash)));
  }

  void checkAcceleration(const std::string& key, double acceleration) {
    if (!steps_per_unit_) return;
    const double steps = acceleration * *steps_per_unit_;
    if (steps * kSlack >= kLowestAcceleration && steps <= kHighestAcceleration * kSlack) return;
    mustBe(key, fmt::format("from {} to {}, which is {} to {} steps/s^2",
                            lowerBoundText(kLowestAcceleration / *steps_per_unit_),
                            upperBoundText(kHighestAcceleration / *steps_per_unit_),
                            numberText(kLowestAcceleration), numberText(kHighestAcceleration)));
  }

  void readPositions(AxisConfig& config) {
    const auto min = readPosition(keys_.min_position);
    const auto max = readPosition(keys_.max_position);
    if (min && max && *min >= *max) {
      contradicts(keys_.min_position, fmt::format("below {}, which is {}", keys_.max_position,
                                                  axis_.shown(keys_.max_position)));
    }
    if (min) config.min_position = si(*min);
    if (max) config.max_position = si(*max);
  }

  void readContinuous(AxisConfig& config) {
    config.continuous = axis_.boolean(kContinuous, config.continuous);
    if (!config.continuous || presence_ == Presence::kOptional) return;
    if (keys_.kind == Kind::kLinear) {
      contradicts(kContinuous,
                  "false: only a rotary axis, with its keys in degrees, turns without end");
    } else if (config.min_position || config.max_position) {
      contradicts(kContinuous,
                  fmt::format("false, as {} is given: an axis that turns without end has "
                              "no soft limits",
                              config.min_position ? keys_.min_position : keys_.max_position));
    }
  }

  std::optional<double> readPosition(const std::string& key) {
    const auto position = axis_.findNumber(key, Range{}, Presence::kOptional);
    if (position && steps_per_unit_ &&
        std::abs(*position) * *steps_per_unit_ > kFarthestLimit * kSlack) {
      mustBe(key, fmt::format("from -{0} to {0}, which is as far as steps are counted",
                              upperBoundText(kFarthestLimit / *steps_per_unit_)));
    }
    return position;
  }

  ConfigReader& axis_;
  const MotionContext& context_;
  const MotionKeys& keys_;
  Presence presence_;
  std::optional<double> steps_per_unit_;
};

}  // namespace

std::optional<Kind> readMotion(ConfigReader& axis, const MotionContext& context,
                               AxisConfig& config) {
  for (const Kind kind : {Kind::kLinear, Kind::kRotary}) {
    for (const std::string& key : motionKeys(kind).all()) axis.allow(key);
  }
  const Rounds rounds = readRounds(axis, context.microsteps);
  config.steps_per_round = rounds.steps;

  const auto kind = readKind(axis);
  if (kind) {
    MotionReader(axis, context, *kind, Presence::kRequired).read(rounds, config);
    return kind;
  }
  // Each given value can be right or wrong by itself.
  for (const Kind each : {Kind::kLinear, Kind::kRotary}) {
    MotionReader(axis, context, each, Presence::kOptional).read(rounds, config);
  }
  return {};
}

}  // namespace stepdriver::config
