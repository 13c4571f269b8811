#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"
#include "support/corexy_bench.h"
#include "support/random_motion.h"

// No two pulses of a motor are closer than its top speed allows, by the edges on the rig's lines,
// while moves take over from each other at random moments.

namespace stepdriver {
namespace {

using motion::Random;
using test::Bench;

/// 40 steps/mm, 100 mm/s, 1000 mm/s^2, 30,000 mm/s^3.
config::AxisConfig slowMicrosteps(const std::string& name) {
  config::AxisConfig config = test::linearAxis(name, 40'000.0, 0.1, 1.0);
  config.jerk = 30.0;
  return config;
}

void shape(config::AxisConfig& axis) {
  axis.input_shaper = {{config::ShaperType::kZv, 7.0, 0.0}, {config::ShaperType::kZv, 14.0, 0.0}};
}

// Edges lie on whole nanoseconds: an interval may be one shorter.
constexpr std::int64_t kRounding = 1;

/// Intervals between two steps in the same direction.
struct Intervals {
  std::int64_t count = 0;
  std::int64_t too_short = 0;
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();  // ns
};

/// @param rate [steps/s] of the motor at its top speed
Intervals intervalsOf(const Bench& bench, const std::string& pins, double rate) {
  const std::int64_t allowed = static_cast<std::int64_t>(1e9 / rate) - kRounding;
  const sim::MemoryTrace& trace = *bench.trace;
  const int step = trace.pin(pins, "step");
  const int dir = trace.pin(pins, "dir");
  Intervals intervals;
  std::int64_t last = -1;
  for (const sim::MemoryTrace::Edge& edge : trace.edges()) {
    if (edge.pin == dir) last = -1;
    if (edge.pin != step || !edge.level) continue;
    if (last >= 0) {
      ++intervals.count;
      if (edge.time_ns - last < allowed) ++intervals.too_short;
      intervals.shortest = std::min(intervals.shortest, edge.time_ns - last);
    }
    last = edge.time_ns;
  }
  return intervals;
}

/// Moves all axes to random targets, mostly before the moves before have ended, and then to 0.
void wander(Bench& bench, int moves) {
  Random random(3);
  const auto& axes = bench.machine->axes();
  for (int i = 0; i < moves; ++i) {
    const auto& axis = axes[static_cast<std::size_t>(i) % axes.size()];
    axis->moveTo(random.within(-0.09, 0.09));
    bench.machine->advance(random.chance(0.5) ? random.within(0.0, 0.3) : random.within(0.3, 1.5));
  }
  std::vector<axis::Move> last;
  for (const auto& axis : axes) last.push_back(axis->moveTo(0.0));
  for (std::size_t i = 0; i < axes.size(); ++i) {
    EXPECT_EQ(axes[i]->wait(last[i]).end, axis::MoveEnd::kReached);
  }
}

TEST(StepIntervals, OfAnAxisWithTwoZvShapersKeepItsTopSpeed) {
  config::AxisConfig config = slowMicrosteps("x");
  shape(config);
  Bench bench({config});
  wander(bench, 80);
  const Intervals seen = intervalsOf(bench, "x", 4000.0);
  EXPECT_GT(seen.count, 50'000);
  EXPECT_EQ(seen.too_short, 0) << "of " << seen.count << ", shortest " << seen.shortest << " ns";
  EXPECT_EQ(bench.pulses(), 0);
}

void expectMotorsKeepTheirTopSpeed(std::vector<config::AxisConfig> axes,
                                   const config::Matrix& matrix) {
  test::share(axes, matrix);
  Bench bench(axes);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  wander(bench, 80);
  for (std::size_t i = 0; i < axes.size(); ++i) {
    double rate = 0.0;  // while all axes move at their top speeds
    for (std::size_t k = 0; k < axes.size(); ++k) {
      rate += std::abs(matrix[i][k]) * axes[k].max_speed * axes[k].steps_per_unit;
    }
    const std::string& motor = axes[i].name;
    const Intervals seen = intervalsOf(bench, motor, rate);
    EXPECT_GT(seen.count, 25'000) << motor;
    EXPECT_EQ(seen.too_short, 0) << motor << ", of " << seen.count << ", shortest " << seen.shortest
                                 << " ns";
    EXPECT_EQ(bench.pulses(motor), 0) << motor;
  }
}

const config::Matrix kCoreXy{{1.0, 1.0}, {1.0, -1.0}};

TEST(StepIntervals, OfACoreXyKeepItsTopSpeeds) {
  expectMotorsKeepTheirTopSpeed({slowMicrosteps("x"), slowMicrosteps("y")}, kCoreXy);
}

TEST(StepIntervals, OfACoreXyWithShapersKeepItsTopSpeeds) {
  std::vector<config::AxisConfig> axes{slowMicrosteps("x"), slowMicrosteps("y")};
  for (config::AxisConfig& axis : axes) shape(axis);
  expectMotorsKeepTheirTopSpeed(axes, kCoreXy);
}

// While x speeds up and y slows down, the first motor's acceleration is only the rounding of 0.7
// and 0.3.
TEST(StepIntervals, OfMotorsWhoseAxesCancelEachOtherOutKeepTheirTopSpeeds) {
  std::vector<config::AxisConfig> axes{slowMicrosteps("x"), slowMicrosteps("y")};
  axes[0].jerk = axes[1].jerk = 0.0;
  axes[0].acceleration = axes[0].deceleration = 0.3;
  axes[1].acceleration = axes[1].deceleration = 0.7;
  expectMotorsKeepTheirTopSpeed(axes, {{0.7, 0.3}, {0.3, -0.7}});
}

}  // namespace
}  // namespace stepdriver
