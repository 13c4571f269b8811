#include <gtest/gtest.h>

#include <cerrno>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/recording.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using machine::EmergencyDisable;
using test::Bench;
using test::kMillisecond;
using test::linearAxis;
using test::violationsOf;

constexpr const char* kPowerLine = "power";
constexpr const char* kFeedback = "power.feedback";
constexpr std::int64_t kOn = 200 * kMillisecond;
constexpr std::int64_t kOffDelay = 300 * kMillisecond;
constexpr std::int64_t kFeedbackTimeout = 500 * kMillisecond;
constexpr std::int64_t kBrakeEngage = 40 * kMillisecond;

/// x carries a load that falls, and has a brake; y has neither.
class MotorPower : public testing::Test {
 protected:
  MotorPower() {
    axes = {linearAxis("x", "drv8825"), linearAxis("y")};
    axes[0].brake = config::BrakeConfig{"x.brake", true, 30 * kMillisecond, kBrakeEngage};
    options.emergency_stop = config::InputSwitch{"button", true};
    options.record_seconds = 60.0;
    options.motor_power = config::MotorPowerConfig{};
    options.motor_power->line = kPowerLine;
    options.motor_power->on_ns = kOn;
    options.motor_power->off_delay_ns = kOffDelay;
  }

  void addFeedback() {
    options.motor_power->feedback = config::InputSwitch{kFeedback, false};
    options.motor_power->feedback_timeout_ns = kFeedbackTimeout;
  }

  void begin() {
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
    rig[0].load_falls = 10.0;
    bench = std::make_unique<Bench>(axes, rig, false, 0.0, options);
  }

  /// Times at which the line of the relay, or a pin of x, took a level.
  std::vector<std::int64_t> switched(bool on) const {
    return bench->trace->times("machine", "motor_power", on);
  }
  std::int64_t last(const char* pin, bool level) const {
    const std::vector<std::int64_t> times = bench->trace->times("x", pin, level);
    return times.empty() ? -1 : times.back();
  }

  void expectNoHarm() {
    bench->rig.setInput("nothing", false, bench->clock.now());
    EXPECT_EQ(bench->report("x").fell, 0.0);
    for (const char* name : {"x", "y"}) EXPECT_EQ(violationsOf(bench->report(name)), "") << name;
  }
  std::string fault(const std::string& axis = "x") const { return bench->axis(axis).state().fault; }
  axis::MoveEnd moveX(double position) { return bench->move(position, "x").end; }

  std::vector<config::AxisConfig> axes;
  machine::MachineOptions options;
  std::unique_ptr<Bench> bench;
};

TEST_F(MotorPower, ComesBeforeTheFirstMotorIsEnabledAndEachWaitsForIt) {
  begin();
  ASSERT_EQ(switched(true).size(), 1U);
  const std::int64_t on = switched(true).front();
  // After it, the chip needs a millisecond from its reset on.
  EXPECT_GE(last("enable", false), on + kOn);
  EXPECT_LE(last("enable", false), on + kOn + 2 * kMillisecond);
  EXPECT_GE(last("reset", true), on + kOn);
  EXPECT_GE(last("brake", true), on + kOn);
  EXPECT_TRUE(bench->report("y").energized);
  EXPECT_TRUE(bench->axis("y").state().powered);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, StaysOffUntilTheFirstMotorIsEnabled) {
  for (config::AxisConfig& axis : axes) axis.enable_on_start = false;
  begin();
  bench->machine->advance(1.0);
  EXPECT_TRUE(switched(true).empty());
  EXPECT_FALSE(bench->axis("x").state().powered);
  bench->axis("y").enable(true);
  ASSERT_EQ(switched(true).size(), 1U);
  EXPECT_EQ(bench->trace->times("y", "enable", false).back(), switched(true).front() + kOn);
  bench->axis("x").enable(true);
  EXPECT_EQ(switched(true).size(), 1U);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

// Its ENABLE isn't wired: it has current as soon as there is power.
TEST_F(MotorPower, ComesForAMotorThatNothingElseSwitches) {
  axes[0].enable_on_start = false;
  axes[1].pins.enable.line.clear();
  begin();
  EXPECT_EQ(switched(true).size(), 1U);
  EXPECT_EQ(bench->move(0.001, "y").end, axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, GoesAtAnEmergencyStopAfterItsDelayAndTheBrakeAndStaysOffUntilRecover) {
  begin();
  for (const std::int64_t delay : {std::int64_t{0}, kOffDelay}) {
    options.motor_power->off_delay_ns = delay;
    begin();
    moveX(0.002);
    const std::int64_t before = bench->clock.now();
    bench->machine->emergencyStop();
    bench->machine->advance(1.0);
    ASSERT_EQ(switched(false).size(), 1U);
    const std::int64_t off = switched(false).front();
    EXPECT_EQ(off, std::max(before + delay, last("brake", false) + kBrakeEngage));
    EXPECT_FALSE(bench->report("x").energized);
    EXPECT_FALSE(bench->report("y").energized);
    EXPECT_FALSE(bench->axis("y").state().enabled);
    EXPECT_FALSE(bench->axis("y").state().powered);
    EXPECT_FALSE(bench->axis("y").state().position_valid);
    EXPECT_TRUE(bench->axis("x").state().brake_engaged);
    bench->machine->advance(5.0);
    EXPECT_EQ(switched(true).size(), 1U);
    bench->machine->recover();
    EXPECT_EQ(switched(true).size(), 2U);
    EXPECT_GE(last("brake", true), switched(true).back() + kOn);
    EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
    expectNoHarm();
  }
}

TEST_F(MotorPower, WithDisableOffGoesWhenEachMotorIsDisabledAndComesWithTheFirstEnable) {
  options.emergency_disable = EmergencyDisable::kOff;
  options.motor_power->off_delay_ns = 0;
  begin();
  moveX(0.002);
  bench->machine->emergencyStop();
  bench->machine->advance(1.0);
  ASSERT_EQ(switched(false).size(), 1U);
  EXPECT_EQ(last("enable", true), last("brake", false) + kBrakeEngage);
  EXPECT_GE(switched(false).front(), last("enable", true));
  bench->machine->recover();
  EXPECT_EQ(fault(), "");
  EXPECT_EQ(switched(true).size(), 1U) << "no motor is to have current";
  EXPECT_REFUSED(bench->axis("x").moveTo(0.001), "disabled; enable it first");
  bench->axis("x").enable(true);
  EXPECT_EQ(switched(true).size(), 2U);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, StaysIfRecoverComesBeforeItHasGone) {
  begin();
  bench->machine->emergencyStop();
  bench->machine->advance(0.1);
  bench->machine->recover();
  bench->machine->advance(1.0);
  EXPECT_TRUE(switched(false).empty());
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, IsNotSwitchedOnByAnEmergencyStopThatComesWhileItComes) {
  for (config::AxisConfig& axis : axes) axis.enable_on_start = false;
  begin();
  // The button is pressed before: the power isn't wanted at all.
  bench->rig.setInput("button", true, bench->clock.now());
  bench->machine->advance(0.01);
  EXPECT_REFUSED(bench->axis("x").enable(true), "at fault");
  EXPECT_TRUE(switched(true).empty());
  bench->rig.setInput("button", false, bench->clock.now());
  bench->machine->recover();
  bench->axis("x").enable(true);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, IsOffAtTheStartWhileTheButtonIsPressed) {
  std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
  pulse::VirtualClock clock;
  auto trace = std::make_shared<sim::MemoryTrace>();
  sim::Rig own(rig, trace, {}, Bench::motorPowerOf(options));
  own.setInput("button", true, 0);
  gpio::SimulatedBackend backend(own, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine(axes, backend, clock, options);
  machine.advance(1.0);
  EXPECT_TRUE(trace->times("machine", "motor_power", true).empty());
  own.setInput("button", false, clock.now());
  machine.recover();
  EXPECT_TRUE(trace->times("machine", "motor_power", true).empty());
  machine.axis("x").enable(true);
  EXPECT_EQ(trace->times("machine", "motor_power", true).size(), 1U);
}

TEST_F(MotorPower, GoesLastAtTheEnd) {
  axes[1].disable_on_shutdown = false;
  begin();
  moveX(0.002);
  bench->machine->shutdown();
  ASSERT_EQ(switched(false).size(), 1U);
  EXPECT_EQ(last("enable", true), last("brake", false) + kBrakeEngage);
  EXPECT_GE(switched(false).front(), last("enable", true));
  EXPECT_FALSE(bench->report("y").energized);
  bench->machine->advance(1.0);
  expectNoHarm();
}

// ---- the feedback ----

TEST_F(MotorPower, WaitsForItsFeedback) {
  addFeedback();
  options.motor_power->on_ns = 20 * kMillisecond;
  axes[0].enable_on_start = axes[1].enable_on_start = false;
  begin();
  bench->rig.stickMotorPower(false, bench->clock.now());
  const std::int64_t begun = bench->clock.now();
  EXPECT_THROW(bench->axis("x").enable(true), GpioError);
  EXPECT_GE(bench->clock.now(), begun + kFeedbackTimeout);
  for (const char* name : {"x", "y"}) {
    EXPECT_EQ(fault(name),
              "the motor power isn't there: its feedback line power.feedback was still inactive "
              "500 ms after the line power had switched it on");
  }
  bench->machine->advance(0.01);
  EXPECT_EQ(switched(false).size(), 1U);
  EXPECT_FALSE(bench->report("x").energized);
  bench->rig.stickMotorPower({}, bench->clock.now());
  bench->machine->recover();
  bench->axis("x").enable(true);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, ThatDoesNotComeAtTheStartLeavesAMachineAtFaultThatRecovers) {
  addFeedback();
  pulse::VirtualClock clock;
  sim::Rig own(Bench::rigAxes(axes), nullptr, {}, Bench::motorPowerOf(options));
  own.stickMotorPower(false, 0);
  gpio::SimulatedBackend backend(own, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine(axes, backend, clock, options);
  EXPECT_NE(machine.axis("y").state().fault.find("the motor power isn't there"), std::string::npos);
  EXPECT_FALSE(machine.axis("y").state().enabled);
  EXPECT_THROW(machine.axis("y").enable(true), Error);
  own.stickMotorPower({}, clock.now());
  machine.recover();
  machine.axis("y").enable(true);
  EXPECT_EQ(machine.axis("y").wait(machine.axis("y").moveTo(0.001)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(own.report("y").totalViolations(), 0);
}

TEST_F(MotorPower, ThatIsLostInAMotionIsAnEmergencyStopOfEveryAxisWithItsOwnReason) {
  addFeedback();
  begin();
  const axis::Move move = bench->axis("x").moveTo(0.08);
  bench->machine->advance(0.3);
  bench->rig.stickMotorPower(false, bench->clock.now());
  bench->machine->advance(0.001);
  const std::int64_t pulses = bench->pulses("x");
  bench->machine->advance(1.0);
  EXPECT_EQ(bench->pulses("x"), pulses);
  EXPECT_TRUE(bench->machine->emergencyStopped());
  for (const char* name : {"x", "y"}) {
    EXPECT_EQ(fault(name),
              "the motor power was lost: its feedback line power.feedback is inactive");
    EXPECT_FALSE(bench->axis(name).state().position_valid) << name;
  }
  EXPECT_NE(bench->axis("x").wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(switched(false).size(), 1U) << "it must not come again by itself";
  bench->rig.stickMotorPower({}, bench->clock.now());
  bench->machine->advance(1.0);
  EXPECT_FALSE(bench->report("y").energized);
  bench->machine->recover();
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
}

// y stays in its place without current, but its chip begins again at Home.
TEST_F(MotorPower, ThatIsLostAtRestLeavesThePositionsThatNothingHasHeld) {
  addFeedback();
  axes[1].holds_position_unpowered = true;
  begin();
  for (const std::int64_t steps : {0, 7}) {
    for (const char* name : {"x", "y"}) bench->axis(name).setPosition(0.0);
    if (steps != 0) bench->move(static_cast<double>(steps) / 80'000.0, "y");
    bench->rig.stickMotorPower(false, bench->clock.now());
    bench->machine->advance(0.2);
    EXPECT_FALSE(bench->axis("x").state().position_valid);
    EXPECT_EQ(bench->axis("y").state().position_valid, steps == 0);
    bench->rig.stickMotorPower({}, bench->clock.now());
    bench->machine->recover();
    EXPECT_EQ(fault(), "");
  }
}

TEST_F(MotorPower, ThatStaysAfterItWasSwitchedOffIsAFaultAndIsNotSwitchedOnAgain) {
  addFeedback();
  options.motor_power->off_delay_ns = 0;
  begin();
  bench->rig.stickMotorPower(true, bench->clock.now());
  bench->machine->emergencyStop();
  bench->machine->advance(1.0);
  EXPECT_NE(fault("y").find("its feedback line power.feedback was still active after 500 ms"),
            std::string::npos)
      << fault("y");
  EXPECT_THROW(bench->machine->recover(), Error);
  EXPECT_EQ(switched(true).size(), 1U);
  bench->rig.stickMotorPower({}, bench->clock.now());
  bench->machine->recover();
  EXPECT_EQ(switched(true).size(), 2U);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

// ---- its line ----

TEST_F(MotorPower, WhoseLineCantBeWrittenIsAFaultThatNamesIt) {
  axes[0].enable_on_start = axes[1].enable_on_start = false;
  begin();
  bench->rig.failWrites(kPowerLine, 0, EIO);
  EXPECT_THROW(bench->axis("x").enable(true), GpioError);
  EXPECT_NE(fault("y").find("the motor power line power can't be written"), std::string::npos)
      << fault("y");
  EXPECT_FALSE(bench->report("x").energized);
  bench->rig.clearWriteFault(kPowerLine);
  bench->machine->advance(0.1);
  bench->machine->recover();
  bench->axis("x").enable(true);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  bench->rig.failWrites(kPowerLine, 0, EIO);
  EXPECT_THROW(bench->machine->shutdown(), GpioError);
}

TEST_F(MotorPower, ThatCouldNotBeSwitchedOffIsSwitchedOffBeforeItComesAgain) {
  addFeedback();
  options.motor_power->off_delay_ns = 0;
  begin();
  bench->rig.failWrites(kPowerLine, 0, EIO);
  bench->machine->emergencyStop();
  bench->machine->advance(1.0);
  EXPECT_NE(fault("y").find("the motor power line power can't be written"), std::string::npos)
      << fault("y");
  EXPECT_TRUE(switched(false).empty());
  bench->rig.clearWriteFault(kPowerLine);
  bench->machine->recover();
  EXPECT_EQ(switched(false).size(), 1U);
  EXPECT_EQ(switched(true).size(), 2U);
  EXPECT_EQ(moveX(0.001), axis::MoveEnd::kReached);
  expectNoHarm();
}

TEST_F(MotorPower, IsRecorded) {
  begin();
  bench->machine->emergencyStop();
  bench->machine->advance(1.0);
  const machine::Recording recording = bench->machine->recording();
  std::size_t edges = 0;
  for (const machine::Recording::Pin& pin : recording.pins) {
    if (pin.axis != "machine" || pin.name != "motor_power") continue;
    EXPECT_TRUE(pin.active);
    for (const machine::Recording::Edge& edge : recording.edges) edges += edge.output == pin.output;
  }
  EXPECT_EQ(edges, 2U);
}

}  // namespace
}  // namespace stepdriver
