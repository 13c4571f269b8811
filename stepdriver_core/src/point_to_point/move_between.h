#pragma once

#include <cstdint>

#include "planner.h"
#include "profile/composition.h"
#include "profile/resting_count.h"

namespace stepdriver::motion {

/// Plans a motion to a place between two counts of an axis, which one that shares motors may come
/// to rest at: counts as seen from there.
///
/// @param between [microsteps] the place minus a count.
/// @param plan_to_count makes the plan from a state to that count.
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
