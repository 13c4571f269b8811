#include "restore_position.h"

#include <fmt/format.h>

#include <memory>
#include <utility>

#include "activity/driver_activities.h"
#include "message_text.h"

namespace stepdriver::machine {

std::string RestorePosition::text(const AxisWords& axes) const {
  return fmt::format("restore position of {}: {} {}", axes.name(axis), numberText(memory.position),
                     axes.unit(axis));
}

void RestorePosition::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& restored = machine.axis(axis);
  const std::string why = restored.whyImpossible(memory, source);
  if (!why.empty()) {
    restored.position.setNote(why);
    return;
  }
  std::string doubt = restored.whyUnverified(memory, clean, source);
  machine.activities.begin(std::make_unique<activity::RestorePosition>(
                               machine.context, restored, memory, std::move(doubt), call),
                           kTakenOver);
}

}  // namespace stepdriver::machine
