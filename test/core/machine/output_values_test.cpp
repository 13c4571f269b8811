#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/passing_lines.h"
#include "support/path_bench.h"
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
using test::PathRequest;
using test::PathSegment;
using test::UnthreadedMachine;

constexpr const char* kLaser = "pwmchip0:0/200000/0/200000";

struct Written {
  std::int64_t time_ns = 0;
  double value = 0.0;
};

/// Keeps what the line of the laser gets.
class LaserLines : public test::PassingLines {
 public:
  LaserLines(std::unique_ptr<gpio::Lines> lines, pulse::VirtualClock& clock,
             std::vector<Written>& written)
      : PassingLines(std::move(lines)), clock_(clock), written_(written) {}
  int write(const gpio::LineWrite* writes, std::size_t count) noexcept override {
    for (std::size_t i = 0; i < count; ++i) {
      if (outputName(writes[i].output) != kLaser) continue;
      const double part = static_cast<double>(writes[i].part) / gpio::LineWrite::kWhole;
      written_.push_back({clock_.now(), writes[i].level ? part : 0.0});
    }
    return PassingLines::write(writes, count);
  }

 private:
  pulse::VirtualClock& clock_;
  std::vector<Written>& written_;
};

class LaserBackend : public gpio::Backend {
 public:
  LaserBackend(gpio::Backend& backend, pulse::VirtualClock& clock, std::vector<Written>& written)
      : backend_(backend), clock_(clock), written_(written) {}
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override {
    return std::make_unique<LaserLines>(backend_.request(outputs, inputs), clock_, written_);
  }

 private:
  gpio::Backend& backend_;
  pulse::VirtualClock& clock_;
  std::vector<Written>& written_;
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

  void begin() {
    const std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(axes, specs, false, 0.0, options);
    bench->machine.reset();
    written.clear();
    backend = std::make_unique<LaserBackend>(bench->backend, bench->clock, written);
    bench->machine = std::make_unique<UnthreadedMachine>(axes, *backend, bench->clock, options);
    written.clear();
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
    for (const Written& one : written) all.push_back(std::round(one.value * 1e4) * 1e-4);
    return all;
  }

  machine::MachineOptions options;
  std::vector<Written> written;
  std::unique_ptr<LaserBackend> backend;
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
  EXPECT_EQ(written.size(), 5U) << "it is off already";
}

TEST_F(OutputValues, AreRefusedIfNoPulsesHaveThem) {
  begin();
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  for (const double value : {0.0, -0.5, 1e-300, 1.0 / 65'537, 1.0000001, 1e300, kNan}) {
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
  while (machine().axis("x").state().moving || written.empty()) {
    bench->machine->advance(1e-3);
    if (seen.back() != laser().value) seen.push_back(laser().value);
  }
  const auto result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 5U);
  EXPECT_EQ(values(), (std::vector<double>{0.5, 0.25, 1.0, 0.0, 0.125}));
  ASSERT_EQ(seen.size(), 6U);
  for (std::size_t i = 1; i < seen.size(); ++i)
    EXPECT_EQ(seen[i], written[i - 1].value) << "as it is published";
  // Each comes with the step at its place: the segments are of 5 mm at 100 mm/s.
  for (std::size_t i = 2; i + 1 < written.size(); ++i) {
    const std::int64_t after = written[i].time_ns - written[i - 1].time_ns;
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

}  // namespace
}  // namespace stepdriver
