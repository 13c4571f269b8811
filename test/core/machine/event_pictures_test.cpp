#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/motion_trace.h"

// The outputs and inputs of docs/motion.md, as the rig saw them: what the page says of them is
// compared with the edges here, and scripts/motion_pictures.sh draws its pictures from the same
// edges. 80 steps/mm.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::MotionTrace;

constexpr double kPerStep = 1.0 / 80'000.0;  // m
constexpr double kExact = 1.5e-9;            // s: times are whole nanoseconds

config::OutputConfig output(const std::string& name) {
  config::OutputConfig config;
  config.name = name;
  config.line = "io." + name;
  return config;
}

config::InputConfig input(const std::string& name) {
  config::InputConfig config;
  config.name = name;
  config.line = {"io." + name, true, Bias::kAsIs};
  return config;
}

/// @param from, to [mm] where the carriage presses it
sim::SwitchSpec flag(const std::string& name, double from, double to) {
  sim::SwitchSpec contact;
  contact.line = "io." + name;
  contact.active_level = true;
  contact.position = from;
  contact.end = to;
  contact.hysteresis = 0.5;
  return contact;
}

class EventPictures : public testing::Test {
 protected:
  using Change = std::function<void(sim::RigAxisSpec&)>;

  void build(const std::vector<config::AxisConfig>& axes, const machine::MachineOptions& options,
             const Change& change = {}) {
    std::vector<sim::RigAxisSpec> rig = Bench::rigAxes(axes);
    if (change) change(rig.front());
    bench = std::make_unique<Bench>(axes, rig, false, 0.0, options);
    trace = std::make_unique<MotionTrace>(*bench);
  }

  axis::Axis& x() { return bench->axis("x"); }
  void advanceTo(double time) { bench->machine->advance(time - trace->now()); }
  /// [s] When an axis made a step to this count, in a direction.
  double timeOfStep(std::int64_t count, const std::string& axis = "x", bool up = true) const {
    std::int64_t before = 0;
    for (const MotionTrace::Step& step : trace->steps(axis)) {
      if (step.count == count && (step.count > before) == up) return step.time;
      before = step.count;
    }
    return -1.0;
  }
  std::optional<MotionTrace::Step> stepAt(double time) const {
    for (const MotionTrace::Step& step : trace->steps("x")) {
      if (std::abs(step.time - time) < kExact) return step;
    }
    return std::nullopt;
  }

  std::unique_ptr<Bench> bench;
  std::unique_ptr<MotionTrace> trace;
};

TEST_F(EventPictures, ACameraEveryTwoMillimetres) {
  machine::MachineOptions options;
  options.outputs = {output("camera")};
  config::PositionCompare& compare = options.outputs[0].compare.emplace();
  compare.axis = "x";
  compare.direction = config::PositionCompare::Direction::kUp;
  compare.every = config::PositionCompare::Every{0.002, 0.004, 0.036};
  compare.pulse_ns = 4'000'000;
  build({linearAxis("x")}, options);
  x().setPosition(0.0);
  const axis::Move move = x().moveTo(0.040);
  advanceTo(0.25);
  trace->mark("hold");
  bench->machine->hold();
  advanceTo(0.5);
  trace->mark("resume");
  bench->machine->resume();
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  advanceTo(1.0);
  trace->mark("back");
  EXPECT_EQ(bench->move(0.0).end, MoveEnd::kReached);

  const std::vector<double> on = trace->times("outputs", "camera", true);
  const std::vector<double> off = trace->times("outputs", "camera", false);
  ASSERT_EQ(on.size(), 17U) << "from 4 mm to 36 mm, on the way up only";
  ASSERT_EQ(off.size(), on.size());
  for (std::size_t i = 0; i < on.size(); ++i) {
    EXPECT_NEAR(on[i], timeOfStep(320 + 160 * static_cast<std::int64_t>(i)), kExact) << i;
    EXPECT_NEAR(off[i] - on[i], 0.004, kExact) << i;
  }
  EXPECT_NEAR(trace->speedAt("x", 0.2), 8000.0, 1.0) << "100 mm/s";
  trace->keep("position_compare");
}

TEST_F(EventPictures, ALaserAlongAPathWithLeads) {
  machine::MachineOptions options;
  options.outputs = {output("laser")};
  build({linearAxis("x"), linearAxis("y")}, options);
  // Places at which a step goes out: its time shows when the axis was there.
  const auto to = [](std::int64_t count) { return (static_cast<double>(count) - 0.5) * kPerStep; };
  motion::PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
  request.segments.resize(3);
  request.segments[0].end = {0.020, 0.0};
  request.segments[1].end = {0.030, 0.010};
  request.segments[2].end = {0.030, 0.030};
  request.segments[0].outputs = {{"laser", true, 1.0, to(400)}};
  request.segments[2].outputs = {{"laser", false, 1.0, to(1200) - 0.010},
                                 {"laser", true, 1.0, to(1600) - 0.010},
                                 {"laser", false, 1.0, to(2080) - 0.010}};
  request.leads = {{"laser", 0.010, 0.005}};
  const auto move = bench->machine->followPath(request);
  const auto result = bench->machine->wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 4U);

  const std::vector<double> on = trace->times("outputs", "laser", true);
  const std::vector<double> off = trace->times("outputs", "laser", false);
  ASSERT_EQ(on.size(), 2U);
  ASSERT_EQ(off.size(), 2U);
  EXPECT_NEAR(timeOfStep(400, "x") - on[0], 0.010, kExact);
  EXPECT_NEAR(timeOfStep(1200, "y") - off[0], 0.005, kExact);
  EXPECT_NEAR(timeOfStep(1600, "y") - on[1], 0.010, kExact);
  EXPECT_NEAR(timeOfStep(2080, "y") - off[1], 0.005, kExact);
  trace->keep("path_outputs");
}

TEST_F(EventPictures, AProbeTouchesTwice) {
  machine::MachineOptions options;
  options.inputs = {input("probe")};
  build({linearAxis("x", 80'000.0, 0.1, 0.2)}, options,
        [](sim::RigAxisSpec& spec) { spec.flags = {flag("probe", 20.0, 80.0)}; });
  x().setPosition(0.0);
  machine::ProbeRequest request;
  request.input = "probe";
  request.names = {"x"};
  request.positions = {0.030};
  request.velocity = 0.020;
  request.second_velocity = 0.004;
  request.back_off = 0.003;
  request.returns = true;
  const machine::ProbeResult result = bench->machine->probe(request);
  ASSERT_EQ(result.end, machine::ProbeEnd::kContact) << result.message;
  EXPECT_NEAR(result.contact.front(), 0.020 - 0.5 * kPerStep, 1e-8);

  const std::vector<double> contacts = trace->times("x", "flag1", true);
  ASSERT_EQ(contacts.size(), 2U);
  std::int64_t farthest = 0;
  for (const MotionTrace::Step& step : trace->steps("x")) {
    farthest = std::max(farthest, step.count);
  }
  // 20 mm/s at 200 mm/s^2 are 1 mm; a plan begins a millisecond later, within which it makes 1.6
  // steps.
  EXPECT_NEAR(static_cast<double>(farthest), 80.0 * 21.0, 2.1);
  for (const double contact : contacts) {
    ASSERT_TRUE(stepAt(contact)) << contact;
    EXPECT_EQ(stepAt(contact)->count, 1600) << contact;
  }
  EXPECT_NEAR(trace->speedAt("x", contacts[0]), 1600.0, 1.0);
  EXPECT_NEAR(trace->speedAt("x", contacts[1]), 320.0, 1.0);
  EXPECT_NEAR(static_cast<double>(trace->steps("x").back().count), 1600.0, 1.0);
  trace->keep("probe");
}

TEST_F(EventPictures, AFlagIsPassedFromTheSameSideWhereverTheAxisBegan) {
  struct Begin {
    double place;  // [mm]
    const char* name;
  };
  for (const Begin& begin : {Begin{5.0, "flag_from_below"}, Begin{45.0, "flag_from_above"}}) {
    config::AxisConfig config = linearAxis("x");
    config.endstop_min.reset();
    config::HomingConfig& homing = config.homing.emplace();
    homing.kind = config::HomingKind::kFlag;
    homing.at_max = true;
    homing.input = "flag";
    homing.seek_speed = 0.05;
    homing.latch_speed = 0.005;
    homing.offset = 0.020;
    homing.max_travel = 0.1;
    machine::MachineOptions options;
    options.inputs = {input("flag")};
    build({config}, options, [&](sim::RigAxisSpec& spec) {
      spec.start = begin.place;
      spec.max_switch->position = 50.0;
      spec.flags = {flag("flag", 20.0, 30.0)};
    });
    const axis::HomingResult result = x().home();
    ASSERT_EQ(result.end, axis::HomingEnd::kHomed) << begin.name << ": " << result.message;

    const std::vector<double> pressed = trace->times("x", "flag1", true);
    ASSERT_FALSE(pressed.empty());
    ASSERT_TRUE(stepAt(pressed.back())) << begin.name;
    EXPECT_EQ(stepAt(pressed.back())->count, std::lround((20.0 - begin.place) * 80.0))
        << begin.name;
    EXPECT_NEAR(trace->speedAt("x", pressed.back()), 400.0, 1.0) << "5 mm/s, upwards";
    EXPECT_NEAR(bench->report().carriage, 20.0, 0.013) << begin.name << ", in mm";
    EXPECT_NEAR(x().state().position, 0.020, kPerStep) << begin.name;
    trace->keep(begin.name);
  }
}

}  // namespace
}  // namespace stepdriver
