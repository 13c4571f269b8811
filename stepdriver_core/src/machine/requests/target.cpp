#include "target.h"

#include "profile/resting_count.h"

namespace stepdriver::machine {
namespace {

// [microsteps] The position of the joint from which a relative move counts.
double relativeOrigin(const RequestContext& machine, const axis::AxisModel& axis) {
  const activity::Activity* owner = machine.activities.owner(axis);
  const activity::MotionExecution* motion = owner != nullptr ? owner->motion() : nullptr;
  const motor::Motion* latest = axis.motor.motions().latest();
  if (motion == nullptr || latest == nullptr) {
    return axis.restCount() + axis.position.remainder() * axis.stepsPerUnit();
  }
  const activity::Goal* goal = motion->goalOf(axis);
  // A motion that slows down or takes up backlash ends at the end of its motor's motion.
  if (latest->slows_down || (goal != nullptr && goal->of_motor)) {
    return axis.jointAt(latest->planned.plan()->endPosition().value());
  }
  if (goal == nullptr || !goal->target) {
    axis.refuse("busy: it jogs without an end; give an absolute position");
  }
  return static_cast<double>(*goal->target) + goal->remainder;
}

void setCount(activity::Goal& goal, double count) {
  goal.target = motion::restingCount(count);
  goal.remainder = count - static_cast<double>(*goal.target);
}

}  // namespace

void setTarget(activity::Goal& goal, const RequestContext& machine, const axis::AxisModel& axis,
               double position, bool relative) {
  machine.refuseUnlessReadyToMove(axis);
  if (!relative) {
    axis.refuseUnlessHomed();
    return setPlace(goal, machine, axis, position);
  }
  axis.refuseUnlessFinite("position", position);
  const double count = relativeOrigin(machine, axis) + position * axis.stepsPerUnit();
  axis.refuseBeyondLimits(axis.positionOf(count), "the position");
  setCount(goal, count);
}

void setPlace(activity::Goal& goal, const RequestContext& machine, const axis::AxisModel& axis,
              double position) {
  machine.refuseUnlessReadyToMove(axis);
  axis.refuseUnlessFinite("position", position);
  axis.refuseBeyondLimits(position, "the position");
  setCount(goal, axis.countOf(position));
}

}  // namespace stepdriver::machine
