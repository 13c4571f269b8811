#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "support/constants.h"
#include "support/refusal.h"
#include "support/trajectory_bench.h"

// Trajectories whose points give only positions, and trajectories that the limits slow down.
// 1000 steps/m, 2 m/s, 10 m/s^2.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using motion::TrajectoryRequest;
using test::kNan;
using test::kPi;
using test::refusal;
using test::trajectoryAxis;

class PositionPoints : public test::TrajectoryBench {
 protected:
  void buildWith(double jerk, double backlash) {
    std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
    for (config::AxisConfig& axis : axes) {
      axis.jerk = jerk;
      axis.backlash = backlash;
    }
    build(axes);
  }
  // The limits, with the tolerance of trajectories and the error of differences over 0.05 s.
  void expectWithin(double jerk) {
    for (const std::string axis : {"x", "y"}) {
      const auto most = differences(axis, 0.05);
      EXPECT_LE(most.speed, 2.0 * 1.012 * 1000.0) << axis;
      EXPECT_LE(most.acceleration, 10.0 * 1.012 * 1000.0 + 20.0) << axis;
      if (jerk > 0.0) {
        EXPECT_LE(most.jerk, jerk * 1.012 * 1000.0 + 700.0) << axis;
      }
    }
  }
};

TrajectoryRequest zigzag(double time) {
  return {{"x", "y"},
          {{time, {0.3, -0.2}, {}, {}},
           {2.0 * time, {0.1, 0.4}, {}, {}},
           {3.0 * time, {0.6, 0.1}, {}, {}}}};
}

TEST_F(PositionPoints, ArePassedAtTheirTimesWithoutAJump) {
  for (const double jerk : {0.0, 200.0}) {
    SCOPED_TRACE(jerk);
    buildWith(jerk, 0.0);
    const auto move = follow(zigzag(1.0));
    EXPECT_NEAR(move.duration, 3.0, 1e-9);
    advance(1.0);
    EXPECT_NEAR(state("x").position, 0.3, 0.012);
    EXPECT_NEAR(state("y").position, -0.2, 0.012);
    advance(1.0);
    EXPECT_NEAR(state("x").position, 0.1, 0.012);
    EXPECT_NEAR(state("y").position, 0.4, 0.012);
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
    EXPECT_EQ(state("x").position, 0.6);
    EXPECT_EQ(state("y").position, 0.1);
    expectWithin(jerk);
    expectClean();
  }
}

TEST_F(PositionPoints, FollowTheTextbooksSplineToTheStep) {
  // Even points at rest on both sides: the velocity at the middle is 3 d/(4 T), with d from end to
  // end. From rest, the first cubic is u^2 ((3 m - v) + (v - 2 m) u).
  const auto move = follow({{"x", "y"}, {{1.0, {0.4, 0.0}, {}, {}}, {2.0, {0.6, 0.0}, {}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  const auto steps = crossings("x");
  const auto at = [](double u) { return u * u * ((1.2 - 0.45) + (0.45 - 0.8) * u) * 1000.0; };
  double begin = 0.0;
  for (const auto& step : steps) {
    if (step.position >= 400.0) break;
    double low = 0.0;
    double high = 1.0;
    for (int i = 0; i < 60; ++i) {
      const double middle = (low + high) / 2.0;
      (at(middle) < step.position ? low : high) = middle;
    }
    const double start = static_cast<double>(step.time_ns) * 1e-9 - low;
    if (begin == 0.0) begin = start;
    EXPECT_NEAR(start, begin, 2e-5) << step.position;
  }
}

TEST_F(PositionPoints, AreRefusedWithTheShortestTimeAndFollowedInIt) {
  for (const double jerk : {0.0, 200.0}) {
    SCOPED_TRACE(jerk);
    buildWith(jerk, 0.0);
    TrajectoryRequest request = zigzag(0.1);
    const std::string why = refusal([&] { follow(request); });
    EXPECT_NE(why.find("with allow_slower it takes "), std::string::npos) << why;
    EXPECT_NE(why.find(" s instead of 0.3 s"), std::string::npos) << why;
    EXPECT_EQ(bench->pulses("x"), 0);
    request.allow_slower = true;
    const auto move = follow(request);
    EXPECT_NE(why.find(fmt::format("takes {:.3f}", move.duration).substr(0, 9)), std::string::npos)
        << why << move.duration;
    // It is the shortest: a time that is shorter by more than the tolerance is refused.
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
    EXPECT_EQ(state("x").position, 0.6);
    expectWithin(jerk);
    expectClean();
    buildWith(jerk, 0.0);
    EXPECT_NE(refusal([&] { follow(zigzag(move.duration / 3.0 * 0.98)); }), "");
    EXPECT_NO_THROW(follow(zigzag(move.duration / 3.0)));
  }
}

TEST_F(PositionPoints, WithVelocitiesAreSlowedDownToo) {
  // The cubic from rest to rest has the acceleration 6 d/T^2: 1 m with 10 m/s^2 takes sqrt(0.6) s,
  // and its speed 1.5 d/T stays below 2 m/s.
  TrajectoryRequest request{{"x"}, {{0.4, {1.0}, {0.0}, {}}}};
  EXPECT_NE(refusal([&] { follow(request); }).find("with allow_slower it takes 0.77"),
            std::string::npos);
  request.allow_slower = true;
  const auto move = follow(request);
  EXPECT_NEAR(move.duration, std::sqrt(0.6), 1e-6);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  expectWithin(0.0);
  expectClean();
}

TEST_F(PositionPoints, AreNotSlowedDownInTheWaitBeforeThem) {
  TrajectoryRequest request{{"x"}, {{0.4, {1.0}, {0.0}, {}}}};
  request.begin_in = 1.0;
  EXPECT_NE(refusal([&] { follow(request); }).find("with allow_slower it takes 0.77"),
            std::string::npos);
  request.allow_slower = true;
  const auto move = follow(request);
  EXPECT_NEAR(move.duration, std::sqrt(0.6), 1e-6);
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 0);
  advance(0.1);
  EXPECT_GT(bench->pulses("x"), 0);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  expectWithin(0.0);
  expectClean();
}

TEST_F(PositionPoints, WithinTheLimitsKeepTheirTimes) {
  TrajectoryRequest request = zigzag(1.0);
  request.allow_slower = true;
  EXPECT_NEAR(follow(request).duration, 3.0, 1e-9);
}

TEST_F(PositionPoints, ThatLeadBeyondASoftLimitAreRefused) {
  std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
  axes[0].max_position = 0.505;
  build(axes);
  TrajectoryRequest request{{"x"},
                            {{1.0, {0.5}, {}, {}}, {2.0, {0.5}, {}, {}}, {3.0, {0.0}, {}, {}}}};
  for (const bool allow_slower : {false, true}) {
    request.allow_slower = allow_slower;
    const std::string why = refusal([&] { follow(request); });
    EXPECT_NE(why.find("the trajectory's position 1.5 s"), std::string::npos) << why;
    EXPECT_NE(why.find("max_position"), std::string::npos) << why;
  }
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(PositionPoints, TakeOverFromAMotion) {
  for (const double jerk : {0.0, 200.0}) {
    SCOPED_TRACE(jerk);
    buildWith(jerk, 0.0);
    bench->axis("x").moveTo(2.0);
    advance(0.4);
    const auto move = follow({{"x", "y"}, {{1.0, {1.2, 0.2}, {}, {}}, {2.0, {1.4, 0.3}, {}, {}}}});
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
    EXPECT_EQ(state("x").position, 1.4);
    expectWithin(jerk);
    expectClean();
  }
}

TEST_F(PositionPoints, TakeUpTheBacklash) {
  buildWith(0.0, 0.02);
  EXPECT_EQ(machine().wait(follow(zigzag(1.0))).end, MoveEnd::kReached);
  EXPECT_NEAR(state("x").position, 0.6, 1e-12);
  EXPECT_NEAR(state("y").position, 0.1, 1e-12);
  expectClean();
}

// rqt_joint_trajectory_controller and MoveIt Servo send single points at a high rate: each message
// comes while the axes still follow the one before it.
class StreamedPoints : public PositionPoints {
 protected:
  // Which velocities the points contain.
  enum class Velocities { kNone, kZero, kOfTheStream };

  // The set point moves along a sine of 0.2 m and 0.25 Hz.
  void stream(double period, double time_from_start, Velocities velocities) {
    const double rate = kPi / 2.0;
    for (double time = period; time < 4.0; time += period) {
      const double place = 0.2 * std::sin(rate * time);
      const double speed = 0.2 * rate * std::cos(rate * time);
      TrajectoryRequest request{{"x", "y"}, {{time_from_start, {place, -place / 2.0}, {}, {}}}};
      if (velocities == Velocities::kZero) request.points[0].velocities = {0.0, 0.0};
      if (velocities == Velocities::kOfTheStream) {
        request.points[0].velocities = {speed, -speed / 2.0};
      }
      request.allow_slower = true;
      last = follow(request);
      farthest = std::max(farthest, std::abs(state("x").position - place));
      advance(period);
    }
    EXPECT_EQ(machine().wait(last).end, MoveEnd::kReached);
  }

  machine::CoordinatedMove last;
  double farthest = 0.0;
};

TEST_F(StreamedPoints, AreFollowedWithinTheLimits) {
  for (const double jerk : {0.0, 200.0}) {
    for (const double backlash : {0.0, 0.005}) {
      for (const double period : {0.1, 0.05, 0.03, 0.01}) {
        for (const Velocities velocities :
             {Velocities::kNone, Velocities::kZero, Velocities::kOfTheStream}) {
          SCOPED_TRACE(fmt::format("jerk {} backlash {} period {} velocities {}", jerk, backlash,
                                   period, static_cast<int>(velocities)));
          buildWith(jerk, backlash);
          farthest = 0.0;
          stream(period, period, velocities);
          EXPECT_LT(farthest, 0.2);
          EXPECT_NEAR(state("x").position, -2.0 * state("y").position, 0.0021);
          if (backlash == 0.0) expectWithin(jerk);
          expectClean();
        }
      }
    }
  }
}

TEST_F(StreamedPoints, AreRefusedWithTheShortestTimeIfTheyMustNotBeSlower) {
  bench->axis("x").moveTo(2.0);
  advance(0.5);
  EXPECT_NEAR(state("x").velocity, 2.0, 1e-3);
  const std::string why = refusal([&] { follow({{"x"}, {{0.05, {1.0}, {}, {}}}}); });
  EXPECT_NE(why.find("with allow_slower it takes 0."), std::string::npos) << why;
  EXPECT_NE(why.find("instead of 0.05 s"), std::string::npos) << why;
  EXPECT_NEAR(state("x").velocity, 2.0, 1e-3) << "it continues";
}

TEST_F(StreamedPoints, AreRefusedIfTheirVelocitiesAreNoNumbers) {
  EXPECT_REFUSED(follow({{"x", "y"}, {{0.05, {0.1, 0.1}, {1.0, kNan}, {}}}, true}),
                 "y: point 0 of the trajectory has nan among its velocities");
  EXPECT_REFUSED(follow({{"x", "y"}, {{0.05, {0.1, 0.1}, {1.0}, {}}}, true}),
                 "x: point 0 of the trajectory has 1 velocities, but must have 2 or none");
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(StreamedPoints, BehindTheAxisAreReachedByTurningRound) {
  bench->axis("x").moveTo(2.0);
  advance(0.5);
  const auto move = follow({{"x"}, {{0.05, {0.3}, {}, {}}}, true});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(state("x").position, 0.3);
  expectWithin(0.0);
  expectClean();
}

}  // namespace
}  // namespace stepdriver
