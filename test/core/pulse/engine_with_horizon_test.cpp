#include <gtest/gtest.h>

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "support/ahead_port.h"
#include "support/constants.h"
#include "support/pulse_engine_bench.h"

/// The engine with a port that plays steps up to 50 ms ahead of time.
namespace stepdriver::pulse {
namespace {

using test::kMillisecond;
constexpr Nanoseconds kHorizon = 50 * kMillisecond;
constexpr Nanoseconds kStart = 100 * kMillisecond;

class EngineWithHorizon : public PulseEngineTest {
 protected:
  void makeAhead(const std::vector<ChannelConfig>& channels, Nanoseconds late = 0,
                 const std::vector<SharedAxes>& shared = {}, Nanoseconds take_back = 0) {
    port = std::make_unique<test::AheadPort>(
        lines, clock, PulseEngine::lanesOf(channels, shared),
        test::AheadPort::Habits{kHorizon, [late](const StepPort::Step&) { return late; },
                                take_back});
    engine = std::make_unique<PulseEngine>(*port, lines, clock, channels, 5 * kMillisecond,
                                           std::nullopt, shared);
  }

  void run(Nanoseconds until) {
    for (;;) {
      Nanoseconds due = engine->serve();
      if (port->playDue() <= clock.now()) {
        port->play(clock.now());
        continue;
      }
      due = std::min(due, port->playDue());
      if (due > until) break;
      while (clock.now() < due) clock.waitUntil(due);
    }
    while (clock.now() < until) clock.waitUntil(until);
  }

  static SharedAxes corexy() {
    SharedAxes shared;
    shared.channels = {0, 1};
    shared.matrix = {{1.0, 1.0}, {1.0, -1.0}};
    shared.inverse = {{0.5, 0.5}, {0.5, -0.5}};
    return shared;
  }

  /// Two motors move towards their switches, at lines 7 and 8, from their steps at lines 0 and 2.
  /// The switch of the first one becomes active after 10 ms.
  void squareGantry(int max_skew) {
    ChannelConfig gantry = config(0);
    gantry.endstop_max = Signal{7, true};
    gantry.max_skew = max_skew;
    MotorSignals& twin = gantry.twins.emplace_back();
    twin.step.line = 2;
    twin.dir.line = 3;
    twin.endstop_max = Signal{8, true};
    makeAhead({gantry});
    Follow& order = plan(cruise(kStart, 0, 1'000, 10'000.0));
    order.squares = order.is_square = true;
    postFollows(1);
    run(kStart + 10 * kMillisecond);
    lines.inputs[7] = 1;
  }

  std::int64_t rises(int line) { return static_cast<std::int64_t>(lines.rises(line).size()); }

  std::unique_ptr<test::AheadPort> port;
};

TEST_F(EngineWithHorizon, FollowsAMotionAndEndsItWhenTheLastStepHasBeenPlayed) {
  for (const Nanoseconds late : {Nanoseconds{0}, 3 * kMillisecond, -kMillisecond}) {
    lines.edges.clear();
    makeAhead({config(0)}, late);
    follow(cruise(clock.now() + kStart, 0, 200, 10'000.0));
    run(clock.now() + kStart + 5 * kMillisecond);
    const ChannelState moving = engine->channel(0);
    EXPECT_EQ(moving.count, rises(0)) << "late by " << late;
    EXPECT_GT(moving.following, 0u);
    for (int i = 0; i < 200 && engine->channel(0).following != 0; ++i) {
      run(clock.now() + kMillisecond);
    }
    const ChannelState state = engine->channel(0);
    EXPECT_EQ(state.count, 200);
    EXPECT_EQ(rises(0), 200);
    EXPECT_EQ(state.following, 0u);
    EXPECT_EQ(state.end, EndReason::kDone);
    EXPECT_EQ(engine->state().slips, 0u);
  }
}

TEST_F(EngineWithHorizon, RefusesAPlanThatBeginsBeforeItsHorizon) {
  makeAhead({config(0)});
  const std::uint64_t first = follow(cruise(clock.now() + kHorizon - 1, 0, 10, 1'000.0));
  engine->serve();
  EXPECT_LT(engine->channel(0).accepted, first);
  const std::uint64_t second = follow(cruise(clock.now() + kHorizon, 0, 10, 1'000.0));
  engine->serve();
  EXPECT_EQ(engine->channel(0).accepted, second);
}

TEST_F(EngineWithHorizon, TakesOverWithoutTakingStepsBack) {
  makeAhead({config(0)});
  const std::uint64_t first = follow(cruise(kStart, 0, 1'000, 10'000.0));
  run(kStart + 20 * kMillisecond);
  // At 10,000 steps/s it is at 800 then.
  const Nanoseconds turn = kStart + 80 * kMillisecond;
  follow(cruise(turn, 800, 500, 10'000.0), 0, first);
  run(kStart + 300 * kMillisecond);
  EXPECT_EQ(engine->channel(0).count, 500);
  EXPECT_EQ(rises(0), 800 + 300);
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
}

TEST_F(EngineWithHorizon, ServesAnEmergencyStopWhenAllStepsAreOver) {
  makeAhead({config(0), config(1)});
  follow(cruise(kStart, 0, 1'000, 10'000.0), 0);
  follow(cruise(kStart, 0, -1'000, 10'000.0), 1);
  run(kStart + 10 * kMillisecond);
  const std::uint64_t asked = engine->emergencyStop();
  engine->serve();
  EXPECT_LT(engine->stopsServed(), asked) << "the board hasn't given the steps back";
  EXPECT_GT(engine->channel(0).following, 0u);
  const std::int64_t played = rises(0);
  run(clock.now());
  EXPECT_EQ(engine->stopsServed(), asked);
  run(kStart + 300 * kMillisecond);
  EXPECT_EQ(rises(0), played);
  const ChannelState state = engine->channel(0);
  EXPECT_EQ(state.count, played);
  EXPECT_EQ(state.end, EndReason::kEmergencyStop);
  EXPECT_EQ(engine->channel(1).count, -rises(kLinesPerChannel));

  // The next motion begins where the motor stands.
  engine->clearEmergencyStop(asked);
  follow(cruise(clock.now() + kStart, state.count, state.count + 20, 1'000.0));
  run(clock.now() + 300 * kMillisecond);
  EXPECT_EQ(engine->channel(0).count, played + 20);
  EXPECT_EQ(rises(0), played + 20);
}

TEST_F(EngineWithHorizon, KnowsThatAStopWasAbruptAlthoughThePlanHasAlreadySlowedDown) {
  restart_interval = 500'000;
  makeAhead({config(0)});
  // It comes to rest within the horizon.
  follow(motion::planFromRest(kStart, 0, 300, {100.0, 20'000.0, 1e6, 1e6}));
  run(kStart + 5 * kMillisecond);
  engine->emergencyStop();
  run(clock.now());
  EXPECT_TRUE(engine->channel(0).end_abrupt);
}

TEST_F(EngineWithHorizon, EndsAMotionThatThePortHasStoppedAtASwitch) {
  ChannelConfig guarded = config(0);
  guarded.endstop_max = Signal{7, true};
  makeAhead({guarded, config(1)});
  plan(cruise(kStart, 0, 1'000, 10'000.0), 0).group = 1;
  plan(cruise(kStart, 0, 1'000, 10'000.0), 1).group = 1;
  postFollows(2);
  run(kStart + 10 * kMillisecond);
  lines.inputs[7] = 1;
  const std::int64_t played = rises(0);
  run(kStart + 300 * kMillisecond);
  EXPECT_EQ(rises(0), played);
  EXPECT_EQ(engine->channel(0).count, played);
  EXPECT_EQ(engine->channel(0).end, EndReason::kEndstopMax);
  EXPECT_EQ(engine->channel(1).end, EndReason::kCompanion);
  EXPECT_EQ(engine->channel(1).count, rises(kLinesPerChannel));
}

TEST_F(EngineWithHorizon, SlidesTheTimelineOnlyIfItIsLaterThanItsHorizon) {
  makeAhead({config(0)});
  follow(cruise(kStart, 0, 3'000, 10'000.0));
  run(kStart);
  // For 30 ms nobody serves it, and the board plays what it has.
  while (clock.now() < kStart + 30 * kMillisecond) {
    clock.waitUntil(std::min(port->playDue(), kStart + 30 * kMillisecond));
    port->play(clock.now());
  }
  run(kStart + 60 * kMillisecond);
  EXPECT_EQ(engine->state().slips, 0u);
  const Nanoseconds late = clock.now() + kHorizon + 2 * kMillisecond;
  while (clock.now() < late) {
    clock.waitUntil(std::min(port->playDue(), late));
    port->play(clock.now());
  }
  run(kStart + 600 * kMillisecond);
  EXPECT_GT(engine->state().slips, 0u);
  EXPECT_EQ(engine->channel(0).count, 3'000);
  EXPECT_EQ(rises(0), 3'000);
}

TEST_F(EngineWithHorizon, TellsThePlacesOfAxesThatShareMotorsByWhatWasPlayed) {
  makeAhead({config(0), config(1)}, 0, {corexy()});
  follow(cruise(kStart, 0, 1'000, 10'000.0), 0);
  run(kStart + 10 * kMillisecond);
  EXPECT_NEAR(static_cast<double>(engine->channel(0).count), 100.0, 2.0);
  engine->emergencyStop();
  run(kStart + 300 * kMillisecond);
  EXPECT_EQ(2 * engine->channel(0).count, rises(0) + rises(kLinesPerChannel));
  EXPECT_NEAR(engine->channel(0).rests_at, static_cast<double>(rises(0)), 1.0);
}

// The other one's steps are always open.
TEST_F(EngineWithHorizon, EndsAnAxisWhileOneThatSharesItsMotorsContinues) {
  makeAhead({config(0), config(1)}, 0, {corexy()});
  follow(cruise(kStart, 0, 100, 10'000.0), 0);
  follow(cruise(kStart, 0, 10'000, 10'000.0), 1);
  run(kStart + 12 * kMillisecond);
  EXPECT_EQ(engine->channel(0).following, 0u);
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_NEAR(static_cast<double>(engine->channel(0).count), 100.0, 1.0);
  EXPECT_GT(engine->channel(1).following, 0u);
}

TEST_F(EngineWithHorizon, SaysThatItFollowsAProfileWhenThatIsPlayedAndNotWhenItIsPut) {
  makeAhead({config(0)});
  const std::uint64_t first = follow(cruise(kStart, 0, 1'000, 10'000.0));
  run(kStart + 20 * kMillisecond);
  const std::uint64_t second =
      follow(cruise(kStart + 80 * kMillisecond, 800, 500, 10'000.0), 0, first);
  run(kStart + 79 * kMillisecond);
  EXPECT_EQ(engine->channel(0).accepted, second);
  EXPECT_EQ(engine->channel(0).following, first);
  run(kStart + 81 * kMillisecond);
  EXPECT_EQ(engine->channel(0).following, second);
}

// About fifty profiles are accepted and not yet played.
TEST_F(EngineWithHorizon, FollowsAStreamOfProfilesAMillisecondApart) {
  makeAhead({config(0)});
  engine->serve();
  constexpr int kProfiles = 200;
  std::uint64_t before = 0;
  for (int i = 0; i < kProfiles; ++i) {
    const Nanoseconds start = clock.now() + kHorizon + kMillisecond;
    before = follow(cruise(start, 10 * i, 10 * i + 1'000, 10'000.0), 0, before);
    run(clock.now() + kMillisecond);
    ASSERT_EQ(engine->channel(0).accepted, before) << i;
    const auto ahead = static_cast<double>(before - engine->channel(0).following);
    EXPECT_NEAR(ahead, std::min(i, 51), 2.0) << i;
  }
  run(clock.now() + 300 * kMillisecond);
  EXPECT_EQ(engine->channel(0).count, 10 * (kProfiles - 1) + 1'000);
  EXPECT_EQ(rises(0), 10 * (kProfiles - 1) + 1'000);
}

TEST_F(EngineWithHorizon, EndsTheAxisWhoseSwitchStopsASharedMotor) {
  ChannelConfig x = config(0);
  x.endstop_max = Signal{7, true};
  ChannelConfig y = config(1);
  y.endstop_max = Signal{8, true};
  for (const int line : {7, 8}) {
    makeAhead({x, y}, 0, {corexy()});
    const Nanoseconds start = clock.now() + kStart;
    plan(cruise(start, 0, 1'000, 10'000.0), 0);
    plan(cruise(start, 0, 1'000, 5'000.0), 1);
    postFollows(2);
    run(start + 10 * kMillisecond);
    lines.inputs[line] = 1;
    const std::int64_t count = engine->channel(line - 7).count;
    run(start + 300 * kMillisecond);
    EXPECT_EQ(engine->channel(line - 7).end, EndReason::kEndstopMax) << line;
    EXPECT_EQ(engine->channel(8 - line).end, EndReason::kCompanion) << line;
    EXPECT_NEAR(static_cast<double>(engine->channel(line - 7).count), static_cast<double>(count),
                1.0);
    lines.inputs[line] = 0;
  }
}

TEST_F(EngineWithHorizon, PassesASwitchBehindAnAxisThatSharesItsMotors) {
  ChannelConfig x = config(0);
  x.endstop_min = Signal{7, true};
  lines.inputs[7] = 1;
  makeAhead({x, config(1)}, 0, {corexy()});
  // Motor b turns backward, as y moves faster than x.
  plan(cruise(kStart, 0, 100, 5'000.0), 0);
  plan(cruise(kStart, 0, 300, 10'000.0), 1);
  postFollows(2);
  run(kStart + 300 * kMillisecond);
  EXPECT_EQ(engine->channel(0).end, EndReason::kDone);
  EXPECT_EQ(engine->channel(0).count, 100);
  EXPECT_EQ(engine->channel(1).count, 300);
}

TEST_F(EngineWithHorizon, SquaresTheMotorsOfAGantryAtTheirOwnSwitches) {
  squareGantry(500);
  const std::int64_t first = rises(0);
  run(kStart + 20 * kMillisecond);
  lines.inputs[8] = 1;
  const std::int64_t second = rises(2);
  run(kStart + 300 * kMillisecond);
  const ChannelState state = engine->channel(0);
  EXPECT_EQ(rises(0), first);
  EXPECT_EQ(rises(2), second);
  EXPECT_EQ(second - first, 100);
  EXPECT_EQ(state.end, EndReason::kEndstopMax);
  EXPECT_EQ(state.still, motorBit(0) | motorBit(1));
  EXPECT_EQ(state.count + state.lags[0], first);
  EXPECT_EQ(state.count + state.lags[1], second);
}

TEST_F(EngineWithHorizon, EndsASquaringBeforeItsMotorsAreFurtherApartThanAllowed) {
  squareGantry(30);
  run(kStart + 300 * kMillisecond);
  EXPECT_EQ(engine->channel(0).end, EndReason::kSkewed);
  EXPECT_EQ(rises(2) - rises(0), 30);
}

// When the stop comes, the motor is still slow; when it reaches the board, it isn't.
TEST_F(EngineWithHorizon, KnowsThatAStopWasAbruptBecauseTheMotorSpedUpUntilItArrived) {
  restart_interval = 500'000;
  for (const Nanoseconds take_back : {Nanoseconds{0}, 30 * kMillisecond}) {
    makeAhead({config(0)}, 0, {}, take_back);
    const Nanoseconds start = clock.now() + kStart;
    follow(motion::planFromRest(start, 0, 3'000, {100.0, 20'000.0, 1e5, 1e5}));
    run(start + 5 * kMillisecond);
    engine->emergencyStop();
    run(clock.now() + 200 * kMillisecond);
    EXPECT_EQ(engine->channel(0).end, EndReason::kEmergencyStop);
    EXPECT_EQ(engine->channel(0).end_abrupt, take_back != 0) << "taken back in " << take_back;
  }
}

// What has been put can't slide with the timeline.
TEST_F(EngineWithHorizon, KeepsChannelsTogetherWhenTheTimelineSlides) {
  full_step = 16;
  makeAhead({config(0), config(1)});
  plan(cruise(kStart, 0, 400, 2'000.0), 0);
  plan(cruise(kStart, 0, 4'000, 20'000.0), 1);
  postFollows(2);
  // Each pass is late, at first by less than the horizon.
  std::int64_t apart = 0;
  while (clock.now() < kStart + 3'000 * kMillisecond) {
    engine->serve();
    const Nanoseconds next = clock.now() + 53 * kMillisecond;
    while (clock.now() < next) {
      clock.waitUntil(std::min(port->playDue(), next));
      port->play(clock.now());
      apart = std::max(apart, std::abs(10 * rises(0) - rises(kLinesPerChannel)));
    }
  }
  EXPECT_GT(engine->state().slips, 0u);
  EXPECT_EQ(rises(0), 400);
  EXPECT_LE(apart, 10 + 2);
}

}  // namespace
}  // namespace stepdriver::pulse
