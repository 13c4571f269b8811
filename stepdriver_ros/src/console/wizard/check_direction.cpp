#include <fmt/format.h>

#include "bring_up_checks.h"
#include "hand_move.h"

namespace stepdriver::console {

void checkDirection(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                    Findings& findings) {
  HandMove hand_move(dialogue, machine, config);
  SmallMove move = visibleMove(config);
  for (;;) {
    const double moved = hand_move.ask(move);
    if (moved == 0.0) {
      if (!askYesNo(dialogue, "It hasn't made its move. Try again, the other way?", false)) return;
      move.distance = -move.distance;
      continue;
    }
    const char* const way = moved < 0.0 ? "minus" : "plus";
    const std::string answer = dialogue.ask(
        fmt::format("Did it go towards {}, as plus is to be? (y, n, a: again) [y/n/a] ", way));
    if (answer == "y" || answer == "n") {
      findings.wrong_way = answer == "n";
      return;
    }
  }
}

}  // namespace stepdriver::console
