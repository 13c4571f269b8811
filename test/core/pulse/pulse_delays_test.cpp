#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <ostream>
#include <utility>
#include <vector>

#include "profile/composition.h"
#include "profile/step_finder.h"
#include "support/constants.h"
#include "support/pulse_engine_bench.h"
#include "timeline/follower.h"

namespace stepdriver::pulse {
namespace {

using test::kMillisecond;

constexpr Nanoseconds kMaxLateness = 5 * kMillisecond;
// The ratios of a line's axes to its path, and so their speeds.
constexpr double kScales[] = {1.0, -0.61, 0.083};
constexpr std::size_t kAxes = 3;

struct Delay {
  const char* name;
  Nanoseconds length;
  double speed;  ///< [microsteps/s] along the path
  bool faults;
};

void PrintTo(const Delay& delay, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << delay.name;
}

/// A line of three axes, in which the pulse thread is delayed once.
class DelayedLine : public PulseEngineTest {
 protected:
  static constexpr double kRestartSpeed = 400.0;  // [microsteps/s]

  void startLine(double speed, std::size_t axes = kAxes) {
    std::vector<ChannelConfig> configs;
    for (std::size_t i = 0; i < axes; ++i) configs.push_back(config(static_cast<int>(i)));
    make(configs, kMaxLateness);
    const auto way = static_cast<std::int64_t>(speed);
    const motion::Profile path =
        motion::planFromRest(kMillisecond, 0, way, {0.0, speed, 4.0 * speed, 4.0 * speed});
    for (std::size_t i = 0; i < axes; ++i) {
      profiles.push_back(std::make_unique<motion::Profile>(motion::scaled(path, 0.0, kScales[i])));
      follows.push_back({static_cast<int>(i), ++serial, profiles.back().get(), 0,
                         std::llround(1e9 / kRestartSpeed), 7});
    }
    postFollows(axes);
  }

  std::vector<motion::Step> planOf(std::size_t axis) const {
    std::vector<motion::Step> steps;
    motion::StepFinder finder(*profiles[axis], 0);
    for (motion::Step step; finder.next(step);) steps.push_back(step);
    return steps;
  }

  std::vector<Nanoseconds> risesOf(std::size_t axis) const {
    return lines.rises(static_cast<int>(axis) * kLinesPerChannel);
  }

  // No interval is below three quarters of its plan, and none is shorter because of the delay.
  void expectNothingBunched(std::size_t axis) const {
    const auto plan = planOf(axis);
    const auto rises = risesOf(axis);
    ASSERT_LE(rises.size(), plan.size());
    for (std::size_t k = 1; k < rises.size(); ++k) {
      const auto planned = static_cast<double>(plan[k].time_ns - plan[k - 1].time_ns);
      ASSERT_GE(static_cast<double>(rises[k] - rises[k - 1]), Follower::kClosest * planned - 1.0)
          << "axis " << axis << ", step " << k;
    }
  }
};

class PulseDelays : public DelayedLine, public testing::WithParamInterface<Delay> {};

TEST_P(PulseDelays, BunchNothingKeepTheAxesOnTheirLineAndFaultWhereTheyMust) {
  startLine(GetParam().speed);
  constexpr Nanoseconds kDelayedAt = 500 * kMillisecond;  // in the middle of the cruise
  runUntil(kDelayedAt);
  clock.waitUntil(clock.now() + GetParam().length);
  runOut();
  for (std::size_t i = 0; i < kAxes; ++i) expectNothingBunched(i);
  if (GetParam().faults) {
    // The fastest axis can't continue. All axes end at the same instant, and no pulse follows.
    EXPECT_EQ(engine->channel(0).end, EndReason::kTooLate);
    EXPECT_GT(engine->channel(0).end_lateness, kMaxLateness);
    EXPECT_EQ(engine->channel(0).end_abrupt, true);
    for (std::size_t i = 0; i < kAxes; ++i) {
      const ChannelState state = engine->channel(static_cast<int>(i));
      EXPECT_TRUE(state.end == EndReason::kTooLate || state.end == EndReason::kCompanion) << i;
      EXPECT_LE(risesOf(i).back(), kDelayedAt) << i;
      EXPECT_EQ(std::abs(state.count), static_cast<std::int64_t>(risesOf(i).size())) << i;
      EXPECT_FALSE(lines.levels[static_cast<int>(i) * kLinesPerChannel]) << "axis " << i;
    }
    return;
  }
  const Nanoseconds slipped = engine->state().slipped;
  EXPECT_LE(slipped, GetParam().length);
  for (std::size_t i = 0; i < kAxes; ++i) {
    EXPECT_EQ(engine->channel(static_cast<int>(i)).end, EndReason::kDone) << i;
    const auto plan = planOf(i);
    const auto rises = risesOf(i);
    ASSERT_EQ(rises.size(), plan.size()) << i;
    // After the delay, all are late by as much as the timeline slid. Before it, none is late.
    EXPECT_EQ(rises.front(), plan.front().time_ns) << i;
    EXPECT_EQ(rises.back(), plan.back().time_ns + slipped) << i;
    for (std::size_t k = 0; k < plan.size(); ++k) {
      if (rises[k] < kDelayedAt) continue;
      if (rises[k] > kDelayedAt + GetParam().length) break;
      const Nanoseconds interval = k == 0 ? 0 : plan[k].time_ns - plan[k - 1].time_ns;
      EXPECT_LE(rises[k] - plan[k].time_ns - slipped, interval / 4 + 1)
          << "off the line by more: step " << k;
    }
  }
}

// 20,000 microsteps/s and 300: the motor can start at up to 400.
INSTANTIATE_TEST_SUITE_P(
    , PulseDelays,
    testing::Values(Delay{"HalfAMillisecondFast", kMillisecond / 2, 20'000.0, false},
                    Delay{"FiveMillisecondsFast", 5 * kMillisecond, 20'000.0, false},
                    Delay{"FiftyMillisecondsFast", 50 * kMillisecond, 20'000.0, true},
                    Delay{"HalfASecondFast", 500 * kMillisecond, 20'000.0, true},
                    Delay{"HalfAMillisecondSlow", kMillisecond / 2, 300.0, false},
                    Delay{"FiveMillisecondsSlow", 5 * kMillisecond, 300.0, false},
                    Delay{"FiftyMillisecondsSlow", 50 * kMillisecond, 300.0, false},
                    Delay{"HalfASecondSlow", 500 * kMillisecond, 300.0, false}),
    [](const auto& delay) { return delay.param.name; });

struct DelayInPulse {
  const char* name;
  bool in_write;  ///< in that of the first edge of a pulse, otherwise between the two edges
  Nanoseconds length;
  double speed;  ///< [microsteps/s] along the path
  bool faults;
};

void PrintTo(const DelayInPulse& delay, std::ostream* out) {  // NOLINT: GoogleTest's name
  *out << delay.name;
}

class DelaysInPulses : public DelayedLine, public testing::WithParamInterface<DelayInPulse> {};

// Afterwards no step is late: the next one is put off by the end of the pulse.
TEST_P(DelaysInPulses, BunchNothingAndFaultWhereTheyMust) {
  startLine(GetParam().speed, 1);
  runUntil(500 * kMillisecond);
  Nanoseconds due = engine->serve();
  while (lines.levels[0]) {
    clock.waitUntil(due);
    due = engine->serve();
  }
  clock.waitUntil(due);
  if (GetParam().in_write) lines.write_cost = GetParam().length;
  engine->serve();
  lines.write_cost = 0;
  ASSERT_TRUE(lines.levels[0]);
  const std::size_t made = risesOf(0).size();
  if (!GetParam().in_write) clock.waitUntil(clock.now() + GetParam().length);
  runOut();
  expectNothingBunched(0);
  const ChannelState state = engine->channel(0);
  EXPECT_EQ(state.count, static_cast<std::int64_t>(risesOf(0).size()));
  EXPECT_FALSE(lines.levels[0]);
  if (!GetParam().faults) {
    EXPECT_EQ(state.end, EndReason::kDone);
    EXPECT_EQ(risesOf(0).size(), planOf(0).size());
    return;
  }
  EXPECT_EQ(state.end, EndReason::kTooLate);
  EXPECT_GT(state.end_lateness, kMaxLateness);
  EXPECT_TRUE(state.end_abrupt);
  EXPECT_EQ(risesOf(0).size(), made);
}

INSTANTIATE_TEST_SUITE_P(
    , DelaysInPulses,
    testing::Values(
        DelayInPulse{"FourMillisecondsFast", false, 4 * kMillisecond, 20'000.0, false},
        DelayInPulse{"FiftyMillisecondsFast", false, 50 * kMillisecond, 20'000.0, true},
        DelayInPulse{"FiftyMillisecondsSlow", false, 50 * kMillisecond, 300.0, false},
        DelayInPulse{"WriteOfFourMillisecondsFast", true, 4 * kMillisecond, 20'000.0, false},
        DelayInPulse{"WriteOfFiftyMillisecondsFast", true, 50 * kMillisecond, 20'000.0, true},
        DelayInPulse{"WriteOfFiftyMillisecondsSlow", true, 50 * kMillisecond, 300.0, false}),
    [](const auto& delay) { return delay.param.name; });

TEST_F(DelayedLine, CountsOnceWhereTheWriteIsSlowToo) {
  make({config(0)}, 1'000 * kMillisecond);
  follow(cruise(kMillisecond, 0, 100, 1000.0));
  runUntil(50 * kMillisecond);
  ASSERT_EQ(engine->state().slips, 0U);
  lines.write_cost = 600'000;  // more than a half of the interval of 1 ms
  clock.waitUntil(clock.now() + 3 * kMillisecond);
  const Nanoseconds due = engine->serve();  // one pulse, late, and slow
  lines.write_cost = 0;
  while (clock.now() < due) clock.waitUntil(due);
  runOut();
  EXPECT_EQ(engine->state().slips, 1U);
  EXPECT_EQ(risesOf(0).size(), 100U);
  EXPECT_EQ(engine->lateness().max, engine->state().worst_lateness);
}

// The slow write leaves each axis less time than the one before, so the timeline slides for each.
TEST_F(DelayedLine, CountsOnceForAllAxesOfAnInstant) {
  make({config(0), config(1), config(2)}, 1'000 * kMillisecond);
  for (const int axis : {0, 1, 2}) {
    const Nanoseconds interval = kMillisecond >> axis;
    const double speed = 1e9 / static_cast<double>(interval);
    // Their first steps come half an interval after their starts, at the same instant.
    follow(cruise(2 * kMillisecond - interval / 2, 0, 100, speed), axis);
  }
  runUntil(9 * kMillisecond + 900'000);
  ASSERT_EQ(engine->state().slips, 0U);
  const std::uint64_t before = engine->state().pulses;
  clock.waitUntil(10 * kMillisecond);
  lines.write_cost = 600'000;
  const Nanoseconds due = engine->serve();
  lines.write_cost = 0;
  ASSERT_EQ(engine->state().pulses, before + 3) << "not one instant";
  EXPECT_EQ(engine->state().slips, 1U);
  EXPECT_EQ(engine->state().slipped, 600'000 - kMillisecond / 4 / 4);
  while (clock.now() < due) clock.waitUntil(due);
  runOut();
  EXPECT_EQ(engine->state().slips, 1U);
}

}  // namespace
}  // namespace stepdriver::pulse
