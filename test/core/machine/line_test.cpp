#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/refusal.h"

// Straight lines of several axes. In steps: x has 1000 steps/m, y 500, c 100 steps/rad.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::CoordinatedMove;
using machine::CoordinatedResult;
using test::Bench;
using test::linearAxis;
using test::refusal;
using test::violationsOf;

config::AxisConfig axisOf(const std::string& name, double scale, double speed,
                          double acceleration) {
  config::AxisConfig config = linearAxis(name, scale, speed, acceleration);
  config.endstop_min.reset();
  return config;
}

class Line : public testing::Test {
 protected:
  void SetUp() override {
    std::vector<config::AxisConfig> axes{axisOf("x", 1000.0, 1.0, 2.0),
                                         axisOf("y", 500.0, 1.0, 4.0),
                                         axisOf("c", 100.0, 10.0, 20.0)};
    axes[2].kind = config::Kind::kRotary;
    build(axes);
  }

  void build(const std::vector<config::AxisConfig>& axes) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    make(axes, specs);
  }

  void make(const std::vector<config::AxisConfig>& axes,
            const std::vector<sim::RigAxisSpec>& specs) {
    bench = std::make_unique<Bench>(axes, specs);
    for (const auto& axis : machine().axes()) axis->setPosition(0.0);
  }

  test::UnthreadedMachine& machine() { return *bench->machine; }
  CoordinatedMove start(const motion::LineRequest& request) { return machine().moveLine(request); }
  double position(const std::string& name) { return bench->axis(name).state().position; }
  void advance(double seconds) { machine().advance(seconds); }
  void awaitRest() {
    for (const auto& axis : machine().axes()) {
      while (axis->state().moving) advance(1e-4);
    }
  }
  // Each axis may be at most half a step off the line through the origin.
  void expectOnTheLine(double x, double y) {
    const double along = std::hypot(x, y);
    const double off = (position("x") * y - position("y") * x) / along;
    EXPECT_LE(std::abs(off), 0.5 * (1.0 / 1000.0 + 1.0 / 500.0));
  }
  void expectClean() {
    for (const auto& axis : machine().axes()) {
      const std::string& name = axis->config().name;
      EXPECT_EQ(violationsOf(bench->report(name)), "") << name;
      const double count = static_cast<double>(bench->pulses(name));
      EXPECT_NEAR(position(name), count / axis->config().steps_per_unit, 1e-12) << name;
    }
    EXPECT_EQ(machine().figures().slips, 0U);
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(Line, IsAsFastAsTheAxisThatLimitsIt) {
  // x takes 1/1 + 1/2 = 1.5 s for 1 m; y moves half as far with half the acceleration of x.
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.5}});
  EXPECT_NEAR(move.duration, 1.5, 1e-9);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.positions, (std::vector<double>{1.0, 0.5}));
  EXPECT_EQ(bench->pulses("x"), 1000);
  EXPECT_EQ(bench->pulses("y"), 250);
  expectClean();
}

TEST_F(Line, IsHeldToTheSmallestAccelerationAlongIt) {
  // y needs 3 + 0.25 s for 3 m with 4 m/s^2 and 1 m/s; x would need less.
  EXPECT_NEAR(start({{"x", "y"}, {-0.1, 3.0}}).duration, 3.25, 1e-9);
}

TEST_F(Line, PutsEachAxisOutAtItsOwnExactCrossings) {
  machine().wait(start({{"x", "y"}, {1.0, -0.7}}));
  // While the path accelerates at a, step k of axis i is at sqrt(2 (k - 1/2)/(a n_i/n)).
  const std::vector<std::int64_t> x = bench->trace->times("x", "step", true);
  const std::vector<std::int64_t> y = bench->trace->times("y", "step", true);
  ASSERT_EQ(x.size(), 1000U);
  ASSERT_EQ(y.size(), 350U);
  const auto since = [&](std::size_t k, double acceleration) {
    return std::sqrt((2.0 * static_cast<double>(k) + 1.0) / acceleration);
  };
  const double begin = static_cast<double>(x[0]) * 1e-9 - since(0, 2000.0);
  for (std::size_t k = 0; k < 249; ++k) {
    EXPECT_NEAR(static_cast<double>(x[k]) * 1e-9, begin + since(k, 2000.0), 2e-9) << k;
  }
  for (std::size_t k = 0; k < 80; ++k) {
    EXPECT_NEAR(static_cast<double>(y[k]) * 1e-9, begin + since(k, 700.0), 2e-9) << k;
  }
  // They end within one step of each other, by symmetry with their beginning.
  EXPECT_LT(std::abs(x.back() - y.back()), y[1] - y[0]);
  expectClean();
}

TEST_F(Line, RunsAtAVelocityAlongThePath) {
  // 3 and 4 m: 5 m at 0.5 m/s. The velocity is that of the linear axes; rotary axes move in
  // proportion.
  const CoordinatedMove move = start({{"x", "y", "c"}, {3.0, 4.0, 1.0}, false, 0.5});
  advance(5.0);
  EXPECT_NEAR(bench->axis("x").state().velocity, 0.3, 1e-9);
  EXPECT_NEAR(bench->axis("y").state().velocity, 0.4, 1e-9);
  EXPECT_NEAR(bench->axis("c").state().velocity, 0.1, 1e-9);
  machine().wait(move);
  expectClean();
}

TEST_F(Line, OfRotaryAxesOnlyTakesItsVelocityInRadians) {
  start({{"c"}, {6.0}, false, 2.0});
  advance(1.5);
  EXPECT_NEAR(bench->axis("c").state().velocity, 2.0, 1e-9);
}

TEST_F(Line, TakesTheTimeThatItIsGiven) {
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.5}, false, 0.0, 7.5});
  EXPECT_NEAR(move.duration, 7.5, 1e-9);
  EXPECT_NEAR(machine().wait(move).duration, 7.5, 1e-6);
  const std::string why = refusal([&] { start({{"x", "y"}, {0.0, 0.0}, false, 0.0, 1.4}); });
  EXPECT_EQ(why, "x: the target can't be reached in 1.4 s; the limits of the axes allow 1.5 s");
}

TEST_F(Line, SaysItsDurationWithoutTheRoundingOfNanoseconds) {
  const CoordinatedMove move = start({{"x"}, {0.9}});
  EXPECT_EQ(move.duration, 1.4);
  EXPECT_EQ(machine().wait(move).duration, 1.4);
}

TEST_F(Line, RefusesAVelocityAboveItsLimitsInItsDirection) {
  // x may move at 1 m/s, so 3 and 4 m: 5/3 m/s.
  EXPECT_EQ(refusal([&] { start({{"x", "y"}, {3.0, 4.0}, false, 1.25}); }), "");
  machine().stop();
  awaitRest();
  machine().axis("x").wait(machine().axis("x").moveTo(0.0));
  machine().axis("y").wait(machine().axis("y").moveTo(0.0));
  EXPECT_EQ(refusal([&] {
              start({{"x", "y"}, {3.0, 4.0}, false, 1.3});
            }),
            "x: the velocity 1.3 m/s of the line is above the 1.25 m/s that the limits of its axes "
            "allow in its direction");
  EXPECT_EQ(position("x"), 0.0);
  EXPECT_EQ(position("y"), 0.0);
}

TEST_F(Line, RefusesAVelocityThatItsAxesNeverReachWithoutStoppingThem) {
  const axis::Move move = bench->axis("x").moveTo(0.5);
  advance(0.2);
  const std::string why = refusal([&] { start({{"x", "y"}, {3.0, 4.0}, false, 50.0}); });
  EXPECT_NE(why.find("x: the velocity 50 m/s of the line is above 1.41421 m/s, the highest "),
            std::string::npos)
      << why;
  EXPECT_EQ(bench->axis("x").wait(move).end, MoveEnd::kReached);
}

TEST_F(Line, GivesABoundThatItAccepts) {
  // x may move at 1 m/s, so 1 and 0.666 m: 1.2014799... m/s.
  const std::string why = refusal([&] { start({{"x", "y"}, {1.0, 2.0 / 3.0}, false, 1.3}); });
  EXPECT_EQ(why,
            "x: the velocity 1.3 m/s of the line is above the 1.20148 m/s that the limits of its "
            "axes allow in its direction");
  EXPECT_EQ(refusal([&] { start({{"x", "y"}, {1.0, 2.0 / 3.0}, false, 1.20148}); }), "");
}

TEST_F(Line, RefusesBeforeItsBacklashIsTakenUp) {
  std::vector<config::AxisConfig> axes{axisOf("x", 1000.0, 1.0, 2.0), axisOf("y", 1000.0, 1.0, 2.0),
                                       axisOf("c", 1000.0, 1.0, 2.0)};
  axes[1].backlash = 0.01;
  build(axes);
  EXPECT_NE(refusal([&] { start({{"x", "y"}, {1.0, 0.5}, false, 0.0, 0.1}); }), "");
  advance(1.0);
  EXPECT_EQ(bench->pulses("y"), 0);
}

TEST_F(Line, StopsAllOfItsAxesAlongThePath) {
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
  advance(0.8);
  bench->axis("y").stop();
  awaitRest();
  expectOnTheLine(1.0, 0.7);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kStopped);
  // 0.8 s minus the lead: 0.549 m, and 0.25 m to stop.
  EXPECT_NEAR(position("x"), 0.80, 0.003);
  EXPECT_TRUE(bench->axis("x").state().position_valid);
  EXPECT_TRUE(bench->axis("y").state().position_valid);
  expectClean();
}

TEST_F(Line, AStopOfItLeavesTheOneThatReplacedItAlone) {
  const CoordinatedMove older = start({{"x", "y"}, {1.0, 0.7}});
  advance(0.8);
  const CoordinatedMove newer = start({{"x", "y"}, {0.2, 0.1}});
  machine().stop(older);
  EXPECT_EQ(machine().wait(newer).end, MoveEnd::kReached);
  EXPECT_NEAR(position("y"), 0.1, 1e-12);

  const CoordinatedMove stopped = start({{"x", "y"}, {1.2, 0.8}});
  advance(0.8);
  machine().stop(stopped);
  EXPECT_EQ(machine().wait(stopped).end, MoveEnd::kStopped);
  EXPECT_LT(position("y"), 0.7);
  expectClean();
}

TEST_F(Line, IsHeldAndGoesOnWithoutLeavingIt) {
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
  advance(0.6);
  machine().hold();
  awaitRest();
  EXPECT_TRUE(bench->axis("x").state().held);
  EXPECT_TRUE(bench->axis("y").state().held);
  EXPECT_NEAR(bench->axis("x").state().target, 1.0, 1e-12);
  expectOnTheLine(1.0, 0.7);
  EXPECT_FALSE(machine().result(move).has_value());
  EXPECT_EQ(refusal([&] { bench->axis("x").moveTo(0.0); }),
            "x: the machine is on hold; resume or stop it first");
  advance(2.0);
  machine().resume();
  advance(0.3);
  expectOnTheLine(1.0, 0.7);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(bench->pulses("x"), 1000);
  EXPECT_EQ(bench->pulses("y"), 350);
  EXPECT_FALSE(bench->axis("x").state().held);
  expectClean();
}

TEST_F(Line, SaysOnceWhyItCannotGoOn) {
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
  advance(0.6);
  machine().hold();
  awaitRest();
  sim::RigFaults faults;
  faults.max_stuck = true;
  bench->rig.setFaults("y", faults);
  try {
    machine().resume();
    ADD_FAILURE() << "it goes on into the switch";
  } catch (const Error& error) {
    EXPECT_STREQ(error.what(), "y: the max endstop is active; it moves only towards min");
  }
  bench->rig.setFaults("y", {});
  machine().resume();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  expectClean();
}

TEST_F(Line, ResumesWhileItStillSlowsDown) {
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
  advance(0.7);
  machine().hold();
  advance(0.1);
  machine().resume();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  expectClean();
}

TEST_F(Line, GivesUpWhatIsHeldAtAStopADisableAndAnEmergencyStop) {
  for (int how = 0; how < 3; ++how) {
    SCOPED_TRACE(how);
    SetUp();
    const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
    advance(0.6);
    machine().hold();
    awaitRest();
    if (how == 0) machine().stop();
    if (how == 1) bench->axis("x").enable(false);
    if (how == 2) machine().emergencyStop();
    const CoordinatedResult result = machine().wait(move);
    EXPECT_EQ(result.end, how == 2 ? MoveEnd::kEmergencyStop : MoveEnd::kStopped) << result.message;
    // Only a stop of the machine ends the hold; after the others there is nothing to resume.
    EXPECT_EQ(bench->axis("x").state().held, how != 0);
    EXPECT_EQ(bench->axis("y").state().held, how != 0);
    const std::int64_t before = bench->pulses("x");
    if (how == 2) machine().recover();
    machine().resume();
    advance(1.0);
    EXPECT_EQ(bench->pulses("x"), before);
  }
}

TEST_F(Line, EndsAtOnceForAllWhereOneMeetsItsEndstop) {
  std::vector<config::AxisConfig> axes{axisOf("x", 1000.0, 1.0, 2.0), axisOf("y", 500.0, 1.0, 4.0)};
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
  specs[0].max_switch->position = 100'000.0;
  specs[1].max_switch->position = 300.0;  // mm
  make(axes, specs);
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kEndstopMax);
  EXPECT_NE(result.message.find("y stands at 0.3"), std::string::npos) << result.message;
  EXPECT_FALSE(bench->axis("x").state().moving);
  expectOnTheLine(1.0, 0.7);
  const auto x = bench->axis("x").result(move.members[0].move);
  EXPECT_EQ(x->end, MoveEnd::kCompanion);
  EXPECT_NE(x->message.find("it moved together with y, which was stopped"), std::string::npos)
      << x->message;
  EXPECT_FALSE(bench->axis("x").state().position_valid);
  expectClean();
}

// As after a homing, whose place is between two microsteps: all targets are in their middle.
TEST_F(Line, ReachesTargetsInTheMiddleOfTwoMicrosteps) {
  build({axisOf("x", 1000.0, 1.0, 2.0), axisOf("y", 500.0, 1.0, 4.0)});
  bench->axis("x").setPosition(0.0005);
  bench->axis("y").setPosition(-0.001);
  const auto expect_reached = [&](const CoordinatedMove& move, const std::string& what) {
    const CoordinatedResult result = machine().wait(move);
    EXPECT_EQ(result.end, MoveEnd::kReached) << what << ": " << result.message;
    for (std::size_t i = 0; i < move.members.size(); ++i) {
      EXPECT_NEAR(result.positions[i], move.members[i].move.rest, 1e-12) << what;
    }
  };
  for (const double target : {0.078, 0.079, 0.08, -0.013, -0.014, 0.001, 0.0, -0.001}) {
    const std::string what = "to " + std::to_string(target);
    expect_reached(start({{"x", "y"}, {target, 2.0 * target}}), "a line " + what);
    expect_reached(start({{"x", "y"}, {0.002, -0.004}, true}), "a relative line after " + what);
    motion::PathSegment segment;
    segment.end = {target, 2.0 * target};
    expect_reached(machine().followPath({{"x", "y"}, {segment}}), "a path " + what);
    expect_reached(machine().followTrajectory({{"x", "y"}, {{0.9, {0.01, 0.01}, {}, {}}}}),
                   "a trajectory before " + what);
    expect_reached(machine().followTrajectory({{"x", "y"},
                                               {{0.5, {0.5 * target, target}, {}, {}},
                                                {1.0, {target, 2.0 * target}, {}, {}}}}),
                   "a trajectory " + what);
    const axis::MoveResult result = bench->move(target + 0.001);
    EXPECT_EQ(result.end, MoveEnd::kReached) << "a move by a microstep: " << result.message;
  }
  for (const std::string name : {"x", "y"}) EXPECT_EQ(violationsOf(bench->report(name)), "");
}

// 0.001 steps/s are the lowest rate of any motion: of x 1e-6 m/s.
TEST_F(Line, RefusesAVelocityWithoutAStepInAQuarterOfAnHour) {
  for (const double velocity : {5e-324, 1e-300, 1e-12, 0.9e-6}) {
    EXPECT_REFUSED(start({{"x", "y"}, {1.0, 0.0}, false, velocity}),
                   "m/s of the line is below the lowest in its direction, 1e-06 m/s, at which the "
                   "axis with the most steps makes 0.001 steps/s");
    EXPECT_REFUSED(bench->axis("x").moveTo(1.0, false, velocity), "is below the lowest, 1e-06 m/s");
    EXPECT_REFUSED(bench->axis("x").plan(1.0, false, velocity), "is below the lowest, 1e-06 m/s");
    EXPECT_REFUSED(bench->axis("x").moveRounds(1.0, velocity), "is below the lowest, 1e-06 m/s");
    motion::PathSegment segment;
    segment.end = {1.0, 0.0};
    motion::PathRequest path{{"x", "y"}, {segment}, false, velocity};
    const std::string why = "m/s, but it must be 0, or at least 1e-06 m/s, which is 0.001 steps/s";
    EXPECT_REFUSED(machine().followPath(path), "segment 0 of the path has the velocity");
    EXPECT_REFUSED(machine().followPath(path), why);
    path.velocity = 0.0;
    path.segments.push_back(segment);
    path.segments.back().end = {1.0, 1.0};
    path.segments.back().velocity = velocity;
    EXPECT_REFUSED(machine().followPath(path), "segment 1 of the path has the velocity");
    EXPECT_REFUSED(machine().followPath(path), why);
  }
  machine().stop(start({{"x", "y"}, {1.0, 0.0}, false, 1e-6}));
  awaitRest();
  bench->axis("x").moveTo(1.0, false, 1e-6);
  bench->axis("x").stop();
  awaitRest();
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(Line, FollowsTheSpeedOverrideTogether) {
  const CoordinatedMove move = start({{"x", "y"}, {2.0, 1.4}});
  advance(0.7);
  machine().setSpeedOverride(0.25);
  advance(1.0);
  EXPECT_NEAR(bench->axis("x").state().velocity, 0.25, 1e-9);
  EXPECT_NEAR(bench->axis("y").state().velocity, 0.175, 1e-9);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  expectClean();
}

TEST_F(Line, LetsTheOthersStopWhereOneIsGivenAnotherGoal) {
  const CoordinatedMove move = start({{"x", "y"}, {1.0, 0.7}});
  advance(0.7);
  const axis::Move other = bench->axis("x").moveTo(0.2);
  EXPECT_EQ(bench->axis("x").wait(other).end, MoveEnd::kReached);
  const auto y = bench->axis("y").result(move.members[1].move);
  ASSERT_TRUE(y.has_value());
  EXPECT_EQ(y->end, MoveEnd::kStopped);
  EXPECT_NE(y->message.find("x, which it moved together with, was given another goal"),
            std::string::npos)
      << y->message;
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReplaced);
  expectClean();
}

TEST_F(Line, WaitsForTheRestOfWhatMovesBefore) {
  const axis::Move move = bench->axis("x").moveTo(2.0);
  advance(0.8);
  const CoordinatedMove line = start({{"x", "y"}, {0.0, 1.0}});
  EXPECT_EQ(bench->axis("x").wait(move).end, MoveEnd::kStopped);
  EXPECT_EQ(machine().wait(line).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 0);
  expectClean();
}

// 2.0 m and the line's 0.5 m, although the move is stopped after 0.8 s.
TEST_F(Line, RelativeToAMoveUnderWayCountsFromWhereThatWasToEnd) {
  const axis::Move move = bench->axis("x").moveTo(2.0);
  advance(0.8);
  const CoordinatedMove line = start({{"x", "y"}, {0.5, 0.4}, true});
  EXPECT_EQ(bench->axis("x").wait(move).end, MoveEnd::kStopped);
  EXPECT_EQ(bench->pulses("y"), 0);
  EXPECT_EQ(machine().wait(line).positions, (std::vector<double>{2.5, 0.4}));
  EXPECT_EQ(bench->pulses("x"), 2500);
  EXPECT_EQ(bench->pulses("y"), 200);
  expectClean();
}

TEST_F(Line, RelativeToALineUnderWayCountsFromItsEnd) {
  start({{"x", "y"}, {1.0, 0.7}});
  advance(0.6);
  const CoordinatedMove line = start({{"x", "y"}, {0.5, -0.7}, true});
  EXPECT_EQ(machine().wait(line).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), 1500);
  EXPECT_EQ(bench->pulses("y"), 0);
  expectClean();
}

TEST_F(Line, RelativeToAStopUnderWayCountsFromWhereThatEnds) {
  bench->axis("x").moveTo(2.0);
  advance(1.0);  // 0.75 m at 1 m/s; the stop takes 0.25 m
  bench->axis("x").stop();
  const CoordinatedMove line = start({{"x", "y"}, {0.5, 0.4}, true});
  EXPECT_EQ(machine().wait(line).end, MoveEnd::kReached);
  EXPECT_NEAR(static_cast<double>(bench->pulses("x")), 1500.0, 5.0);
  EXPECT_EQ(bench->pulses("y"), 200);
  expectClean();
}

// Such a motion would be longer than one that can be planned.
TEST_F(Line, RefusesADurationOfDecades) {
  for (const double duration : {1e9 + 1.0, 3.9e9, 7.5e168, 1.7e308}) {
    EXPECT_REFUSED(start({{"x", "y"}, {0.5, 0.4}, false, 0.0, duration}),
                   "but must be at most 1000000000 s");
  }
  EXPECT_NEAR(start({{"x", "y"}, {0.5, 0.4}, false, 0.0, 1e9}).duration, 1e9, 1.0);
}

TEST_F(Line, RelativeToAJogWithoutAnEndIsRefused) {
  bench->axis("x").jog(0.5);
  advance(0.5);
  EXPECT_REFUSED(start({{"x", "y"}, {0.5, 0.4}, true}),
                 "x: busy: it jogs without an end; give an absolute position");
  advance(0.5);
  EXPECT_NEAR(bench->axis("x").state().velocity, 0.5, 1e-9) << "the jog goes on";
}

TEST_F(Line, RefusesWhatItCannotDoAndMovesNothing) {
  const auto refused = [&](const motion::LineRequest& request) {
    return refusal([&] { start(request); });
  };
  EXPECT_EQ(refused({{}, {}}), "no axis is named (axes: x, y, c)");
  EXPECT_EQ(refused({{"x", "q"}, {1.0, 1.0}}), "there is no axis q (axes: x, y, c)");
  EXPECT_EQ(refused({{"x", "x"}, {1.0, 1.0}}), "the axis x is named twice");
  EXPECT_EQ(refused({{"x", "y"}, {1.0}}), "there are 2 names, but 1 positions");
  EXPECT_EQ(refused({{"x", "y"}, {1.0, std::nan("")}}),
            "y: the position is nan m, but must be a finite number");
  EXPECT_EQ(
      refused({{"x", "y"}, {1.0, 1.0}, false, -1.0}),
      "x: the velocity of the line is -1, but must be a finite number above 0, or 0 for as fast as "
      "the limits allow");
  EXPECT_EQ(refused({{"x", "y"}, {1.0, 1.0}, false, 1.0, 1.0}),
            "x: the line has a velocity, 1, and a duration, 1 s; give only one of them");
  bench->axis("y").enable(false);
  EXPECT_EQ(refused({{"x", "y"}, {1.0, 1.0}}), "y: disabled; enable it first");
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(Line, OfNoLengthIsOverAtOnce) {
  EXPECT_EQ(machine().wait(start({{"x", "y"}, {0.0, 0.0}})).end, MoveEnd::kReached);
}

TEST_F(Line, KeepsAJerkLimit) {
  std::vector<config::AxisConfig> axes{axisOf("x", 1000.0, 1.0, 2.0), axisOf("y", 500.0, 1.0, 4.0)};
  axes[0].jerk = 20.0;
  build(axes);
  EXPECT_NEAR(start({{"x", "y"}, {1.0, 0.5}}).duration, 1.6, 1e-9);
}

}  // namespace
}  // namespace stepdriver
