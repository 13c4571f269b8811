#include "point_to_point/moving_target.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace stepdriver::motion {
namespace {

MotionLimits interceptLimits(double jerk) {
  MotionLimits limits;
  limits.max_speed = 1000.0;
  limits.acceleration = 2000.0;
  limits.deceleration = 3000.0;
  limits.jerk = jerk;
  return limits;
}

double durationOf(const std::vector<Piece>& pieces) {
  double duration = 0.0;
  for (const Piece& piece : pieces) duration += piece.duration.hi;
  return duration;
}

/// The pieces follow each other without a jump, and keep the limits.
void expectGood(const std::vector<Piece>& pieces, const MotionState& from,
                const MotionLimits& limits) {
  const double fastest = std::max(limits.max_speed, std::abs(from.velocity)) * (1.0 + 1e-8);
  const double hardest = std::max(2000.0, std::abs(from.acceleration)) * (1.0 + 1e-9);
  MotionState end = from;
  if (limits.jerk == 0.0) end.acceleration = 0.0;
  for (const Piece& piece : pieces) {
    ASSERT_GT(piece.duration.hi, 0.0);
    EXPECT_NEAR((piece.p0 - end.position).hi, 0.0, 1e-8) << "a jump";
    EXPECT_NEAR(piece.v0, end.velocity, 1e-8) << "a jump of the speed";
    if (limits.jerk > 0.0) {
      EXPECT_NEAR(piece.a, end.acceleration, 1e-6);
    }
    EXPECT_LE(std::abs(piece.j), limits.jerk * (1.0 + 1e-12));
    for (int i = 0; i <= 8; ++i) {
      const double t = piece.duration.hi * i / 8.0;
      EXPECT_LE(std::abs(piece.velocityAt(t).value()), fastest);
      EXPECT_LE(std::abs(piece.accelerationAt(t).value()), hardest);
    }
    end = endOf({piece}, end);
  }
}

TEST(Intercept, EndsAtThePointAndWithItsVelocityFromAnyState) {
  std::mt19937_64 random(7);
  const auto any = [&random](double most) {
    return std::uniform_real_distribution<double>(-most, most)(random);
  };
  for (int i = 0; i < 20'000; ++i) {
    const MotionLimits limits = interceptLimits(i % 2 == 0 ? 0.0 : 50'000.0);
    MotionState from;
    from.position = DoubleDouble(any(1e6));
    // Not beyond the limits a moment later.
    from.velocity = any(950.0);
    from.acceleration = limits.jerk > 0.0 ? any(1000.0) : 0.0;
    const MovingTarget point{from.position + any(i % 3 == 0 ? 1000.0 : 2.0),
                             i % 5 == 0 ? 0.0 : any(980.0)};
    const double within = i % 4 == 0 ? 0.02 : 0.0;
    const std::vector<Piece> pieces = planIntercept(from, point, limits, within);
    expectGood(pieces, from, limits);
    const MotionState end = endOf(pieces, from);
    const double duration = durationOf(pieces);
    EXPECT_NEAR((end.position - point.position - DoubleDouble(duration) * point.velocity).hi, 0.0,
                1e-7);
    EXPECT_NEAR(end.velocity, point.velocity, 1e-7);
    EXPECT_NEAR(end.acceleration, 0.0, limits.jerk > 0.0 ? 1e-6 : 1e9);
    if (HasFailure()) FAIL() << "case " << i;
  }
}

TEST(Intercept, TakesTheClosedFormToCatchUp) {
  // 10 microsteps behind at the same velocity: up and down by 2000/s^2, 2 sqrt(10/2000).
  const std::vector<Piece> pieces = planIntercept(
      {DoubleDouble(0.0), 500.0, 0.0}, {DoubleDouble(10.0), 500.0}, interceptLimits(0.0), 0.0);
  EXPECT_NEAR(durationOf(pieces), 2.0 * std::sqrt(10.0 / 2000.0), 1e-9);
}

TEST(Intercept, MakesASmallCorrectionSlowly) {
  const MotionState from{DoubleDouble(0.0), 500.0, 0.0};
  const std::vector<Piece> pieces =
      planIntercept(from, {DoubleDouble(0.02), 500.0}, interceptLimits(0.0), 0.02);
  EXPECT_GT(durationOf(pieces), 0.008);
  EXPECT_LE(durationOf(pieces), 0.02 + 1e-9);
  for (const Piece& piece : pieces) EXPECT_LE(std::abs(piece.a), 1000.0);
}

TEST(Intercept, NeedsNothingOnThePoint) {
  const MotionState from{DoubleDouble(3.0), 500.0, 0.0};
  EXPECT_TRUE(planIntercept(from, {DoubleDouble(3.0), 500.0}, interceptLimits(0.0), 0.01).empty());
}

TEST(Intercept, TheFirstPartEndsAtItsTime) {
  const MotionState from{DoubleDouble(0.0), 0.0, 0.0};
  const std::vector<Piece> pieces =
      planIntercept(from, {DoubleDouble(10.0), 500.0}, interceptLimits(0.0), 0.0);
  const double half = 0.5 * durationOf(pieces);
  const std::vector<Piece> first = firstPart(pieces, half);
  EXPECT_NEAR(durationOf(first), half, 1e-15);
  EXPECT_TRUE(firstPart(pieces, 0.0).empty());
}

}  // namespace
}  // namespace stepdriver::motion
