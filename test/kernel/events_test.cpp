#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "kernel_bench.h"
#include "stepdriver_core/axis/axis.h"
#include "waveform.h"

// Tests outputs that a motion switches, and positions that are latched at edges, by what a real
// kernel says of its lines, in its virtual time (`run.sh --time-travel`): the outputs change with
// the steps of their places, and a latched position is the number of steps before the edge.

namespace stepdriver::kernel {
namespace {

constexpr std::int64_t kMillisecond = 1'000'000;
/// [ns] All lines of one instant are written one after the other: STEP and two outputs.
constexpr std::int64_t kOneInstant = 1'000 + 12 * kClockRead;
/// [ns] gpio-sim reports an edge with the next tick of that kernel.
constexpr std::int64_t kLongestTick = 25 * kMillisecond;

class EventsOnKernel : public testing::Test {
 protected:
  void SetUp() override {
    const std::string missing = missingVirtualTime();
    if (!missing.empty()) GTEST_SKIP() << missing;
  }

  static machine::MachineOptions options() {
    machine::MachineOptions options;
    options.outputs.resize(2);
    options.outputs[0].name = "pen";
    options.outputs[0].line = "board-1:0";
    options.outputs[1].name = "camera";
    options.outputs[1].line = "board-0:5";
    options.outputs[1].active_level = false;
    config::InputConfig probe;
    probe.name = "probe";
    probe.line = {"board-1:3", true, Bias::kAsIs};
    options.inputs.push_back(probe);
    return options;
  }

  /// [m] Where the axis makes its step to a count.
  static double stepTo(std::int64_t count) { return (static_cast<double>(count) - 0.5) / 80e3; }

  static config::PositionCompare every100Steps(double pulse) {
    config::PositionCompare compare;
    compare.axis = "x";
    compare.every = config::PositionCompare::Every{100 / 80e3, 200 / 80e3, 600 / 80e3};
    compare.pulse_ns = std::llround(pulse * 1e9);
    return compare;
  }

  /// Each change of a line comes with the pulse of its count, from 1 on.
  static std::int64_t worstOf(const std::vector<std::int64_t>& changes,
                              const std::vector<std::int64_t>& counts, const Waveform& seen) {
    EXPECT_EQ(changes.size(), counts.size());
    std::int64_t worst = 0;
    for (std::size_t i = 0; i < std::min(changes.size(), counts.size()); ++i) {
      const Pulse& pulse = seen.pulses.at(static_cast<std::size_t>(counts[i]) - 1);
      worst = std::max(worst, std::abs(changes[i] - pulse.time_ns));
    }
    return worst;
  }

  config::AxisConfig x = axisAt("x", "a4988", {{"board-0:0"}, {"board-0:1"}, {"board-0:2"}});
};

TEST_F(EventsOnKernel, OutputsChangeWithTheStepsOfTheirPlaces) {
  KernelBench bench({x}, options(), kExactGuard);
  bench.axis("x").setPosition(0.0);
  bench.machine().setPositionCompare("camera", every100Steps(1e-3));
  // The pen and the camera have one place in common, 500; two marks of the pen are a step apart.
  const std::vector<std::int64_t> pens{100, 101, 350, 500, 650};
  motion::PathRequest path{{"x"}, {}, false, 0.0, 0.0005};
  bool on = false;
  for (const std::int64_t count : pens) {
    motion::PathSegment segment;
    segment.end = {stepTo(count)};
    if (!path.segments.empty()) segment.outputs = {{"pen", on = !on}};
    path.segments.push_back(segment);
  }
  motion::PathSegment last;
  last.end = {800 / 80e3};
  last.outputs = {{"pen", !on}};
  path.segments.push_back(last);
  const auto result = bench.machine().wait(bench.machine().followPath(path));
  EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_EQ(result.marks_made, pens.size());
  EXPECT_EQ(bench.figures().slips, 0U);
  const KernelTrace trace = bench.finish("outputs");

  const Waveform seen = waveformOf(trace, wiredAxis(x, trace));
  EXPECT_TRUE(seen.violations.empty()) << reportOf(seen);
  ASSERT_EQ(seen.pulses.size(), 800U);
  std::vector<std::int64_t> of_pen;
  const std::vector<LineEdge> edges = trace.edges(trace.line("board-1:0"));
  ASSERT_EQ(edges.size(), pens.size() + 1) << "the end of the program leaves it off";
  for (std::size_t i = 0; i < edges.size(); ++i) EXPECT_EQ(edges[i].level, i % 2 == 0) << i;
  for (std::size_t i = 0; i < pens.size(); ++i) of_pen.push_back(edges[i].time_ns);
  EXPECT_GT(edges.back().time_ns, seen.pulses.back().time_ns);
  std::vector<std::int64_t> shots;
  for (std::int64_t count = 200; count <= 600; count += 100) shots.push_back(count);
  const unsigned camera = trace.line("board-0:5");
  const std::vector<std::int64_t> begins = trace.times(camera, false);
  const std::vector<std::int64_t> ends = trace.times(camera, true);
  const std::int64_t worst = std::max(worstOf(of_pen, pens, seen), worstOf(begins, shots, seen));
  EXPECT_LE(worst, kOneInstant);
  ASSERT_EQ(ends.size(), begins.size());
  for (std::size_t i = 0; i < begins.size(); ++i) {
    EXPECT_LE(std::abs(ends[i] - begins[i] - kMillisecond), kOneInstant) << i;
  }
  std::printf("[ KERNEL   ] %zu changes of outputs within %lld ns of their steps\n",
              of_pen.size() + begins.size(), static_cast<long long>(worst));
}

TEST_F(EventsOnKernel, AnEmergencyStopSwitchesAnOutputOffWithinAMillisecond) {
  KernelBench bench({x}, options(), kExactGuard);
  bench.axis("x").setPosition(0.0);
  bench.machine().setPositionCompare("camera", every100Steps(0.04));
  bench.start("x", 700);
  ASSERT_TRUE(bench.awaitLevel(0, 5, false)) << "it is never on";
  const std::int64_t asked = pulse::SteadyClock().now();
  bench.emergencyStop();
  const KernelTrace trace = bench.finish("emergency_stop");
  const std::vector<std::int64_t> offs = trace.times(trace.line("board-0:5"), true);
  ASSERT_EQ(offs.size(), 1U);
  EXPECT_GT(offs[0], asked) << "its pulse was over";
  EXPECT_LE(offs[0] - asked, kMillisecond);
}

TEST_F(EventsOnKernel, ALatchedPositionIsTheCountOfThePulsesAtTheKernelsTimeStamp) {
  KernelBench bench({x}, options(), kExactGuard);
  machine::LatchRequest request;
  request.input = "probe";
  request.edge = machine::LatchEdge::kEither;
  request.every = true;
  const machine::Latch latch = bench.machine().latch(request);
  const axis::Move move = bench.start("x", 800);
  std::vector<std::int64_t> driven;
  for (int i = 0; i < 8; ++i) {
    std::this_thread::sleep_for(std::chrono::microseconds(50'000 + 3'333 * i));
    driven.push_back(pulse::SteadyClock().now());
    bench.chip(1).drive(3, i % 2 == 0);
  }
  EXPECT_EQ(bench.axis("x").wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench.figures().slips, 0U);
  bench.machine().end(latch);
  const std::vector<machine::LatchedEdge> edges = latch.record->take();
  const KernelTrace trace = bench.finish("latch");

  const Waveform seen = waveformOf(trace, wiredAxis(x, trace));
  ASSERT_EQ(edges.size(), driven.size());
  std::int64_t longest = 0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    EXPECT_EQ(edges[i].active, i % 2 == 0);
    EXPECT_GE(edges[i].time, driven[i]);
    EXPECT_LE(edges[i].time, driven[i] + kLongestTick);
    longest = std::max(longest, edges[i].time - driven[i]);
    const auto before = std::count_if(
        seen.pulses.begin(), seen.pulses.end(),
        [&](const Pulse& pulse) { return pulse.time_ns <= edges[i].time + kOneInstant; });
    // A step is made where the motion crosses its half.
    EXPECT_NEAR(edges[i].axes.at(0).position * 80e3, static_cast<double>(before), 0.52) << i;
  }
  std::printf("[ KERNEL   ] %zu latched edges, stamped up to %.1f ms after the line was driven\n",
              edges.size(), static_cast<double>(longest) / 1e6);
}

}  // namespace
}  // namespace stepdriver::kernel
