#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/path_bench.h"
#include "support/refusal.h"

// Paths that are given as a whole.

namespace stepdriver {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)
using axis::MoveEnd;
using test::kInfinity;
using test::kNan;
using Shape = PathSegment::Shape;

class Path : public PathBench {
 protected:
  /// Follows the circle with a hold in its middle, to its end.
  void holdAndResume() {
    const CoordinatedMove move = followPath(circle());
    advance(0.5);
    machine().hold();
    awaitRest();
    EXPECT_TRUE(state("x").held);
    advance(1.0);
    machine().resume();
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
    EXPECT_EQ(bench->pulses("x"), 0);
    expectAtRest();
  }

  /// Stops on the circle, somewhere in its middle.
  void stopOnTheWay() {
    const CoordinatedMove move = followPath(circle());
    advance(0.7);
    bench->axis("y").stop();
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kStopped);
    awaitRest();
    expectAtRest();
    EXPECT_GT(std::abs(state("x").position), 0.01);
  }

  /// Moves both axes to a place and follows a full circle around (-20 mm, 0) from there. The pulses
  /// must be on the circle around the place that was commanded.
  void followCircleFrom(double at, bool relative, bool clockwise) {
    bench->move(at, "x");
    bench->move(at, "y");
    const double begin = relative ? 0.0 : at;
    PathRequest request{
        {"x", "y"}, {arcTo({begin, begin}, {begin - kRadius, begin})}, relative, 0.0, 0.0};
    request.segments.front().clockwise = clockwise;
    const std::size_t before = pulsePlaces().size();
    const CoordinatedResult result = finish(request);
    ASSERT_EQ(result.end, MoveEnd::kReached) << result.message;
    const std::vector<Place> places = pulsePlaces();
    EXPECT_NEAR(static_cast<double>(places.size() - before), 12'800.0, 20.0);
    double worst = 0.0;
    for (std::size_t i = before; i < places.size(); ++i) {
      const double radius = std::hypot(places[i][0] - (at - kRadius), places[i][1] - at);
      worst = std::max(worst, std::abs(radius - kRadius));
    }
    EXPECT_LE(worst, kHalfMicrosteps + 0.05 * kMicrostep);
    for (const std::string name : {"x", "y"}) {
      EXPECT_EQ(static_cast<double>(bench->pulses(name)), std::round(at / kMicrostep)) << name;
    }
    expectAtRest();
  }

  /// The highest speed along the path during a time.
  double fastest(double time) {
    double most = 0.0;
    for (double t = 0.0; t < time; t += 0.001) {
      advance(0.001);
      most = std::max(most, std::hypot(state("x").velocity, state("y").velocity));
    }
    return most;
  }

  void expectNextPathBeginsThere() {
    EXPECT_EQ(finish({{"x", "y"}, {lineTo({0.0, 0.0})}, false, 0.0, 0.0}).end, MoveEnd::kReached);
    EXPECT_EQ(bench->pulses("x"), 0);
  }
};

TEST_F(Path, IsPlannedAsItWillBeFollowed) {
  const PathRequest request = circle();
  const double planned = machine().pathDuration(request);
  machine().hold();
  EXPECT_EQ(machine().pathDuration(request), planned) << "a hold changes no plan";
  machine().stop();
  bench->axis("x").enable(false);
  EXPECT_EQ(machine().pathDuration(request), planned) << "nor does a disabled axis";
  bench->axis("x").enable(true);
  EXPECT_EQ(bench->pulses("x"), 0);
  const CoordinatedResult result = finish(request);
  ASSERT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.duration, planned, 1e-6);
  EXPECT_EQ(machine().pathDuration(request, {0.0, 0.0}), planned) << "from where it began";
}

TEST_F(Path, IsPlannedFromElsewhere) {
  const PathRequest there{{"x", "y"}, {lineTo({0.05, 0.0})}, false, 0.0, 0.0};
  EXPECT_LT(machine().pathDuration(there, {0.04, 0.0}), machine().pathDuration(there));
  const auto expect_refused = [&](const PathRequest& request, const std::vector<double>& from,
                                  const std::string& words) {
    EXPECT_REFUSED(machine().pathDuration(request, from), words);
  };
  expect_refused(there, {0.04}, "there are 2 names, but 1 positions");
  expect_refused(there, {0.04, std::nan("")}, "y: the position nan from which the path begins");
  expect_refused(there, {0.04, 1e300}, "y: the position from which the path begins");
  expect_refused({{"x", "y"}, {lineTo({9e9, 0.0})}, false, 0.0, 0.0}, {}, "segment 0");
  PathRequest more = there;
  more.more_follows = true;
  expect_refused(more, {}, "no more may follow");
  advance(0.1);
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(Path, FollowsACircleOfLinesWithoutStopping) {
  const CoordinatedMove move = followPath(circle());
  // On the ideal circle: 2 pi r/v + v/a = 1.357 s.
  EXPECT_LE(move.duration, 1.40);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_LE(result.duration, 1.40);
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 0);
  expectAtRest();
  const std::vector<Place> places = pulsePlaces();
  // The circle has 4 * 3200; its rounded corners are a bit inside of it.
  EXPECT_NEAR(static_cast<double>(places.size()), 12'800.0, 20.0);
  // The plan deviates from the blended path by a fiftieth of a microstep at most.
  EXPECT_LE(farthest(places, corners(circle())), kTolerance + kHalfMicrosteps + 0.02 * kMicrostep);
  RecordProperty("duration", std::to_string(result.duration));
}

TEST_F(Path, KeepsTheLimitsOfBothAxes) {
  finish(mixed());
  expectAtRest();
  for (const std::string name : {"x", "y"}) {
    const test::Differences seen = differences(name, 0.004);
    // Half a step of uncertainty at each end of 4 ms.
    EXPECT_LE(seen.speed, 0.1 / kMicrostep * 1.001) << name;
    EXPECT_LE(seen.acceleration, 1.0 / kMicrostep * 1.02) << name;
  }
}

TEST_F(Path, GoesThroughArcsAndBeziersToItsEnd) {
  const CoordinatedResult result = finish(mixed());
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.positions[0], -0.010, kMicrostep / 2.0);
  EXPECT_NEAR(result.positions[1], 0.010, kMicrostep / 2.0);
  expectAtRest();
}

TEST_F(Path, TakesAnArcThroughAPointAndAHelix) {
  PathRequest request{{"x", "y"}, {lineTo({-0.020, 0.020})}, false, 0.0, 0.0};
  request.segments[0].shape = Shape::kArcThrough;
  request.segments[0].plane = {"x", "y"};
  request.segments[0].point = onCircle(0.125);
  finish(request);
  std::vector<Place> given;
  for (int i = 0; i <= 500; ++i) given.push_back(onCircle(i / 2000.0));
  EXPECT_LE(farthest(pulsePlaces(), given), kHalfMicrosteps + 0.03 * kMicrostep);
  EXPECT_EQ(bench->pulses("y"), 1600);

  build({plotterAxis("x"), plotterAxis("y"), plotterAxis("z")});
  PathRequest helix{{"x", "y", "z"}, {arcTo({0.0, 0.0, 0.010}, {-kRadius, 0.0})}, false, 0.0, 0.0};
  finish(helix);
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("z"), 800);
}

// The axes rest up to half a microstep away from that place. From there it would be another circle,
// of which nothing or twice as much may be left.
TEST_F(Path, BeginsAnArcAtTheCommandedPositions) {
  for (const double at : {0.010003, 0.0100061, 0.00999375, 0.01001}) {
    for (const bool relative : {false, true}) {
      for (const bool clockwise : {false, true}) {
        SCOPED_TRACE(std::to_string(at * 1e6) + " um" + (relative ? ", relative" : "") +
                     (clockwise ? ", clockwise" : ""));
        SetUp();
        followCircleFrom(at, relative, clockwise);
      }
    }
  }
}

// Relative moves that are circles don't lose what is less than a microstep.
TEST_F(Path, KeepsTheCommandedPositionsOverACircle) {
  const double third = kMicrostep / 3.0;
  const PathRequest request{
      {"x", "y"}, {arcTo({0.0, 0.0}, {-0.001, 0.0}), lineTo({0.001 + third, 0.0})}, true, 0.0, 0.0};
  for (int i = 0; i < 3; ++i) EXPECT_EQ(finish(request).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 3 * 80 + 1);
}

TEST_F(Path, TakesEndsThatDifferByRoundingForAFullTurn) {
  for (const double off : {1e-18, 1e-15, -1e-12, 1e-9}) {
    for (const std::size_t axis : {0U, 1U}) {
      for (const bool clockwise : {false, true}) {
        SCOPED_TRACE(std::to_string(off * 1e12) + " pm of axis " + std::to_string(axis));
        SetUp();
        PathRequest request{{"x", "y"}, {arcTo({0.0, 0.0}, {-kRadius, 0.0})}, false, 0.0, 0.0};
        request.segments.front().end[axis] = off;
        request.segments.front().clockwise = clockwise;
        EXPECT_EQ(finish(request).end, MoveEnd::kReached);
        EXPECT_NEAR(static_cast<double>(pulsePlaces().size()), 12'800.0, 20.0);
        std::vector<Place> given;
        for (int i = 0; i <= 2000; ++i) given.push_back(onCircle(i / 2000.0));
        EXPECT_LE(farthest(pulsePlaces(), given), kHalfMicrosteps + 0.03 * kMicrostep);
      }
    }
  }
}

TEST_F(Path, OfADoubledPointAloneEndsAtOnce) {
  bench->move(0.010, "x");
  const CoordinatedResult result = finish({{"x", "y"}, {lineTo({0.010, 0.0})}, false, 0.0, 0.0});
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), 800);
  EXPECT_EQ(finish({{"x", "y"}, {lineTo({0.0, 0.0})}, false, 0.0, 0.0}).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 0);
  expectAtRest();
}

TEST_F(Path, StopsAtCornersWithoutATolerance) {
  PathRequest request = mixed();
  request.tolerance = 0.0;
  request.segments.resize(2);
  const CoordinatedMove move = followPath(request);
  // Two lines of 10 mm, each from rest to rest: 2 sqrt(10 mm / 1000 mm/s^2).
  EXPECT_NEAR(move.duration, 2.0 * 2.0 * std::sqrt(0.01), 1e-6);
  machine().wait(move);
  EXPECT_LE(farthest(pulsePlaces(), corners(request)), kMicrostep / 2.0 + 1e-12);
}

TEST_F(Path, KeepsToTheVelocityOfEachSegment) {
  PathRequest request = mixed();
  request.velocity = 0.05;
  request.segments[1].velocity = 0.01;
  const double duration = followPath(request).duration;
  // 10 mm at 10 mm/s, and about 51 mm at 50 mm/s.
  EXPECT_GT(duration, 1.0 + 0.8);
  EXPECT_LT(duration, 1.0 + 1.5);
  while (state("x").moving || state("y").moving) {
    advance(0.001);
    EXPECT_LE(std::hypot(state("x").velocity, state("y").velocity), 0.05 * 1.002);
  }
}

TEST_F(Path, CountsRelativePositionsFromTheCommandedOnes) {
  // A third of a microstep more each time: nothing is lost.
  PathRequest request{{"x", "y"}, {lineTo({0.001 + kMicrostep / 3.0, 0.0})}, true, 0.0, 0.0};
  for (int i = 0; i < 3; ++i) EXPECT_EQ(finish(request).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 3 * 80 + 1);
}

// As after a homing whose switch is there: all round numbers are in the middle between two
// microsteps.
TEST_F(Path, ReachesEndsInTheMiddleBetweenTwoMicrosteps) {
  for (const double jerk : {0.0, 20.0}) {
    for (int i = 1; i <= 40; ++i) {
      std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
      for (config::AxisConfig& axis : axes) axis.jerk = jerk;
      if (jerk > 0.0) axes[0].start_speed = axes[1].start_speed = 0.0;
      build(axes);
      for (const std::string name : {"x", "y"}) bench->axis(name).setPosition(kMicrostep / 2.0);
      const double way = 0.0005 * i;
      const bool fed = i % 2 == 0;
      const CoordinatedMove move = followPath(
          {{"x", "y"}, {lineTo({way, 0.03}), lineTo({-way, 0.01})}, false, 0.0, 1e-4, fed});
      if (fed) {
        advance(i % 4 == 0 ? 0.1 : 3.0);
        machine().appendPath({move.id(), {lineTo({0.0075, way})}, false});
      }
      const CoordinatedResult result = machine().wait(move);
      EXPECT_EQ(result.end, MoveEnd::kReached) << i << ", jerk " << jerk << ": " << result.message;
    }
  }
}

TEST_F(Path, IsHeldOnThePathAndResumed) {
  holdAndResume();
  EXPECT_LE(farthest(pulsePlaces(), corners(circle())),
            kTolerance + kHalfMicrosteps + 0.05 * kMicrostep);
}

// Also in the rounded corner: both axes are at the limits of their accelerations there.
TEST_F(Path, ComesToRestSoonWhereverItIsHeld) {
  const double ramp = 0.1 / 1.0;  // s, from the highest speed to rest
  double longest = 0.0;
  for (double after = 0.15; after < 0.65; after += 0.02) {
    SetUp();
    const PathRequest corner{
        {"x", "y"}, {lineTo({0.03, 0.0}), lineTo({0.03, 0.03})}, false, 0.0, 0.002};
    followPath(corner);
    advance(after);
    machine().hold();
    double time = 0.0;
    for (; state("x").moving || state("y").moving; time += 1e-3) advance(1e-3);
    longest = std::max(longest, time);
    EXPECT_LE(farthest(pulsePlaces(), corners(corner)), 0.002 + kHalfMicrosteps) << after;
    for (const std::string name : {"x", "y"}) {
      EXPECT_LE(differences(name, 0.004).acceleration, 1.0 / kMicrostep * 1.02) << after;
    }
  }
  EXPECT_GE(longest, ramp);
  EXPECT_LE(longest, 1.6 * ramp);
}

TEST_F(Path, StopsOnThePath) {
  stopOnTheWay();
  EXPECT_LE(farthest(pulsePlaces(), corners(circle())),
            kTolerance + kHalfMicrosteps + 0.05 * kMicrostep);
  expectNextPathBeginsThere();
}

TEST_F(Path, EndsOnThePathAtAnEmergencyStop) {
  const CoordinatedMove move = followPath(circle());
  advance(0.6);
  machine().emergencyStop();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kEmergencyStop);
  EXPECT_LE(farthest(pulsePlaces(), corners(circle())),
            kTolerance + kHalfMicrosteps + 0.02 * kMicrostep);
  expectAtRest();
}

TEST_F(Path, RunsMoreSlowlyAtASpeedOverride) {
  machine().setSpeedOverride(0.5);
  const CoordinatedResult result = finish(circle());
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_GT(result.duration, 2.5);
  EXPECT_LE(farthest(pulsePlaces(), corners(circle())),
            kTolerance + kHalfMicrosteps + 0.05 * kMicrostep);
}

// One slope for the whole fall would have to be that of the sharpest place on its way.
TEST_F(Path, FallsToASpeedOverrideWithinTheNextCorners) {
  const CoordinatedMove move = followPath(corrugated());
  advance(0.2);
  const double full = fastest(0.1);
  machine().setSpeedOverride(0.5);
  EXPECT_GT(fastest(0.05), 0.55 * full);
  EXPECT_LE(fastest(0.2), 0.51 * full);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 59 * 80);
  for (const std::string name : {"x", "y"}) {
    EXPECT_LE(differences(name, 0.004).acceleration, 1.0 / kMicrostep * 1.05) << name;
  }
}

TEST_F(Path, TakesUpTheBacklashOnTheWay) {
  std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
  for (config::AxisConfig& axis : axes) axis.backlash = 0.0001;
  build(axes);
  const CoordinatedResult result = finish(circle());
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.positions[0], 0.0, 1e-12);
  EXPECT_NEAR(result.positions[1], 0.0, 1e-12);
  // From the left, up, and the whole backlash of 8 microsteps is taken up.
  EXPECT_EQ(bench->pulses("x"), 8);
  EXPECT_LE(result.duration, 1.8);
}

TEST_F(Path, BeginsOnlyAtRest) {
  bench->axis("x").moveTo(0.05);
  advance(0.1);
  EXPECT_REFUSED(followPath(circle()), "x: it moves; a path begins at rest");
}

TEST_F(Path, IsRefusedAsAWholeAndMovesNothing) {
  const auto with = [](auto change) {
    PathRequest request = mixed();
    change(request);
    return request;
  };
  const auto segment = [&](std::size_t index, auto change) {
    return with([&](PathRequest& request) { change(request.segments[index]); });
  };
  EXPECT_REFUSED(followPath(with([&](auto& request) {
                   request.names = {"x", "q"};
                 })),
                 "there is no axis q");
  EXPECT_REFUSED(followPath(with([&](auto& request) {
                   request.names = {"x", "x"};
                 })),
                 "the axis x is named twice");
  EXPECT_REFUSED(followPath(with([&](auto& request) { request.segments.clear(); })),
                 "the path has 0 segments, but must have 1 to 20000");
  EXPECT_REFUSED(followPath(with([&](auto& request) {
                   request.segments.assign(1'000'000, lineTo({0.0, 0.0}));
                 })),
                 "the path has 1000000 segments, but must have 1 to 20000");
  EXPECT_REFUSED(followPath(with([&](auto& request) { request.tolerance = -1.0; })),
                 "the tolerance of the path is -1, but must be a finite number from 0 on");
  EXPECT_REFUSED(followPath(with([&](auto& request) { request.velocity = kNan; })),
                 "the velocity of the path is nan");
  EXPECT_REFUSED(followPath(segment(1, [&](auto& given) { given.end = {0.0}; })),
                 "segment 1 of the path has 1 positions, but must have 2");
  EXPECT_REFUSED(followPath(segment(1, [&](auto& given) { given.end[1] = kNan; })),
                 "y: segment 1 of the path has nan among its positions, but they must be finite");
  EXPECT_REFUSED(followPath(segment(3, [&](auto& given) { given.control1[0] = kInfinity; })),
                 "x: segment 3 of the path has inf among its numbers in control1");
  EXPECT_REFUSED(followPath(segment(0, [&](auto& given) { given.velocity = -0.1; })),
                 "segment 0 of the path has the velocity -0.1, but it must be");
  EXPECT_REFUSED(followPath(segment(0, [&](auto& given) { given.tolerance = kInfinity; })),
                 "segment 0 of the path has the tolerance inf");
  EXPECT_REFUSED(followPath(segment(0, [&](auto& given) { given.end[0] = -0.2; })),
                 "x: segment 0 of the path at -0.2 m is below the soft limit");
  EXPECT_REFUSED(followPath(segment(2,
                                    [&](auto& given) {
                                      given.point = {0.0, 0.011};
                                    })),
                 "segment 2 of the path is an arc that begins 0.0100498756 m from its centre and "
                 "ends 0.009 m from it; these may differ by 1.00498756e-05 m");
  EXPECT_REFUSED(followPath(segment(2,
                                    [&](auto& given) {
                                      given.shape = Shape::kArcThrough;
                                      given.point = {0.005, 0.015};
                                    })),
                 "segment 2 of the path is an arc through three points that are in line");
  EXPECT_REFUSED(followPath(segment(2,
                                    [&](auto& given) {
                                      given.plane = {"x", "z"};
                                    })),
                 "segment 2 of the path is an arc in a plane of 'z', which isn't among");
  EXPECT_REFUSED(followPath(segment(2,
                                    [&](auto& given) {
                                      given.plane = {"x", "x"};
                                    })),
                 "must have two different axes of the same kind");
  EXPECT_REFUSED(followPath(segment(3,
                                    [&](auto& given) {
                                      given.end = {0.010, 0.020};
                                      given.control1 = {0.010, 0.030};
                                      given.control2 = {0.0, 0.030};
                                    })),
                 "segment 3 is a Bezier with a cusp");
  // The arc's farthest point, not its end.
  EXPECT_REFUSED(followPath({{"x", "y"}, {arcTo({0.0, 0.0}, {-0.06, 0.0})}, false, 0.0, 0.0}),
                 "x: segment 0 of the path at -0.12 m");
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 0);
}

// With a jerk limit: y has the lower one.
class SmoothPath : public Path {
 protected:
  void SetUp() override { buildWith(20.0, 10.0); }

  void buildWith(double jerk_x, double jerk_y, double backlash = 0.0) {
    std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
    axes[0].jerk = jerk_x;
    axes[1].jerk = jerk_y;
    for (config::AxisConfig& axis : axes) axis.backlash = backlash;
    build(axes);
  }

  /// [microsteps] where the joint x is, by the pulses.
  double jointByPulses(int backlash) {
    std::int64_t motor = 0;
    std::int64_t slack = 0;
    for (const test::MotionTrace::Step& step : test::MotionTrace(*bench).steps("x")) {
      slack = std::clamp<std::int64_t>(slack + step.count - motor, 0, backlash);
      motor = step.count;
    }
    return static_cast<double>(motor - slack);
  }

  void expectOnTheCircle() {
    EXPECT_LE(farthest(pulsePlaces(), corners(circle())),
              kTolerance + kHalfMicrosteps + 0.1 * kMicrostep);
  }

  // The 8 parts of a difference that the cubics and half a microstep may add, over its cube.
  void expectLimits(double jerk_x, double jerk_y) {
    constexpr double kApart = 0.02;  // s
    for (const std::string name : {"x", "y"}) {
      const test::Differences seen = differences(name, kApart);
      EXPECT_LE(seen.speed, 0.1 / kMicrostep * 1.001) << name;
      EXPECT_LE(seen.acceleration, 1.0 / kMicrostep * 1.005) << name;
      const double jerk = name == "x" ? jerk_x : jerk_y;
      if (jerk == 0.0) continue;
      EXPECT_LE(seen.jerk, jerk / kMicrostep + 8.0 * 0.03 / (kApart * kApart * kApart)) << name;
    }
  }
};

TEST_F(SmoothPath, KeepsTheLimitsOfBothAxes) {
  const CoordinatedResult result = finish(mixed());
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.positions[0], -0.010, kMicrostep / 2.0);
  EXPECT_NEAR(result.positions[1], 0.010, kMicrostep / 2.0);
  expectAtRest();
  expectLimits(20.0, 10.0);
  EXPECT_GE(differences("y", 0.02).jerk, 0.7 * 10.0 / kMicrostep) << "it isn't used";
  RecordProperty("duration", std::to_string(result.duration));
}

TEST_F(SmoothPath, KeepsTheLimitIfOnlyOneAxisHasOne) {
  buildWith(0.0, 10.0);
  EXPECT_EQ(finish(mixed()).end, MoveEnd::kReached);
  expectAtRest();
  expectLimits(0.0, 10.0);
}

TEST_F(SmoothPath, FollowsACircleOfLinesWithoutStopping) {
  const CoordinatedResult result = finish(circle());
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 0);
  expectAtRest();
  expectOnTheCircle();
  expectLimits(20.0, 10.0);
  RecordProperty("duration", std::to_string(result.duration));
}

TEST_F(SmoothPath, OfALineTakesTheSevenPhasesOfAMove) {
  // 20 mm at 0.1 m/s, 1 m/s^2 and 20 m/s^3
  EXPECT_NEAR(finish({{"x", "y"}, {lineTo({0.02, 0.0})}, false, 0.0, 0.0}).duration,
              0.02 / 0.1 + 0.1 / 1.0 + 1.0 / 20.0, 1e-6);
}

TEST_F(SmoothPath, BeginsAnArcAtTheCommandedPositions) {
  for (const double at : {0.010003, 0.0100061, 0.00999375}) {
    SCOPED_TRACE(std::to_string(at * 1e6) + " um");
    SetUp();
    followCircleFrom(at, true, false);
    expectLimits(20.0, 10.0);
  }
}

TEST_F(SmoothPath, IsHeldOnThePathAndResumed) {
  holdAndResume();
  expectOnTheCircle();
}

TEST_F(SmoothPath, StopsOnThePath) {
  stopOnTheWay();
  expectOnTheCircle();
  expectNextPathBeginsThere();
}

TEST_F(SmoothPath, EndsOnThePathAtAnEmergencyStop) {
  const CoordinatedMove move = followPath(circle());
  advance(0.6);
  machine().emergencyStop();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kEmergencyStop);
  expectOnTheCircle();
  expectAtRest();
}

TEST_F(SmoothPath, RunsMoreSlowlyAtASpeedOverride) {
  const double duration = followPath(circle()).duration;
  advance(0.5);
  machine().setSpeedOverride(0.5);
  advance(duration);
  EXPECT_TRUE(state("x").moving);
  awaitRest();
  expectAtRest();
  EXPECT_EQ(bench->pulses("x"), 0);
  expectOnTheCircle();
  expectLimits(20.0, 10.0);
}

// A single S-curve would take up to 0.85 s. The motion is at its jerk limits, so that the stop has
// to follow its own decelerations.
TEST_F(SmoothPath, ComesToRestWithinTheNextCorners) {
  for (const double at : {0.2, 0.25, 0.3, 0.4}) {
    const CoordinatedMove move = followPath(corrugated());
    advance(at);
    machine().hold();
    advance(0.35);
    EXPECT_TRUE(state("x").held);
    EXPECT_EQ(state("x").velocity, 0.0) << at;
    machine().resume();
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
    expectLimits(20.0, 10.0);
    bench->move(0.0, "x");
    bench->move(0.0, "y");
  }
}

TEST_F(SmoothPath, FallsToASpeedOverrideWithinTheNextCorners) {
  const CoordinatedMove move = followPath(corrugated());
  advance(0.5);
  const double full = fastest(0.1);
  machine().setSpeedOverride(0.5);
  EXPECT_GT(fastest(0.02), 0.55 * full);
  advance(0.2);
  EXPECT_LE(fastest(0.2), 0.51 * full);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 59 * 80);
  expectLimits(20.0, 10.0);
}

TEST_F(SmoothPath, TakesUpTheBacklashOnTheWay) {
  buildWith(20.0, 20.0, 0.0001);
  const CoordinatedResult result = finish(circle());
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.positions[0], 0.0, 1e-12);
  EXPECT_EQ(bench->pulses("x"), 8);
  expectLimits(20.0, 20.0);
}

// While the backlash is still being taken up for the way back, the way forth begins: the joint
// hasn't followed yet, and would stay where it is.
TEST_F(SmoothPath, EndsAtItsEndEvenIfItsLastTurnsAreShorterThanTheBacklash) {
  constexpr int kBacklash = 25;  // microsteps
  for (const double jerk : {0.0, 20.0}) {
    for (const int back : {1, 3, 10, 24, 40}) {
      for (const double forth : {0.6, 2.4, 9.0, 30.0}) {
        SCOPED_TRACE(fmt::format("{} back, {} forth, jerk {}", back, forth, jerk));
        buildWith(jerk, jerk, kBacklash * kMicrostep);
        const double turn = 100.0 - back;
        const double end = turn + forth;
        PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0};
        for (const double place : {100.0, turn, end}) {
          request.segments.push_back(lineTo({place * kMicrostep, 0.0}));
        }
        const CoordinatedResult result = finish(request);
        EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
        EXPECT_NEAR(result.positions[0] / kMicrostep, end, 0.5 + 1e-6);
        EXPECT_NEAR(jointByPulses(kBacklash), end, 0.5 + 1e-6);
      }
    }
  }
}

TEST_F(SmoothPath, StopsWhereTheCurvatureJumpsOnlyWithoutATolerance) {
  PathRequest request{{"x", "y"}, {lineTo({0.010, 0.0})}, false, 0.0, 0.0};
  request.segments.push_back(arcTo({0.010, 0.020}, {0.010, 0.010}));
  const auto slowest = [&] {
    const double duration = followPath(request).duration;
    advance(0.1);
    double speed = std::numeric_limits<double>::infinity();
    for (double time = 0.1; time < duration - 0.1; time += 0.001) {
      advance(0.001);
      speed = std::min(speed, std::hypot(state("x").velocity, state("y").velocity));
    }
    awaitRest();
    finish({{"x", "y"}, {lineTo({0.0, 0.0})}, false, 0.0, 0.0});
    return speed;
  };
  EXPECT_LT(slowest(), 0.002);
  request.tolerance = kTolerance;
  EXPECT_GT(slowest(), 0.02);
  expectLimits(20.0, 10.0);
}

TEST_F(SmoothPath, UsesALimitThatWasSet) {
  buildWith(0.0, 0.0);
  const double jumping = finish(mixed()).duration;
  finish({{"x", "y"}, {lineTo({0.0, 0.0})}, false, 0.0, 0.0});
  for (const char* name : {"x", "y"}) {
    axis::AxisLimits limits;
    limits.jerk = 10.0;
    bench->axis(name).setLimits(limits);
  }
  EXPECT_GT(finish(mixed()).duration, 1.05 * jumping);
}

}  // namespace
}  // namespace stepdriver
