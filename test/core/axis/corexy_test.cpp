#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/corexy_bench.h"
#include "support/refusal.h"

// Two axes that share two motors, on the rig. Motor a has the pins of x, motor b those of y.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::coreXyAxes;
using test::refusal;
using test::violationsOf;

class CoreXy : public testing::Test {
 protected:
  explicit CoreXy(const std::vector<config::AxisConfig>& axes = coreXyAxes()) : bench(axes) {
    for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  }

  axis::Axis& x() { return bench.axis("x"); }
  axis::Axis& y() { return bench.axis("y"); }
  void advance(double seconds) { bench.machine->advance(seconds); }
  void awaitRest() {
    for (int i = 0; i < 100'000; ++i) {
      if (!x().state().moving && !y().state().moving) return;
      advance(1e-3);
    }
    FAIL() << "they still move";
  }
  /// The positions are those of the carriages, and the chips saw nothing wrong.
  void expectTrue() {
    EXPECT_NEAR(bench.report("x").carriage, 1e3 * x().state().position, 1e-9);
    EXPECT_NEAR(bench.report("y").carriage, 1e3 * y().state().position, 1e-9);
    EXPECT_EQ(violationsOf(bench.report("x")), "");
    EXPECT_EQ(violationsOf(bench.report("y")), "");
  }

  Bench bench;
};

TEST_F(CoreXy, OneAxisMovesBothMotors) {
  EXPECT_EQ(bench.move(0.01, "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 800);
  EXPECT_EQ(bench.pulses("y"), 800);
  EXPECT_EQ(bench.move(0.005, "y").end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 1200);
  EXPECT_EQ(bench.pulses("y"), 400);
  EXPECT_EQ(x().state().position, 0.01);
  EXPECT_EQ(y().state().position, 0.005);
  expectTrue();
}

TEST_F(CoreXy, ASwitchOfOneAxisEndsBothInTheSamePass) {
  const axis::Move slow = y().moveTo(0.08, false, 0.004);
  advance(0.1);
  const axis::MoveResult met = x().wait(x().moveTo(0.12, false, 0.015));
  EXPECT_EQ(met.end, MoveEnd::kEndstopMax) << met.message;
  const std::int64_t a = bench.pulses("x");
  const std::int64_t b = bench.pulses("y");
  const axis::MoveResult other = y().wait(slow);
  EXPECT_EQ(other.end, MoveEnd::kCompanion) << other.message;
  advance(1.0);
  EXPECT_EQ(bench.pulses("x"), a);
  EXPECT_EQ(bench.pulses("y"), b);
  EXPECT_TRUE(x().state().position_valid);
  EXPECT_TRUE(y().state().position_valid);
  expectTrue();
  // Neither motor may turn x further towards its switch, but y is free, and so is the way back.
  EXPECT_EQ(refusal([&] { x().moveTo(0.13); }),
            "x: the max endstop is active; it moves only towards min");
  EXPECT_EQ(bench.move(0.0, "y").end, MoveEnd::kReached);
  expectTrue();
  EXPECT_EQ(bench.move(0.0, "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 0);
  EXPECT_EQ(bench.pulses("y"), 0);
  expectTrue();
}

TEST_F(CoreXy, ASwitchMetAtSpeedMakesBothPositionsDoubtful) {
  y().moveTo(0.001);
  EXPECT_EQ(x().wait(x().moveTo(0.12)).end, MoveEnd::kEndstopMax);
  EXPECT_FALSE(x().state().position_valid);
  EXPECT_FALSE(y().state().position_valid);
  expectTrue();
}

TEST_F(CoreXy, IsDisabledAndEnabledAsAWhole) {
  x().jog(0.05);
  const axis::Move move = y().moveTo(-0.05);
  advance(0.2);
  x().enable(false);
  EXPECT_FALSE(x().state().enabled);
  EXPECT_FALSE(y().state().enabled);
  EXPECT_NE(y().wait(move).end, MoveEnd::kReached);
  EXPECT_FALSE(x().state().position_valid);
  EXPECT_FALSE(y().state().position_valid);
  expectTrue();
  EXPECT_EQ(refusal([&] { y().moveTo(0.0); }), "y: disabled; enable it first");
  y().enable(true);
  EXPECT_TRUE(x().state().enabled);
  EXPECT_TRUE(y().state().enabled);
  EXPECT_EQ(bench.move(0.0, "y").end, MoveEnd::kReached);
  expectTrue();
}

TEST_F(CoreXy, ALineThatFailsEndsBothAndBothRecover) {
  x().jog(0.03);
  advance(0.1);
  bench.rig.failWrites("y.step", 50, 5);
  const axis::MoveResult result = y().wait(y().moveTo(0.05));
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  awaitRest();
  EXPECT_NE(x().state().fault.find("y: the STEP line y.step"), std::string::npos)
      << x().state().fault;
  EXPECT_NE(y().state().fault, "");
  EXPECT_FALSE(x().state().position_valid);
  EXPECT_NE(refusal([&] { x().moveTo(0.0); }), "");
  bench.rig.clearWriteFault("y.step");
  bench.machine->recover();
  EXPECT_EQ(x().state().fault, "");
  EXPECT_EQ(y().state().fault, "");
  EXPECT_EQ(x().wait(x().moveTo(0.001, true)).end, MoveEnd::kReached);
}

TEST_F(CoreXy, AnEmergencyStopEndsBoth) {
  x().moveTo(0.05);
  y().moveTo(0.03);
  advance(0.2);
  bench.machine->emergencyStop();
  const std::int64_t a = bench.pulses("x");
  const std::int64_t b = bench.pulses("y");
  advance(1.0);
  EXPECT_EQ(bench.pulses("x"), a);
  EXPECT_EQ(bench.pulses("y"), b);
  bench.machine->recover();
  expectTrue();
  // From between two microsteps of the axes both reach their targets exactly.
  EXPECT_EQ(bench.move(0.01, "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench.move(-0.01, "y").end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 0);
  EXPECT_EQ(bench.pulses("y"), 1600);
  expectTrue();
}

TEST_F(CoreXy, RefusesWhatMakesNoSense) {
  EXPECT_EQ(refusal([&] { x().moveRounds(1.0); }),
            "x: it shares its motors, none of which turns for it alone: move it by a distance");
  EXPECT_NE(refusal([&] { y().setMicrosteps(8); }).find("it shares its motors"), std::string::npos);
  y().jog(0.01);
  EXPECT_EQ(refusal([&] { x().setPosition(0.0); }),
            "x: busy: y, which shares its motors, is at work; its position is set when both are at "
            "rest");
}

TEST(CoreXyMachine, RefusesAnIdleTimeoutDuringWhichTheOtherAxisMayMove) {
  std::vector<config::AxisConfig> axes = coreXyAxes();
  axes[1].idle_timeout = 1.0;
  try {
    const Bench bench(axes);
    FAIL();
  } catch (const ConfigError& error) {
    EXPECT_STREQ(error.what(),
                 "kinematics/axes: has y with idle_timeout_s, which it must not have: while it "
                 "rests, its motors may move another axis");
  }
}

// A thread reports the edge of a fault output, so this is on the rig in real time.
TEST(CoreXyWithFaults, AFaultOfOneMotorEndsBothAndBothRecover) {
  std::vector<config::AxisConfig> axes{test::linearAxis("x", "drv8825"),
                                       test::linearAxis("y", "drv8825")};
  test::share(axes, {{1.0, 1.0}, {1.0, -1.0}});
  for (config::AxisConfig& axis : axes) axis.fault = config::FaultPin{axis.name + ".fault"};
  Bench bench(axes, true, 1.0);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  sim::RigFaults faults;
  faults.chip_fault_after = 2000;
  bench.rig.setFaults("y", faults);
  const axis::Move of_x = bench.axis("x").moveTo(0.05);
  const axis::Move of_y = bench.axis("y").moveTo(-0.05);
  EXPECT_EQ(bench.axis("y").wait(of_y).end, MoveEnd::kFault);
  EXPECT_EQ(bench.axis("x").wait(of_x).end, MoveEnd::kFault);
  for (const std::string name : {"x", "y"}) {
    const axis::AxisState state = bench.axis(name).state();
    EXPECT_NE(state.fault.find("of y reports a fault"), std::string::npos) << state.fault;
    EXPECT_FALSE(state.position_valid);
    EXPECT_FALSE(state.moving);
  }
  const std::int64_t a = bench.pulses("x");
  const std::int64_t b = bench.pulses("y");
  EXPECT_LT(b, 8000);
  EXPECT_EQ(bench.axis("x").state().position, static_cast<double>(a + b) / 2.0 / 80'000.0);
  EXPECT_EQ(bench.axis("y").state().position, static_cast<double>(a - b) / 2.0 / 80'000.0);
  bench.rig.setFaults("y", {});
  bench.machine->recover();
  EXPECT_EQ(bench.axis("x").wait(bench.axis("x").moveTo(0.001, true)).end, MoveEnd::kReached);
}

// ---- homing ----

class CoreXyHoming : public CoreXy {
 protected:
  static std::vector<config::AxisConfig> homedAxes() {
    std::vector<config::AxisConfig> axes = coreXyAxes();
    for (config::AxisConfig& axis : axes) {
      config::HomingConfig homing;
      homing.seek_speed = 0.02;
      homing.latch_speed = 0.002;
      homing.pull_off = 0.001;
      homing.offset = -0.1;
      homing.max_travel = 0.3;
      homing.order = axis.name == "x" ? 0 : 1;
      axis.homing = homing;
    }
    return axes;
  }
  CoreXyHoming() : CoreXy(homedAxes()) {}
};

TEST_F(CoreXyHoming, OfBothOneAfterTheOther) {
  bench.move(0.013, "x");
  bench.move(-0.021, "y");
  for (const axis::HomingResult& result : bench.machine->home()) {
    EXPECT_EQ(result.end, axis::HomingEnd::kHomed) << result.message;
  }
  for (axis::Axis* axis : {&x(), &y()}) {
    EXPECT_TRUE(axis->state().homed);
    EXPECT_TRUE(axis->state().position_valid);
    EXPECT_NEAR(axis->state().position, -0.099, 1.0 / 80'000.0);
    const double carriage = bench.report(axis->config().name).carriage;
    EXPECT_NEAR(carriage, 1e3 * axis->state().position, 1.0 / 80.0);
  }
  EXPECT_EQ(violationsOf(bench.report("x")), "");
  EXPECT_EQ(violationsOf(bench.report("y")), "");
}

TEST_F(CoreXyHoming, OfOneLeavesTheOtherWhereItStands) {
  bench.move(0.02, "y");
  const double before = bench.report("y").carriage;
  EXPECT_EQ(x().home().end, axis::HomingEnd::kHomed);
  EXPECT_EQ(bench.report("y").carriage, before);
  EXPECT_EQ(y().state().position, 0.02);
  EXPECT_TRUE(y().state().position_valid);
}

TEST_F(CoreXyHoming, IsRefusedWhileTheOtherMoves) {
  y().jog(0.01);
  EXPECT_EQ(refusal([&] { x().home(); }),
            "x: busy: y, which shares its motors, is at work; it is homed when both are at rest");
}

// It would move the motors that the other one needs to find its switch.
TEST_F(CoreXyHoming, IsNotDisturbedByATrajectoryOfTheOtherThatBeginsMeanwhile) {
  motion::TrajectoryRequest later{{"y"}, {{1.0, {0.01}, {0.0}, {}}}};
  later.begin_in = 0.5;
  const auto move = bench.machine->followTrajectory(later);
  EXPECT_EQ(x().home().end, axis::HomingEnd::kHomed);
  const auto result = bench.machine->result(move);
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->end, MoveEnd::kStopped);
  EXPECT_NE(result->message.find("x, which shares its motors, is being homed"), std::string::npos)
      << result->message;
  EXPECT_EQ(y().state().position, 0.0);
}

// ---- other matrices ----

class ThreeAxes : public testing::Test {
 protected:
  static std::vector<config::AxisConfig> threeAxes() {
    std::vector<config::AxisConfig> axes{test::linearAxis("x"), test::linearAxis("y"),
                                         test::linearAxis("z")};
    axes[1].steps_per_unit = 100'000.0;
    test::share(axes, {{1.0, 0.5, 0.0}, {1.0, -0.3, 0.7}, {0.2, 0.0, -1.5}});
    return axes;
  }
};

TEST_F(ThreeAxes, ReachTheirTargetsToHalfAMicrostepOfEachMotor) {
  const std::vector<config::AxisConfig> axes = threeAxes();
  Bench bench(axes);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  const std::vector<std::string> names{"x", "y", "z"};
  for (int i = 1; i <= 7; ++i) {
    for (std::size_t k = 0; k < names.size(); ++k) {
      const double target =
          1e-3 * (static_cast<double>((i * 7 + static_cast<int>(k) * 5) % 11) - 5.0);
      EXPECT_EQ(bench.move(target, names[k]).end, MoveEnd::kReached);
      double reach = 1e-9;
      for (std::size_t m = 0; m < names.size(); ++m) {
        reach += 0.5 * std::abs(axes[0].kinematics->inverse[k][m]) / axes[m].steps_per_unit;
      }
      const axis::AxisState state = bench.axis(names[k]).state();
      EXPECT_NEAR(state.position, target, reach);
      EXPECT_NEAR(bench.report(names[k]).carriage, 1e3 * state.position, 1e-6);
    }
  }
  // Relative moves don't add up what a microstep can't say.
  for (int i = 0; i < 100; ++i) {
    EXPECT_EQ(bench.axis("y").wait(bench.axis("y").moveTo(1.0 / 300'000.0, true)).end,
              MoveEnd::kReached);
  }
  const double y = 1e-3 * (static_cast<double>((7 * 7 + 5) % 11) - 5.0) + 100.0 / 300'000.0;
  EXPECT_NEAR(bench.axis("y").state().position, y, 2.0 / 80'000.0);
  for (const std::string& name : names) EXPECT_EQ(violationsOf(bench.report(name)), "");
}

// [[1, 0.5], [0.25, -1]] at 40 microsteps/mm: x reaches its targets to 16.7 um, y to 13.9 um,
// whatever else moves on the way, and each answer says to which place.
TEST(SkewedAxes, ReachTheirTargetsToHalfAMicrostepOfEachMotorByEveryKindOfMotion) {
  std::vector<config::AxisConfig> axes{test::linearAxis("x", 40'000.0, 0.1, 1.0),
                                       test::linearAxis("y", 40'000.0, 0.1, 1.0)};
  test::share(axes, {{1.0, 0.5}, {0.25, -1.0}});
  Bench bench(axes);
  const std::vector<std::string> names{"x", "y"};
  for (const std::string& name : names) bench.axis(name).setPosition(0.0);
  std::array<double, 2> reach{};
  for (std::size_t k = 0; k < 2; ++k) {
    for (std::size_t m = 0; m < 2; ++m) {
      reach.at(k) += 0.5 * std::abs(axes[0].kinematics->inverse[k][m]) / 40'000.0 + 5e-10;
    }
  }
  EXPECT_NEAR(reach[0], 16.7e-6, 0.1e-6);
  EXPECT_NEAR(reach[1], 13.9e-6, 0.1e-6);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> place(-0.01, 0.01);
  std::array<double, 2> wanted{};
  for (int i = 0; i < 300; ++i) {
    const int kind = i % 6;
    const std::size_t moved = static_cast<std::size_t>(i / 6) % 2;
    std::vector<axis::Move> moves;
    std::vector<std::size_t> ways{0, 1};
    if (kind < 2) {
      ways = {moved};
      const bool relative = kind == 1;
      const double to = place(random) * (relative ? 0.1 : 1.0);
      moves = {bench.axis(names[moved]).moveTo(to, relative)};
      wanted.at(moved) = relative ? wanted.at(moved) + to : to;
    } else if (kind == 2) {
      ways = {moved};
      wanted.at(moved) = place(random);
      for (int k = 0; k < 5; ++k) {
        const double value = wanted.at(moved);
        EXPECT_EQ(bench.machine->followSetpoints(machine::SetpointMode::kPosition, 1.0,
                                                 {{names[moved], value, {}}}),
                  std::vector<std::string>{""});
        bench.machine->advance(0.01);
      }
    } else {
      wanted = {place(random), place(random)};
      const std::vector<double> to{wanted[0], wanted[1]};
      motion::PathSegment segment;
      segment.end = to;
      const machine::CoordinatedMove move =
          kind == 3   ? bench.machine->moveLine({names, to})
          : kind == 4 ? bench.machine->followPath({names, {segment}})
                      : bench.machine->followTrajectory(
                            {names, {{1.0, {0.5 * to[0], to[1]}, {}, {}}, {2.0, to, {}, {}}}});
      for (const auto& member : move.members) moves.push_back(member.move);
    }
    for (std::size_t k = 0; k < moves.size(); ++k) {
      const std::string& name = names[ways[k]];
      const axis::MoveResult result = bench.axis(name).wait(moves[k]);
      EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
      EXPECT_NEAR(result.position, moves[k].rest, 1e-9) << name << " by kind " << kind;
      EXPECT_NEAR(moves[k].target, wanted.at(ways[k]), 1e-9);
    }
    while (bench.axis("x").state().moving || bench.axis("y").state().moving) {
      bench.machine->advance(1e-3);
    }
    for (std::size_t k = 0; k < 2; ++k) {
      const double position = bench.axis(names[k]).state().position;
      EXPECT_NEAR(position, wanted.at(k), reach.at(k)) << names[k] << " by kind " << kind;
      EXPECT_NEAR(bench.report(names[k]).carriage, 1e3 * position, 1e-6);
    }
  }
  for (const std::string& name : names) EXPECT_EQ(violationsOf(bench.report(name)), "");
}

// The places of an axis that shares motors aren't its own counts, at a soft limit either.
TEST(SkewedAxes, JogToTheirSoftLimitsToHalfAMicrostepOfEachMotor) {
  for (int i = 0; i < 40; ++i) {
    const double limit = 0.003 + i * 1.7e-6;
    std::vector<config::AxisConfig> axes{test::linearAxis("x", 40'000.0, 0.1, 1.0),
                                         test::linearAxis("y", 40'000.0, 0.1, 1.0)};
    for (config::AxisConfig& axis : axes) {
      axis.min_position = -limit;
      axis.max_position = limit;
    }
    test::share(axes, {{1.0, 0.5}, {0.25, -1.0}});
    Bench bench(axes);
    for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
    for (std::size_t k = 0; k < 2; ++k) {
      double reach = 5e-10;
      for (const double part : axes[0].kinematics->inverse[k]) {
        reach += 0.5 * std::abs(part) / 40'000.0;
      }
      axis::Axis& moved = bench.axis(axes[k].name);
      for (const double sign : {1.0, -1.0}) {
        moved.jog(sign * 0.1);
        while (moved.state().moving) bench.machine->advance(1e-3);
        EXPECT_NEAR(moved.state().position, sign * limit, reach) << axes[k].name;
      }
    }
  }
}

// The end of a move that a stop comes for is between the axis's own counts: it rests there all the
// same, and not on the nearest one.
TEST(SkewedAxes, AStopNextToATargetRestsOnIt) {
  for (int i = 0; i < 40; ++i) {
    std::vector<config::AxisConfig> axes{test::linearAxis("x", 40'000.0, 0.1, 1.0),
                                         test::linearAxis("y", 40'000.0, 0.1, 1.0)};
    test::share(axes, {{1.0, 0.5}, {0.25, -1.0}});
    Bench bench(axes);
    for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
    axis::Axis& x = bench.axis("x");
    const axis::Move move = x.moveTo(0.003 + i * 1.7e-6);
    bench.machine->advance(move.duration - 0.002 - 0.0005 * (i % 5));
    x.stop();
    while (x.state().moving) bench.machine->advance(1e-3);
    EXPECT_NEAR(x.state().position, move.rest, 1e-9) << "target " << i;
  }
}

}  // namespace
}  // namespace stepdriver
