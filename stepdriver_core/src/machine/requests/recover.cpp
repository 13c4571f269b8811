#include "recover.h"

#include <memory>

#include "activity/driver_activities.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {
std::string Recover::text(const AxisWords& /*axes*/) const { return "recover"; }

void Recover::serve(RequestContext& machine, const SharedCall& call) const {
  machine.refuseWhileEmergencyStopInput();
  activity::Context& context = machine.context;
  if (context.stops_asked != context.stops_handled) {
    throw Refused("an emergency stop has come meanwhile");
  }
  context.stops_cleared = context.stops_handled;
  context.out->clear_stops = context.stops_handled;
  machine.named.outputs.retry(call);
  for (const auto& faulty : context.axes) {
    if (!faulty->fault) continue;
    ++faulty->stops;
    machine.activities.begin(std::make_unique<activity::Recover>(context, *faulty, call),
                             {axis::MoveEnd::kFault, faulty->fault.what()});
  }
}

}  // namespace stepdriver::machine
