#include "trajectory/feed_rate.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

namespace stepdriver::motion {
namespace {

constexpr double kEnd = 10.0;

// Checks that the rate and its slope are continuous if they must be, and keep the limits.
void expectSound(const Profile& path, const FeedRateLimits& limits, double most_jerk) {
  for (std::size_t i = 0; i < path.pieces().size(); ++i) {
    const Piece& piece = path.pieces()[i];
    for (const double part : {0.0, 0.3, 0.7, 1.0}) {
      const DoubleDouble t = piece.duration * DoubleDouble(part);
      EXPECT_GE(piece.velocityAt(t).value(), -1e-12);
      EXPECT_LE(piece.velocityAt(t).value(), 1.0 + 1e-12);
    }
    EXPECT_LE(std::abs(piece.j), most_jerk * (1.0 + 1e-9));
    if (limits.jerk == 0.0) {
      EXPECT_LE(std::abs(piece.a), limits.slope * (1.0 + 1e-9));
    }
    if (i == 0) continue;
    const Piece& before = path.pieces()[i - 1];
    EXPECT_NEAR((piece.p0 - before.positionAt(before.duration)).value(), 0.0, 1e-12);
    EXPECT_NEAR(piece.v0, before.velocityAt(before.duration).value(), 1e-9);
    if (limits.jerk > 0.0) {
      EXPECT_NEAR(piece.a, before.accelerationAt(before.duration).value(), 1e-6);
    }
  }
}

TEST(Rate, FallsEvenlyToRest) {
  const Profile path = planFeedRate(0, {2.0, 1.0, 0.0}, 0.0, {4.0, 0.0}, 0.0, kEnd);
  ASSERT_EQ(path.pieces().size(), 1U);
  EXPECT_DOUBLE_EQ(path.duration().value(), 0.25);
  EXPECT_DOUBLE_EQ(path.endPosition().value(), 2.125);
}

TEST(Rate, FallsToRestWithAJerkLimitInTheTimeOfTheClosedForm) {
  // slope/jerk + 1/slope if the slope is reached.
  const Profile path = planFeedRate(0, {2.0, 1.0, 0.0}, 0.0, {4.0, 32.0}, 0.0, kEnd);
  EXPECT_NEAR(path.duration().value(), 0.125 + 0.25, 1e-12);
  EXPECT_NEAR(path.endPosition().value(), 2.0 + 0.375 / 2.0, 1e-12);
  expectSound(path, {4.0, 32.0}, 32.0);
}

TEST(Rate, GoesOnToTheEndAtTheNewRate) {
  const Profile path = planFeedRate(7, {2.0, 1.0, 0.0}, 0.5, {1.0, 0.0}, 0.0, kEnd);
  EXPECT_EQ(path.startNs(), 7);
  EXPECT_NEAR(path.endPosition().value(), kEnd, 1e-12);
  EXPECT_NEAR(path.duration().value(), 0.5 + (8.0 - 0.375) / 0.5, 1e-9);
}

TEST(Rate, StaysAsItIsForATimeFirst) {
  const Profile path = planFeedRate(0, {2.0, 1.0, 0.0}, 0.0, {4.0, 0.0}, 0.5, kEnd);
  EXPECT_DOUBLE_EQ(path.stateAt(499'000'000).velocity, 1.0);
  EXPECT_DOUBLE_EQ(path.endPosition().value(), 2.625);
}

TEST(Rate, EndsWhereTheCourseDoes) {
  for (const double jerk : {0.0, 0.1}) {
    const Profile path = planFeedRate(0, {9.9, 1.0, 0.0}, 0.0, {0.1, jerk}, 0.0, kEnd);
    EXPECT_NEAR(path.endPosition().value(), kEnd, 1e-12);
    EXPECT_NEAR(path.duration().value(), 0.1, 0.01);
  }
}

TEST(Rate, NeverRunsBackwardsNorFasterWhateverComesInBetween) {
  std::mt19937 random(20250101);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (int i = 0; i < 2000; ++i) {
    const FeedRateLimits first{std::pow(10.0, 3.0 * unit(random)),
                               std::pow(10.0, 4.0 * unit(random))};
    const FeedRateLimits second{std::pow(10.0, 3.0 * unit(random)),
                                std::pow(10.0, 4.0 * unit(random))};
    const double goal = unit(random) < 0.3 ? 0.0 : unit(random);
    const Profile before = planFeedRate(0, {0.0, unit(random), 0.0}, goal, first, 0.0, 1000.0);
    const auto at = static_cast<std::int64_t>(unit(random) * 1e9);
    const MotionState from = before.stateAt(std::min(at, before.endNs()));
    const double wanted = unit(random) < 0.5 ? 1.0 : unit(random);
    const double after = unit(random) < 0.5 ? 0.0 : unit(random);
    const Profile path = planFeedRate(0, from, wanted, second, after, 1000.0);
    // Ending the current slope may take as much as beginning it.
    expectSound(path, second, std::max(first.jerk, second.jerk) * (1.0 + 1e-6));
    EXPECT_NEAR(path.endPosition().value(), 1000.0, 1e-9) << i;
    if (testing::Test::HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver::motion
