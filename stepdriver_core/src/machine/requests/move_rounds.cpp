#include "move_rounds.h"

#include <fmt/format.h>

#include <cmath>

#include "message_text.h"
#include "move_to.h"

namespace stepdriver::machine {

std::string MoveRounds::text(const AxisWords& axes) const {
  return fmt::format("{}: move by {} revolutions{}", axes.name(axis), numberText(rounds),
                     axes.velocity(axis, velocity));
}

void MoveRounds::serve(RequestContext& machine, const SharedCall& call) const {
  const axis::AxisModel& moved = machine.axis(axis);
  if (moved.config.kinematics) {
    moved.refuse("it shares its motors, none of which turns for it alone: move it by a distance");
  }
  if (moved.config.steps_per_round <= 0.0) {
    moved.refuse(
        "the steps per revolution are not known: configure steps_per_round or "
        "full_steps_per_round");
  }
  if (!std::isfinite(rounds)) {
    moved.refuse(fmt::format("rounds is {}, but must be a finite number", rounds));
  }
  const double distance = rounds * moved.config.steps_per_round / moved.config.steps_per_unit;
  MoveTo{axis, distance, true, velocity}.serve(machine, call);
}

}  // namespace stepdriver::machine
