#include "stop_move.h"

#include <fmt/format.h>

namespace stepdriver::machine {

std::string StopMove::text(const AxisWords& axes) const {
  return fmt::format("stop move {} of {}", move, axes.name(axis));
}

void StopMove::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& stopped = machine.axis(axis);
  if (machine.activities.schedule().dropMove(stopped, move, kStopped)) return;
  const activity::Goal* goal = machine.goalOf(stopped);
  if (goal == nullptr || goal->move != move) return;
  stopped.noteStop();
  machine.activities.end(stopped, kStopped, call);
}

}  // namespace stepdriver::machine
