#include "axis_bring_up.h"

#include <fmt/format.h>

#include "../table_units.h"
#include "bring_up_checks.h"
#include "common/text.h"

namespace stepdriver::console {
namespace {

/// Keeps the motor enabled during its lifetime.
class Current {
 public:
  Current(MachineAtHand& machine, std::string axis) : machine_(machine), axis_(std::move(axis)) {}
  ~Current() {
    if (given_) machine_.enable(axis_, false);
  }
  Current(const Current&) = delete;
  Current& operator=(const Current&) = delete;

  /// @return whether the motor is enabled.
  bool ask(Dialogue& dialogue) {
    if (machine_.state(axis_).enabled) return true;
    const std::string question = "The motor of " + axis_ + " is disabled. Enable it?";
    if (!askYesNo(dialogue, question, false)) return false;
    const client::Answer answer = machine_.enable(axis_, true);
    if (!answer.success) dialogue.say("The driver refuses: " + inTableUnits(answer.message));
    given_ = answer.success;
    return given_;
  }

 private:
  MachineAtHand& machine_;
  const std::string axis_;
  bool given_ = false;
};

/// Until the position is known, soft limits count from the position at the start of the driver: the
/// axis might be unable to move at all.
void askPosition(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config) {
  if (machine.state(config.name).position_valid) return;
  const auto position = askNumber(
      dialogue,
      "The driver doesn't know the position, and its soft limits count from the position at which "
      "it was started. About which position is it? (Enter: leave it)",
      configUnitOf(config.kind));
  if (!position) return;
  const client::Answer answer = machine.setPosition(config.name, *position);
  dialogue.say((answer.success ? "" : "The driver refuses: ") + inTableUnits(answer.message));
}

}  // namespace

Findings bringUp(Dialogue& dialogue, MachineAtHand& machine, const config::AxisConfig& config) {
  Findings findings;
  findings.axis = config.name;
  const double steps = config.steps_per_unit / config::configUnitsPerUnit(config.kind);
  dialogue.say(fmt::format("\n==== Axis {}: {} steps per {} at {} microsteps", config.name,
                           ros_node::roundedText(steps), configUnitOf(config.kind),
                           config.microsteps));
  dialogue.say("\n-- 1. Do the switches read correctly?");
  checkSwitches(dialogue, machine, config, findings);
  Current current(machine, config.name);
  dialogue.say("\n-- 2. Which way is plus?");
  if (!current.ask(dialogue)) {
    dialogue.say("The motor is disabled: neither the direction nor the distance is checked.");
    return findings;
  }
  askPosition(dialogue, machine, config);
  checkDirection(dialogue, machine, config, findings);
  dialogue.say("\n-- 3. Is the distance right?");
  checkDistance(dialogue, machine, config, findings);
  return findings;
}

}  // namespace stepdriver::console
