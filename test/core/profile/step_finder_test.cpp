#include "profile/step_finder.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <vector>

#include "support/plan_from_rest.h"

namespace stepdriver::motion {
namespace {

std::vector<Step> allSteps(const Profile& profile, std::int64_t count) {
  StepFinder finder(profile, count);
  std::vector<Step> steps;
  Step step;
  while (finder.next(step)) steps.push_back(step);
  return steps;
}

Profile onePiece(double duration, double p0, double v0, double a, double j) {
  return {0, {Piece{duration, p0, v0, a, j}}};
}

TEST(StepFinder, FindsEachHalfStepLineOfACruise) {
  const auto steps = allSteps(onePiece(1.0, 0.0, 10.0, 0.0, 0.0), 0);
  ASSERT_EQ(steps.size(), 10U);
  for (std::size_t k = 0; k < steps.size(); ++k) {
    EXPECT_EQ(steps[k].time_ns, 50'000'000 + static_cast<std::int64_t>(k) * 100'000'000);
    EXPECT_EQ(steps[k].direction, 1);
  }
}

TEST(StepFinder, CountsBackwardsAcrossZero) {
  const auto steps = allSteps(onePiece(1.0, 2.0, -5.0, 0.0, 0.0), 2);
  ASSERT_EQ(steps.size(), 5U);
  EXPECT_EQ(steps.front().time_ns, 100'000'000);
  EXPECT_EQ(steps.back().time_ns, 900'000'000);
  for (const Step& step : steps) EXPECT_EQ(step.direction, -1);
}

TEST(StepFinder, TurnsRoundInsideAPiece) {
  // Up to 12.5 - 0.1 and back: the line at 12.5 is not reached.
  const double v = std::sqrt(2.0 * 12.4);
  const auto steps = allSteps(onePiece(2.0 * v, 0.0, v, -1.0, 0.0), 0);
  ASSERT_EQ(steps.size(), 24U);
  for (std::size_t k = 0; k < 12; ++k) {
    EXPECT_EQ(steps[k].direction, 1);
    EXPECT_EQ(steps[23 - k].direction, -1);
    // The ways up and down are mirror images about the turning point.
    EXPECT_NEAR(static_cast<double>(steps[k].time_ns + steps[23 - k].time_ns), 2.0 * v * 1e9, 2.0);
  }
}

TEST(StepFinder, MakesNoStepWhereTheCurveOnlyTouchesALine) {
  // v = 1, a = -1: the turning point is at 0.5 exactly.
  EXPECT_TRUE(allSteps(onePiece(2.0, 0.0, 1.0, -1.0, 0.0), 0).empty());
}

TEST(StepFinder, LosesNoStepThatLiesOnTheBorderOfTwoPieces) {
  const Profile profile(0, {Piece{0.5, 0.0, 1.0, 0.0, 0.0}, Piece{0.5, 0.5, 1.0, 0.0, 0.0}});
  const auto steps = allSteps(profile, 0);
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_EQ(steps[0].time_ns, 500'000'000);
}

TEST(StepFinder, StartsWithTheStepThatACountBehindTheCurveOwes) {
  const auto steps = allSteps(onePiece(1.0, 0.75, 1.0, 0.0, 0.0), 0);
  ASSERT_EQ(steps.size(), 2U);
  EXPECT_EQ(steps[0].time_ns, 0);
  EXPECT_EQ(steps[1].time_ns, 750'000'000);
}

TEST(StepFinder, FollowsRandomCubicsLikeBisectionDoes) {
  std::mt19937_64 random(20240517);
  std::uniform_real_distribution<double> spread(-1.0, 1.0);
  for (int round = 0; round < 2000; ++round) {
    const double duration = 0.05 + std::abs(spread(random));
    const Piece piece{duration, 0.49 * spread(random), 2000.0 * spread(random),
                      8000.0 * spread(random), 60000.0 * spread(random)};
    const auto at = [&piece](long double t) {
      return static_cast<long double>(piece.p0.hi) +
             t * (piece.v0 + t * (piece.a / 2.0L + t * piece.j / 6.0L));
    };
    const Profile profile(0, {piece});
    StepFinder finder(profile, 0);
    Step step;
    std::int64_t count = 0;
    std::int64_t last = 0;
    while (finder.next(step)) {
      ASSERT_GE(step.time_ns, last) << "round " << round;
      last = step.time_ns;
      // The crossing lies within 1 ns of the step: 1 ns before and after it, the curve is on
      // different sides of the line.
      const long double line = count + 0.5L * step.direction;
      const long double t = step.time_ns * 1e-9L;
      const long double before = at(std::max(0.0L, t - 1e-9L)) - line;
      const long double after = at(std::min<long double>(duration, t + 1e-9L)) - line;
      const bool crossed = before * step.direction <= 1e-9L && after * step.direction >= -1e-9L;
      ASSERT_TRUE(crossed) << "round " << round << " line " << static_cast<double>(line) << " at "
                           << step.time_ns << " ns: " << static_cast<double>(before) << ", "
                           << static_cast<double>(after);
      count += step.direction;
    }
    EXPECT_LE(std::abs(static_cast<double>(at(duration)) - static_cast<double>(count)), 0.5 + 1e-6)
        << "round " << round;
  }
}

// Each line that is looked for is found as if all steps before it had been found.
TEST(StepFinder, LeavesOutStepsWithoutMissingOrMovingTheNextOne) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> spread(-1.0, 1.0);
  for (int round = 0; round < 500; ++round) {
    std::vector<Piece> pieces;
    DoubleDouble position(0.0);
    double velocity = 0.0;
    for (int i = 0; i < 4; ++i) {
      const bool cruises = spread(random) > 0.5;
      const Piece piece{0.01 + 0.2 * std::abs(spread(random)), position, velocity,
                        cruises ? 0.0 : 8000.0 * spread(random),
                        cruises || round % 2 == 0 ? 0.0 : 60000.0 * spread(random)};
      pieces.push_back(piece);
      position = piece.positionAt(piece.duration);
      velocity = piece.velocityAt(piece.duration).value();
    }
    const Profile profile(0, pieces);
    const std::vector<Step> all = allSteps(profile, 0);
    StepFinder finder(profile, 0);
    const std::int64_t distance = 1 + round % 40;
    std::int64_t low = -distance;
    std::int64_t high = distance;
    std::int64_t count = 0;
    for (const Step& step : all) {
      count += step.direction;
      if (count != low && count != high) continue;
      Step found;
      ASSERT_TRUE(finder.nextTo(low, high, found)) << "round " << round;
      ASSERT_LE(std::abs(found.time_ns - step.time_ns), 1) << "round " << round;
      ASSERT_EQ(found.direction, step.direction);
      ASSERT_EQ(finder.count(), count);
      low = count - distance;
      high = count + distance;
    }
    Step none;
    ASSERT_FALSE(finder.nextTo(low, high, none)) << "round " << round;
  }
}

// A sum of parts leaves an acceleration or a jerk of either sign that should be 0.
TEST(StepFinder, KeepsAConstantSpeedWhateverResidualItsAccelerationIs) {
  for (const double residual : {-1e-9, -1e-13, -1e-30, 1e-30, 1e-13}) {
    for (const Profile& profile :
         {onePiece(1.0, 0.0, 4000.0, residual, 0.0), onePiece(1.0, 0.0, 4000.0, 0.0, residual),
          onePiece(1.0, 0.0, 4000.0, residual, -residual)}) {
      const auto steps = allSteps(profile, 0);
      ASSERT_EQ(steps.size(), 4000U);
      for (std::size_t k = 0; k < steps.size(); ++k) {
        ASSERT_EQ(steps[k].time_ns, 125'000 + static_cast<std::int64_t>(k) * 250'000)
            << "residual " << residual << ", step " << k;
      }
    }
  }
}

// All speeds are residuals: nothing moves, and the owed step waits for what does.
TEST(StepFinder, DoesNotFollowAResidualSpeed) {
  const Profile profile(0, {Piece{1.0, 0.5, 1e-300, -1e-290, 0.0}, Piece{1.0, 0.5, 0.0, 2.0, 0.0}});
  const auto steps = allSteps(profile, 0);
  ASSERT_EQ(steps.size(), 1U);
  EXPECT_GE(steps[0].time_ns, 0);
  EXPECT_LE(steps[0].time_ns, 1'000'000'001);
}

// A ramp of 10^8 steps in 10^4 s that ends or begins up to 10 us past its turn.
TEST(StepFinder, IsExactIfALongRampEndsJustPastItsTurn) {
  const double ramp = 1e4;  // s
  for (const double past : {0.0, 1e-12, 1e-9, 1e-7, 1e-6, 9e-6}) {
    // p = -(T - t)^2 + T^2, and its mirror image.
    for (const bool ends : {true, false}) {
      const double length = ramp + past;
      const double t0 = ends ? 0.0 : -past;
      const double v0 = 2.0 * (ends ? ramp : t0);
      const double a = ends ? -2.0 : 2.0;
      const double p0 = ends ? 0.0 : t0 * t0;
      const Profile profile = onePiece(length, p0, v0, a, 0.0);
      const std::int64_t first = ends ? 99'999'900 : 0;
      StepFinder finder(profile, first);
      Step step;
      for (std::int64_t k = first; k < first + 100; ++k) {
        ASSERT_TRUE(finder.next(step));
        if (ends && k < first + 2) continue;  // owed at once: the finder was not there before
        const long double line = static_cast<long double>(k) + 0.5L;
        const long double exact = ends ? ramp - std::sqrt(1e8L - line) : past + std::sqrt(line);
        ASSERT_LE(std::abs(step.time_ns - exact * 1e9L), 0.6L)
            << "step " << k << ", " << past << " s past the turn";
      }
    }
  }
}

// Seen from its slow end, the first line lies 8 years away: in doubles that is 30 ns exact.
TEST(StepFinder, IsExactAtTheFastEndOfARampOfYears) {
  const double v = 4.5e6;
  const Profile profile = onePiece(2.5e8, 0.5 - 25e-9 * v, v, -0.0176, 0.0);
  StepFinder finder(profile, 0);
  Step step;
  for (int k = 0; k < 100; ++k) {
    ASSERT_TRUE(finder.next(step));
    EXPECT_NEAR(static_cast<double>(step.time_ns), 25.0 + k * 1e9 / v, 1.0) << "step " << k;
  }
}

TEST(StepFinder, StaysExactOverYears) {
  // 0.001 steps/s for 2^20 steps: 33 years. The period is 1000 s to the last bit of 0.001.
  const Profile profile = planFromRest(0, 0, 1 << 20, {0.001, 0.001, 1.0, 1.0});
  StepFinder finder(profile, 0);
  Step step;
  for (std::int64_t k = 0; k < (1 << 20); ++k) {
    ASSERT_TRUE(finder.next(step));
    const long double exact = (static_cast<long double>(k) + 0.5L) / 0.001 * 1e9L;
    ASSERT_LE(std::abs(static_cast<long double>(step.time_ns) - exact), 1.0L) << "step " << k;
  }
  EXPECT_FALSE(finder.next(step));
}

// Times of years to fractions of a nanosecond: in integers, because a long double may be only a
// double.
struct LongTime {
  std::int64_t whole_ns;
  double rest_ns;

  double behind(std::int64_t time_ns) const {
    return static_cast<double>(time_ns - whole_ns) - rest_ns;
  }
};

TEST(StepFinder, IsExactAtBothEndsOf2To40Steps) {
  const std::int64_t steps = std::int64_t{1} << 40;
  const double speed = 19999.75;  // 79999/4
  const double acceleration = 12345.6;
  const Profile profile = planFromRest(0, 0, steps, {0.0, speed, acceleration, acceleration});
  const double ramp = speed / acceleration;
  const double way = speed * ramp / 2.0;
  // The time for so many half steps at full speed, after or before some seconds.
  const auto cruise = [](std::int64_t half_steps, double seconds) {
    const std::int64_t ns = 2'000'000'000;
    const std::int64_t rest = half_steps % 79'999 * ns;
    return LongTime{half_steps / 79'999 * ns + rest / 79'999,
                    static_cast<double>(rest % 79'999) / 79'999.0 + seconds * 1e9};
  };
  EXPECT_LE(std::abs(cruise(2 * steps, ramp).behind(profile.endNs())), 1.0);

  StepFinder finder(profile, 0);
  Step step;
  for (int k = 0; k < 30000; ++k) {
    ASSERT_TRUE(finder.next(step));
    const LongTime exact = k < way ? LongTime{0, std::sqrt((2.0 * k + 1.0) / acceleration) * 1e9}
                                   : cruise(2 * k + 1, ramp / 2.0);
    ASSERT_LE(std::abs(exact.behind(step.time_ns)), 1.0) << "step " << k;
  }
  // The same motion, entered 30,000 steps before its end.
  const std::int64_t late = steps - 30000;
  StepFinder tail(profile, late);
  for (std::int64_t k = late; k < steps; ++k) {
    ASSERT_TRUE(tail.next(step)) << k;
    if (k - late < 2) continue;  // the finder owes these at once: it was not there when they came
    const std::int64_t half_steps_left = 2 * (steps - k) - 1;
    const auto left = static_cast<double>(half_steps_left);
    const LongTime exact = left / 2.0 <= way
                               ? cruise(2 * steps, ramp - std::sqrt(left / acceleration))
                               : cruise(2 * k + 1, ramp / 2.0);
    ASSERT_LE(std::abs(exact.behind(step.time_ns)), 1.0) << "step " << k;
  }
  EXPECT_FALSE(tail.next(step));
}

TEST(StepFinder, IsExactAtTheEndOfALongSlowdown) {
  // From 20,000 steps/s at 1 step/s^2: in doubles, v^2 - 2 d s would lose all its digits.
  const std::int64_t steps = 400'000'000;
  const Profile profile = planFromRest(0, 0, steps, {0.0, 20000.0, 1e6, 1.0});
  const long double ramps = 20000.0L / 1e6L + 20000.0L;
  const long double ways = 2e8L + 200.0L;
  const long double total = ramps + (steps - ways) / 20000.0L;
  StepFinder tail(profile, steps - 2000);
  Step step;
  for (std::int64_t left = 2000; left > 0; --left) {
    ASSERT_TRUE(tail.next(step));
    if (left > 1990) continue;
    const long double exact = total - std::sqrt(2.0L * (left - 0.5L));
    ASSERT_LE(std::abs(step.time_ns - exact * 1e9L), 1.0L) << left << " steps before the end";
  }
}

TEST(StepFinder, IsExactInLongRampsFromSlowSpeeds) {
  // Hours from rest to full speed: just below and above the switch to another form of the root.
  for (const double speed : {19'000.0, 21'000.0}) {
    const auto exact = [](long double line) { return std::sqrt(25.0L + 2.0L * line) - 5.0L; };
    const Profile profile = onePiece(speed, 0.0, 5.0, 1.0, 0.0);
    Step step;
    for (const std::int64_t from : {0, 170'000'000}) {
      StepFinder finder(profile, from);
      for (std::int64_t k = from; k < from + 20'000; ++k) {
        ASSERT_TRUE(finder.next(step));
        ASSERT_LE(std::abs(step.time_ns - exact(k + 0.5L) * 1e9L), 0.6L) << "step " << k;
        ASSERT_EQ(finder.count(), k + 1);
      }
    }
  }
}

}  // namespace
}  // namespace stepdriver::motion
