#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "point_to_point/planner.h"
#include "profile/errors.h"
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
    check.expectOvershoot(target, plan.overshoot);
    if (check.way() < 1000.0) {
      check.expectSteps(target);
      if (!plan.overshoots()) check.expectNoStepBeyond(target);
    }
    if (HasFailure()) return;
  }
}

// Near the distance at which stopping, or turning in time, becomes impossible.
TEST(PlannerProperties, HoldForTargetsAboutTheStoppingDistance) {
  Random random(7);
  int overshoots = 0;
  int turns = 0;
  int passes = 0;
  for (int i = 0; i < 20000; ++i) {
    MotionLimits limits = anyLimits(random);
    limits.start_speed = 0.0;
    const double d = limits.deceleration;
    MotionState from{DoubleDouble(0.0), limits.max_speed * random.within(0.0, 1.0),
                     -d * random.within(0.0, 1.0)};
    const double hardest = from.velocity * from.velocity / (2.0 * d);
    const double softest = planStop(0, from, limits).endPosition().value();
    from.position = -random.within(0.95 * hardest, std::max(hardest, softest));
    if (from.position.hi == 0.0) continue;
    SCOPED_TRACE(testing::Message() << i << ": " << from << " to 0, " << limits);
    const Plan plan = planMove(0, from, 0, limits);
    ProfileCheck check(plan.profile, from, limits);
    check.expectWithinLimits();
    check.expectRestOn(0);
    check.expectOvershoot(0, plan.overshoot);
    if (HasFailure()) return;
    overshoots += plan.overshoots() ? 1 : 0;
    const auto& pieces = plan.profile.pieces();
    const auto turned = [](const Piece& p) { return std::abs(p.p0.hi) < 1e-9; };
    turns += std::any_of(pieces.begin(), pieces.end(), turned) ? 1 : 0;
    if (plan.overshoots() || check.way() > 10'000.0) continue;
    check.expectNoStepBeyond(0);
    // A stop or another plan at any time while it passes the target makes no step beyond it either.
    for (const Piece& piece : pieces) {
      const double turn = piece.firstTurn(0.0);
      if (!(turn < piece.duration.hi && piece.positionAt(turn).hi > 1e-3)) continue;
      ++passes;
      for (const double part : {0.5, 0.9, 0.99, 1.0}) {
        const MotionState passing{piece.positionAt(part * turn),
                                  piece.velocityAt(part * turn).value(),
                                  piece.accelerationAt(part * turn).value()};
        if (!(passing.position.hi > 0.0)) continue;
        for (const Profile& next :
             {planStop(0, passing, limits, 0), planMove(0, passing, 0, limits).profile}) {
          StepFinder finder(next, 0);
          Step step;
          while (finder.next(step)) ASSERT_LE(finder.count(), 0) << part;
          EXPECT_EQ(finder.count(), 0);
        }
      }
    }
  }
  EXPECT_GT(overshoots, 1000);
  EXPECT_GT(turns, 300);
  EXPECT_GT(passes, 100);
}

// Limits and states of all orders of magnitude, independently of each other.
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
    } catch (const TooLong&) {
      const double jerks = 2.0 * (limits.acceleration + limits.deceleration) / limits.jerk;
      const double level = std::abs(v) + a * a / (2.0 * limits.jerk);
      const double speed = level + limits.max_speed;
      const double ramps = speed / limits.acceleration + 2.0 * speed / limits.deceleration + jerks;
      const double cruise = std::abs(static_cast<double>(target)) + 10.0 + speed * ramps;
      EXPECT_GT(ramps + cruise / limits.max_speed, Profile::kLongest) << "would not take so long";
    }
    if (HasFailure()) return;
  }
}

// Any command: a new target, another speed, a stop.
Profile anyCommand(Random& random, std::int64_t now, const MotionState& state,
                   const MotionLimits& limits) {
  const double which = random.within(0.0, 1.0);
  MotionLimits in_force = limits;
  Profile profile(now, state.position);
  if (which < 0.6) {
    profile = planMove(now, state, anyTarget(random, state, limits), limits).profile;
  } else if (which < 0.8) {
    const double velocity = limits.max_speed * random.within(-1.0, 1.0);
    profile = planVelocity(now, state, velocity, limits).profile;
    in_force.max_speed = std::abs(velocity);
  } else {
    profile = planStop(now, state, limits);
  }
  ProfileCheck check(profile, state, in_force);
  check.expectWithinLimits();
  if (profile.duration().hi < 1e9) check.expectRestOn(split(profile.endPosition()).whole);
  return profile;
}

TEST(PlannerProperties, APlanMayBeReplacedAtAnyMoment) {
  Random random(3);
  for (int i = 0; i < 400; ++i) {
    MotionLimits limits = anyLimits(random);
    MotionState state{DoubleDouble(random.within(-10, 10)), 0.0, 0.0};
    std::int64_t now = 0;
    for (int link = 0; link < 50; ++link) {
      SCOPED_TRACE(testing::Message() << i << ", " << link << ": " << state << ", " << limits);
      const Profile profile = anyCommand(random, now, state, limits);
      if (HasFailure()) return;
      const double ramps = 3.0 * limits.max_speed / limits.deceleration;
      const double seconds = std::min(profile.duration().value(), ramps) * random.within(0.0, 1.0);
      now += std::llround(seconds * 1e9);
      state = profile.stateAt(now);
      if (!random.chance(0.3)) continue;
      // Other limits of the same order of magnitude: an override, another acceleration.
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
    if (first.profile.pieces().empty()) continue;
    const std::int64_t then =
        std::llround(static_cast<double>(first.profile.endNs()) * random.within(0.0, 1.0));
    const MotionState state = first.profile.stateAt(then);
    SCOPED_TRACE(testing::Message() << i << ": " << from << " to " << target << ", " << limits
                                    << "; at " << then << " ns " << state);
    const Plan second = planMove(then, state, target, limits);
    const double end = static_cast<double>(first.profile.endNs());
    // On the way to a turn it may keep its speed, which isn't the same later. Near the start speed,
    // the last bit of the velocity has a larger effect.
    const bool turns = first.profile.pieces().back().v0 * from.velocity < 0.0;
    if (limits.start_speed > 0.0 && turns) continue;
    const double doubt = limits.start_speed > 0.0 ? 1e3 : 2.0 + 1e-9 * end;
    EXPECT_NEAR(static_cast<double>(second.profile.endNs()), end, doubt);
    for (const Piece& piece : second.profile.pieces()) {
      EXPECT_GT(piece.duration.hi, 1e-12 * first.profile.duration().hi) << "a sliver";
    }
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
