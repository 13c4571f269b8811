#include "reset.h"

#include <memory>
#include <vector>

#include "activity/driver_activities.h"

namespace stepdriver::machine {

std::string Reset::text(const AxisWords& axes) const { return "reset " + axes.name(axis); }

void Reset::serve(RequestContext& machine, const SharedCall& call) const {
  const std::vector<axis::AxisModel*> all = machine.withSharers(axis);
  for (const axis::AxisModel* changed : all) {
    machine.refuseUnlessFree(*changed, "it is reset");
    if (!changed->motor.pins().hasReset()) {
      changed->refuse(whyNoPin(changed->config, &driver::DriverChip::reset_held, "reset", "RESET"));
    }
  }
  for (axis::AxisModel* changed : all) {
    machine.activities.begin(std::make_unique<activity::Reset>(machine.context, *changed, call),
                             kTakenOver);
  }
}

}  // namespace stepdriver::machine
