#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "profile/step_finder.h"
#include "support/constants.h"
#include "support/pulse_engine_bench.h"
#include "timeline/follower.h"

// Late steps of a motor at 1/16: a quarter of a full step is four microsteps.

namespace stepdriver::pulse {
namespace {

using test::kMillisecond;

constexpr Nanoseconds kStepInterval = 100'000;
constexpr double kStepSpeed = 1e9 / kStepInterval;
constexpr Nanoseconds kMotionStart = kMillisecond;

class LateSteps : public PulseEngineTest {
 protected:
  LateSteps() { full_step = 16; }

  void waitUntil(Nanoseconds time) {
    while (clock.now() < time) clock.waitUntil(time);
  }
  // Serves late from this time until that one.
  void stall(Nanoseconds from, Nanoseconds until) {
    runUntil(from);
    waitUntil(until);
  }
  // When the k-th step of a cruise is planned.
  static Nanoseconds planned(std::size_t k) {
    return kMotionStart + kStepInterval / 2 + static_cast<Nanoseconds>(k) * kStepInterval;
  }
  std::vector<motion::Step> planOf(std::size_t order) const {
    std::vector<motion::Step> steps;
    motion::StepFinder finder(*profiles[order], 0);
    for (motion::Step step; finder.next(step);) steps.push_back(step);
    return steps;
  }
};

TEST_F(LateSteps, FollowAsCloselyAsTheChipAllowsUntilThePlanIsReached) {
  make({config(0)});
  follow(cruise(kMotionStart, 0, 100, kStepSpeed));
  stall(planned(49) + 10'000, planned(50) + 4 * kStepInterval);
  runOut();
  const auto rises = lines.rises(0);
  ASSERT_EQ(rises.size(), 100U);
  EXPECT_EQ(engine->state().slips, 0U);
  for (std::size_t k = 0; k < rises.size(); ++k) {
    const Nanoseconds overdue = planned(50) + 4 * kStepInterval + 4'000 * static_cast<int>(k - 50);
    EXPECT_EQ(rises[k], k < 50 ? planned(k) : std::max(planned(k), overdue)) << k;
  }
  EXPECT_EQ(engine->state().worst_lateness, 4 * kStepInterval);
  expectTimes(config(0));
}

TEST_F(LateSteps, SlideTheTimelineOnlyByWhatIsBeyond) {
  make({config(0), config(1)});
  follow(cruise(kMotionStart, 0, 100, kStepSpeed));
  follow(cruise(kMotionStart, 0, 10, kStepSpeed / 10.0), 1);
  stall(planned(49) + 10'000, planned(50) + 4 * kStepInterval + 30'000);
  runOut();
  EXPECT_EQ(engine->state().slips, 1U);
  EXPECT_EQ(engine->state().slipped, 30'000);
  EXPECT_EQ(lines.rises(0).back(), planned(99) + 30'000);
  EXPECT_EQ(lines.rises(2).back(), kMotionStart + 95 * kStepInterval + 30'000)
      << "the same for all axes";
}

TEST_F(LateSteps, AreAllowedNoMoreThanAreConfigured) {
  for (const double late_steps : {0.0, 0.1, 0.25, 0.5}) {
    SCOPED_TRACE(late_steps);
    ChannelConfig channel = config(0);
    channel.late_steps = late_steps;
    make({channel});
    const Nanoseconds start = clock.now() + kMillisecond;
    follow(cruise(start, 0, 100, kStepSpeed));
    stall(start + 50 * kStepInterval,
          start + 50 * kStepInterval + kStepInterval / 2 + 10 * kStepInterval);
    runOut();
    const double allowed = std::max(0.25, 16.0 * late_steps);
    EXPECT_EQ(engine->state().slipped, 10 * kStepInterval - std::llround(allowed * kStepInterval));
  }
}

// A rotor that stands, or turns back, doesn't expect the field ahead of it.
TEST_F(LateSteps, OfAFirstStepOrATurnAreNotCaughtUp) {
  make({config(0)});
  follow(cruise(kMotionStart, 0, 100, kStepSpeed));
  stall(kMotionStart, kMotionStart + kStepInterval / 2 + 300'000);
  runOut();
  EXPECT_EQ(engine->state().slipped, 300'000 - kStepInterval / 8) << "its interval is half of one";

  make({config(0)});
  const Nanoseconds start = clock.now() + kMillisecond;
  motion::Profile turn(start,
                       {{motion::DoubleDouble(0.01), motion::DoubleDouble(0.0), kStepSpeed},
                        {motion::DoubleDouble(0.01), motion::DoubleDouble(100.0), -kStepSpeed}});
  follow(std::move(turn));
  stall(start + 10 * kMillisecond, start + 10 * kMillisecond + 350'000);
  runOut();
  EXPECT_EQ(engine->channel(0).count, 0);
  // The step back was to be an interval after the last one forward.
  EXPECT_EQ(engine->state().slipped, 350'000 - kStepInterval / 2 - kStepInterval / 4);
}

TEST_F(LateSteps, OfAMotionThatMeasuresAreNotCaughtUp) {
  full_step = 0;
  make({config(0)});
  follow(cruise(kMotionStart, 0, 100, kStepSpeed));
  stall(planned(49) + 10'000, planned(50) + 3 * kStepInterval);
  runOut();
  EXPECT_EQ(engine->state().slipped, 3 * kStepInterval - kStepInterval / 4);
}

TEST_F(LateSteps, OfASlowMotionAreCaughtUpForNoLongerThanARotorTakesToRest) {
  make({config(0)}, 1'000 * kMillisecond);
  constexpr Nanoseconds kSlow = 2 * kMillisecond;
  follow(cruise(kMotionStart, 0, 100, 1e9 / kSlow));
  stall(kMotionStart + 10 * kSlow, kMotionStart + 10 * kSlow + kSlow / 2 + 5 * kMillisecond);
  runOut();
  EXPECT_EQ(engine->state().slipped, 5 * kMillisecond - Follower::kLongestCatchUp);
}

TEST_F(LateSteps, OnBothEdgesAreCaughtUpToo) {
  ChannelConfig channel = config(0);
  channel.both_edges = true;
  make({channel});
  follow(cruise(kMotionStart, 0, 100, kStepSpeed));
  stall(planned(49) + 10'000, planned(50) + 3 * kStepInterval);
  runOut();
  EXPECT_EQ(engine->state().slips, 0U);
  ASSERT_EQ(lines.edges.size(), 101U) << "one is of DIR";
  EXPECT_EQ(lines.edges.back().time, planned(99));
}

// Two axes move the first motor at the sum of their speeds.
TEST_F(LateSteps, OfSharedMotorsAreJudgedByTheSpeedOfTheMotor) {
  SharedAxes shared;
  shared.channels = {0, 1};
  shared.matrix = {{1.0, 1.0}, {1.0, -1.0}};
  shared.inverse = {{0.5, 0.5}, {0.5, -0.5}};
  for (const Nanoseconds beyond : {0, 10'000}) {
    SCOPED_TRACE(beyond);
    lines.edges.clear();
    engine = std::make_unique<PulseEngine>(
        lines, clock, std::vector<ChannelConfig>{config(0), config(1)}, 5'000'000, std::nullopt,
        std::vector<SharedAxes>{shared});
    const Nanoseconds start = clock.now() + kMillisecond;
    follow(cruise(start, 0, 100, kStepSpeed), 0);
    follow(cruise(start, 0, 100, kStepSpeed), 1);
    const Nanoseconds due = start + 50 * kStepInterval + kStepInterval / 4;
    stall(due - 5'000, due + 2 * kStepInterval + beyond);
    runOut();
    EXPECT_EQ(engine->state().slipped, beyond) << "four steps of the motor are two intervals";
    EXPECT_EQ(lines.rises(0).size(), 200U);
    EXPECT_EQ(lines.rises(2).size(), 0U);
  }
}

TEST_F(LateSteps, EndAtOnceWithTheirMotion) {
  make({config(0)});
  follow(cruise(kMotionStart, 0, 100, kStepSpeed));
  stall(planned(49) + 10'000, planned(50) + 3 * kStepInterval);
  engine->serve();
  engine->emergencyStop();
  runOut();
  EXPECT_EQ(lines.rises(0).size(), 51U);
  EXPECT_EQ(engine->channel(0).count, 51);
}

// Random stalls of random motions: the count and the order are right, no time of the chip is
// broken, and no step is farther behind the plan at its time than the angle that is allowed.
TEST_F(LateSteps, KeepTheAngleWhateverStallsThereAre) {
  std::mt19937_64 random(11);
  const auto between = [&random](double low, double high) {
    return low * std::pow(high / low, std::uniform_real_distribution<double>()(random));
  };
  for (int run = 0; run < 300; ++run) {
    SCOPED_TRACE(run);
    const int microsteps = 1 << std::uniform_int_distribution<int>(0, 5)(random);
    const double speed = between(200.0, 60'000.0);
    const double acceleration = between(2.0 * speed, 200.0 * speed);
    const double jerk = run % 2 == 0 ? 0.0 : between(10.0, 1e4) * acceleration;
    lines.edges.clear();
    full_step = microsteps;
    make({config(0)}, 1'000 * kMillisecond);
    const Nanoseconds start = clock.now() + kMillisecond;
    const auto target = static_cast<std::int64_t>(between(50.0, 3'000.0));
    follow(motion::planFromRest(start, 0, target, {0.0, speed, acceleration, acceleration, jerk}));
    const auto plan = planOf(profiles.size() - 1);
    std::size_t made = 0;
    for (Nanoseconds due = engine->serve(); due != kNever; due = engine->serve()) {
      const std::size_t now_made = lines.rises(0).size();
      for (; made < now_made; ++made) {
        // By the plan on the timeline as it is now that the step has gone out.
        const Nanoseconds motion_time = lines.rises(0)[made] - engine->state().slipped;
        const motion::MotionState state = profiles.back()->stateAt(motion_time);
        const double behind = state.position.value() - (static_cast<double>(made) + 0.5);
        const Nanoseconds before = made > 0 ? plan[made - 1].time_ns : start;
        const double interval = static_cast<double>(plan[made].time_ns - before) * 1e-9;
        const double allowed = std::max(0.25 * microsteps, 0.25 * interval * state.velocity);
        // The speed may have its peak between the step's planned time and now.
        ASSERT_LE(behind, allowed * 1.1 + 1e-6) << "step " << made;
      }
      const bool stalls = std::uniform_int_distribution<int>(0, 9)(random) == 0;
      const auto late = stalls ? static_cast<Nanoseconds>(between(1e3, 3e6)) : Nanoseconds{0};
      waitUntil(due + late);
    }
    ASSERT_EQ(lines.rises(0).size(), plan.size());
    EXPECT_EQ(engine->channel(0).count, target);
    EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
    expectTimes(config(0));
    if (HasFailure()) return;
  }
}

}  // namespace
}  // namespace stepdriver::pulse
