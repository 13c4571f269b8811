#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "gpio/pwm_backend.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/making_backend.h"
#include "support/passing_lines.h"
#include "support/path_bench.h"
#include "support/pwm_folder.h"
#include "support/refusal.h"
#include "support/unthreaded_machine.h"

// Values of PWM outputs between off and on: what their lines get.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::OutputState;
using motion::OutputSwitch;
using test::Bench;
using test::kMillisecond;
using test::kSecond;
using test::lineTo;
using test::MakingBackend;
using test::PathRequest;
using test::PathSegment;
using test::UnthreadedMachine;

constexpr const char* kLaser = "pwmchip0:0/200000/0/200000";

/// What the line of the laser gets, and when its writes end.
struct Laser {
  struct Written {
    std::int64_t time_ns = 0;
    double value = 0.0;
  };
  std::vector<Written> written;
  bool is_slow = false;   // its writes end when the test says so
  gpio::LateWrites late;  // those
};

class LaserLines : public test::PassingLines {
 public:
  LaserLines(std::unique_ptr<gpio::Lines> lines, pulse::VirtualClock& clock, Laser& laser)
      : PassingLines(std::move(lines)), clock_(clock), laser_(laser) {}
  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    for (std::size_t i = 0; i < count; ++i) {
      if (outputName(writes[i].output) != kLaser) continue;
      const double part = static_cast<double>(writes[i].part) / gpio::LineWrite::kWhole;
      laser_.written.push_back({clock_.now(), writes[i].level ? part : 0.0});
      if (laser_.is_slow) ++laser_.late.ordered;
    }
    return PassingLines::write(writes, count);
  }
  gpio::LateWrites lateWrites(int output) const noexcept override {
    return outputName(output) == kLaser ? laser_.late : PassingLines::lateWrites(output);
  }

 private:
  pulse::VirtualClock& clock_;
  Laser& laser_;
};

class OutputValues : public test::PathBench {
 protected:
  void SetUp() override {
    options.outputs.resize(2);
    options.outputs[0].name = "laser";
    options.outputs[0].line = kLaser;
    options.outputs[1].name = "pump";
    options.outputs[1].line = "pump.line";
  }

  // The machine uses what is below.
  void TearDown() override { bench.reset(); }

  void begin() {
    makeRig();
    backend = std::make_unique<MakingBackend>([this](const auto& outputs, const auto& inputs) {
      return std::make_unique<LaserLines>(bench->backend.request(outputs, inputs), bench->clock,
                                          line);
    });
    bench->machine = std::make_unique<UnthreadedMachine>(axes, *backend, bench->clock, options);
    line.written.clear();
  }
  void makeRig() {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(axes, specs, false, 0.0, options);
    bench->machine.reset();
  }
  machine::Machine& machine() const { return *bench->machine; }
  OutputState laser() const { return machine().ioStates().outputs.at(0); }
  /// Ends with another line, so that the last mark isn't at the end.
  static PathRequest pathWith(const std::vector<std::optional<OutputSwitch>>& switches) {
    PathRequest request{{"x", "y"}, {}, true, 0.0, 0.0005};
    for (const auto& wanted : switches) {
      PathSegment& segment = request.segments.emplace_back();
      segment = lineTo({0.005 * static_cast<double>(request.segments.size()), 0.0});
      if (wanted) segment.outputs.push_back(*wanted);
    }
    return request;
  }
  std::vector<double> values() const {
    std::vector<double> all;
    for (const Laser::Written& one : line.written)
      all.push_back(std::round(one.value * 1e4) * 1e-4);
    return all;
  }

  /// Until so many writes have begun. Each ends with the next millisecond, if `ends`.
  void advanceToWrite(std::size_t count, bool ends = true) {
    for (int i = 0; i < 2000 && line.written.size() < count; ++i) {
      if (ends) line.late.ended = line.late.ordered;
      bench->machine->advance(1e-3);
    }
    ASSERT_EQ(line.written.size(), count);
  }
  std::string fault(const std::string& axis = "x") const {
    return machine().axis(axis).state().fault;
  }

  const std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
  machine::MachineOptions options;
  Laser line;
  std::unique_ptr<MakingBackend> backend;
};

TEST_F(OutputValues, AreWrittenByACall) {
  begin();
  machine().setOutput("laser", true, 0.25);
  EXPECT_NEAR(laser().value, 0.25, 1e-5);
  EXPECT_TRUE(laser().on);
  machine().setOutput("laser", true, 0.75);
  machine().setOutput("laser", true);
  EXPECT_EQ(laser().value, 1.0);
  machine().setOutput("laser", true, 1.0 / 65'535);
  machine().setOutput("laser", false, 0.5);
  EXPECT_EQ(laser().value, 0.0);
  EXPECT_FALSE(laser().on);
  EXPECT_EQ(values(), (std::vector<double>{0.25, 0.75, 1.0, 0.0, 0.0}));
  machine().setOutput("laser", false);
  EXPECT_EQ(line.written.size(), 5U) << "it is off already";
}

TEST_F(OutputValues, AreRefusedIfNoPulsesHaveThem) {
  begin();
  for (const double value : {0.0, -0.5, 1e-300, 1.0 / 65'537, 1.0000001, 1e300, test::kNan}) {
    EXPECT_REFUSED(machine().setOutput("laser", true, value), "must be from 1.52");
    EXPECT_REFUSED(machine().followPath(pathWith({{{"laser", true, value}}})),
                   "segment 0 of the path switches the output laser: the value ");
  }
  EXPECT_REFUSED(machine().setOutput("pump", true, 0.5),
                 "is one of a PWM output, and this is none");
  EXPECT_REFUSED(machine().followPath(pathWith({{}, {{"pump", true, 0.5}}})),
                 "segment 1 of the path switches the output pump: the value 0.5 is one of a PWM");
  EXPECT_EQ(values(), (std::vector<double>{}));
  EXPECT_EQ(machine().axis("x").state().position, 0.0);
}

TEST_F(OutputValues, OfAPathComeAtTheirPlaces) {
  begin();
  const auto move = machine().followPath(pathWith({{{"laser", true, 0.5}},
                                                   {{"laser", true, 0.25}},
                                                   {},
                                                   {{"laser", true}},
                                                   {{"laser", false}},
                                                   {{"laser", true, 0.125}},
                                                   {}}));
  std::vector<double> seen{0.0};
  while (machine().axis("x").state().moving || line.written.empty()) {
    bench->machine->advance(1e-3);
    if (seen.back() != laser().value) seen.push_back(laser().value);
  }
  const auto result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 5U);
  EXPECT_EQ(values(), (std::vector<double>{0.5, 0.25, 1.0, 0.0, 0.125}));
  ASSERT_EQ(seen.size(), 6U);
  for (std::size_t i = 1; i < seen.size(); ++i)
    EXPECT_EQ(seen[i], line.written[i - 1].value) << "as it is published";
  // Each comes with the step at its place: the segments are of 5 mm at 100 mm/s.
  for (std::size_t i = 2; i + 1 < line.written.size(); ++i) {
    const std::int64_t after = line.written[i].time_ns - line.written[i - 1].time_ns;
    EXPECT_NEAR(static_cast<double>(after), i == 2 ? 100e6 : 50e6, 2e6) << i;
  }
}

// Least times are those of being on and off: another value doesn't wait, and starts none anew.
TEST_F(OutputValues, DoNotDependOnLeastTimes) {
  options.outputs[0].min_on_ns = 20 * kMillisecond;
  options.outputs[0].max_on_ns = 50 * kMillisecond;
  begin();
  bench->machine->advance(1.0);
  const std::int64_t began = bench->clock.now();
  machine().setOutput("laser", true, 0.5);
  for (int i = 1; i <= 15; ++i) {
    bench->machine->advance(1e-3);
    machine().setOutput("laser", true, i / 16.0);
  }
  EXPECT_LT(bench->clock.now() - began, 17 * kMillisecond);
  machine().setOutput("laser", false);
  EXPECT_NEAR(static_cast<double>(bench->clock.now() - began), 20e6, 1e6);
  machine().setOutput("laser", true, 0.5);
  const std::int64_t again = bench->clock.now();
  while (laser().on) {
    bench->machine->advance(1e-3);
    if (!laser().on) break;
    machine().setOutput("laser", true, laser().value == 0.5 ? 0.25 : 0.5);
  }
  EXPECT_NEAR(static_cast<double>(bench->clock.now() - again), 50e6, 2e6);
  EXPECT_NE(laser().note.find("max_on_s"), std::string::npos) << laser().note;
}

TEST_F(OutputValues, EndWithAnEmergencyStop) {
  begin();
  const auto move = machine().followPath(pathWith({{{"laser", true, 0.5}}, {}}));
  bench->machine->advance(0.05);
  EXPECT_EQ(values(), (std::vector<double>{0.5}));
  machine().emergencyStop();
  EXPECT_EQ(values(), (std::vector<double>{0.5, 0.0}));
  EXPECT_EQ(laser().value, 0.0);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kEmergencyStop);
  machine().recover();
  EXPECT_EQ(values(), (std::vector<double>{0.5, 0.0})) << "nobody has switched it on";
}

// ---- writes that end after the pulse thread has ordered them ----

TEST_F(OutputValues, AWriteOfAPathThatFailsLaterIsAFaultAtOnce) {
  begin();
  machine().axis("x").setPosition(0.0);
  line.is_slow = true;
  const auto move = machine().followPath(
      pathWith({{{"laser", true, 0.5}}, {{"laser", true, 0.25}}, {}, {}, {{"laser", true}}, {}}));
  advanceToWrite(2);
  EXPECT_EQ(fault(), "") << "it has not ended";
  line.is_slow = false;
  line.late.ended = line.late.failed = line.late.ordered;
  line.late.error = ENOSPC;
  bench->machine->advance(1e-3);
  EXPECT_EQ(fault().find("the line pwmchip0:0/200000/0/200000 of the output laser can't be "
                         "written: "),
            0U)
      << fault();
  EXPECT_NE(fault().find("errno 28"), std::string::npos) << fault();
  EXPECT_EQ(fault("y"), fault());
  EXPECT_EQ(values(), (std::vector<double>{0.5, 0.25, 0.0})) << "its safe state";
  const auto result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_EQ(result.marks_made, 1U);
  EXPECT_EQ(result.marks_not_made, 2U);
  EXPECT_TRUE(machine().axis("x").state().position_valid) << "the axes decelerate";
  machine().recover();
  line.is_slow = true;
  const auto next = machine().followPath(pathWith({{{"laser", true, 0.5}}, {}}));
  advanceToWrite(4);
  line.late.ended = line.late.ordered;
  EXPECT_EQ(machine().wait(next).end, MoveEnd::kReached) << "the failure was of the path before";
}

TEST_F(OutputValues, APathEndsWhenItsLastWriteHasEnded) {
  begin();
  line.is_slow = true;
  const PathRequest request = pathWith({{}, {{"laser", true, 0.5}}});
  const auto move = machine().followPath(request);
  advanceToWrite(1);
  bench->machine->advance(0.4);
  EXPECT_FALSE(machine().axis("x").state().moving);
  line.late.ended = line.late.ordered;
  EXPECT_EQ(machine().wait(move).marks_made, 1U);
  machine().axis("x").setPosition(0.0);
  const auto failing = machine().followPath(pathWith({{}, {{"laser", true, 0.25}}}));
  advanceToWrite(2);
  bench->machine->advance(0.4);
  EXPECT_FALSE(machine().axis("x").state().moving);
  line.is_slow = false;
  line.late.ended = line.late.failed = line.late.ordered;
  line.late.error = EIO;
  const auto result = machine().wait(failing);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_EQ(result.marks_made, 0U);
  EXPECT_EQ(result.marks_not_made, 1U);
}

TEST_F(OutputValues, AWriteOfAPathThatHangsIsAFaultAfterTheWriteTimeout) {
  begin();
  line.is_slow = true;
  const auto move = machine().followPath(
      pathWith({{{"laser", true, 0.5}}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}, {}}));
  advanceToWrite(1);
  line.is_slow = false;
  const std::int64_t written = line.written[0].time_ns;
  bench->machine->advance(1e-9 * static_cast<double>(written - bench->clock.now()) + 0.499);
  EXPECT_EQ(fault(), "");
  EXPECT_TRUE(machine().axis("x").state().moving);
  bench->machine->advance(0.0015);
  EXPECT_NE(fault().find("ETIMEDOUT, the chip doesn't answer"), std::string::npos) << fault();
  EXPECT_EQ(values(), (std::vector<double>{0.5, 0.0}));
  const auto result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_EQ(result.marks_made, 0U);
  // It has returned at last, with an error.
  line.late.ended = line.late.failed = line.late.ordered;
  line.late.error = EIO;
  machine().recover();
  bench->machine->advance(0.1);
  EXPECT_EQ(fault(), "") << "it has been told";
}

// Each ends, but the next one has begun by then: that isn't a write that hangs.
TEST_F(OutputValues, WritesOfASlowChipAreNoFaultIfTheyEnd) {
  begin();
  line.is_slow = true;
  PathRequest request = pathWith({});
  for (int i = 0; i < 40; ++i) {
    request.segments.push_back(lineTo({0.002 * (i + 1), 0.0}));
    request.segments.back().outputs.push_back({"laser", true, i % 2 == 0 ? 0.5 : 0.25});
  }
  const auto move = machine().followPath(request);
  for (std::size_t i = 1; i <= 40; ++i) {
    advanceToWrite(i, false);
    line.late.ended = line.late.ordered - 1;
  }
  line.late.ended = line.late.ordered;
  const auto result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 40U);
}

TEST_F(OutputValues, AWriteOfAPositionCompareThatFailsLaterIsAFault) {
  begin();
  machine().axis("x").setPosition(0.0);
  config::PositionCompare compare;
  compare.axis = "x";
  compare.places = {0.01, 0.02, 0.03};
  compare.pulse_ns = 20 * kMillisecond;
  machine().setPositionCompare("laser", compare);
  line.is_slow = true;
  const auto move = machine().axis("x").moveTo(0.05);
  advanceToWrite(3);
  line.is_slow = false;
  line.late.ended = line.late.failed = line.late.ordered;
  line.late.error = EIO;
  bench->machine->advance(1e-3);
  EXPECT_NE(fault().find("of the output laser can't be written: EIO"), std::string::npos)
      << fault();
  EXPECT_EQ(machine().axis("x").wait(move).end, MoveEnd::kFault);
  EXPECT_EQ(laser().compared, 1U);
  EXPECT_GE(laser().missed, 1U);
  EXPECT_EQ(values(), (std::vector<double>{1.0, 0.0, 1.0, 0.0}));
}

// ---- the files of the kernel ----

/// Time stands still while a write is being made.
class PromptLines : public test::PassingLines {
 public:
  using PassingLines::PassingLines;
  gpio::LateWrites lateWrites(int output) const noexcept override {
    for (;;) {
      const gpio::LateWrites late = PassingLines::lateWrites(output);
      if (late.ended >= late.ordered) return late;
      std::this_thread::yield();
    }
  }
};

// With all threads of a machine.
TEST_F(OutputValues, AFileThatCannotBeWrittenInAPathIsAFault) {
  const test::PwmFolder folder;
  options.outputs[0].line = "pwmchip0:1/200000/0/200000";
  makeRig();
  const auto pwm = gpio::withPwm(
      std::make_unique<MakingBackend>([this](const auto& outputs, const auto& inputs) {
        return bench->backend.request(outputs, inputs);
      }),
      folder.root());
  MakingBackend prompt([&pwm](const auto& outputs, const auto& inputs) {
    return std::make_unique<PromptLines>(pwm->request(outputs, inputs));
  });
  bench->machine = std::make_unique<UnthreadedMachine>(axes, prompt, bench->clock, options, true);
  const PathRequest request = pathWith({{{"laser", true, 0.5}}, {{"laser", true, 0.25}}, {}, {}});
  EXPECT_EQ(machine().wait(machine().followPath(request)).end, MoveEnd::kReached);
  EXPECT_EQ(folder.read("pwm1/duty_cycle"), "50001");
  machine().axis("x").setPosition(0.0);
  folder.fill("pwm1/duty_cycle");
  const auto result = machine().wait(machine().followPath(request));
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_EQ(result.marks_made, 0U);
  EXPECT_EQ(result.marks_not_made, 2U);
  EXPECT_NE(fault().find("the line pwmchip0:1 of the output laser can't be written: errno 28"),
            std::string::npos)
      << fault();
  EXPECT_LT(machine().axis("x").state().position, 0.02) << "it hasn't gone on to the end";
  EXPECT_THROW(machine().recover(), Error);
  folder.repair("pwm1/duty_cycle");
  machine().recover();
  EXPECT_EQ(fault(), "");
  EXPECT_EQ(folder.read("pwm1/duty_cycle"), "0") << "its safe state";
  bench->machine.reset();
}

}  // namespace
}  // namespace stepdriver
