#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/corexy_bench.h"
#include "support/temporary_folder.h"

// What the drivers of motors that two axes share can do. Motor a has the pins of x, motor b those
// of y.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::coreXyAxes;
using test::kStep;
using test::violationsOf;

std::unique_ptr<Bench> benchOf(const std::vector<config::AxisConfig>& axes) {
  auto bench = std::make_unique<Bench>(axes);
  for (const auto& axis : bench->machine->axes()) axis->setPosition(0.0);
  return bench;
}

void expectNoViolations(Bench& bench) {
  for (const char* name : {"x", "y"}) EXPECT_EQ(violationsOf(bench.report(name)), "") << name;
}

/// Moves of both axes at a time, one of which turns round on its way, and their ends.
void expectExactMoves(Bench& bench) {
  const axis::Move of_x = bench.axis("x").moveTo(0.02);
  bench.machine->advance(0.05);
  bench.axis("y").moveTo(0.03);
  bench.machine->advance(0.1);
  const axis::Move of_y = bench.axis("y").moveTo(-0.01);
  EXPECT_EQ(bench.axis("x").wait(of_x).end, MoveEnd::kReached);
  EXPECT_EQ(bench.axis("y").wait(of_y).end, MoveEnd::kReached);
  EXPECT_EQ(bench.pulses("x"), 800);
  EXPECT_EQ(bench.pulses("y"), 2400);
  EXPECT_NEAR(bench.report("x").carriage, 20.0, 1e-9);
  EXPECT_NEAR(bench.report("y").carriage, -10.0, 1e-9);
  expectNoViolations(bench);
}

TEST(CoreXyDrivers, StepOnBothEdges) {
  std::vector<config::AxisConfig> axes = coreXyAxes();
  for (config::AxisConfig& axis : axes) axis.driver.both_edges = true;
  const auto bench = benchOf(axes);
  expectExactMoves(*bench);
  for (const char* name : {"x", "y"}) {
    const sim::RigAxisReport report = bench->report(name);
    const std::size_t edges = bench->trace->times(name, "step", true).size() +
                              bench->trace->times(name, "step", false).size();
    EXPECT_EQ(edges, static_cast<std::size_t>(report.pulses_forward + report.pulses_backward));
  }
}

TEST(CoreXyDrivers, OnlyOneStepsOnBothEdges) {
  std::vector<config::AxisConfig> axes = coreXyAxes();
  axes[1].driver.both_edges = true;
  const auto bench = benchOf(axes);
  expectExactMoves(*bench);
}

TEST(CoreXyDrivers, HaveCwAndCcwInputs) {
  for (const bool both : {true, false}) {
    std::vector<config::AxisConfig> axes = coreXyAxes();
    axes[0].driver.step_inputs = driver::StepInputs::kCwCcw;
    if (both) axes[1].driver.step_inputs = driver::StepInputs::kCwCcw;
    const auto bench = benchOf(axes);
    expectExactMoves(*bench);
    // Motor a runs backward for a while: those are pulses on its other line.
    EXPECT_GT(bench->report("x").pulses_backward, 0);
    EXPECT_EQ(bench->trace->times("x", "ccw", true).size(),
              static_cast<std::size_t>(bench->report("x").pulses_backward));
  }
}

TEST(CoreXyDrivers, KeepTheTimesOfEach) {
  std::vector<config::AxisConfig> axes = coreXyAxes();
  axes[1].driver.timing.step_high_ns = 20'000;
  axes[1].driver.timing.step_low_ns = 20'000;
  axes[1].driver.timing.dir_setup_ns = 400'000;
  axes[1].driver.timing.dir_hold_ns = 120'000;
  const auto bench = benchOf(axes);
  expectExactMoves(*bench);
}

TEST(CoreXyDrivers, AreAllInPositionBeforeAMotionHasEnded) {
  std::vector<config::AxisConfig> axes = coreXyAxes();
  for (config::AxisConfig& axis : axes) {
    axis.driver.in_position_active = true;
    axis.driver.in_position_name = "PEND";
    axis.in_position = config::InPositionPin{axis.name + ".in_position", Bias::kAsIs, 0.2};
  }
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
  rig[1].settling_ns = 50'000'000;
  Bench bench(axes, rig);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  // Both motors turn for a move of x, so that of y must have settled too.
  const std::int64_t began = bench.clock.now();
  EXPECT_EQ(bench.move(0.001, "x").end, MoveEnd::kReached);
  const std::int64_t last = bench.trace->times("y", "step", true).back();
  EXPECT_GT(last, began);
  EXPECT_GE(bench.clock.now(), last + 50'000'000);
  sim::RigFaults faults;
  faults.never_in_position = true;
  bench.rig.setFaults("y", faults);
  const axis::MoveResult result = bench.move(0.002, "x");
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find("of y isn't in position: PEND was still inactive 200 ms"),
            std::string::npos)
      << result.message;
  for (const char* name : {"x", "y"}) EXPECT_FALSE(bench.axis(name).state().position_valid);
  bench.rig.setFaults("y", {});
  bench.machine->recover();
  EXPECT_EQ(bench.axis("x").wait(bench.axis("x").moveTo(0.001, true)).end, MoveEnd::kReached);
  expectNoViolations(bench);
}

// A thread reports the edge of a fault output, so this is on the rig in real time.
TEST(CoreXyDrivers, ThatReportAFaultStopBothAxesByARamp) {
  std::vector<config::AxisConfig> axes{test::linearAxis("x", "drv8825"),
                                       test::linearAxis("y", "drv8825")};
  test::share(axes, {{1.0, 1.0}, {1.0, -1.0}});
  for (config::AxisConfig& axis : axes) {
    axis.fault = config::FaultPin{axis.name + ".fault"};
    axis.fault_ramps = true;
  }
  Bench bench(axes, true, 1.0);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  sim::RigFaults faults;
  faults.chip_fault_after = 3000;
  bench.rig.setFaults("y", faults);
  const axis::Move of_x = bench.axis("x").moveTo(0.09);
  const axis::Move of_y = bench.axis("y").moveTo(-0.09);
  for (const auto& [name, move] : {std::pair("x", of_x), std::pair("y", of_y)}) {
    const axis::MoveResult result = bench.axis(name).wait(move);
    EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
    EXPECT_EQ(result.message.find("it stopped too fast"), std::string::npos) << result.message;
    const axis::AxisState state = bench.axis(name).state();
    EXPECT_NE(state.fault.find("of y reports a fault on nFAULT"), std::string::npos) << state.fault;
    EXPECT_FALSE(state.position_valid);
  }
  // Motor b has made at least the steps of a ramp after the fault: from 0.2 m/s at 1 m/s^2 each.
  EXPECT_GT(bench.pulses("y"), 3000 + 400);
  EXPECT_LT(bench.pulses("y"), 14'400);
  expectNoViolations(bench);
}

// The chip is that of the axis at rest, whose motor turns for the other one too.
TEST(CoreXyDrivers, ThatReportAFaultSayWhyTheOtherAxisWasStopped) {
  for (const char* moved : {"x", "y"}) {
    std::vector<config::AxisConfig> axes{test::linearAxis("x", "drv8825"),
                                         test::linearAxis("y", "drv8825")};
    test::share(axes, {{1.0, 1.0}, {1.0, -1.0}});
    for (config::AxisConfig& axis : axes) axis.fault = config::FaultPin{axis.name + ".fault"};
    // As above, in real time.
    Bench bench(axes, true, 1.0);
    for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
    sim::RigFaults faults;
    faults.chip_fault_after = 500;
    const std::string other = moved == std::string("x") ? "y" : "x";
    bench.rig.setFaults(other, faults);
    const axis::MoveResult result = bench.move(0.09, moved);
    EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
    EXPECT_NE(result.message.find("reports a fault on nFAULT"), std::string::npos)
        << result.message;
  }
}

// ---- over a restart ----

class CoreXyStateFile : public testing::Test {
 protected:
  void start(std::vector<config::AxisConfig> axes) {
    bench.reset();
    for (config::AxisConfig& axis : axes) axis.holds_position_unpowered = true;
    machine::MachineOptions options;
    options.state_file = folder.path() + "/state";
    bench = std::make_unique<Bench>(axes, Bench::rigAxes(axes), false, 0.0, options);
  }

  const test::TemporaryFolder folder;
  std::unique_ptr<Bench> bench;
};

TEST_F(CoreXyStateFile, BringsBothPositionsBack) {
  start(coreXyAxes());
  for (const auto& axis : bench->machine->axes()) axis->setPosition(0.0);
  // Both motors at Home, which is every 0.8 mm.
  EXPECT_EQ(bench->move(0.008, "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench->move(-0.0016, "y").end, MoveEnd::kReached);
  start(coreXyAxes());
  EXPECT_NEAR(bench->axis("x").state().position, 0.008, 1e-9);
  EXPECT_NEAR(bench->axis("y").state().position, -0.0016, 1e-9);
  for (const char* name : {"x", "y"}) EXPECT_TRUE(bench->axis(name).state().position_valid);
  EXPECT_EQ(bench->move(0.0, "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("x"), -640);
  EXPECT_EQ(bench->pulses("y"), -640);
}

// x alone says nothing about Home: its motors are away from there because of y.
TEST_F(CoreXyStateFile, DoesNotTrustAnyAxisIfAChipBeganElsewhere) {
  start(coreXyAxes());
  for (const auto& axis : bench->machine->axes()) axis->setPosition(0.0);
  EXPECT_EQ(bench->move(0.008, "x").end, MoveEnd::kReached);
  EXPECT_EQ(bench->move(3 * kStep, "y").end, MoveEnd::kReached);
  start(coreXyAxes());
  EXPECT_NEAR(bench->axis("x").state().position, 0.008, 1e-9);
  EXPECT_NEAR(bench->axis("y").state().position, 3 * kStep, 1e-9);
  for (const char* name : {"x", "y"}) EXPECT_FALSE(bench->axis(name).state().position_valid);
}

// Stopped abruptly, an axis may stand between two of its microsteps, and its motors elsewhere.
TEST_F(CoreXyStateFile, KeepsAPlaceBetweenTwoMicrosteps) {
  start(coreXyAxes());
  for (const auto& axis : bench->machine->axes()) axis->setPosition(0.0);
  std::int64_t a = 0;
  std::int64_t b = 0;
  for (int i = 0; i < 50 && (a - b) % 2 == 0; ++i) {
    bench->axis("x").moveTo(0.05, false, 0.03);
    bench->axis("y").moveTo(0.03, false, 0.01);
    bench->machine->advance(0.05 + 1e-5 * i);
    bench->machine->emergencyStop();
    a = bench->pulses("x");
    b = bench->pulses("y");
    bench->machine->recover();
  }
  ASSERT_NE((a - b) % 2, 0) << "no stop has ended between two microsteps";
  const double x = static_cast<double>(a + b) / 2.0 * kStep;
  const double y = static_cast<double>(a - b) / 2.0 * kStep;
  EXPECT_NEAR(bench->axis("x").state().position, x, 1e-12);
  start(coreXyAxes());
  EXPECT_NEAR(bench->axis("x").state().position, x, 1e-9);
  EXPECT_NEAR(bench->axis("y").state().position, y, 1e-9);
}

}  // namespace
}  // namespace stepdriver
