#include "trajectory/microstep_shift.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace stepdriver::motion {
namespace {

constexpr double kAcceleration = 10'000.0;  // [microsteps/s^2]
constexpr double kJerk = 1e6;               // [microsteps/s^3]

// Points at a place, every millisecond, with velocities and accelerations of 0.
std::vector<Waypoint> pointsAt(double place, int count) {
  std::vector<Waypoint> points;
  for (int i = 0; i < count; ++i) {
    points.push_back({std::int64_t{1'000'000} * i, place, 0.0, 0.0});
  }
  return points;
}

std::vector<Waypoint> shifted(double begin, const std::vector<Waypoint>& points,
                              double jerk = 0.0) {
  return shiftedToMicrosteps({begin, 0.0, 0.0}, points, kAcceleration, jerk);
}

TEST(MicrostepShift, BeginsAtTheAxisAndEndsOnAMicrostep) {
  for (const double place : {7.3, 6.7, -7.3, 7.0, 7.5, -7.5}) {
    const double begin = std::round(place);
    const std::vector<Waypoint> points = shifted(begin, pointsAt(place, 3000));
    EXPECT_DOUBLE_EQ(points.front().position, begin);
    EXPECT_EQ(points.back().position, std::round(place));
    EXPECT_EQ(points.back().velocity, 0.0);
    EXPECT_EQ(points.back().acceleration, 0.0);
    EXPECT_EQ(points[1500].position, place) << "far from both ends";
    EXPECT_EQ(points[1500].velocity, 0.0);
  }
}

TEST(MicrostepShift, AddsAThousandthOfTheLimits) {
  for (const double jerk : {0.0, kJerk}) {
    double acceleration = 0.0;
    double change = 0.0;
    const std::vector<Waypoint> points = shifted(0.0, pointsAt(0.5, 3000), jerk);
    for (std::size_t i = 1; i < points.size(); ++i) {
      acceleration = std::max(acceleration, std::abs(*points[i].acceleration));
      change = std::max(change, std::abs(*points[i].acceleration - *points[i - 1].acceleration));
    }
    EXPECT_LE(acceleration, 1e-3 * kAcceleration);
    EXPECT_GT(acceleration, jerk > 0.0 ? 0.0 : 0.95e-3 * kAcceleration);
    if (jerk > 0.0) {
      EXPECT_LE(change / 1e-3, 1e-3 * kJerk);
    }
  }
}

TEST(MicrostepShift, HasTheVelocitiesAndAccelerationsOfItsPlaces) {
  const std::vector<Waypoint> points = shifted(0.0, pointsAt(0.4, 400));
  for (std::size_t i = 1; i + 1 < points.size(); ++i) {
    const double slope = (points[i + 1].position - points[i - 1].position) / 2e-3;
    const double bend =
        (points[i + 1].position - 2.0 * points[i].position + points[i - 1].position) / 1e-6;
    EXPECT_NEAR(*points[i].velocity, slope, 1e-4) << i;
    EXPECT_NEAR(*points[i].acceleration, bend, 0.05) << i;
  }
}

TEST(MicrostepShift, LeavesWhatIsNotRoundingAsItIs) {
  // The axis moves, stands elsewhere, or the first point is later: only the end is shifted.
  const std::vector<Waypoint> points = pointsAt(0.4, 3000);
  const auto first = [&](const MotionState& from, std::vector<Waypoint> given) {
    return shiftedToMicrosteps(from, std::move(given), kAcceleration, 0.0).front().position;
  };
  EXPECT_EQ(first({0.0, 5.0, 0.0}, points), 0.4);
  EXPECT_EQ(first({-0.2, 0.0, 0.0}, points), 0.4);
  EXPECT_EQ(first({0.0, 0.0, 0.0}, {points.begin() + 1, points.end()}), 0.4);
  std::vector<Waypoint> shared = points;
  shared.back().may_rest = true;
  EXPECT_EQ(shifted(0.4, shared).back().position, 0.4);
  EXPECT_EQ(shifted(0.0, {{1'000'000, 0.4, {}, {}}}).front().position, 0.0);
  EXPECT_FALSE(shifted(0.0, {{1'000'000, 0.4, {}, {}}}).front().velocity);
}

}  // namespace
}  // namespace stepdriver::motion
