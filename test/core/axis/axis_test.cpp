#include "stepdriver_core/axis/axis.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::rigAxis;
using test::violationsOf;

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
  config::AxisConfig config = linearAxis("x");
  config.min_position = -0.01;
  config.max_position = 0.02;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const double inf = std::numeric_limits<double>::infinity();
  EXPECT_REFUSED(x.moveTo(nan), "x: the position is nan m, but must be a finite number");
  EXPECT_REFUSED(x.moveTo(-inf), "the position is -inf m, but must be");
  EXPECT_REFUSED(
      x.moveTo(0.01, false, -0.05),
      "the velocity is -0.05 m/s, but must be a finite number above 0, or 0 for the maximum");
  EXPECT_REFUSED(x.moveTo(0.01, false, nan), "velocity");
  EXPECT_REFUSED(x.moveTo(0.01, false, -0.1), "velocity");
  EXPECT_REFUSED(x.moveTo(0.01, false, 0.11), "above the maximum 0.1 m/s");
  EXPECT_REFUSED(x.moveTo(0.0201), "above the soft limit max_position 0.02 m");
  EXPECT_REFUSED(x.moveTo(-0.0101), "below the soft limit min_position -0.01 m");
  EXPECT_REFUSED(x.moveTo(0.021, true), "soft limit");
  EXPECT_REFUSED(x.moveRounds(nan), "rounds is nan, but must be a finite number");
  EXPECT_REFUSED(x.moveRounds(1e300), "soft limit");
  EXPECT_REFUSED(x.setPosition(nan), "the position is nan m, but must be a finite number");
  EXPECT_REFUSED(x.setPosition(0.03), "soft limit");
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.report().pulses_forward + bench.report().pulses_backward, 0);
  EXPECT_EQ(x.state().position, 0.0);
  EXPECT_EQ(bench.move(0.02).end, axis::MoveEnd::kReached);
}

TEST(Axis, RefusesToMoveDisabledAsleepOrBusy) {
  config::AxisConfig config = linearAxis("x");
  config.enable_on_start = false;
  Bench bench({config});
  axis::Axis& x = bench.axis();
  EXPECT_REFUSED(x.moveTo(0.01), "disabled");
  x.enable(true);
  x.sleep(true);
  EXPECT_REFUSED(x.moveTo(0.01), "asleep");
  x.sleep(false);
  const axis::Move move = x.moveTo(0.01);
  EXPECT_REFUSED(x.sleep(true), "busy");
  EXPECT_REFUSED(x.reset(), "busy");
  EXPECT_REFUSED(x.setMicrosteps(8), "busy");
  EXPECT_REFUSED(x.setPosition(0.0), "busy");
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 800);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, EndsAtAnEndstopByNameWithTheExactCount) {
  std::vector<config::AxisConfig> configs = {linearAxis("x")};
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
  // From here, the axis may only move towards min.
  EXPECT_REFUSED(x.moveTo(0.001, true), "max endstop is active");
  EXPECT_EQ(x.wait(x.moveTo(-0.001, true)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 320);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Axis, DistrustsThePositionAfterAnEndstopAtSpeed) {
  config::AxisConfig config = linearAxis("x");
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

/// Moves of an axis x that nobody waits for, towards a min switch at -20 mm.
axis::AxisState stateAtTheSwitch(const config::AxisConfig& config, double target) {
  std::vector<sim::RigAxisSpec> specs = {rigAxis(config)};
  specs[0].min_switch->position = -20.0;
  Bench bench({config}, specs);
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  x.moveTo(target);
  bench.machine->advance(10.0);
  return x.state();
}

TEST(Axis, SaysInItsStateThatAMoveMetAnEndstop) {
  std::vector<sim::RigAxisSpec> specs = {rigAxis(linearAxis("x"))};
  specs[0].max_switch->position = 5.0;
  Bench bench({linearAxis("x")}, specs);
  axis::Axis& x = bench.axis();
  x.setPosition(0.0);
  EXPECT_EQ(x.state().stopped_by, "");
  x.moveTo(0.05, false, 0.01);
  bench.machine->advance(2.0);
  EXPECT_EQ(x.state().stopped_by, "the max endstop was met at 0.005 m");
  EXPECT_EQ(x.state().endstops_met, 1U);
  EXPECT_REFUSED(x.moveTo(0.001, true), "max endstop is active");
  EXPECT_NE(x.state().stopped_by, "") << "a refused motion hasn't begun";
  x.moveTo(-0.001, true);
  bench.machine->advance(0.01);
  EXPECT_EQ(x.state().stopped_by, "") << "the next motion has begun";
  EXPECT_EQ(x.state().endstops_met, 1U);
}

TEST(Axis, SaysThatAJogMetAnEndstop) {
  std::vector<sim::RigAxisSpec> specs = {rigAxis(linearAxis("x"))};
  specs[0].min_switch->position = -5.0;
  Bench bench({linearAxis("x")}, specs);
  bench.axis().jog(-0.01);
  bench.machine->advance(2.0);
  const std::string met = bench.axis().state().stopped_by;
  EXPECT_NE(met.find("the min endstop was met at -0.005 m"), std::string::npos) << met;
}

TEST(Axis, SaysHowToConfigureASwitchThatARotaryAxisPasses) {
  config::AxisConfig rotary = linearAxis("x");
  const std::string advice = "keep the axis within a turn by min_position_deg and max_position_deg";
  EXPECT_EQ(stateAtTheSwitch(rotary, -0.05).stopped_by.find(advice), std::string::npos);
  rotary.kind = config::Kind::kRotary;
  const std::string met = stateAtTheSwitch(rotary, -0.05).stopped_by;
  EXPECT_NE(met.find(advice), std::string::npos) << met;
  EXPECT_NE(met.find("remove endstops/min and homing"), std::string::npos) << met;
  EXPECT_EQ(stateAtTheSwitch(rotary, -0.01).stopped_by, "") << "it doesn't get to the switch";
  rotary.start_speed = rotary.max_speed;
  EXPECT_EQ(stateAtTheSwitch(rotary, -0.05).stopped_by, "the min endstop was met at -0.02 rad")
      << "it could stop there at once";
}

TEST(Axis, KnowsASwitchThatIsActiveAtTheStart) {
  std::vector<config::AxisConfig> configs = {linearAxis("x")};
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
  // v^2 / 2a = 5 mm, after the lead of a millisecond.
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
  EXPECT_NE(result.message.find("x.step"), std::string::npos) << result.message;
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_EQ(x.state().fault,
            "the STEP line x.step can't be written: EIO, input/output error; check the cable and "
            "the supply of its chip");
  EXPECT_REFUSED(x.moveTo(0.0), "recover");
  EXPECT_THROW(bench.machine->recover(), GpioError);
  EXPECT_REFUSED(x.moveTo(0.0), "recover");
  bench.rig.clearWriteFault("x.step");
  bench.machine->recover();
  EXPECT_EQ(x.state().fault, "");
  const std::int64_t pulses = bench.pulses();
  bench.machine->advance(1.0);
  EXPECT_EQ(bench.pulses(), pulses);
  EXPECT_EQ(bench.move(0.01).end, axis::MoveEnd::kReached);
  EXPECT_DOUBLE_EQ(x.state().position, 0.01);
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
