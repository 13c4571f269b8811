#include "set_limits.h"

#include <fmt/format.h>

#include "message_text.h"

namespace stepdriver::machine {

std::string SetLimits::text(const AxisWords& axes) const {
  return fmt::format("set limits of {}: speed {}, acceleration {}, deceleration {}, jerk {}",
                     axes.name(axis), numberText(limits.max_speed), numberText(limits.acceleration),
                     numberText(limits.deceleration), numberText(limits.jerk));
}

void SetLimits::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& changed = machine.axis(axis);
  changed.refuseUnlessOpen();
  changed.changeLimits(changed.checkedLimits(limits));
  activity::Activity* owner = machine.activities.owner(changed);
  // Axes that move together keep their limits.
  if (owner != nullptr && owner->axes().size() == 1) owner->speedChanged(call);
}

}  // namespace stepdriver::machine
