#include "read_homing.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "bounds.h"
#include "message_text.h"
#include "motion_keys.h"
#include "printable.h"
#include "read_motion.h"
#include "restart_speed.h"

namespace stepdriver::config {
namespace {

constexpr double kLongestDebounceMs = 1000.0;
constexpr int kHighestOrder = 1000;

// In the order of HomingKind.
const std::vector<std::string> kKinds = {"limit", "flag",   "flag_centre", "index",
                                         "block", "direct", "stall"};
// [full steps/s] A revolution a second of a motor with 200 of them. Below that, its voltage is too
// low for StallGuard (TMC2209 datasheet, section 11).
constexpr double kSlowestStall = 200.0;
// [full steps] The chip measures a stall within so many; then the motor must have come to its speed
// again before the second approach.
constexpr double kStallTakes = 4.0;
const std::vector<std::string> kEnds = {"min", "max"};
// In the order of FlagCheck.
const std::vector<std::string> kFlagChecks = {"none", "warning", "fault"};

/// Whether the trigger of the homing lies so far inside the soft limit at its end that the axis,
/// pulled off, hasn't left the part between the two: no motion gets there, because the switch is an
/// endstop.
bool triggersInside(const AxisConfig& axis, const HomingConfig& homing) {
  const auto& limit = homing.at_max ? axis.max_position : axis.min_position;
  if (!limit) return false;
  const double inside = homing.at_max ? *limit - homing.offset : homing.offset - *limit;
  const double step = axis.steps_per_unit > 0.0 ? 1.0 / axis.steps_per_unit : 0.0;
  const double way = std::abs(restOf(homing) - homing.offset);
  return inside > (homing.final_position ? way : homing.pull_off) + step;
}

class HomingReader {
 public:
  HomingReader(ConfigReader& axis, const MotionKeys& keys, const AxisConfig& config)
      : axis_(axis), homing_(axis.map("homing")), keys_(keys), config_(config) {}

  HomingConfig read() {
    const std::string kind = homing_.oneOf("kind", kKinds, kKinds.front());
    result_.kind =
        static_cast<HomingKind>(std::find(kKinds.begin(), kKinds.end(), kind) - kKinds.begin());
    result_.order = homing_.integer("order", 0, kHighestOrder, result_.order);
    if (result_.kind == HomingKind::kDirect) {
      if (readOffset(true)) checkWithinLimits(inUnit("offset"), result_.offset);
    } else {
      readMotion();
    }
    homing_.rejectUnknown();
    return result_;
  }

 private:
  double si(double units) const { return static_cast<double>(units / keys_.units_per_si_unit); }
  double units(double si) const { return static_cast<double>(si * keys_.units_per_si_unit); }
  std::string inUnit(const char* key) const { return homingKey(key, keys_.kind); }
  void mustBe(const std::string& key, const std::string& wanted) {
    homing_.issue(key, fmt::format("is {}, but must be {}", homing_.shown(key), wanted));
  }
  bool isLimit() const { return result_.kind == HomingKind::kLimit; }
  bool isBlock() const { return result_.kind == HomingKind::kBlock; }
  bool isStall() const { return result_.kind == HomingKind::kStall; }

  void readMotion() {
    const bool has_end = isLimit() ? readSwitch() : readDirection();
    if (!isLimit() && !isStall()) readSensor();
    readSpeeds();
    readDistances(has_end);
    if (!isLimit() && !isStall()) readFlagCheck();
    result_.timeout = homing_.number("timeout_s", {0.0, kLongestTime, true}, result_.timeout);
    if (!isLimit()) return;
    result_.debounce =
        homing_.number("debounce_ms", {0.0, kLongestDebounceMs}, result_.debounce * 1e3) * 1e-3;
  }

  /// @return whether it is right.
  bool readSwitch() {
    const auto which = homing_.findOneOf("switch", kEnds, Presence::kRequired);
    if (!which) return false;
    result_.at_max = *which == "max";
    if (config_.hasEndstop(result_.at_max)) return true;
    homing_.contradiction(
        "switch",
        fmt::format("is {}, but must be a switch that the axis has: endstops/{} is missing",
                    homing_.shown("switch"), *which));
    return false;
  }

  /// @return as above
  bool readDirection() {
    const auto towards = homing_.findOneOf("towards", kEnds, Presence::kRequired);
    result_.at_max = towards && *towards == "max";
    return towards.has_value();
  }

  void readSensor() {
    result_.input = isBlock() ? homing_.text("input", "") : homing_.text("input");
    result_.flag = homing_.text("flag", "");
    result_.approaches = homing_.integer("approaches", 1, 2, result_.approaches);
    const bool is_index = result_.kind == HomingKind::kIndex;
    if (!is_index && homing_.has("flag")) {
      homing_.contradiction("flag", "is given, but only an index comes after a flag");
    }
    if (!isBlock() && homing_.has("approaches")) {
      homing_.contradiction("approaches", "is given, but only a block is approached twice");
    }
    if (is_index && config_.steps_per_round <= 0.0) {
      homing_.contradiction("kind",
                            "is \"index\", but steps_per_round is missing: an index comes "
                            "once a turn of the motor");
    }
    if (isBlock() && result_.input.empty() && !hasFaultOutputs()) {
      homing_.contradiction("input",
                            "must be the name of an input that reports the block, because "
                            "pins/fault of each motor isn't wired");
    }
  }

  void readFlagCheck() {
    const std::string key = inUnit("check_tolerance");
    const std::string check = homing_.oneOf("check_at_flag", kFlagChecks, kFlagChecks.front());
    result_.check_at_flag = static_cast<FlagCheck>(
        std::find(kFlagChecks.begin(), kFlagChecks.end(), check) - kFlagChecks.begin());
    const bool checks = result_.check_at_flag != FlagCheck::kNone;
    const auto tolerance = homing_.findNumber(key, Range::positive(),
                                              checks ? Presence::kRequired : Presence::kOptional);
    result_.flag_tolerance = si(tolerance.value_or(0.0));
    const bool has_flag = result_.kind == HomingKind::kFlag ||
                          result_.kind == HomingKind::kFlagCentre || !result_.flag.empty();
    if (checks && !has_flag) {
      homing_.contradiction("check_at_flag", "is given, but this homing has no flag");
    } else if (checks && tolerance && result_.flag_tolerance * kSlack < step()) {
      mustBe(key, fmt::format("at least {}, which is a microstep", lowerBoundText(units(step()))));
    }
  }

  bool hasFaultOutputs() const {
    for (std::size_t i = 0; i < config_.motors(); ++i) {
      if (!config_.motorAt(i).fault) return false;
    }
    return true;
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

  void readSpeeds() {
    const std::string seek_key = inUnit("seek_speed") + "_s";
    const std::string latch_key = inUnit("latch_speed") + "_s";
    const auto seek =
        readSpeed(seek_key, units(config_.max_speed),
                  fmt::format("{}, which is {}", keys_.max_speed, axis_.shown(keys_.max_speed)));
    result_.seek_speed = si(seek.value_or(0.0));
    if (isStall()) return checkStallSpeed(seek_key, seek);
    if (isBlock() && result_.approaches == 1) return;
    // The count stays correct at the switch only at a speed from which the motor stops at once. A
    // motor that is blocked has stopped, and a flag is passed.
    const bool known = isLimit() && config_.steps_per_unit > 0.0 && config_.acceleration > 0.0;
    const double restart = known ? units(restartSpeed(config_)) : 0.0;
    const auto latch = readSpeed(latch_key, restart,
                                 fmt::format("{}, the speed that the motor stops from without a "
                                             "ramp ({}, or that after one full step)",
                                             upperBoundText(restart), keys_.start_speed));
    if (seek && latch && *latch > *seek) {
      mustBe(latch_key, fmt::format("at most {}, which is {}", seek_key, homing_.shown(seek_key)));
    }
    result_.latch_speed = si(latch.value_or(0.0));
  }

  /// [full steps per unit of the configuration]
  double fullSteps() const { return config_.steps_per_unit / config_.microsteps / units(1.0); }

  void checkStallSpeed(const std::string& key, const std::optional<double>& speed) {
    if (config_.motors() > 1) {
      homing_.contradiction("kind",
                            "is stall, but must be another one: it is only for an axis with "
                            "one motor");
      return;
    }
    if (!config_.tmc || !config_.tmc->stall) {
      homing_.contradiction("kind", fmt::format("is stall, but {} is missing",
                                                axis_.fullName("tmc/stall_threshold")));
      return;
    }
    if (!speed || config_.steps_per_unit <= 0.0) return;
    const double rate = *speed * fullSteps();
    if (rate * kSlack < kSlowestStall) {
      mustBe(key,
             fmt::format("at least {}, which is {} full steps/s: a slower motor shows no stall",
                         lowerBoundText(kSlowestStall / fullSteps()), numberText(kSlowestStall)));
    }
    const double above = config_.tmc->spread_cycle_above;
    if (config_.tmc->baud == 0) return;  // on SPI: it chops as in SpreadCycle then
    if (above > 0.0 && rate >= above) {
      mustBe(key, fmt::format("below tmc/spreadcycle_above, which is {}: the chip detects stalls "
                              "below it only",
                              roughText(above / fullSteps())));
    }
  }

  /// The second approach must come to its speed, and the chip must have measured there.
  void checkStallPullOff(const std::string& key, double pull_off) {
    if (config_.steps_per_unit <= 0.0 || config_.acceleration <= 0.0) return;
    const double ramp = result_.seek_speed * result_.seek_speed / (2.0 * config_.acceleration);
    const double least = units(2.0 * ramp) + 2.0 * kStallTakes / fullSteps();
    if (pull_off >= least) return;
    mustBe(key, fmt::format("at least {}, in which the axis comes to its speed again",
                            lowerBoundText(least)));
  }

  /// @return whether it is right.
  bool readOffset(bool required) {
    const std::string key = inUnit("offset");
    const auto offset =
        homing_.findNumber(key, Range{}, required ? Presence::kRequired : Presence::kOptional);
    result_.offset = si(offset.value_or(0.0));
    return offset.has_value() == homing_.has(key);
  }

  void readDistances(bool has_end) {
    const std::string travel_key = inUnit("max_travel");
    const std::string pull_off_key = inUnit("pull_off");
    const std::string final_key = inUnit("final_position");
    const auto travel = homing_.findNumber(travel_key, Range::positive(), Presence::kRequired);
    const double steps = config_.steps_per_unit / units(1.0);
    if (travel && steps > 0.0 && *travel * steps > kFarthestTravel * kSlack) {
      mustBe(travel_key, fmt::format("at most {}, which is 2^40 steps",
                                     upperBoundText(kFarthestTravel / steps)));
    }
    const auto final_position = homing_.findNumber(final_key, Range{}, Presence::kOptional);
    const bool backs_off = isStall() || (isBlock() && result_.approaches == 2);
    const bool stops_there = isLimit() || isBlock() || isStall();
    const bool needs_pull_off = (stops_there && !homing_.has(final_key)) || backs_off;
    const auto pull_off =
        homing_.findNumber(pull_off_key, Range::notNegative(),
                           needs_pull_off ? Presence::kRequired : Presence::kOptional);
    const bool too_far = travel && pull_off && *pull_off > *travel;
    if (too_far) {
      mustBe(pull_off_key,
             fmt::format("at most {}, which is {}", travel_key, homing_.shown(travel_key)));
    }
    if (backs_off && pull_off && *pull_off == 0.0) {
      mustBe(pull_off_key, "above 0, from where the second approach begins");
    } else if (isStall() && pull_off && !too_far) {
      checkStallPullOff(pull_off_key, *pull_off);
    }
    result_.max_travel = si(travel.value_or(0.0));
    result_.pull_off = si(pull_off.value_or(0.0));
    if (final_position) result_.final_position = si(*final_position);
    const bool all_right = readOffset(false) && pull_off.has_value() == homing_.has(pull_off_key) &&
                           !too_far && final_position.has_value() == homing_.has(final_key) &&
                           (pull_off || final_position || !stops_there);
    if (has_end && all_right) checkRest();
  }

  /// The axis must be able to move from its position after the result_.
  void checkRest() {
    if (result_.final_position) return checkFinalPosition();
    const std::string offset_key = inUnit("offset");
    const double rest = restOf(result_);
    const std::string stands =
        homing_.has(offset_key) ? "is " + homing_.shown(offset_key) : "is missing, and so 0";
    if (isLimit() && triggersInside(config_, result_)) {
      const std::string limit = result_.at_max ? keys_.max_position : keys_.min_position;
      const double clear =
          result_.at_max ? result_.offset + result_.pull_off : result_.offset - result_.pull_off;
      return homing_.issue(
          offset_key,
          fmt::format(
              "{}, so that nothing of the way between the {} switch and {}, which is {}, "
              "can be reached, because no motion passes an endstop; it must be {} {}, or {} "
              "must be {} {}",
              stands, result_.at_max ? "max" : "min", limit, axis_.shown(limit),
              result_.at_max ? "at least" : "at most",
              roughText(units(result_.at_max ? *config_.max_position - result_.pull_off
                                             : *config_.min_position + result_.pull_off)),
              limit, result_.at_max ? "at most" : "at least", roughText(units(clear))));
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

  double step() const { return config_.steps_per_unit > 0.0 ? 1.0 / config_.steps_per_unit : 0.0; }

  void checkWithinLimits(const std::string& key, double position) {
    if (config_.min_position && position < *config_.min_position - step()) {
      mustBe(key, fmt::format("at least {}, which is {}", keys_.min_position,
                              axis_.shown(keys_.min_position)));
    }
    if (config_.max_position && position > *config_.max_position + step()) {
      mustBe(key, fmt::format("at most {}, which is {}", keys_.max_position,
                              axis_.shown(keys_.max_position)));
    }
  }

  /// Beyond the trigger point is what stops the axis.
  void checkFinalPosition() {
    const std::string key = inUnit("final_position");
    const double position = *result_.final_position;
    checkWithinLimits(key, position);
    if (!isLimit() && !isBlock() && !isStall()) return;
    const double beyond = result_.at_max ? position - result_.offset : result_.offset - position;
    if (beyond <= step()) return;
    mustBe(key, fmt::format("{} {}, which is {}", result_.at_max ? "at most" : "at least",
                            inUnit("offset"), roughText(units(result_.offset))));
  }

  ConfigReader& axis_;
  ConfigReader homing_;
  const MotionKeys& keys_;
  const AxisConfig& config_;
  HomingConfig result_;
};

}  // namespace

std::string homingKey(const char* what, Kind kind) {
  return std::string(what) + (kind == Kind::kLinear ? "_mm" : "_deg");
}

const std::string& textOf(HomingKind kind) { return kKinds.at(static_cast<std::size_t>(kind)); }
const std::string& textOf(FlagCheck check) {
  return kFlagChecks.at(static_cast<std::size_t>(check));
}

double restOf(const HomingConfig& homing) {
  if (homing.final_position) return *homing.final_position;
  return homing.offset + (homing.at_max ? -homing.pull_off : homing.pull_off);
}

void checkHomingInputs(const std::vector<AxisConfig>& axes, const std::vector<InputConfig>& inputs,
                       const std::string& name, std::vector<ConfigIssue>& issues) {
  std::vector<std::string> names;
  names.reserve(inputs.size());
  for (const InputConfig& input : inputs) names.push_back(input.name);
  const auto check = [&](const AxisConfig& axis, const char* key, const std::string& wanted) {
    if (wanted.empty() || std::find(names.begin(), names.end(), wanted) != names.end()) return;
    issues.push_back(
        {fmt::format("{}/{}/homing/{}", name, axis.name, key),
         fmt::format("is \"{}\", but must be the name of an input: {}", printable(wanted),
                     names.empty() ? "there is no `inputs`" : listText(names, "or")),
         true});
  };
  for (const AxisConfig& axis : axes) {
    if (!axis.homing) continue;
    check(axis, "input", axis.homing->input);
    check(axis, "flag", axis.homing->flag);
  }
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
