#include "profile/composition.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <vector>

#include "trajectory/spline.h"

namespace stepdriver {
namespace {

// The value and the derivatives of q(s(t)) at a time, by the chain rule.
double placeAt(const motion::Profile& curve, const motion::Piece& path, double seconds) {
  const motion::DoubleDouble s = path.positionAt(seconds);
  const std::int64_t s_ns = motion::splitNanoseconds(s).whole;
  const motion::MotionState there = curve.stateAt(s_ns);
  return there.position.value() + (s.value() - static_cast<double>(s_ns) * 1e-9) * there.velocity;
}

motion::Profile compose(const motion::Profile& curve, const motion::Profile& path) {
  return motion::composeAlong(std::make_shared<const motion::Profile>(curve), path);
}

double worstError(const motion::Profile& curve, const motion::Piece& path) {
  const motion::Profile run = compose(curve, motion::Profile(0, {path}));
  double worst = 0.0;
  for (std::int64_t t = 0; t <= run.endNs(); t += 100'003) {
    const double wanted = placeAt(curve, path, static_cast<double>(t) * 1e-9);
    worst = std::max(worst, std::abs(run.stateAt(t).position.value() - wanted));
  }
  EXPECT_LT(run.pieces().size(), 300U);
  return worst;
}

TEST(Compose, IsTheCurveAtTheSameRateAndExactAtAnother) {
  const motion::Profile curve = motion::planSpline(
      0, {}, {{1'000'000'000, 300.0, 200.0, 0.0}, {2'500'000'000, 900.0, 0.0, {}}});
  for (const double rate : {1.0, 0.25}) {
    const motion::Profile path(5, {motion::Piece{2.5 / rate, 0.0, rate, 0.0, 0.0}});
    const motion::Profile run = compose(curve, path);
    EXPECT_NEAR(run.duration().value(), 2.5 / rate, 1e-12);
    for (std::int64_t t = 0; t < 2'500'000'000; t += 10'000'019) {
      const motion::MotionState wanted = curve.stateAt(t);
      const motion::MotionState seen =
          run.stateAt(5 + static_cast<std::int64_t>(static_cast<double>(t) / rate));
      EXPECT_NEAR((seen.position - wanted.position).value(), 0.0, 1e-5) << t;
      EXPECT_NEAR(seen.velocity, wanted.velocity * rate, 1e-5) << t;
      EXPECT_NEAR(seen.acceleration, wanted.acceleration * rate * rate, 1e-3) << t;
    }
  }
}

motion::Profile bend() {
  return motion::planSpline(
      0, {}, {{1'000'000'000, 30'000.0, 20'000.0, 0.0}, {2'500'000'000, 90'000.0, 0.0, {}}});
}

TEST(Compose, StaysWithinItsErrorWhereTheRateChanges) {
  // From full rate to a fifth of it: 0.6 s in 1 s, rising from 0.7 s.
  const double worst = worstError(bend(), {1.0, 0.7, 1.0, -0.8, 0.0});
  EXPECT_LE(worst, motion::kComposeError * 1.001);
  EXPECT_GT(worst, motion::kComposeError / 100.0);  // it isn't cut finer than necessary
}

TEST(Compose, StaysWithinItsErrorWhereTheSlopeOfTheRateChangesToo) {
  // From full rate to rest, with a slope that rises and then falls.
  EXPECT_LE(worstError(bend(), {1.0, 0.7, 1.0, 0.0, -1.0}), motion::kComposeError * 1.001);
  EXPECT_LE(worstError(bend(), {1.0, 0.7, 0.5, -1.0, 1.0}), motion::kComposeError * 1.001);
}

TEST(Compose, GoesFromOneCurveToTheNextWhereTheSlopeOfTheRateChanges) {
  const motion::Piece path{1.0, 0.7, 1.0, 0.0, -1.0};
  const motion::Profile run = compose(bend(), motion::Profile(0, {path}));
  double longest = 0.0;
  for (std::size_t i = 1; i < run.pieces().size(); ++i) {
    const motion::Piece before = run.pieces()[i - 1];
    const motion::Piece piece = run.pieces()[i];
    const motion::DoubleDouble step = piece.p0 - before.positionAt(before.duration);
    longest = std::max(longest, std::abs(step.value()));
    EXPECT_NEAR(before.velocityAt(before.duration).value(), piece.v0, 1e-6) << i;
  }
  EXPECT_LT(longest, 1e-9);
}

TEST(Compose, RestsWhereThePathRests) {
  const motion::Profile curve = bend();
  const double seconds = 0.25;
  const motion::Profile path(
      5, {motion::Piece{1.0, 0.5, 1.0, -1.0, 0.0}, motion::Piece{seconds, 1.0, 0.0, 0.0, 0.0},
          motion::Piece{1.0, 1.0, 0.0, 1.0, 0.0}});
  const motion::Profile run = compose(curve, path);
  EXPECT_NEAR(run.duration().value(), 2.0 + seconds, 1e-12);
  const double place = curve.stateAt(1'000'000'000).position.value();
  for (std::int64_t t = 0; t <= 250'000'000; t += 25'000'000) {
    const motion::MotionState seen = run.stateAt(1'000'000'005 + t);
    EXPECT_NEAR(seen.position.value(), place, 1e-5) << t;
    EXPECT_NEAR(seen.velocity, 0.0, 1e-3) << t;
  }
  EXPECT_NEAR(run.endPosition().value(), curve.stateAt(1'500'000'000).position.value(), 1e-5);
}

TEST(Compose, TellsWhetherAMotorMayDoIt) {
  const motion::Profile curve = bend();
  const motion::Piece slowing{0.4, 1.2, 1.0, -0.5, -1.0};
  const motion::Profile path(0, {slowing});
  double acceleration = 0.0;
  double jerk = 0.0;
  constexpr double kStep = 1e-3;
  for (double t = kStep; t < 0.4 - kStep; t += kStep) {
    const double before = placeAt(curve, slowing, t - kStep);
    const double here = placeAt(curve, slowing, t);
    const double after = placeAt(curve, slowing, t + kStep);
    acceleration = std::max(acceleration, std::abs(after - 2.0 * here + before) / kStep / kStep);
    if (t < 2.0 * kStep) continue;
    const double long_before = placeAt(curve, slowing, t - 2.0 * kStep);
    jerk = std::max(
        jerk, std::abs(after - 3.0 * here + 3.0 * before - long_before) / (kStep * kStep * kStep));
  }
  EXPECT_TRUE(motion::staysWithin(curve, path, {acceleration * 1.02, 0.0}));
  EXPECT_FALSE(motion::staysWithin(curve, path, {acceleration * 0.98, 0.0}));
  EXPECT_TRUE(motion::staysWithin(curve, path, {acceleration * 1.02, jerk * 1.02}));
  EXPECT_FALSE(motion::staysWithin(curve, path, {acceleration * 1.02, jerk * 0.97}));
}

}  // namespace
}  // namespace stepdriver
