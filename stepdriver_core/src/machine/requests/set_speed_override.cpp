#include "set_speed_override.h"

#include "message_text.h"

namespace stepdriver::machine {

std::string SetSpeedOverride::text(const AxisWords& /*axes*/) const {
  return "speed override " + numberText(factor);
}

void SetSpeedOverride::serve(RequestContext& machine, const SharedCall& call) const {
  machine.context.mode.speed_override = factor;
  machine.activities.forEach([&](activity::Activity& activity) { activity.speedChanged(call); });
}

}  // namespace stepdriver::machine
