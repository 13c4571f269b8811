#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "profile/errors.h"
#include "profile/step_finder.h"
#include "support/plan_from_rest.h"

namespace stepdriver::motion {
namespace {

// The textbook motion in long double, built in another way: from times, not from pieces.
struct TextbookTrapezoid {
  long double start, peak, up_time, cruise_time, down_time, up, cruise, length, a, d;

  TextbookTrapezoid(std::int64_t steps, const MotionLimits& limits) {
    length = std::abs(static_cast<long double>(steps));
    a = limits.acceleration;
    d = limits.deceleration;
    start = std::min(limits.start_speed, limits.max_speed);
    peak = std::min<long double>(limits.max_speed,
                                 std::sqrt(start * start + 2.0L * length * a * d / (a + d)));
    up_time = (peak - start) / a;
    down_time = (peak - start) / d;
    up = (peak + start) / 2.0L * up_time;
    const long double down = (peak + start) / 2.0L * down_time;
    cruise = std::max(0.0L, length - up - down);
    cruise_time = peak > 0.0L ? cruise / peak : 0.0L;
  }

  long double total() const { return up_time + cruise_time + down_time; }

  long double timeOf(long double line) const {
    if (line <= up) return ramp(line, a);
    if (line <= up + cruise) return up_time + (line - up) / peak;
    return total() - ramp(length - line, d);
  }

  long double ramp(long double way, long double acceleration) const {
    const long double root = std::sqrt(start * start + 2.0L * acceleration * way);
    return 2.0L * way / (start + root);
  }
};

void expectTextbook(std::int64_t from, std::int64_t to, const MotionLimits& limits) {
  SCOPED_TRACE(testing::Message() << from << " to " << to << ", start " << limits.start_speed
                                  << ", max " << limits.max_speed << ", a " << limits.acceleration
                                  << ", d " << limits.deceleration);
  const std::int64_t start_ns = 123'456'789;
  const Profile profile = planFromRest(start_ns, from, to, limits);
  const std::int64_t length = std::abs(to - from);
  const TextbookTrapezoid textbook(length, limits);
  StepFinder finder(profile, from);
  Step step;
  std::int64_t last = 0;
  for (std::int64_t k = 0; k < length; ++k) {
    ASSERT_TRUE(finder.next(step)) << "only " << k << " steps";
    ASSERT_EQ(step.direction, to > from ? 1 : -1);
    const long double exact = start_ns + textbook.timeOf(k + 0.5L) * 1e9L;
    ASSERT_LE(std::abs(step.time_ns - exact), 1.0L) << "step " << k << " of " << length;
    if (k > 0) {
      // Both ends are rounded to a nanosecond.
      ASSERT_GE(step.time_ns - last, static_cast<std::int64_t>(1e9L / textbook.peak) - 1)
          << "step " << k;
    }
    last = step.time_ns;
  }
  EXPECT_FALSE(finder.next(step));
  EXPECT_EQ(finder.count(), to);
  EXPECT_LE(std::abs(profile.endNs() - start_ns - textbook.total() * 1e9L), 1.0L);
  for (const Piece& piece : profile.pieces()) {
    EXPECT_LE(std::abs(piece.v0), limits.max_speed);
    const bool speeding_up = piece.a * (to - from) > 0.0;
    EXPECT_LE(std::abs(piece.a), speeding_up ? limits.acceleration : limits.deceleration);
  }
}

TEST(Trapezoid, NoWayTakesNoTimeAndNoStep) {
  const Profile profile = planFromRest(7, 42, 42, {0, 100, 100, 100});
  EXPECT_EQ(profile.endNs(), 7);
  Step step;
  EXPECT_FALSE(StepFinder(profile, 42).next(step));
}

TEST(Trapezoid, FollowsTheTextbook) {
  const std::vector<MotionLimits> all = {
      {0, 1000, 2000, 2000},    {0, 1000, 2000, 500},   {0, 1000, 500, 2000},
      {100, 1000, 2000, 2000},  {999.9, 1000, 2000, 1}, {1000, 1000, 2000, 2000},
      {5000, 1000, 2000, 2000}, {0, 1e5, 1e6, 3e5},     {0, 0.001, 0.001, 0.001},
      {0, 2.5e5, 1e9, 1e9},     {0.3, 7.7, 0.013, 17},  {1, 40000, 3, 1e7},
  };
  for (const MotionLimits& limits : all) {
    for (const std::int64_t steps : {1, 2, 3, 4, 5, 7, 16, 99, 1000, 4001}) {
      expectTextbook(0, steps, limits);
      expectTextbook(steps / 2, steps / 2 - steps, limits);
    }
  }
}

TEST(Trapezoid, ThousandStepsAtThousandPerSecondTakeOneAndAHalf) {
  const Profile profile = planFromRest(0, 0, 1000, {0, 1000, 2000, 2000});
  EXPECT_EQ(profile.endNs(), 1'500'000'000);
  EXPECT_DOUBLE_EQ(profile.peakSpeed(), 1000.0);
}

TEST(Trapezoid, FollowsTheTextbookForRandomMoves) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> decade(-1.0, 5.0);
  std::uniform_int_distribution<std::int64_t> steps(-3000, 3000);
  for (int i = 0; i < 500; ++i) {
    const auto any = [&] { return std::pow(10.0, decade(random)); };
    const MotionLimits limits{i % 3 == 0 ? 0.0 : any(), any(), any(), any()};
    const std::int64_t from = steps(random);
    expectTextbook(from, from + steps(random), limits);
    if (testing::Test::HasFatalFailure()) return;
  }
}

TEST(Trapezoid, RefusesWhatTakesCenturies) {
  EXPECT_THROW(planFromRest(0, 0, std::int64_t{1} << 40, {0.001, 0.001, 1, 1}), TooLong);
}

TEST(Stop, RestsOnAWholeStepWithinTheDeceleration) {
  const MotionLimits limits{50, 1000, 2000, 1500};
  const Profile move = planFromRest(0, 0, 4000, limits);
  for (std::int64_t at = 1'000'000; at < move.endNs(); at += 13'333'337) {
    const MotionState state = move.stateAt(at);
    const Profile stop = planStop(at, state, limits, 4000);
    const double end = stop.endPosition().value();
    if (stop.pieces().empty()) {
      EXPECT_LE(std::abs(state.velocity), 50.0 + 1e-9);
      continue;
    }
    EXPECT_NEAR(end, std::round(end), 1e-6) << "stopped at " << at;
    EXPECT_LE(end, 4000.0 + 1e-6);
    EXPECT_LE(std::abs(stop.pieces()[0].a), 1500.0 * (1.0 + 1e-9)) << "stopped at " << at;
    const double shortest = (state.velocity * state.velocity - 2500.0) / 3000.0;
    EXPECT_LT(end - state.position.value(), shortest + 1.0 + 1e-6);
  }
}

TEST(Stop, DoesNothingToAnAxisAtRest) {
  const Profile stop = planStop(5, {DoubleDouble(17.0), 0.0, 0.0}, {0, 100, 100, 100}, 17);
  EXPECT_EQ(stop.endNs(), 5);
  EXPECT_DOUBLE_EQ(stop.endPosition().value(), 17.0);
}

TEST(Profile, HasThePositionAndSpeedOfTheTextbookInBetween) {
  const Profile profile = planFromRest(1000, 100, 1100, {0, 1000, 2000, 1000});
  EXPECT_DOUBLE_EQ(profile.stateAt(0).position.value(), 100.0);
  const MotionState quarter = profile.stateAt(1000 + 250'000'000);
  EXPECT_NEAR(quarter.position.value(), 100.0 + 62.5, 1e-9);
  EXPECT_NEAR(quarter.velocity, 500.0, 1e-9);
  EXPECT_DOUBLE_EQ(quarter.acceleration, 2000.0);
  EXPECT_DOUBLE_EQ(profile.stateAt(profile.endNs()).position.value(), 1100.0);
  EXPECT_DOUBLE_EQ(profile.stateAt(profile.endNs()).velocity, 0.0);
}

}  // namespace
}  // namespace stepdriver::motion
