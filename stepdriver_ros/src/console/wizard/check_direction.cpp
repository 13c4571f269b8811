#include <fmt/format.h>

#include <optional>
#include <string>

#include "bring_up_checks.h"
#include "hand_move.h"

namespace stepdriver::console {
namespace {

/// Reverses the move if the driver would refuse it, and says so.
///
/// @return false: the driver would refuse both ways.
bool findPossibleWay(Dialogue& dialogue, HandMove& hand_move, const config::AxisConfig& config,
                     SmallMove& move) {
  const std::string why = hand_move.refusalOf(move.distance);
  if (why.empty()) return true;
  dialogue.say(
      fmt::format("{} can't move {}: {}.", config.name, distanceText(config, move.distance), why));
  const std::string why_back = hand_move.refusalOf(-move.distance);
  if (why_back.empty()) {
    move.distance = -move.distance;
    return true;
  }
  dialogue.say(fmt::format("{} can't move {} either: {}.", config.name,
                           distanceText(config, -move.distance), why_back));
  return false;
}

/// @return the end towards which the user saw it move; empty: the move has to be made again.
std::optional<bool> askPlusEnd(Dialogue& dialogue, const config::AxisConfig& config) {
  const bool linear = config.kind == config::Kind::kLinear;
  const std::string question =
      fmt::format("Which way did {} {}? [+ plus{end}, - minus{end}, a again] ", config.name,
                  linear ? "move" : "turn", fmt::arg("end", linear ? " end" : ""));
  for (;;) {
    const std::string answer = dialogue.ask(question);
    if (answer == "+" || answer == "plus") return true;
    if (answer == "-" || answer == "minus") return false;
    if (answer == "a") return {};
    dialogue.say(fmt::format("\"{}\" isn't understood: type +, - or a, or q to quit.", answer));
  }
}

}  // namespace

void checkDirection(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                    Findings& findings) {
  HandMove hand_move(dialogue, machine, config);
  SmallMove move = visibleMove(config);
  for (;;) {
    if (!findPossibleWay(dialogue, hand_move, config, move)) {
      dialogue.say("The direction isn't checked.");
      return;
    }
    const double moved = hand_move.ask(move);
    if (moved == 0.0) {
      const bool other_way = hand_move.refusalOf(-move.distance).empty();
      const std::string question = fmt::format("{} hasn't completed the move. Try again{}?",
                                               config.name, other_way ? ", the other way" : "");
      if (!askYesNo(dialogue, question, false)) return;
      if (other_way) move.distance = -move.distance;
      continue;
    }
    const bool commanded_plus = moved > 0.0;
    const auto plus = askPlusEnd(dialogue, config);
    if (!plus) continue;
    if (*plus == commanded_plus) {
      findings.wrong_way = false;
      dialogue.say("The direction is right, and stays as it is configured.");
      return;
    }
    const std::string question = fmt::format(
        "{} moved towards what you call {}, but the driver commanded {}. Invert its direction?",
        config.name, *plus ? "plus" : "minus", commanded_plus ? "plus" : "minus");
    findings.wrong_way = askYesNo(dialogue, question, true);
    if (findings.wrong_way) return;
  }
}

}  // namespace stepdriver::console
