#include "stop_axis.h"

namespace stepdriver::machine {

std::string StopAxis::text(const AxisWords& axes) const { return "stop " + axes.name(axis); }

void StopAxis::serve(RequestContext& machine, const SharedCall& call) const {
  machine.axis(axis).noteStop();
  machine.activities.end(machine.axis(axis), kStopped, call);
}

}  // namespace stepdriver::machine
