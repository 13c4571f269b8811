#include "read_shared_switches.h"

#include <fmt/format.h>

#include <algorithm>

#include "message_text.h"
#include "motion_keys.h"

namespace stepdriver::config {
namespace {

constexpr double kRounding = 1.0 + 1e-9;  // of numbers that were converted

bool sharesBothEnds(const AxisConfig& axis) {
  const std::optional<Endstop>& min = axis.endstop_min;
  const std::optional<Endstop>& max = axis.endstop_max;
  return axis.motors() == 1 && min && max && min->shared && max->shared && !min->line.empty() &&
         min->line == max->line;
}

/// A switch whose line others may have too.
struct SharedSwitch {
  const AxisConfig* axis;
  std::string key;
  std::string line;
};

std::vector<SharedSwitch> sharedSwitchesOf(const std::vector<AxisConfig>& axes,
                                           const std::string& name) {
  std::vector<SharedSwitch> switches;
  for (const AxisConfig& axis : axes) {
    for (std::size_t i = 0; i < axis.motors(); ++i) {
      const MotorConfig& motor = axis.motorAt(i);
      const std::string key = name + "/" + axis.name +
                              (axis.motors() > 1 ? "/motors/" + motor.motor : "") + "/endstops/";
      const auto add = [&](const std::optional<Endstop>& endstop, const char* end) {
        if (!endstop || !endstop->shared || endstop->line.empty()) return;
        switches.push_back({&axis, key + end + "/shared", endstop->line});
      };
      add(motor.endstop_min, "min");
      add(motor.endstop_max, "max");
    }
  }
  return switches;
}

}  // namespace

void readSharedEnds(ConfigReader& axis, const std::optional<Kind>& kind, AxisConfig& config) {
  if (config.motors() > 1 || axis.value("endstops").as<ConfigValue::Map>() == nullptr) return;
  ConfigReader endstops = axis.map("endstops");
  for (const char* key : {"min", "max"}) endstops.allow(key);
  if (!kind) {
    for (const char* key : {"release_mm", "release_deg"}) endstops.allow(key);
  }
  const auto assumed = endstops.findOneOf("assumed_end", std::vector<std::string>{"min", "max"},
                                          Presence::kOptional);
  const bool shares = sharesBothEnds(config);
  const char* const only =
      "is given, but is only for a switch of both ends: endstops/min and "
      "endstops/max with one pin, and shared: true";
  if (assumed) {
    config.assumed_end_is_max = *assumed == "max";
    if (!shares) endstops.contradiction("assumed_end", only);
  }
  if (kind) {
    const std::string key = *kind == Kind::kLinear ? "release_mm" : "release_deg";
    const auto release = endstops.findNumber(key, Range::positive(),
                                             shares ? Presence::kRequired : Presence::kOptional);
    config.switch_release =
        release.value_or(0.0) / static_cast<double>(motionKeys(*kind).units_per_si_unit);
    const double full_step =
        config.steps_per_unit > 0.0 ? config.microsteps / config.steps_per_unit : 0.0;
    if (release && !shares) {
      endstops.contradiction(key, only);
    } else if (release && config.switch_release * kRounding < full_step) {
      endstops.contradiction(
          key, fmt::format("is {}, but must be at least a full step, {}", endstops.shown(key),
                           lowerBoundText(full_step * configUnitsPerUnit(*kind))));
    } else if (release && config.min_position && config.max_position &&
               2.0 * config.switch_release * kRounding >=
                   *config.max_position - *config.min_position) {
      endstops.contradiction(
          key, fmt::format("is {}, but must be below half of the way between the soft limits, {}",
                           endstops.shown(key),
                           upperBoundText(0.5 * (*config.max_position - *config.min_position) *
                                          configUnitsPerUnit(*kind))));
    }
  }
  endstops.rejectUnknown();
}

void checkSharedSwitches(const std::vector<AxisConfig>& axes, const std::string& name,
                         std::vector<ConfigIssue>& issues) {
  const std::vector<SharedSwitch> switches = sharedSwitchesOf(axes, name);
  for (const SharedSwitch& one : switches) {
    const AxisConfig& axis = *one.axis;
    if (axis.motors() > 1) {
      issues.push_back({one.key,
                        "is true, but each switch of an axis with several motors needs a line of "
                        "its own",
                        true});
      continue;
    }
    bool is_alone = true;
    for (const SharedSwitch& other : switches) {
      if (&other == &one || other.line != one.line) continue;
      is_alone = false;
      if (other.axis->name >= axis.name || !axis.homing || !other.axis->homing ||
          axis.homing->order != other.axis->homing->order) {
        continue;
      }
      issues.push_back({name + "/" + axis.name + "/homing/order",
                        fmt::format("is {}, as that of {}, but must differ: a switch of each is on "
                                    "the line \"{}\", so they are homed one after the other",
                                    axis.homing->order, other.axis->name, one.line),
                        true});
    }
    if (is_alone) {
      issues.push_back({one.key,
                        fmt::format("is true, but no other switch is on the line \"{}\"", one.line),
                        true});
    }
  }
}

}  // namespace stepdriver::config
