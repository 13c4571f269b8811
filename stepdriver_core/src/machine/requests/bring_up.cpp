#include "bring_up.h"

#include <memory>

#include "activity/driver_activities.h"

namespace stepdriver::machine {

std::string BringUp::text(const AxisWords& /*axes*/) const { return "bring up"; }

void BringUp::serve(RequestContext& machine, const SharedCall& call) const {
  for (const auto& axis : machine.context.axes) {
    if (const auto found = kept.find(axis->name()); found != kept.end()) {
      axis->continueCoils(found->second);
    }
    machine.activities.begin(std::make_unique<activity::BringUp>(machine.context, *axis, call),
                             kTakenOver);
  }
  machine.named.inputs.begin(machine.context);
  if (!machine.isEmergencyStopInputActive()) machine.named.outputs.begin(call);
}

}  // namespace stepdriver::machine
