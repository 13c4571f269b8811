#include <fmt/format.h>

#include <cmath>
#include <optional>
#include <string>

#include "bring_up_checks.h"
#include "common/text.h"
#include "hand_move.h"

namespace stepdriver::console {
namespace {

using ros_node::roundedText;

// Reading a rule by eye is no more accurate than this.
constexpr double kAsGoodAsRight = 0.002;
// A factor this close to a power of two comes from the microsteps, not from a gear.
constexpr double kNearPower = 0.05;

/// The usual cause of such a factor; empty: unknown.
std::string usualCause(double factor) {
  const double power = std::log2(factor);
  const double whole = std::round(power);
  if (whole == 0.0 || std::abs(power - whole) > kNearPower) return {};
  return fmt::format(
      "That is near a factor of {}: look at the microsteps first, at straps and DIP switches "
      "against `microsteps`.",
      roundedText(std::exp2(std::abs(whole))));
}

struct Measured {
  double commanded = 0.0;  ///< [mm|deg]
  double really = 0.0;     ///< [mm|deg]
};

/// @return empty if a move wasn't completed, or its length isn't known.
std::optional<Measured> measure(Dialogue& dialogue, HandMove& hand_move,
                                const config::AxisConfig& config) {
  const std::string unit = unitOf(config.kind);
  SmallMove move = measurableMove(config);
  SmallMove play = visibleMove(config);
  move.distance = *askLength(dialogue, "How far is it to go?", unit, move.distance);
  if (!askYesNo(dialogue, "Is there room for it towards plus, as it is configured?", true)) {
    move.distance = -move.distance;
    play.distance = -play.distance;
  }
  dialogue.say("First a little the same way, to take up the play.");
  if (hand_move.ask(play) == 0.0) return {};
  dialogue.ask("Mark where it stands now, or set the dial to 0; then press Enter. ");
  const double moved = std::abs(hand_move.ask(move));
  if (moved == 0.0) return {};
  const auto really = askLength(dialogue, "How far did it really go?", unit);
  if (!really) return {};
  return Measured{moved, *really};
}

}  // namespace

void checkDistance(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings) {
  if (findings.wrong_way) {
    dialogue.say("Until the driver is started with the new configuration, its plus is your minus.");
  }
  HandMove hand_move(dialogue, machine, config);
  std::optional<Measured> measured = measure(dialogue, hand_move, config);
  while (!measured) {
    if (!askYesNo(dialogue, "Nothing is measured. Try again?", false)) return;
    measured = measure(dialogue, hand_move, config);
  }
  const double factor = measured->commanded / measured->really;
  const double steps = config.steps_per_unit / config::configUnitsPerUnit(config.kind);
  const std::string unit = unitOf(config.kind);
  const std::string commanded = roundedText(measured->commanded);
  const std::string really = roundedText(measured->really);
  dialogue.say(
      fmt::format("Commanded {0} {2}, measured {1} {2}: {3} x {0} / {1} = {4} steps per {2}.",
                  commanded, really, unit, roundedText(steps), roundedText(steps * factor)));
  if (std::abs(factor - 1.0) < kAsGoodAsRight) {
    dialogue.say("That is as good as right; it stays.");
    return;
  }
  const std::string cause = usualCause(factor);
  if (!cause.empty()) dialogue.say(cause);
  if (askYesNo(dialogue, "Take that?", true)) findings.scale = factor;
}

}  // namespace stepdriver::console
