#include "set_position.h"

#include <fmt/format.h>

#include "message_text.h"

namespace stepdriver::machine {

std::string SetPosition::text(const AxisWords& axes) const {
  return fmt::format("set position of {}: {} {}", axes.name(axis), numberText(position),
                     axes.unit(axis));
}

void SetPosition::serve(RequestContext& machine, const SharedCall& /*call*/) const {
  axis::AxisModel& changed = machine.axis(axis);
  machine.refuseUnlessFree(changed, "its position is set");
  changed.refuseUnlessFinite("position", position);
  changed.refuseBeyondLimits(position, "the position");
  const double origin = position - changed.exactCount() / changed.stepsPerUnit();
  changed.flag_places.shift(origin - changed.position.origin());
  changed.position.declare(origin);
}

}  // namespace stepdriver::machine
