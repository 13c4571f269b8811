#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cstdint>
#include <map>

#include "profile/step_finder.h"
#include "support/pulse_engine_bench.h"

namespace stepdriver::pulse {
namespace {

TEST_F(PulseEngineTest, PutsEachStepOutAtItsNanosecond) {
  make({config(0)});
  const auto profile = motion::planFromRest(1'000'000, 0, 500, {0, 5000, 20000, 30000});
  motion::StepFinder finder(profile, 0);
  follow(profile);
  runOut();
  const auto rises = lines.rises(0);
  ASSERT_EQ(rises.size(), 500U);
  motion::Step step;
  for (std::size_t k = 0; k < rises.size(); ++k) {
    ASSERT_TRUE(finder.next(step));
    ASSERT_EQ(rises[k], step.time_ns) << "step " << k;
  }
  for (const Edge& edge : lines.edges) {
    if (edge.line != 0 || edge.level) continue;
    EXPECT_EQ(edge.time - (&edge - 1)->time, 1'900);
  }
  EXPECT_EQ(engine->channel(0).count, 500);
  EXPECT_EQ(engine->channel(0).ended, serial);
  EXPECT_EQ(engine->channel(0).end_time, profile.endNs());
  EXPECT_EQ(engine->state().slips, 0U);
}

TEST_F(PulseEngineTest, TellsWhatAStepChangesRightAfterIt) {
  ChannelConfig loose = config(0);
  loose.backlash = 5;
  make({loose});
  follow(cruise(1'000'000, 0, 100, 1000.0));
  for (const std::int64_t count : {1, 3, 40}) {
    runUntil(1'000'000 + count * 1'000'000);
    const ChannelState state = engine->channel(0);
    EXPECT_EQ(state.count, count);
    EXPECT_EQ(state.slack, std::min<std::int64_t>(count, 5));
    EXPECT_EQ(state.pulses, static_cast<std::uint64_t>(count));
    EXPECT_EQ(state.rose, lines.rises(0).back());
    EXPECT_EQ(state.following, serial);
  }
}

TEST_F(PulseEngineTest, KeepsDirSetupAndHoldWhateverThePlanWants) {
  ChannelConfig slow_dir = config(0);
  slow_dir.dir_hold = 5'000;
  slow_dir.dir_setup = 7'000;
  for (const ChannelConfig& channel : {config(0), slow_dir}) {
    lines.edges.clear();
    make({channel});
    // Forward and immediately back: the last step forward and the first step back are 10 ns apart.
    const double speed = 50'000.0;
    const Nanoseconds start = clock.now() + 1'000'000;
    follow(cruise(start, 0, 3, speed));
    runUntil(start + 40'000);
    std::vector<motion::Piece> back{{0.0004, 3.0 - 0.4995, -speed, 0.0, 0.0}};
    follow({start + 50'010, back}, 0, serial);
    runOut();
    EXPECT_GT(engine->state().slips, 0U);
    expectTimes(channel);
  }
}

TEST_F(PulseEngineTest, SlidesAPlanThatIsTooFastForTheChip) {
  make({config(0)});
  follow(cruise(1'000'000, 0, 1000, 1e6));  // a step each microsecond; the chip needs 4
  runOut();
  const auto rises = lines.rises(0);
  ASSERT_EQ(rises.size(), 1000U);
  for (std::size_t k = 1; k < rises.size(); ++k) ASSERT_GE(rises[k] - rises[k - 1], 4'000);
  EXPECT_EQ(engine->channel(0).count, 1000);
  EXPECT_GT(engine->state().slips, 900U);
}

TEST_F(PulseEngineTest, WritesSimultaneousStepsTogether) {
  make({config(0), config(1)});
  follow(cruise(1'000'000, 0, 10, 1000.0), 0);
  follow(cruise(1'000'000, 0, 10, 1000.0), 1);
  runOut();
  std::map<std::size_t, int> edges_of_write;
  for (const Edge& edge : lines.edges) {
    if (edge.line % 2 == 0) ++edges_of_write[edge.write];
  }
  for (const auto& [write, edges] : edges_of_write) EXPECT_EQ(edges, 2) << "write " << write;
}

TEST_F(PulseEngineTest, AbsorbsASmallLatenessAndBunchesNothing) {
  make({config(0)});
  follow(cruise(1'000'000, 0, 100, 1000.0));
  runOut(100'000);  // every wake-up 100 us late, of an interval of 1 ms
  const auto rises = lines.rises(0);
  ASSERT_EQ(rises.size(), 100U);
  for (std::size_t k = 1; k < rises.size(); ++k) ASSERT_GE(rises[k] - rises[k - 1], 1'000'000);
  EXPECT_EQ(engine->state().slips, 0U);
  EXPECT_EQ(engine->state().worst_lateness, 100'000);
  EXPECT_EQ(engine->state().pulses, 100U);
  EXPECT_EQ(engine->lateness().count, 100U);
  EXPECT_EQ(engine->lateness().p50, 100'000);
  clock.waitUntil(1'500'000'000);
  EXPECT_EQ(engine->latenessLastSecond().max, 100'000);
}

TEST_F(PulseEngineTest, AbsorbsAQuarterOfAnIntervalToTheNanosecond) {
  for (const Nanoseconds beyond : {0, 1}) {
    SCOPED_TRACE(beyond);
    make({config(0)});
    const Nanoseconds start = clock.now() + 1'000'000;
    follow(cruise(start, 0, 100, 1000.0));
    runUntil(start + 50'000'000);
    clock.waitUntil(start + 50'500'000 + 250'000 + beyond);
    runOut();
    EXPECT_EQ(engine->state().slips, static_cast<std::uint64_t>(beyond));
    EXPECT_EQ(engine->state().slipped, beyond);
  }
}

TEST_F(PulseEngineTest, SlidesTheTimelineOfAllAxesByAGap) {
  make({config(0), config(1)}, 1'000'000'000);
  follow(cruise(1'000'000, 0, 200, 1000.0), 0);
  follow(cruise(1'000'000, 0, 20, 100.0), 1);
  runUntil(100'000'000);
  clock.waitUntil(clock.now() + 50'000'000);
  runOut();
  const auto fast = lines.rises(0);
  const auto slow = lines.rises(2);
  ASSERT_EQ(fast.size(), 200U);
  ASSERT_EQ(slow.size(), 20U);
  for (std::size_t k = 1; k < fast.size(); ++k) ASSERT_GE(fast[k] - fast[k - 1], 750'000);
  for (std::size_t k = 1; k < slow.size(); ++k) ASSERT_GE(slow[k] - slow[k - 1], 7'500'000);
  // Both axes are equally late at the end: they stay on their line.
  const Nanoseconds slipped = engine->state().slipped;
  EXPECT_NEAR(static_cast<double>(slipped), 50e6, 2e6);
  EXPECT_EQ(fast.back(), 1'000'000 + 199'500'000 + slipped);
  EXPECT_EQ(slow.back(), 1'000'000 + 195'000'000 + slipped);
}

TEST_F(PulseEngineTest, FaultsWhereTheMotorCantGoOnAfterAGap) {
  make({config(0)}, 5'000'000);
  restart_interval = 2'000'000;  // 500 steps/s
  const auto serial_of = follow(cruise(1'000'000, 0, 200, 1000.0));
  runUntil(100'000'000);
  clock.waitUntil(clock.now() + 10'000'000);
  runOut();
  const ChannelState state = engine->channel(0);
  EXPECT_EQ(state.end, EndReason::kTooLate);
  EXPECT_EQ(state.ended, serial_of);
  EXPECT_TRUE(state.end_abrupt);
  EXPECT_GT(state.end_lateness, 5'000'000);
  EXPECT_EQ(state.count, static_cast<std::int64_t>(lines.rises(0).size()));
  EXPECT_LT(state.count, 200);
  EXPECT_FALSE(lines.levels[0]) << "the pulse that was out is finished";
}

TEST_F(PulseEngineTest, FaultsBeyondTheLimitAndNotAtIt) {
  constexpr Nanoseconds kLimit = 5'000'000;
  for (const Nanoseconds beyond : {0, 1}) {
    SCOPED_TRACE(beyond);
    make({config(0)}, kLimit);
    restart_interval = 2'000'000;
    const Nanoseconds start = clock.now() + 1'000'000;
    follow(cruise(start, 0, 200, 1000.0));
    runUntil(start + 99'000'000);
    clock.waitUntil(start + 99'500'000 + kLimit + beyond);
    runOut();
    EXPECT_EQ(engine->channel(0).end, beyond == 0 ? EndReason::kDone : EndReason::kTooLate);
    EXPECT_EQ(engine->channel(0).count, beyond == 0 ? 200 : 99);
    EXPECT_EQ(engine->channel(0).end_lateness, beyond == 0 ? 0 : kLimit + 1);
  }
}

TEST_F(PulseEngineTest, GoesOnAfterAGapAtASpeedThatTheMotorStartsFrom) {
  make({config(0)}, 5'000'000);
  restart_interval = 1'000'000;  // exactly this is allowed; closer steps are too fast
  follow(cruise(1'000'000, 0, 200, 1000.0));
  runUntil(100'000'000);
  clock.waitUntil(clock.now() + 10'000'000);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(0).count, 200);
}

TEST_F(PulseEngineTest, FinishesThePulseThatIsOutAtAnEmergencyStop) {
  make({config(0)});
  follow(cruise(1'000'000, 0, 100, 1000.0));
  while (!lines.levels[0]) clock.waitUntil(engine->serve());
  engine->emergencyStop();
  const Nanoseconds rose = lines.edges.back().time;
  runOut();
  ASSERT_FALSE(lines.levels[0]);
  EXPECT_EQ(lines.edges.back().time, rose + 1'900);
  EXPECT_EQ(lines.rises(0).size(), 1U);
  EXPECT_EQ(engine->channel(0).end, EndReason::kEmergencyStop);
  // Nothing moves during the hold, and no motion that was ordered during it moves after it.
  follow(cruise(clock.now() + 1'000'000, 1, 100, 1000.0));
  runOut();
  engine->clearEmergencyStop(engine->stopsServed());
  runOut();
  EXPECT_EQ(lines.rises(0).size(), 1U);
}

TEST_F(PulseEngineTest, SendsNoStepTowardsAnActiveSwitchAndAnyAwayFromIt) {
  ChannelConfig wired = config(0);
  wired.endstop_max = Signal{10, false};
  wired.endstop_min = Signal{11, false};
  make({wired});
  lines.inputs = {{10, 1}, {11, 1}};
  follow(cruise(1'000'000, 0, 100, 1000.0));
  runUntil(20'000'000);
  lines.inputs[10] = 0;
  const std::size_t before = lines.rises(0).size();
  runOut();
  EXPECT_EQ(lines.rises(0).size(), before);
  EXPECT_EQ(engine->channel(0).end, EndReason::kEndstopMax);
  EXPECT_EQ(engine->channel(0).count, static_cast<std::int64_t>(before));
  const std::int64_t here = engine->channel(0).count;
  follow(cruise(clock.now() + 1'000'000, here, here - 5, 1000.0));
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(0).count, here - 5);
}

TEST_F(PulseEngineTest, SwapsAPlanAtItsTimeAndLosesNoStep) {
  make({config(0)});
  const auto first = cruise(1'000'000, 0, 1000, 1000.0);
  follow(first);
  runUntil(100'000'000);
  const Nanoseconds swap = 101'234'567;
  const motion::MotionState state = first.stateAt(swap);
  std::vector<motion::Piece> on{{0.05, state.position, 500.0, 0.0, 0.0}};
  follow({swap, on}, 0, serial);
  runOut();
  const auto rises = lines.rises(0);
  EXPECT_EQ(static_cast<double>(rises.size()), 125.0);  // 100.23 at 1000/s, then 25 at 500/s
  EXPECT_EQ(engine->channel(0).ended, serial);
  for (std::size_t k = 1; k < rises.size(); ++k) {
    EXPECT_GE(rises[k] - rises[k - 1], rises[k] < swap ? 999'999 : 1'000'000);
  }
}

TEST_F(PulseEngineTest, RefusesAPlanThatComesTooLate) {
  make({config(0)});
  clock.waitUntil(5'000'000);
  const auto late = follow(cruise(4'999'999, 0, 10, 1000.0));
  runOut();
  EXPECT_LT(engine->channel(0).accepted, late);
  EXPECT_TRUE(lines.edges.empty());
}

TEST_F(PulseEngineTest, RefusesAPlanThatGoesOnFromAMotionThatIsOver) {
  make({config(0)});
  const auto first = follow(cruise(clock.now(), 0, 10, 1000.0));
  const auto from_rest = follow(cruise(clock.now() + 5'000'000, 5, 50, 1000.0));
  runUntil(clock.now() + 4'000'000);
  EXPECT_LT(engine->channel(0).accepted, from_rest) << "planned from rest, but it moves";
  const std::size_t edges = lines.edges.size();
  engine->emergencyStop();
  runOut();
  engine->clearEmergencyStop(engine->stopsServed());
  const auto on = follow(cruise(clock.now() + 1'000'000, 5, 50, 1000.0), 0, first);
  runOut();
  EXPECT_LT(engine->channel(0).accepted, on) << "planned from a speed that it no longer has";
  EXPECT_LE(lines.edges.size(), edges + 1) << "only the pulse that was out ends";
}

TEST_F(PulseEngineTest, FollowsNothingWhileItIsReservedAndNothingBeforeItIsReady) {
  make({config(0)});
  Command reserve;
  reserve.kind = Command::Kind::kReserve;
  reserve.serial = ++serial;
  ASSERT_TRUE(engine->post(reserve));
  runOut();
  EXPECT_EQ(engine->channel(0).accepted, serial);
  const auto early = follow(cruise(clock.now() + 1'000'000, 0, 1, 1e5));
  runOut();
  EXPECT_EQ(engine->channel(0).taken, early);
  EXPECT_NE(engine->channel(0).accepted, early) << "somebody writes its pins";
  Command release;
  release.kind = Command::Kind::kRelease;
  release.serial = ++serial;
  release.ready = clock.now() + 2'000'000;
  ASSERT_TRUE(engine->post(release));
  follow(cruise(clock.now(), 0, 1, 1e5));
  runOut();
  ASSERT_EQ(lines.rises(0).size(), 1U);
  EXPECT_GE(lines.rises(0).at(0), release.ready);
}

TEST_F(PulseEngineTest, IsNotReservedWhileItMoves) {
  make({config(0)});
  follow(cruise(1'000'000, 0, 10, 1000.0));
  runUntil(3'000'000);
  Command reserve;
  reserve.kind = Command::Kind::kReserve;
  reserve.serial = ++serial;
  ASSERT_TRUE(engine->post(reserve));
  runOut();
  EXPECT_EQ(engine->channel(0).taken, serial);
  EXPECT_NE(engine->channel(0).accepted, serial);
  EXPECT_EQ(lines.rises(0).size(), 10U);
}

TEST_F(PulseEngineTest, CountsInANewScaleFromTheReleaseOn) {
  make({config(0)});
  Command order;
  order.kind = Command::Kind::kReserve;
  order.serial = ++serial;
  ASSERT_TRUE(engine->post(order));
  order.kind = Command::Kind::kRelease;
  order.serial = ++serial;
  order.scale = Command::Scale{-40, 3, 5};
  ASSERT_TRUE(engine->post(order));
  runOut();
  EXPECT_EQ(engine->channel(0).count, -40);
  EXPECT_EQ(engine->channel(0).slack, 3);
  EXPECT_EQ(engine->channel(0).epoch, 1U);
}

TEST_F(PulseEngineTest, RefusesWhatWasPlannedBeforeAnEmergencyStopThatIsOver) {
  make({config(0)});
  follow(cruise(1'000'000, 0, 10, 1000.0));
  follows.back().stops = 0;
  engine->emergencyStop();
  runOut();
  EXPECT_EQ(engine->stopsServed(), 1U);
  engine->clearEmergencyStop(engine->stopsServed());
  runOut();
  EXPECT_TRUE(lines.edges.empty());
  follow(cruise(clock.now() + 1'000'000, 0, 10, 1000.0));
  follows.back().stops = 0;
  runOut();
  EXPECT_TRUE(lines.edges.empty()) << "planned before the stop";
  follow(cruise(clock.now() + 1'000'000, 0, 10, 1000.0));
  runOut();
  EXPECT_EQ(lines.rises(0).size(), 10U);
}

TEST_F(PulseEngineTest, DoesNotLoseAnEmergencyStopThatComesWhileAnEarlierOneIsCleared) {
  make({config(0)});
  engine->emergencyStop();
  runOut();
  const std::uint64_t served = engine->stopsServed();
  engine->emergencyStop();
  engine->clearEmergencyStop(served);
  EXPECT_TRUE(engine->emergencyStopped());
  runOut();
  EXPECT_EQ(engine->stopsServed(), 2U);
  EXPECT_TRUE(engine->emergencyStopped());
}

TEST_F(PulseEngineTest, StopsAtALineThatFailsAndDoesNotCountItsEdge) {
  make({config(0)});
  lines.fail_after = 10;
  const auto failing = follow(cruise(1'000'000, 0, 100, 1000.0));
  runOut();
  const ChannelState state = engine->channel(0);
  EXPECT_EQ(state.end, EndReason::kLineError);
  EXPECT_EQ(state.ended, failing);
  EXPECT_EQ(state.failure.error, EIO);
  EXPECT_EQ(state.failure.line, 0);
  EXPECT_FALSE(state.failure.input);
  EXPECT_EQ(state.line_errors, 1U);
  EXPECT_EQ(state.count, static_cast<std::int64_t>(lines.rises(0).size()));
}

TEST_F(PulseEngineTest, GoesOnWithTheOthersWhereOneLineOfAWriteFails) {
  make({config(0), config(1), config(2)});
  for (const int channel : {0, 1, 2}) follow(cruise(1'000'000, 0, 100, 1000.0), channel);
  runUntil(50'300'000);
  const std::int64_t before = engine->channel(1).count;
  lines.broken = 2;
  runOut();
  for (const int channel : {0, 2}) {
    const ChannelState state = engine->channel(channel);
    EXPECT_EQ(state.end, EndReason::kDone) << channel;
    EXPECT_EQ(state.count, 100) << channel;
    EXPECT_EQ(lines.rises(channel * kLinesPerChannel).size(), 100U) << channel;
    EXPECT_EQ(state.line_errors, 0U) << channel;
  }
  const ChannelState failed = engine->channel(1);
  EXPECT_EQ(failed.end, EndReason::kLineError);
  EXPECT_EQ(failed.failure.error, ENODEV);
  EXPECT_EQ(failed.failure.line, 2);
  EXPECT_EQ(failed.count, before);
  EXPECT_EQ(failed.line_errors, 1U);
}

TEST_F(PulseEngineTest, FollowsEachProfileFromItsStartThoughTheNextOneIsThereAlready) {
  make({config(0)});
  const auto first = follow(cruise(1'000'000, 0, 100, 1000.0));
  const auto rest = follow(motion::Profile(11'200'000, 10.2), 0, first);
  follow(cruise(11'700'000, 10, 0, 1000.0), 0, rest);
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(0).count, 0);
  // The first profile's step at 11.5 ms is cancelled.
  EXPECT_EQ(lines.rises(0).size(), 20U);
}

TEST_F(PulseEngineTest, RefusesMoreSuccessorsThanItHasRoomForAndKeepsThose) {
  make({config(0)});
  auto last = follow(cruise(1'000'000, 0, 1000, 1000.0));
  for (int i = 0; i < 16; ++i) {
    last = follow(cruise(100'000'000 + i * 2'000'000, 98 + 2 * i, 1000, 1000.0), 0, last);
  }
  engine->serve();
  EXPECT_EQ(engine->channel(0).accepted, last);
  const auto one_too_many = follow(cruise(140'000'000, 138, 1000, 1000.0), 0, last);
  engine->serve();
  EXPECT_LT(engine->channel(0).accepted, one_too_many);
  runOut();
  EXPECT_EQ(engine->channel(0).count, 1000);
  EXPECT_EQ(engine->channel(0).ended, last);
}

TEST_F(PulseEngineTest, RefusesWhatWasPlannedBeforeAFaultAtRest) {
  ChannelConfig faulty = config(0);
  faulty.fault = Signal{0, true};
  lines.inputs[0] = 0;
  make({faulty, config(1)});
  lines.inputs[0] = 1;
  engine->inputsChanged();
  engine->serve();
  EXPECT_EQ(engine->channel(0).chip_faults, 1U);
  const auto before = follow(cruise(1'000'000, 0, 100, 1000.0));
  follows.back().faults = 0;
  const auto other = follow(cruise(1'000'000, 0, 100, 1000.0), 1);
  runOut();
  EXPECT_EQ(engine->channel(0).taken, before);
  EXPECT_EQ(engine->channel(0).accepted, 0U);
  EXPECT_EQ(engine->channel(0).count, 0);
  EXPECT_EQ(engine->channel(1).accepted, other);
  EXPECT_EQ(engine->channel(1).count, 100);
}

TEST_F(PulseEngineTest, OnlyCountsAFaultOfAChipThatRamps) {
  ChannelConfig ramps = config(0);
  ramps.fault = Signal{0, true};
  ramps.ramps_at_fault = true;
  ChannelConfig ends = config(1);
  ends.fault = Signal{1, true};
  lines.inputs[0] = lines.inputs[1] = 0;
  make({ramps, ends});
  for (const int channel : {0, 1}) follow(cruise(1'000'000, 0, 100, 1000.0), channel);
  runUntil(50'300'000);
  lines.inputs[0] = lines.inputs[1] = 1;
  engine->inputsChanged();
  runOut();
  EXPECT_EQ(engine->channel(0).chip_faults, 1U);
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(0).count, 100) << "without an order to stop";
  EXPECT_EQ(engine->channel(1).chip_faults, 1U);
  EXPECT_EQ(engine->channel(1).end, EndReason::kChipFault);
  EXPECT_EQ(engine->channel(1).count, 49);
}

TEST_F(PulseEngineTest, EndsAMotionWithoutAStepAtAFaultEvenIfTheChipRamps) {
  ChannelConfig ramps = config(0);
  ramps.fault = Signal{0, true};
  ramps.ramps_at_fault = true;
  lines.inputs[0] = 0;
  make({ramps});
  follow(cruise(100'000'000, 0, 100, 1000.0));
  runUntil(50'000'000);
  lines.inputs[0] = 1;
  engine->inputsChanged();
  runOut();
  EXPECT_EQ(engine->channel(0).end, EndReason::kChipFault);
  EXPECT_EQ(engine->channel(0).count, 0);
}

}  // namespace
}  // namespace stepdriver::pulse
