#include <gtest/gtest.h>

#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <future>
#include <memory>
#include <mutex>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "pulse/pulse_engine.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/passing_lines.h"
#include "support/recording_lines.h"
#include "support/refusal.h"

namespace stepdriver {
namespace {

using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr const char* kStopLine = "stop";

machine::MachineOptions withInput(bool active_level) {
  machine::MachineOptions options;
  options.emergency_stop = config::InputSwitch{kStopLine, active_level, Bias::kPullUp};
  return options;
}

/// Two axes, and a button that opens a contact to ground: the high level means stop.
class EmergencyStopInput : public testing::Test {
 protected:
  void make(const std::vector<config::AxisConfig>& axes, bool threaded = false,
            double speed = 0.0) {
    bench = std::make_unique<Bench>(axes, Bench::rigAxes(axes), threaded, speed, withInput(true));
  }

  void press(bool pressed) { bench->rig.setInput(kStopLine, pressed, bench->clock.now()); }

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

TEST(EmergencyStopInputAtStart, FindsEveryAxisAtFaultAndEnergizesNone) {
  for (const bool active_level : {true, false}) {
    const std::vector<config::AxisConfig> axes = {linearAxis("x"), linearAxis("y")};
    sim::Rig rig(Bench::rigAxes(axes));
    pulse::VirtualClock clock;
    gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
    machine::MachineOptions options = withInput(active_level);
    rig.setInput(kStopLine, active_level, 0);
    test::UnthreadedMachine machine(axes, backend, clock, options);
    for (const auto& axis : machine.axes()) {
      EXPECT_EQ(axis->state().fault, "emergency stop input");
      EXPECT_FALSE(axis->state().enabled);
      EXPECT_REFUSED(axis->enable(true), "emergency stop input");
    }
    EXPECT_REFUSED(machine.recover(), "is active");
    rig.setInput(kStopLine, !active_level, clock.now());
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

// If a recover() is accepted while the button is down, at whatever moment, every axis is still, or
// again, at fault.
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

/// Lines that can keep the pulse thread in a write.
class PausableLines : public test::PassingLines {
 public:
  using PassingLines::PassingLines;

  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    std::unique_lock<std::mutex> lock(mutex_);
    blocked_ = closed_;
    changed_.notify_all();
    changed_.wait(lock, [this] { return !closed_; });
    blocked_ = false;
    lock.unlock();
    return PassingLines::write(writes, count);
  }

  /// @return whether a thread reached the write within a minute.
  bool close() {
    std::unique_lock<std::mutex> lock(mutex_);
    closed_ = true;
    return changed_.wait_for(lock, std::chrono::minutes(1), [this] { return blocked_; });
  }
  void open() {
    const std::lock_guard<std::mutex> lock(mutex_);
    closed_ = false;
    changed_.notify_all();
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool closed_ = false;
  bool blocked_ = false;
};

class PausableBackend : public gpio::Backend {
 public:
  explicit PausableBackend(gpio::Backend& backend) : backend_(backend) {}
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override {
    auto gated = std::make_unique<PausableLines>(backend_.request(outputs, inputs));
    lines = gated.get();
    return gated;
  }
  PausableLines* lines = nullptr;

 private:
  gpio::Backend& backend_;
};

// The emergency stop comes while the pulse thread is in a write, and a recover before the write has
// returned.
TEST(EmergencyStop, IsNotLostIfARecoverComesBeforeItWasCarriedOut) {
  const std::vector<config::AxisConfig> axes = {linearAxis("x")};
  sim::Rig rig(Bench::rigAxes(axes));
  pulse::VirtualClock clock(1.0);
  gpio::SimulatedBackend simulated(rig, [&clock] { return clock.now(); });
  PausableBackend backend(simulated);
  machine::Machine machine(axes, backend, clock);
  axis::Axis& x = machine.axis("x");
  const axis::Move move = x.moveTo(0.08);  // 6400 steps
  ASSERT_TRUE(backend.lines->close());
  auto stopped = std::async(std::launch::async, [&] { machine.emergencyStop(); });
  const auto end = std::chrono::steady_clock::now() + std::chrono::minutes(1);
  while (!machine.emergencyStopped() && std::chrono::steady_clock::now() < end) {
    std::this_thread::yield();
  }
  auto recovered =
      std::async(std::launch::async, [&] { return test::refusal([&] { machine.recover(); }); });
  const bool answered = recovered.wait_for(std::chrono::seconds(5)) == std::future_status::ready;
  backend.lines->open();
  EXPECT_TRUE(answered) << "a recover waits for nothing that may hang";
  EXPECT_EQ(recovered.get(), "an emergency stop has come meanwhile");
  stopped.get();
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kEmergencyStop);
  const std::int64_t pulses = rig.report("x").pulses_forward;
  EXPECT_LT(pulses, 6400);
  EXPECT_EQ(x.state().fault, "emergency stop");
  machine.recover();
  EXPECT_EQ(x.state().fault, "");
  EXPECT_EQ(x.wait(x.moveTo(0.001, true)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(rig.report("x").pulses_forward, pulses + 80);
}

TEST(EmergencyStop, HasEndedAllPulsesWhenItAnswers) {
  std::vector<config::AxisConfig> axes = {linearAxis("x"), linearAxis("y")};
  for (config::AxisConfig& config : axes) config.endstop_min = config.endstop_max = {};
  Bench bench(axes, true);
  for (int i = 0; i < 20; ++i) {
    bench.axis("x").jog(i % 2 == 0 ? 0.01 : -0.01);
    bench.axis("y").jog(i % 2 == 0 ? 0.01 : -0.01);
    bench.machine->emergencyStop();
    const std::int64_t x = bench.pulses("x");
    const std::int64_t y = bench.pulses("y");
    bench.machine->recover();
    EXPECT_FALSE(bench.axis("x").state().moving);
    EXPECT_FALSE(bench.axis("y").state().moving);
    EXPECT_EQ(bench.pulses("x"), x);
    EXPECT_EQ(bench.pulses("y"), y);
  }
}

/// Two axes whose motors lose their current at an emergency stop; both have a load that falls, and
/// a brake.
class EmergencyDisableOff : public testing::Test {
 protected:
  EmergencyDisableOff() {
    machine::MachineOptions options = withInput(true);
    options.emergency_disable = machine::EmergencyDisable::kOff;
    std::vector<config::AxisConfig> axes = {linearAxis("x", "drv8825"), linearAxis("y")};
    axes[0].fault = config::FaultPin{"x.fault"};
    for (config::AxisConfig& config : axes) {
      config.brake = config::BrakeConfig{config.name + ".brake", true, 30'000'000, 40'000'000};
    }
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : rig) spec.load_falls = 10.0;
    bench = std::make_unique<Bench>(axes, rig, false, 0.0, options);
    bench->axis("x").setPosition(0.0);
  }

  /// Gives the brakes time.
  void expectOff() {
    bench->machine->advance(0.2);
    for (const char* name : {"x", "y"}) {
      EXPECT_FALSE(bench->axis(name).state().enabled) << name;
      EXPECT_FALSE(bench->report(name).energized) << name;
      EXPECT_EQ(bench->report(name).fell, 0.0) << name;
      EXPECT_EQ(violationsOf(bench->report(name)), "") << name;
    }
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(EmergencyDisableOff, TakesTheCurrentFromEveryMotorOnceItsBrakeHolds) {
  axis::Axis& x = bench->axis("x");
  const axis::Move move = x.moveTo(0.08);
  bench->machine->advance(0.3);
  bench->machine->emergencyStop();
  const std::int64_t pulses = bench->pulses();
  EXPECT_TRUE(bench->report().energized) << "the brake doesn't hold yet";
  EXPECT_EQ(x.wait(move).end, axis::MoveEnd::kEmergencyStop);
  expectOff();
  EXPECT_EQ(bench->pulses(), pulses);
  EXPECT_EQ(x.state().fault, "emergency stop");
}

TEST_F(EmergencyDisableOff, LastsBeyondARecoverUntilTheAxisIsEnabled) {
  axis::Axis& x = bench->axis("x");
  bench->machine->emergencyStop();
  bench->machine->recover();
  expectOff();
  EXPECT_REFUSED(x.moveTo(0.001), "disabled; enable it first");
  x.enable(true);
  EXPECT_EQ(x.wait(x.moveTo(0.001)).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench->report().fell, 0.0);
}

TEST_F(EmergencyDisableOff, ComesAgainWithEachEmergencyStop) {
  for (int i = 0; i < 3; ++i) {
    bench->rig.setInput(kStopLine, true, bench->clock.now());
    expectOff();
    bench->rig.setInput(kStopLine, false, bench->clock.now());
    bench->machine->recover();
    for (const char* name : {"x", "y"}) bench->axis(name).enable(true);
    EXPECT_TRUE(bench->report().energized);
  }
}

TEST_F(EmergencyDisableOff, AlsoSwitchesOffAnAxisThatIsAtFaultAlready) {
  axis::Axis& x = bench->axis("x");
  sim::RigFaults faults;
  faults.chip_fault_after = 20;
  bench->rig.setFaults("x", faults);
  x.wait(x.moveTo(0.01));
  bench->machine->advance(0.5);
  EXPECT_NE(x.state().fault.find("nFAULT"), std::string::npos) << x.state().fault;
  EXPECT_TRUE(x.state().enabled);
  bench->machine->emergencyStop();
  bench->machine->advance(0.2);
  EXPECT_FALSE(x.state().enabled);
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
  engine.clearEmergencyStop(engine.stopsServed());
  engine.inputsChanged();
  engine.serve();
  EXPECT_EQ(engine.inputStops(), 2U) << "a stop that was cleared too early";
}

}  // namespace
}  // namespace stepdriver
