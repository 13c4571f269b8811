// Drivers that take their steps in other ways: CW and CCW inputs, and steps on both edges.
#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <cstdlib>
#include <string>
#include <vector>

#include "support/bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::violationsOf;

config::AxisConfig cwCcwAxis(const std::string& name = "x") {
  config::AxisConfig config = test::linearAxis(name, "dm542");
  config.pins = {};
  config.pins.step.line = name + ".cw";
  config.pins.dir.line = name + ".ccw";
  config.driver.step_inputs = driver::StepInputs::kCwCcw;
  return config;
}

config::AxisConfig bothEdgesAxis(const std::string& name = "x") {
  config::AxisConfig config = test::linearAxis(name, "tb6600");
  config.driver.both_edges = true;
  return config;
}

std::size_t edgesOf(const Bench& bench, const std::string& pin) {
  return bench.trace->times("x", pin, true).size() + bench.trace->times("x", pin, false).size();
}

TEST(CwCcw, MakesStepsForwardOnOneLineAndStepsBackwardOnTheOther) {
  for (const bool inverted : {false, true}) {
    config::AxisConfig config = cwCcwAxis();
    config.pins.step.inverted = config.pins.dir.inverted = inverted;
    Bench bench({config});
    EXPECT_EQ(bench.move(0.01).end, MoveEnd::kReached);
    EXPECT_EQ(bench.trace->times("x", "cw", !inverted).size(), 800U);
    EXPECT_EQ(edgesOf(bench, "ccw"), 0U);
    EXPECT_EQ(bench.move(-0.005).end, MoveEnd::kReached);
    EXPECT_EQ(bench.trace->times("x", "cw", !inverted).size(), 800U);
    EXPECT_EQ(bench.trace->times("x", "ccw", !inverted).size(), 1200U);
    EXPECT_EQ(bench.report().pulses_forward, 800);
    EXPECT_EQ(bench.report().pulses_backward, 1200);
    EXPECT_NEAR(bench.report().carriage, -5.0, 1e-9);
    EXPECT_DOUBLE_EQ(bench.axis().state().position, -0.005);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(CwCcw, TurnsInMotionWithTheTimeBetweenThePulsesOfTheTwoLines) {
  config::AxisConfig config = cwCcwAxis();
  config.driver.timing.dir_setup_ns = 3'000'000;
  config.driver.timing.dir_hold_ns = 120'000;
  Bench bench({config});
  bench.axis().moveTo(0.02);
  for (int i = 0; i < 20; ++i) {
    bench.machine->advance(0.07);
    bench.axis().moveTo(i % 2 == 0 ? -0.02 : 0.02);
  }
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_GT(bench.report().pulses_backward, 1000);
  EXPECT_NEAR(bench.report().carriage, 0.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(CwCcw, NamesTheLineThatFailsAndRecovers) {
  Bench bench({cwCcwAxis()});
  bench.rig.failWrites("x.ccw", 21, EIO);
  const axis::MoveResult result = bench.move(-0.01);
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find("the CCW line x.ccw can't be written"), std::string::npos)
      << result.message;
  EXPECT_EQ(bench.pulses(), -11) << "the last pulse could not be ended";
  bench.rig.clearWriteFault("x.ccw");
  bench.machine->recover();
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(BothEdges, MakesAStepWithEachEdge) {
  Bench bench({bothEdgesAxis()});
  EXPECT_EQ(bench.move(0.01).end, MoveEnd::kReached);
  EXPECT_EQ(edgesOf(bench, "step"), 800U);
  EXPECT_EQ(bench.report().pulses_forward, 800);
  EXPECT_EQ(bench.move(0.0005).end, MoveEnd::kReached);
  EXPECT_EQ(bench.move(0.0005125).end, MoveEnd::kReached) << "one step: an odd number of them";
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 0);
  EXPECT_NEAR(bench.report().carriage, 0.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(BothEdges, HasTheStepTimesOfADriverWithOneEdge) {
  config::AxisConfig one = bothEdgesAxis();
  one.driver.both_edges = false;
  std::vector<std::vector<std::int64_t>> times;
  for (const config::AxisConfig& config : {bothEdgesAxis(), one}) {
    Bench bench({config});
    bench.move(0.02);
    times.push_back(bench.trace->times("x", "step", true));
    if (!config.driver.both_edges) continue;
    const auto falls = bench.trace->times("x", "step", false);
    times.back().insert(times.back().end(), falls.begin(), falls.end());
    std::sort(times.back().begin(), times.back().end());
  }
  EXPECT_EQ(times[0], times[1]);
}

TEST(BothEdges, ReachesTwiceTheRateWithoutAViolation) {
  config::AxisConfig config = bothEdgesAxis();
  config.driver.timing.step_high_ns = 5'000;
  config.driver.timing.step_low_ns = 4'000;
  config.max_speed = 200'000.0 / config.steps_per_unit;
  config.acceleration = config.deceleration = 100.0;
  Bench bench({config});
  EXPECT_EQ(bench.move(0.09).end, MoveEnd::kReached);
  EXPECT_EQ(bench.move(-0.09).end, MoveEnd::kReached);
  EXPECT_EQ(violationsOf(bench.report()), "");
  EXPECT_NEAR(bench.report().carriage, -90.0, 1e-9);
}

TEST(BothEdges, CountsOnlyTheEdgesThatWentOutIfALineFails) {
  Bench bench({bothEdgesAxis()});
  bench.rig.failWrites("x.step", 11, EIO);
  EXPECT_EQ(bench.move(0.01).end, MoveEnd::kFault);
  EXPECT_EQ(bench.pulses(), 11);
  EXPECT_DOUBLE_EQ(bench.axis().state().position, 11.0 / 80'000.0);
  bench.rig.clearWriteFault("x.step");
  bench.machine->recover();
  EXPECT_EQ(bench.pulses(), 11) << "no step by going back to the level at rest";
  EXPECT_EQ(bench.move(0.01).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses(), 800);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(BothEdges, MakesNoStepAtTheEndOfTheMachine) {
  config::AxisConfig config = bothEdgesAxis();
  config.disable_on_shutdown = false;
  Bench bench({config});
  bench.move(101.0 / 80'000.0);
  bench.machine.reset();
  EXPECT_EQ(bench.pulses(), 101);
}

}  // namespace
}  // namespace stepdriver
