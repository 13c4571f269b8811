#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <thread>
#include <vector>

#include "machine_waveform.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/pulse/clock.h"
#include "support/gpio_sim.h"

// Edges of switches that the kernel has lost, because more came than libgpiod 1 has room for.

namespace stepdriver::kernel {
namespace {

constexpr std::size_t kKept = 16;
constexpr int kTooMany = 21;
/// [microsteps] A quarter of a full step, and the one of that instant.
constexpr std::ptrdiff_t kMostLate = 5;

/// Lets the calling thread have the only processor of this kernel before all but its interrupts and
/// the pulse thread, so that nobody reads what lines report. Libgpiod 1 has a buffer of 16 edges,
/// of which the kernel keeps the first ones.
class BeforeAllReaders {
 public:
  BeforeAllReaders() {
    // For as long as it likes.
    test::writeText("/proc/sys/kernel/sched_rt_runtime_us", "-1");
    EXPECT_EQ(setScheduler(SCHED_FIFO, 30), 0);
  }
  ~BeforeAllReaders() { EXPECT_EQ(setScheduler(SCHED_OTHER, 0), 0); }
  BeforeAllReaders(const BeforeAllReaders&) = delete;
  BeforeAllReaders& operator=(const BeforeAllReaders&) = delete;

  /// Changes an input so often, so that it ends at the level `last`. gpio-sim reports an edge with
  /// the next tick.
  static void change(const test::GpioSimChip& chip, unsigned offset, int edges, bool last) {
    constexpr std::int64_t kTwoTicks = 20'000'000;
    pulse::SteadyClock clock;
    for (int left = edges - 1; left >= 0; --left) {
      chip.drive(offset, (left % 2 == 0) == last);
      const std::int64_t until = clock.now() + kTwoTicks;
      while (clock.now() < until) {
      }
    }
  }

 private:
  static int setScheduler(int policy, int priority) {
    sched_param parameters{};
    parameters.sched_priority = priority;
    return pthread_setschedparam(pthread_self(), policy, &parameters);
  }
};

class LostEdges : public MachineWaveform {
 protected:
  /// With the input probe, and the output camera.
  static machine::MachineOptions options() {
    machine::MachineOptions options;
    config::InputConfig probe;
    probe.name = "probe";
    probe.line = {"board-1:3", true, Bias::kAsIs};
    options.inputs.push_back(probe);
    options.outputs.resize(1);
    options.outputs[0].name = "camera";
    options.outputs[0].line = "board-0:5";
    return options;
  }
  static void burst(KernelBench& bench, unsigned offset, bool last) {
    const BeforeAllReaders before;
    BeforeAllReaders::change(bench.chip(1), offset, kTooMany, last);
  }
  /// Whether a condition comes within ten seconds.
  static bool comes(const std::function<bool()>& condition) {
    const auto end = std::chrono::steady_clock::now() + std::chrono::seconds(10);
    while (std::chrono::steady_clock::now() < end) {
      if (condition()) return true;
      std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }
    return condition();
  }

  config::AxisConfig x = axisAt("x", "a4988", placeAt("board-0", 0));
};

TEST_F(LostEdges, OfASwitchLetNoStepGoIntoItAndNeverBlockTheWay) {
  x.endstop_max = config::Endstop{{"board-1:4", true}};
  KernelBench bench({x});
  bench.axis("x").setPosition(0.0);
  burst(bench, 4, true);
  EXPECT_THROW(bench.start("x", 100), Refused);
  burst(bench, 4, false);
  const axis::MoveResult result = bench.axis("x").wait(bench.start("x", 100));
  EXPECT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_EQ(read(bench, {x}).at("x").pulses.size(), 100U);
}

TEST_F(LostEdges, OfASwitchAtTheEndOfAMoveStopItAtTheStepThatReadsIt) {
  x.endstop_max = config::Endstop{{"board-1:4", true}};
  KernelBench bench({x});
  const axis::Move move = bench.start("x", 4'000);
  bench.awaitCount("x", 200);
  burst(bench, 4, true);
  EXPECT_EQ(bench.axis("x").wait(move).end, axis::MoveEnd::kEndstopMax);
  EXPECT_LT(bench.count("x"), 4'000);
  EXPECT_EQ(bench.axis("x").endstops().max, true);
  read(bench, {x});
}

TEST_F(LostEdges, OfAnInputLeaveItsLevelKnown) {
  KernelBench bench({x}, options());
  for (const bool level : {true, false, true}) {
    burst(bench, 3, level);
    const auto shown = [&] { return bench.machine().ioStates().inputs.at(0).active == level; };
    EXPECT_TRUE(comes(shown)) << level;
  }
  read(bench, {x});
}

// A timeline that slides meanwhile shifts the positions, but not their order.
TEST_F(LostEdges, OfALatchAreFollowedByTheLevelThatIsReadLater) {
  KernelBench bench({x}, options());
  machine::LatchRequest request;
  request.input = "probe";
  request.edge = machine::LatchEdge::kEither;
  request.every = true;
  const machine::Latch latch = bench.machine().latch(request);
  const axis::Move move = bench.start("x", 1'200);
  burst(bench, 3, true);
  EXPECT_EQ(bench.axis("x").wait(move).end, axis::MoveEnd::kReached);
  std::vector<machine::LatchedEdge> edges;
  const auto take = [&] {
    for (const machine::LatchedEdge& edge : latch.record->take()) edges.push_back(edge);
    return edges.size() > kKept;
  };
  EXPECT_TRUE(comes(take));
  bench.machine().end(latch);
  take();
  ASSERT_EQ(edges.size(), kKept + 1) << "those that were kept, and the level";
  double last = 0.0;
  for (std::size_t i = 0; i < edges.size(); ++i) {
    EXPECT_EQ(edges[i].active, i % 2 == 0) << i;
    const double position = edges[i].axes.at(0).position * 80e3;
    EXPECT_GE(position, last) << i;
    last = position;
  }
  EXPECT_LE(last, 1'200.0);
  read(bench, {x});
}

// Positions switch outputs without an input.
TEST_F(LostEdges, OfAnInputCostNoPulseOfAnOutputAtItsPlaces) {
  KernelBench bench({x}, options());
  bench.axis("x").setPosition(0.0);
  config::PositionCompare compare;
  compare.axis = "x";
  compare.every = config::PositionCompare::Every{100 / 80e3, 200 / 80e3, 600 / 80e3};
  compare.pulse_ns = 1'000'000;
  bench.machine().setPositionCompare("camera", compare);
  const axis::Move move = bench.start("x", 1'200);
  burst(bench, 3, true);
  EXPECT_EQ(bench.axis("x").wait(move).end, axis::MoveEnd::kReached);
  const Waveform seen = read(bench, {x}).at("x");
  ASSERT_EQ(seen.pulses.size(), 1'200U);
  const std::vector<std::int64_t> shots = trace->times(trace->line("board-0:5"), true);
  ASSERT_EQ(shots.size(), 5U);
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const auto before =
        std::count_if(seen.pulses.begin(), seen.pulses.end(),
                      [&](const Pulse& pulse) { return pulse.time_ns <= shots[i]; });
    const auto count = static_cast<std::ptrdiff_t>(200 + 100 * i);
    EXPECT_LE(before, count);
    EXPECT_GE(before, count - kMostLate) << "steps may be late, and the plan is not";
  }
}

}  // namespace
}  // namespace stepdriver::kernel
