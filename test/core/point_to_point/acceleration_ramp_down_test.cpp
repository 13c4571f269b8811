#include "point_to_point/acceleration_ramp_down.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <random>

#include "profile/position_range.h"

namespace stepdriver::motion {
namespace {

constexpr double kStartSpeed = 40.0;
constexpr double kMaxSpeed = 1000.0;
constexpr double kLowJerk = 10.0;

MotionLimits limitsOf(double jerk) { return {kStartSpeed, kMaxSpeed, 2000.0, 2000.0, jerk}; }

/// The rest is a move to a target far ahead.
Profile moveOf(const MotionState& from, const MotionLimits& limits, double most_jerk) {
  const AccelerationRampDown ramp_down(5, from, limits, most_jerk);
  return ramp_down.followedBy(planMove(ramp_down.endNs(), ramp_down.end(), 100'000'000, limits))
      .profile;
}

TEST(AccelerationRampDown, KeepsTheSpeedBetweenStandstillAndItsMaximum) {
  std::mt19937_64 random(3);
  const auto any = [&random](double least, double most) {
    return std::uniform_real_distribution<double>(least, most)(random);
  };
  for (int i = 0; i < 5000; ++i) {
    MotionState from;
    from.velocity = any(kStartSpeed, kMaxSpeed);
    from.acceleration = any(-2000.0, 2000.0);
    const Profile whole = moveOf(from, limitsOf(kLowJerk), i % 2 == 0 ? 0.0 : 1e9);
    ASSERT_LE(whole.peakSpeed(), kMaxSpeed * (1.0 + 1e-6)) << from.acceleration;
    ASSERT_GE(positionRangeOf(whole).lowest, 0.0) << from.velocity << " " << from.acceleration;
    ASSERT_EQ(whole.startNs(), 5);
    ASSERT_EQ(whole.endPosition().value(), 100'000'000.0);
    MotionState end = from;
    for (const Piece& piece : whole.pieces()) {
      ASSERT_NEAR((piece.p0 - end.position).value(), 0.0, 1e-6) << "a jump";
      ASSERT_NEAR(piece.v0, end.velocity, kStartSpeed) << "a jump of the speed";
      end = {piece.positionAt(piece.duration), piece.velocityAt(piece.duration).value(), 0.0};
    }
  }
}

TEST(AccelerationRampDown, TakesTheAccelerationBackWithTheJerkThatThisNeeds) {
  MotionState from;
  from.velocity = 540.0;
  from.acceleration = -500.0;
  // 500 steps/s to the start speed: 500^2 / (2 * 500) steps/s^3.
  const AccelerationRampDown slower(0, from, limitsOf(kLowJerk), 1e6);
  EXPECT_NEAR(static_cast<double>(slower.endNs()), 2e9, 2.0);
  EXPECT_NEAR(slower.end().velocity, kStartSpeed, 1e-5);
  EXPECT_EQ(slower.end().acceleration, 0.0);
  from.acceleration = 500.0;
  // 460 steps/s to the maximum.
  const AccelerationRampDown faster(0, from, limitsOf(kLowJerk), 1e6);
  EXPECT_NEAR(static_cast<double>(faster.endNs()), 1.84e9, 2.0);
  EXPECT_NEAR(faster.end().velocity, kMaxSpeed, 1e-5);
}

TEST(AccelerationRampDown, UsesNoHigherJerkThanThatOfTheMotionBefore) {
  MotionState from;
  from.velocity = kMaxSpeed;
  from.acceleration = 500.0;
  const AccelerationRampDown limited(0, from, limitsOf(kLowJerk), 1000.0);
  EXPECT_NEAR(static_cast<double>(limited.endNs()), 0.5e9, 2.0);
  const AccelerationRampDown unlimited(0, from, limitsOf(kLowJerk), 0.0);
  EXPECT_EQ(unlimited.endNs(), 0);
  EXPECT_EQ(unlimited.end().acceleration, 0.0) << "it may jump";
}

TEST(AccelerationRampDown, IsNotNeededIfTheJerkSuffices) {
  MotionState from;
  from.velocity = 540.0;
  from.acceleration = 500.0;
  const double enough = 500.0 * 500.0 / (2.0 * 460.0);
  EXPECT_FALSE(AccelerationRampDown(0, from, limitsOf(enough), 1e6).isNeeded());
  EXPECT_TRUE(AccelerationRampDown(0, from, limitsOf(0.99 * enough), 1e6).isNeeded());
  EXPECT_FALSE(AccelerationRampDown(0, from, limitsOf(0.0), 1e6).isNeeded())
      << "the acceleration may jump";
  from.acceleration = 0.0;
  EXPECT_FALSE(AccelerationRampDown(0, from, limitsOf(kLowJerk), 1e6).isNeeded());
  from = {};
  from.velocity = 0.5 * kStartSpeed;
  from.acceleration = -500.0;
  EXPECT_FALSE(AccelerationRampDown(0, from, limitsOf(kLowJerk), 1e6).isNeeded())
      << "it can stop at once";
}

}  // namespace
}  // namespace stepdriver::motion
