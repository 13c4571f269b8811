#include "power_down.h"

#include <memory>

#include "activity/driver_activities.h"

namespace stepdriver::machine {

std::string PowerDown::text(const AxisWords& /*axes*/) const { return "power down"; }

void PowerDown::serve(RequestContext& machine, const SharedCall& call) const {
  activity::Context& context = machine.context;
  const activity::EarlyEnd why{axis::MoveEnd::kStopped, context.mode.closed};
  for (const auto& axis : context.axes) {
    if (axis->motor.pins().hasEnable() && axis->config.disable_on_shutdown) {
      machine.disable(*axis, why, call);
    } else if (axis->motor.brake().isWired()) {
      machine.activities.begin(std::make_unique<activity::EngageBrake>(context, *axis, call), why);
    }
  }
  context.motor_power.switchOff(context.now, call);
  machine.named.outputs.await(call);
}

}  // namespace stepdriver::machine
