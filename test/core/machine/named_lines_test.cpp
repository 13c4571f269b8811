#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstddef>
#include <cstdint>
#include <future>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/recording.h"
#include "stepdriver_core/setup/hardware.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/making_backend.h"
#include "support/passing_lines.h"
#include "support/refusal.h"

// Outputs and inputs with a name.

namespace stepdriver {
namespace {

using machine::EmergencyDisable;
using machine::OutputState;
using test::Bench;
using test::kMillisecond;
using test::kSecond;
using test::linearAxis;

config::OutputConfig output(const std::string& name) {
  config::OutputConfig config;
  config.name = name;
  config.line = name + ".line";
  return config;
}

config::InputConfig input(const std::string& name) {
  config::InputConfig config;
  config.name = name;
  config.line = config::InputSwitch{name + ".line", false};
  return config;
}

/// A pen that is lifted by its magnet, and a clamp that holds without current.
class NamedLines : public testing::Test {
 protected:
  NamedLines() {
    options.outputs = {output("pen"), output("clamp")};
    options.outputs[1].active_level = false;
    options.outputs[1].at_fault = true;
    options.inputs = {input("probe")};
    options.emergency_stop = config::InputSwitch{"button", true};
    options.record_seconds = 60.0;
  }

  void begin(bool threaded = false) {
    bench = std::make_unique<Bench>(axes, Bench::rigAxes(axes), threaded, 0.0, options);
  }

  const config::OutputConfig& pen() { return options.outputs[0]; }
  OutputState state(std::size_t number = 0) const {
    return bench->machine->ioStates().outputs.at(number);
  }
  /// Whether an output is on, by its line on the rig.
  bool isOn(std::size_t number = 0) const {
    const config::OutputConfig& config = options.outputs.at(number);
    const bool on = bench->rig.outputLevel(config.line) == config.active_level;
    EXPECT_EQ(state(number).on, on) << config.name;
    return on;
  }
  void expectSafe() const {
    for (std::size_t i = 0; i < options.outputs.size(); ++i) {
      EXPECT_EQ(isOn(i), options.outputs[i].at_fault) << options.outputs[i].name;
    }
  }
  void unsafe() {
    bench->machine->setOutput("pen", true);
    bench->machine->setOutput("clamp", false);
    ASSERT_TRUE(isOn(0));
    ASSERT_FALSE(isOn(1));
  }
  /// Times at which the pen was switched.
  std::vector<std::int64_t> switched(bool on) const {
    return bench->trace->times("outputs", "pen", on == options.outputs[0].active_level);
  }
  std::string fault() const { return bench->machine->axis("x").state().fault; }

  std::vector<config::AxisConfig> axes{linearAxis("x"), linearAxis("y")};
  machine::MachineOptions options;
  std::unique_ptr<Bench> bench;
};

TEST_F(NamedLines, OutputsBeginAsConfiguredAndAreSwitchedByName) {
  options.outputs[0].initial = true;
  begin();
  EXPECT_TRUE(isOn(0));
  EXPECT_FALSE(isOn(1)) << "its safe state is only the one before the start";
  bench->machine->advance(1.0);
  const std::int64_t before = bench->clock.now();
  bench->machine->setOutput("pen", false);
  EXPECT_FALSE(isOn(0));
  EXPECT_EQ(state().changed, before);
  EXPECT_EQ(switched(false), std::vector<std::int64_t>{before});
  bench->machine->setOutput("pen", false);
  EXPECT_EQ(state().changed, before);
}

TEST_F(NamedLines, UnknownNamesAreRefusedWithThoseThatThereAre) {
  begin();
  EXPECT_REFUSED(bench->machine->setOutput("pan", true),
                 "there is no output pan (outputs: pen, clamp)");
  EXPECT_REFUSED(bench->machine->setOutput("", true), "there is no output ");
  EXPECT_REFUSED(bench->machine->setOutput("probe", true), "there is no output probe");
  options.outputs.clear();
  begin();
  EXPECT_REFUSED(bench->machine->setOutput("pen", true),
                 "there is no output pen: none is configured");
}

TEST_F(NamedLines, OutputsAreSafeWhenAnEmergencyStopIsAnsweredAndStaySoAfterRecover) {
  begin();
  unsafe();
  const axis::Move move = bench->axis().moveTo(0.05);
  bench->machine->advance(0.3);
  const std::int64_t asked = bench->clock.now();
  bench->machine->emergencyStop();
  expectSafe();
  EXPECT_LE(*state().changed - asked, kMillisecond);
  EXPECT_EQ(state(0).note, "was switched off for safety: x is at fault: emergency stop");
  EXPECT_EQ(state(1).note, "was switched on for safety: x is at fault: emergency stop");
  EXPECT_REFUSED(bench->machine->setOutput("pen", true),
                 "the output pen: x is at fault: emergency stop; call recover first");
  bench->machine->recover();
  bench->machine->advance(1.0);
  expectSafe();
  bench->machine->setOutput("pen", true);
  EXPECT_TRUE(isOn());
  EXPECT_EQ(state().note, "");
  EXPECT_EQ(bench->axis().wait(move).end, axis::MoveEnd::kEmergencyStop);
}

TEST_F(NamedLines, OutputsAreSafeFromTheBeginningOfARampOn) {
  options.emergency_disable = EmergencyDisable::kRamp;
  begin();
  unsafe();
  bench->axis().moveTo(0.05);
  bench->machine->advance(0.3);
  const std::int64_t asked = bench->clock.now();
  bench->machine->emergencyStop();
  EXPECT_GT(bench->clock.now() - asked, 90 * kMillisecond) << "0.1 m/s at 1 m/s^2";
  EXPECT_LE(*state(0).changed - asked, kMillisecond);
  EXPECT_LE(*state(1).changed - asked, kMillisecond);
  expectSafe();
}

TEST_F(NamedLines, OutputsAreSafeAfterTheButtonAndAFaultOfOneAxis) {
  begin();
  unsafe();
  bench->rig.setInput("button", true, bench->clock.now());
  EXPECT_REFUSED(bench->machine->setOutput("pen", true), "emergency stop input");
  bench->machine->advance(0.001);
  expectSafe();
  bench->rig.setInput("button", false, bench->clock.now());
  bench->machine->recover();
  unsafe();
  bench->rig.failWrites("y.step", 0, EIO);
  bench->move(0.01, "y");
  expectSafe();
  EXPECT_EQ(fault(), "");
  EXPECT_REFUSED(bench->machine->setOutput("pen", true), "y is at fault: the STEP line");
}

TEST_F(NamedLines, NothingIsSwitchedOnAtTheStartWhileTheButtonIsPressed) {
  options.outputs[0].initial = true;
  pulse::VirtualClock clock;
  sim::Rig rig(Bench::rigAxes(axes), nullptr, {}, {}, Bench::ioOf(options));
  rig.setInput("button", true, 0);
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine(axes, backend, clock, options);
  machine.advance(0.1);
  EXPECT_FALSE(machine.ioStates().outputs[0].changed);
  EXPECT_EQ(rig.outputLevel(pen().line), false);
  rig.setInput("button", false, clock.now());
  machine.recover();
  machine.advance(0.1);
  EXPECT_EQ(rig.outputLevel(pen().line), false) << "recover switches nothing on";
}

TEST_F(NamedLines, AStopSwitchesOnlyWhatIsConfiguredSo) {
  options.outputs[0].at_stop = false;
  options.outputs.push_back(output("light"));
  options.outputs.back().at_stop = true;
  begin();
  unsafe();
  bench->machine->stop();
  bench->machine->advance(0.001);
  EXPECT_FALSE(isOn(0));
  EXPECT_FALSE(isOn(1)) << "it keeps its state, which is not its safe one";
  EXPECT_TRUE(isOn(2));
  unsafe();
  bench->machine->hold();
  bench->axis().stop();
  bench->machine->advance(1.0);
  EXPECT_TRUE(isOn(0)) << "neither a hold nor the stop of one axis is a stop of the machine";
  bench->machine->setOutput("pen", true);
}

TEST_F(NamedLines, AnOutputIsSwitchedOffAfterItsLongestTimeToTheNanosecond) {
  options.outputs[0].max_on_ns = 2 * kSecond;
  begin();
  bench->machine->setOutput("pen", true);
  const std::int64_t on = *state().changed;
  bench->machine->advance(1.5);
  bench->machine->setOutput("pen", true);
  EXPECT_EQ(state().note, "");
  bench->machine->advance(0.5);
  EXPECT_FALSE(isOn()) << "a call for the state that it has doesn't prolong it";
  EXPECT_EQ(switched(false), std::vector<std::int64_t>{on + 2 * kSecond});
  EXPECT_EQ(state().note,
            "was switched off: it had been on for 2 s, the most that max_on_s allows");
  EXPECT_EQ(fault(), "");
  bench->machine->setOutput("pen", true);
  EXPECT_EQ(state().note, "");
  EXPECT_TRUE(isOn());
}

TEST_F(NamedLines, LeastTimesDelayASwitchButNotTheSafeState) {
  options.outputs[0].min_on_ns = 300 * kMillisecond;
  options.outputs[0].min_off_ns = 100 * kMillisecond;
  begin();
  bench->machine->setOutput("pen", true);
  const std::int64_t on = *state().changed;
  bench->machine->setOutput("pen", false);
  EXPECT_EQ(switched(false).back() - on, 300 * kMillisecond);
  bench->machine->setOutput("pen", true);
  EXPECT_EQ(switched(true).back() - switched(false).back(), 100 * kMillisecond);
  bench->machine->emergencyStop();
  expectSafe();
  EXPECT_EQ(switched(false).back(), switched(true).back());
}

TEST_F(NamedLines, APwmOutputStaysOnAndOffForAPeriodAtLeast) {
  options.outputs[0].line = "pwmchip0:0/20000000/1000000/2000000";
  options.outputs[0].min_on_ns = 19 * kMillisecond;
  options.outputs[0].min_off_ns = 21 * kMillisecond;
  begin();
  bench->machine->setOutput("pen", true);
  bench->machine->setOutput("pen", false);
  EXPECT_EQ(switched(false).back() - switched(true).back(), 20 * kMillisecond);
  bench->machine->setOutput("pen", true);
  EXPECT_EQ(switched(true).back() - switched(false).back(), 21 * kMillisecond);
  bench->machine->emergencyStop();
  EXPECT_EQ(switched(false).back(), switched(true).back()) << "the safe state doesn't wait";
}

TEST_F(NamedLines, ACallThatWaitsForALeastTimeEndsWithWhatComesFirst) {
  options.outputs[0].min_on_ns = 60 * kSecond;
  begin(true);
  bench->machine->setOutput("pen", true);
  auto off = std::async(std::launch::async, [&] {
    return test::refusal([&] { bench->machine->setOutput("pen", false); });
  });
  // In virtual time the wait has a length only if the clock doesn't run: it ends by either.
  bench->machine->emergencyStop();
  const std::string message = off.get();
  EXPECT_TRUE(message.empty() || message.find("emergency stop") != std::string::npos) << message;
  expectSafe();
}

TEST_F(NamedLines, ALineThatFailsIsAFaultOfEveryAxisAndRecoverWritesItAgain) {
  begin();
  bench->axis().setPosition(0.0);
  const axis::Move move = bench->axis().moveTo(0.05);
  bench->machine->advance(0.3);
  bench->rig.failWrites("pen.line", 0, EIO);
  try {
    bench->machine->setOutput("pen", true);
    FAIL() << "it was not written";
  } catch (const GpioError& error) {
    EXPECT_STREQ(error.what(),
                 "the line pen.line of the output pen can't be written: EIO, input/output error; "
                 "check the cable and the supply of its chip");
  }
  EXPECT_EQ(fault().find("the line pen.line of the output pen can't be written"), 0U) << fault();
  EXPECT_EQ(bench->axis("y").state().fault, fault());
  EXPECT_EQ(bench->axis().wait(move).end, axis::MoveEnd::kFault);
  EXPECT_TRUE(bench->axis().state().position_valid) << "it decelerates";
  EXPECT_TRUE(isOn(1));
  EXPECT_NE(state().error, "");
  EXPECT_THROW(bench->machine->recover(), Error);
  EXPECT_NE(fault(), "");
  bench->rig.clearWriteFault("pen.line");
  bench->machine->recover();
  EXPECT_EQ(fault(), "");
  EXPECT_EQ(state().error, "");
  bench->machine->setOutput("pen", true);
  EXPECT_TRUE(isOn());
}

// The safe state is written although the write before it has failed.
TEST_F(NamedLines, ALineThatFailsOnceIsInItsSafeStateAfterIt) {
  begin();
  bench->machine->setOutput("pen", true);
  bench->machine->setOutput("clamp", true);
  bench->rig.failWrites("clamp.line", 0, EIO);
  EXPECT_THROW(bench->machine->setOutput("clamp", false), GpioError);
  EXPECT_FALSE(isOn(0)) << "it is safe as well";
  bench->machine->emergencyStop();
  bench->rig.clearWriteFault("clamp.line");
  bench->machine->recover();
  expectSafe();
}

TEST_F(NamedLines, AShutdownAndTheEndOfTheMachineLeaveTheSafeState) {
  begin();
  unsafe();
  bench->axis().moveTo(0.05);
  bench->machine->advance(0.3);
  const std::int64_t closed = bench->clock.now();
  bench->machine->shutdown();
  EXPECT_EQ(*state().changed, closed) << "not only when the axes are at rest";
  expectSafe();
  EXPECT_REFUSED(bench->machine->setOutput("pen", true), "shut down");
  begin();
  unsafe();
  bench->machine.reset();
  EXPECT_EQ(bench->rig.outputLevel("pen.line"), false);
  EXPECT_EQ(bench->rig.outputLevel("clamp.line"), false);
}

TEST_F(NamedLines, AreInTheFlightRecorder) {
  begin();
  unsafe();
  bench->rig.pressInput("probe", true, bench->clock.now());
  bench->machine->advance(0.01);
  const machine::Recording recording = bench->machine->recording();
  int found = 0;
  for (const machine::Recording::Pin& pin : recording.pins) {
    if (pin.axis != "outputs") continue;
    ++found;
    const auto edges = std::count_if(
        recording.edges.begin(), recording.edges.end(),
        [&](const machine::Recording::Edge& edge) { return edge.output == pin.output; });
    EXPECT_GE(edges, 1) << pin.name;
  }
  EXPECT_EQ(found, 2);
  for (const char* const words : {"switch pen on", "input probe.line went low, 0 ms before"}) {
    EXPECT_TRUE(
        std::any_of(recording.events.begin(), recording.events.end(),
                    [&](const auto& event) { return event.text.find(words) != std::string::npos; }))
        << words;
  }
}

TEST_F(NamedLines, WrongOnesOfAProgramAreRefused) {
  options.outputs[1].line = "x.step";
  options.inputs.push_back(input("probe"));
  options.outputs[0].max_on_ns = 0;
  try {
    begin();
    FAIL() << "it has begun";
  } catch (const ConfigError& error) {
    const std::string text = error.what();
    for (const char* words : {"outputs/clamp/pin", "used twice", "inputs/probe", "given twice",
                              "outputs/pen/max_on_s", "must be from 0.001 to 86400"}) {
      EXPECT_NE(text.find(words), std::string::npos) << words << " in " << text;
    }
  }
}

// ---- inputs ----

TEST_F(NamedLines, AnInputIsReadAtTheStartAndItsEdgesGiveTheTimes) {
  begin();
  EXPECT_FALSE(bench->machine->ioStates().inputs[0].active);
  EXPECT_FALSE(bench->machine->ioStates().inputs[0].changed);
  bench->machine->advance(0.5);
  const std::int64_t pressed = bench->clock.now();
  bench->rig.pressInput("probe", true, pressed);
  bench->machine->advance(0.2);
  EXPECT_TRUE(bench->machine->ioStates().inputs[0].active);
  EXPECT_EQ(bench->machine->ioStates().inputs[0].changed, pressed);
  bench->rig.pressInput("probe", false, bench->clock.now());
  bench->machine->advance(0.001);
  EXPECT_FALSE(bench->machine->ioStates().inputs[0].active);
}

TEST_F(NamedLines, AShortGlitchIsNoChangeWithADebounce) {
  options.inputs[0].debounce_ns = 5 * kMillisecond;
  begin();
  bench->rig.pressInput("probe", true, bench->clock.now());
  bench->machine->advance(0.004);
  bench->rig.pressInput("probe", false, bench->clock.now());
  bench->machine->advance(0.1);
  EXPECT_FALSE(bench->machine->ioStates().inputs[0].changed);
  const std::int64_t pressed = bench->clock.now();
  bench->rig.pressInput("probe", true, pressed);
  bench->machine->advance(0.004);
  EXPECT_FALSE(bench->machine->ioStates().inputs[0].active);
  bench->machine->advance(0.002);
  EXPECT_TRUE(bench->machine->ioStates().inputs[0].active);
  EXPECT_EQ(bench->machine->ioStates().inputs[0].changed, pressed);
}

/// Lines of which an input can't be read.
class UnreadableLines : public test::PassingLines {
 public:
  UnreadableLines(std::unique_ptr<gpio::Lines> lines, const bool& fails)
      : PassingLines(std::move(lines)), fails_(fails) {}
  int read(int input) noexcept override {
    return fails_ && inputName(input) == "probe.line" ? -EIO : PassingLines::read(input);
  }

 private:
  const bool& fails_;
};

TEST_F(NamedLines, AnInputThatCannotBeReadSaysSoUntilItCan) {
  begin();
  bool fails = false;
  test::MakingBackend backend([&](const auto& outputs, const auto& inputs) {
    return std::make_unique<UnreadableLines>(bench->backend.request(outputs, inputs), fails);
  });
  bench->machine.reset();
  bench->machine = std::make_unique<test::UnthreadedMachine>(axes, backend, bench->clock, options);
  const auto probe = [this] { return bench->machine->ioStates().inputs.at(0); };
  EXPECT_EQ(probe().error, "");
  fails = true;
  bench->rig.pressInput("probe", true, bench->clock.now());
  bench->machine->advance(0.2);
  EXPECT_EQ(probe().error,
            "the line probe.line of the input probe can't be read: EIO, input/output error");
  EXPECT_EQ(fault(), "") << "no axis needs it";
  const std::vector<machine::Recording::Event> events = bench->machine->recording().events;
  EXPECT_TRUE(std::any_of(events.begin(), events.end(), [](const auto& event) {
    return event.text.find("input probe.line can't be read: EIO") != std::string::npos;
  }));
  fails = false;
  bench->machine->advance(0.2);
  EXPECT_EQ(probe().error, "");
  EXPECT_TRUE(probe().active);
  bench->machine.reset();
}

// The rig reports the first edge only: all bounces are lost edges.
TEST(NamedInput, ThatBouncesChangesOnceAtItsFirstEdge) {
  const std::vector<config::AxisConfig> axes{linearAxis("x")};
  machine::MachineOptions options;
  options.inputs = {input("probe")};
  options.inputs[0].debounce_ns = 5 * kMillisecond;
  setup::SimulationConfig config;
  config.speed = 0.0;
  config.inputs["probe"].bounces = 20;
  config.inputs["probe"].bounce_ms = 0.7;
  setup::Simulation simulation(axes, {}, {}, config, {}, options.inputs);
  test::UnthreadedMachine machine(axes, simulation.backend(), simulation.clock(), options);
  int changes = 0;
  machine::InputState before = machine.ioStates().inputs[0];
  for (const bool pressed : {true, false, true}) {
    const std::int64_t time = simulation.clock().now();
    simulation.pressInput("probe", pressed);
    for (int i = 0; i < 100; ++i) {
      machine.advance(0.001);
      const machine::InputState now = machine.ioStates().inputs[0];
      if (now.active != before.active) ++changes;
      before = now;
    }
    EXPECT_EQ(before.active, pressed);
    EXPECT_EQ(before.changed, time);
  }
  EXPECT_EQ(changes, 3);
}

TEST(NamedInputs, AreRequestedWithTheirBiasAndTheirEdges) {
  machine::MachineOptions options;
  const std::vector<Bias> biases{Bias::kAsIs, Bias::kPullUp, Bias::kPullDown, Bias::kDisabled};
  for (const Bias bias : biases) {
    options.inputs.push_back(input("probe" + std::to_string(options.inputs.size())));
    options.inputs.back().line.bias = bias;
  }
  const std::vector<config::AxisConfig> axes{linearAxis("x")};
  sim::Rig rig(Bench::rigAxes(axes), nullptr, {}, {}, Bench::ioOf(options));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend simulated(rig, [&clock] { return clock.now(); });
  std::vector<gpio::InputRequest> requested;
  test::MakingBackend backend([&](const auto& outputs, const auto& inputs) {
    requested = inputs;
    return simulated.request(outputs, inputs);
  });
  const test::UnthreadedMachine machine(axes, backend, clock, options);
  for (std::size_t i = 0; i < biases.size(); ++i) {
    const std::string line = options.inputs[i].line.line;
    const auto found =
        std::find_if(requested.begin(), requested.end(),
                     [&](const gpio::InputRequest& request) { return request.line == line; });
    ASSERT_NE(found, requested.end()) << line;
    EXPECT_EQ(found->bias, biases[i]) << line;
    EXPECT_TRUE(found->edges) << line;
  }
}

}  // namespace
}  // namespace stepdriver
