#include "probe_stroke.h"

#include <fmt/format.h>

#include <cstddef>

#include "printable.h"

namespace stepdriver::machine {

std::string ProbeStroke::text(const AxisWords& words) const {
  if (!latch) return line.text(words) + " after a probing";
  return fmt::format("{} until {}", line.text(words), printable(latch->wanted.input));
}

void ProbeStroke::serve(RequestContext& machine, const SharedCall& call) const {
  refuseUnlessUndisturbed(machine);
  if (latch) refuseUnlessApart(machine);
  begin->clear();
  for (const AxisId id : line.axes) begin->push_back(machine.axis(id).positionNow());
  const auto outcome = line.begin(machine, call);
  if (latch) latch->begin(machine, outcome);
}

// Between two strokes the axes belong to nobody.
void ProbeStroke::refuseUnlessUndisturbed(RequestContext& machine) const {
  for (std::size_t i = 0; i < line.axes.size(); ++i) {
    const axis::AxisModel& axis = machine.axis(line.axes[i]);
    if (axis.stops - axis.holds != stops.at(i)) axis.refuse("it was stopped");
    if (is_first) {
      machine.refuseUnlessFree(axis, "a probing begins");
    } else if (axis.moving()) {
      axis.refuse("another command took over");
    }
  }
}

// The input must be able to tell of a contact.
void ProbeStroke::refuseUnlessApart(RequestContext& machine) const {
  const NamedInputs& inputs = machine.named.inputs;
  const axis::AxisModel& first = machine.axis(line.axes.front());
  if (const std::string failure = inputs.failureNow(machine.context, latch->input);
      !failure.empty()) {
    first.refuse(failure);
  }
  const bool is_active = inputs.isActiveNow(machine.context, latch->input);
  if (is_active != (latch->wanted.edge == LatchEdge::kActive)) return;
  first.refuse(fmt::format("the input {} is {} already, so it can't tell of a contact",
                           printable(latch->wanted.input), is_active ? "active" : "inactive"));
}

}  // namespace stepdriver::machine
