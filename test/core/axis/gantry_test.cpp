#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/gantry_bench.h"
#include "support/refusal.h"

// An axis with two motors: they step together, and whatever ends one ends both.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using axis::MoveResult;
using test::Bench;
using test::gantryAxis;
using test::GantryTest;
using test::kStep;

class Gantry : public GantryTest {
 protected:
  void SetUp() override {
    GantryTest::SetUp();
    y().setPosition(0.0);
  }

  MoveResult move(double position) { return y().wait(y().moveTo(position)); }
  /// Begins a move to 50 mm, and lets it run for 0.3 s, so that it moves at its top speed.
  axis::Move moveFast() {
    const axis::Move move = y().moveTo(0.05);
    bench->machine->advance(0.3);
    EXPECT_GT(y().state().velocity, 0.09);
    return move;
  }
  /// The chip of the motor on a side reports a fault then.
  void failAfter500Pulses(const std::string& side) {
    sim::RigFaults faults;
    faults.chip_fault_after = 500;
    bench->rig.setFaults(side == "left" ? "y" : "y.right", faults);
  }
};

TEST_F(Gantry, StepsBothMotorsAtTheSameTimes) {
  move(0.02);
  EXPECT_EQ(move(-0.01).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), -800);
  EXPECT_EQ(bench->pulses("y.right"), -800);
  for (const bool level : {true, false}) {
    const auto steps = bench->trace->times("y", "step", level);
    EXPECT_EQ(steps, bench->trace->times("y.right", "step", level));
    EXPECT_EQ(bench->trace->times("y", "dir", level), bench->trace->times("y.right", "dir", level));
    EXPECT_EQ(steps.size(), 4000U);
  }
  EXPECT_EQ(y().state().skew, 0.0);
  expectNoViolations();
}

TEST_F(Gantry, TurnsAMotorTheOtherWayRoundIfItIsMountedSo) {
  config::AxisConfig config = gantryAxis();
  config.twins[0].pins.dir.inverted = true;
  build(config, [](auto&, auto& right) { right.dir.inverted = false; });
  y().setPosition(0.0);
  move(0.01);
  EXPECT_EQ(bench->pulses("y"), 800);
  EXPECT_EQ(bench->pulses("y.right"), -800);
}

TEST_F(Gantry, StopsBothMotorsAtAnEndstopOfEither) {
  for (const char* side : {"y", "y.right"}) {
    build(gantryAxis());
    y().setPosition(0.0);
    const axis::Move move = moveFast();
    sim::RigFaults pressed;
    pressed.max_stuck = true;
    bench->rig.setFaults(side, pressed);
    const MoveResult result = y().wait(move);
    EXPECT_EQ(result.end, MoveEnd::kEndstopMax) << result.message;
    EXPECT_EQ(bench->pulses("y"), bench->pulses("y.right"));
    EXPECT_REFUSED(y().moveTo(0.09), "the max endstop is active");
    EXPECT_TRUE(*y().endstops().max);
    expectNoViolations();
  }
}

// In real time: a thread reports the edge of a fault.
TEST_F(Gantry, StopsBothMotorsAtAFaultOfEitherAndSaysWhose) {
  for (const std::string side : {"left", "right"}) {
    config::AxisConfig config = gantryAxis();
    driver::DriverChip box = config.driver;
    box.title = "box";
    box.fault_active = false;
    box.fault_name = "ALM";
    box.fault_end = driver::FaultEnd::kReset;
    test::giveDrivers(config, box);
    config.fault = config::FaultPin{"left.fault"};
    config.twins[0].fault = config::FaultPin{"right.fault"};
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config},
                                    test::rigMotors(config), true, 1.0);
    y().setPosition(0.0);
    failAfter500Pulses(side);
    const MoveResult result = move(0.05);
    EXPECT_EQ(result.end, MoveEnd::kFault);
    const std::string words = "the box of motor " + side + " reports a fault on ALM";
    EXPECT_NE(result.message.find(words), std::string::npos) << result.message;
    EXPECT_EQ(bench->pulses("y"), bench->pulses("y.right"));
    EXPECT_FALSE(y().state().position_valid);
    bench->machine->recover();
    EXPECT_EQ(y().state().fault, "");
    EXPECT_TRUE(left().energized && right().energized);
  }
}

TEST_F(Gantry, IsAtFaultIfALineOfEitherMotorFails) {
  for (const std::string line : {"left.step", "right.step", "right.dir"}) {
    build(gantryAxis());
    y().setPosition(0.0);
    const bool is_dir = line == "right.dir";
    bench->rig.failWrites(line, is_dir ? 0 : 50, EIO);
    const MoveResult result = move(is_dir ? 0.01 : -0.01);
    EXPECT_EQ(result.end, MoveEnd::kFault);
    const std::string motor = line.substr(0, line.find('.'));
    EXPECT_NE(result.message.find(line + " of motor " + motor), std::string::npos)
        << result.message;
    EXPECT_FALSE(y().state().position_valid);
    EXPECT_DOUBLE_EQ(y().state().position, static_cast<double>(bench->pulses("y")) * kStep);
    EXPECT_LE(std::abs(bench->pulses("y") - bench->pulses("y.right")), 1);
    bench->rig.clearWriteFault(line);
    bench->machine->recover();
    y().setPosition(0.0);
    EXPECT_EQ(move(0.01).end, MoveEnd::kReached);
  }
}

TEST_F(Gantry, EnablesAndDisablesBothMotors) {
  EXPECT_TRUE(left().energized && right().energized);
  y().enable(false);
  EXPECT_FALSE(left().energized || right().energized);
  y().enable(true);
  EXPECT_TRUE(left().energized && right().energized);
  y().sleep(true);
  EXPECT_FALSE(left().energized || right().energized);
  y().sleep(false);
  y().reset();
  EXPECT_TRUE(left().energized && right().energized);
  y().setPosition(0.0);
  EXPECT_EQ(move(0.01).end, MoveEnd::kReached);
  expectNoViolations();
}

TEST_F(Gantry, WakesBothMotorsBeforeTheChipsTimesAreOver) {
  config::AxisConfig config = gantryAxis();
  config.driver.timing.wake_ns = 5'000'000;
  config.twins[0].driver.timing.enable_ns = 3'000'000;
  build(config);
  y().sleep(true);
  y().enable(false);
  y().enable(true);
  y().sleep(false);
  y().setPosition(0.0);
  move(0.001);
  expectNoViolations();
}

TEST_F(Gantry, SharesAnEnableLineOfItsMotorsWithAnotherAxis) {
  config::AxisConfig gantry = gantryAxis();
  config::AxisConfig x = test::linearAxis("x");
  for (config::Pin* pin : {&gantry.pins.enable, &gantry.twins[0].pins.enable, &x.pins.enable}) {
    pin->line = "all.enable";
  }
  std::vector<sim::RigAxisSpec> specs = test::rigMotors(gantry);
  specs.push_back(test::rigAxis(x));
  bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{gantry, x}, specs);
  y().enable(false);
  EXPECT_TRUE(left().energized && right().energized);
  bench->axis("x").enable(false);
  EXPECT_FALSE(left().energized || right().energized || bench->report("x").energized);
  y().enable(true);
  EXPECT_TRUE(left().energized && right().energized);
}

TEST_F(Gantry, KeepsAnEnableLineOfOneMotorThatAnotherAxisHolds) {
  config::AxisConfig gantry = gantryAxis();
  config::AxisConfig x = test::linearAxis("x");
  gantry.twins[0].pins.enable.line = x.pins.enable.line;
  std::vector<sim::RigAxisSpec> specs = test::rigMotors(gantry);
  specs.push_back(test::rigAxis(x));
  bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{gantry, x}, specs);
  y().enable(false);
  EXPECT_FALSE(left().energized);
  EXPECT_TRUE(right().energized);
  bench->axis("x").enable(false);
  EXPECT_FALSE(right().energized);
}

TEST_F(Gantry, KeepsItsMicrosteps) {
  EXPECT_REFUSED(y().setMicrosteps(8), "it has 2 motors, and keeps its microsteps, 1/16");
}

TEST_F(Gantry, WaitsUntilBothMotorsAreInPosition) {
  config::AxisConfig config = gantryAxis();
  test::giveDrivers(config, driver::driverChip("cl57t"));
  config.in_position = config::InPositionPin{"left.in_position"};
  config.twins[0].in_position = config::InPositionPin{"right.in_position"};
  build(config);
  y().setPosition(0.0);
  EXPECT_EQ(move(0.01).end, MoveEnd::kReached);
  sim::RigFaults faults;
  faults.never_in_position = true;
  bench->rig.setFaults("y.right", faults);
  const MoveResult result = move(0.02);
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find("of motor right isn't in position"), std::string::npos)
      << result.message;
}

// A TMC2209 on the left, whose pulses may be as short as 200 ns, and on the right a box that needs
// 2.5 us, and 5 us around each turn.
config::AxisConfig withTwoDrivers() {
  config::AxisConfig config = gantryAxis();
  test::giveDriver(config, driver::driverChip("tmc2209"));
  driver::DriverChip box = driver::driverChip("dm542");
  box.title = "box";
  box.fault_active = false;
  box.fault_name = "ALM";
  test::giveDriver(config.twins[0], box);
  config.fault = config::FaultPin{"left.fault"};
  config.twins[0].fault = config::FaultPin{"right.fault"};
  return config;
}

TEST_F(Gantry, KeepsTheTimesOfTwoDifferentDrivers) {
  config::AxisConfig config = withTwoDrivers();
  config.max_speed = 2.4;  // 192,000 steps/s: at most 5.2 us for a step of 5 us
  config.acceleration = config.deceleration = 200.0;
  for (const bool slower_is_left : {false, true}) {
    if (slower_is_left) {
      std::swap(static_cast<config::MotorConfig&>(config), config.twins[0]);
      std::swap(config.motor, config.twins[0].motor);
    }
    build(config);
    y().setPosition(0.0);
    for (const double target : {0.09, -0.05, 0.0}) {
      const MoveResult result = move(target);
      EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    }
    EXPECT_EQ(bench->pulses("y"), 0);
    EXPECT_EQ(bench->pulses("y.right"), 0);
    EXPECT_EQ(left().translator, right().translator);
    EXPECT_GT(left().pulses_forward, 10'000);
    expectNoViolations();
  }
}

TEST_F(Gantry, IsNoFasterThanItsSlowestDriver) {
  config::AxisConfig config = withTwoDrivers();
  config.max_speed = 2.5;  // 200,000 steps/s
  config.acceleration = config.deceleration = 200.0;
  build(config);
  y().setPosition(0.0);
  EXPECT_REFUSED(y().moveTo(0.09, false, 2.6), "is above the maximum 2.5 m/s");
  EXPECT_EQ(move(0.09).end, MoveEnd::kReached);
  expectNoViolations();
}

// In real time: a thread reports the edge of a fault.
TEST_F(Gantry, StopsBothMotorsAtAFaultOfEitherDriver) {
  for (const std::string side : {"left", "right"}) {
    for (const driver::FaultEnd end : {driver::FaultEnd::kEnable, driver::FaultEnd::kPower}) {
      config::AxisConfig config = withTwoDrivers();
      config.driver.fault_end = config.twins[0].driver.fault_end = driver::FaultEnd::kPower;
      (side == "left" ? config.driver : config.twins[0].driver).fault_end = end;
      bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config},
                                      test::rigMotors(config), true, 1.0);
      y().setPosition(0.0);
      failAfter500Pulses(side);
      const MoveResult result = move(0.05);
      EXPECT_EQ(result.end, MoveEnd::kFault);
      const std::string chip =
          side == "left" ? "the TMC2209 of motor left" : "the box of motor right";
      const std::string pin = side == "left" ? "DIAG" : "ALM";
      EXPECT_NE(result.message.find(chip + " reports a fault on " + pin), std::string::npos)
          << result.message;
      EXPECT_EQ(bench->pulses("y"), bench->pulses("y.right"));
      EXPECT_LT(bench->pulses("y"), 4000);
      if (end == driver::FaultEnd::kPower) {
        EXPECT_REFUSED(bench->machine->recover(), chip + " still reports a fault on " + pin +
                                                      "; only switching its power off clears it");
      } else {
        bench->machine->recover();
        EXPECT_EQ(y().state().fault, "");
        EXPECT_TRUE(left().energized && right().energized);
      }
      expectNoViolations();
    }
  }
}

TEST_F(Gantry, LosesItsPositionIfAnyDriverGoesHome) {
  for (const bool goes_home : {false, true}) {
    config::AxisConfig config = withTwoDrivers();
    config.holds_position_unpowered = true;
    if (goes_home) config.twins[0].driver.disabled = driver::TranslatorState::kHome;
    build(config);
    y().setPosition(0.0);
    move(7 * kStep);
    y().enable(false);
    EXPECT_EQ(y().state().position_valid, !goes_home);
  }
}

TEST_F(Gantry, ResetsTheDriversThatHaveReset) {
  config::AxisConfig config = gantryAxis();
  test::giveDriver(config, driver::driverChip("tmc2209"));
  config.pins.sleep = config.twins[0].pins.sleep = {};
  build(config);
  y().setPosition(0.0);
  move(7 * kStep);
  y().reset();
  EXPECT_EQ(left().translator, 7 * 256 / 16 / 4) << "in microsteps of 1/64";
  EXPECT_EQ(right().translator, 0);
  EXPECT_FALSE(y().state().position_valid);
  y().setPosition(0.0);
  EXPECT_EQ(move(0.001).end, MoveEnd::kReached);
  expectNoViolations();
  test::giveDriver(config.twins[0], driver::driverChip("tmc2209"));
  build(config);
  EXPECT_REFUSED(y().reset(), "the TMC2209 has no RESET pin");
  EXPECT_REFUSED(y().sleep(true), "the TMC2209 has no SLEEP pin");
}

TEST_F(Gantry, StepsBothMotorsOnBothEdges) {
  config::AxisConfig config = gantryAxis();
  driver::DriverChip chip = driver::driverChip("drv8434");
  chip.both_edges = true;
  chip.sleep_asleep.reset();
  test::giveDrivers(config, chip);
  build(config, [](auto&, auto& right) { right.start = 1.003; });
  const axis::HomingResult homed = y().home();
  EXPECT_EQ(homed.end, axis::HomingEnd::kHomed) << homed.message;
  EXPECT_NEAR(skew(), 0.0, 1.001 / 80.0);
  y().moveTo(0.0, true);
  const std::int64_t before = bench->pulses("y");
  EXPECT_EQ(y().wait(y().moveTo(0.01, true)).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y") - before, 800);
  EXPECT_NEAR(skew(), 0.0, 1.001 / 80.0);
  expectNoViolations();
}

}  // namespace
}  // namespace stepdriver
