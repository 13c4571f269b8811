#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::violationsOf;

TEST(AxisChip, WakesAndEnablesLongEnoughBeforeTheFirstStep) {
  for (const std::string model : {"a4988", "drv8825", "tb6600"}) {
    config::AxisConfig config = linearAxis("x", model);
    config.enable_on_start = false;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    for (int round = 0; round < 3; ++round) {
      x.enable(true);
      if (config.pins.sleep.wired()) {
        x.sleep(true);
        x.sleep(false);
        x.wait(x.moveTo(0.0, true));
        x.reset();
      }
      x.wait(x.moveTo(0.0001, true));
      x.enable(false);
    }
    EXPECT_EQ(bench.pulses(), 24);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(AxisChip, WakesWhicheverPinsAreWired) {
  for (const bool sleep_wired : {false, true}) {
    for (const bool reset_wired : {false, true}) {
      config::AxisConfig config = linearAxis("x", "drv8825");
      config.start_speed = config.max_speed;
      if (!sleep_wired) config.pins.sleep.line.clear();
      if (!reset_wired) config.pins.reset.line.clear();
      Bench bench({config});
      bench.move(0.001);
      EXPECT_NEAR(bench.report().carriage, 1.0, 1e-9);
      EXPECT_EQ(violationsOf(bench.report()), "") << sleep_wired << reset_wired;
    }
  }
}

TEST(AxisChip, KeepsTheChipsTimesAtItsHighestRate) {
  for (const std::string model : {"a4988", "drv8825", "tb6600"}) {
    config::AxisConfig config = linearAxis("x", model);
    const double period =
        static_cast<double>(config.driver.timing.step_high_ns + config.driver.timing.step_low_ns) *
        1e-9;
    config.max_speed = 1.0 / period / config.steps_per_unit;
    config.start_speed = config.max_speed;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    for (const double target : {0.01, -0.01, -0.0099, 0.0}) {
      EXPECT_EQ(bench.move(target).end, axis::MoveEnd::kReached);
    }
    EXPECT_EQ(bench.pulses(), 0);
    EXPECT_EQ(x.state().position, 0.0);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(AxisChip, DisablingStopsFirstAndDropsTheTarget) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  const axis::Move move = x.moveTo(0.08);
  bench.machine->advance(0.3);
  x.enable(false);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kStopped);
  EXPECT_FALSE(x.state().enabled);
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_FALSE(bench.report().energized);
  const std::int64_t pulses = bench.pulses();
  x.enable(true);
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.pulses(), pulses);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(AxisChip, ChangesMicrostepsAndKeepsThePosition) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.move(0.002);  // 160 microsteps: 10 full steps
  for (const int mode : {1, 16, 2, 8, 4, 1, 8, 16}) {
    x.setMicrosteps(mode);
    EXPECT_EQ(x.state().microsteps, mode);
    EXPECT_DOUBLE_EQ(x.state().position, 0.002);
    const std::int64_t before = bench.pulses();
    bench.move(0.006);
    EXPECT_EQ(bench.pulses() - before, 20 * mode) << "1/" << mode;
    EXPECT_EQ(bench.report().microsteps, mode);
    EXPECT_NEAR(bench.report().carriage, 6.0, 1e-9);
    bench.move(0.002);
  }
  EXPECT_EQ(bench.move(0.0).end, axis::MoveEnd::kReached);
  EXPECT_NEAR(bench.report().carriage, 0.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(AxisChip, RefusesAMicrostepModeThatHasNoPositionHere) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.move(163.0 / 80'000.0);
  EXPECT_REFUSED(x.setMicrosteps(1), "1/1 has no position at 0.00204 m; the nearest");
  EXPECT_REFUSED(x.setMicrosteps(8), "no position");
  EXPECT_REFUSED(x.setMicrosteps(3), "it has 1, 2, 4, 8, 16");
  EXPECT_REFUSED(x.setMicrosteps(32), "the A4988 has no 1/32 mode; it has 1, 2, 4, 8, 16");
  EXPECT_EQ(x.state().microsteps, 16);
  EXPECT_EQ(bench.pulses(), 163);
}

TEST(AxisChip, MovesToTheNearestCommonPositionWhereThatIsWanted) {
  config::AxisConfig config = linearAxis("x", "drv8825");
  config.align_on_microstep_change = true;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  bench.move(163.0 / 80'000.0);
  x.setMicrosteps(1);
  EXPECT_EQ(x.state().microsteps, 1);
  EXPECT_EQ(bench.pulses(), 160);
  EXPECT_DOUBLE_EQ(x.state().position, 0.002);
  bench.move(0.0);
  EXPECT_EQ(bench.pulses(), 150);
  EXPECT_NEAR(bench.report().carriage, 0.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(AxisChip, StopsAtAFaultOfTheChipAndResetsItToRecover) {
  for (const bool reset_wired : {true, false}) {
    config::AxisConfig config = linearAxis("x", "drv8825");
    config.fault = config::FaultPin{"x.fault", Bias::kPullUp};
    if (!reset_wired) config.pins.reset.line.clear();
    Bench bench({config}, true, 1.0);
    axis::Axis& x = bench.axis();
    x.setPosition(0.0);
    sim::RigFaults faults;
    faults.chip_fault_after = 100;
    bench.rig.setFaults("x", faults);
    const axis::MoveResult result = x.wait(x.moveTo(0.09));
    EXPECT_EQ(result.end, axis::MoveEnd::kFault);
    EXPECT_NE(result.message.find("nFAULT"), std::string::npos) << result.message;
    EXPECT_LT(bench.pulses(), 7200);
    EXPECT_DOUBLE_EQ(x.state().position, static_cast<double>(bench.pulses()) / 80'000.0);
    EXPECT_FALSE(x.state().position_valid);
    EXPECT_REFUSED(x.moveTo(0.0), "nFAULT");
    if (reset_wired) {
      bench.machine->recover();
      EXPECT_EQ(x.state().fault, "");
      EXPECT_EQ(bench.move(0.0).end, axis::MoveEnd::kReached);
      EXPECT_EQ(bench.pulses(), 0);
    } else {
      EXPECT_REFUSED(bench.machine->recover(), "RESET isn't wired");
    }
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(AxisChip, CountsTheTranslatorFromHomeAfterAReset) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.move(163.0 / 80'000.0);
  x.reset();
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_DOUBLE_EQ(x.state().position, 163.0 / 80'000.0);
  x.setMicrosteps(1);  // the translator is at Home at any count
  EXPECT_DOUBLE_EQ(x.state().position, 163.0 / 80'000.0);
  x.wait(x.moveTo(0.0002, true));
  EXPECT_EQ(bench.pulses(), 164);
  EXPECT_DOUBLE_EQ(x.state().position, 163.0 / 80'000.0 + 0.0002);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(AxisChip, RefusesToSetTheMicrostepsOfATb6600) {
  Bench bench({linearAxis("x", "tb6600")});
  EXPECT_REFUSED(
      bench.axis().setMicrosteps(8),
      "it can't change to 8 microsteps: those of the TB6600 are set by its DIP switches");
  EXPECT_REFUSED(bench.axis().sleep(true), "no SLEEP pin");
  EXPECT_REFUSED(bench.axis().reset(), "no RESET pin");
}

TEST(AxisChip, InvertsEverySignalOfACommonAnode) {
  config::AxisConfig config = linearAxis("x", "tb6600");
  config.pins.step.inverted = true;
  config.pins.dir.inverted = true;
  config.pins.enable.inverted = true;
  Bench bench({config});
  bench.move(0.01);
  bench.move(0.005);
  EXPECT_EQ(bench.pulses(), 400);
  EXPECT_NEAR(bench.report().carriage, 5.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(AxisChip, GoesBackToTheOldModeAfterAModePinFailed) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.rig.failWrites("x.ms2", 0, EIO);
  EXPECT_THROW(x.setMicrosteps(1), GpioError);
  EXPECT_EQ(x.state().microsteps, 16);
  EXPECT_REFUSED(x.moveTo(0.01), "at fault");
  bench.rig.clearWriteFault("x.ms2");
  bench.machine->recover();
  bench.move(0.01);
  EXPECT_EQ(bench.report().microsteps, 16);
  EXPECT_EQ(bench.pulses(), 800);
  EXPECT_EQ(violationsOf(bench.report()), "");
}
}  // namespace
}  // namespace stepdriver
