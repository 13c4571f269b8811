#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/path_bench.h"
#include "support/refusal.h"
#include "support/traced_place.h"

// Outputs that a path switches where its segments begin.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using machine::OutputState;
using motion::OutputSwitch;
using test::Bench;
using test::CoordinatedMove;
using test::CoordinatedResult;
using test::kMicrostep;
using test::kMillisecond;
using test::kNan;
using test::kSecond;
using test::lineTo;
using test::PathRequest;
using test::PathSegment;

/// The position at which an axis makes its step to a count: then a mark comes with that step.
double stepTo(std::int64_t count) { return (static_cast<double>(count) - 0.5) * kMicrostep; }

class PathOutputs : public test::PathBench {
 protected:
  void SetUp() override {
    options.outputs = test::penAndLaser();
    options.record_seconds = 60.0;
    axes = {plotterAxis("x"), plotterAxis("y")};
    begin();
  }

  void begin() {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(axes);
    for (sim::RigAxisSpec& spec : specs) spec.max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(axes, specs, false, 0.0, options);
  }

  static PathSegment with(PathSegment segment, std::vector<OutputSwitch> outputs) {
    segment.outputs = std::move(outputs);
    return segment;
  }

  /// Along x, with a segment that ends at each of these steps. The n-th of them begins with the
  /// pen on if n is odd, and off if it is even; the first one leaves it.
  static PathRequest dashes(const std::vector<std::int64_t>& counts) {
    PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
    bool on = false;
    for (const std::int64_t count : counts) {
      request.segments.push_back(lineTo({stepTo(count), 0.0}));
      if (request.segments.size() > 1) request.segments.back().outputs = {{"pen", on = !on}};
    }
    return request;
  }

  /// The clock times at which a line was switched on, or off.
  std::vector<std::int64_t> switched(std::size_t output, bool on) const {
    const config::OutputConfig& config = options.outputs[output];
    return bench->trace->times("outputs", config.name, on == config.active_level);
  }
  /// Both, in their order.
  std::vector<std::int64_t> edges(std::size_t output = 0) const {
    std::vector<std::int64_t> all = switched(output, true);
    const std::vector<std::int64_t> off = switched(output, false);
    all.insert(all.end(), off.begin(), off.end());
    std::sort(all.begin(), all.end());
    return all;
  }
  struct Step {
    std::int64_t time_ns = 0;  ///< of the clock
    std::int64_t count = 0;    ///< after it
  };
  std::vector<Step> steps(const std::string& name) const {
    const sim::MemoryTrace& trace = *bench->trace;
    const int step = trace.pin(name, "step");
    const int dir = trace.pin(name, "dir");
    bool forward = trace.levels()[static_cast<std::size_t>(dir)];
    std::vector<Step> found;
    std::int64_t count = 0;
    for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      found.push_back({edge.time_ns, count += forward ? 1 : -1});
    }
    return found;
  }
  /// The clock times of the first steps of x to these counts; -1: there is none.
  std::vector<std::int64_t> timesOfSteps(const std::vector<std::int64_t>& counts) const {
    const std::vector<Step> all = steps("x");
    std::vector<std::int64_t> times;
    for (const std::int64_t count : counts) {
      const auto found = std::find_if(all.begin(), all.end(),
                                      [&](const Step& step) { return step.count == count; });
      times.push_back(found == all.end() ? -1 : found->time_ns);
    }
    return times;
  }
  std::int64_t timeOfStep(std::int64_t count) const { return timesOfSteps({count}).front(); }
  bool isOn(std::size_t output) const {
    const config::OutputConfig& config = options.outputs.at(output);
    const bool on = bench->rig.outputLevel(config.line) == config.active_level;
    EXPECT_EQ(bench->machine->ioStates().outputs.at(output).on, on) << config.name;
    return on;
  }
  /// Each of these steps comes with the next change of the pen.
  void expectWithSteps(const std::vector<std::int64_t>& counts) {
    const std::vector<std::int64_t> times = edges();
    const std::vector<std::int64_t> wanted = timesOfSteps(counts);
    ASSERT_EQ(times.size(), counts.size());
    for (std::size_t i = 0; i < counts.size(); ++i) {
      EXPECT_LE(std::abs(times[i] - wanted[i]), 1) << "mark " << i << " at " << times[i];
    }
  }

  machine::MachineOptions options;
  std::vector<config::AxisConfig> axes;
};

TEST_F(PathOutputs, AreSwitchedAtTheNanosecondOfTheirPlacesWithoutAStop) {
  const std::vector<std::int64_t> counts{100, 200, 700, 707, 1500, 1900};
  PathRequest request = dashes(counts);
  for (PathSegment& segment : request.segments) segment.outputs.clear();
  finish(request);
  const std::vector<Step> without = steps("x");
  const std::int64_t ended = bench->clock.now();
  begin();
  const CoordinatedResult result = finish(dashes(counts));
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 5U);
  EXPECT_EQ(result.marks_not_made, 0U);
  EXPECT_EQ(bench->clock.now(), ended);
  const std::vector<Step> with_marks = steps("x");
  ASSERT_EQ(with_marks.size(), without.size());
  for (std::size_t i = 0; i < without.size(); ++i) {
    EXPECT_EQ(with_marks[i].time_ns, without[i].time_ns);
  }
  expectWithSteps({100, 200, 700, 707, 1500});
  expectAtRest();
}

// Two strokes of a drawing that adjoin, each with a laser of its own, and a third one after a jump.
TEST_F(PathOutputs, StrokesHaveNoGapInTheirStepsWhereTheLaserIsSwitched) {
  const std::vector<std::int64_t> ends{800, 2000, 2800, 3600};
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0};
  request.segments = {lineTo({stepTo(ends[0]), 0.0}),
                      with(lineTo({stepTo(ends[1]), 0.0}), {{"laser", true}}),
                      with(lineTo({stepTo(ends[2]), 0.0}), {{"laser", false}, {"pen", true}}),
                      with(lineTo({stepTo(ends[3]), 0.0}), {{"pen", false}}),
                      with(lineTo({stepTo(4800), 0.0}), {{"pen", true}})};
  finish(request);
  const std::vector<std::int64_t> wanted = timesOfSteps(ends);
  EXPECT_EQ(edges(1), (std::vector<std::int64_t>{wanted[0], wanted[1]}));
  expectWithSteps({ends[1], ends[2], ends[3]});
  // At 100 mm/s a microstep takes 125 us.
  std::int64_t longest = 0;
  const std::vector<Step> all = steps("x");
  for (std::size_t i = 1; i < all.size(); ++i) {
    if (all[i].count < ends[0] || all[i].count > ends[3]) continue;
    longest = std::max(longest, all[i].time_ns - all[i - 1].time_ns);
  }
  EXPECT_GT(longest, 0);
  EXPECT_LE(longest, 125'001);
}

TEST_F(PathOutputs, AreSwitchedAtDistancesAlongASegment) {
  const std::vector<std::int64_t> counts{100, 200, 700, 707, 1500};
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
  request.segments = {lineTo({stepTo(1900), 0.0}), lineTo({stepTo(2000), 0.0})};
  // In any order.
  for (const std::size_t i : {4U, 2U, 0U, 3U, 1U}) {
    request.segments[0].outputs.push_back({"pen", i % 2 == 0, 1.0, stepTo(counts[i])});
  }
  request.segments[1].outputs = {{"pen", false}, {"pen", true, 1.0, stepTo(1950) - stepTo(1900)}};
  const CoordinatedResult result = finish(request);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 7U);
  std::vector<std::int64_t> all = counts;
  all.insert(all.end(), {1900, 1950});
  expectWithSteps(all);
  expectAtRest();
}

// Where the steps have brought the axes at a time, and where a curve is at a distance, by many
// short lines.
TEST_F(PathOutputs, AreSwitchedAtDistancesAlongCurves) {
  constexpr double kRight = 1.5707963267948966;
  const auto on_arc = [](double part) {
    return std::array<double, 2>{0.02 * std::sin(kRight * part),
                                 0.02 - 0.02 * std::cos(kRight * part)};
  };
  const auto on_bezier = [](double u) {
    const double v = 1.0 - u;
    const double a = 3.0 * v * v * u;
    const double b = 3.0 * v * u * u;
    return std::array<double, 2>{a * 0.03 + b * 0.04 + u * u * u * 0.02,
                                 b * 0.01 + u * u * u * 0.03};
  };
  PathSegment arc = test::arcTo({0.02, 0.02}, {0.0, 0.02});
  PathSegment bezier = lineTo({0.02, 0.03});
  bezier.shape = PathSegment::Shape::kBezier;
  bezier.control1 = {0.03, 0.0};
  bezier.control2 = {0.04, 0.01};
  const auto check = [&](const PathSegment& segment, const auto& place) {
    begin();
    constexpr int kLines = 200'000;
    const std::vector<double> distances{1e-6, 0.003, 0.0071, 0.02, 0.0301};
    PathRequest request{{"x", "y"}, {segment}, false, 0.0, 0.0005};
    for (std::size_t i = 0; i < distances.size(); ++i) {
      request.segments[0].outputs.push_back({"pen", i % 2 == 0, 1.0, distances[i]});
    }
    const CoordinatedResult result = finish(request);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    const std::vector<std::int64_t> times = edges();
    ASSERT_EQ(times.size(), distances.size());
    double length = 0.0;
    std::size_t next = 0;
    for (int k = 1; k <= kLines && next < distances.size(); ++k) {
      const auto from = place(static_cast<double>(k - 1) / kLines);
      const auto to = place(static_cast<double>(k) / kLines);
      length += std::hypot(to[0] - from[0], to[1] - from[1]);
      if (length < distances[next]) continue;
      for (const std::size_t axis : {0U, 1U}) {
        std::int64_t count = 0;
        for (const Step& step : steps(axis == 0 ? "x" : "y")) {
          if (step.time_ns <= times[next]) count = step.count;
        }
        EXPECT_NEAR(static_cast<double>(count) * kMicrostep, to[axis], 0.55 * kMicrostep)
            << distances[next] << " m, axis " << axis;
      }
      ++next;
    }
    EXPECT_EQ(next, distances.size());
  };
  check(arc, on_arc);
  check(bezier, on_bezier);
}

TEST_F(PathOutputs, AtADistanceBeyondTheirSegmentAreRefused) {
  const auto switched_at = [](double distance) {
    PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
    request.segments = {lineTo({0.01, 0.0}),
                        with(lineTo({0.01, 0.02}), {{"pen", true, 1.0, distance}})};
    return request;
  };
  for (const double distance : {-1e-300, -1.0, 0.0200001, 1e300, kNan}) {
    EXPECT_REFUSED(bench->machine->followPath(switched_at(distance)),
                   "segment 1 of the path switches the output pen at ");
    EXPECT_REFUSED(bench->machine->followPath(switched_at(distance)),
                   "m or rad, but must do so at 0 to 0.02, its length");
  }
  EXPECT_EQ(finish(switched_at(0.02)).marks_made, 1U);
  PathRequest nowhere = switched_at(0.0);
  nowhere.segments.push_back(with(lineTo({0.01, 0.02}), {{"pen", false, 1.0, 1e-9}}));
  EXPECT_REFUSED(bench->machine->followPath(nowhere), "at 0 to 0, its length");
  PathRequest twice = switched_at(0.005);
  twice.segments[1].outputs.push_back({"pen", false, 1.0, 0.005});
  EXPECT_REFUSED(bench->machine->followPath(twice), "switches the output pen twice");
  // A curve that no axis can pass without a stop.
  PathRequest cusp{{"x", "y"}, {lineTo({0.01, 0.0})}, true, 0.0, 0.0005};
  cusp.segments[0].shape = PathSegment::Shape::kBezier;
  cusp.segments[0].control1 = {0.01, 0.01};
  cusp.segments[0].control2 = {0.0, 0.01};
  cusp.segments[0].outputs = {{"pen", true, 1.0, 0.001}};
  EXPECT_REFUSED(bench->machine->followPath(cusp), "segment 0 is a Bezier with a cusp");
}

// The new plan passes those that are still ahead on the last segment at other times.
TEST_F(PathOutputs, AtDistancesComeOnceIfThePathIsContinuedAmongThem) {
  for (const double appended_after : {0.05, 0.1, 0.2, 0.3, 0.4, 0.5}) {
    begin();
    const std::vector<std::int64_t> counts{300, 900, 1500, 2100, 2700, 3100, 3300};
    PathRequest request{{"x", "y"}, {lineTo({stepTo(3200), 0.0})}, false, 0.0, 0.0005, true};
    for (std::size_t i = 0; i + 1 < counts.size(); ++i) {
      request.segments[0].outputs.push_back({"pen", i % 2 == 0, 1.0, stepTo(counts[i])});
    }
    const CoordinatedMove move = bench->machine->followPath(request);
    bench->machine->advance(appended_after);
    const double distance = stepTo(3300) - stepTo(3200);
    bench->machine->appendPath(
        {move.id(), {with(lineTo({stepTo(4000), 0.0}), {{"pen", true, 1.0, distance}})}, false});
    const CoordinatedResult result = bench->machine->wait(move);
    EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
    EXPECT_EQ(result.marks_made, 7U) << appended_after;
    EXPECT_EQ(result.marks_not_made, 0U);
    expectWithSteps(counts);
  }
}

TEST_F(PathOutputs, AreSwitchedInTheMiddleOfARoundedCorner) {
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0005};
  request.segments = {lineTo({0.01, 0.0}), with(lineTo({0.01, 0.01}), {{"pen", true}})};
  finish(request);
  const std::vector<std::int64_t> on = edges();
  ASSERT_EQ(on.size(), 1U);
  // There, both axes are as far from the corner.
  const auto count_at = [&](const std::string& name) {
    std::int64_t count = 0;
    for (const Step& step : steps(name)) {
      if (step.time_ns <= on[0]) count = step.count;
    }
    return count;
  };
  EXPECT_NEAR(static_cast<double>(800 - count_at("x")), static_cast<double>(count_at("y")), 1.0);
  EXPECT_GT(count_at("y"), 5);
}

TEST_F(PathOutputs, AtStopsAtTheBeginAndAtTheEndTheyComeWithThePlannedTimes) {
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0};
  request.segments = {with(lineTo({0.01, 0.0}), {{"pen", true}, {"laser", true}}),
                      with(lineTo({0.01, 0.01}), {{"pen", false}}),
                      with(lineTo({0.01, 0.01}), {{"laser", false}})};
  const std::int64_t asked = bench->clock.now();
  finish(request);
  const auto x = steps("x");
  const auto y = steps("y");
  ASSERT_EQ(edges(0).size(), 2U);
  ASSERT_EQ(edges(1).size(), 2U);
  EXPECT_GE(edges(0)[0], asked);
  EXPECT_EQ(edges(0)[0], edges(1)[0]);
  EXPECT_LT(edges(0)[0], x.front().time_ns);
  EXPECT_GT(edges(0)[1], x.back().time_ns);
  EXPECT_LT(edges(0)[1], y.front().time_ns);
  EXPECT_GT(edges(1)[1], y.back().time_ns);
  EXPECT_FALSE(isOn(0));
  EXPECT_FALSE(isOn(1));
}

TEST_F(PathOutputs, APathThatOnlySwitchesIsNoMotion) {
  PathRequest request{{"x"}, {}, false, 0.0, 0.0};
  request.segments = {with(lineTo({0.0}), {{"pen", true}})};
  EXPECT_EQ(finish(request).marks_made, 1U);
  EXPECT_TRUE(isOn(0));
  EXPECT_TRUE(steps("x").empty());
  bench->machine->setOutput("pen", false);
  EXPECT_FALSE(isOn(0));
}

TEST_F(PathOutputs, HoldsAndOverridesTakeThemAlong) {
  const std::vector<std::int64_t> counts{300, 600, 601, 1200, 1800, 2400, 2700};
  const CoordinatedMove move = followPath(dashes(counts));
  advance(0.1);
  machine().setSpeedOverride(0.3);
  advance(0.1);
  machine().hold();
  advance(3.0);
  machine().resume();
  advance(0.2);
  machine().setSpeedOverride(1.0);
  advance(0.05);
  machine().hold();
  machine().resume();
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 6U);
  expectWithSteps({300, 600, 601, 1200, 1800, 2400});
}

TEST_F(PathOutputs, AStopMakesWhatItPassesAndReportsTheRest) {
  PathRequest request = dashes({400, 600, 800, 1000, 1200, 4000, 5000});
  request.segments[0].outputs = {{"laser", true}};
  const CoordinatedMove move = followPath(request);
  while (steps("x").size() < 700) advance(1e-3);
  EXPECT_TRUE(isOn(1));
  const std::int64_t asked = bench->clock.now();
  machine().stop();
  EXPECT_FALSE(isOn(1)) << "its at_stop is off";
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kStopped);
  ASSERT_EQ(switched(1, false).size(), 1U);
  EXPECT_LE(switched(1, false)[0] - asked, kMillisecond);
  const auto passed = static_cast<std::int64_t>(steps("x").size());
  ASSERT_GT(passed, 1000) << "it passes marks while it slows down";
  ASSERT_LT(passed, 4000);
  EXPECT_EQ(edges().size(), passed >= 1200 ? 5U : 4U);
  EXPECT_EQ(result.marks_made, 1U + edges().size());
  EXPECT_EQ(result.marks_not_made, 7U - result.marks_made);
  EXPECT_NE(result.message.find("pen wasn't switched at "), std::string::npos) << result.message;
  advance(1.0);
  EXPECT_EQ(edges().size(), result.marks_made - 1);
  bench->machine->setOutput("pen", false);
  bench->machine->setOutput("laser", true);
}

TEST_F(PathOutputs, AnEmergencyStopLeavesThemSafeAndCutsOffTheRest) {
  const CoordinatedMove move = followPath(dashes({200, 500, 1000, 1500}));
  while (steps("x").size() < 400) advance(1e-3);
  EXPECT_TRUE(isOn(0));
  const std::int64_t asked = bench->clock.now();
  machine().emergencyStop();
  EXPECT_FALSE(isOn(0));
  ASSERT_EQ(edges().size(), 2U);
  EXPECT_LE(edges()[1] - asked, kMillisecond);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kEmergencyStop);
  EXPECT_EQ(result.marks_made, 1U);
  EXPECT_EQ(result.marks_not_made, 2U);
  machine().recover();
  advance(1.0);
  EXPECT_EQ(edges().size(), 2U);
}

TEST_F(PathOutputs, AreSafeAndGivenUpIfAnEmergencyStopComesInAHold) {
  const CoordinatedMove move = followPath(dashes({200, 2000, 3000}));
  while (steps("x").size() < 400) advance(1e-3);
  machine().hold();
  advance(1.0);
  EXPECT_TRUE(isOn(0));
  machine().emergencyStop();
  EXPECT_FALSE(isOn(0));
  EXPECT_EQ(machine().wait(move).marks_not_made, 1U);
  machine().recover();
  bench->machine->setOutput("pen", true);
  EXPECT_TRUE(isOn(0));
}

TEST_F(PathOutputs, AFaultOfAnAxisEndsThem) {
  axes[0].driver = driver::driverChip("drv8825");
  axes[0].fault = config::FaultPin{"x.fault"};
  begin();
  const CoordinatedMove move = followPath(dashes({200, 500, 1000}));
  while (steps("x").size() < 300) advance(1e-3);
  sim::RigFaults over_current;
  over_current.chip_fault_after = 10;
  bench->rig.setFaults("x", over_current);
  while (!machine().result(move)) advance(1e-3);
  const CoordinatedResult result = *machine().result(move);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_EQ(result.marks_not_made, 1U);
  advance(0.1);
  EXPECT_FALSE(isOn(0));
}

TEST_F(PathOutputs, AnotherCommandTakesOverAndTheRestIsNotMade) {
  const CoordinatedMove move = followPath(dashes({200, 4000, 5000}));
  while (steps("x").size() < 300) advance(1e-3);
  const axis::Move next = bench->axis("x").moveTo(0.02);
  bench->axis("x").wait(next);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.marks_made, 1U);
  EXPECT_EQ(result.marks_not_made, 1U);
  EXPECT_TRUE(isOn(0)) << "it has no at_stop";
  bench->machine->setOutput("pen", false);
}

TEST_F(PathOutputs, LeadsSwitchThemEarlier) {
  PathRequest request = dashes({1000, 3000, 5000});
  request.leads = {{"pen", 0.02, 0.005}};
  finish(request);
  ASSERT_EQ(edges().size(), 2U);
  EXPECT_NEAR(static_cast<double>(timeOfStep(1000) - edges()[0]), 20e6, 1.0);
  EXPECT_NEAR(static_cast<double>(timeOfStep(3000) - edges()[1]), 5e6, 1.0);
}

TEST_F(PathOutputs, ALeadThatIsLongerThanTheWayBeginsWithThePath) {
  PathRequest request = dashes({10, 3000, 5000});
  request.leads = {{"pen", 10.0, 0.0}};
  const std::int64_t asked = bench->clock.now();
  finish(request);
  ASSERT_EQ(edges().size(), 2U);
  EXPECT_GE(edges()[0], asked);
  EXPECT_LT(edges()[0], timeOfStep(1));
}

TEST_F(PathOutputs, WhatALineCannotMakeIsRefusedBeforeAnythingMoves) {
  options.outputs[0].min_on_ns = 50 * kMillisecond;
  options.outputs[0].min_off_ns = 200 * kMillisecond;
  options.outputs[0].max_on_ns = kSecond;
  begin();
  // 8000 steps/s.
  EXPECT_REFUSED(followPath(dashes({2000, 2200, 6000})),
                 "segment 2 of the path switches the output pen off 0.025");
  EXPECT_REFUSED(followPath(dashes({2000, 2200, 6000})), "but min_on_ms of it is 0.05 s");
  EXPECT_REFUSED(followPath(dashes({2000, 3000, 4000, 6000})), "but min_off_ms of it is 0.2 s");
  EXPECT_REFUSED(followPath(dashes({1000, 10000, 12000})), "but max_on_s of it is 1 s");
  PathRequest request = dashes({1000, 3000});
  request.segments[1].outputs[0].output = "pan";
  EXPECT_REFUSED(followPath(request),
                 "segment 1 of the path switches the output pan, but there are pen, laser");
  request.segments[1].outputs = {{"pen", true}, {"pen", false}};
  EXPECT_REFUSED(followPath(request), "segment 1 of the path switches the output pen twice");
  request.segments[1].outputs = {{"pen", true}};
  for (const double lead : {-1e-9, 10.1, kNan}) {
    request.leads = {{"pen", lead, 0.0}};
    EXPECT_REFUSED(followPath(request), "but must be 0 to 10 s");
  }
  request.leads = {{"pan", 0.0, 0.0}};
  EXPECT_REFUSED(followPath(request), "a lead of the path is for the output pan, but there are");
  advance(1.0);
  EXPECT_TRUE(steps("x").empty());
  EXPECT_TRUE(edges().empty());
  request.leads.clear();
  EXPECT_EQ(finish(request).marks_made, 1U);
}

// The pulses of a servo come every 20 ms.
TEST_F(PathOutputs, APwmOutputIsNotSwitchedFasterThanItsPulsesCome) {
  options.outputs[0].line = "pwmchip0:0/20000000/1000000/2000000";
  options.outputs[0].min_off_ns = 30 * kMillisecond;
  begin();
  // 8000 steps/s.
  EXPECT_REFUSED(followPath(dashes({2000, 2100, 6000})),
                 "segment 2 of the path switches the output pen off 0.0125");
  EXPECT_REFUSED(followPath(dashes({2000, 2100, 6000})), "but the PWM period of it is 0.02 s");
  EXPECT_REFUSED(followPath(dashes({2000, 3000, 3200, 6000})), "but min_off_ms of it is 0.03 s");
  EXPECT_EQ(finish(dashes({2000, 2200, 2500, 6000})).marks_made, 3U);
  EXPECT_EQ(edges().size(), 3U);
  // What was switched before the path counts too.
  machine().setOutput("pen", false);
  machine().setOutput("pen", true);
  machine().axis("x").setPosition(0.0);
  PathRequest at_once{{"x"}, {}, false, 0.0, 0.0};
  at_once.segments = {with(lineTo({0.01}), {{"pen", false}})};
  finish(at_once);
  ASSERT_EQ(edges().size(), 6U);
  EXPECT_EQ(edges()[5] - edges()[4], 20 * kMillisecond);
}

TEST_F(PathOutputs, ThePathWaitsForTheLeastTimesOfWhatWasSwitchedBefore) {
  options.outputs[0].min_on_ns = kSecond;
  begin();
  machine().setOutput("pen", true);
  PathRequest request{{"x"}, {}, false, 0.0, 0.0};
  request.segments = {with(lineTo({0.01}), {{"pen", false}})};
  finish(request);
  ASSERT_EQ(edges().size(), 2U);
  EXPECT_EQ(edges()[1] - edges()[0], kSecond);
  EXPECT_LT(edges()[1], steps("x").front().time_ns);
}

TEST_F(PathOutputs, MaxOnEndsInAHold) {
  options.outputs[0].max_on_ns = kSecond;
  begin();
  const CoordinatedMove move = followPath(dashes({400, 3000, 4000}));
  while (steps("x").size() < 500) advance(1e-3);
  machine().hold();
  advance(3.0);
  ASSERT_EQ(edges().size(), 2U);
  EXPECT_EQ(edges()[1] - edges()[0], kSecond);
  const OutputState state = machine().ioStates().outputs[0];
  EXPECT_FALSE(state.on);
  EXPECT_NE(state.note.find("the most that max_on_s allows"), std::string::npos) << state.note;
  machine().resume();
  EXPECT_EQ(machine().wait(move).marks_made, 2U);
  EXPECT_EQ(edges().size(), 2U);
}

TEST_F(PathOutputs, NothingElseSwitchesThemMeanwhile) {
  const CoordinatedMove move = followPath(dashes({200, 4000, 6000}));
  advance(0.1);
  EXPECT_REFUSED(machine().setOutput("pen", false), "the output pen: a path of x, y switches it");
  machine().setOutput("laser", true);
  machine().wait(move);
  machine().setOutput("pen", true);
  EXPECT_TRUE(isOn(0));
  EXPECT_TRUE(isOn(1));
}

TEST_F(PathOutputs, OnePathHasAnOutputAtATime) {
  PathRequest along_x{{"x"}, {}, false, 0.0, 0.0};
  along_x.segments = {lineTo({0.01}), with(lineTo({0.02}), {{"pen", true}})};
  PathRequest along_y = along_x;
  along_y.names = {"y"};
  const CoordinatedMove first = followPath(along_x);
  EXPECT_REFUSED(followPath(along_y), "the output pen: a path of x switches it");
  along_y.segments[1].outputs[0].output = "laser";
  const CoordinatedMove second = followPath(along_y);
  EXPECT_EQ(machine().wait(first).marks_made, 1U);
  EXPECT_EQ(machine().wait(second).marks_made, 1U);
}

TEST_F(PathOutputs, AnOutputThatCannotBeWrittenIsAFaultThatNamesIt) {
  const CoordinatedMove move = followPath(dashes({800, 2000, 4000}));
  while (steps("x").size() < 500) advance(1e-3);
  bench->rig.failWrites("pen.line", 0, EIO);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_NE(state("x").fault.find("the line pen.line of the output pen can't be written: EIO"),
            std::string::npos)
      << state("x").fault;
  EXPECT_EQ(result.marks_made, 0U) << "the one that failed wasn't made";
  EXPECT_EQ(result.marks_not_made, 2U);
  bench->rig.clearWriteFault("pen.line");
  machine().recover();
  EXPECT_EQ(finish(dashes({5000, 6000, 7000})).marks_made, 2U);
}

TEST_F(PathOutputs, AFailureAtTheEndOfAPathIsItsResult) {
  PathRequest request = dashes({800, 2000});
  request.segments.push_back(with(lineTo({stepTo(2000), 0.0}), {{"pen", false}}));
  const CoordinatedMove move = followPath(request);
  while (!isOn(0)) advance(1e-3);
  bench->rig.failWrites("pen.line", 0, EIO);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(steps("x").size(), 2000U);
  EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
  EXPECT_EQ(result.marks_made, 1U);
  EXPECT_EQ(result.marks_not_made, 1U);
}

TEST_F(PathOutputs, AppendedSegmentsContinueThem) {
  PathRequest request = dashes({400, 800, 1200});
  request.more_follows = true;
  const CoordinatedMove move = followPath(request);
  advance(0.05);
  machine().appendPath({move.id(),
                        {with(lineTo({stepTo(1700), 0.0}), {{"pen", true}}),
                         with(lineTo({stepTo(2500), 0.0}), {{"pen", false}})},
                        true});
  awaitRest();
  advance(0.5);
  EXPECT_REFUSED(machine().setOutput("pen", true), "a path of x, y switches it");
  // At the end of the path, while the axes wait.
  machine().appendPath({move.id(), {with(lineTo({stepTo(2500), 0.0}), {{"pen", true}})}, true});
  advance(0.1);
  EXPECT_TRUE(isOn(0));
  machine().appendPath({move.id(), {with(lineTo({stepTo(3500), 0.0}), {{"pen", false}})}, false});
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 6U);
  ASSERT_EQ(edges().size(), 6U);
  const std::vector<std::int64_t> times = edges();
  const std::vector<std::int64_t> counts{400, 800, 1200, 1700};
  const std::vector<std::int64_t> wanted = timesOfSteps(counts);
  for (std::size_t i = 0; i < counts.size(); ++i) {
    EXPECT_LE(std::abs(times[i] - wanted[i]), 1) << i;
  }
}

// From the first step to the last one: while the axis accelerates, at constant speed, and while it
// comes to rest.
TEST_F(PathOutputs, WithAShaperTheyComeWithTheStepsOfTheAxis) {
  for (config::AxisConfig& axis : axes) {
    axis.start_speed = 0.0;
    axis.input_shaper = {{config::ShaperType::kMzv, 42.0, 0.1}};
  }
  begin();
  const std::vector<std::int64_t> counts{1, 2, 40, 200, 280, 4000, 5000, 8700, 8960, 8999, 9000};
  std::vector<std::int64_t> with_end = counts;
  with_end.push_back(9001);
  finish(dashes(with_end));
  expectWithSteps(counts);
}

TEST_F(PathOutputs, WithAShaperHoldsAndOverridesTakeThemAlong) {
  for (config::AxisConfig& axis : axes) {
    axis.start_speed = 0.0;
    axis.input_shaper = {{config::ShaperType::kTwoHumpEi, 30.0, 0.1}};
  }
  begin();
  std::vector<std::int64_t> counts;
  for (std::int64_t i = 1; i <= 58; ++i) counts.push_back(50 * i);
  const CoordinatedMove move = followPath(dashes(counts));
  for (const double factor : {0.3, 1.0, 0.1, 0.7}) {
    advance(0.07);
    machine().setSpeedOverride(factor);
    advance(0.013);
    machine().hold();
    advance(factor < 0.5 ? 0.01 : 2.0);  // before it rests, and at rest
    machine().resume();
  }
  machine().setSpeedOverride(1.0);
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 57U);
  counts.pop_back();
  expectWithSteps(counts);
}

// They leave the line, but not along it: one axis is as far behind the place as the other is
// beyond.
TEST_F(PathOutputs, WithDifferentShapersTheyComeWhenTheAxesAreAsFarAlongTheLine) {
  for (config::AxisConfig& axis : axes) axis.start_speed = 0.0;
  axes[0].input_shaper = {{config::ShaperType::kZv, 20.0, 0.0}};
  begin();
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0};
  const std::vector<std::int64_t> counts{200, 240, 280, 1360};
  bool on = false;
  for (const std::int64_t count : counts) {
    request.segments.push_back(lineTo({stepTo(count), stepTo(count)}));
    if (request.segments.size() > 1) request.segments.back().outputs = {{"pen", on = !on}};
  }
  request.segments.push_back(with(lineTo({0.02, 0.02}), {{"pen", !on}}));
  finish(request);
  const test::TracedAxes traced(*bench->trace, axes);
  const std::vector<std::int64_t> times = edges();
  ASSERT_EQ(times.size(), counts.size());
  for (std::size_t i = 0; i < times.size(); ++i) {
    const test::KnownPlace x = traced.at(0, static_cast<double>(times[i]));
    const test::KnownPlace y = traced.at(1, static_cast<double>(times[i]));
    const double middle = (x.place + y.place) / 2.0;
    EXPECT_LT(x.error + y.error, 0.2) << i;
    EXPECT_NEAR(middle, static_cast<double>(counts[i]) - 0.5, (x.error + y.error) / 2.0 + 1e-3);
    EXPECT_GT(y.place, x.place + 10.0) << i;
  }
}

TEST_F(PathOutputs, WithAJerkLimitTheyComeWithTheAxis) {
  for (config::AxisConfig& axis : axes) {
    axis.start_speed = 0.0;
    axis.jerk = 20.0;
  }
  begin();
  finish(dashes({400, 1000, 2500, 4000, 4400}));
  const std::vector<std::int64_t> times = edges();
  const std::vector<std::int64_t> counts{400, 1000, 2500, 4000};
  ASSERT_EQ(times.size(), counts.size());
  // Its quintics are within a hundredth of a microstep of the path.
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const std::int64_t step = timeOfStep(counts[i] + 1) - timeOfStep(counts[i]);
    EXPECT_LE(std::abs(times[i] - timeOfStep(counts[i])), step / 50 + 1) << i;
  }
}

TEST_F(PathOutputs, WithABacklashTheyComeWithTheJoint) {
  axes[0].backlash = 20 * kMicrostep;
  begin();
  // Towards max and back: on the way back, the motor is 20 microsteps ahead of the joint.
  PathRequest request{{"x"}, {}, false, 0.05, 0.0};
  request.segments = {lineTo({0.02}), lineTo({stepTo(801)}),
                      with(lineTo({stepTo(401)}), {{"pen", true}}),
                      with(lineTo({stepTo(201)}), {{"pen", false}})};
  finish(request);
  const std::vector<std::int64_t> times = edges();
  ASSERT_EQ(times.size(), 2U);
  std::vector<std::int64_t> back;
  std::int64_t before = 0;
  for (const Step& step : steps("x")) {
    const bool returns = step.count < std::exchange(before, step.count);
    if (returns && (step.count == 800 || step.count == 400)) back.push_back(step.time_ns);
  }
  ASSERT_EQ(back.size(), 2U);
  EXPECT_LE(std::abs(times[0] - back[0]), 1);
  EXPECT_LE(std::abs(times[1] - back[1]), 1);
}

TEST_F(PathOutputs, AreInTheFlightRecorder) {
  machine().setOutput("pen", true);
  advance(0.5);
  machine().setOutput("pen", false);
  finish(dashes({200, 500, 1000}));
  machine().setOutput("pen", true);
  const machine::Recording recording = machine().recording();
  std::vector<std::int64_t> recorded;
  for (const machine::Recording::Pin& pin : recording.pins) {
    if (pin.name != "pen") continue;
    bool level = recording.levels[static_cast<std::size_t>(pin.output)];
    for (const machine::Recording::Edge& edge : recording.edges) {
      if (edge.output != pin.output) continue;
      EXPECT_NE(edge.level, level) << "at " << edge.time;
      level = edge.level;
      recorded.push_back(edge.time);
    }
  }
  EXPECT_EQ(recorded, edges());
}

TEST_F(PathOutputs, ManyMarksCostNoTimeOfThePath) {
  std::vector<std::int64_t> counts;
  for (std::int64_t i = 1; i <= 4000; ++i) counts.push_back(2 * i);
  const CoordinatedResult result = finish(dashes(counts));
  EXPECT_EQ(result.marks_made, 3999U);
  EXPECT_EQ(edges().size(), 3999U);
  counts.pop_back();
  expectWithSteps(counts);
}

TEST_F(PathOutputs, AHundredThousandMarksOfAPathInParts) {
  constexpr std::int64_t kMarks = 100'000;
  constexpr std::int64_t kPart = 10'000;
  std::vector<std::int64_t> counts;
  for (std::int64_t i = 1; i <= kMarks + 1; ++i) counts.push_back(2 * i);
  PathRequest all = dashes(counts);
  PathRequest first = all;
  first.segments.resize(kPart);
  first.more_follows = true;
  const CoordinatedMove move = followPath(first);
  for (std::int64_t from = kPart; from <= kMarks; from += kPart) {
    const auto begin = all.segments.begin() + from;
    const auto end = all.segments.begin() + std::min(from + kPart, kMarks + 1);
    while (steps("x").empty() || bench->pulses("x") < 2 * from - kPart) advance(0.01);
    machine().appendPath({move.id(), {begin, end}, end != all.segments.end()});
  }
  const CoordinatedResult result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, 100'000U);
  EXPECT_EQ(result.marks_not_made, 0U);
  counts.pop_back();
  const std::vector<Step> made = steps("x");
  const std::vector<std::int64_t> times = edges();
  ASSERT_EQ(times.size(), counts.size());
  for (std::size_t i = 0; i < counts.size(); ++i) {
    const Step& step = made.at(static_cast<std::size_t>(counts[i]) - 1);
    ASSERT_EQ(step.count, counts[i]);
    ASSERT_LE(std::abs(times[i] - step.time_ns), 1) << i;
  }
}

}  // namespace
}  // namespace stepdriver
