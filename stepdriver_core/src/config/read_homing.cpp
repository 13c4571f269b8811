#include "read_homing.h"

#include <fmt/format.h>

#include <string>
#include <vector>

#include "bounds.h"
#include "message_text.h"
#include "motion_keys.h"
#include "read_motion.h"
#include "restart_speed.h"

namespace stepdriver::config {
namespace {

constexpr double kLongestDebounceMs = 1000.0;
constexpr int kHighestOrder = 1000;

/// Whether the trigger of the homing lies so far inside the soft limit at its end that the axis,
/// pulled off, hasn't left the part between the two: no motion gets there, because the switch is an
/// endstop.
bool triggersInside(const AxisConfig& axis, const HomingConfig& homing) {
  const auto& limit = homing.at_max ? axis.max_position : axis.min_position;
  if (!limit) return false;
  const double inside = homing.at_max ? *limit - homing.offset : homing.offset - *limit;
  const double step = axis.steps_per_unit > 0.0 ? 1.0 / axis.steps_per_unit : 0.0;
  return inside > homing.pull_off + step;
}

class HomingReader {
 public:
  HomingReader(ConfigReader& axis, const MotionKeys& keys, const AxisConfig& config)
      : axis_(axis), homing_(axis.map("homing")), keys_(keys), config_(config) {}

  HomingConfig read() {
    HomingConfig homing;
    const bool has_switch = readSwitch(homing);
    readSpeeds(homing);
    readDistances(homing, has_switch);
    homing.timeout = homing_.number("timeout_s", {0.0, kLongestTime, true}, homing.timeout);
    homing.debounce =
        homing_.number("debounce_ms", {0.0, kLongestDebounceMs}, homing.debounce * 1e3) * 1e-3;
    homing.order = homing_.integer("order", 0, kHighestOrder, homing.order);
    homing_.rejectUnknown();
    return homing;
  }

 private:
  double si(double units) const { return static_cast<double>(units / keys_.units_per_si_unit); }
  double units(double si) const { return static_cast<double>(si * keys_.units_per_si_unit); }
  std::string inUnit(const char* key) const { return homingKey(key, keys_.kind); }
  void mustBe(const std::string& key, const std::string& wanted) {
    homing_.issue(key, fmt::format("is {}, but must be {}", homing_.shown(key), wanted));
  }

  /// @return whether it is right.
  bool readSwitch(HomingConfig& homing) {
    const auto which =
        homing_.findOneOf("switch", std::vector<std::string>{"min", "max"}, Presence::kRequired);
    if (!which) return false;
    homing.at_max = *which == "max";
    if (config_.hasEndstop(homing.at_max)) return true;
    homing_.contradiction(
        "switch",
        fmt::format("is {}, but must be a switch that the axis has: endstops/{} is missing",
                    homing_.shown("switch"), *which));
    return false;
  }

  std::optional<double> readSpeed(const std::string& key, double highest, const std::string& what) {
    const auto speed = homing_.findNumber(key, Range::positive(), Presence::kRequired);
    const double steps = config_.steps_per_unit / units(1.0);
    if (speed && steps > 0.0 && *speed * steps * kSlack < kLowestRate) {
      mustBe(key, fmt::format("at least {}, which is {} steps/s",
                              lowerBoundText(kLowestRate / steps), numberText(kLowestRate)));
    }
    if (speed && highest > 0.0 && *speed > highest * kSlack) mustBe(key, "at most " + what);
    return speed;
  }

  void readSpeeds(HomingConfig& homing) {
    const std::string seek_key = inUnit("seek_speed") + "_s";
    const std::string latch_key = inUnit("latch_speed") + "_s";
    const auto seek =
        readSpeed(seek_key, units(config_.max_speed),
                  fmt::format("{}, which is {}", keys_.max_speed, axis_.shown(keys_.max_speed)));
    // The count stays correct at the switch only at a speed from which the motor stops at once.
    const bool known = config_.steps_per_unit > 0.0 && config_.acceleration > 0.0;
    const double restart = known ? units(restartSpeed(config_)) : 0.0;
    const auto latch = readSpeed(latch_key, restart,
                                 fmt::format("{}, the speed that the motor stops from without a "
                                             "ramp ({}, or that after one full step)",
                                             upperBoundText(restart), keys_.start_speed));
    if (seek && latch && *latch > *seek) {
      mustBe(latch_key, fmt::format("at most {}, which is {}", seek_key, homing_.shown(seek_key)));
    }
    homing.seek_speed = si(seek.value_or(0.0));
    homing.latch_speed = si(latch.value_or(0.0));
  }

  void readDistances(HomingConfig& homing, bool has_switch) {
    const std::string travel_key = inUnit("max_travel");
    const std::string pull_off_key = inUnit("pull_off");
    const auto travel = homing_.findNumber(travel_key, Range::positive(), Presence::kRequired);
    const double steps = config_.steps_per_unit / units(1.0);
    if (travel && steps > 0.0 && *travel * steps > kFarthestTravel * kSlack) {
      mustBe(travel_key, fmt::format("at most {}, which is 2^40 steps",
                                     upperBoundText(kFarthestTravel / steps)));
    }
    const auto pull_off =
        homing_.findNumber(pull_off_key, Range::notNegative(), Presence::kRequired);
    const bool too_far = travel && pull_off && *pull_off > *travel;
    if (too_far) {
      mustBe(pull_off_key,
             fmt::format("at most {}, which is {}", travel_key, homing_.shown(travel_key)));
    }
    const std::string offset_key = inUnit("offset");
    const auto offset = homing_.findNumber(offset_key, Range{}, Presence::kOptional);
    homing.max_travel = si(travel.value_or(0.0));
    homing.pull_off = si(pull_off.value_or(0.0));
    homing.offset = si(offset.value_or(0.0));
    const bool all_right = pull_off && !too_far && offset.has_value() == homing_.has(offset_key);
    if (has_switch && all_right) checkRest(homing, offset_key);
  }

  /// The axis must be able to move from its position after the homing.
  void checkRest(const HomingConfig& homing, const std::string& offset_key) {
    const double rest = restOf(homing);
    const std::string stands =
        homing_.has(offset_key) ? "is " + homing_.shown(offset_key) : "is missing, and so 0";
    if (triggersInside(config_, homing)) {
      const std::string limit = homing.at_max ? keys_.max_position : keys_.min_position;
      const double clear =
          homing.at_max ? homing.offset + homing.pull_off : homing.offset - homing.pull_off;
      return homing_.issue(
          offset_key,
          fmt::format(
              "{}, so that nothing of the way between the {} switch and {}, which is {}, "
              "can be reached, because no motion passes an endstop; it must be {} {}, or {} "
              "must be {} {}",
              stands, homing.at_max ? "max" : "min", limit, axis_.shown(limit),
              homing.at_max ? "at least" : "at most",
              roughText(units(homing.at_max ? *config_.max_position - homing.pull_off
                                            : *config_.min_position + homing.pull_off)),
              limit, homing.at_max ? "at most" : "at least", roughText(units(clear))));
    }
    const auto check = [&](const std::optional<double>& limit, bool beyond, const char* word,
                           const std::string& key) {
      if (!limit || !beyond) return;
      homing_.issue(offset_key,
                    fmt::format("{}, so that the axis stands at {} when it is homed, but that must "
                                "be {} {}, which is {}",
                                stands, roughText(units(rest)), word, key, axis_.shown(key)));
    };
    const double tolerance = config_.steps_per_unit > 0.0 ? 1.0 / config_.steps_per_unit : 0.0;
    check(config_.min_position, rest < config_.min_position.value_or(0.0) - tolerance, "at least",
          keys_.min_position);
    check(config_.max_position, rest > config_.max_position.value_or(0.0) + tolerance, "at most",
          keys_.max_position);
  }

  ConfigReader& axis_;
  ConfigReader homing_;
  const MotionKeys& keys_;
  const AxisConfig& config_;
};

}  // namespace

std::string homingKey(const char* what, Kind kind) {
  return std::string(what) + (kind == Kind::kLinear ? "_mm" : "_deg");
}

double restOf(const HomingConfig& homing) {
  return homing.offset + (homing.at_max ? -homing.pull_off : homing.pull_off);
}

void readHoming(ConfigReader& axis, std::optional<Kind> kind, AxisConfig& config) {
  axis.allow("homing");
  config.require_homing = axis.boolean("require_homing", axis.has("homing"));
  if (axis.has("homing")) {
    if (kind) config.homing = HomingReader(axis, motionKeys(*kind), config).read();
  } else if (config.require_homing) {
    axis.contradiction("require_homing", "is true, but must be false if there is no homing");
  }
}

}  // namespace stepdriver::config
