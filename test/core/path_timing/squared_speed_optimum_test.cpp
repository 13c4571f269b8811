#include "path_timing/squared_speed_optimum.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "support/constants.h"

// The optimum on pieces with known derivatives: its duration against a closed form, and its limits
// at both ends of each piece.

namespace stepdriver {
namespace {

using motion::PathDerivatives;
using motion::SquaredSpeedOptimum;
using motion::TimingLimits;

constexpr std::size_t kPieces = 240;

// A place whose distance from either end grows with the third power of its part there.
double placeOf(std::size_t index, double length) {
  const double part = static_cast<double>(index) / kPieces;
  return length * (part - std::sin(2.0 * test::kPi * part) / (2.0 * test::kPi));
}

double durationOf(const SquaredSpeedOptimum& optimum) {
  double duration = 0.0;
  for (std::size_t i = 0; i < optimum.size(); ++i) duration += optimum.duration(i);
  return duration;
}

SquaredSpeedOptimum onLine(double length, const std::vector<TimingLimits>& limits) {
  SquaredSpeedOptimum optimum(limits);
  const double cap = limits[0].speed * limits[0].speed;
  for (std::size_t i = 0; i < kPieces; ++i) {
    const double piece = placeOf(i + 1, length) - placeOf(i, length);
    optimum.append(piece, cap, {{1.0, 0.0, 0.0}, {1.0, 0.0, 0.0}});
  }
  optimum.begin(std::vector<double>(kPieces, 1.0));
  return optimum;
}

// [unit/s^3] The jerk on a line at both ends of a piece between two others.
double jerkOnLine(const SquaredSpeedOptimum& optimum, std::size_t piece, double length) {
  const double change = optimum.acceleration(piece + 1) - optimum.acceleration(piece);
  const double speed = std::sqrt(std::max(optimum.square(piece), optimum.square(piece + 1)));
  return std::abs(change) / (placeOf(piece + 1, length) - placeOf(piece, length)) * speed;
}

TEST(SquaredSpeedOptimum, OfALineTakesAsLongAsTheSevenPhases) {
  const double length = 1000.0;
  for (const double jerk : {20'000.0, 50'000.0, 400'000.0}) {
    SCOPED_TRACE(jerk);
    const std::vector<TimingLimits> limits{{1000.0, 5000.0, 5000.0, jerk}};
    SquaredSpeedOptimum optimum = onLine(length, limits);
    optimum.solve();
    // Each of the first pieces is much longer than the one before it: they don't use all of the
    // jerk.
    EXPECT_NEAR(durationOf(optimum), 1.0 + 0.2 + 5000.0 / jerk, 0.025);
    for (std::size_t i = 1; i + 1 < kPieces; ++i) {
      ASSERT_LT(std::sqrt(optimum.square(i)), 1000.0) << "place " << i;
      ASSERT_LT(std::abs(optimum.acceleration(i)), 5000.0) << "place " << i;
      ASSERT_LT(jerkOnLine(optimum, i, length), jerk * (1.0 + 1e-9)) << "piece " << i;
    }
  }
}

TEST(SquaredSpeedOptimum, KeepsToALowerLimitWhereItIsTightened) {
  const double length = 1000.0;
  const std::vector<TimingLimits> limits{{1000.0, 5000.0, 5000.0, 50'000.0}};
  SquaredSpeedOptimum optimum = onLine(length, limits);
  optimum.solve();
  const double before = durationOf(optimum);
  motion::LimitUsage usage;
  usage.jerk = 2.0;
  for (std::size_t i = 0; i < kPieces / 2; ++i) optimum.tighten(i, usage);
  optimum.solve();
  // A ramp up to the speed v takes v/2a + a/2j longer than the same way at v.
  EXPECT_NEAR(durationOf(optimum), before + 0.05, 0.01);
  for (std::size_t i = 1; i < kPieces / 2; ++i) {
    ASSERT_LT(jerkOnLine(optimum, i, length), 25'000.0 * (1.0 + 1e-9)) << "piece " << i;
  }
}

// Half a turn: each axis keeps to its own limits.
TEST(SquaredSpeedOptimum, OfAnArcKeepsToTheLimitsOfEachAxis) {
  const double radius = 200.0;
  const double length = test::kPi * radius;
  const std::vector<TimingLimits> limits{{1000.0, 3000.0, 4000.0, 40'000.0},
                                         {500.0, 5000.0, 5000.0, 30'000.0}};
  const auto derivatives_at = [&](double s) -> std::vector<PathDerivatives> {
    const double cosine = std::cos(s / radius);
    const double sine = std::sin(s / radius);
    const double square = radius * radius;
    return {{-sine, -cosine / radius, sine / square}, {cosine, -sine / radius, -cosine / square}};
  };
  SquaredSpeedOptimum optimum(limits);
  for (std::size_t i = 0; i < kPieces; ++i) {
    std::vector<PathDerivatives> ends = derivatives_at(placeOf(i, length));
    for (const PathDerivatives& each : derivatives_at(placeOf(i + 1, length))) ends.push_back(each);
    optimum.append(placeOf(i + 1, length) - placeOf(i, length), 1e6, ends);
  }
  optimum.begin(std::vector<double>(kPieces, 1.0));
  optimum.solve();
  double most = 0.0;
  for (std::size_t i = 1; i + 1 < kPieces; ++i) {
    const double piece = placeOf(i + 1, length) - placeOf(i, length);
    const double bend = (optimum.acceleration(i + 1) - optimum.acceleration(i)) / piece;
    for (const std::size_t place : {i, i + 1}) {
      const double square = optimum.square(place);
      const double acceleration = optimum.acceleration(place);
      const std::vector<PathDerivatives> path = derivatives_at(placeOf(place, length));
      for (std::size_t j = 0; j < limits.size(); ++j) {
        const double of_axis = path[j].first * acceleration + path[j].second * square;
        const bool rises = of_axis * path[j].first > 0.0;
        ASSERT_LT(std::abs(of_axis), rises ? limits[j].acceleration : limits[j].deceleration);
        const double jerk =
            std::sqrt(square) *
            (path[j].third * square + 3.0 * path[j].second * acceleration + path[j].first * bend);
        ASSERT_LT(std::abs(jerk), limits[j].jerk * (1.0 + 1e-9)) << "piece " << i << " axis " << j;
        most = std::max(most, std::abs(jerk) / limits[j].jerk);
      }
    }
  }
  EXPECT_GT(most, 0.99) << "it isn't at its limits";
}

}  // namespace
}  // namespace stepdriver
