#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "machine_waveform.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/pulse/clock.h"

// Tests moves that end on their way: by a stop, at an endstop, by an emergency stop.

namespace stepdriver::kernel {
namespace {

using axis::MoveEnd;

class Ending : public MachineWaveform {};

constexpr std::int64_t kFar = 20'000;
constexpr std::int64_t kAbout = 800;

std::size_t pulsesBefore(const Waveform& seen, std::int64_t time_ns) {
  const auto& pulses = seen.pulses;
  return static_cast<std::size_t>(
      std::count_if(pulses.begin(), pulses.end(),
                    [time_ns](const Pulse& pulse) { return pulse.time_ns < time_ns; }));
}

TEST_F(Ending, ByAStopSlowsDownAsPlanned) {
  const std::vector<config::AxisConfig> axes = {axisAt("x", "a4988", placeAt("board-0", 0))};
  KernelBench bench(axes);
  const axis::Move move = bench.start("x", kFar);
  bench.awaitCount("x", kAbout);
  const std::int64_t stopped_ns = pulse::SteadyClock().now();
  bench.axis("x").stop();
  EXPECT_EQ(bench.axis("x").wait(move).end, MoveEnd::kStopped);
  const Waveform seen = read(bench, axes).at("x");

  const motion::MotionLimits limits = limitsOf(axes[0]);
  const std::size_t cruised = pulsesBefore(seen, stopped_ns);
  EXPECT_LT(seen.position(), kFar);
  EXPECT_EQ(seen.backward(), 0);
  expectAsPlanned(seen.pulses, 0, plannedSteps(0, kFar, limits), cruised);
  // The ramp has the configured deceleration or a lower one.
  const auto ramp =
      static_cast<std::size_t>(limits.max_speed * limits.max_speed / (2.0 * limits.deceleration));
  ASSERT_GE(seen.pulses.size(), cruised + ramp);
  const auto time_left = [&](double steps) {
    return static_cast<std::int64_t>(1e9 * std::sqrt(2.0 * steps / limits.deceleration));
  };
  const std::int64_t last = time_left(0.5);
  for (std::size_t left = 1; left < ramp; ++left) {
    const auto steps = static_cast<double>(left);
    const std::int64_t interval = time_left(steps + 0.5) - time_left(steps - 0.5);
    const std::size_t k = seen.pulses.size() - 1 - left;
    ASSERT_GE(seen.pulses.back().time_ns - seen.pulses[k].time_ns,
              time_left(steps + 0.5) - last - madeUp(interval))
        << left << " steps before the end";
  }
}

TEST_F(Ending, AtAnEndstopSendsNoStepAfterItReadsActive) {
  auto config = axisAt("x", "drv8825", placeAt("board-0", 0));
  config.endstop_max = config::Endstop{{"board-1:3", true}};
  const std::vector<config::AxisConfig> axes = {config};
  KernelBench bench(axes);
  const axis::Move move = bench.start("x", kFar);
  bench.awaitCount("x", kAbout);
  bench.chip(1).drive(3, true);
  const std::int64_t pressed_ns = pulse::SteadyClock().now();
  EXPECT_EQ(bench.axis("x").wait(move).end, MoveEnd::kEndstopMax);
  const std::int64_t there = bench.count("x");
  EXPECT_EQ(bench.axis("x").wait(bench.start("x", -1'000)).end, MoveEnd::kReached);
  const Waveform seen = read(bench, axes).at("x");

  EXPECT_EQ(seen.forward(), there);
  EXPECT_EQ(seen.backward(), 1'000);
  const auto last = static_cast<std::size_t>(there);
  expectAsPlanned(seen.pulses, 0, plannedSteps(0, kFar, limitsOf(config)), last);
  EXPECT_LE(last, pulsesBefore(seen, pressed_ns) + 1) << "one may have been on its way";

  // Before each step its switch was read, and wasn't active.
  const unsigned endstop = trace->line("board-1:3");
  std::size_t next = 0;
  bool free = false;
  for (const LineEvent& event : trace->events()) {
    if (event.line == endstop && event.read) free = !event.level;
    if (next == last || event.time_ns != seen.pulses[next].time_ns) continue;
    ASSERT_TRUE(free) << "step " << next;
    free = false;
    ++next;
  }
  EXPECT_EQ(next, last);
}

TEST_F(Ending, ByAnEmergencyStopFinishesThePulse) {
  auto config_x = axisAt("x", "tb6600", placeAt("board-0", 0, true));
  config_x.driver.timing.step_high_ns = 300'000;  // so long that most stops come during a pulse
  const std::vector<config::AxisConfig> axes = {config_x,
                                                axisAt("y", "a4988", placeAt("board-1", 0))};
  KernelBench bench(axes);
  std::vector<std::int64_t> ends_x = {0};
  std::vector<std::int64_t> ends_y = {0};
  for (int i = 0; i < 6; ++i) {
    const axis::Move x = bench.start("x", kFar);
    const axis::Move y = bench.start("y", -kFar);
    bench.awaitCount("x", ends_x.back() + 150);
    bench.emergencyStop();
    EXPECT_EQ(bench.axis("x").wait(x).end, MoveEnd::kEmergencyStop);
    EXPECT_EQ(bench.axis("y").wait(y).end, MoveEnd::kEmergencyStop);
    EXPECT_TRUE(bench.awaitLevel(0, 0, true)) << "the pulse of x doesn't end";
    EXPECT_TRUE(bench.awaitLevel(1, 0, false)) << "the pulse of y doesn't end";
    ends_x.push_back(bench.count("x"));
    ends_y.push_back(bench.count("y"));
    bench.recover();
  }
  const auto seen = read(bench, axes);
  for (std::size_t i = 1; i < ends_x.size(); ++i) {
    SCOPED_TRACE("stop " + std::to_string(i));
    const auto hold = [&](const config::AxisConfig& config, std::int64_t from, std::int64_t to,
                          std::int64_t far) {
      expectAsPlanned(seen.at(config.name).pulses, static_cast<std::size_t>(std::abs(from)),
                      plannedSteps(from, from + far, limitsOf(config)),
                      static_cast<std::size_t>(std::abs(to - from)));
    };
    hold(axes[0], ends_x[i - 1], ends_x[i], kFar);
    hold(axes[1], ends_y[i - 1], ends_y[i], -kFar);
  }
}

}  // namespace
}  // namespace stepdriver::kernel
