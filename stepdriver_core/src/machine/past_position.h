#pragma once

#include "activity/context.h"
#include "axis/axis_model.h"

namespace stepdriver::machine {

/// [unit] Where the joint of an axis was at a clock time of the last seconds, by its plans.
/// @pre Motor::watchMotions()
inline double positionAt(const activity::Context& context, const axis::AxisModel& axis,
                         pulse::Nanoseconds clock_time) {
  return axis.positionOf(axis.jointAtTime(context.motionTimeAt(clock_time)));
}

}  // namespace stepdriver::machine
