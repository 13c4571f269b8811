#include "stop_all.h"

namespace stepdriver::machine {

std::string StopAll::text(const AxisWords& /*axes*/) const { return "stop all axes"; }

void StopAll::serve(RequestContext& machine, const SharedCall& call) const {
  machine.context.mode.held = false;
  for (const auto& axis : machine.context.axes) axis->noteStop();
  machine.named.outputs.stop(machine.context);
  machine.activities.endAll(kStopped, call);
}

}  // namespace stepdriver::machine
