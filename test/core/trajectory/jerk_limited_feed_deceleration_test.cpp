#include "trajectory/jerk_limited_feed_deceleration.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "trajectory/feed_rate.h"
#include "trajectory/spline.h"

namespace stepdriver {
namespace {

using motion::DoubleDouble;
using motion::LimitedCurve;
using motion::Piece;
using motion::Profile;

constexpr double kAcceleration = 40'000.0;  // microsteps/s^2
constexpr double kJerk = 400'000.0;         // microsteps/s^3
constexpr double kShortPart = 0.002;        // s
constexpr double kAnyTime = 100.0;          // s

std::vector<LimitedCurve> atSpeed(double speed) {
  const Piece even{1.0, 0.0, speed, 0.0, 0.0};
  return {{std::make_shared<const Profile>(0, std::vector<Piece>{even}), {kAcceleration, kJerk}}};
}

/// Through random places, with velocities and accelerations: quintics.
LimitedCurve randomCourse(std::mt19937& random) {
  std::uniform_real_distribution<double> part(-1.0, 1.0);
  std::vector<motion::Waypoint> waypoints;
  for (std::int64_t i = 1; i <= 20; ++i) {
    const bool last = i == 20;
    waypoints.push_back({i * 50'000'000, 40.0 * part(random), last ? 0.0 : 800.0 * part(random),
                         last ? 0.0 : 10'000.0 * part(random)});
  }
  auto curve = std::make_shared<const Profile>(motion::planSpline(0, {}, waypoints));
  // The limits are what the curve needs.
  double acceleration = 0.0;
  double jerk = 0.0;
  for (const Piece& piece : curve->pieces()) {
    for (const double a : {piece.a, piece.accelerationAt(piece.duration).value()}) {
      acceleration = std::max(acceleration, std::abs(a));
    }
    jerk = std::max(jerk, std::abs(piece.j));
  }
  return {std::move(curve), {acceleration, 1.05 * jerk}};
}

/// The same by single S-curves, as soon and as steep as possible.
double timeOfOneCurve(const std::vector<LimitedCurve>& curves, double from, double rate) {
  const double end = curves.front().curve->duration().value();
  double soonest = end - from;
  for (double delay = 0.0; delay < soonest; delay += 0.01) {
    for (double gentle = 1.0; gentle > 1e-4; gentle *= 0.8) {
      const motion::FeedRateLimits limits{1000.0 * gentle, 1e6 * gentle * gentle};
      const Profile path = motion::planFeedRate(0, {from, 1.0, 0.0}, rate, limits, delay, end);
      double time = 0.0;
      for (const Piece& piece : path.pieces()) {
        if (piece.a != 0.0 || piece.j != 0.0 || time == 0.0) time += piece.duration.value();
      }
      if (time >= soonest) break;
      if (!std::all_of(curves.begin(), curves.end(), [&](const LimitedCurve& curve) {
            return staysWithin(*curve.curve, path, curve.bounds);
          }))
        continue;
      soonest = time;
      break;
    }
  }
  return soonest;
}

TEST(JerkLimitedFeedDeceleration, TakesLittleLongerThanAnSCurveWhereThatIsTheFastest) {
  for (const double speed : {500.0, 2000.0, 8000.0}) {
    const double ramp = kAcceleration / kJerk;
    const double ideal = speed > kAcceleration * ramp ? speed / kAcceleration + ramp
                                                      : 2.0 * std::sqrt(speed / kJerk);
    const auto path = planJerkLimitedFeedDeceleration(0, {0.2, 1.0, 0.0}, 0.0, atSpeed(speed),
                                                      kShortPart, kAnyTime, 1.0);
    ASSERT_TRUE(path) << speed;
    EXPECT_GE(path->duration().value(), 0.999 * ideal) << speed;
    EXPECT_LE(path->duration().value(), 1.2 * ideal + 2.0 * kShortPart) << speed;
    const Piece& last = path->pieces().back();
    EXPECT_NEAR(last.velocityAt(last.duration).value(), 0.0, 1e-12);
    EXPECT_NEAR(last.accelerationAt(last.duration).value(), 0.0, 1e-12);
  }
}

TEST(JerkLimitedFeedDeceleration, EndsTheSlopeAtALowerRateAndKeepsThatToTheEnd) {
  const auto path = planJerkLimitedFeedDeceleration(0, {0.2, 1.0, 0.0}, 0.4, atSpeed(2000.0),
                                                    kShortPart, kAnyTime, 1.0);
  ASSERT_TRUE(path);
  const Piece& last = path->pieces().back();
  EXPECT_EQ(last.v0, 0.4);
  EXPECT_EQ(last.a, 0.0);
  EXPECT_NEAR(last.positionAt(last.duration).value(), 1.0, 1e-12);
}

TEST(JerkLimitedFeedDeceleration, GoesOnFromTheSlopeOfNow) {
  const motion::MotionState falling{0.2, 0.8, -5.0};
  const auto path =
      planJerkLimitedFeedDeceleration(0, falling, 0.0, atSpeed(2000.0), kShortPart, kAnyTime, 1.0);
  ASSERT_TRUE(path);
  EXPECT_EQ(path->pieces().front().a, -5.0);
  const motion::MotionState rising{0.2, 0.8, 5.0};
  EXPECT_FALSE(
      planJerkLimitedFeedDeceleration(0, rising, 0.0, atSpeed(2000.0), kShortPart, kAnyTime, 1.0));
}

TEST(JerkLimitedFeedDeceleration, TellsIfItTakesLongerThanIsOfUse) {
  const auto within = [](double most) {
    return planJerkLimitedFeedDeceleration(0, {0.2, 1.0, 0.0}, 0.0, atSpeed(2000.0), kShortPart,
                                           most, 1.0);
  };
  EXPECT_FALSE(within(0.14));
  EXPECT_TRUE(within(0.18));
  // The curve ends before.
  EXPECT_FALSE(planJerkLimitedFeedDeceleration(0, {0.95, 1.0, 0.0}, 0.0, atSpeed(2000.0),
                                               kShortPart, kAnyTime, 1.0));
}

TEST(JerkLimitedFeedDeceleration, KeepsTheLimitsOfAllMotorsAndIsFasterThanOneSCurve) {
  std::mt19937 random(11);
  double ours = 0.0;
  double others = 0.0;
  int found = 0;
  for (int round = 0; round < 100; ++round) {
    const std::vector<LimitedCurve> curves{randomCourse(random), randomCourse(random)};
    const double from = std::uniform_real_distribution<double>(0.05, 0.5)(random);
    const double rate = round % 2 == 0 ? 0.0 : 0.5;
    const double one = timeOfOneCurve(curves, from, rate);
    const auto path = planJerkLimitedFeedDeceleration(0, {from, 1.0, 0.0}, rate, curves, kShortPart,
                                                      one, curves.front().curve->duration());
    others += one;
    ours += one;
    if (!path) continue;
    ++found;
    double time = 0.0;
    double slope = 0.0;
    double lowest = 1.0;
    for (const Piece& piece : path->pieces()) {
      ASSERT_NEAR(piece.a, slope, 1e-9) << round;
      ASSERT_LE(piece.v0, lowest + 1e-12) << round;
      lowest = piece.v0;
      slope = piece.accelerationAt(piece.duration).value();
      if (piece.a != 0.0 || piece.j != 0.0 || time == 0.0) time += piece.duration.value();
    }
    EXPECT_NEAR(slope, 0.0, 1e-9) << round;
    ours += time - one;
    // It can be changed again up to its last nanosecond.
    const auto ends = static_cast<std::int64_t>(time * 1e9);
    for (const std::int64_t before : {0, 1, 2, 1000, 1'000'000}) {
      const motion::MotionState state = path->stateAt(ends - before);
      ASSERT_GE(state.velocity, 0.0) << round << ' ' << before;
      const Profile up =
          motion::planFeedRate(0, state, 1.0, {100.0, 1e4}, 0.0, curves.front().curve->duration());
      ASSERT_NEAR(up.endPosition().value(), 1.0, 1e-9) << round;
    }
    for (const LimitedCurve& curve : curves) {
      ASSERT_TRUE(staysWithin(*curve.curve, *path, curve.bounds)) << round;
      const Profile run = composeAlong(curve.curve, *path);
      constexpr std::int64_t kApart = 1'000'000;
      const auto end = static_cast<std::int64_t>(time * 1e9) - kApart;
      for (std::int64_t t = kApart; t < end; t += kApart / 5) {
        const double before = run.stateAt(t - kApart).acceleration;
        const double after = run.stateAt(t + kApart).acceleration;
        const double jerk = (after - before) / (2e-9 * static_cast<double>(kApart));
        ASSERT_LE(std::abs(jerk), 1.05 * curve.bounds.jerk) << round << " at " << t;
      }
    }
  }
  EXPECT_GT(found, 30);
  EXPECT_LT(ours, 0.9 * others);
  RecordProperty("found", found);
  RecordProperty("ours_to_one_curve", std::to_string(ours / others));
}

}  // namespace
}  // namespace stepdriver
