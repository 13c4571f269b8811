#include <gtest/gtest.h>

#include <chrono>
#include <cmath>
#include <string>
#include <thread>
#include <vector>

#include "support/bench.h"
#include "support/homing_bench.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using axis::MoveEnd;
using driver::FaultEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

// The rig's speed is real time: a thread reports the edge of an alarm some steps later, and later
// still on a busy computer.
constexpr double kSpeed = 1.0;

/// An axis whose driver has an alarm output that is high at a fault, as no named chip with RESET
/// has: 8000 steps/s, which it reaches and leaves within 400 steps.
config::AxisConfig alarmAxis(FaultEnd end, const std::string& name = "x") {
  config::AxisConfig config = linearAxis(name);
  config.driver.title = "box";
  config.driver.fault_active = true;
  config.driver.fault_name = "ALM";
  config.driver.fault_end = end;
  config.driver.timing.reset_low_ns = 3'000'000;
  config.fault = config::FaultPin{name + ".fault", Bias::kPullUp};
  return config;
}

sim::RigFaults brokenAfter(std::int64_t steps) {
  sim::RigFaults faults;
  faults.chip_fault_after = steps;
  return faults;
}

void expectAlarm(Bench& bench, const axis::MoveResult& result) {
  axis::Axis& x = bench.axis();
  EXPECT_EQ(result.end, MoveEnd::kFault);
  EXPECT_NE(result.message.find("the box reports a fault on ALM"), std::string::npos)
      << result.message;
  EXPECT_DOUBLE_EQ(x.state().position, static_cast<double>(bench.pulses()) / 80'000.0);
  EXPECT_FALSE(x.state().position_valid);
  EXPECT_FALSE(x.state().moving);
  EXPECT_REFUSED(x.moveTo(0.0), "at fault: the box reports a fault on ALM");
}

TEST(Alarm, EndsTheStepsAtOnceOrByARamp) {
  for (const bool ramps : {false, true}) {
    config::AxisConfig config = alarmAxis(FaultEnd::kReset);
    config.fault_ramps = ramps;
    Bench bench({config}, true, kSpeed);
    bench.axis().setPosition(0.0);
    bench.rig.setFaults("x", brokenAfter(2000));
    const axis::MoveResult result = bench.move(0.09);
    expectAlarm(bench, result);
    EXPECT_EQ(result.message.find("it stopped too fast") == std::string::npos, ramps)
        << result.message;
    EXPECT_LT(bench.pulses(), 7200);
    EXPECT_GT(bench.pulses(), ramps ? 2395 : 1999);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

TEST(Alarm, BeforeTheFirstStepOfAMotionLeavesNothingToRamp) {
  config::AxisConfig config = alarmAxis(FaultEnd::kReset);
  config.fault_ramps = true;
  Bench bench({config});
  bench.rig.setFaults("x", brokenAfter(0));
  bench.machine->advance(0.2);
  // The fault may be known only when the first step is due.
  test::refusal([&bench] { EXPECT_EQ(bench.move(0.01).end, MoveEnd::kFault); });
  EXPECT_NE(bench.axis().state().fault.find("the box reports a fault on ALM"), std::string::npos);
  EXPECT_EQ(bench.pulses(), 0);
}

TEST(Alarm, EndsByWhatTheDriverNeeds) {
  for (const FaultEnd end : {FaultEnd::kReset, FaultEnd::kEnable}) {
    Bench bench({alarmAxis(end)}, true, kSpeed);
    bench.rig.setFaults("x", brokenAfter(2000));
    expectAlarm(bench, bench.move(0.09));
    bench.rig.setFaults("x", {});
    bench.machine->recover();
    EXPECT_EQ(bench.axis().state().fault, "");
    EXPECT_TRUE(bench.axis().state().enabled);
    EXPECT_TRUE(bench.report().energized);
    EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
    EXPECT_EQ(bench.pulses(), 0);
    EXPECT_EQ(violationsOf(bench.report()), "") << static_cast<int>(end);
  }
}

TEST(Alarm, ThatIsNotLatchedEndsWithItsCause) {
  Bench bench({alarmAxis(FaultEnd::kItself)}, true, kSpeed);
  sim::RigFaults faults = brokenAfter(2000);
  faults.chip_fault_lasts_ns = 3'000'000'000;
  bench.rig.setFaults("x", faults);
  expectAlarm(bench, bench.move(0.09));
  EXPECT_REFUSED(bench.machine->recover(),
                 "still reports a fault on ALM; it ends by itself when its cause is gone");
  const auto bound = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  std::string refusal;
  do {
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
    EXPECT_NE(bench.axis().state().fault, "") << "only recover ends the fault of the axis";
    refusal = test::refusal([&bench] { bench.machine->recover(); });
  } while (!refusal.empty() && std::chrono::steady_clock::now() < bound);
  EXPECT_EQ(refusal, "");
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Alarm, ThatNoWiredLineEndsSaysSo) {
  config::AxisConfig no_enable = alarmAxis(FaultEnd::kEnable);
  no_enable.pins.enable.line.clear();
  for (const config::AxisConfig& config : {alarmAxis(FaultEnd::kPower), no_enable}) {
    Bench bench({config}, true, kSpeed);
    bench.rig.setFaults("x", brokenAfter(10));
    expectAlarm(bench, bench.move(0.09));
    EXPECT_REFUSED(bench.machine->recover(), "only switching its power off clears it");
    EXPECT_NE(bench.axis().state().fault, "");
  }
}

TEST(Alarm, IsNotEndedByAnEnableLineThatAnotherAxisNeeds) {
  std::vector<config::AxisConfig> configs = {alarmAxis(FaultEnd::kEnable), linearAxis("y")};
  for (config::AxisConfig& config : configs) config.pins.enable.line = "both.enable";
  Bench bench(configs, true, kSpeed);
  bench.axis("y").setPosition(0.0);
  bench.rig.setFaults("x", brokenAfter(10));
  expectAlarm(bench, bench.move(0.09));
  EXPECT_REFUSED(bench.machine->recover(), "keeps another axis enabled");
  EXPECT_TRUE(bench.axis("y").state().position_valid);
  bench.axis("y").enable(false);
  bench.machine->recover();
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

TEST(Alarm, OfADisabledMotorIsEndedBySwitchingItOn) {
  Bench bench({alarmAxis(FaultEnd::kEnable)}, true, kSpeed);
  bench.rig.setFaults("x", brokenAfter(10));
  expectAlarm(bench, bench.move(0.09));
  bench.rig.setFaults("x", {});
  bench.axis().enable(false);
  bench.machine->recover();
  EXPECT_FALSE(bench.axis().state().enabled);
  EXPECT_FALSE(bench.report().energized);
  bench.axis().enable(true);
  EXPECT_EQ(bench.move(0.0).end, MoveEnd::kReached);
}

TEST(Alarm, BringsTheAxesOfALineToRestOnIt) {
  config::AxisConfig x = alarmAxis(FaultEnd::kReset);
  x.fault_ramps = true;
  Bench bench({x, linearAxis("y")}, true, kSpeed);
  bench.rig.setFaults("x", brokenAfter(2000));
  motion::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.09, 0.045};
  const machine::CoordinatedMove move = bench.machine->moveLine(line);
  const machine::CoordinatedResult result = bench.machine->wait(move);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_NE(result.message.find("x stands at"), std::string::npos) << result.message;
  EXPECT_GT(bench.pulses("x"), 2395);
  EXPECT_LE(std::abs(bench.pulses("x") - 2 * bench.pulses("y")), 2) << "on the line";
  EXPECT_EQ(bench.axis("y").state().fault, "");
  EXPECT_TRUE(bench.axis("y").state().enabled);
}

TEST(Alarm, EndsAHomingByItsRamp) {
  config::AxisConfig config = test::homingAxis();
  const config::AxisConfig alarm = alarmAxis(FaultEnd::kReset);
  config.driver = alarm.driver;
  config.fault = alarm.fault;
  config.fault_ramps = true;
  Bench bench({config}, true, kSpeed);
  bench.rig.setFaults("x", brokenAfter(500));
  const axis::HomingResult result = bench.axis().home();
  EXPECT_EQ(result.end, axis::HomingEnd::kFailed);
  EXPECT_NE(result.message.find("the box reports a fault on ALM"), std::string::npos)
      << result.message;
  EXPECT_FALSE(bench.axis().state().homed);
  EXPECT_GT(std::abs(bench.pulses()), 500);
}

}  // namespace
}  // namespace stepdriver
