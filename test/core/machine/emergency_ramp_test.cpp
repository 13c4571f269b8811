#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "pulse/pulse_engine.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/recording_lines.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using machine::EmergencyDisable;
using test::Bench;
using test::kMillisecond;
using test::linearAxis;
using test::violationsOf;

constexpr std::int64_t kEngage = 40 * kMillisecond;
/// From 100 mm/s at 1000 mm/s^2.
constexpr double kRamp = 0.1;

/// Two axes at 100 mm/s and 1000 mm/s^2; x has a load that falls, and a brake.
class EmergencyRamp : public testing::Test {
 protected:
  EmergencyRamp() {
    axes = {linearAxis("x", "drv8825"), linearAxis("y")};
    axes[0].brake = config::BrakeConfig{"x.brake", true, 30 * kMillisecond, kEngage};
    axes[0].holds_position_unpowered = axes[1].holds_position_unpowered = true;
    axes[0].fault = config::FaultPin{"x.fault"};
    options.emergency_stop = config::InputSwitch{"button", true};
    options.emergency_disable = EmergencyDisable::kRamp;
  }

  void begin() {
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
    rig[0].load_falls = 10.0;
    bench = std::make_unique<Bench>(axes, rig, false, 0.0, options);
    for (const char* name : {"x", "y"}) bench->axis(name).setPosition(0.0);
  }

  /// Both axes at their top speed.
  void run() {
    for (const char* name : {"x", "y"}) bench->axis(name).moveTo(0.08);
    bench->machine->advance(0.4);
    ASSERT_NEAR(bench->axis("x").state().velocity, 0.1, 1e-6);
  }

  std::int64_t last(const char* pin, bool level) const {
    return bench->trace->times("x", pin, level).back();
  }

  void expectNoHarm() {
    bench->machine->advance(1.0);
    EXPECT_EQ(bench->report("x").fell, 0.0);
    for (const char* name : {"x", "y"}) EXPECT_EQ(violationsOf(bench->report(name)), "") << name;
  }

  std::vector<config::AxisConfig> axes;
  machine::MachineOptions options;
  std::unique_ptr<Bench> bench;
};

TEST_F(EmergencyRamp, DeceleratesAndTakesTheCurrentInTheOrderBrakeAndCurrent) {
  begin();
  const axis::Move move = bench->axis("x").moveTo(0.08);
  bench->machine->advance(0.4);
  const std::int64_t asked = bench->clock.now();
  const double at = bench->axis("x").state().position;
  bench->machine->emergencyStop();
  const double answered = 1e-9 * static_cast<double>(bench->clock.now() - asked);
  EXPECT_NEAR(answered, kRamp, 0.005) << "served is at rest";
  const std::int64_t pulses = bench->pulses("x");
  EXPECT_NEAR(bench->axis("x").state().position - at, 0.005, 0.0002);
  EXPECT_FALSE(bench->axis("x").state().moving);
  EXPECT_EQ(bench->axis("x").wait(move).end, axis::MoveEnd::kEmergencyStop);
  bench->machine->advance(1.0);
  EXPECT_EQ(bench->pulses("x"), pulses);
  EXPECT_EQ(last("enable", true), last("brake", false) + kEngage);
  EXPECT_FALSE(bench->report("y").energized);
  EXPECT_TRUE(bench->axis("x").state().position_valid);
  EXPECT_EQ(bench->axis("x").state().fault, "emergency stop");
  EXPECT_REFUSED(bench->axis("x").moveTo(0.0), "at fault");
  bench->machine->recover();
  EXPECT_REFUSED(bench->axis("x").moveTo(0.0), "disabled; enable it first");
  bench->axis("x").enable(true);
  EXPECT_EQ(bench->move(0.0, "x").end, axis::MoveEnd::kReached);
  EXPECT_NEAR(bench->report("x").carriage, 0.0, 1e-9);
  expectNoHarm();
}

TEST_F(EmergencyRamp, SlowsALineDownAlongItsPath) {
  begin();
  motion::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.06, 0.03};
  const machine::CoordinatedMove move = bench->machine->moveLine(line);
  bench->machine->advance(0.4);
  bench->machine->emergencyStop();
  EXPECT_EQ(bench->machine->wait(move).end, axis::MoveEnd::kEmergencyStop);
  const double x = bench->axis("x").state().position;
  EXPECT_GT(x, 0.01);
  EXPECT_NEAR(bench->axis("y").state().position, 0.5 * x, 2e-5);
  EXPECT_TRUE(bench->axis("y").state().position_valid);
  expectNoHarm();
}

TEST_F(EmergencyRamp, ComesByTheButtonTooAndItsBouncesDontEndIt) {
  begin();
  run();
  const auto button = [&](bool pressed) {
    bench->rig.setInput("button", pressed, bench->clock.now());
    bench->machine->advance(0.001);
  };
  for (const bool pressed : {true, false, true, false, true}) button(pressed);
  EXPECT_TRUE(bench->axis("x").state().moving);
  EXPECT_EQ(bench->axis("x").state().fault, "emergency stop input");
  bench->machine->advance(0.2);
  EXPECT_FALSE(bench->axis("x").state().moving);
  EXPECT_TRUE(bench->axis("x").state().position_valid);
  EXPECT_REFUSED(bench->machine->recover(), "is active; release it");
  expectNoHarm();
}

TEST_F(EmergencyRamp, EndsAtOnceAtASecondCall) {
  begin();
  run();
  bench->rig.setInput("button", true, bench->clock.now());
  bench->machine->advance(0.02);
  ASSERT_TRUE(bench->axis("x").state().moving);
  const std::int64_t pulses = bench->pulses("x");
  bench->machine->emergencyStop();
  EXPECT_LE(bench->pulses("x"), pulses + 1);
  EXPECT_FALSE(bench->axis("x").state().moving);
  EXPECT_FALSE(bench->axis("x").state().position_valid) << "it stopped at speed";
  expectNoHarm();
}

TEST_F(EmergencyRamp, RecoverIsRefusedUntilItIsOver) {
  begin();
  run();
  bench->rig.setInput("button", true, bench->clock.now());
  bench->machine->advance(0.02);
  bench->rig.setInput("button", false, bench->clock.now());
  bench->machine->advance(0.001);
  EXPECT_REFUSED(bench->machine->recover(), "an emergency stop has come meanwhile");
  EXPECT_REFUSED(bench->axis("x").moveTo(0.0), "at fault");
  bench->machine->advance(0.2);
  bench->machine->recover();
  EXPECT_FALSE(bench->machine->emergencyStopped());
  expectNoHarm();
}

TEST_F(EmergencyRamp, EndsAtOnceForAnAxisWhoseChipReportsAFault) {
  begin();
  run();
  bench->rig.setInput("button", true, bench->clock.now());
  bench->machine->advance(0.02);
  sim::RigFaults faults;
  faults.chip_fault_after = 0;
  bench->rig.setFaults("x", faults);
  bench->machine->advance(0.0);
  EXPECT_FALSE(bench->axis("x").state().moving);
  EXPECT_FALSE(bench->axis("x").state().position_valid);
  EXPECT_TRUE(bench->axis("y").state().moving);
  bench->machine->advance(0.2);
  EXPECT_TRUE(bench->axis("y").state().position_valid);
}

TEST_F(EmergencyRamp, AStopThatWasUnderWayContinues) {
  begin();
  run();
  bench->machine->stop();
  bench->machine->advance(0.02);
  bench->machine->emergencyStop();
  EXPECT_TRUE(bench->axis("x").state().position_valid);
  expectNoHarm();
}

TEST_F(EmergencyRamp, ThenTheMotorPowerGoes) {
  options.motor_power = config::MotorPowerConfig{};
  options.motor_power->line = "power";
  begin();
  run();
  bench->machine->emergencyStop();
  bench->machine->advance(1.0);
  EXPECT_EQ(last("enable", true), last("brake", false) + kEngage);
  ASSERT_EQ(bench->trace->times("machine", "motor_power", false).size(), 1U);
  EXPECT_GE(bench->trace->times("machine", "motor_power", false).back(), last("enable", true));
  expectNoHarm();
}

// ---- the engine alone: nobody orders a deceleration ----

class RampingEngine : public testing::Test {
 protected:
  RampingEngine() : lines(clock) {
    pulse::ChannelConfig channel;
    channel.step.line = 0;
    channel.dir.line = 1;
    channel.step_high = channel.step_low = 2'000;
    engine = std::make_unique<pulse::PulseEngine>(lines, clock, std::vector{channel}, 5'000'000);
    engine->rampStops(500 * kMillisecond);
    follow.serial = 1;
    follow.profile = &profile;
    command.follows = &follow;
    command.follow_count = 1;
  }

  void serveUntil(std::int64_t end) {
    for (;;) {
      const std::int64_t due = engine->serve();
      if (due > end) break;
      clock.waitUntil(due);
    }
    clock.waitUntil(end);
    engine->serve();
  }

  pulse::VirtualClock clock;
  test::RecordingLines lines;
  std::unique_ptr<pulse::PulseEngine> engine;
  motion::Profile profile{
      kMillisecond, {{motion::DoubleDouble(10.0), motion::DoubleDouble(0.0), 1000.0, 0.0, 0.0}}};
  pulse::Follow follow;
  pulse::Command command;
};

TEST_F(RampingEngine, StopsAtOnceIfNoDecelerationIsOrdered) {
  ASSERT_TRUE(engine->post(command));
  serveUntil(200 * kMillisecond);
  engine->emergencyStop();
  serveUntil(250 * kMillisecond);
  EXPECT_NE(engine->channel(0).following, 0U);
  EXPECT_EQ(engine->stopsServed(), 0U);
  EXPECT_EQ(engine->stopsRamping(), 1U);
  serveUntil(320 * kMillisecond);
  EXPECT_EQ(engine->channel(0).following, 0U);
  EXPECT_EQ(engine->channel(0).end, pulse::EndReason::kEmergencyStop);
  EXPECT_LE(engine->channel(0).count, 301);
  EXPECT_EQ(engine->stopsServed(), 1U);
}

TEST_F(RampingEngine, StopsAtOnceIfTheDecelerationTakesTooLong) {
  follow.slows = true;
  ASSERT_TRUE(engine->post(command));
  serveUntil(200 * kMillisecond);
  engine->emergencyStop();
  serveUntil(650 * kMillisecond);
  EXPECT_NE(engine->channel(0).following, 0U);
  serveUntil(720 * kMillisecond);
  EXPECT_EQ(engine->channel(0).following, 0U);
  EXPECT_EQ(engine->stopsServed(), 1U);
}

TEST_F(RampingEngine, FollowsOnlyWhatDecelerates) {
  ASSERT_TRUE(engine->post(command));
  serveUntil(200 * kMillisecond);
  engine->emergencyStop();
  serveUntil(201 * kMillisecond);
  const motion::Profile next{
      210 * kMillisecond,
      {{motion::DoubleDouble(0.1), motion::DoubleDouble(209.0), 1000.0, -10'000.0, 0.0}}};
  pulse::Follow then = follow;
  then.serial = 2;
  then.continues = 1;
  then.profile = &next;
  command.follows = &then;
  ASSERT_TRUE(engine->post(command));
  serveUntil(202 * kMillisecond);
  EXPECT_EQ(engine->channel(0).accepted, 1U);
  then.serial = 3;
  then.slows = true;
  ASSERT_TRUE(engine->post(command));
  serveUntil(203 * kMillisecond);
  EXPECT_EQ(engine->channel(0).accepted, 3U);
  serveUntil(400 * kMillisecond);
  EXPECT_EQ(engine->channel(0).end, pulse::EndReason::kDone);
  EXPECT_EQ(engine->stopsServed(), 1U);
}

TEST_F(RampingEngine, StopsAtOnceIfThatIsAskedFor) {
  ASSERT_TRUE(engine->post(command));
  serveUntil(200 * kMillisecond);
  engine->stopAtOnce();
  serveUntil(201 * kMillisecond);
  EXPECT_EQ(engine->channel(0).following, 0U);
  EXPECT_EQ(engine->stopsServed(), 1U);
}

}  // namespace
}  // namespace stepdriver
