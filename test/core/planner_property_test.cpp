#include <gtest/gtest.h>

#include <cmath>

#include "stepdriver_core/motion/planner.h"
#include "support/profile_check.h"
#include "support/random_motion.h"

namespace stepdriver::motion {
namespace {

TEST(PlannerProperties, EveryMoveFromAnyStateKeepsTheLimitsAndEndsOnItsTarget) {
  Random random(1);
  for (int i = 0; i < 30000; ++i) {
    const MotionLimits limits = anyLimits(random);
    const MotionState from = anyState(random, limits);
    const std::int64_t target = anyTarget(random, from, limits);
    SCOPED_TRACE(testing::Message() << i << ": " << from << " to " << target << ", " << limits);
    const Plan plan = planMove(1000, from, target, limits);
    ProfileCheck check(plan.profile, from, limits);
    check.expectWithinLimits();
    check.expectRestOn(target);
    if (check.way() < 1000.0) check.expectSteps(target);
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver::motion
