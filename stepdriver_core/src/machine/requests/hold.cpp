#include "hold.h"

#include "stepdriver_core/error.h"

namespace stepdriver::machine {

std::string Hold::text(const AxisWords& /*axes*/) const { return "hold"; }

void Hold::serve(RequestContext& machine, const SharedCall& call) const {
  activity::Context& context = machine.context;
  if (!context.mode.closed.empty()) throw Refused(context.mode.closed);
  if (context.mode.held) return;
  context.mode.held = true;
  machine.activities.schedule().dropAll({axis::MoveEnd::kStopped, "the machine was put on hold"});
  for (const auto& axis : context.axes) axis->noteHold();
  machine.activities.forEach([&](activity::Activity& activity) {
    if (activity.hasBegun()) activity.hold(call);
  });
}

}  // namespace stepdriver::machine
