#include "enable.h"

#include <algorithm>
#include <memory>

#include "activity/driver_activities.h"
#include "activity/follow_goal.h"
#include "activity/point_motion.h"
#include "activity/steps.h"

namespace stepdriver::machine {
namespace {

// Whether an enable has something to do. @throw Refused
bool mustEnable(const RequestContext& machine, const axis::AxisModel& axis) {
  activity::refuseUnlessCurrentStays(machine.context, axis);
  const activity::Activity* owner = machine.activities.owner(axis);
  for (const activity::Activity* busy :
       {owner, static_cast<const activity::Activity*>(machine.activities.heir(axis))}) {
    if (busy != nullptr && busy->work() == activity::Activity::Work::kDisables) {
      axis.refuse("busy: it is being disabled");
    }
  }
  const motor::Power& power = axis.motor.power();
  const bool is_awake = power.wantsEnabled() && !axis.mustWake();
  if (is_awake && (owner == nullptr || !owner->isInBackground())) return false;
  if (!power.wantsEnabled()) machine.refuseUnlessFree(axis, "it is enabled");
  return true;
}

}  // namespace

std::string Enable::text(const AxisWords& words) const {
  return (on ? "enable " : "disable ") + words.names(axes);
}

void Enable::serve(RequestContext& machine, const SharedCall& call) const {
  std::vector<axis::AxisModel*> all;
  for (const AxisId id : axes) {
    for (axis::AxisModel* axis : machine.withSharers(id)) {
      if (std::find(all.begin(), all.end(), axis) == all.end()) all.push_back(axis);
    }
  }
  for (const axis::AxisModel* changed : all) {
    changed->refuseUnlessOpen();
    if (!changed->motor.pins().hasEnable()) {
      changed->refuse(
          "pins/enable isn't configured: the motor is energized as long as the chip is");
    }
  }
  if (!on) {
    for (axis::AxisModel* changed : all) {
      machine.disable(*changed, {axis::MoveEnd::kStopped, "it was disabled"}, call);
    }
    return;
  }
  std::vector<axis::AxisModel*> to_enable;
  for (axis::AxisModel* changed : all) {
    if (mustEnable(machine, *changed)) to_enable.push_back(changed);
  }
  for (axis::AxisModel* changed : to_enable) {
    ++changed->stops;
    machine.activities.begin(std::make_unique<activity::Enable>(machine.context, *changed, call),
                             kTakenOver);
  }
}

}  // namespace stepdriver::machine
