#include "profile/shaped_profile.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "point_to_point/planner.h"
#include "profile/profile_sum.h"
#include "profile/step_finder.h"
#include "sim/spring_mass.h"
#include "support/constants.h"

namespace stepdriver::motion {
namespace {

using test::kSecond;

const MotionLimits kTrapezoid{0.0, 20'000.0, 300'000.0, 300'000.0, 0.0};
const MotionLimits kSmooth{0.0, 20'000.0, 300'000.0, 200'000.0, 9e6};

std::shared_ptr<const Profile> shared(Profile profile) {
  return std::make_shared<const Profile>(std::move(profile));
}
std::shared_ptr<const InputShaper> shared(InputShaper shaper) {
  return std::make_shared<const InputShaper>(std::move(shaper));
}

/// The pieces as the engine computes them.
Profile piecesOf(const ShapedProfile& motion) {
  ProfileSum sum;
  sum.begin(motion.startNs());
  sum.add(1.0, motion);
  std::vector<Piece> pieces;
  while (sum.next()) pieces.push_back(sum.piece());
  return {motion.startNs(), std::move(pieces)};
}

std::vector<Step> stepsOf(const ShapedProfile& motion, std::int64_t count) {
  ProfileSum sum;
  sum.begin(motion.startNs());
  sum.add(1.0, motion);
  StepFinder finder(sum, count);
  std::vector<Step> steps;
  for (Step step; finder.next(step);) steps.push_back(step);
  return steps;
}

TEST(ShapedProfile, ATrapezoidHasAtMostTwentyPieces) {
  const auto plan = shared(planMove(0, {}, 8'000, kTrapezoid).profile);
  ASSERT_EQ(plan->pieceCount(), 3U);
  const auto pieces = [&](InputShaper shaper) {
    return piecesOf(PlannedMotion(plan, shared(std::move(shaper))).made()).pieceCount();
  };
  EXPECT_EQ(pieces(InputShaper::zv(42.0, 0.1)), 7U);
  EXPECT_EQ(pieces(InputShaper::mzv(42.0, 0.1)), 11U);
  EXPECT_EQ(pieces(InputShaper::ei(42.0, 0.1)), 11U);
  EXPECT_EQ(pieces(InputShaper::twoHumpEi(42.0, 0.1)), 15U);
}

TEST(ShapedProfile, IsTheSumOfItsPartsWithinAllLimits) {
  for (const MotionLimits& limits : {kTrapezoid, kSmooth}) {
    const auto plan = shared(planMove(3 * kSecond, {100.0, 0.0, 0.0}, 8'100, limits).profile);
    const auto shaper = shared(InputShaper::ei(42.0, 0.1).with(InputShaper::zv(61.0, 0.0)));
    const PlannedMotion motion(plan, shaper);
    const Profile pieces = piecesOf(motion.made());
    EXPECT_EQ(motion.made().endNs(), plan->endNs() + shaper->durationNs());
    EXPECT_EQ(pieces.endNs(), motion.made().endNs());
    for (std::int64_t t = plan->startNs(); t <= pieces.endNs(); t += 777'777) {
      DoubleDouble position;
      for (const Impulse& impulse : shaper->impulses()) {
        position = position + plan->stateAt(t - impulse.delay_ns).position * impulse.part;
      }
      const MotionState made = pieces.stateAt(t);
      EXPECT_NEAR((made.position - position).value(), 0.0, 1e-9);
      const MotionState told = motion.made().stateAt(t);
      EXPECT_NEAR((told.position - position).value(), 0.0, 1e-9);
      EXPECT_NEAR(told.velocity, made.velocity, 1e-6);
      EXPECT_LE(made.velocity, limits.max_speed * (1.0 + 1e-12));
      EXPECT_GE(made.velocity, -1e-9);
      EXPECT_LE(made.acceleration, limits.acceleration * (1.0 + 1e-12));
      EXPECT_GE(made.acceleration, -limits.deceleration * (1.0 + 1e-12));
    }
    for (const Piece& piece : pieces.pieces()) {
      EXPECT_LE(std::abs(piece.j), limits.jerk * (1.0 + 1e-12));
    }
    EXPECT_EQ(pieces.endPosition().value(), 8'100.0);
    const auto steps = stepsOf(motion.made(), 100);
    EXPECT_EQ(steps.size(), 8'000U);
    EXPECT_LE(steps.back().time_ns, motion.made().endNs());
  }
}

TEST(ShapedProfile, TheEndOfALongMoveIsExact) {
  const std::int64_t target = (std::int64_t{1} << 40) + 1;
  const auto plan = shared(planMove(0, {}, target, kSmooth).profile);
  const auto shaper = shared(InputShaper::twoHumpEi(42.0, 0.1));
  const PlannedMotion motion(plan, shaper);
  const std::int64_t from = motion.made().endNs() - kSecond / 10;
  const DoubleDouble place = motion.made().stateAt(from).position;
  ProfileSum sum;
  sum.begin(from);
  sum.add(1.0, motion.made());
  StepFinder finder(sum, split(place).whole);
  Step step;
  std::int64_t steps = 0;
  while (finder.next(step)) ++steps;
  EXPECT_GT(steps, 100);
  EXPECT_EQ(finder.count(), target);
  // The last step is where the curve crosses its half-step line.
  const MotionState then = motion.made().stateAt(step.time_ns);
  EXPECT_NEAR((then.position - fromInteger(target)).value(), -0.5, 1e-5);
}

// Takes over many times, each time after less than the shaper's duration.
TEST(ShapedProfile, ATakeoverContinuesWhereTheMotionIs) {
  std::mt19937 random(7);
  const auto shaper = shared(InputShaper::ei(31.0, 0.05));
  for (int run = 0; run < 200; ++run) {
    PlannedMotion motion(shared(planMove(0, {}, 4'000, kSmooth).profile), shaper);
    std::int64_t at = 0;
    for (int i = 0; i < 8; ++i) {
      at += 1'000'000 + static_cast<std::int64_t>(random() % 60'000'000);
      const auto target = static_cast<std::int64_t>(random() % 8'000);
      const MotionState from = motion.plan()->stateAt(at);
      const Profile stop = planStop(at, from, kTrapezoid);
      const PlannedMotion next = motion.takenOverBy(
          shared(random() % 3 == 0 ? stop : planMove(at, from, target, kSmooth).profile));
      const MotionState before = motion.made().stateAt(at);
      const MotionState after = next.made().stateAt(at);
      EXPECT_NEAR((after.position - before.position).value(), 0.0, 1e-8);
      EXPECT_NEAR(after.velocity, before.velocity, 1e-4);
      // What comes afterwards is the sum of the parts of everything that was planned.
      const std::int64_t later = at + shaper->durationNs() / 3;
      DoubleDouble sum;
      for (const Impulse& impulse : shaper->impulses()) {
        const std::int64_t t = later - impulse.delay_ns;
        const MotionState then =
            t < at ? motion.made().profile().stateAt(t) : next.plan()->stateAt(t);
        sum = sum + then.position * impulse.part;
      }
      EXPECT_NEAR((next.made().stateAt(later).position - sum).value(), 0.0, 1e-8);
      motion = next;
    }
    EXPECT_EQ(motion.made().endPosition().value(), motion.plan()->endPosition().value());
    const DoubleDouble rest = motion.made().stateAt(motion.made().endNs()).position;
    EXPECT_NEAR((rest - motion.plan()->endPosition()).value(), 0.0, 1e-12);
    // However often it is taken over, it keeps no more than the last parts.
    EXPECT_LT(motion.made().profile().pieceCount(), 200U);
  }
}

// An order that changes nothing, while the parts are still being made.
TEST(ShapedProfile, ATakeoverAfterTheEndOfThePlanEndsNoLater) {
  const auto shaper = shared(InputShaper::zv(10.0, 0.0));
  const PlannedMotion motion(shared(planMove(0, {}, 100, kTrapezoid).profile), shaper);
  const std::int64_t at = motion.plan()->endNs() + 20'000'000;
  const MotionState from = motion.plan()->stateAt(at);
  const PlannedMotion same = motion.takenOverBy(shared(Profile(at, from.position)));
  EXPECT_EQ(same.made().endNs(), motion.made().endNs());
  const std::int64_t later = at + 10'000'000;
  EXPECT_NEAR((same.made().stateAt(later).position - motion.made().stateAt(later).position).value(),
              0.0, 1e-9);
  // Nothing is left to be made.
  const std::int64_t after = motion.made().endNs() + 5;
  const PlannedMotion rest = same.takenOverBy(shared(Profile(after, from.position)));
  EXPECT_EQ(rest.made().endNs(), after);
  EXPECT_EQ(stepsOf(rest.made(), 100).size(), 0U);
}

TEST(ShapedProfile, WithoutAShaperItIsTheProfile) {
  const auto plan = shared(planMove(5, {}, 100, kTrapezoid).profile);
  const PlannedMotion motion(plan, nullptr);
  EXPECT_EQ(&motion.made().profile(), plan.get());
  EXPECT_EQ(motion.made().endNs(), plan->endNs());
  const auto next = shared(planMove(5, {}, 50, kTrapezoid).profile);
  EXPECT_EQ(&motion.takenOverBy(next).made().profile(), next.get());
  EXPECT_FALSE(ShapedProfile());
}

/// The amplitude of a mass on a spring after the end of a motion, from the times of its steps.
double ringingAfter(const ShapedProfile& motion, double frequency, double damping) {
  sim::SpringMass mass(frequency, damping, 0.0);
  double position = 0.0;
  for (const Step& step : stepsOf(motion, 0)) {
    position += step.direction;
    mass.moveTo(position, step.time_ns);
  }
  return mass.ringing(motion.endNs());
}

TEST(ShapedProfile, ASpringComesToRestWithTheMotion) {
  constexpr double kFrequency = 20.0;
  constexpr double kSpeed = 100'000.0;
  const MotionLimits trapezoid{0.0, kSpeed, 15e6, 15e6, 0.0};
  const MotionLimits smooth{0.0, kSpeed, 15e6, 15e6, 3e9};
  for (const double damping : {0.0, 0.05, 0.1}) {
    for (const MotionLimits& limits : {trapezoid, smooth}) {
      const auto ratio = [&](const InputShaper& shaper, double of) {
        // The deceleration adds to the ringing that the acceleration has left.
        const double frequency = of * kFrequency;
        const std::int64_t target = std::llround(kSpeed * 2.5 / frequency);
        const auto plan = [&](std::int64_t at) {
          return shared(planMove(at, {}, target, limits).profile);
        };
        const PlannedMotion shaped(plan(0), shared(shaper));
        // It ends at the same time: the spring has rung for as long.
        const auto unshaped = plan(shaper.durationNs());
        const double without = ringingAfter(unshaped.get(), frequency, damping);
        EXPECT_GT(without, 600.0);
        return ringingAfter(shaped.made(), frequency, damping) / without;
      };
      EXPECT_LE(ratio(InputShaper::zv(kFrequency, damping), 1.0), 0.01);
      EXPECT_LE(ratio(InputShaper::mzv(kFrequency, damping), 1.0), 0.01);
      for (const double of : {0.9, 0.95, 1.0, 1.05, 1.1}) {
        EXPECT_LE(ratio(InputShaper::ei(kFrequency, damping), of), 0.052) << of;
        EXPECT_LE(ratio(InputShaper::twoHumpEi(kFrequency, damping), of), 0.052) << of;
      }
      EXPECT_GT(ratio(InputShaper::zv(kFrequency, damping), 0.9), 0.1);
    }
  }
}

}  // namespace
}  // namespace stepdriver::motion
