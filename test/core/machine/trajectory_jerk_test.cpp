#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/refusal.h"
#include "support/trajectory_bench.h"
#include "trajectory/spline.h"

// Trajectories of axes with a jerk limit, and trajectories at the limits, which have to slow down.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::CoordinatedMove;
using motion::TrajectoryPoint;
using motion::TrajectoryRequest;
using test::kSecond;
using test::trajectoryAxis;

constexpr double kJerkLimit = 40.0;  // m/s^3

// The quintic from rest to rest, d (10 u^3 - 15 u^4 + 6 u^5), has a jerk of 60 d/T^3 at its ends.
TrajectoryRequest quintic(double distance, double time) {
  return {{"x", "y"}, {{time, {distance, -distance / 2.0}, {0.0, 0.0}, {0.0, 0.0}}}};
}

class TrajectoryWithJerkLimit : public test::TrajectoryBench {
 protected:
  void SetUp() override {
    std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
    for (config::AxisConfig& axis : axes) axis.jerk = kJerkLimit;
    build(axes);
  }

  // The cubics differ from the curve by up to 0.01 steps, which over 60 ms is a jerk of
  // 8 * 0.01 / 0.06^3 = 370 steps/s^3.
  void expectJerkWithin(double most) {
    EXPECT_LE(differences("x", 0.06).jerk, most * 1000.0 + 400.0);
    EXPECT_LE(differences("y", 0.06).jerk, most * 1000.0 + 400.0);
  }
};

TEST_F(TrajectoryWithJerkLimit, RefusesAnAccelerationThatJumps) {
  const TrajectoryRequest cubic{{"x", "y"}, {{2.0, {0.5, 0.0}, {0.0, 0.0}, {}}}};
  EXPECT_REFUSED(
      follow(cubic),
      "x: the trajectory's acceleration jumps by 0.75 m/s^2 0 s after its start, but the "
      "axis has a jerk limit: all points must have velocities and accelerations, 0 at "
      "the last");
  const TrajectoryRequest braking{{"x", "y"}, {{2.0, {0.5, 0.0}, {0.0, 0.0}, {-0.5, 0.0}}}};
  EXPECT_REFUSED(follow(braking), "jumps by 0.5 m/s^2 2 s after its start");
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(TrajectoryWithJerkLimit, RefusesMoreJerkThanTheAxisHas) {
  EXPECT_REFUSED(follow(quintic(0.5, 0.85)),
                 "x: the trajectory's jerk is 48.8499898 m/s^3 0 s after its start, but the axis "
                 "has 40 m/s^3");
  EXPECT_GT(follow(quintic(0.5, 1.0)).duration, 0.9);
}

TEST_F(TrajectoryWithJerkLimit, FollowsWhatKeepsToIt) {
  EXPECT_EQ(machine().wait(follow(quintic(0.5, 1.0))).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 500);
  expectJerkWithin(30.0);
  expectClean();
}

TEST_F(TrajectoryWithJerkLimit, IsHeldAndResumedWithinIt) {
  const CoordinatedMove move = follow(quintic(0.6, 1.2));
  advance(0.5);
  machine().hold();
  awaitRest();
  EXPECT_GT(state("x").position, 0.2);
  EXPECT_LT(state("x").position, 0.5);
  machine().resume();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 600);
  expectJerkWithin(kJerkLimit);
  expectClean();
}

TEST_F(TrajectoryWithJerkLimit, IsResumedWhileItSlowsDown) {
  const CoordinatedMove move = follow(quintic(0.6, 1.2));
  advance(0.5);
  machine().hold();
  advance(0.15);
  EXPECT_TRUE(state("x").moving);
  machine().resume();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 600);
  expectJerkWithin(kJerkLimit);
  expectClean();
}

TEST_F(TrajectoryWithJerkLimit, StopsAndChangesItsSpeedWithinIt) {
  const CoordinatedMove move = follow(quintic(0.6, 1.2));
  advance(0.3);
  machine().setSpeedOverride(0.5);
  advance(0.4);
  EXPECT_LT(state("x").velocity, 0.6);
  bench->axis("y").stop();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kStopped);
  EXPECT_NEAR(state("y").position, -0.5 * state("x").position, 0.0016);
  expectJerkWithin(kJerkLimit);
  expectClean();
}

class TrajectoryAtItsLimits : public test::TrajectoryBench {};

// Up to 1 m/s at 10 m/s^2, and down to 0.2 m/s with the same deceleration, then constant for
// seconds.
std::vector<TrajectoryPoint> brakingHard() {
  const auto point = [](double time, double position, double velocity) {
    return TrajectoryPoint{time, {position, 0.0}, {velocity, 0.0}, {}};
  };
  return {point(0.1, 0.05, 1.0), point(0.2, 0.15, 1.0), point(0.28, 0.198, 0.2),
          point(3.0, 0.742, 0.2), point(3.02, 0.744, 0.0)};
}

TEST_F(TrajectoryAtItsLimits, StopsAsSoonAsTheyLeaveRoom) {
  const CoordinatedMove move = follow({{"x", "y"}, brakingHard()});
  advance(0.22);
  EXPECT_NEAR(state("x").velocity, 0.8, 0.03);
  bench->axis("x").stop();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kStopped);
  EXPECT_LT(state("x").position, 0.23);
  EXPECT_LE(differences("x", 0.02).acceleration, 10.0 * 1000.0 * 1.02);
  expectClean();
}

TEST_F(TrajectoryAtItsLimits, SlowsDownAsSoonAsTheyLeaveRoom) {
  const CoordinatedMove move = follow({{"x", "y"}, brakingHard()});
  advance(0.22);
  machine().setSpeedOverride(0.5);
  advance(0.2);
  EXPECT_NEAR(state("x").velocity, 0.1, 1e-3);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 744);
  EXPECT_LE(differences("x", 0.02).acceleration, 10.0 * 1000.0 * 1.02);
  expectClean();
}

TEST(SplineJerk, IsThatOfTheCurves) {
  const motion::SplineJerk of_quintic = motion::splineJerk({}, {{kSecond, 100.0, 0.0, 0.0}});
  EXPECT_NEAR(std::abs(of_quintic.jerk.value), 6000.0, 1e-9);
  EXPECT_EQ(of_quintic.acceleration_jump.value, 0.0);
  // A cubic from rest to rest: -12 d/T^3, and 6 d/T^2 at its ends.
  const motion::SplineJerk of_cubic = motion::splineJerk({}, {{2 * kSecond, 100.0, 0.0, {}}});
  EXPECT_NEAR(of_cubic.jerk.value, -150.0, 1e-9);
  EXPECT_NEAR(of_cubic.acceleration_jump.value, 150.0, 1e-9);
  const motion::SplineJerk of_line = motion::splineJerk({}, {{kSecond, 100.0, {}, {}}});
  EXPECT_EQ(of_line.jerk.value, 0.0);
  EXPECT_EQ(of_line.acceleration_jump.value, 0.0);
}

TEST(SplineJerk, TellsWhereTheAccelerationJumpsMost) {
  const motion::SplineJerk found = motion::splineJerk(
      {0.0, 0.0, 7.0}, {{kSecond, 100.0, 150.0, {}}, {2 * kSecond, 200.0, 0.0, {}}});
  // The first cubic's accelerations are 300 and 0, the second cubic's 0 and -300.
  EXPECT_NEAR(std::abs(found.acceleration_jump.value), 300.0, 1e-9);
  EXPECT_EQ(found.acceleration_jump.time_s, 2.0);
}

TEST(SplineJerk, FindsAPeakInsideAQuintic) {
  // With velocities of v at both ends and accelerations of -5 v and 5 v [1/s] its jerk is 0 there.
  const std::vector<motion::Waypoint> waypoints{{kSecond, 0.0, 600.0, 3000.0}};
  const motion::MotionState from{0.0, 600.0, -3000.0};
  const motion::SplineJerk found = motion::splineJerk(from, waypoints);
  const motion::Profile profile = motion::planSpline(0, from, waypoints);
  double steepest = 0.0;
  for (std::int64_t t = 0; t + 20'000'000 < kSecond; t += 1'000'000) {
    const double change =
        profile.stateAt(t + 20'000'000).acceleration - profile.stateAt(t).acceleration;
    steepest = std::max(steepest, std::abs(change) / 0.02);
  }
  EXPECT_NEAR(std::abs(found.jerk.value), steepest, 0.05 * steepest);
  EXPECT_NEAR(found.jerk.value, 9000.0, 1e-6);
  EXPECT_NEAR(found.jerk.time_s, 0.5, 1e-9);
}

}  // namespace
}  // namespace stepdriver
