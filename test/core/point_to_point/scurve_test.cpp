#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "point_to_point/planner.h"
#include "profile/errors.h"
#include "profile/step_finder.h"
#include "support/profile_check.h"
#include "support/random_motion.h"

namespace stepdriver::motion {
namespace {

// The double S of the textbooks (Biagiotti and Melchiorri, Trajectory Planning for Automatic
// Machines and Robots) in long double, from rest to rest with a start speed. Its peak and its times
// are found by bisection, its position by adding up its seven phases.
class DoubleS {
 public:
  DoubleS(long double length, const MotionLimits& limits)
      : jerk_(limits.jerk), start_(std::min(limits.start_speed, limits.max_speed)) {
    long double rise = limits.max_speed - start_;
    if (ways(rise, limits) > length) {
      long double high = rise;
      rise = 0.0L;
      for (int i = 0; i < 200; ++i) {
        const long double middle = (rise + high) / 2.0L;
        (ways(middle, limits) > length ? high : rise) = middle;
      }
    }
    build(rise, limits, std::max(0.0L, length - ways(rise, limits)) / (start_ + rise));
  }

  long double total() const { return total_; }

  long double positionAt(long double t) const {
    long double p = 0.0L;
    long double v = start_;
    long double a = 0.0L;
    for (const Part& part : parts_) {
      const long double dt = std::min(t, part.duration);
      p += dt * (v + dt * (a / 2.0L + dt * part.jerk / 6.0L));
      v += dt * (a + dt * part.jerk / 2.0L);
      a += dt * part.jerk;
      t -= dt;
    }
    return p;
  }

  /// The time at which the position is `line`, between two times around it.
  long double timeOf(long double line, long double low, long double high) const {
    for (int i = 0; i < 70; ++i) {
      const long double middle = (low + high) / 2.0L;
      (positionAt(middle) < line ? low : high) = middle;
    }
    return high;
  }

 private:
  struct Part {
    long double jerk;
    long double duration;
  };

  // Time of a ramp that raises the speed by v: v/a + a/j if it reaches the acceleration a,
  // otherwise twice sqrt(v/j).
  long double rampTime(long double v, long double a) const {
    return v * jerk_ >= a * a ? v / a + a / jerk_ : 2.0L * std::sqrt(v / jerk_);
  }
  long double ways(long double rise, const MotionLimits& limits) const {
    return (start_ + rise / 2.0L) *
           (rampTime(rise, limits.acceleration) + rampTime(rise, limits.deceleration));
  }
  void addRamp(long double v, long double a, long double sign) {
    const long double bend = std::min(a / jerk_, std::sqrt(v / jerk_));
    parts_.push_back({sign * jerk_, bend});
    parts_.push_back({0.0L, rampTime(v, a) - 2.0L * bend});
    parts_.push_back({-sign * jerk_, bend});
  }
  void build(long double rise, const MotionLimits& limits, long double cruise) {
    addRamp(rise, limits.acceleration, 1.0L);
    parts_.push_back({0.0L, cruise});
    addRamp(rise, limits.deceleration, -1.0L);
    for (const Part& part : parts_) total_ += part.duration;
  }

  long double jerk_;
  long double start_;
  std::vector<Part> parts_;
  long double total_ = 0.0L;
};

Profile fromRest(std::int64_t length, const MotionLimits& limits) {
  return planMove(0, {DoubleDouble(0.0), 0.0, 0.0}, length, limits).profile;
}

double seconds(std::int64_t length, const MotionLimits& limits) {
  return fromRest(length, limits).duration().value();
}

TEST(SCurve, ThousandStepsTakeOnePointSixSeconds) {
  const Profile profile = fromRest(1000, {0, 1000, 2000, 2000, 20000});
  EXPECT_EQ(profile.endNs(), 1'600'000'000);
  EXPECT_EQ(profile.pieces().size(), 7U);
  EXPECT_DOUBLE_EQ(profile.peakSpeed(), 1000.0);
}

TEST(SCurve, TakesTheTimeOfTheClosedFormInEachCase) {
  // Neither speed nor acceleration reaches its limit: 32 l/j is the cube of the time.
  EXPECT_DOUBLE_EQ(seconds(10, {0, 1000, 2000, 2000, 20000}), std::cbrt(32.0 * 10 / 20000));
  EXPECT_EQ(fromRest(10, {0, 1000, 2000, 2000, 20000}).pieces().size(), 3U);
  // Reaches only the limit of the acceleration: t = a/j + sqrt((a/j)^2 + 4 l/a).
  EXPECT_DOUBLE_EQ(seconds(300, {0, 1000, 2000, 2000, 20000}),
                   0.1 + std::sqrt(0.01 + 4.0 * 300 / 2000));
  EXPECT_EQ(fromRest(300, {0, 1000, 2000, 2000, 20000}).pieces().size(), 5U);
  // Reaches only the limit of the speed: l/v + 2 sqrt(v/j).
  EXPECT_DOUBLE_EQ(seconds(1000, {0, 1000, 20000, 20000, 20000}), 1.0 + 2.0 * std::sqrt(0.05));
  EXPECT_EQ(fromRest(1000, {0, 1000, 20000, 20000, 20000}).pieces().size(), 5U);
  // Each limit is just reached: there is one phase less each time.
  EXPECT_DOUBLE_EQ(seconds(600, {0, 1000, 2000, 2000, 20000}), 1.2);
  EXPECT_EQ(fromRest(600, {0, 1000, 2000, 2000, 20000}).pieces().size(), 5U);
  EXPECT_DOUBLE_EQ(seconds(40, {0, 200, 2000, 2000, 20000}), 0.4);
  EXPECT_EQ(fromRest(40, {0, 200, 2000, 2000, 20000}).pieces().size(), 3U);
}

TEST(SCurve, WithAJerkThatNeverMattersIsATrapezoid) {
  EXPECT_NEAR(seconds(1000, {0, 1000, 2000, 500, 1e12}), seconds(1000, {0, 1000, 2000, 500, 0}),
              1e-8);
}

TEST(SCurve, TakesTheTimeOfTheTextbookForAllOrdersOfMagnitude) {
  Random random(1);
  for (int i = 0; i < 5000; ++i) {
    MotionLimits limits{0.0, random.decades(-3, 6), random.decades(-3, 9), 0.0,
                        random.decades(-3, 12)};
    limits.deceleration = limits.acceleration * random.decades(-3, 3);
    if (random.chance(0.3)) limits.start_speed = limits.max_speed * random.within(0.0, 1.1);
    const auto length = static_cast<std::int64_t>(std::pow(2.0, random.within(0.0, 40.0)));
    SCOPED_TRACE(testing::Message() << length << " microsteps, " << limits);
    const auto textbook = static_cast<double>(DoubleS(length, limits).total());
    if (textbook > Profile::kLongest) {
      EXPECT_THROW(fromRest(length, limits), TooLong);
      continue;
    }
    const Profile profile = fromRest(length, limits);
    EXPECT_NEAR(profile.duration().value(), textbook, 1e-9 + 1e-14 * textbook);
    ProfileCheck check(profile, {}, limits);
    check.expectWithinLimits();
    check.expectRestOn(length);
    if (HasFailure()) return;
  }
}

// Each step is within a nanosecond of the result in long double.
void expectTextbookSteps(std::int64_t length, const MotionLimits& limits) {
  SCOPED_TRACE(testing::Message() << length << " microsteps, " << limits);
  const DoubleS textbook(length, limits);
  const Profile profile = fromRest(length, limits);
  StepFinder finder(profile, 0);
  Step step;
  for (std::int64_t k = 0; k < length; ++k) {
    ASSERT_TRUE(finder.next(step)) << "only " << k << " steps";
    const long double found = step.time_ns * 1e-9L;
    const long double exact = textbook.timeOf(k + 0.5L, found - 1e-6L, found + 1e-6L);
    ASSERT_LE(std::abs(found - exact), 1e-9L) << "step " << k;
  }
  EXPECT_FALSE(finder.next(step));
}

TEST(SCurve, HasItsStepsWhereTheTextbookHasThem) {
  const std::vector<MotionLimits> all = {
      {0, 1000, 2000, 2000, 20000}, {0, 1000, 2000, 500, 20000}, {0, 1000, 500, 2000, 3000},
      {0, 4e4, 2e5, 1e5, 1e7},      {0, 1000, 1e6, 1e6, 1e9},    {0, 100, 0.7, 700, 10},
      {0, 1000, 2000, 2000, 1.0},   {0, 0.01, 0.01, 0.01, 0.01},
  };
  for (const MotionLimits& limits : all) {
    for (const std::int64_t length : {1, 2, 3, 7, 100, 1500}) {
      expectTextbookSteps(length, limits);
      if (testing::Test::HasFailure()) return;
    }
  }
}

TEST(SCurve, HasItsStepsWhereTheTextbookHasThemForRandomMoves) {
  Random random(2);
  for (int i = 0; i < 200; ++i) {
    MotionLimits limits{0.0, random.decades(0, 5), random.decades(0, 6), random.decades(0, 6), 0.0};
    limits.jerk = limits.acceleration * random.decades(-1, 3);
    if (random.chance(0.3)) limits.start_speed = limits.max_speed * random.within(0.0, 1.1);
    expectTextbookSteps(random.whole(1, 400), limits);
    if (HasFailure()) return;
  }
}

TEST(SCurve, IsExactAtTheEndOf2To40Steps) {
  const std::int64_t length = std::int64_t{1} << 40;
  const MotionLimits limits{0, 19999.7, 12345.6, 2345.6, 54321.0};
  const Profile profile = fromRest(length, limits);
  // Reversed in time, the end is the beginning of the mirrored motion.
  const DoubleS mirrored(length, {0, 19999.7, 2345.6, 12345.6, 54321.0});
  const DoubleDouble total = profile.duration();
  StepFinder tail(profile, length - 2000);
  Step step;
  for (std::int64_t left = 2000; left > 0; --left) {
    ASSERT_TRUE(tail.next(step));
    if (left > 1990) continue;  // the finder owes these at once: it was not there when they came
    const DoubleDouble found = total - fromInteger(step.time_ns) / DoubleDouble(1e9);
    const auto before_end = static_cast<long double>(found.hi) + found.lo;
    const long double exact = mirrored.timeOf(left - 0.5L, before_end - 1e-6L, before_end + 1e-6L);
    ASSERT_LE(std::abs(before_end - exact), 1e-9L) << left << " steps before the end";
  }
  EXPECT_FALSE(tail.next(step));
}

TEST(SCurve, IsExactInPhasesOfWeeks) {
  const std::int64_t length = std::int64_t{1} << 40;
  const MotionLimits limits{0, 1e6, 1.0, 1.0, 1e-6};
  const Profile profile = fromRest(length, limits);
  EXPECT_GT(profile.pieces().front().duration.hi, 6e5);
  const auto textbook = [](std::int64_t steps) { return std::cbrt(6.0L * (steps + 0.5L) * 1e6L); };
  const long double total = static_cast<long double>(profile.duration().hi) + profile.duration().lo;
  for (std::int64_t steps = 1; steps < 30'000'000'000; steps = steps * 3 + 1) {
    SCOPED_TRACE(steps);
    Step step;
    StepFinder finder(profile, steps);
    ASSERT_TRUE(finder.next(step));
    EXPECT_LE(std::abs(step.time_ns * 1e-9L - textbook(steps)), 1e-9L);
    StepFinder tail(profile, length - steps - 1);
    ASSERT_TRUE(tail.next(step));
    EXPECT_LE(std::abs(total - step.time_ns * 1e-9L - textbook(steps)), 1e-9L);
  }
}

TEST(SCurve, IsExactAtBothEndsOfALongSwing) {
  // From one turning point to the other with one jerk: the two ends are mirror images.
  const double a = 2000.0;
  const double j = 0.125;
  const std::int64_t length = 341'333'333'333;  // 2 a^3/(3 j^2) less a third
  const DoubleDouble duration(2.0 * a / j);
  const Profile profile(0, {Piece{duration, fromInteger(length), 0.0, -a, j}});
  for (std::int64_t steps = 0; steps < 100'000'000'000; steps = steps * 3 + 1) {
    SCOPED_TRACE(steps);
    Step first;
    ASSERT_TRUE(StepFinder(profile, length - steps).next(first));
    const long double after = first.time_ns * 1e-9L;
    const long double way = after * after * (a / 2.0L - after * j / 6.0L);
    const long double speed = after * (a - after * j / 2.0L);
    EXPECT_LE(std::abs((way - (steps + 0.5L)) / speed), 1e-9L);
    // The turning point is a third of a microstep below 0.
    Step last;
    ASSERT_TRUE(StepFinder(profile, steps + 1).next(last));
    const long double before = duration.hi - last.time_ns * 1e-9L;
    const long double way_left = before * before * (a / 2.0L - before * j / 6.0L);
    const long double speed_left = before * (a - before * j / 2.0L);
    const long double end =
        static_cast<long double>(profile.endPosition().hi) + profile.endPosition().lo;
    EXPECT_LE(std::abs((way_left - (steps + 0.5L - end)) / speed_left), 1e-9L);
  }
}

}  // namespace
}  // namespace stepdriver::motion
