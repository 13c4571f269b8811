#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/refusal.h"
#include "support/trajectory_bench.h"

// Trajectories of several axes. In steps: 1000 steps/m, 2 m/s, 10 m/s^2.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::CoordinatedMove;
using machine::CoordinatedResult;
using motion::TrajectoryRequest;
using test::kNan;
using test::refusal;
using test::trajectoryAxis;

class Trajectory : public test::TrajectoryBench {};

// The cubic s^2 (3 - 2 s) over 2 s, with s = t/2; y moves half as far, backwards.
TrajectoryRequest cubic() { return {{"x", "y"}, {{2.0, {1.0, -0.5}, {0.0, 0.0}, {}}}}; }
double cubicAt(double t) { return t * t / 4.0 * (3.0 - t); }

TEST_F(Trajectory, FollowsACubicToTheStep) {
  const CoordinatedMove move = follow(cubic());
  EXPECT_NEAR(move.duration, 2.0, 1e-9);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.positions, (std::vector<double>{1.0, -0.5}));
  const auto x = bench->trace->times("x", "step", true);
  ASSERT_EQ(x.size(), 1000U);
  // Each edge is where the curve crosses its half-step line; one of them gives the time of the
  // begin.
  double low = 0.0;
  double high = 2.0;
  for (int i = 0; i < 100; ++i) {
    const double middle = (low + high) / 2.0;
    (cubicAt(middle) * 1000.0 < 499.5 ? low : high) = middle;
  }
  const double begin = static_cast<double>(x[499]) * 1e-9 - low;
  for (std::size_t k = 0; k < x.size(); ++k) {
    const double at = cubicAt(static_cast<double>(x[k]) * 1e-9 - begin) * 1000.0;
    EXPECT_NEAR(at, static_cast<double>(k) + 0.5, 1e-5) << k;
  }
  expectClean();
}

TEST_F(Trajectory, IsReplacedByAnotherWithoutAJump) {
  const CoordinatedMove first = follow(cubic());
  advance(1.001);
  const double velocity = state("x").velocity;
  EXPECT_NEAR(velocity, 0.75, 1e-3);
  const CoordinatedMove second = follow({{"x", "y"}, {{2.0, {0.2, 0.2}, {0.0, 0.0}, {0.0, 0.0}}}});
  EXPECT_EQ(machine().wait(first).end, MoveEnd::kReplaced);
  EXPECT_NEAR(state("x").velocity, velocity, 0.02);
  EXPECT_EQ(machine().wait(second).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 200);
  EXPECT_EQ(bench->pulses("y"), 200);
  expectClean();
}

TEST_F(Trajectory, IsHeldOnItsCurveAndResumed) {
  const CoordinatedMove move = follow(cubic());
  advance(0.9);
  machine().hold();
  awaitRest();
  EXPECT_TRUE(state("x").held);
  // Both are at the same place of the curve: y moves half as far as x, backwards.
  EXPECT_NEAR(state("y").position, -0.5 * state("x").position, 0.0016);
  EXPECT_GT(state("x").position, cubicAt(0.9));
  advance(3.0);
  machine().resume();
  advance(0.2);
  EXPECT_NEAR(state("y").position, -0.5 * state("x").position, 0.0016);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), 1000);
  EXPECT_EQ(bench->pulses("y"), -500);
  expectClean();
}

TEST_F(Trajectory, StopsOnItsCurveWithinTheAccelerations) {
  const CoordinatedMove move = follow(cubic());
  advance(1.0);
  bench->axis("y").stop();
  double highest = 0.0;
  double before = state("x").velocity;
  while (state("x").moving) {
    advance(1e-3);
    const double now = state("x").velocity;
    highest = std::max(highest, std::abs(now - before) / 1e-3);
    before = now;
  }
  // Decelerates from 0.75 m/s with at most 10 m/s^2, and not with much less.
  EXPECT_LT(highest, 10.01);
  EXPECT_GT(highest, 5.0);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kStopped);
  EXPECT_NEAR(state("y").position, -0.5 * state("x").position, 0.0016);
  EXPECT_LT(state("x").position, 0.6);
  expectClean();
}

TEST_F(Trajectory, RunsMoreSlowlyAtASpeedOverride) {
  const CoordinatedMove move = follow(cubic());
  advance(1.0);
  machine().setSpeedOverride(0.5);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_NEAR(result.duration, 3.0, 0.1);
  EXPECT_EQ(bench->pulses("x"), 1000);
  expectClean();
}

TEST_F(Trajectory, GoesThroughQuinticsCubicsAndLines) {
  const CoordinatedMove move = follow({{"y", "x"},
                                       {{0.0, {0.0, 0.0}, {0.0, 0.0}, {0.0, 0.0}},
                                        {1.0, {0.5, 0.1}, {0.5, 0.0}, {0.0, 0.0}},
                                        {2.0, {0.9, 0.1}, {0.0, 0.0}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), 900);
  EXPECT_EQ(bench->pulses("x"), 100);
  expectClean();
}

TEST_F(Trajectory, MayJumpToRestFromTheStartSpeed) {
  std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
  for (config::AxisConfig& axis : axes) axis.start_speed = 0.2;
  build(axes);
  const CoordinatedMove move = follow({{"x", "y"}, {{2.5, {0.25, -0.45}, {0.2, -0.2}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), -450);
  expectClean();
  const std::string why = refusal([&] {
    follow({{"x", "y"}, {{2.5, {0.0, 0.0}, {-0.3, 0.2}, {}}}});
  });
  EXPECT_NE(why.find("jump of the velocity is"), std::string::npos) << why;
}

// A trapezoid of velocity exactly at the limits of x, as planners sample it: its acceleration jumps
// at corners between two points. y moves half as far, backwards.
TrajectoryRequest sampledTrapezoid(double period, double phase, bool with_accelerations) {
  constexpr double kRamp = 0.2;
  constexpr double kEnd = 0.7;
  TrajectoryRequest request{{"x", "y"}, {}};
  const auto add = [&](double t) {
    const double left = kEnd - t;
    const double way = t < kRamp      ? 5.0 * t * t
                       : left < kRamp ? 1.0 - 5.0 * left * left
                                      : 2.0 * t - 0.2;
    const double v = 10.0 * std::max(0.0, std::min({t, kRamp, left}));
    const double a = left <= 0.0 ? 0.0 : t < kRamp ? 10.0 : left > kRamp ? 0.0 : -10.0;
    motion::TrajectoryPoint point{t, {way, -way / 2.0}, {v, -v / 2.0}, {}};
    if (with_accelerations) point.accelerations = {a, -a / 2.0};
    request.points.push_back(point);
  };
  for (int k = 0; (k + phase) * period < kEnd - 1e-6; ++k) {
    if (k > 0 || phase > 0.0) add((k + phase) * period);
  }
  add(kEnd);
  return request;
}

TEST_F(Trajectory, FollowsASampledTrapezoidAtTheLimits) {
  for (const bool with_accelerations : {true, false}) {
    for (const double period : {0.1, 0.05, 0.02, 0.01}) {
      for (const double phase : {0.0, 0.33, 0.5}) {
        build({trajectoryAxis("x"), trajectoryAxis("y")});
        const CoordinatedResult result =
            machine().wait(follow(sampledTrapezoid(period, phase, with_accelerations)));
        EXPECT_EQ(result.end, MoveEnd::kReached) << period << ' ' << phase;
        EXPECT_NEAR(result.duration, 0.7, 1e-6);
        EXPECT_EQ(bench->pulses("x"), 1000);
        EXPECT_EQ(bench->pulses("y"), -500);
        const test::Differences most = differences("x", 0.01);
        EXPECT_LE(most.speed, 1.01 * 2000.0 + 1.0) << period << ' ' << phase;
        EXPECT_LE(most.acceleration, 1.01 * 10'000.0 + 1.0) << period << ' ' << phase;
        expectClean();
      }
    }
  }
}

// A planner's points lie anywhere between two microsteps, and so do its first and last one.
TEST_F(Trajectory, FollowsASampledTrapezoidAtTheLimitsBetweenMicrosteps) {
  for (const double offset : {0.0004, -0.0003, 0.000499}) {
    for (const bool with_accelerations : {true, false}) {
      for (const double period : {0.1, 0.05, 0.02, 0.01}) {
        build({trajectoryAxis("x"), trajectoryAxis("y")});
        TrajectoryRequest request = sampledTrapezoid(period, 0.0, with_accelerations);
        request.points.insert(request.points.begin(), {0.0, {0.0, 0.0}, {0.0, 0.0}, {}});
        if (with_accelerations) request.points.front().accelerations = {10.0, -5.0};
        for (motion::TrajectoryPoint& point : request.points) {
          for (double& position : point.positions) position += offset;
        }
        const CoordinatedResult result = machine().wait(follow(request));
        EXPECT_EQ(result.end, MoveEnd::kReached) << period << ' ' << offset << result.message;
        EXPECT_EQ(bench->pulses("x"), 1000);
        EXPECT_EQ(bench->pulses("y"), -500);
        const test::Differences most = differences("x", 0.01);
        EXPECT_LE(most.speed, 1.01 * 2000.0 + 1.0) << period << ' ' << offset;
        EXPECT_LE(most.acceleration, 1.01 * 10'000.0 + 1.0) << period << ' ' << offset;
        expectClean();
      }
    }
  }
}

// A relative move counts from the position that was commanded, between two microsteps.
TEST_F(Trajectory, LeavesTheRestOfAMicrostepToTheNextRelativeMove) {
  const std::vector<TrajectoryRequest> requests = {
      {{"x"}, {{1.0, {0.5}, {}, {}}, {2.0, {1.0004}, {}, {}}}},
      {{"x"}, {{1.0, {0.5}, {0.5}, {0.0}}, {2.0, {1.0004}, {0.0}, {0.0}}}},
      {{"x"}, {{2.0, {1.0004}, {}, {}}}},
  };
  for (const double jerk : {0.0, 1000.0}) {
    for (const TrajectoryRequest& request : requests) {
      config::AxisConfig x = trajectoryAxis("x");
      x.jerk = jerk;
      build({x, trajectoryAxis("y")});
      const CoordinatedMove move = follow(request);
      EXPECT_NEAR(move.members.front().move.target, 1.0004, 1e-12);
      EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
      EXPECT_EQ(bench->pulses("x"), 1000);
      for (int i = 0; i < 3; ++i) {
        EXPECT_EQ(bench->axis("x").wait(bench->axis("x").moveTo(0.0004, true)).end,
                  MoveEnd::kReached);
      }
      EXPECT_EQ(bench->pulses("x"), 1002) << "1000 + 4 x 0.4, jerk " << jerk;
      expectClean();
    }
  }
}

TEST_F(Trajectory, RefusesWhatAnAxisCannotDoAndMovesNothing) {
  const auto why = [&](const std::vector<motion::TrajectoryPoint>& points) {
    return refusal([&] { follow({{"x", "y"}, points}); });
  };
  EXPECT_EQ(why({}), "x: the trajectory has no points");
  EXPECT_EQ(why({{1.0, {0.1}, {}, {}}}),
            "x: point 0 of the trajectory has 1 positions, but must have 2");
  EXPECT_EQ(why({{1.0, {0.1, 0.1}, {0.0}, {}}}),
            "x: point 0 of the trajectory has 1 velocities, but must have 2 or none");
  EXPECT_EQ(why({{1.0, {0.1, kNan}, {}, {}}}),
            "y: point 0 of the trajectory has nan among its positions, but they must be finite");
  EXPECT_EQ(why({{2.0, {0.1, 0.1}, {0.0, 0.0}, {}}, {1.0, {0.2, 0.2}, {0.0, 0.0}, {}}}),
            "x: point 1 of the trajectory is at 1 s, but must be later than the one before it, at "
            "2 s");
  EXPECT_EQ(why({{-1.0, {0.1, 0.1}, {}, {}}}).substr(0, 39),
            "x: point 0 of the trajectory is at -1 s");
  EXPECT_NE(why({{9.0, {0.1, -6.0}, {0.0, 0.0}, {}}}).find("below the soft limit"),
            std::string::npos);
  EXPECT_EQ(why({{0.5, {1.0, 0.0}, {0.0, 0.0}, {}}}),
            "x: the trajectory's velocity is 3 m/s 0.25 s after its start, but the axis has 2 m/s, "
            "from the configuration; with allow_slower it takes 0.774597 s instead of 0.5 s");
  // With the speed limit, the smallest possible acceleration is 10.5 m/s^2. That of the cubic is
  // named, and what makes it allowed.
  EXPECT_EQ(
      why({{0.55, {0.72, 0.0}, {0.0, 0.0}, {}}}),
      "x: the trajectory's acceleration is 14.2809917 m/s^2 0 s after its start, but the axis has "
      "10 m/s^2; with allow_slower it takes 0.657268 s instead of 0.55 s");
  EXPECT_EQ(why({{0.0, {0.5, 0.0}, {0.0, 0.0}, {}}, {2.0, {1.0, 0.0}, {0.0, 0.0}, {}}}),
            "x: the trajectory begins at 0.5 m, but the axis stands at 0 m; they may differ by one "
            "full step");
  // A cubic that exceeds the limits between its points.
  EXPECT_NE(why({{4.0, {-4.9, 0.0}, {-1.0, 0.0}, {}}, {6.0, {-4.9, 0.0}, {0.0, 0.0}, {}}})
                .find("below the soft limit"),
            std::string::npos);
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 0);
}

}  // namespace
}  // namespace stepdriver
