#include <gtest/gtest.h>

#include <cerrno>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "stepdriver_core/pulse/pulse_engine.h"
#include "support/bench.h"
#include "support/recording_lines.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr const char* kLine = "stop";

machine::MachineOptions withInput(bool active_level) {
  machine::MachineOptions options;
  options.emergency_stop = axis::InputSwitch{kLine, active_level, gpio::Bias::kPullUp};
  return options;
}

/// Two axes, and a button that opens a contact to ground: high is stop.
class EmergencyStopInput : public testing::Test {
 protected:
  void make(const std::vector<axis::AxisConfig>& axes, bool threaded = false, double speed = 0.0) {
    bench = std::make_unique<Bench>(axes, Bench::rigAxes(axes), threaded, speed, withInput(true));
  }

  void press(bool pressed) { bench->rig.setInput(kLine, pressed, bench->clock.now()); }

  /// Whether the machine has accepted it.
  bool recovers() {
    try {
      bench->machine->recover();
    } catch (const Error&) {
      return false;
    }
    return true;
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(EmergencyStopInput, EndsEveryMotionWithoutAnotherPulseAndLatches) {
  make({linearAxis("x"), linearAxis("y")});
  axis::Axis& x = bench->axis("x");
  x.setPosition(0.0);
  bench->axis("y").setPosition(0.0);
  const axis::Move move = x.moveTo(0.08);
  bench->machine->advance(0.3);
  const std::int64_t pulses = bench->pulses();
  ASSERT_GT(pulses, 100);
  press(true);
  bench->machine->advance(1.0);
  EXPECT_EQ(bench->pulses(), pulses);
  EXPECT_TRUE(bench->machine->emergencyStopped());
  const axis::MoveResult result = x.wait(move);
  EXPECT_EQ(result.end, axis::MoveEnd::kEmergencyStop);
  EXPECT_NE(result.message.find("emergency stop input"), std::string::npos) << result.message;
  for (const char* name : {"x", "y"}) {
    EXPECT_EQ(bench->axis(name).state().fault, "emergency stop input");
    EXPECT_REFUSED(bench->axis(name).moveTo(0.01), "emergency stop input; call recover");
    EXPECT_REFUSED(bench->axis(name).jog(0.01), "emergency stop input; call recover");
    EXPECT_TRUE(bench->axis(name).state().enabled) << "motors stay energized";
  }
  EXPECT_FALSE(x.state().position_valid) << "it stopped from 100 mm/s at once";
  EXPECT_TRUE(bench->axis("y").state().position_valid) << "it stood";

  EXPECT_REFUSED(bench->machine->recover(), "the emergency stop input stop is active; release it");
  EXPECT_EQ(x.state().fault, "emergency stop input");
  press(false);
  bench->machine->advance(0.1);
  EXPECT_REFUSED(x.moveTo(0.0), "call recover");
  bench->machine->recover();
  EXPECT_FALSE(bench->machine->emergencyStopped());
  bench->machine->advance(1.0);
  EXPECT_EQ(bench->pulses(), pulses) << "nothing moves until a new command";
  EXPECT_EQ(bench->move(0.0).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench->pulses(), 0);
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(EmergencyStopInput, StopsAgainEachTime) {
  make({linearAxis("x")});
  for (int i = 0; i < 3; ++i) {
    const std::int64_t pulses = bench->pulses();
    press(true);
    bench->machine->advance(0.1);
    EXPECT_REFUSED(bench->axis().moveTo(0.01, true), "emergency stop input");
    press(false);
    bench->machine->recover();
    bench->machine->advance(0.1);
    EXPECT_EQ(bench->axis().wait(bench->axis().moveTo(0.001, true)).end, axis::MoveEnd::kReached);
    EXPECT_EQ(bench->pulses(), pulses + 80);
  }
}

TEST_F(EmergencyStopInput, IsNamedAlsoWhereAnotherEmergencyStopComesFirstOrLater) {
  make({linearAxis("x")});
  bench->machine->emergencyStop();
  EXPECT_EQ(bench->axis().state().fault, "emergency stop");
  press(true);
  bench->machine->advance(0.1);
  EXPECT_EQ(bench->axis().state().fault, "emergency stop input");
  bench->machine->emergencyStop();
  EXPECT_EQ(bench->axis().state().fault, "emergency stop input");
}

// Machine::recover() ends the stop, and then each axis's fault: a stop that comes between is none
// that an axis may clear.
TEST_F(EmergencyStopInput, IsNotClearedByAnAxisThatIsRecoveredWhenItHasComeMeanwhile) {
  make({linearAxis("x"), linearAxis("y")});
  bench->machine->emergencyStop();
  bench->machine->recover();
  ASSERT_EQ(bench->axis("x").state().fault, "");
  press(true);
  bench->machine->advance(0.1);
  EXPECT_REFUSED(bench->axis("x").recover(), "an emergency stop has come meanwhile");
  EXPECT_EQ(bench->axis("x").state().fault, "emergency stop input");
  EXPECT_REFUSED(bench->axis("x").moveTo(0.001), "emergency stop input; call recover");
}

TEST(EmergencyStopInputAtStart, FindsEveryAxisAtFaultAndEnergizesNone) {
  for (const bool active_level : {true, false}) {
    const std::vector<axis::AxisConfig> axes = {linearAxis("x"), linearAxis("y")};
    sim::Rig rig(Bench::rigAxes(axes));
    pulse::VirtualClock clock;
    gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
    machine::MachineOptions options = withInput(active_level);
    options.threaded = false;
    rig.setInput(kLine, active_level, 0);
    machine::Machine machine(axes, backend, clock, options);
    for (const auto& axis : machine.axes()) {
      EXPECT_EQ(axis->state().fault, "emergency stop input");
      EXPECT_FALSE(axis->state().enabled);
      EXPECT_REFUSED(axis->enable(true), "emergency stop input");
    }
    EXPECT_REFUSED(machine.recover(), "is active");
    rig.setInput(kLine, !active_level, clock.now());
    machine.recover();
    axis::Axis& x = machine.axis("x");
    EXPECT_REFUSED(x.moveTo(0.001), "disabled");
    x.enable(true);
    EXPECT_EQ(x.wait(x.moveTo(0.001)).end, axis::MoveEnd::kReached);
    EXPECT_EQ(violationsOf(rig.report("x")), "");
  }
}

TEST_F(EmergencyStopInput, IsSeenByTheWatcherOfAThreadedMachine) {
  make({linearAxis("x")}, true, 1.0);
  axis::Axis& x = bench->axis();
  const axis::Move move = x.moveTo(0.09, false, 0.01);  // 9 s
  press(true);
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kEmergencyStop);
  EXPECT_LT(bench->pulses(), 7200);
}

// Whatever the moment: after a recover() that was accepted while the button is down every axis is
// at fault still or again.
TEST_F(EmergencyStopInput, IsNeverLostToARecoverThatComesAtTheSameTime) {
  make({linearAxis("x"), linearAxis("y")}, true, 0.0);
  for (int i = 0; i < 200; ++i) {
    std::thread recovering([this] { recovers(); });
    press(true);
    recovering.join();
    while (bench->axis("x").state().fault.empty()) std::this_thread::yield();
    for (const char* name : {"x", "y"}) {
      EXPECT_REFUSED(bench->axis(name).moveTo(0.001), "emergency stop");
    }
    EXPECT_TRUE(bench->machine->emergencyStopped());
    press(false);
    // The pulse thread may have read the line just before that.
    while (!recovers() || !bench->axis("x").state().fault.empty()) std::this_thread::yield();
  }
}

TEST(EmergencyStopLine, ThatCantBeReadCountsAsActive) {
  pulse::VirtualClock clock;
  test::RecordingLines lines(clock);
  pulse::ChannelConfig channel;
  channel.step.line = 0;
  channel.dir.line = 1;
  channel.step_high = channel.step_low = 2'000;
  pulse::PulseEngine engine(lines, clock, {channel}, 5'000'000, pulse::Signal{0, true});
  EXPECT_FALSE(engine.emergencyStopped());
  lines.inputs[0] = -EIO;
  EXPECT_FALSE(engine.emergencyStopped());
  engine.inputsChanged();
  engine.serve();
  EXPECT_TRUE(engine.emergencyStopped());
  EXPECT_EQ(engine.inputStops(), 1U);
  engine.inputsChanged();
  engine.serve();
  EXPECT_EQ(engine.inputStops(), 1U) << "told once";
  engine.clearEmergencyStop();
  engine.inputsChanged();
  engine.serve();
  EXPECT_EQ(engine.inputStops(), 2U) << "a stop that was cleared too early";
}

}  // namespace
}  // namespace stepdriver
