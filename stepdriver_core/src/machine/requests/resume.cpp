#include "resume.h"

namespace stepdriver::machine {

std::string Resume::text(const AxisWords& /*axes*/) const { return "resume"; }

void Resume::serve(RequestContext& machine, const SharedCall& call) const {
  activity::Context& context = machine.context;
  if (!context.mode.held) return;
  // All or none: what is refused for one axis leaves the machine on hold.
  machine.activities.forEach([](const activity::Activity& activity) {
    if (activity.hasBegun()) activity.refuseUnlessResumable();
  });
  context.mode.held = false;
  for (const auto& axis : context.axes) axis->noteHold();
  machine.activities.forEach([&](activity::Activity& activity) {
    if (activity.hasBegun()) activity.resume(call);
  });
}

}  // namespace stepdriver::machine
