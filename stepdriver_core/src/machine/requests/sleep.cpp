#include "sleep.h"

#include <fmt/format.h>

#include <memory>
#include <vector>

#include "activity/driver_activities.h"

namespace stepdriver::machine {

std::string Sleep::text(const AxisWords& axes) const {
  return fmt::format("{}: {}", axes.name(axis), asleep ? "sleep" : "wake");
}

void Sleep::serve(RequestContext& machine, const SharedCall& call) const {
  const std::vector<axis::AxisModel*> all = machine.withSharers(axis);
  for (const axis::AxisModel* changed : all) {
    machine.refuseUnlessFree(*changed, asleep ? "it is put to sleep" : "it is woken");
    if (!changed->motor.pins().hasSleep()) {
      changed->refuse(
          whyNoPin(changed->config, &driver::DriverChip::sleep_asleep, "sleep", "SLEEP"));
    }
  }
  for (axis::AxisModel* changed : all) {
    ++changed->stops;
    machine.activities.begin(
        std::make_unique<activity::Sleep>(machine.context, *changed, asleep, call), kTakenOver);
  }
}

}  // namespace stepdriver::machine
