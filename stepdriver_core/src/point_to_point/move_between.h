#pragma once

#include <cstdint>

#include "planner.h"
#include "profile/composition.h"
#include "profile/resting_count.h"

namespace stepdriver::motion {

/// Plans a motion of an axis that shares motors to a place at which it may come to rest between two
/// of its own counts. Counts are then seen from that place.
///
/// @param between [microsteps] the place minus a count
/// @param plan_to_count plans the motion from a state to that count
template <typename PlanToCount>
Plan planBetween(double between, const MotionState& from, const PlanToCount& plan_to_count) {
  if (between == 0.0) return plan_to_count(from);
  MotionState seen = from;
  seen.position = seen.position - between;
  Plan plan = plan_to_count(seen);
  plan.profile = scaled(plan.profile, between, 1.0);
  return plan;
}

/// The fastest motion to rest at a place, see motion::planMove().
inline Plan planMoveToPlace(std::int64_t start_ns, const MotionState& from, double place,
                            const MotionLimits& limits) {
  const std::int64_t count = restingCount(place);
  return planBetween(place - static_cast<double>(count), from, [&](const MotionState& seen) {
    return planMove(start_ns, seen, count, limits);
  });
}

}  // namespace stepdriver::motion
