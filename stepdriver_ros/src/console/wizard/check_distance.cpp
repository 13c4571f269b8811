#include <cmath>
#include <string>

#include "../../text.h"
#include "bring_up_checks.h"
#include "hand_move.h"

namespace stepdriver::console {
namespace {

using ros_node::numberText;

// Nearer than this a rule and an eye don't tell.
constexpr double kAsGoodAsRight = 0.002;
// A factor that is as near as this to a power of two comes from the microsteps, not from a gear.
constexpr double kNearPower = 0.05;

/// What is usually behind such a factor; empty: nothing that is known.
std::string usualCause(double factor) {
  const double power = std::log2(factor);
  const double whole = std::round(power);
  if (whole == 0.0 || std::abs(power - whole) > kNearPower) return {};
  return "That is near a factor of " + numberText(std::exp2(std::abs(whole))) +
         ": look at the microsteps first, at straps and DIP switches against `microsteps`.";
}

}  // namespace

void checkDistance(Dialogue& dialogue, MachineAtHand& machine, const axis::AxisConfig& config,
                   Findings& findings) {
  const std::string unit = unitOf(config.kind);
  HandMove hand_move(dialogue, machine, config);
  SmallMove move = measurableMove(config);
  const auto wanted =
      askNumber(dialogue, "How far is it to go to be measured?", unit, move.distance);
  move.distance = wanted.value_or(move.distance);
  SmallMove play = visibleMove(config);
  if (!askYesNo(dialogue, "Is there room for it towards plus, as it is configured?", true)) {
    move.distance = -move.distance;
    play.distance = -play.distance;
  }
  dialogue.say("First a little the same way, to take up the play.");
  if (hand_move.ask(play) == 0.0) {
    dialogue.say("Without that nothing is measured.");
    return;
  }
  dialogue.ask("Mark where it stands now, or set the dial to 0. Then press Enter. ");
  const double moved = std::abs(hand_move.ask(move));
  if (moved == 0.0) {
    dialogue.say("It hasn't made its move: nothing is measured.");
    return;
  }
  const auto measured = askNumber(dialogue, "How far did it really go?", unit);
  if (!measured) {
    dialogue.say("Nothing is measured.");
    return;
  }
  const double factor = moved / *measured;
  const double steps = config.steps_per_unit / axis::configUnitsPerUnit(config.kind);
  dialogue.say("Commanded " + numberText(moved) + " " + unit + ", measured " +
               numberText(*measured) + " " + unit + ": " + numberText(steps) + " x " +
               numberText(moved) + " / " + numberText(*measured) + " = " +
               numberText(steps * factor) + " steps per " + unit + ".");
  if (std::abs(factor - 1.0) < kAsGoodAsRight) {
    dialogue.say("That is as good as right; it stays.");
    return;
  }
  const std::string cause = usualCause(factor);
  if (!cause.empty()) dialogue.say(cause);
  if (askYesNo(dialogue, "Take that?", true)) findings.scale = factor;
}

}  // namespace stepdriver::console
