#include "trajectory/interpolation.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <vector>

#include "support/constants.h"

namespace stepdriver::motion {
namespace {

using test::kSecond;

std::vector<Waypoint> randomPositions(std::mt19937& random, int count) {
  std::uniform_int_distribution<std::int64_t> duration(kSecond / 20, 3 * kSecond);
  std::uniform_real_distribution<double> position(-4000.0, 4000.0);
  std::vector<Waypoint> waypoints;
  std::int64_t time = 0;
  for (int i = 0; i < count; ++i) {
    time += duration(random);
    waypoints.push_back({time, position(random), {}, {}});
  }
  return waypoints;
}

// The integral of the squared nth derivative (2 or 3) from the start to the last waypoint, by
// Simpson's rule over the exact polynomial of each segment. `from` is the state at the start.
double energy(const MotionState& from, const std::vector<Waypoint>& waypoints, int derivative) {
  double sum = 0.0;
  Waypoint begin{0, from.position.value(), from.velocity, from.acceleration};
  for (const Waypoint& end : waypoints) {
    const double t = 1e-9 * static_cast<double>(end.time_ns - begin.time_ns);
    const double w = end.position - begin.position;
    const double v0 = *begin.velocity * t;
    const double v1 = *end.velocity * t;
    double c[6] = {0.0, v0, 3.0 * w - 2.0 * v0 - v1, v0 + v1 - 2.0 * w, 0.0, 0.0};
    if (derivative == 3) {
      const double a0 = *begin.acceleration * t * t / 2.0;
      const double a1 = *end.acceleration * t * t / 2.0;
      c[2] = a0;
      c[3] = 10.0 * w - 6.0 * v0 - 4.0 * v1 - 3.0 * a0 + a1;
      c[4] = -15.0 * w + 8.0 * v0 + 7.0 * v1 + 3.0 * a0 - 2.0 * a1;
      c[5] = 6.0 * w - 3.0 * v0 - 3.0 * v1 - a0 + a1;
    }
    const auto squared = [&](double u) {
      double value = 0.0;
      for (int k = derivative; k < 6; ++k) {
        double factor = c[k];
        for (int d = 0; d < derivative; ++d) factor *= k - d;
        value += factor * std::pow(u, k - derivative);
      }
      value /= std::pow(t, derivative);
      return value * value;
    };
    constexpr int kParts = 20;
    for (int i = 0; i < kParts; ++i) {
      const double u = static_cast<double>(i) / kParts;
      constexpr double kHalf = 0.5 / kParts;
      sum += t / kParts / 6.0 * (squared(u) + 4.0 * squared(u + kHalf) + squared(u + 2.0 * kHalf));
    }
    begin = end;
  }
  return sum;
}

double jumpOfAcceleration(const std::vector<Waypoint>& waypoints, std::size_t index) {
  const auto curve = [&](std::size_t end) {
    const Waypoint& a = waypoints[end - 1];
    const Waypoint& b = waypoints[end];
    const double t = 1e-9 * static_cast<double>(b.time_ns - a.time_ns);
    const double m = (b.position - a.position) / t;
    return std::pair(2.0 * (3.0 * m - 2.0 * *a.velocity - *b.velocity) / t,
                     2.0 * (*a.velocity + 2.0 * *b.velocity - 3.0 * m) / t);
  };
  return curve(index + 1).first - curve(index).second;
}

TEST(Interpolate, GivesTheMiddleOfThreeEvenPointsItsTextbookVelocity) {
  // 4 v = 3 (m- + m+) with T = 1 s at rest on both sides: (300 + 900)/4.
  const auto made = interpolate({}, {{kSecond, 100.0, {}, {}}, {2 * kSecond, 400.0, {}, {}}},
                                Smoothness::kAcceleration);
  EXPECT_NEAR(*made[0].velocity, 3.0 * 400.0 / 4.0, 1e-9);
  EXPECT_EQ(*made[1].velocity, 0.0);
  EXPECT_FALSE(made[0].acceleration);
}

TEST(Interpolate, ReproducesACubicAndAQuinticFromTheirPositions) {
  // Between known ends, a spline through points of one cubic or one quintic is that curve.
  const auto cubic = [](double t) { return 5.0 * t * t * t - 30.0 * t * t + 7.0 * t + 2.0; };
  std::vector<Waypoint> waypoints;
  for (const double t : {0.5, 0.9, 2.0, 4.0}) {
    waypoints.push_back({std::llround(t * 1e9), cubic(t), {}, {}});
  }
  waypoints.back().velocity = 15.0 * 4.0 * 4.0 - 60.0 * 4.0 + 7.0;
  for (const Waypoint& point :
       interpolate({2.0, 7.0, -60.0}, waypoints, Smoothness::kAcceleration)) {
    const double t = 1e-9 * static_cast<double>(point.time_ns);
    EXPECT_NEAR(*point.velocity, 15.0 * t * t - 60.0 * t + 7.0, 1e-9) << t;
  }
  const auto quintic = [](double t) { return t * t * (1.0 + t * (-2.0 + t * (3.0 + 4.0 * t))); };
  const auto slope = [](double t) { return t * (2.0 + t * (-6.0 + t * (12.0 + 20.0 * t))); };
  const auto curvature = [](double t) { return 2.0 + t * (-12.0 + t * (36.0 + 80.0 * t)); };
  for (Waypoint& point : waypoints) {
    const double t = 1e-9 * static_cast<double>(point.time_ns);
    point = {point.time_ns, quintic(t), {}, {}};
  }
  waypoints.back().velocity = slope(4.0);
  waypoints.back().acceleration = curvature(4.0);
  for (const Waypoint& point : interpolate({0.0, 0.0, 2.0}, waypoints, Smoothness::kJerk)) {
    const double t = 1e-9 * static_cast<double>(point.time_ns);
    EXPECT_NEAR(*point.velocity, slope(t), 1e-8) << t;
    EXPECT_NEAR(*point.acceleration, curvature(t), 1e-8) << t;
  }
}

TEST(Interpolate, KeepsTheAccelerationContinuous) {
  std::mt19937 random(71);
  for (int round = 0; round < 200; ++round) {
    const auto made =
        interpolate({50.0, -300.0, 0.0}, randomPositions(random, 9), Smoothness::kAcceleration);
    for (std::size_t i = 1; i + 1 < made.size(); ++i) {
      EXPECT_NEAR(jumpOfAcceleration(made, i), 0.0, 1e-6) << "round " << round << " point " << i;
    }
  }
}

TEST(Interpolate, HasTheSmallestIntegral) {
  // At a minimum, a small change of any unknown in either direction makes the integral larger.
  std::mt19937 random(72);
  const MotionState from{-20.0, 200.0, 90.0};
  for (int round = 0; round < 50; ++round) {
    const auto given = randomPositions(random, 7);
    for (const int derivative : {2, 3}) {
      const auto made =
          interpolate(from, given, derivative == 2 ? Smoothness::kAcceleration : Smoothness::kJerk);
      const double least = energy(from, made, derivative);
      for (std::size_t i = 0; i + 1 < made.size(); ++i) {
        for (const double change : {-100.0, 100.0}) {
          auto other = made;
          *other[i].velocity += change;
          EXPECT_GT(energy(from, other, derivative), least) << "round " << round << " point " << i;
          if (derivative == 2) continue;
          other = made;
          *other[i].acceleration += change;
          EXPECT_GT(energy(from, other, derivative), least) << "round " << round << " point " << i;
        }
      }
    }
  }
}

TEST(Interpolate, EndsAtRest) {
  std::mt19937 random(73);
  for (const auto smoothness : {Smoothness::kAcceleration, Smoothness::kJerk}) {
    const auto made = interpolate({}, randomPositions(random, 5), smoothness);
    EXPECT_EQ(*made.back().velocity, 0.0);
    EXPECT_EQ(made.back().acceleration.value_or(0.0), 0.0);
  }
}

// The curve ends on a whole microstep, wherever the last waypoint is.
TEST(Interpolate, KeepsTheAccelerationContinuousIfTheEndIsRounded) {
  std::mt19937 random(9);
  for (int i = 0; i < 100; ++i) {
    const std::vector<Waypoint> waypoints =
        interpolate({}, randomPositions(random, 5), Smoothness::kAcceleration);
    const Profile curve = planSpline(0, {}, waypoints);
    ASSERT_EQ(curve.pieceCount(), 5U);
    for (std::size_t k = 0; k + 1 < 5; ++k) {
      const Piece before = curve.piece(k);
      EXPECT_NEAR(before.accelerationAt(before.duration).value(), curve.piece(k + 1).a, 1e-6);
    }
  }
}

TEST(Interpolate, LeavesGivenVelocitiesAsTheyAre) {
  const std::vector<Waypoint> given{{kSecond, 100.0, {}, {}},
                                    {2 * kSecond, 400.0, 77.0, 5.0},
                                    {3 * kSecond, 0.0, {}, {}},
                                    {4 * kSecond, 9.0, 3.0, {}}};
  for (const auto smoothness : {Smoothness::kAcceleration, Smoothness::kJerk}) {
    const auto made = interpolate({}, given, smoothness);
    EXPECT_EQ(*made[1].velocity, 77.0);
    EXPECT_EQ(*made[1].acceleration, 5.0);
    EXPECT_EQ(*made[3].velocity, 3.0);
    EXPECT_FALSE(made[3].acceleration);
    // The points before and after the given velocity don't depend on each other.
    auto farther = given;
    farther[2].position = 1e6;
    EXPECT_EQ(*interpolate({}, farther, smoothness)[0].velocity, *made[0].velocity);
  }
}

TEST(Interpolate, LeavesOutAFirstOfSeveralWaypointsAtTimeZero) {
  const std::vector<Waypoint> tail{{kSecond, 100.0, {}, {}}, {3 * kSecond, 400.0, {}, {}}};
  std::vector<Waypoint> whole = tail;
  whole.insert(whole.begin(), {0, 12345.0, {}, {}});
  const auto made = interpolate({10.0, 5.0, 0.0}, whole, Smoothness::kAcceleration);
  EXPECT_FALSE(made[0].velocity);
  EXPECT_EQ(*made[1].velocity,
            *interpolate({10.0, 5.0, 0.0}, tail, Smoothness::kAcceleration)[0].velocity);
}

}  // namespace
}  // namespace stepdriver::motion
