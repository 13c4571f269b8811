#include <gtest/gtest.h>

#include <cmath>
#include <stdexcept>

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

// Limits and states of all orders of magnitude, each on its own.
TEST(PlannerProperties, HoldForLimitsThatHaveNothingToDoWithEachOther) {
  Random random(2);
  for (int i = 0; i < 20000; ++i) {
    MotionLimits limits{0.0, random.decades(-3, 6), random.decades(-3, 9), 0.0,
                        random.decades(-3, 12)};
    limits.deceleration = limits.acceleration * random.decades(-3, 3);
    const double v = random.chance(0.3) ? 0.0 : limits.max_speed * random.within(-1.0, 1.0);
    const double least = std::min(limits.acceleration, limits.deceleration);
    const double a = random.chance(0.3) ? 0.0 : least * random.within(-1.0, 1.0);
    const MotionState from{DoubleDouble(random.within(-10, 10)), v, a};
    const std::int64_t target = std::llround(random.within(-1, 1) * random.decades(0, 12));
    SCOPED_TRACE(testing::Message() << i << ": " << from << " to " << target << ", " << limits);
    try {
      const Plan plan = planMove(0, from, target, limits);
      ProfileCheck check(plan.profile, from, limits);
      check.expectWithinLimits();
      check.expectRestOn(target);
      if (check.way() < 100.0) check.expectSteps(target);
    } catch (const std::range_error&) {
      const double slowest = std::max(1.0, std::abs(v)) / limits.deceleration;
      EXPECT_GT(slowest + 2.0 * std::abs(static_cast<double>(target)) / limits.max_speed, 0.0);
    }
    if (HasFailure()) return;
  }
}

TEST(PlannerProperties, APlanMayBeReplacedAtAnyMoment) {
  Random random(3);
  for (int i = 0; i < 400; ++i) {
    MotionLimits limits = anyLimits(random);
    limits.start_speed = 0.0;
    MotionState state{DoubleDouble(random.within(-10, 10)), 0.0, 0.0};
    std::int64_t now = 0;
    for (int link = 0; link < 50; ++link) {
      SCOPED_TRACE(testing::Message() << i << ", " << link << ": " << state << ", " << limits);
      const std::int64_t target = anyTarget(random, state, limits);
      const Plan plan = planMove(now, state, target, limits);
      ProfileCheck check(plan.profile, state, limits);
      check.expectWithinLimits();
      check.expectRestOn(target);
      if (HasFailure()) return;
      const std::int64_t duration = plan.profile.endNs() - now;
      now += std::llround(static_cast<double>(duration) * random.within(0.0, 1.0));
      state = plan.profile.stateAt(now);
      if (!random.chance(0.3)) continue;
      // Some other limits, of the same order of magnitude: an override, another acceleration.
      limits.max_speed *= random.within(0.5, 2.0);
      limits.acceleration *= random.within(0.5, 2.0);
      limits.deceleration *= random.within(0.5, 2.0);
      limits.jerk *= random.within(0.5, 2.0);
    }
  }
}

TEST(PlannerProperties, ReplanningForTheSameTargetChangesNothing) {
  Random random(4);
  for (int i = 0; i < 20000; ++i) {
    const MotionLimits limits = anyLimits(random);
    const MotionState from = anyState(random, limits);
    const std::int64_t target = anyTarget(random, from, limits);
    const Plan first = planMove(0, from, target, limits);
    const std::int64_t then =
        std::llround(static_cast<double>(first.profile.endNs()) * random.within(0.0, 1.0));
    const MotionState state = first.profile.stateAt(then);
    SCOPED_TRACE(testing::Message() << i << ": " << from << " to " << target << ", " << limits
                                    << "; at " << then << " ns " << state);
    const Plan second = planMove(then, state, target, limits);
    const double end = static_cast<double>(first.profile.endNs());
    // Near the start speed the last bit of the velocity weighs more.
    const double doubt = limits.start_speed > 0.0 ? 1e3 : 2.0 + 1e-9 * end;
    EXPECT_NEAR(static_cast<double>(second.profile.endNs()), end, doubt);
    if (HasFailure()) return;
  }
}

TEST(PlannerProperties, AStopRestsOnTheFirstWholeMicrostep) {
  Random random(5);
  for (int i = 0; i < 20000; ++i) {
    const MotionLimits limits = anyLimits(random);
    const MotionState from = anyState(random, limits);
    SCOPED_TRACE(testing::Message() << i << ": " << from << ", " << limits);
    const Profile stop = planStop(0, from, limits);
    ProfileCheck check(stop, from, limits);
    check.expectWithinLimits();
    EXPECT_LE(stop.peakSpeed(), check.fastestStop() * (1.0 + 1e-14)) << "speeds up";
    const std::int64_t rest = split(stop.endPosition()).whole;
    check.expectRestOn(rest);
    if (check.way() < 1000.0) check.expectSteps(rest);
    if (from.acceleration == 0.0 && limits.jerk > 0.0 && limits.start_speed == 0.0) {
      const double v = std::abs(from.velocity);
      const double d = limits.deceleration;
      const bool reaches = v * limits.jerk > d * d;
      const double time = reaches ? v / d + d / limits.jerk : 2.0 * std::sqrt(v / limits.jerk);
      const double way = std::abs((stop.endPosition() - from.position).hi);
      EXPECT_LE(way, (v / 2.0 * time) * (1.0 + 1e-14) + 1.0);
      EXPECT_GE(way, (v / 2.0 * time) * (1.0 - 1e-14) - 1e-8);
    }
    if (HasFailure()) return;
  }
}

TEST(PlannerProperties, AnyVelocityIsReachedAndHeld) {
  Random random(6);
  for (int i = 0; i < 20000; ++i) {
    const MotionLimits limits = anyLimits(random);
    const MotionState from = anyState(random, limits);
    const double velocity = limits.max_speed * random.within(-1.0, 1.0);
    SCOPED_TRACE(testing::Message() << i << ": " << from << " to " << velocity << ", " << limits);
    const Profile profile = planVelocity(0, from, velocity, limits).profile;
    MotionLimits bounded = limits;
    bounded.max_speed = std::abs(velocity);
    ProfileCheck check(profile, from, bounded);
    check.expectWithinLimits();
    const Piece& last = profile.pieces().back();
    EXPECT_EQ(last.v0, velocity);
    EXPECT_EQ(last.a, 0.0);
    EXPECT_EQ(last.j, 0.0);
    EXPECT_GT(last.duration.hi, 1e9);
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver::motion
