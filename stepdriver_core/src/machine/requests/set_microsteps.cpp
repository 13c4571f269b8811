#include "set_microsteps.h"

#include <fmt/format.h>

#include <cstdint>
#include <memory>

#include "activity/driver_activities.h"

namespace stepdriver::machine {

std::string SetMicrosteps::text(const AxisWords& axes) const {
  return fmt::format("{}: {} microsteps", axes.name(axis), microsteps);
}

void SetMicrosteps::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& changed = machine.axis(axis);
  changed.refuseMicrosteps(microsteps);
  machine.refuseUnlessFree(changed, "its microsteps are changed");
  if (changed.fault) changed.refuse("at fault: " + changed.fault.what() + "; call recover first");
  if (microsteps == changed.motor.microsteps()) return;
  const std::int64_t count = changed.motor.state().count;
  const std::int64_t common = changed.motor.translator().nearestCommon(count, microsteps);
  if (common != count) {
    const double place = changed.positionOf(changed.jointAt(static_cast<double>(common)));
    if (!changed.config.align_on_microstep_change) {
      changed.refuse(fmt::format(
          "1/{} has no position at {}; the nearest that both modes have is {}: move "
          "there first, or configure align_on_microstep_change",
          microsteps, changed.showPlace(changed.positionNow()), changed.showPlace(place)));
    }
    machine.refuseUnlessReadyToMove(changed);
    changed.refuseBeyondLimits(place, "the common position");
    changed.refuseIntoEndstop(common - count);
  }
  machine.activities.begin(
      std::make_unique<activity::ChangeMicrosteps>(machine.context, changed, microsteps, call),
      kTakenOver);
}

}  // namespace stepdriver::machine
