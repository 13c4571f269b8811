#include "pulse/hybrid_wait.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>
#include <vector>

#include "pulse/pulse_engine.h"
#include "support/constants.h"
#include "support/plan_from_rest.h"
#include "support/recording_lines.h"
#include "timeline/follower.h"

namespace stepdriver::pulse {
namespace {

using test::kMillisecond;
using test::kSecond;

constexpr Nanoseconds kMicrosecond = 1'000;

TEST(GuardLearner, ComesToTheNinetyNinthPercentileOfTheSleeps) {
  std::mt19937_64 random(1);
  GuardLearner learner;
  // Evenly distributed from 20 to 120 us: 99 of 100 are below 119 us.
  std::uniform_int_distribution<Nanoseconds> lateness(20'000, 120'000);
  int late = 0;
  constexpr int kSleeps = 50'000;
  for (int i = 0; i < 2 * kSleeps; ++i) {
    const Nanoseconds sleep = lateness(random);
    if (i >= kSleeps && sleep > learner.guard()) ++late;
    learner.slept(sleep);
  }
  EXPECT_NEAR(late / double{kSleeps}, 0.01, 0.003);
  EXPECT_GT(learner.guard(), 110'000);
  EXPECT_LT(learner.guard(), 135'000);
}

TEST(GuardLearner, ForgetsABusyTimeAndBearsStalls) {
  GuardLearner learner;
  for (int i = 0; i < 1'000; ++i) learner.slept(150'000);
  EXPECT_GT(learner.guard(), 130'000);
  for (int i = 0; i < 10'000; ++i) learner.slept(i % 1'000 == 0 ? 100 * kMillisecond : 20'000);
  EXPECT_LT(learner.guard(), 25'000);
}

TEST(GuardLearner, StaysWithinItsBounds) {
  GuardLearner learner;
  EXPECT_EQ(learner.guard(), GuardLearner::kFirst);
  for (int i = 0; i < 1'000; ++i) learner.slept(kSecond);
  EXPECT_EQ(learner.guard(), GuardLearner::kLongest);
  for (int i = 0; i < 100'000; ++i) learner.slept(0);
  EXPECT_EQ(learner.guard(), GuardLearner::kShortest);
}

TEST(GuardLearner, TakesASleepThatEndsAtTheGuardAsInTime) {
  GuardLearner in_time;
  in_time.slept(GuardLearner::kFirst);
  EXPECT_LT(in_time.guard(), GuardLearner::kFirst);
  GuardLearner late;
  late.slept(GuardLearner::kFirst + 1);
  EXPECT_GT(late.guard(), GuardLearner::kFirst);
}

TEST(RunningShare, AllowsARunAndHasItPaidBackByRests) {
  RunningShare share;
  share.ran(89 * kMillisecond);
  EXPECT_EQ(share.rest(), 0);
  share.ran(2 * kMillisecond);
  const Nanoseconds rest = share.rest();
  EXPECT_GE(rest, RunningShare::kRest);
  EXPECT_LT(rest, 2 * RunningShare::kRest);
  share.slept(rest);
  EXPECT_EQ(share.rest(), 0);
  share.ran(2 * kMillisecond);
  EXPECT_GT(share.rest(), 0) << "a rest pays for less than two milliseconds";
}

TEST(RunningShare, SavesUpNoSleep) {
  RunningShare share;
  share.slept(100 * kSecond);
  share.ran(91 * kMillisecond);
  EXPECT_GT(share.rest(), 0);
}

/// A thread on a processor that wakes it late by a given time, and a clock for the code that runs
/// in it.
class FakeThread : public Clock {
 public:
  explicit FakeThread(std::optional<Nanoseconds> guard = {}) : wait_(guard) {}

  Nanoseconds now() override { return processor.now(); }
  void wake() override {}
  void waitUntil(Nanoseconds time) override {
    System system{*this};
    wait_.waitUntil(system, time);
  }
  void sleepUntil(Nanoseconds time) override {
    System system{*this};
    wait_.waitUntil(system, time, false);
  }
  Nanoseconds guard() const override { return wait_.guard(); }
  void pass(Nanoseconds time) { processor.waitUntil(now() + time); }

  // The share of a period in which the thread was running.
  double shareOf(Nanoseconds begin, Nanoseconds end) const {
    return 1.0 - static_cast<double>(asleepBefore(end) - asleepBefore(begin)) /
                     static_cast<double>(end - begin);
  }

  // The largest share in any period of this length.
  double mostRunningIn(Nanoseconds length) {
    double most = shareOf(0, length);
    for (const Sleep& sleep : sleeps) {
      if (sleep.end + length <= now())
        most = std::max(most, shareOf(sleep.end, sleep.end + length));
    }
    return most;
  }

  std::function<Nanoseconds()> oversleeps = [] { return 40 * kMicrosecond; };
  Nanoseconds woken_at = kNever;
  struct Sleep {
    Nanoseconds begin;
    Nanoseconds end;
    Nanoseconds before;  // total sleep before this one
  };
  std::vector<Sleep> sleeps;
  VirtualClock processor;

 private:
  static constexpr Nanoseconds kLook = 250;  // duration of a read of the clock, while spinning

  Nanoseconds asleepBefore(Nanoseconds time) const {
    const auto after = std::upper_bound(
        sleeps.begin(), sleeps.end(), time,
        [](Nanoseconds sought, const Sleep& sleep) { return sought < sleep.begin; });
    if (after == sleeps.begin()) return 0;
    const Sleep& last = *(after - 1);
    return last.before + std::min(time, last.end) - last.begin;
  }

  struct System {
    FakeThread& thread;
    Nanoseconds now() const {
      thread.pass(kLook);
      return thread.now();
    }
    bool woken() const { return thread.now() >= thread.woken_at; }
    void sleepUntil(Nanoseconds time) const {
      const Nanoseconds begin = thread.now();
      thread.processor.waitUntil(std::min(time + thread.oversleeps(), thread.woken_at));
      const Nanoseconds before =
          thread.sleeps.empty()
              ? 0
              : thread.sleeps.back().before + thread.sleeps.back().end - thread.sleeps.back().begin;
      thread.sleeps.push_back({begin, thread.now(), before});
    }
  };

  HybridWait wait_;
};

TEST(HybridWait, IsExactOnceItHasLearntTheWakeUps) {
  FakeThread thread;
  std::mt19937_64 random(3);
  std::uniform_int_distribution<Nanoseconds> lateness(60'000, 100'000);
  thread.oversleeps = [&] { return lateness(random); };
  int late = 0;
  for (int i = 0; i < 4'000; ++i) {
    const Nanoseconds time = thread.now() + kMillisecond;
    thread.waitUntil(time);
    ASSERT_GE(thread.now(), time);
    if (i >= 1'000 && thread.now() > time + kMicrosecond) ++late;
  }
  EXPECT_LT(late, 90) << "of 3000, one in a hundred is expected";
  EXPECT_LT(thread.shareOf(0, thread.now()), 0.15) << "it spins no longer than it must";
}

TEST(HybridWait, GoesOnSleepingWhereWakeUpsAreTooLateForAnyGuard) {
  FakeThread thread;
  std::mt19937_64 random(4);
  std::uniform_int_distribution<Nanoseconds> lateness(100 * kMicrosecond, 4 * kMillisecond);
  thread.oversleeps = [&] { return lateness(random); };
  for (int i = 0; i < 2'000; ++i) thread.waitUntil(thread.now() + kMillisecond);
  EXPECT_EQ(thread.guard(), GuardLearner::kLongest);
  EXPECT_LT(thread.mostRunningIn(kSecond), 0.1);
}

TEST(HybridWait, SpinsForLessThanTheRealtimeThrottleAllowsWhateverTheIntervals) {
  for (const Nanoseconds interval : {5, 25, 60, 100, 220}) {
    SCOPED_TRACE(interval);
    FakeThread thread(GuardLearner::kLongest);
    Nanoseconds due = 0;
    while (thread.now() < 2 * kSecond) {
      due = std::max(due + interval * kMicrosecond, thread.now());
      thread.waitUntil(due);
    }
    EXPECT_LT(thread.mostRunningIn(kSecond), 0.91);
    // Short waits always spin, within the share of the time for which the thread may run at all.
    const bool is_short = interval * kMicrosecond <= HybridWait::kShortWait;
    EXPECT_LT(thread.shareOf(0, 2 * kSecond), is_short ? 0.91 : 0.85);
  }
}

TEST(HybridWait, OnlySleepsWhereItIsAskedTo) {
  FakeThread thread;
  const Nanoseconds time = thread.now() + kMillisecond;
  thread.sleepUntil(time);
  EXPECT_GE(thread.now(), time + 40 * kMicrosecond);
  const Nanoseconds next = thread.now() + kMillisecond;
  thread.waitUntil(next);
  EXPECT_LT(thread.now(), next + kMicrosecond);
}

TEST(HybridWait, LearnsNothingFromASleepThatWasEndedByAWake) {
  FakeThread thread;
  thread.woken_at = kMillisecond;
  thread.waitUntil(10 * kMillisecond);
  EXPECT_LT(thread.now(), kMillisecond + kMicrosecond);
  EXPECT_EQ(thread.guard(), GuardLearner::kFirst);
}

TEST(HybridWait, SleepsUpToItsGuardThoughItIsToRestForLess) {
  FakeThread thread;
  thread.waitUntil(0);
  thread.pass(95 * kMillisecond);
  const Nanoseconds begin = thread.now();
  thread.waitUntil(begin + 10 * kMillisecond);
  EXPECT_LT(thread.shareOf(begin, thread.now()), 0.05) << "it spins on after the rest";
}

TEST(HybridWait, NeverRestsWhereItSleepsATenthOfTheTimeAnyway) {
  FakeThread thread(60 * kMicrosecond);
  for (int i = 0; i < 400; ++i) {
    thread.pass(8'900 * kMicrosecond);
    const Nanoseconds due = thread.now();
    thread.waitUntil(due);
    ASSERT_LT(thread.now(), due + kMicrosecond) << i;
    thread.waitUntil(due + 1'060 * kMicrosecond);
  }
  EXPECT_GT(thread.shareOf(0, thread.now()), 0.89);
}

TEST(HybridWait, RestsShortlyAfterAStall) {
  FakeThread thread;
  thread.pass(kMillisecond);
  thread.waitUntil(thread.now() + kMillisecond);
  thread.pass(20 * kSecond);  // counts as running time
  const Nanoseconds now = thread.now();
  thread.waitUntil(now);
  EXPECT_GT(thread.now(), now + RunningShare::kRest - kMicrosecond);
  EXPECT_LT(thread.now(), now + RunningShare::kLongestRest + 50 * kMicrosecond);
}

/// An engine whose thread and lines can't keep up with the requested rate.
class EngineBehind : public testing::TestWithParam<int> {
 protected:
  static ChannelConfig config(int channel) {
    ChannelConfig config;
    config.step.line = 2 * channel;
    config.dir.line = 2 * channel + 1;
    config.step_high = config.step_low = 2'000;
    return config;
  }
};

// A write costs as much as in the test kernel: a pulse takes longer than its interval.
TEST_P(EngineBehind, LeavesTheOtherThreadsTheirShareAndOnlyEverSpreadsThePulses) {
  FakeThread thread;
  test::RecordingLines lines(thread.processor);
  lines.write_cost = 373 * kMicrosecond;
  const auto count = static_cast<std::size_t>(GetParam());
  std::vector<ChannelConfig> channels;
  channels.reserve(count);
  for (int i = 0; i < GetParam(); ++i) channels.push_back(config(i));
  PulseEngine engine(lines, thread, channels, kSecond);
  constexpr double kSpeed = 3000.0;
  std::vector<motion::Profile> profiles;
  for (int i = 0; i < GetParam(); ++i) {
    const double speed = kSpeed * (1.0 - 0.07 * i);
    profiles.push_back(motion::planFromRest(kMillisecond, 0, 2'000, {speed, speed, 1.0, 1.0}));
  }
  std::vector<Follow> follows;
  follows.reserve(count);
  for (int i = 0; i < GetParam(); ++i) follows.push_back({i, 1, &profiles[std::size_t(i)]});
  Command command;
  command.follows = follows.data();
  command.follow_count = follows.size();
  ASSERT_TRUE(engine.post(command));
  for (Nanoseconds due = engine.serve(); due != kNever; due = engine.serve()) {
    thread.waitUntil(due);
  }
  for (int i = 0; i < GetParam(); ++i) {
    const auto rises = lines.rises(2 * i);
    ASSERT_EQ(rises.size(), 2'000U);
    const double closest = Follower::kClosest * 1e9 / (kSpeed * (1.0 - 0.07 * i));
    for (std::size_t k = 1; k < rises.size(); ++k) {
      ASSERT_GE(static_cast<double>(rises[k] - rises[k - 1]), closest - 1.0);
    }
  }
  EXPECT_GT(engine.state().slips, 0U) << "it was not behind";
  EXPECT_LT(thread.mostRunningIn(kSecond), 0.92);
  EXPECT_LT(thread.shareOf(kSecond, thread.now()), 0.91);
}

INSTANTIATE_TEST_SUITE_P(Axes, EngineBehind, testing::Values(1, 3));

}  // namespace
}  // namespace stepdriver::pulse
