#include "point_to_point/planner.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <stdexcept>

#include "profile/errors.h"
#include "profile/step_finder.h"
#include "support/profile_check.h"

namespace stepdriver::motion {
namespace {

MotionState at(double position, double velocity = 0.0, double acceleration = 0.0) {
  return {DoubleDouble(position), velocity, acceleration};
}

double seconds(const Profile& profile) { return profile.duration().value(); }

void expectSound(const Profile& profile, const MotionState& from, const MotionLimits& limits,
                 std::int64_t target) {
  ProfileCheck check(profile, from, limits);
  check.expectWithinLimits();
  check.expectRestOn(target);
  check.expectSteps(target);
}

double highest(const Profile& profile) {
  double highest = profile.endPosition().value();
  for (const Piece& piece : profile.pieces()) {
    for (const double t : {0.0, piece.firstTurn(0.0)}) {
      highest = std::max(highest, piece.positionAt(t).value());
    }
  }
  return highest;
}

std::int64_t highestStep(const Profile& profile, std::int64_t count) {
  std::int64_t highest = count;
  StepFinder finder(profile, count);
  for (Step step; finder.next(step);) highest = std::max(highest, finder.count());
  return highest;
}

// ---- new targets during a motion ----

TEST(PlanMove, TargetExactlyAtTheStoppingDistanceIsReachedByStopping) {
  // 1000^2/(2 * 2000) = 250 without a jerk limit; with it 1000/2 * (1000/2000 + 2000/20000) = 300.
  const Plan plain = planMove(0, at(0, 1000), 250, {0, 1000, 2000, 2000, 0});
  EXPECT_EQ(plain.profile.pieces().size(), 1U);
  EXPECT_DOUBLE_EQ(seconds(plain.profile), 0.5);
  EXPECT_FALSE(plain.overshoots());
  const Plan smooth = planMove(0, at(0, 1000), 300, {0, 1000, 2000, 2000, 20000});
  EXPECT_EQ(smooth.profile.pieces().size(), 3U);
  EXPECT_DOUBLE_EQ(seconds(smooth.profile), 0.6);
  EXPECT_FALSE(smooth.overshoots());
}

TEST(PlanMove, TargetNearerThanTheStoppingDistanceIsPassedAndComeBackTo) {
  const MotionLimits limits{0, 1000, 2000, 2000, 0};
  const Plan plan = planMove(0, at(0, 1000), 200, limits);
  expectSound(plan.profile, at(0, 1000), limits, 200);
  EXPECT_DOUBLE_EQ(plan.overshoot, 50.0);
  // Stops after 0.5 s, 50 steps beyond; back over 50 steps with a triangle.
  EXPECT_DOUBLE_EQ(seconds(plan.profile), 0.5 + 2.0 * std::sqrt(50.0 / 2000.0));
}

TEST(PlanMove, TargetUnderAMovingAxisIsPassedAndComeBackTo) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 2000, 2000, jerk};
    const Plan plan = planMove(0, at(7, -1000), 7, limits);
    expectSound(plan.profile, at(7, -1000), limits, 7);
    EXPECT_GE(plan.overshoot, 250.0);
    EXPECT_LT(plan.overshoot, 300.0);
  }
}

TEST(PlanMove, TargetBehindIsTurnedToWithoutPassingIt) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 2000, 1000, jerk};
    const Plan plan = planMove(0, at(0, 800), -300, limits);
    expectSound(plan.profile, at(0, 800), limits, -300);
    EXPECT_FALSE(plan.overshoots());
  }
}

// At the bounds of a configuration, the ramp up takes 1e-15 s, and is no phase.
TEST(PlanMove, ReachesItsTargetWithARampThatTakesNoTime) {
  const MotionLimits limits{0, 1e-3, 1e12, 2e8, 0};
  for (const double velocity : {-575.0, -1e-3, 1e-3, 348.0}) {
    for (const std::int64_t target : {-1'000'000, -1, 0, 1, 1'000'000}) {
      const MotionState from = at(0.25, velocity);
      const Plan plan = planMove(0, from, target, limits);
      EXPECT_NEAR((plan.profile.endPosition() - fromInteger(target)).value(), 0.0, 1e-15)
          << velocity << " to " << target;
    }
  }
}

TEST(PlanMove, TurnsShortOfATargetThatItCouldOnlyRestBeyond) {
  // At the full deceleration of 2000 the speed is 0 after 250 microsteps, but the deceleration
  // isn't. To be at rest there, it must decrease earlier, and that takes 250.83.
  const MotionLimits limits{0, 1000, 2000, 2000, 20000};
  const MotionState braking = at(0, 1000, -2000);
  const Profile stop = planStop(0, braking, limits);
  EXPECT_DOUBLE_EQ(stop.endPosition().value(), 251.0);
  const Plan turned = planMove(0, braking, 250, limits);
  EXPECT_FALSE(turned.overshoots());
  EXPECT_NEAR(highest(turned.profile), 250.0, 1e-9);
  expectSound(turned.profile, braking, limits, 250);
  const Plan passed = planMove(0, braking, 249, limits);
  EXPECT_TRUE(passed.overshoots());
  expectSound(passed.profile, braking, limits, 249);
}

TEST(PlanMove, PassesATargetByLessThanHalfAMicrostepIfThatIsFaster) {
  // It could also turn on the target; that takes 0.752 s.
  const MotionLimits limits{0, 1000, 2000, 2000, 20000};
  const MotionState braking = at(0.8, 1000, -2000);
  const Plan plan = planMove(0, braking, 251, limits);
  expectSound(plan.profile, braking, limits, 251);
  EXPECT_LT(seconds(plan.profile), 0.6);
  EXPECT_NEAR(highest(plan.profile), 251.351, 0.001);
  EXPECT_FALSE(plan.overshoots());
  EXPECT_EQ(highestStep(plan.profile, 1), 251);
}

TEST(PlanMove, ALowerSpeedLimitIsComeDownToAtTheDeceleration) {
  const Plan plain = planMove(0, at(0, 1000), 2000, {0, 250, 2000, 2000, 0});
  EXPECT_DOUBLE_EQ(plain.profile.pieceStart(1).value(), 0.375);
  EXPECT_DOUBLE_EQ(plain.profile.pieces()[1].v0, 250.0);
  EXPECT_DOUBLE_EQ(plain.profile.pieces()[0].a, -2000.0);
  const Plan smooth = planMove(0, at(0, 1000), 2000, {0, 250, 2000, 2000, 20000});
  EXPECT_DOUBLE_EQ(smooth.profile.pieceStart(3).value(), 0.475);
  EXPECT_DOUBLE_EQ(smooth.profile.pieces()[3].v0, 250.0);
}

TEST(PlanMove, AnAccelerationBeyondItsLimitComesBackAtTheJerk) {
  const MotionLimits limits{0, 1000, 500, 500, 10000};
  const MotionState from = at(0, 100, 2000);
  const Plan plan = planMove(0, from, 4000, limits);
  expectSound(plan.profile, from, limits, 4000);
  EXPECT_DOUBLE_EQ(plan.profile.pieces()[0].j, -10000.0);
  EXPECT_DOUBLE_EQ(plan.profile.pieces()[0].duration.value(), 0.15);
  EXPECT_DOUBLE_EQ(plan.profile.pieces()[1].a, 500.0);
}

TEST(PlanMove, RestStaysRest) {
  const Plan plan = planMove(5, at(42), 42, {10, 1000, 2000, 2000, 20000});
  EXPECT_TRUE(plan.profile.pieces().empty());
  EXPECT_EQ(plan.profile.endNs(), 5);
  EXPECT_FALSE(plan.overshoots());
}

TEST(PlanMove, RefusesWhatTakesCenturies) {
  const MotionLimits limits{0, 0.001, 1, 1, 1};
  EXPECT_THROW(planMove(0, at(0), std::int64_t{1} << 40, limits), TooLong);
}

TEST(PlanMove, GoesOnFromTheStateItWasPlannedFrom) {
  const MotionLimits limits{0, 1000, 2000, 2000, 20000};
  const MotionState state = planMove(5, at(1, 300, 700), 4000, limits).profile.stateAt(5);
  EXPECT_EQ(state.position.value(), 1.0);
  EXPECT_EQ(state.velocity, 300.0);
  EXPECT_EQ(state.acceleration, 700.0);
}

TEST(PlanMove, HasItsPeakSpeedInsideAPieceWhereItNeverCruises) {
  const Profile profile = planMove(0, at(0), 10, {0, 1000, 2000, 2000, 20000}).profile;
  EXPECT_EQ(profile.pieces().size(), 3U);
  EXPECT_DOUBLE_EQ(profile.peakSpeed(), 2.0 * 10.0 / seconds(profile));
}

// ---- the start speed ----

TEST(StartSpeed, IsTakenAtOnceAndTheRampsBeginThere) {
  const MotionLimits limits{200, 1000, 2000, 2000, 20000};
  const Plan plan = planMove(0, at(0), 1000, limits);
  expectSound(plan.profile, at(0), limits, 1000);
  EXPECT_EQ(plan.profile.pieces().front().v0, 200.0);
  EXPECT_EQ(plan.profile.pieces().front().a, 0.0);
  // A ramp takes 800/2000 + 2000/20000 = 0.5 s and 600 * 0.5 = 300 microsteps.
  EXPECT_DOUBLE_EQ(seconds(plan.profile), 1.0 + (1000.0 - 600.0) / 1000.0);
}

TEST(StartSpeed, TurnsRoundAtRestOnAWholeMicrostep) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{100, 1000, 2000, 2000, jerk};
    const MotionState from = at(0.3, 700);
    const Plan plan = planMove(0, from, -50, limits);
    expectSound(plan.profile, from, limits, -50);
    StepFinder finder(plan.profile, 0);
    Step step;
    Step last;
    while (finder.next(step)) {
      if (last.direction > 0 && step.direction < 0) {
        // Half a microstep in each direction, starting at 100: v^2 = 100^2 + 2000.
        EXPECT_GE(step.time_ns - last.time_ns, 9'544'511);
      }
      last = step;
    }
  }
}

TEST(StartSpeed, AboveTheMaximumIsCutToIt) {
  const Plan plan = planMove(0, at(0), 100, {500, 100, 2000, 2000, 20000});
  EXPECT_EQ(plan.profile.pieces().size(), 1U);
  EXPECT_DOUBLE_EQ(seconds(plan.profile), 1.0);
}

TEST(StartSpeed, IsLeftAtOnceForALowerMaximum) {
  for (const double jerk : {0.0, 20000.0}) {
    for (const double v : {100.0, 300.0, 500.0}) {
      const Plan plan = planMove(0, at(0, v), 50, {500, 100, 2000, 2000, jerk});
      EXPECT_EQ(plan.overshoot, 0.0) << v;
      EXPECT_EQ(plan.profile.pieces().size(), 1U) << v;
      EXPECT_DOUBLE_EQ(seconds(plan.profile), 0.5) << v;
    }
  }
}

TEST(StartSpeed, IsWhereARampToALowerMaximumEnds) {
  // From 700 to 500 the ramp takes 0.1 s and 60 microsteps, and 0.2 s and 120 with its jerk.
  for (const double jerk : {0.0, 20000.0}) {
    const double ramp = jerk > 0.0 ? 0.2 : 0.1;
    const Plan plan = planMove(0, at(0, 700), 150, {500, 100, 2000, 2000, jerk});
    EXPECT_EQ(plan.overshoot, 0.0) << jerk;
    EXPECT_DOUBLE_EQ(seconds(plan.profile), ramp + (150.0 - 600.0 * ramp) / 100.0) << jerk;
    EXPECT_EQ(plan.profile.pieces().back().v0, 100.0) << jerk;
  }
}

// ---- stop ----

TEST(PlanStop, DeceleratesAtTheDecelerationToTheFirstWholeMicrostep) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 4000, 2000, jerk};
    const double way = jerk > 0.0 ? 300.0 : 250.0;
    const Profile stop = planStop(0, at(0.25, 1000), limits);
    expectSound(stop, at(0.25, 1000), limits, std::llround(way) + 1);
    EXPECT_DOUBLE_EQ(seconds(stop), (jerk > 0.0 ? 0.6 : 0.5) + 0.75 / 1000.0);
    EXPECT_LE(stop.peakSpeed(), 1000.0);
  }
}

TEST(PlanStop, DoesNotPassWhereTheMotionWouldHaveEnded) {
  for (const double jerk : {0.0, 1000.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 2000, 1500, jerk};
    const Profile move = planMove(0, at(0), 4000, limits).profile;
    for (std::int64_t time = 1; time < move.endNs(); time += 13'333'337) {
      SCOPED_TRACE(time);
      const MotionState state = move.stateAt(time);
      const Profile stop = planStop(time, state, limits, 4000);
      EXPECT_LE(stop.endPosition().value(), 4000.0);
      EXPECT_LE(stop.endNs(), move.endNs() + 1);
      expectSound(stop, state, limits, split(stop.endPosition()).whole);
    }
  }
}

TEST(PlanStop, OfAMotionThatPassesItsTargetWithoutAStepEndsOnTheTarget) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 2000, 2000, jerk};
    const std::int64_t target = jerk > 0.0 ? 300 : 250;
    const Profile move = planMove(0, at(0.3, 1000), target, limits).profile;
    int passing = 0;
    for (std::int64_t time = 1; time < move.endNs(); time += 100'003) {
      SCOPED_TRACE(time);
      const MotionState state = move.stateAt(time);
      if (state.position.hi < static_cast<double>(target)) continue;
      ++passing;
      const Profile stop = planStop(time, state, limits, target);
      EXPECT_EQ(highestStep(stop, target), target);
      expectSound(stop, state, limits, target);
    }
    EXPECT_GT(passing, 100);
  }
}

TEST(PlanStop, ComesBackToWhatALowerDecelerationMakesItPass) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 2000, 1000, jerk};
    for (const double sign : {1.0, -1.0}) {
      const MotionState from = at(0.0, sign * 1000.0);
      const std::int64_t target = sign > 0.0 ? 400 : -400;
      expectSound(planStop(0, from, limits, target), from, limits, target);
    }
  }
}

// After a jog that decelerates hard, a move with a lower jerk begins to turn, and is stopped.
TEST(PlanStop, DoesNotGoToATargetFromWhichTheMotionIsTurningAway) {
  const MotionLimits limits{0, 1000, 2000, 2000, 20000};
  for (const double sign : {1.0, -1.0}) {
    const MotionState from = at(0.0, sign * 50.0, sign * -2000.0);
    const Profile stop = planStop(0, from, limits, sign > 0.0 ? 4000 : -4000);
    EXPECT_LT(seconds(stop), 0.3);
    expectSound(stop, from, limits, split(planStop(0, from, limits).endPosition()).whole);
  }
}

TEST(PlanStop, EndsACrawlSoon) {
  const MotionLimits limits{0, 1000, 2000, 2000, 20000};
  EXPECT_LT(seconds(planStop(0, at(0.1, 0.01), limits)), 0.15);
}

// ---- jog ----

TEST(PlanVelocity, ChangesTheSpeedAndHoldsIt) {
  const Plan plain = planVelocity(0, at(0, 1000), 250, {0, 1000, 2000, 2000, 0});
  EXPECT_DOUBLE_EQ(plain.profile.pieceStart(1).value(), 0.375);
  const MotionState later = plain.profile.stateAt(1'000'000'000'000);
  EXPECT_EQ(later.velocity, 250.0);
  EXPECT_DOUBLE_EQ(later.position.value(), 0.375 * 625.0 + (1000.0 - 0.375) * 250.0);
  StepFinder finder(plain.profile, 0);
  Step step;
  for (int i = 0; i < 1000; ++i) ASSERT_TRUE(finder.next(step));
}

TEST(PlanVelocity, StandsExactlyWhereItMust) {
  for (const double jerk : {0.0, 20000.0}) {
    const MotionLimits limits{0, 1000, 2000, 2000, jerk};
    const Plan plan = planVelocity(0, at(0.4), -600, limits, -2000);
    expectSound(plan.profile, at(0.4), limits, -2000);
    EXPECT_FALSE(plan.overshoots());
    EXPECT_DOUBLE_EQ(plan.profile.peakSpeed(), 600.0);
    const double ramps = 600.0 / 2000.0 + (jerk > 0.0 ? 0.1 : 0.0);
    EXPECT_DOUBLE_EQ(seconds(plan.profile), 2000.4 / 600.0 + ramps);
  }
}

TEST(PlanVelocity, SaysWhenItCannotStandInTime) {
  const MotionLimits limits{0, 1000, 2000, 2000, 0};
  const Plan plan = planVelocity(0, at(0, 1000), 1000, limits, 100);
  EXPECT_DOUBLE_EQ(plan.overshoot, 150.0);
  expectSound(plan.profile, at(0, 1000), limits, 100);
}

TEST(PlanVelocity, NeverExceedsTheMaximum) {
  const Plan plan = planVelocity(0, at(0), 5000, {0, 1000, 2000, 2000, 20000});
  EXPECT_DOUBLE_EQ(plan.profile.peakSpeed(), 1000.0);
}

TEST(PlanVelocity, OfZeroStops) {
  const MotionLimits limits{0, 1000, 2000, 2000, 20000};
  const Plan plan = planVelocity(0, at(0, 1000), 0.0, limits, 5000);
  EXPECT_DOUBLE_EQ(plan.profile.endPosition().value(), 300.0);
}

}  // namespace
}  // namespace stepdriver::motion
