#include "read_motion.h"

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "message_text.h"
#include "motion_keys.h"
#include "read_scale.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::config {
namespace {

// Far beyond any machine, and well inside what the motion can count and time in 64 bits.
constexpr double kHighestAcceleration = 1e12;
constexpr double kMostBacklash = 1e6;  // steps
constexpr double kHighestJerk = 1e15;
constexpr double kFarthestStep = 9007199254740992.0;  // 2^53: each step is a double of its own

/// The first key of this unit that is given; empty: none.
std::string firstGiven(const ConfigReader& axis, const MotionKeys& keys) {
  for (const std::string& key : keys.all()) {
    if (axis.has(key)) return key;
  }
  return {};
}

/// @return nullopt where the keys don't tell, which is an issue.
std::optional<Kind> readKind(ConfigReader& axis) {
  const std::string linear = firstGiven(axis, motionKeys(Kind::kLinear));
  const std::string rotary = firstGiven(axis, motionKeys(Kind::kRotary));
  if (!linear.empty() && !rotary.empty()) {
    axis.issue("", "has " + linear + " and " + rotary +
                       ", but must be either linear, with all of it in mm, or rotary, with all of "
                       "it in degrees");
    return {};
  }
  if (!linear.empty()) return Kind::kLinear;
  if (!rotary.empty()) return Kind::kRotary;
  if (axis.isMap()) {
    axis.issue("",
               "has no key with a unit; it must have steps_per_mm, max_speed_mm_s and "
               "acceleration_mm_s2 where it is linear, or steps_per_degree, max_speed_deg_s and "
               "acceleration_deg_s2 where it is rotary");
  }
  return {};
}

/// Reads what is given in one unit.
class MotionReader {
 public:
  /// @param presence kOptional: what is missing isn't to be reported.
  MotionReader(ConfigReader& axis, const MotionContext& context, Kind kind, Presence presence)
      : axis_(axis), context_(context), keys_(motionKeys(kind)), presence_(presence) {}

  void read(const Rounds& rounds, AxisConfig& config) {
    config.kind = keys_.kind;
    const auto scale = readScale(axis_, keys_, rounds, presence_);
    // Where the unit isn't certain, nothing is computed from it.
    if (scale && presence_ == Presence::kRequired) {
      config.steps_per_unit = static_cast<double>(*scale * keys_.units_per_si_unit);
      steps_per_unit_ = static_cast<double>(*scale);
    }
    readSpeeds(config);
    readAccelerations(config);
    readJerk(config);
    readBacklash(config);
    readPositions(config);
  }

 private:
  double si(double units) const { return static_cast<double>(units / keys_.units_per_si_unit); }

  std::string is(const std::string& key) const {
    return "is " + axis_.shown(key) + ", but must be ";
  }

  void readSpeeds(AxisConfig& config) {
    const auto max = axis_.findNumber(keys_.max_speed, Range::positive(), presence_);
    const auto min = axis_.findNumber(keys_.min_speed, Range::notNegative(), Presence::kOptional);
    if (min && max && *min > *max) {
      axis_.issue(keys_.min_speed, is(keys_.min_speed) + "at most " + keys_.max_speed +
                                       ", which is " + axis_.shown(keys_.max_speed));
    }
    if (max) checkRate(*max);
    config.max_speed = si(max.value_or(0.0));
    config.start_speed = si(min.value_or(0.0));
  }

  void checkRate(double max_speed) {
    if (!steps_per_unit_) return;
    const double rate = max_speed * *steps_per_unit_;
    if (rate * kSlack < kLowestRate) {
      axis_.issue(keys_.max_speed, is(keys_.max_speed) + "at least " +
                                       lowerBoundText(kLowestRate / *steps_per_unit_) +
                                       ", which is " + numberText(kLowestRate) + " steps/s");
    }
    if (!context_.timing) return;
    const double high_us = static_cast<double>(context_.timing->step_high_ns) / 1e3;
    const double low_us = static_cast<double>(context_.timing->step_low_ns) / 1e3;
    const double highest = 1e6 / (high_us + low_us);
    if (rate <= highest * kSlack) return;
    axis_.issue(keys_.max_speed,
                is(keys_.max_speed) + "at most " + upperBoundText(highest / *steps_per_unit_) +
                    ": it is " + roughText(rate) + " steps/s (at " + roughText(*steps_per_unit_) +
                    " steps per " + keys_.unit + "), and the " + context_.chip_title +
                    " takes at most " + upperBoundText(highest) + " steps/s (" +
                    numberText(high_us) + " us high, " + numberText(low_us) + " us low)");
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
      axis_.issue(keys_.stop_deceleration, is(keys_.stop_deceleration) + "at least " + key +
                                               ", which is " + axis_.shown(key) +
                                               ": a stop must not end beyond what it stops");
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
    axis_.issue(keys_.jerk, is(keys_.jerk) + "0 for none, or from " +
                                lowerBoundText(kLowestJerk / *steps_per_unit_) + " to " +
                                upperBoundText(kHighestJerk / *steps_per_unit_) + ", which is " +
                                numberText(kLowestJerk) + " to " + numberText(kHighestJerk) +
                                " steps/s^3");
  }

  void readBacklash(AxisConfig& config) {
    const double backlash =
        axis_.findNumber(keys_.backlash, Range::notNegative(), Presence::kOptional).value_or(0.0);
    config.backlash = si(backlash);
    if (!steps_per_unit_ || backlash * *steps_per_unit_ <= kMostBacklash) return;
    axis_.issue(keys_.backlash, is(keys_.backlash) + "at most " +
                                    upperBoundText(kMostBacklash / *steps_per_unit_) +
                                    ", which is " + numberText(kMostBacklash) + " steps");
  }

  void checkAcceleration(const std::string& key, double acceleration) {
    if (!steps_per_unit_) return;
    const double steps = acceleration * *steps_per_unit_;
    if (steps * kSlack >= kLowestAcceleration && steps <= kHighestAcceleration * kSlack) return;
    axis_.issue(key, is(key) + "from " + lowerBoundText(kLowestAcceleration / *steps_per_unit_) +
                         " to " + upperBoundText(kHighestAcceleration / *steps_per_unit_) +
                         ", which is " + numberText(kLowestAcceleration) + " to " +
                         numberText(kHighestAcceleration) + " steps/s^2");
  }

  void readPositions(AxisConfig& config) {
    const auto min = readPosition(keys_.min_position);
    const auto max = readPosition(keys_.max_position);
    if (min && max && *min >= *max) {
      axis_.issue(keys_.min_position, is(keys_.min_position) + "below " + keys_.max_position +
                                          ", which is " + axis_.shown(keys_.max_position));
    }
    if (min) config.min_position = si(*min);
    if (max) config.max_position = si(*max);
  }

  std::optional<double> readPosition(const std::string& key) {
    const auto position = axis_.findNumber(key, Range{}, Presence::kOptional);
    if (position && steps_per_unit_ && std::abs(*position) * *steps_per_unit_ > kFarthestStep) {
      const std::string bound = upperBoundText(kFarthestStep / *steps_per_unit_);
      axis_.issue(key, is(key) + "from -" + bound + " to " + bound +
                           ", which is as far as steps are counted");
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
  // Each value that is there can be right or wrong by itself.
  for (const Kind each : {Kind::kLinear, Kind::kRotary}) {
    MotionReader(axis, context, each, Presence::kOptional).read(rounds, config);
  }
  return {};
}

}  // namespace stepdriver::config
