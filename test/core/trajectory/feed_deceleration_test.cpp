#include "trajectory/feed_deceleration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <random>
#include <vector>

#include "trajectory/feed_rate.h"

namespace stepdriver {
namespace {

using motion::DoubleDouble;
using motion::LimitedCurve;
using motion::Piece;
using motion::Profile;

constexpr double kLimit = 40'000.0;  // microsteps/s^2
constexpr double kSlice = 0.001;     // s
constexpr double kForEver = 100.0;   // s

/// Speeds up, or slows down, by these accelerations, for `each` seconds each.
Profile courseOf(double speed, const std::vector<double>& accelerations, double each) {
  std::vector<Piece> pieces;
  double place = 0.0;
  for (const double acceleration : accelerations) {
    pieces.push_back({each, place, speed, acceleration, 0.0});
    place += each * (speed + acceleration * each / 2.0);
    speed += acceleration * each;
  }
  return {0, std::move(pieces)};
}

LimitedCurve bound(Profile curve, double acceleration = kLimit) {
  return {std::make_shared<const Profile>(std::move(curve)), {acceleration, 0.0}};
}

std::optional<Profile> brake(const std::vector<LimitedCurve>& curves, double from,
                             double slice = kSlice, double most = kForEver) {
  return planFeedDeceleration(0, {from, 1.0, 0.0}, 0.0, curves, slice, most,
                              curves.front().curve->duration());
}

/// The largest acceleration of a motor by differences over 20 us.
double largestAcceleration(const LimitedCurve& curve, const Profile& path) {
  const Profile run = composeAlong(curve.curve, path);
  constexpr std::int64_t kStep = 20'000;
  constexpr double kSeconds = 20e-6;
  double largest = 0.0;
  const auto until = static_cast<std::int64_t>(path.duration().value() * 1e9) - kStep;
  for (std::int64_t t = kStep; t < until; t += kStep) {
    const auto at = [&](std::int64_t time) { return run.stateAt(time).velocity; };
    largest = std::max(largest, std::abs(at(t + kStep) - at(t - kStep)) / (2.0 * kSeconds));
  }
  return largest;
}

TEST(FeedDeceleration, StopsAMotorInTheTimeThatItsSpeedTakes) {
  // At the limit of its acceleration, and then at that of its deceleration.
  const std::vector<LimitedCurve> one = {
      bound(courseOf(500.0, {kLimit, kLimit, -kLimit, -kLimit}, 0.03))};
  for (const double from : {0.0, 0.01, 0.04, 0.055}) {
    const double ideal = (500.0 + kLimit * from) / kLimit;
    const std::optional<Profile> stop = brake(one, from);
    ASSERT_TRUE(stop) << from;
    EXPECT_GE(stop->duration().value(), 0.999 * ideal) << from;
    EXPECT_LE(stop->duration().value(), 1.03 * ideal + 2.0 * kSlice) << from;
  }
}

TEST(FeedDeceleration, IsAtRestAtItsEnd) {
  const std::optional<Profile> stop = brake({bound(courseOf(900.0, {0.0}, 1.0))}, 0.2);
  ASSERT_TRUE(stop);
  const Piece last = stop->pieces().back();
  EXPECT_EQ(last.velocityAt(last.duration).value(), 0.0);
  EXPECT_NEAR(stop->duration().value(), 900.0 / kLimit, 1e-9);
}

// At the limit all the time, its speed is v - a t, its place v t - a t^2/2, and the curve of speed
// v + c a s is at the s with that place.
double timeToFall(double v, double change, double rate) {
  double low = 0.0;
  double high = v / kLimit;
  for (int i = 0; i < 60; ++i) {
    const double t = (low + high) / 2.0;
    const double place = v * t - kLimit * t * t / 2.0;
    const double speed =
        std::sqrt(v * v + 2.0 * change * kLimit * place);  // what the curve allows there
    (v - kLimit * t > rate * speed ? low : high) = t;
  }
  return low;
}

TEST(FeedDeceleration, FallsToALowerRateAndKeepsItToTheEnd) {
  constexpr double kRate = 0.3;
  for (const double change : {0.0, -0.5, 0.5}) {
    const std::vector<LimitedCurve> one = {bound(courseOf(2000.0, {change * kLimit}, 0.09))};
    const Profile path =
        *planFeedDeceleration(0, {0.0, 1.0, 0.0}, kRate, one, kSlice, kForEver, 0.09);
    const Piece& last = path.pieces().back();
    EXPECT_EQ(last.v0, kRate);
    EXPECT_EQ(last.a, 0.0);
    EXPECT_NEAR(last.positionAt(last.duration).value(), 0.09, 1e-15);
    const Piece& before = path.pieces()[path.pieceCount() - 2];
    EXPECT_NEAR(before.velocityAt(before.duration).value(), kRate, 1e-15);
    EXPECT_LE(largestAcceleration(one[0], path), 1.01 * kLimit);
    const double ideal = timeToFall(2000.0, change, kRate);
    const double fall = path.duration().value() - last.duration.value();
    EXPECT_GE(fall, 0.999 * ideal) << change;
    EXPECT_LE(fall, 1.03 * ideal + 2.0 * kSlice) << change;
  }
}

TEST(FeedDeceleration, CannotBrakeAMotorThatDeceleratesAtItsLimitAlready) {
  EXPECT_FALSE(brake({bound(courseOf(4000.0, {-kLimit}, 0.1))}, 0.01));
}

TEST(FeedDeceleration, TellsIfItTakesLongerThanIsOfUse) {
  const std::vector<LimitedCurve> even = {bound(courseOf(2000.0, {0.0}, 1.0))};
  EXPECT_FALSE(brake(even, 0.0, kSlice, 0.0499));
  EXPECT_TRUE(brake(even, 0.0, kSlice, 0.0501));
}

TEST(FeedDeceleration, KeepsTheLimitsOfAllMotorsAndIsFasterThanEvenSlopes) {
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  double ours = 0.0;
  double even = 0.0;
  for (int round = 0; round < 60; ++round) {
    std::vector<LimitedCurve> curves;
    for (int member = 0; member < 2; ++member) {
      std::vector<double> accelerations(20);
      for (double& acceleration : accelerations) {
        acceleration = std::clamp(1.5 * part(random), -1.0, 1.0) * kLimit;
      }
      curves.push_back(bound(courseOf(2000.0 * part(random), accelerations, 0.02)));
    }
    const std::optional<Profile> stop = brake(curves, 0.05);
    if (!stop) continue;
    double time = 0.4;
    for (double slope = 1000.0; slope > 5.0; slope *= 0.9) {
      const Profile path = motion::planFeedRate(0, {0.05, 1.0, 0.0}, 0.0, {slope, 0.0}, 0.0, 0.4);
      const bool keeps = std::all_of(curves.begin(), curves.end(), [&](const LimitedCurve& curve) {
        return staysWithin(*curve.curve, path, curve.bounds);
      });
      if (!keeps) continue;
      time = path.duration().value();
      break;
    }
    EXPECT_LE(stop->duration().value(), time + 2.0 * kSlice) << round;
    ours += stop->duration().value();
    even += time;
    for (const LimitedCurve& curve : curves) {
      EXPECT_LE(largestAcceleration(curve, *stop), 1.01 * kLimit) << round;
    }
  }
  EXPECT_LT(ours, 0.6 * even);
  EXPECT_GT(ours, 0.0);
}

}  // namespace
}  // namespace stepdriver
