#pragma once

#include "activity/goal.h"
#include "request_context.h"

namespace stepdriver::machine {

/// The target of a goal, and the remainder. A relative one counts from where the joint comes to
/// rest. @throw Refused
void setTarget(activity::Goal& goal, const RequestContext& machine, const axis::AxisModel& axis,
               double position, bool relative);
/// The same of a place, also of an axis that must be homed before it moves to one. @throw Refused
void setPlace(activity::Goal& goal, const RequestContext& machine, const axis::AxisModel& axis,
              double position);

}  // namespace stepdriver::machine
