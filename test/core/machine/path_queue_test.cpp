#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/path_bench.h"
#include "support/refusal.h"

// Paths that are fed while axes follow them.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using motion::PathAhead;
using motion::PathAppend;
using test::CoordinatedMove;
using test::CoordinatedResult;
using test::kHalfMicrosteps;
using test::kMicrostep;
using test::kNan;
using test::kTolerance;
using test::lineTo;
using test::PathRequest;
using test::PathSegment;
using test::Place;

class PathQueue : public test::PathBench {
 protected:
  /// The first segments of a path. The others follow.
  CoordinatedMove begin(const PathRequest& whole, std::size_t count) {
    whole_ = whole;
    fed_ = count;
    PathRequest first = whole;
    first.segments.resize(count);
    first.more_follows = true;
    move_ = followPath(first);
    return move_;
  }

  /// The next ones.
  PathAhead feed(std::size_t count) {
    PathAppend append{move_.id(), {}, false};
    while (count-- > 0 && fed_ < whole_.segments.size()) {
      append.segments.push_back(whole_.segments[fed_++]);
    }
    append.more_follows = fed_ < whole_.segments.size();
    return machine().appendPath(append);
  }

  PathAhead append(const std::vector<PathSegment>& segments, bool more_follows = true) {
    return machine().appendPath({move_.id(), segments, more_follows});
  }
  PathAhead ahead() { return append({}); }

  /// Feeds a path in pieces, each when less than that is left [s].
  CoordinatedResult feedInTime(const PathRequest& whole, std::size_t piece, double least) {
    begin(whole, piece);
    while (fed_ < whole_.segments.size()) {
      EXPECT_TRUE(state("x").moving || state("y").moving) << "starved at segment " << fed_;
      if (ahead().time < least) feed(piece);
      advance(0.001);
    }
    return machine().wait(move_);
  }

  /// A path of 100 segments, which comes to rest after 30 and 60 of them.
  void starveTwice(const PathRequest& path) {
    begin(path, 30);
    awaitRest();
    advance(1.0);
    EXPECT_FALSE(machine().result(move_)) << "it isn't the end";
    EXPECT_NEAR(state("x").position, path.segments[29].end[0], kMicrostep);
    EXPECT_EQ(ahead().segments, 0U);
    EXPECT_EQ(ahead().time, 0.0);
    feed(30);
    EXPECT_TRUE(state("x").moving);
    awaitRest();
    EXPECT_FALSE(machine().result(move_));
    feed(40);
    const CoordinatedResult result = machine().wait(move_);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  }

  // The longest time between two pulses of either axis, after the first and before the last [s].
  double longestPause() {
    std::vector<double> times;
    for (const std::string name : {"x", "y"}) {
      for (const auto& crossing : crossings(name)) times.push_back(crossing.time_ns * 1e-9);
    }
    std::sort(times.begin(), times.end());
    double longest = 0.0;
    for (std::size_t i = 1; i < times.size(); ++i) {
      longest = std::max(longest, times[i] - times[i - 1]);
    }
    return longest;
  }

  void expectOnPath(const PathRequest& path, double more = 0.05 * kMicrostep) {
    expectAtRest();
    EXPECT_LE(farthest(pulsePlaces(), corners(path)), path.tolerance + kHalfMicrosteps + more);
  }

  void expectLimits() {
    for (const std::string name : {"x", "y"}) {
      const test::Differences seen = differences(name, 0.004);
      EXPECT_LE(seen.speed, 0.1 / kMicrostep * 1.001) << name;
      EXPECT_LE(seen.acceleration, 1.0 / kMicrostep * 1.02) << name;
    }
  }

  PathRequest whole_;
  std::size_t fed_ = 0;
  CoordinatedMove move_;
};

PathRequest zigzag(std::size_t count) {
  PathRequest request{{"x", "y"}, {}, false, 0.0, 100e-6};
  std::mt19937 random(3);
  std::uniform_real_distribution<double> place(-0.02, 0.02);
  for (std::size_t i = 0; i < count; ++i) {
    request.segments.push_back(lineTo({place(random), place(random)}));
  }
  return request;
}

TEST_F(PathQueue, StaysOnThePathIfItIsFedWhileItSlowsDownForItsEnd) {
  // From 0.2 s on, it slows down.
  for (double after = 0.15; after < 0.305; after += 0.005) {
    SCOPED_TRACE(after);
    build({plotterAxis("x"), plotterAxis("y")});
    PathRequest path{{"x", "y"}, {}, false, 0.0, 500e-6};
    path.segments = {lineTo({0.02, 0.0}), lineTo({0.02, 0.02}), lineTo({0.0, 0.02})};
    begin(path, 1);
    advance(after);
    feed(2);
    const CoordinatedResult result = machine().wait(move_);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    expectOnPath(path);
    expectLimits();
    for (const std::string name : {"x", "y"}) EXPECT_LE(bench->pulses(name), 1600) << name;
  }
}

TEST_F(PathQueue, FollowsACircleInPiecesAsFastAsInOneGo) {
  const double in_one_go = finish(test::circle()).duration;
  build({plotterAxis("x"), plotterAxis("y")});
  const CoordinatedResult result = feedInTime(test::circle(), 5, 0.2);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  // A thousandth of the limits is left for the plans from a speed.
  EXPECT_LE(result.duration, 1.002 * in_one_go);
  EXPECT_LE(longestPause(), 0.01) << "it stopped";
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 0);
  expectOnPath(test::circle());
  expectLimits();
}

// The roundings of many chords overlap where each plan begins. Those that have begun stay as they
// are, which costs about 3 ms at each of the nine appends.
TEST_F(PathQueue, FollowsDenseChordsInPieces) {
  PathRequest path{{"x", "y"}, {}, false, 0.0, kTolerance};
  double direction = 0.0;
  std::vector<double> place(2, 0.0);
  for (int i = 0; i < 600; ++i) {
    direction += 0.02 * std::sin(i / 50.0);
    place[0] += 1e-4 * std::cos(direction);
    place[1] += 1e-4 * std::sin(direction);
    path.segments.push_back(lineTo(place));
  }
  const double in_one_go = finish(path).duration;
  build({plotterAxis("x"), plotterAxis("y")});
  const CoordinatedResult result = feedInTime(path, 60, 0.3);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_LE(result.duration, 1.04 * in_one_go);
  EXPECT_LE(longestPause(), 0.01) << "it stopped";
  expectOnPath(path);
  expectLimits();
}

TEST_F(PathQueue, FollowsLinesCurvesAndCornersInPieces) {
  const double in_one_go = finish(test::mixed()).duration;
  build({plotterAxis("x"), plotterAxis("y")});
  const CoordinatedResult result = feedInTime(test::mixed(), 1, 0.15);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_LE(result.duration, 1.002 * in_one_go);
  EXPECT_NEAR(result.positions[0], -0.010, kMicrostep / 2.0);
  EXPECT_NEAR(result.positions[1], 0.010, kMicrostep / 2.0);
  expectAtRest();
  expectLimits();
}

TEST_F(PathQueue, OfRandomLinesKeepsLimitsAndTolerance) {
  const double in_one_go = finish(zigzag(60)).duration;
  build({plotterAxis("x"), plotterAxis("y")});
  const CoordinatedResult result = feedInTime(zigzag(60), 2, 1.0);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_LE(result.duration, 1.002 * in_one_go);
  expectOnPath(zigzag(60));
  expectLimits();
}

// Appends come when the axes already slow down for the end: some corners are rounded less.
TEST_F(PathQueue, IsFedAtTheLastMoment) {
  for (const double least : {0.05, 0.03}) {
    build({plotterAxis("x"), plotterAxis("y")});
    const CoordinatedResult result = feedInTime(zigzag(60), 1, least);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    expectOnPath(zigzag(60));
    expectLimits();
  }
}

TEST_F(PathQueue, RestsOnThePathWhileItIsStarvedAndContinues) {
  starveTwice(test::circle());
  EXPECT_EQ(bench->pulses("x"), 0);
  expectOnPath(whole_);
  expectLimits();
}

TEST_F(PathQueue, IsFedWhileItSlowsDownToItsEnd) {
  PathRequest path{{"x", "y"}, {lineTo({0.03, 0.0}), lineTo({0.06, 0.0})}, false, 0.0, kTolerance};
  begin(path, 1);
  // 30 mm at 100 mm/s: the axes slow down from 0.3 to 0.4 s.
  advance(0.36);
  const double slow = state("x").velocity;
  EXPECT_LT(slow, 0.06);
  feed(1);
  advance(0.05);
  EXPECT_GT(state("x").velocity, slow - 0.021) << "20 ms ahead nothing changes";
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  expectOnPath(path);
  expectLimits();
}

TEST_F(PathQueue, EndsOnlyWhenItIsTold) {
  begin(test::circle(), 20);
  awaitRest();
  advance(0.5);
  EXPECT_FALSE(machine().result(move_));
  const PathAhead end = append({}, false);
  EXPECT_FALSE(end.more_follows);
  const auto result = machine().result(move_);
  ASSERT_TRUE(result);
  EXPECT_EQ(result->end, MoveEnd::kReached) << result->message;
  EXPECT_REFUSED(append({lineTo({0.0, 0.0})}), "doesn't continue: it has ended");
}

TEST_F(PathQueue, CanBeToldItsEndWhileItMoves) {
  begin(test::circle(), 20);
  advance(0.1);
  append({}, false);
  EXPECT_REFUSED(append({lineTo({0.0, 0.0})}), "the path is complete");
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
}

TEST_F(PathQueue, ContinuesFromBetweenTwoMicrosteps) {
  PathRequest path{{"x", "y"}, {}, true, 0.0, kTolerance};
  for (int i = 1; i <= 6; ++i) {
    path.segments.push_back(lineTo({i * (0.002 + kMicrostep / 3.0), i * 0.001}));
  }
  begin(path, 1);
  for (int i = 1; i < 6; ++i) {
    awaitRest();
    feed(1);
  }
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 6 * 160 + 2);
  expectOnPath(path);
  expectLimits();
}

TEST_F(PathQueue, IsHeldFedAndResumed) {
  const PathRequest path = test::circle();
  begin(path, 40);
  advance(0.3);
  machine().hold();
  feed(20);  // while it decelerates
  awaitRest();
  advance(0.1);
  feed(20);  // at rest
  EXPECT_FALSE(state("x").moving) << "fed during a hold";
  machine().resume();
  advance(0.01);
  feed(20);
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 0);
  expectOnPath(path);
  expectLimits();
}

TEST_F(PathQueue, IsHeldWhileStarved) {
  const PathRequest path = test::circle();
  begin(path, 40);
  awaitRest();
  machine().hold();
  machine().resume();
  advance(0.1);
  EXPECT_FALSE(state("x").moving);
  machine().hold();
  feed(30);
  advance(0.1);
  EXPECT_FALSE(state("x").moving) << "fed during a hold";
  machine().resume();
  EXPECT_TRUE(state("x").moving);
  awaitRest();
  machine().hold();
  feed(30);
  append({}, false);
  machine().resume();
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  expectOnPath(path);
}

TEST_F(PathQueue, IsToldItsEndDuringAHold) {
  begin(test::circle(), 40);
  awaitRest();
  machine().hold();
  append({}, false);
  EXPECT_FALSE(machine().result(move_)) << "held";
  machine().resume();
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
}

// At rest a hold and a resume order nothing, whatever comes before and after them.
TEST_F(PathQueue, IsToldItsEndAfterAHoldAtRest) {
  for (const bool held_twice : {false, true}) {
    for (const bool fed_between : {false, true}) {
      for (const bool fed_after : {false, true}) {
        build({plotterAxis("x"), plotterAxis("y")});
        begin(test::circle(), 40);
        awaitRest();
        machine().hold();
        if (fed_between) feed(20);
        machine().resume();
        if (held_twice) {
          machine().hold();
          machine().resume();
        }
        if (fed_after) feed(20);
        append({}, false);
        EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
        bench->axis("x").setPosition(0.0);
      }
    }
  }
}

// Nothing waits for the path any more: its axes may be given positions, and idle.
TEST_F(PathQueue, LeavesItsAxesIdleIfItWasToldItsEndAfterAHoldAtRest) {
  std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
  for (config::AxisConfig& axis : axes) axis.idle_timeout = 2.0;
  build(axes);
  begin(test::circle(), 40);
  awaitRest();
  machine().hold();
  machine().resume();
  append({}, false);
  const auto result = machine().result(move_);
  ASSERT_TRUE(result) << "it never ends";
  EXPECT_EQ(result->end, MoveEnd::kReached) << result->message;
  for (const std::string name : {"x", "y"}) bench->axis(name).setPosition(0.0);
  advance(1.9);
  for (const std::string name : {"x", "y"}) EXPECT_FALSE(state(name).idle) << name;
  advance(0.2);
  for (const std::string name : {"x", "y"}) EXPECT_TRUE(state(name).idle) << name;
}

// The hold slows down without a jerk limit, and the rate had to be kept from falling to 0 within
// one.
TEST_F(PathQueue, ContinuesSoonIfItIsResumedWhileItSlowsDownAndHasALowerJerkLimit) {
  for (int i = 1; i < 10; ++i) {
    build({plotterAxis("x"), plotterAxis("y")});
    axis::AxisLimits smooth;
    smooth.jerk = 5.0;
    bench->axis("y").setLimits(smooth);
    begin(test::circle(), 100);
    advance(0.1 * i);
    machine().hold();
    advance(0.001);
    machine().resume();
    append({}, false);
    const CoordinatedResult result = machine().wait(move_);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    EXPECT_LT(result.duration, 10.0) << "held after " << 0.1 * i << " s";
  }
}

TEST_F(PathQueue, RunsMoreSlowlyAtASpeedOverride) {
  const PathRequest path = test::circle();
  machine().setSpeedOverride(0.5);
  begin(path, 20);
  advance(0.2);
  feed(20);
  machine().setSpeedOverride(0.25);
  feed(20);
  advance(0.2);
  machine().setSpeedOverride(1.5);
  feed(40);
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  expectOnPath(path);
  expectLimits();
}

// Whatever ends a path also ends one that is fed, in motion and while it waits.
TEST_F(PathQueue, EndsWithEverythingThatEndsAPath) {
  struct Ending {
    const char* name;
    std::function<void()> end;
    MoveEnd how;
    const char* why;  // the reason by which an append is refused
  };
  const std::vector<Ending> endings = {
      {"stop", [this] { machine().stop(); }, MoveEnd::kStopped, "it was stopped"},
      {"stop y", [this] { bench->axis("y").stop(); }, MoveEnd::kStopped, "it was stopped"},
      {"cancel", [this] { machine().stop(move_); }, MoveEnd::kStopped, "it was stopped"},
      {"disable y", [this] { bench->axis("y").enable(false); }, MoveEnd::kStopped, "disabled"},
      {"emergency stop", [this] { machine().emergencyStop(); }, MoveEnd::kEmergencyStop,
       "emergency stop"},
      {"a move of y", [this] { bench->axis("y").moveTo(0.0); }, MoveEnd::kStopped,
       "y, which it moved together with, was given another goal"},
      {"a move of x", [this] { bench->axis("x").moveTo(0.0); }, MoveEnd::kReplaced,
       "a move to 0 m took over"},
  };
  for (const bool starved : {false, true}) {
    for (const Ending& ending : endings) {
      SCOPED_TRACE(std::string(ending.name) + (starved ? " while starved" : ""));
      build({plotterAxis("x"), plotterAxis("y")});
      begin(test::circle(), 20);
      if (starved) awaitRest();
      if (!starved) {
        advance(0.15);
        feed(20);
      }
      ending.end();
      const CoordinatedResult result = machine().wait(move_);
      if (ending.how == MoveEnd::kReplaced) {
        EXPECT_NE(result.end, MoveEnd::kReached) << result.message;
      } else {
        EXPECT_EQ(result.end, ending.how) << result.message;
      }
      EXPECT_REFUSED(feed(20), "doesn't continue");
      awaitRest();
      EXPECT_REFUSED(append({}), ending.why);
      advance(0.2);
      const auto x = bench->pulses("x");
      EXPECT_REFUSED(feed(20), "doesn't continue");
      advance(0.2);
      EXPECT_EQ(bench->pulses("x"), x) << "it moved after its end";
      expectAtRest();
    }
  }
}

TEST_F(PathQueue, EndsAtAnEndstopOfOneOfItsAxes) {
  begin(test::circle(), 20);
  advance(0.15);
  feed(20);
  sim::RigFaults closed;
  closed.max_stuck = true;
  bench->rig.setFaults("y", closed);
  const CoordinatedResult result = machine().wait(move_);
  EXPECT_EQ(result.end, MoveEnd::kEndstopMax);
  EXPECT_NE(result.message.find("y stands at"), std::string::npos) << result.message;
  const auto x = bench->pulses("x");
  const auto why = "it moved together with y, which was stopped: the max endstop was met";
  EXPECT_REFUSED(feed(20), why);
  advance(0.5);
  EXPECT_EQ(bench->pulses("x"), x);
  EXPECT_REFUSED(append({}, false), why);
  // The next path begins from there.
  bench->rig.setFaults("y", {});
  EXPECT_EQ(finish({{"x", "y"}, {lineTo({0.0, 0.0})}}).end, MoveEnd::kReached);
  expectAtRest();
}

TEST_F(PathQueue, EndsAtAFaultOfOneOfItsAxesInMotionAndWhenItContinues) {
  for (const bool starved : {false, true}) {
    build({plotterAxis("x"), plotterAxis("y")});
    begin(test::circle(), 20);
    if (starved) {
      awaitRest();
    } else {
      advance(0.15);
    }
    bench->rig.failWrites("y.step", 0, EIO);
    feed(20);
    const CoordinatedResult result = machine().wait(move_);
    EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
    EXPECT_NE(result.message.find("y.step"), std::string::npos) << result.message;
    EXPECT_REFUSED(feed(20), "doesn't continue");
    const auto x = bench->pulses("x");
    advance(0.5);
    EXPECT_EQ(bench->pulses("x"), x);
    bench->rig.clearWriteFault("y.step");
    machine().recover();
    EXPECT_REFUSED(feed(20), "doesn't continue");
    advance(0.5);
    EXPECT_EQ(bench->pulses("x"), x) << "nothing of it is left after a recover";
  }
}

TEST_F(PathQueue, KeepsItsLimits) {
  begin(test::circle(), 20);
  advance(0.1);
  axis::AxisLimits slow;
  slow.max_speed = 0.02;
  slow.acceleration = slow.deceleration = 0.1;
  bench->axis("x").setLimits(slow);
  feed(80);
  const CoordinatedResult result = machine().wait(move_);
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_LE(result.duration, 1.40);
}

TEST_F(PathQueue, TakesUpTheBacklashOnTheWay) {
  std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
  for (config::AxisConfig& axis : axes) axis.backlash = 0.0001;
  build(axes);
  const double in_one_go = finish(test::circle()).duration;
  build(axes);
  const CoordinatedResult result = feedInTime(test::circle(), 5, 0.2);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.positions[0], 0.0, 1e-12);
  EXPECT_NEAR(result.positions[1], 0.0, 1e-12);
  EXPECT_EQ(bench->pulses("x"), 8);
  EXPECT_LE(result.duration, 1.002 * in_one_go);
  expectLimits();

  build(axes);
  finish(zigzag(40));
  build(axes);
  begin(zigzag(40), 1);
  for (int i = 1; i < 40; ++i) {
    if (i % 3 == 0) awaitRest();
    advance(0.02);
    feed(1);
  }
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  expectLimits();
}

// The last moment of taking up a backlash isn't a place from which the path continues: to end it
// within the first microseconds takes a high acceleration, which each later hold would use.
TEST_F(PathQueue, IsHeldWithinItsLimitsAfterASegmentWasAppendedWhileABacklashIsTakenUp) {
  PathSegment up = lineTo({0.68835923516457091e-3, 1.7531101682292075e-3});
  up.tolerance = 0.3e-3;
  PathSegment arc = test::arcTo({0.69652329824513182e-3, 2.5190951565047682e-3},
                                {-0.31437368871761132e-3, 2.1468335525702356e-3});
  arc.tolerance = 0.1e-3;
  PathSegment down = lineTo({0.60566351280819629e-3, 2.1676220955868827e-3});
  down.shape = PathSegment::Shape::kBezier;
  down.control1 = {0.62030201263759679e-3, 2.7260782757647243e-3};
  down.control2 = {0.72405833233903137e-3, 2.2337036715164437e-3};
  for (int held_after = 20; held_after < 150; held_after += 5) {
    SCOPED_TRACE(held_after);
    std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
    axes[1].backlash = 6 * kMicrostep;
    build(axes);
    PathRequest request{{"x", "y"}, {up, arc, down}, false, 0.0, 0.0, true};
    const CoordinatedMove move = followPath(request);
    advance(0.005);
    machine().appendPath({move.id(), {lineTo({3.2427e-3, 0.8661e-3})}, false});
    advance(1e-3 * held_after - 0.005);
    machine().hold();
    advance(0.3);
    EXPECT_EQ(test::violationsOf(bench->report("y")), "");
    machine().resume();
    EXPECT_EQ(machine().wait(move).end, axis::MoveEnd::kReached);
  }
}

// y has a backlash of 1.25 mm, and comes back by less so fast that the joint hasn't followed when
// the path turns again: it still stands at the first turn while x moves on. It must be brought to
// the end that is appended.
TEST_F(PathQueue, EndsAtItsEndIfItWasAppendedToWhileTheJointLagsBehindAShortTurn) {
  std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
  axes[1].backlash = 100 * kMicrostep;
  for (const double velocity : {0.002, 0.005, 0.01}) {
    for (const double down : {0.05e-3, 0.1e-3, 0.2e-3, 0.3e-3}) {
      SCOPED_TRACE(testing::Message() << "down by " << down << " at " << velocity);
      build(axes);
      constexpr double kTop = 12.5e-3;
      PathRequest request{{"x", "y"}, {}, false, velocity, 0.0, true};
      request.segments = {lineTo({0.0, kTop}), lineTo({0.0, kTop - down}),
                          lineTo({5e-3, kTop - 0.8 * down})};
      const CoordinatedMove move = followPath(request);
      while (state("x").position < 1e-3) advance(0.01);
      const double end = kTop - 0.6 * down;
      machine().appendPath({move.id(), {lineTo({10e-3, end})}, false});
      EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
      EXPECT_NEAR(state("y").position, end, 0.51 * kMicrostep);
    }
  }
}

TEST_F(PathQueue, BeginsContinuesAndEndsWithDoubledPoints) {
  PathRequest path{{"x", "y"}, {}, false, 0.0, test::kTolerance};
  for (const double x : {0.0, 0.010, 0.010, 0.0, 0.0}) path.segments.push_back(lineTo({x, 0.0}));
  begin(path, 1);
  advance(0.1);
  for (int i = 1; i < 5; ++i) {
    feed(1);
    advance(0.5);
  }
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(PathQueue, RefusesAWrongSegmentAndGoesOn) {
  const PathRequest path = test::circle();
  begin(path, 20);
  advance(0.1);
  const auto end = path.segments[19].end;
  EXPECT_REFUSED(append({lineTo({0.0, 0.01}), lineTo({0.0, kNan})}),
                 "y: segment 1 of the path has nan among its positions");
  EXPECT_REFUSED(append({lineTo({0.0, 0.01}), lineTo({0.0, -0.2})}),
                 "y: segment 1 of the path at -0.2 m is below the soft limit");
  EXPECT_REFUSED(append({lineTo({0.0})}), "segment 0 of the path has 1 positions, but must have 2");
  EXPECT_REFUSED(append(std::vector<PathSegment>(1'000'000, lineTo({0.0, 0.0}))),
                 "1000000 segments are too many");
  PathSegment cusp = lineTo({end[0] + 0.01, end[1]});
  cusp.shape = PathSegment::Shape::kBezier;
  cusp.control1 = {end[0] + 0.01, end[1] + 0.01};
  cusp.control2 = {end[0], end[1] + 0.01};
  EXPECT_REFUSED(append({cusp}), "segment 0 is a Bezier with a cusp");
  EXPECT_REFUSED(machine().appendPath({move_.id() + 1000, {}, true}), "doesn't continue");
  feed(80);
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  expectOnPath(path);
}

TEST_F(PathQueue, IsOnlyForPathsThatSayThatMoreFollows) {
  PathRequest path = test::circle();
  move_ = followPath(path);
  EXPECT_REFUSED(append({lineTo({0.0, 0.01})}), "the path is complete");
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
}

// With a jerk limit: y has the lower one.
class SmoothPathQueue : public PathQueue {
 protected:
  static constexpr double kJerkX = 20.0;  // m/s^3
  static constexpr double kJerkY = 10.0;

  void SetUp() override { buildSmooth(); }

  void buildSmooth(double backlash = 0.0) {
    std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
    axes[0].jerk = kJerkX;
    axes[1].jerk = kJerkY;
    for (config::AxisConfig& axis : axes) axis.backlash = backlash;
    build(axes);
  }

  /// [s] A path that is fed is planned as a moving average, which is slower than the optimum: what
  /// is fed in pieces is compared with the same path as one piece.
  double inOneGo(const PathRequest& path) {
    begin(path, path.segments.size());
    feed(0);
    return machine().wait(move_).duration;
  }

  // The cubics of the motion differ from its quintics by up to 0.01 microsteps, and on an arc these
  // differ from it.
  void expectSmooth() {
    expectLimits();
    constexpr double kApart = 0.02;  // s
    const double rounding = 8.0 * 0.03 / (kApart * kApart * kApart);
    EXPECT_LE(differences("x", kApart).jerk, kJerkX / kMicrostep + rounding);
    EXPECT_LE(differences("y", kApart).jerk, kJerkY / kMicrostep + rounding);
  }
};

// With 0.5 s ahead, some pieces come when the axes already slow down for the end of the one before.
// Which ones do depends on the last bits of the circle: of circles that differ by 1e-7, one at a
// time takes 1.16 times as long in the mean, with a standard deviation of 0.06. The mean of nine
// has one of 0.02.
TEST_F(SmoothPathQueue, FollowsACircleInPiecesNearlyAsFastAsInOneGo) {
  constexpr int kCircles = 9;
  const double in_one_go = inOneGo(test::circle());
  for (const std::size_t piece : {1U, 5U, 20U}) {
    SCOPED_TRACE(std::to_string(piece) + " at a time");
    double mean = 0.0;
    for (int i = 0; i < kCircles; ++i) {
      PathRequest circle = test::circle();
      for (PathSegment& segment : circle.segments) {
        for (double& place : segment.end) place *= 1.0 + 1e-7 * i;
      }
      buildSmooth();
      const CoordinatedResult result = feedInTime(circle, piece, 0.7);
      EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
      mean += result.duration / kCircles;
      // Some of these circles nearly stop: their pauses are up to 0.03 s.
      EXPECT_LE(longestPause(), 0.05) << "it stopped";
      EXPECT_EQ(bench->pulses("x"), 0);
      EXPECT_EQ(bench->pulses("y"), 0);
      expectOnPath(circle);
      expectSmooth();
    }
    EXPECT_LE(mean, 1.2 * in_one_go);
  }
}

TEST_F(SmoothPathQueue, FollowsLinesCurvesAndCornersInPieces) {
  const double in_one_go = inOneGo(test::mixed());
  buildSmooth();
  const CoordinatedResult result = feedInTime(test::mixed(), 1, 0.3);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_LE(result.duration, 1.02 * in_one_go);
  EXPECT_NEAR(result.positions[0], -0.010, kMicrostep / 2.0);
  EXPECT_NEAR(result.positions[1], 0.010, kMicrostep / 2.0);
  expectAtRest();
  expectSmooth();
}

TEST_F(SmoothPathQueue, OfRandomLinesKeepsLimitsAndTolerance) {
  const double in_one_go = inOneGo(zigzag(60));
  for (const double least : {1.0, 0.1, 0.05}) {
    SCOPED_TRACE(std::to_string(least) + " s ahead");
    buildSmooth();
    const CoordinatedResult result = feedInTime(zigzag(60), 2, least);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    if (least == 1.0) {
      EXPECT_LE(result.duration, 1.02 * in_one_go);
    }
    expectOnPath(zigzag(60));
    expectSmooth();
  }
}

TEST_F(SmoothPathQueue, RestsOnThePathWhileItIsStarvedAndContinues) {
  starveTwice(test::circle());
  EXPECT_EQ(bench->pulses("x"), 0);
  expectOnPath(whole_);
  expectSmooth();
}

// On a straight line that is continued, the axes don't stop.
TEST_F(SmoothPathQueue, IsFedBeforeItSlowsDownToItsEnd) {
  PathRequest path{{"x", "y"}, {lineTo({0.03, 0.0}), lineTo({0.06, 0.0})}, false, 0.0, kTolerance};
  begin(path, 1);
  // 30 mm at 100 mm/s: the axes slow down from 0.3 to 0.45 s.
  advance(0.25);
  feed(1);
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  EXPECT_LE(longestPause(), 0.02);
  expectOnPath(path);
  expectSmooth();
  // 60 mm at 100 mm/s, 0.1 s of acceleration and 0.05 s until that is reached.
  EXPECT_NEAR(machine().result(move_)->duration, 0.75, 0.001);
}

TEST_F(SmoothPathQueue, IsHeldFedResumedAndSlowedDown) {
  const PathRequest path = test::circle();
  begin(path, 40);
  advance(0.3);
  machine().hold();
  feed(20);  // while it decelerates
  awaitRest();
  advance(0.1);
  feed(10);  // at rest
  EXPECT_FALSE(state("x").moving) << "fed during a hold";
  machine().resume();
  advance(0.01);
  machine().setSpeedOverride(0.5);
  feed(10);
  advance(0.2);
  machine().setSpeedOverride(1.0);
  feed(20);
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 0);
  expectOnPath(path);
  expectLimits();
}

TEST_F(SmoothPathQueue, StopsAsOtherPathsDo) {
  begin(test::circle(), 20);
  advance(0.15);
  feed(20);
  machine().stop();
  EXPECT_EQ(machine().wait(move_).end, MoveEnd::kStopped);
  EXPECT_REFUSED(feed(20), "doesn't continue");
  awaitRest();
  const auto x = bench->pulses("x");
  advance(0.2);
  EXPECT_EQ(bench->pulses("x"), x) << "it moved after its end";
  expectOnPath(test::circle());
  expectLimits();
}

TEST_F(SmoothPathQueue, TakesUpTheBacklashOnTheWay) {
  buildSmooth(0.0001);
  const double in_one_go = inOneGo(test::circle());
  buildSmooth(0.0001);
  const CoordinatedResult result = feedInTime(test::circle(), 5, 0.5);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), 8);
  EXPECT_LE(result.duration, 1.1 * in_one_go);
  expectSmooth();
}

TEST_F(PathQueue, TellsWhatLiesAhead) {
  PathRequest path{{"x", "y"}, {}, false, 0.01, kTolerance};
  for (int i = 1; i <= 10; ++i) path.segments.push_back(lineTo({i * 0.001, 0.0}));
  begin(path, 5);
  PathAhead now = ahead();
  EXPECT_EQ(now.segments, 5U);
  EXPECT_EQ(now.room, motion::kMostPathSegments - 5);
  EXPECT_NEAR(now.time, 0.51, 0.002);
  EXPECT_TRUE(now.more_follows);
  EXPECT_EQ(now.targets, (std::vector<double>{0.005, 0.0}));
  advance(0.255);
  EXPECT_EQ(ahead().segments, 3U);
  now = feed(5);
  EXPECT_EQ(now.segments, 8U);
  EXPECT_FALSE(now.more_follows);
  EXPECT_EQ(machine().wait(move_).positions[0], 0.01);
}

TEST_F(PathQueue, IsFull) {
  PathRequest path{{"x", "y"}, {}, false, 0.01, kTolerance};
  for (int i = 1; i <= 30'000; ++i) path.segments.push_back(lineTo({i % 2 * 0.001, i * 1e-6}));
  begin(path, 19'000);
  EXPECT_REFUSED(feed(1500),
                 "1500 segments are too many: 19000 lie ahead of the axes, and there "
                 "is room for 1000 more");
  machine().stop();
}

}  // namespace
}  // namespace stepdriver
