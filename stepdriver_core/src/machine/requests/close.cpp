#include "close.h"

namespace stepdriver::machine {

std::string Close::text(const AxisWords& /*axes*/) const { return "shut down"; }

void Close::serve(RequestContext& machine, const SharedCall& call) const {
  machine.context.mode.closed = reason;
  machine.context.mode.held = false;
  for (const auto& axis : machine.context.axes) ++axis->stops;
  machine.latches.endAll(reason);
  machine.activities.endAll({axis::MoveEnd::kStopped, reason}, call);
}

}  // namespace stepdriver::machine
