#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

// Motions that interrupt others. In steps, unless stated otherwise: 1000 steps/m.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

/// 1000 steps/s, 2000 steps/s^2, no soft limits, switches at -100 m and 100 m.
config::AxisConfig config() { return linearAxis("x", 1000.0, 1.0, 2.0); }

class AxisMotion : public testing::Test {
 protected:
  void build(const config::AxisConfig& with) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({with});
    specs[0].min_switch->position = -100'000.0;
    specs[0].max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{with}, specs);
  }
  void SetUp() override { build(config()); }

  axis::Axis& x() { return bench->axis(); }
  void advance(double seconds) { bench->machine->advance(seconds); }
  /// Clock time until the axis is at rest [s].
  double timeToRest() {
    const std::int64_t begin = bench->clock.now();
    while (x().state().moving) advance(1e-5);
    return static_cast<double>(bench->clock.now() - begin) * 1e-9;
  }
  /// Time until the axis reaches the speed [s].
  double timeToSpeed(double speed) {
    const std::int64_t begin = bench->clock.now();
    for (int i = 0; i < 1'000'000 && std::abs(x().state().velocity - speed) > 1e-9; ++i) {
      advance(1e-5);
    }
    return static_cast<double>(bench->clock.now() - begin) * 1e-9;
  }
  void expectCleanAt(std::int64_t count) {
    EXPECT_EQ(bench->pulses(), count);
    EXPECT_NEAR(x().state().position, static_cast<double>(count) / 1000.0, 1e-12);
    EXPECT_EQ(violationsOf(bench->report()), "");
    EXPECT_EQ(bench->machine->figures().slips, 0U);
  }

  std::unique_ptr<Bench> bench;
};

// The planned times begin 1 ms after the call.
constexpr double kLead = 0.001;

TEST_F(AxisMotion, MakesNoStepWhereItIsStoppedBeforeItBegins) {
  for (const double target : {1.0, -1.0}) {
    const axis::Move move = x().moveTo(target);
    x().stop();
    EXPECT_EQ(x().wait(move).end, MoveEnd::kStopped);
    EXPECT_EQ(bench->report().pulses_forward + bench->report().pulses_backward, 0);
  }
}

TEST_F(AxisMotion, TakesTheTimeOfTheClosedFormWithAJerkLimitToo) {
  EXPECT_NEAR(x().moveTo(1.0).duration, 1.5, 1e-9);
  config::AxisConfig smooth = config();
  smooth.jerk = 20.0;
  build(smooth);
  const axis::Move move = x().moveTo(1.0);
  EXPECT_NEAR(move.duration, 1.6, 1e-9);
  const axis::MoveResult result = x().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_NEAR(result.duration, 1.6, 1e-8);
  expectCleanAt(1000);
}

TEST_F(AxisMotion, SaysWhereItsPlanHasIt) {
  EXPECT_EQ(x().state().planned, x().state().position);
  const axis::Move move = x().moveTo(1.0);
  advance(0.25 + kLead);
  EXPECT_NEAR(x().state().planned, 0.0625, 1e-6) << "0.25 s at 2 m/s^2";
  for (int i = 0; i < 500; ++i) {
    advance(1.7e-3);
    const axis::AxisState state = x().state();
    EXPECT_NEAR(state.position, state.planned, 0.0005 + 1e-9) << "half a step";
  }
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(x().state().planned, x().state().position);
}

TEST_F(AxisMotion, GoesOnToATargetFartherAheadWithoutSlowingDown) {
  const std::int64_t begin = bench->clock.now();
  const axis::Move first = x().moveTo(2.0);
  advance(1.0);
  const axis::Move second = x().moveTo(3.0);
  EXPECT_EQ(second.overshoot, 0.0);
  const axis::MoveResult replaced = x().wait(first);
  EXPECT_EQ(replaced.end, MoveEnd::kReplaced);
  EXPECT_NE(replaced.message.find("a move to 3 m took over"), std::string::npos)
      << replaced.message;
  EXPECT_EQ(x().wait(second).end, MoveEnd::kReached);
  // As if the farther target had been the first one: no time is lost.
  EXPECT_NEAR(static_cast<double>(bench->clock.now() - begin) * 1e-9, 3.5 + kLead, 1e-6);
  expectCleanAt(3000);
}

TEST_F(AxisMotion, TurnsAndSaysSoWhereItCannotStopBeforeTheTarget) {
  const axis::Move first = x().moveTo(5.0);
  advance(1.0 + kLead);  // at 750 steps and 1000 steps/s: 250 steps to rest
  const axis::Move back = x().moveTo(0.9);
  // Planned 1 ms later, at 751: it rests at 1001, 101 beyond.
  EXPECT_NEAR(back.overshoot, 0.101, 1e-6);
  EXPECT_EQ(x().wait(first).end, MoveEnd::kReplaced);
  EXPECT_EQ(x().wait(back).end, MoveEnd::kReached);
  EXPECT_EQ(bench->report().pulses_forward, 1001);
  EXPECT_EQ(bench->report().pulses_backward, 101);
  expectCleanAt(900);
}

// Until a plan begins, the axis continues its motion for a millisecond, here by 20 microsteps.
TEST(AxisOvershoot, IsAnnouncedIfATargetIsPassedBeforeThePlanBegins) {
  for (const double sign : {1.0, -1.0}) {
    for (const double backlash : {0.0, 0.0003}) {
      for (const int ahead : {-200, -2, 2, 10, 18, 22, 200, 1200}) {
        constexpr double kScale = 1e5;
        config::AxisConfig config = test::linearAxis("x", kScale, 0.2, 2.0);
        config.backlash = backlash;
        Bench fast({config});
        axis::Axis& x = fast.axis();
        x.moveTo(sign * 0.09);
        fast.machine->advance(0.2);
        const double target = x.state().position + sign * ahead / kScale;
        const axis::Move move = x.moveTo(target);
        double farthest = x.state().position;
        while (x.state().moving) {
          fast.machine->advance(1e-4);
          farthest = sign > 0.0 ? std::max(farthest, x.state().position)
                                : std::min(farthest, x.state().position);
        }
        const double passed = ahead > 0 ? std::max(0.0, sign * (farthest - target)) : 0.0;
        EXPECT_NEAR(move.overshoot, passed, 1.5 / kScale)
            << sign << ", " << ahead << " microsteps ahead, backlash " << backlash;
        EXPECT_NEAR(x.state().position, target, 0.5 / kScale);
      }
    }
  }
}

TEST_F(AxisMotion, StopsShortOfANearerTargetWhereItCan) {
  x().moveTo(5.0);
  advance(1.0 + kLead);
  const axis::Move nearer = x().moveTo(1.1);
  EXPECT_EQ(nearer.overshoot, 0.0);
  EXPECT_EQ(x().wait(nearer).end, MoveEnd::kReached);
  EXPECT_EQ(bench->report().pulses_backward, 0);
  expectCleanAt(1100);
}

TEST_F(AxisMotion, AddsARelativeMoveToTheTargetUnderWay) {
  x().moveTo(1.0, true);
  advance(0.3);
  EXPECT_EQ(x().wait(x().moveTo(1.0, true)).end, MoveEnd::kReached);
  expectCleanAt(2000);
  x().jog(0.5);
  advance(0.1);
  EXPECT_REFUSED(x().moveTo(0.1, true), "jogs without an end");
}

TEST_F(AxisMotion, RefusesATargetBeyondALimitAndKeepsTheOneItHas) {
  config::AxisConfig limited = config();
  limited.max_position = 1.5;
  build(limited);
  const axis::Move move = x().moveTo(1.0);
  advance(0.5);
  EXPECT_REFUSED(x().moveTo(2.0), "soft limit");
  EXPECT_REFUSED(x().moveTo(0.5, false, 1.1), "above the maximum");
  EXPECT_REFUSED(x().moveTo(std::numeric_limits<double>::quiet_NaN()), "finite");
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  expectCleanAt(1000);
}

// 1000 to 250 steps/s at 2000 steps/s^2 takes 0.375 s.
TEST_F(AxisMotion, SlowsDownToALowerSpeedLimitAtTheDeceleration) {
  const axis::Move move = x().moveTo(5.0);
  advance(1.0);
  bench->machine->setSpeedOverride(0.25);
  EXPECT_NEAR(timeToSpeed(0.25), 0.375 + kLead, 2e-5);
  advance(0.5);
  EXPECT_NEAR(x().state().velocity, 0.25, 1e-9);
  bench->machine->setSpeedOverride(1.0);
  EXPECT_NEAR(timeToSpeed(1.0), 0.375 + kLead, 2e-5);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached) << "it is the same move still";
  expectCleanAt(5000);
}

TEST_F(AxisMotion, NeverGoesBeyondItsMaximumByAnOverride) {
  bench->machine->setSpeedOverride(2.0);
  const axis::Move move = x().moveTo(5.0, false, 0.75);
  advance(1.0);
  EXPECT_NEAR(x().state().velocity, 1.0, 1e-9);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  expectCleanAt(5000);
}

TEST_F(AxisMotion, JogsUntilItIsToldToEnd) {
  x().jog(0.5);
  EXPECT_NEAR(timeToSpeed(0.5), 0.25 + kLead, 3e-5);
  advance(0.3);
  x().jog(0.5);
  EXPECT_NEAR(x().state().velocity, 0.5, 1e-9);
  EXPECT_EQ(x().state().target, x().state().position);
  x().jog(-0.5);
  EXPECT_NEAR(timeToSpeed(-0.5), 0.5 + kLead, 3e-5);
  x().jog(0.0);
  EXPECT_NEAR(timeToRest(), 0.25 + kLead, 2e-3) << "on the first whole step";
  EXPECT_EQ(violationsOf(bench->report()), "");
  advance(10.0);
  EXPECT_FALSE(x().state().moving);
  EXPECT_EQ(bench->pulses(), std::llround(x().state().position * 1000.0));
}

TEST_F(AxisMotion, RestsAtTheSoftLimitThatItJogsTo) {
  config::AxisConfig limited = config();
  limited.min_position = -0.3;
  limited.max_position = 0.7;
  limited.jerk = 50.0;
  build(limited);
  x().jog(1.0);
  timeToRest();
  expectCleanAt(700);
  EXPECT_REFUSED(x().jog(0.1), "soft limit 0.7 m");
  x().jog(-1.0);
  timeToRest();
  expectCleanAt(-300);
}

TEST_F(AxisMotion, TakesOverFromAJogWithAMoveAndTheOtherWayRound) {
  x().jog(1.0);
  advance(1.0);
  const axis::Move move = x().moveTo(2.0);
  advance(0.1);
  x().jog(-0.2);
  const axis::MoveResult replaced = x().wait(move);
  EXPECT_EQ(replaced.end, MoveEnd::kReplaced);
  EXPECT_NE(replaced.message.find("a jog took over"), std::string::npos) << replaced.message;
  EXPECT_EQ(x().wait(x().moveTo(0.0)).end, MoveEnd::kReached);
  expectCleanAt(0);
}

TEST_F(AxisMotion, RefusesAJogThatItCannotDo) {
  EXPECT_REFUSED(x().jog(std::numeric_limits<double>::infinity()),
                 "the velocity is inf m/s, but must be");
  EXPECT_REFUSED(x().jog(-1.01), "above the maximum 1 m/s");
  x().jog(0.0);
  x().enable(false);
  EXPECT_REFUSED(x().jog(0.1), "disabled");
  advance(1.0);
  expectCleanAt(0);
}

TEST_F(AxisMotion, StopsAtTheDecelerationOfAStop) {
  config::AxisConfig firm = config();
  firm.stop_deceleration = 10.0;
  build(firm);
  const axis::Move move = x().moveTo(5.0);
  advance(1.0 + kLead);
  x().stop();
  EXPECT_NEAR(timeToRest(), 0.1 + kLead, 2e-3) << "on the first whole step";
  const axis::MoveResult result = x().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kStopped);
  expectCleanAt(801);
}

TEST_F(AxisMotion, StopsAMoveOnlyWhileItIsTheOneUnderWayOrHeld) {
  const axis::Move first = x().moveTo(4.0);
  advance(1.0);
  const axis::Move second = x().moveTo(3.0);
  x().stop(first);
  EXPECT_EQ(x().wait(second).end, MoveEnd::kReached) << "it has replaced the first";
  const axis::Move third = x().moveTo(1.0);
  advance(1.0);
  x().stop(third);
  EXPECT_EQ(x().wait(third).end, MoveEnd::kStopped);
  const axis::Move fourth = x().moveTo(0.0);
  advance(0.5);
  bench->machine->hold();
  advance(2.0);
  EXPECT_FALSE(x().result(fourth).has_value());
  x().stop(third);
  EXPECT_FALSE(x().result(fourth).has_value()) << "that one is long over";
  x().stop(fourth);
  ASSERT_TRUE(x().result(fourth).has_value());
  EXPECT_EQ(x().result(fourth)->end, MoveEnd::kStopped);
}

TEST_F(AxisMotion, AStreamOfJogsDoesNotRunOnThroughWhatStopsTheAxis) {
  const std::vector<std::function<void()>> stops = {
      [this] { x().stop(); },
      [this] { bench->machine->stop(); },
      [this] {
        bench->machine->hold();
        bench->machine->resume();
      },
      [this] {
        x().enable(false);
        x().enable(true);
      },
      [this] {
        bench->machine->emergencyStop();
        bench->machine->recover();
      },
  };
  for (std::size_t i = 0; i < stops.size(); ++i) {
    SCOPED_TRACE(i);
    const std::uint64_t stream = x().state().stops;
    for (int k = 0; k < 5; ++k) {
      x().jog(0.5, stream);
      advance(0.05);
    }
    stops[i]();
    advance(1.0);
    const std::int64_t pulses = bench->pulses();
    EXPECT_REFUSED(x().jog(0.5, stream), "the jog was stopped");
    x().jog(0.0, stream);
    advance(1.0);
    EXPECT_EQ(bench->pulses(), pulses);
    x().jog(0.5, x().state().stops);
    advance(0.5);
    EXPECT_GT(bench->pulses(), pulses) << "another stream";
    x().jog(0.0);
    advance(1.0);
  }
}

TEST_F(AxisMotion, KnowsHowAMoveEndedHoweverManyCameAfterIt) {
  const axis::Move first = x().moveTo(0.01);
  EXPECT_EQ(x().wait(first).end, MoveEnd::kReached);
  for (int i = 0; i < 400; ++i) x().wait(x().moveTo(i % 2 == 0 ? 0.011 : 0.01));
  const std::optional<axis::MoveResult> result = x().result(first);
  ASSERT_TRUE(result.has_value());
  EXPECT_EQ(result->end, MoveEnd::kReached);
  EXPECT_NEAR(result->position, 0.01, 1e-12);
  EXPECT_EQ(x().wait(first).end, MoveEnd::kReached);
}

TEST_F(AxisMotion, HasNoEndToWaitForIfItIsOnlyPlanned) {
  const axis::Move planned = x().plan(0.02).move;
  EXPECT_FALSE(x().result(planned).has_value());
  EXPECT_REFUSED(x().wait(planned), "the move was only planned");
}

TEST_F(AxisMotion, SaysHowLongItsMotionStillTakes) {
  EXPECT_EQ(x().state().time_left, 0.0);
  const axis::Move move = x().moveTo(2.0);  // 2.5 s
  advance(1.0);
  EXPECT_NEAR(x().state().time_left, 1.501, 1e-4) << "it began a millisecond later";
  x().stop();
  advance(0.002);
  EXPECT_NEAR(x().state().time_left, 0.499, 1e-4) << "a stop begins a millisecond later too";
  x().wait(move);
  EXPECT_EQ(x().state().time_left, 0.0);
  x().jog(0.5);
  advance(1.0);
  EXPECT_EQ(x().state().time_left, 0.0) << "no end";
}

TEST_F(AxisMotion, GoesOnFromAStopThatIsUnderWayOnlyByANewCommand) {
  const axis::Move first = x().moveTo(5.0);
  advance(1.0);
  x().stop();
  advance(0.2);
  const axis::Move second = x().moveTo(2.0);
  EXPECT_EQ(x().wait(second).end, MoveEnd::kReached);
  EXPECT_EQ(x().wait(first).end, MoveEnd::kReplaced);
  expectCleanAt(2000);
}

// The new motion is planned a little ahead; the switch may be met before it begins.
TEST_F(AxisMotion, DoesNotGoOnFromASpeedThatAnEndstopHasEnded) {
  for (double ahead = 0.0; ahead < 2.0; ahead += 0.1) {  // [steps] before the switch
    SCOPED_TRACE(testing::Message() << ahead << " steps before the switch");
    const config::AxisConfig with = config();
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({with});
    specs[0].max_switch->position = 500.0;
    Bench near({with}, specs, false, 0.0);
    axis::Axis& axis = near.axis();
    const axis::Move into = axis.moveTo(0.6, false, 0.9);
    while (axis.state().position < 0.5 - 0.001) near.machine->advance(1e-5);
    near.machine->advance(ahead / 900.0);
    try {
      const axis::Move back = axis.moveTo(0.55);
      const MoveEnd end = axis.wait(back).end;
      EXPECT_TRUE(end == MoveEnd::kEndstopMax) << static_cast<int>(end);
    } catch (const Refused& refused) {
      EXPECT_NE(std::string(refused.what()).find("max endstop"), std::string::npos)
          << refused.what();
    }
    const MoveEnd end = axis.wait(into).end;
    EXPECT_TRUE(end == MoveEnd::kEndstopMax || end == MoveEnd::kReplaced) << static_cast<int>(end);
    EXPECT_EQ(near.pulses(), 500);
    EXPECT_EQ(violationsOf(near.report()), "");
  }
}

}  // namespace
}  // namespace stepdriver
