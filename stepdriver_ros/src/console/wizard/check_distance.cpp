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
      "That is near a factor of {}: first compare the microsteps that straps or DIP switches set "
      "with `microsteps`.",
      roundedText(std::exp2(std::abs(whole))));
}

struct Measured {
  double commanded = 0.0;  ///< [mm|deg]
  double really = 0.0;     ///< [mm|deg]
};

/// Asks which way has room, and doesn't offer one that the driver would refuse.
///
/// @param measured, play [mm|deg] lengths of the move that is measured and of the one before it
/// @param wrong_way the driver's plus is the user's minus.
/// @return 1 for plus, -1 for minus; empty: there is no room.
std::optional<double> askWay(Dialogue& dialogue, HandMove& hand_move,
                             const config::AxisConfig& config, double measured, double play,
                             bool wrong_way) {
  const double distance = measured + play;
  const auto possible = [&](double way) {
    const std::string why = hand_move.refusalOf(way * distance);
    if (!why.empty()) {
      dialogue.say(fmt::format("{} can't move {}: {}.", config.name,
                               distanceText(config, way * distance), why));
    }
    return why.empty();
  };
  const bool plus = possible(1.0);
  const bool minus = possible(-1.0);
  if (!plus && !minus) return {};
  const double way = plus ? 1.0 : -1.0;
  const auto end = [wrong_way](bool is_plus) {
    return fmt::format("your {} end", is_plus != wrong_way ? "plus" : "minus");
  };
  const std::string question = fmt::format(
      "Is there room for {} {unit} towards {}: {} {unit} to take up the play, then {} {unit}?{}",
      roundedText(distance), end(plus), roundedText(play), roundedText(measured),
      plus && minus ? fmt::format(" If you answer n, it moves towards {}.", end(false)) : "",
      fmt::arg("unit", configUnitOf(config.kind)));
  if (askYesNo(dialogue, question, true)) return way;
  return plus && minus ? std::optional(-1.0) : std::nullopt;
}

/// @return empty if a move wasn't completed, or its length isn't known.
std::optional<Measured> measure(Dialogue& dialogue, HandMove& hand_move,
                                const config::AxisConfig& config, bool wrong_way) {
  const std::string unit = configUnitOf(config.kind);
  SmallMove move = measurableMove(config);
  SmallMove play = visibleMove(config);
  move.distance =
      *askLength(dialogue, fmt::format("How far should {} move to be measured?", config.name), unit,
                 move.distance);
  const auto way = askWay(dialogue, hand_move, config, move.distance, play.distance, wrong_way);
  if (!way) return {};
  move.distance *= *way;
  play.distance *= *way;
  dialogue.say("First it makes a small move in the same direction, to take up the play.");
  if (hand_move.ask(play) == 0.0) return {};
  dialogue.ask(fmt::format("Mark where {} stands now, or set the dial to 0; then press Enter. ",
                           config.name));
  const double moved = std::abs(hand_move.ask(move));
  if (moved == 0.0) return {};
  const auto really =
      askLength(dialogue, fmt::format("How far did {} really move?", config.name), unit);
  if (!really) return {};
  return Measured{moved, *really};
}

}  // namespace

void checkDistance(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings) {
  if (findings.wrong_way) {
    dialogue.say(
        "Until the driver is restarted with the new configuration, its plus is your minus.");
  }
  HandMove hand_move(dialogue, machine, config);
  std::optional<Measured> measured = measure(dialogue, hand_move, config, findings.wrong_way);
  while (!measured) {
    if (!askYesNo(dialogue, "Nothing is measured. Try again?", false)) return;
    measured = measure(dialogue, hand_move, config, findings.wrong_way);
  }
  const double factor = measured->commanded / measured->really;
  const double steps = config.steps_per_unit / config::configUnitsPerUnit(config.kind);
  const std::string unit = configUnitOf(config.kind);
  const std::string commanded = roundedText(measured->commanded);
  const std::string really = roundedText(measured->really);
  dialogue.say(
      fmt::format("Commanded {0} {2}, measured {1} {2}: {3} x {0} / {1} = {4} steps per {2}.",
                  commanded, really, unit, roundedText(steps), roundedText(steps * factor)));
  if (std::abs(factor - 1.0) < kAsGoodAsRight) {
    dialogue.say("That is accurate enough: the configuration stays as it is.");
    return;
  }
  const std::string cause = usualCause(factor);
  if (!cause.empty()) dialogue.say(cause);
  if (askYesNo(dialogue, "Use the new value?", true)) findings.scale = factor;
}

}  // namespace stepdriver::console
