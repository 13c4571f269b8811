#include "stepdriver_core/axis/axis.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::rigAxis;
using test::violationsOf;

// The message of the refusal; empty where the action was accepted.
template <typename Action>
std::string refusal(Action action) {
  try {
    action();
  } catch (const Refused& refused) {
    return refused.what();
  }
  return "";
}

#define EXPECT_REFUSED(action, words)                                            \
  do {                                                                           \
    const std::string message = refusal([&] { action; });                        \
    EXPECT_NE(message.find(words), std::string::npos) << "message: " << message; \
  } while (false)

TEST(Axis, MovesToWhereItIsToldAndSaysSo) {
  Bench bench({linearAxis("x")});
  const axis::MoveResult result = bench.move(0.0125);
  EXPECT_EQ(result.end, axis::MoveEnd::kReached);
  EXPECT_EQ(result.message, "x reached 0.0125 m");
  EXPECT_DOUBLE_EQ(result.position, 0.0125);
  EXPECT_NEAR(result.duration, 0.1 + 0.0125 / 0.1, 1e-8);
  EXPECT_EQ(bench.pulses(), 1000);
  EXPECT_NEAR(bench.report().carriage, 12.5, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, MovesBackAndByRounds) {
  Bench bench({linearAxis("x")});
  bench.move(-0.01);
  EXPECT_EQ(bench.pulses(), -800);
  axis::Axis& x = bench.axis();
  EXPECT_EQ(x.wait(x.moveRounds(1.5)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), -800 + 4800);
  EXPECT_EQ(x.wait(x.moveTo(-0.001, true)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), -800 + 4800 - 80);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, GoesAsFastAsAsked) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  const axis::Move move = x.moveTo(0.05, false, 0.02);
  EXPECT_NEAR(move.duration, 0.02 + 0.05 / 0.02, 1e-9);
  bench.machine->advance(1.0);
  EXPECT_NEAR(x.state().velocity, 0.02, 1e-12);
  EXPECT_TRUE(x.state().moving);
  EXPECT_DOUBLE_EQ(x.state().target, 0.05);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kReached);
  EXPECT_FALSE(x.state().moving);
  EXPECT_EQ(x.state().velocity, 0.0);
}

TEST(Axis, RefusesBadNumbersAndSendsNoPulse) {
  axis::AxisConfig config = linearAxis("x");
  config.min_position = -0.01;
  config.max_position = 0.02;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_REFUSED(x.moveTo(nan), "finite");
  EXPECT_REFUSED(x.moveTo(-inf), "finite");
  EXPECT_REFUSED(x.moveTo(0.01, false, nan), "velocity");
  EXPECT_REFUSED(x.moveTo(0.01, false, -0.1), "velocity");
  EXPECT_REFUSED(x.moveTo(0.01, false, 0.11), "above the maximum 0.1 m/s");
  EXPECT_REFUSED(x.moveTo(0.0201), "above the soft limit max_position 0.02 m");
  EXPECT_REFUSED(x.moveTo(-0.0101), "below the soft limit min_position -0.01 m");
  EXPECT_REFUSED(x.moveTo(0.021, true), "soft limit");
  EXPECT_REFUSED(x.moveRounds(nan), "finite");
  EXPECT_REFUSED(x.moveRounds(1e300), "soft limit");
  EXPECT_REFUSED(x.setPosition(nan), "finite");
  EXPECT_REFUSED(x.setPosition(0.03), "soft limit");
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.report().pulses_forward + bench.report().pulses_backward, 0);
  EXPECT_EQ(x.state().position, 0.0);
  EXPECT_EQ(bench.move(0.02).end, axis::MoveEnd::kReached);
}

TEST(Axis, RefusesToMoveDisabledAsleepOrBusy) {
  axis::AxisConfig config = linearAxis("x");
  config.enable_on_start = false;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  EXPECT_REFUSED(x.moveTo(0.01), "disabled");
  x.enable(true);
  x.sleep(true);
  EXPECT_REFUSED(x.moveTo(0.01), "asleep");
  x.sleep(false);
  const axis::Move move = x.moveTo(0.01);
  EXPECT_REFUSED(x.moveTo(0.02), "busy");
  EXPECT_REFUSED(x.sleep(true), "busy");
  EXPECT_REFUSED(x.reset(), "busy");
  EXPECT_REFUSED(x.setMicrosteps(8), "busy");
  EXPECT_REFUSED(x.setPosition(0.0), "busy");
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 800);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, WakesAndEnablesLongEnoughBeforeTheFirstStep) {
  for (const chip::Model model :
       {chip::Model::kA4988, chip::Model::kDrv8825, chip::Model::kTb6600}) {
    axis::AxisConfig config = linearAxis("x", model);
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

TEST(Axis, WakesWhicheverPinsAreWired) {
  for (const bool sleep_wired : {false, true}) {
    for (const bool reset_wired : {false, true}) {
      axis::AxisConfig config = linearAxis("x", chip::Model::kDrv8825);
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

TEST(Axis, KeepsTheChipsTimesAtItsHighestRate) {
  for (const chip::Model model :
       {chip::Model::kA4988, chip::Model::kDrv8825, chip::Model::kTb6600}) {
    axis::AxisConfig config = linearAxis("x", model);
    const double period =
        static_cast<double>(config.timing.step_high_ns + config.timing.step_low_ns) * 1e-9;
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

TEST(Axis, EndsAtAnEndstopByNameWithTheExactCount) {
  std::vector<axis::AxisConfig> configs = {linearAxis("x")};
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(configs);
  specs[0].max_switch->position = 5.0;
  specs[0].max_switch->bounces = 3;
  specs[0].max_switch->bounce_ns = 50'000;
  Bench bench(configs, specs);
  axis::Axis& x = bench.axis();
  const axis::MoveResult result = x.wait(x.moveTo(0.05, false, 0.01));
  EXPECT_EQ(result.end, axis::MoveEnd::kEndstopMax);
  EXPECT_NE(result.message.find("the max endstop was met"), std::string::npos) << result.message;
  EXPECT_EQ(bench.pulses(), 400);
  EXPECT_NEAR(result.position, 0.005, 1e-12);
  EXPECT_NEAR(bench.report().carriage, 5.0, 1e-9);
  EXPECT_EQ(x.endstops().max, true);
  EXPECT_EQ(x.endstops().min, false);
  // Only towards min from here.
  EXPECT_REFUSED(x.moveTo(0.001, true), "max endstop is active");
  EXPECT_EQ(x.wait(x.moveTo(-0.001, true)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 320);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, DistrustsThePositionAfterAnEndstopAtSpeed) {
  axis::AxisConfig config = linearAxis("x");
  config.start_speed = 0.02;
  std::vector<sim::RigAxisSpec> specs = {rigAxis(config)};
  specs[0].min_switch->position = -20.0;
  for (const double velocity : {0.015, 0.1}) {
    Bench bench({config}, specs);
    axis::Axis& x = bench.axis();
    x.setPosition(0.0);
    EXPECT_TRUE(x.state().position_valid);
    const axis::MoveResult result = x.wait(x.moveTo(-0.05, false, velocity));
    EXPECT_EQ(result.end, axis::MoveEnd::kEndstopMin);
    EXPECT_EQ(bench.pulses(), -1600);
    EXPECT_EQ(x.state().position_valid, velocity < 0.02) << result.message;
  }
}

TEST(Axis, KnowsASwitchThatIsActiveAtTheStart) {
  std::vector<axis::AxisConfig> configs = {linearAxis("x")};
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(configs);
  specs[0].min_switch->position = 0.0;
  Bench bench(configs, specs);
  axis::Axis& x = bench.axis();
  EXPECT_EQ(x.endstops().min, true);
  EXPECT_REFUSED(x.moveTo(-0.01), "min endstop is active");
  EXPECT_EQ(bench.move(0.01).end, axis::MoveEnd::kReached);
  EXPECT_EQ(x.endstops().min, false);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, SeesASwitchThatSticksInMidMove) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  const axis::Move move = x.moveTo(0.05);
  bench.machine->advance(0.2);
  const std::int64_t before = bench.pulses();
  sim::RigFaults stuck;
  stuck.max_stuck = true;
  bench.rig.setFaults("x", stuck);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kEndstopMax);
  EXPECT_EQ(bench.pulses(), before);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, StopsWithItsDecelerationAndMovesAgainOnlyWhenTold) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  const axis::Move move = x.moveTo(0.08);
  bench.machine->advance(0.3);  // at 0.1 m/s since 0.1 s
  const double here = x.state().position;
  x.stop();
  x.stop();
  const axis::MoveResult result = x.wait(move);
  EXPECT_EQ(result.end, axis::MoveEnd::kStopped);
  EXPECT_NE(result.message.find("not at 0.08 m: it was stopped"), std::string::npos)
      << result.message;
  // v^2 / 2a = 5 mm, after the millisecond of the hand-over.
  EXPECT_NEAR(result.position - here, 0.005 + 0.0001, 2.0 / 80'000.0);
  const std::int64_t pulses = bench.pulses();
  bench.machine->advance(2.0);
  EXPECT_EQ(bench.pulses(), pulses);
  EXPECT_EQ(x.state().target, x.state().position);
  EXPECT_EQ(bench.move(0.0).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, StopsShortlyBeforeTheEndOfAMoveAtItsTarget) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  for (const double before : {0.0, 0.0005, 0.001, 0.0013, 0.002, 0.0071, 0.05, 0.098}) {
    const axis::Move there = x.moveTo(0.08);
    bench.machine->advance(there.duration - before);
    x.stop();
    x.wait(there);
    EXPECT_EQ(bench.pulses(), 6400) << before << " s before the end";
    bench.move(0.0);
  }
}

TEST(Axis, DisablingStopsFirstAndDropsTheTarget) {
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

TEST(Axis, ChangesMicrostepsAndKeepsThePosition) {
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

TEST(Axis, RefusesAMicrostepModeThatHasNoPositionHere) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.move(163.0 / 80'000.0);
  EXPECT_REFUSED(x.setMicrosteps(1), "1/1 has no position at 0.0020375 m; the nearest");
  EXPECT_REFUSED(x.setMicrosteps(8), "no position");
  EXPECT_REFUSED(x.setMicrosteps(3), "it has 1, 2, 4, 8, 16");
  EXPECT_REFUSED(x.setMicrosteps(32), "no 1/32 mode");
  EXPECT_EQ(x.state().microsteps, 16);
  EXPECT_EQ(bench.pulses(), 163);
}

TEST(Axis, MovesToTheNearestCommonPositionWhereThatIsWanted) {
  axis::AxisConfig config = linearAxis("x", chip::Model::kDrv8825);
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

TEST(Axis, CountsTheTranslatorFromHomeAfterAReset) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.move(163.0 / 80'000.0);
  x.reset();
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_DOUBLE_EQ(x.state().position, 163.0 / 80'000.0);
  x.setMicrosteps(1);  // the translator is at Home, wherever the count is
  EXPECT_DOUBLE_EQ(x.state().position, 163.0 / 80'000.0);
  x.wait(x.moveTo(0.0002, true));
  EXPECT_EQ(bench.pulses(), 164);
  EXPECT_DOUBLE_EQ(x.state().position, 163.0 / 80'000.0 + 0.0002);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, RefusesToSetTheMicrostepsOfATb6600) {
  Bench bench({linearAxis("x", chip::Model::kTb6600)});
  EXPECT_REFUSED(bench.axis().setMicrosteps(8), "DIP switches");
  EXPECT_REFUSED(bench.axis().sleep(true), "no SLEEP pin");
  EXPECT_REFUSED(bench.axis().reset(), "no RESET pin");
}

TEST(Axis, InvertsEverySignalOfACommonAnode) {
  axis::AxisConfig config = linearAxis("x", chip::Model::kTb6600);
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

TEST(Axis, SetsItsPositionWithoutAPulse) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  EXPECT_FALSE(x.state().position_valid);
  x.setPosition(0.25);
  EXPECT_TRUE(x.state().position_valid);
  EXPECT_DOUBLE_EQ(x.state().position, 0.25);
  EXPECT_EQ(bench.pulses(), 0);
  bench.move(0.26);
  EXPECT_EQ(bench.pulses(), 800);
}

TEST(Axis, FaultsWhereALineFailsAndStandsUntilRecovered) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  bench.rig.failWrites("x.step", 501, EIO);
  const axis::MoveResult result = x.wait(x.moveTo(0.05));
  EXPECT_EQ(result.end, axis::MoveEnd::kFault);
  EXPECT_NE(result.message.find("Input/output error"), std::string::npos) << result.message;
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_NE(x.state().fault.find("Input/output error"), std::string::npos);
  EXPECT_REFUSED(x.moveTo(0.0), "recover");
  EXPECT_THROW(x.recover(), GpioError);
  EXPECT_REFUSED(x.moveTo(0.0), "recover");
  bench.rig.clearWriteFault("x.step");
  x.recover();
  EXPECT_EQ(x.state().fault, "");
  const std::int64_t pulses = bench.pulses();
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.pulses(), pulses);
  EXPECT_EQ(bench.move(0.01).end, axis::MoveEnd::kReached);
  EXPECT_DOUBLE_EQ(x.state().position, 0.01);
}

TEST(Axis, GoesBackToTheOldModeAfterAModePinFailed) {
  Bench bench({linearAxis("x")});
  axis::Axis& x = bench.axis();
  bench.rig.failWrites("x.ms2", 0, EIO);
  EXPECT_THROW(x.setMicrosteps(1), GpioError);
  EXPECT_EQ(x.state().microsteps, 16);
  EXPECT_REFUSED(x.moveTo(0.01), "at fault");
  bench.rig.clearWriteFault("x.ms2");
  x.recover();
  bench.move(0.01);
  EXPECT_EQ(bench.report().microsteps, 16);
  EXPECT_EQ(bench.pulses(), 800);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, CountsStepsThatTheMotorLosesAsSent) {
  Bench bench({linearAxis("x")});
  sim::RigFaults faults;
  faults.lose_every = 10;
  bench.rig.setFaults("x", faults);
  bench.move(0.01);
  EXPECT_EQ(bench.pulses(), 800);
  EXPECT_DOUBLE_EQ(bench.axis().state().position, 0.01);
  EXPECT_NEAR(bench.report().carriage, 9.0, 1e-6);
}

TEST(Axis, MovesADistanceOfNothing) {
  Bench bench({linearAxis("x")});
  const axis::MoveResult result = bench.move(0.0);
  EXPECT_EQ(result.end, axis::MoveEnd::kReached);
  EXPECT_EQ(result.duration, 0.0);
  EXPECT_EQ(bench.report().pulses_forward, 0);
}

}  // namespace
}  // namespace stepdriver
