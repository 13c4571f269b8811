#include <fmt/format.h>

#include <optional>
#include <string>

#include "bring_up_checks.h"

namespace stepdriver::console {
namespace {

struct Press {
  bool max = false;       ///< the switch that is configured as max, not min
  bool inverted = false;  ///< it read active while it wasn't pressed
};

std::string nameOf(bool max) { return max ? "max" : "min"; }

/// Waits until a switch has been pressed and released.
///
/// @return empty: a line was entered instead.
std::optional<Press> awaitPress(Dialogue& dialogue, MachineAtHand& machine,
                                const std::string& axis) {
  const AxisView rest = machine.state(axis);
  std::optional<Press> press;
  for (;;) {
    if (dialogue.line()) return {};
    machine.wait();
    const AxisView now = machine.state(axis);
    const bool min = now.min_active != rest.min_active;
    const bool max = now.max_active != rest.max_active;
    if (!press && (min || max)) {
      press = Press{max, max ? rest.max_active : rest.min_active};
      dialogue.say("  " + nameOf(max) + " has changed; release it");
    }
    if (press && !min && !max) return press;
  }
}

std::optional<Press> checkEnd(Dialogue& dialogue, MachineAtHand& machine,
                              const config::AxisConfig& config, const std::string& end) {
  dialogue.say(
      fmt::format("Press the switch at the {} end by hand, then release it. (Enter: there is no "
                  "switch, or nothing happens)",
                  end));
  const auto press = awaitPress(dialogue, machine, config.name);
  if (!press) {
    dialogue.say("  No switch has changed at the " + end + " end.");
    return {};
  }
  dialogue.say(fmt::format(
      "  The switch at the {} end is the one that is configured as {}{}", end, nameOf(press->max),
      press->inverted ? ". It is inverted: it read pressed before you pressed it." : "."));
  return press;
}

void sayDead(Dialogue& dialogue, const std::string& name) {
  dialogue.say(
      fmt::format("  ATTENTION: {} is configured, but has never changed. Check its wire, its line "
                  "and its supply before you rely on it; the wizard can't repair that.",
                  name));
}

}  // namespace

void checkSwitches(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config,
                   Findings& findings) {
  if (!config.endstop_min && !config.endstop_max) {
    dialogue.say("No endstops are configured.");
    return;
  }
  dialogue.say(
      "Decide which end of the axis you call plus, and which one minus. Nothing moves in this "
      "part.");
  const auto minus = checkEnd(dialogue, machine, config, "minus");
  const auto plus = checkEnd(dialogue, machine, config, "plus");
  bool min_seen = false;
  bool max_seen = false;
  for (const auto& press : {minus, plus}) {
    if (!press) continue;
    (press->max ? max_seen : min_seen) = true;
    (press->max ? findings.max_inverted : findings.min_inverted) = press->inverted;
  }
  if (config.endstop_min && !min_seen) sayDead(dialogue, "endstops/min");
  if (config.endstop_max && !max_seen) sayDead(dialogue, "endstops/max");
  if (minus && plus && minus->max == plus->max) {
    dialogue.say("  ATTENTION: both ends change the same line: are the switches wired together?");
    return;
  }
  findings.switches_swapped = (minus && minus->max) || (plus && !plus->max);
}

}  // namespace stepdriver::console
