#include "hand_move.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "../table_units.h"
#include "common/text.h"

namespace stepdriver::console {
namespace {

using config::Kind;
using ros_node::roundedText;

// When a call is answered, an older state may still be on its way; the one after it is new.
constexpr int kStatesUntilFresh = 2;

SmallMove slowly(const config::AxisConfig& config, double distance, double speed) {
  const double highest = config.max_speed * config::configUnitsPerUnit(config.kind);
  return {distance, std::min(speed, highest / 2.0)};
}

}  // namespace

SmallMove visibleMove(const config::AxisConfig& config) {
  return config.kind == Kind::kLinear ? slowly(config, 2.0, 5.0) : slowly(config, 10.0, 20.0);
}

SmallMove measurableMove(const config::AxisConfig& config) {
  return config.kind == Kind::kLinear ? slowly(config, 20.0, 10.0) : slowly(config, 90.0, 45.0);
}

std::string distanceText(const config::AxisConfig& config, double distance) {
  return fmt::format("{} {} towards {}", roundedText(std::abs(distance)), configUnitOf(config.kind),
                     distance < 0.0 ? "minus" : "plus");
}

std::string knownRefusal(const config::AxisConfig& config, const AxisView& state, double distance) {
  // The first motion of an idle axis wakes it up.
  if (!state.fault.empty()) return "it has a fault: " + state.fault;
  if (!state.enabled && !state.idle) return "its motor is disabled";
  if (state.asleep && !state.idle) return "its driver chip is asleep";
  if (state.held) return "it is on hold";
  if (state.switches_known && (distance < 0.0 ? state.min_active : state.max_active)) {
    return fmt::format("the {} switch ahead of it reads pressed", distance < 0.0 ? "min" : "max");
  }
  const double units = config::configUnitsPerUnit(config.kind);
  // The driver counts from the commanded position, up to half a step from this one.
  const double doubt = units / config.steps_per_unit;
  const double target = state.position + distance;
  const bool below = config.min_position && target < *config.min_position * units - doubt;
  const bool above = config.max_position && target > *config.max_position * units + doubt;
  if (!below && !above) return {};
  const std::string unit = configUnitOf(config.kind);
  const double limit = below ? *config.min_position : *config.max_position;
  return fmt::format("it stands at {}, and would then be beyond its soft limit {}",
                     positionText(state.position, unit), positionText(limit * units, unit));
}

std::string HandMove::refusalOf(double distance) {
  return knownRefusal(config_, freshState(), distance);
}

double HandMove::ask(const SmallMove& move) {
  const std::string way = distanceText(config_, move.distance);
  const std::string why = refusalOf(move.distance);
  if (!why.empty()) {
    dialogue_.say(fmt::format("{} can't move {}: {}.", config_.name, way, why));
    return 0.0;
  }
  const std::string what = fmt::format(
      "{0} will move {1}, as the configuration defines it now, at {2} {3}/s. Enter stops it. Move "
      "{0} now?",
      config_.name, way, roundedText(move.speed), configUnitOf(config_.kind));
  if (!askYesNo(dialogue_, what, false)) return 0.0;
  const double start = machine_.state(config_.name).position;
  const client::Answer answer = machine_.move(config_.name, move.distance, move.speed);
  if (!answer.success) {
    dialogue_.say("The driver refuses: " + inTableUnits(answer.message));
    return 0.0;
  }
  try {
    return watch(start);
  } catch (...) {
    machine_.stop(config_.name);
    throw;
  }
}

double HandMove::watch(double start) {
  const AxisView before = machine_.state(config_.name);
  const auto stopped = [&](const std::string& why) {
    machine_.stop(config_.name);
    rest();
    dialogue_.say("Stopped: " + why + ".");
    return 0.0;
  };
  for (;;) {
    const AxisView now = freshState();
    if (!now.fault.empty()) {
      dialogue_.say("Stopped by a fault: " + now.fault);
      return 0.0;
    }
    if (now.min_active != before.min_active || now.max_active != before.max_active) {
      return stopped("a switch has changed");
    }
    if (!now.moving) return now.position - start;
    if (dialogue_.lineOfAHand()) return stopped("you asked for it");
  }
}

void HandMove::rest() {
  while (freshState().moving) {
  }
}

AxisView HandMove::freshState() {
  const int from = machine_.states();
  while (machine_.states() < from + kStatesUntilFresh) {
    machine_.wait();
    machine_.state(config_.name);
  }
  return machine_.state(config_.name);
}

}  // namespace stepdriver::console
