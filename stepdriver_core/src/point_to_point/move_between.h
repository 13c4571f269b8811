#pragma once

#include <cstdint>

#include "planner.h"
#include "profile/composition.h"
#include "profile/resting_count.h"

namespace stepdriver::axis {

/// Plans a motion to a place between two counts of an axis, which one that shares motors may come
/// to rest at: counts as seen from there.
///
/// @param between [microsteps] the place minus a count.
/// @param plan_to_count makes the plan from a state to that count.
template <typename PlanToCount>
motion::Plan planBetween(double between, const motion::MotionState& from,
                         const PlanToCount& plan_to_count) {
  if (between == 0.0) return plan_to_count(from);
  motion::MotionState seen = from;
  seen.position = seen.position - between;
  motion::Plan plan = plan_to_count(seen);
  plan.profile = motion::scaled(plan.profile, between, 1.0);
  return plan;
}

/// The fastest motion to rest at a place, see motion::planMove().
inline motion::Plan planMove(std::int64_t start_ns, const motion::MotionState& from, double place,
                             const motion::MotionLimits& limits) {
  const std::int64_t count = motion::restingCount(place);
  return planBetween(place - static_cast<double>(count), from,
                     [&](const motion::MotionState& seen) {
                       return motion::planMove(start_ns, seen, count, limits);
                     });
}

}  // namespace stepdriver::axis
