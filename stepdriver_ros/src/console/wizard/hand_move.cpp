#include "hand_move.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

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

double HandMove::ask(const SmallMove& move) {
  const std::string unit = unitOf(config_.kind);
  const std::string what = fmt::format(
      "{0} will move {1} {2} towards {3}, as it is configured, at {4} {2}/s. Enter stops it. Move?",
      config_.name, roundedText(std::abs(move.distance)), unit,
      move.distance < 0.0 ? "minus" : "plus", roundedText(move.speed));
  if (!askYesNo(dialogue_, what, false)) return 0.0;
  const double start = machine_.state(config_.name).position;
  const client::Answer answer = machine_.move(config_.name, move.distance, move.speed);
  if (!answer.success) {
    dialogue_.say("The driver refuses: " + answer.message);
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
