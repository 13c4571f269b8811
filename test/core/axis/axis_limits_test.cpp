#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/refusal.h"

// 1000 steps/m, at most 1 m/s and 2 m/s^2, unless a test sets other limits.

namespace stepdriver {
namespace {

using axis::AxisLimits;
using axis::MoveEnd;
using test::Bench;
using test::kInfinity;
using test::kNan;
using test::linearAxis;
using test::violationsOf;

class AxisLimitsTest : public testing::Test {
 protected:
  void build(double jerk = 0.0, bool has_soft_limits = true) {
    config::AxisConfig config = linearAxis("x");
    config.steps_per_unit = 1000.0;
    config.max_speed = 1.0;
    config.acceleration = 2.0;
    config.deceleration = 2.0;
    config.jerk = jerk;
    if (has_soft_limits) {
      config.min_position = -50.0;
      config.max_position = 50.0;
    }
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    specs[0].min_switch->position = -100'000.0;
    specs[0].max_switch->position = 100'000.0;
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config}, specs);
  }
  void SetUp() override { build(); }
  void TearDown() override { EXPECT_EQ(violationsOf(bench->report()), ""); }

  axis::Axis& x() { return bench->axis(); }
  void advance(double seconds) { bench->machine->advance(seconds); }
  double velocity() { return x().state().velocity; }
  void send(machine::SetpointMode mode, double timeout, double value) {
    EXPECT_EQ(bench->machine->followSetpoints(mode, timeout, {{"x", value, {}}}),
              std::vector<std::string>{""});
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(AxisLimitsTest, TellsTheHighestStepRateOfTheMotionUnderWay) {
  EXPECT_EQ(x().peakRate(), 0.0);
  const axis::Move move = x().moveTo(0.08);  // a triangle up to 0.4 m/s
  advance(0.05);
  EXPECT_NEAR(x().peakRate(), 400.0, 0.1) << "though it is slow still";
  EXPECT_LT(velocity(), 0.11);
  x().wait(move);
  EXPECT_EQ(x().peakRate(), 0.0);
}

TEST_F(AxisLimitsTest, MovesWithinThemFromTheNextMotionOn) {
  EXPECT_NEAR(bench->move(2.0).duration, 2.5, 1e-3);
  x().setLimits({0.5, 1.0, 0.25, 0.0});
  // Ramps of 0.5 s and 2 s, 0.625 m; 1.375 m between them.
  EXPECT_NEAR(bench->move(0.0).duration, 0.5 + 2.0 + 2.75, 1e-3);
  const AxisLimits holding = x().limits();
  EXPECT_EQ(holding.max_speed, 0.5);
  EXPECT_EQ(holding.acceleration, 1.0);
  EXPECT_EQ(holding.deceleration, 0.25);
  x().setLimits({});
  EXPECT_NEAR(bench->move(2.0).duration, 2.5, 1e-3) << "0: as configured";
}

TEST_F(AxisLimitsTest, TakesAJerkLimitWhereNoneIsConfigured) {
  x().setLimits({0.0, 0.0, 0.0, 4.0});
  EXPECT_NEAR(bench->move(2.0).duration, 2.5 + 0.5, 1e-3) << "2 m/s^2 over 4 m/s^3 longer";
}

TEST_F(AxisLimitsTest, RefusesCommandsBeyondTheLowerSpeed) {
  x().setLimits({0.5, 0.0, 0.0, 0.0});
  EXPECT_REFUSED(x().moveTo(1.0, false, 0.6), "above the maximum 0.5 m/s");
  EXPECT_REFUSED(x().jog(-0.6), "above the maximum");
}

TEST_F(AxisLimitsTest, SlowsDownAMotionUnderWay) {
  const axis::Move move = x().moveTo(10.0);
  advance(2.0);
  EXPECT_NEAR(velocity(), 1.0, 1e-9);
  x().setLimits({0.4, 0.0, 0.5, 0.0});
  advance(0.201);
  EXPECT_NEAR(velocity(), 0.9, 1e-6) << "by 0.5 m/s^2";
  advance(1.1);
  EXPECT_NEAR(velocity(), 0.4, 1e-9);
  const double before = x().state().time_left;
  EXPECT_NEAR(before, (10.0 - x().state().position) / 0.4 + 0.4, 0.005);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses(), 10'000);
}

// At 0.03 steps/s the next whole step is half a minute away.
TEST_F(AxisLimitsTest, StopsAtOnceHoweverSlowTheyAre) {
  constexpr double kWholeStep = 0.05;  // s, from rest to rest at 2 m/s^2
  for (const AxisLimits& slow :
       {AxisLimits{3e-5, 0.0, 0.0, 0.0}, AxisLimits{0.0, 3e-5, 3e-5, 0.0}}) {
    build();
    x().setLimits(slow);
    x().moveTo(10.0);
    advance(0.3);
    x().stop();
    advance(kWholeStep);
    EXPECT_FALSE(x().state().moving);
    EXPECT_LE(bench->pulses(), 1);
  }
}

TEST_F(AxisLimitsTest, GoesFasterAgainWhereTheLimitIsRaised) {
  x().setLimits({0.25, 0.0, 0.0, 0.0});
  x().jog(0.25);
  advance(1.0);
  x().setLimits({});
  advance(1.0);
  EXPECT_NEAR(velocity(), 0.25, 1e-9) << "as it was asked for";
  x().jog(1.0);
  advance(1.0);
  EXPECT_NEAR(velocity(), 1.0, 1e-9);
}

// The acceleration of 1e12 microsteps/s^2 must end at once: in a nanosecond it takes the speed to
// twice its maximum.
TEST(AxisLimits, AreKeptIfALowJerkReplacesAStopAtTheHighestAcceleration) {
  for (const double after : {0.016, 0.017, 0.018}) {
    config::AxisConfig config = linearAxis("x", 100'000.0, 0.003, 1e7);
    config.deceleration = 50.0;
    Bench bench({config});
    axis::Axis& x = bench.axis();
    x.setLimits({0.0, 0.0, 0.0, 5.0});
    x.moveTo(0.012);
    bench.machine->advance(after);
    x.stop();
    EXPECT_EQ(x.wait(x.moveTo(0.0005, true)).end, MoveEnd::kReached);
    EXPECT_EQ(violationsOf(bench.report()), "");
  }
}

// With the lower deceleration it would overshoot its target, and here the soft limit too.
TEST_F(AxisLimitsTest, ComesToRestInTimeWhateverIsSetMeanwhile) {
  const axis::Move move = x().moveTo(50.0);
  advance(49.8);
  x().setLimits({0.0, 0.1, 0.1, 0.2});
  const axis::Move other = x().moveTo(49.99);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReplaced);
  double farthest = 0.0;
  while (x().state().moving) {
    advance(0.001);
    farthest = std::max(farthest, x().state().position);
  }
  EXPECT_EQ(x().wait(other).end, MoveEnd::kReached);
  EXPECT_LE(farthest, 50.0);
  const axis::Move slow = x().moveTo(49.0);
  EXPECT_GT(slow.duration, 6.0) << "from rest on they hold: 2 sqrt(0.99 / 0.1)";
}

TEST_F(AxisLimitsTest, HoldForAMotionUnderWayIfItStillStopsInTime) {
  const axis::Move move = x().moveTo(10.0);
  advance(2.0);
  x().setLimits({0.0, 0.0, 0.25, 0.0});  // it needs 2 m to come to rest
  advance(0.002);
  EXPECT_NEAR(x().state().time_left, 10.0 - x().state().position + 2.0, 0.005);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses(), 10'000);
  x().setLimits({});
  const axis::Move back = x().moveTo(0.0);
  advance(9.05);  // 1.2 m are left
  x().setLimits({0.0, 0.0, 0.25, 0.0});
  advance(0.002);
  EXPECT_NEAR(x().state().time_left, x().state().position + 0.25, 0.005)
      << "it keeps the deceleration that it began with";
  EXPECT_EQ(x().wait(back).end, MoveEnd::kReached);
  EXPECT_EQ(bench->report().pulses_backward, 10'000);
  const axis::Move next = x().moveTo(10.0);
  EXPECT_NEAR(next.duration, 10.0 + 0.25 + 2.0, 1e-3) << "the next motion has the new one";
}

// Planned with the lower deceleration it would pass the soft limit before it turns.
TEST_F(AxisLimitsTest, LetNoMotionPassASoftLimit) {
  const std::vector<std::function<void()>> turns = {
      [this] { x().jog(-1.0); },
      [this] { x().moveTo(0.0); },
      [this] { bench->machine->setSpeedOverride(0.9); },
      [this] { send(machine::SetpointMode::kPosition, 5.0, 49.0); },
      [this] { send(machine::SetpointMode::kVelocity, 5.0, -1.0); },
  };
  for (const bool line : {false, true}) {
    for (std::size_t i = 0; i < turns.size(); ++i) {
      SCOPED_TRACE(testing::Message() << "turn " << i << (line ? " of a line" : " of a move"));
      build();
      if (line) {
        bench->machine->moveLine({{"x"}, {50.0}});
      } else {
        x().moveTo(50.0);
      }
      advance(50.0);  // 0.4 m before it comes to rest, for which 0.25 m suffice
      x().setLimits({0.0, 0.0, 0.1, 0.0});
      turns[i]();
      double farthest = 0.0;
      for (int k = 0; k < 3000; ++k) {
        advance(0.001);
        farthest = std::max(farthest, x().state().position);
      }
      EXPECT_GT(farthest, 49.5);
      EXPECT_LE(farthest, 50.0);
    }
  }
}

// From 1 m/s it turns within 0.25 m, or 0.5 m with the jerk limit, and would take 5 m with the
// lower deceleration.
TEST_F(AxisLimitsTest, DoNotTakeAnAxisThatTurnsBackFarther) {
  for (const double jerk : {0.0, 4.0}) {
    for (const bool jogs : {false, true}) {
      for (const double after : {0.0, 0.001, 0.1, 0.3, 0.45}) {
        SCOPED_TRACE(testing::Message() << jerk << " m/s^3, after " << after);
        build(jerk);
        x().moveTo(10.0);
        advance(3.0);
        const double place = x().state().position;
        if (jogs) {
          x().jog(-1.0);
        } else {
          x().moveTo(0.0);
        }
        advance(after);
        x().setLimits({0.0, 0.1, 0.1, 0.2});
        double farthest = place;
        for (int k = 0; k < 2000; ++k) {
          advance(0.001);
          farthest = std::max(farthest, x().state().position);
        }
        EXPECT_GT(farthest, place + 0.2);
        EXPECT_LE(farthest, place + (jerk > 0.0 ? 0.5 : 0.25) + 0.003);
        EXPECT_LT(velocity(), 0.0);
        EXPECT_GT(velocity(), -0.2) << "from there on, the new ones apply";
      }
    }
  }
}

/// A lower jerk takes an acceleration back more slowly: from 2 m/s^2 at 0.01 m/s^3 in 200 s, while
/// the speed changes by 200 m/s.
class LowerJerk : public AxisLimitsTest {
 protected:
  void expectNoTurnAndNoHigherSpeed(double seconds) {
    double place = x().state().planned;
    for (int i = 0; i < static_cast<int>(seconds / 0.005); ++i) {
      advance(0.005);
      const axis::AxisState state = x().state();
      ASSERT_GE(state.planned, place - 1e-9) << "it turned";
      ASSERT_LE(state.velocity, 1.0 + 1e-6);
      place = state.planned;
    }
  }
};

TEST_F(LowerJerk, OfAMotionUnderWayNeitherTurnsItNorMakesItTooFast) {
  for (const double jerk : {0.0, 4.0}) {
    for (int after = 0; after < 32; ++after) {
      SCOPED_TRACE(testing::Message() << jerk << " m/s^3, after " << after);
      build(jerk);
      const axis::Move move = x().moveTo(2.0);
      advance(0.001 + 0.1 * after);
      if (!x().state().moving) break;
      x().setLimits({0.0, 0.0, 0.0, 0.01});
      bench->machine->setSpeedOverride(0.8);
      expectNoTurnAndNoHigherSpeed(3.0);
      bench->machine->setSpeedOverride(1.0);
      EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
      EXPECT_EQ(bench->report().pulses_backward, 0);
    }
  }
}

TEST_F(LowerJerk, OfAJogWithoutALimitDoesNotMakeItTooFast) {
  for (const double jerk : {0.0, 4.0}) {
    for (int after = 0; after < 10; ++after) {
      SCOPED_TRACE(testing::Message() << jerk << " m/s^3, after " << after);
      build(jerk, false);
      x().jog(1.0);
      advance(0.001 + 0.1 * after);
      x().setLimits({0.0, 0.0, 0.0, 0.01});
      expectNoTurnAndNoHigherSpeed(3.0);
      x().jog(0.5);
      expectNoTurnAndNoHigherSpeed(3.0);
    }
  }
}

TEST_F(LowerJerk, ThanThatOfAStopNeitherTurnsNorSpeedsUpWhatFollowsIt) {
  const std::vector<std::function<void()>> followers = {
      [this] { x().moveTo(40.0); },
      [this] { x().jog(1.0); },
      [this] { send(machine::SetpointMode::kVelocity, 0.1, 0.9); },
  };
  for (const double jerk : {0.0, 4.0}) {
    for (std::size_t i = 0; i < followers.size(); ++i) {
      for (int after = 1; after < 10; ++after) {
        SCOPED_TRACE(testing::Message() << jerk << " m/s^3, " << i << ", after " << after);
        build(jerk);
        x().setLimits({0.0, 0.0, 0.0, 0.01});
        for (int k = 0; k < 300; ++k) {
          send(machine::SetpointMode::kVelocity, 0.1, 0.9);
          advance(0.05);
        }
        ASSERT_GT(velocity(), 0.5);
        if (after % 2 == 0) {
          x().stop();
        } else {
          advance(0.101);  // a stream that pauses comes to rest likewise
        }
        advance(0.05 * after);
        followers[i]();
        expectNoTurnAndNoHigherSpeed(1.0);
        EXPECT_EQ(bench->report().pulses_backward, 0);
      }
    }
  }
}

TEST_F(LowerJerk, ThanThatOfAHoldNeitherTurnsNorSpeedsUpALine) {
  for (int after = 1; after < 10; ++after) {
    SCOPED_TRACE(after);
    build(4.0);
    x().setLimits({0.0, 0.0, 0.0, 0.01});
    const machine::CoordinatedMove move = bench->machine->moveLine({{"x"}, {20.0}});
    advance(12.0);
    ASSERT_GT(velocity(), 0.5);
    bench->machine->hold();
    advance(0.05 * after);
    bench->machine->resume();
    expectNoTurnAndNoHigherSpeed(3.0);
    EXPECT_EQ(bench->machine->wait(move).end, MoveEnd::kReached);
    EXPECT_EQ(bench->report().pulses_backward, 0);
  }
}

TEST_F(AxisLimitsTest, AStopKeepsItsDeceleration) {
  x().setLimits({0.0, 0.0, 0.1, 0.0});
  x().jog(1.0);
  advance(2.0);
  x().stop();
  advance(0.002);
  EXPECT_NEAR(x().state().time_left, 0.499, 1e-4);
}

TEST_F(AxisLimitsTest, AHeldMoveGoesOnWithinThem) {
  const axis::Move move = x().moveTo(4.0);
  advance(1.0);
  bench->machine->hold();
  advance(1.0);
  x().setLimits({0.5, 0.5, 0.5, 0.0});
  bench->machine->resume();
  advance(0.501);
  EXPECT_NEAR(velocity(), 0.25, 1e-6);
  EXPECT_EQ(x().wait(move).end, MoveEnd::kReached);
}

// From 0.3 m/s with 2 m/s^2 and 20 m/s^3 it takes 0.25 s and less than 80 steps.
TEST_F(AxisLimitsTest, NoStopTakesLongerThanByTheConfiguredOnes) {
  const std::vector<std::function<void()>> stops = {
      [this] { x().stop(); },
      [this] { bench->machine->stop(); },
      [this] { bench->machine->hold(); },
      [this] { x().enable(false); },
      [this] { bench->machine->shutdown(); },
  };
  for (const bool line : {false, true}) {
    for (std::size_t i = 0; i < stops.size(); ++i) {
      SCOPED_TRACE(testing::Message() << "stop " << i << (line ? " of a line" : " of a move"));
      build(20.0);
      x().setLimits({0.0, 0.0, 0.0, 0.01});
      if (line) {
        bench->machine->moveLine({{"x"}, {40.0}});
      } else {
        x().moveTo(40.0);
      }
      for (int k = 0; k < 1000 && velocity() < 0.3; ++k) advance(0.1);
      ASSERT_NEAR(velocity(), 0.3, 0.02);
      const std::int64_t pulses = bench->pulses();
      const std::int64_t begin = bench->clock.now();
      stops[i]();
      for (int k = 0; k < 1000 && x().state().moving; ++k) advance(0.01);
      EXPECT_LE(static_cast<double>(bench->clock.now() - begin) * 1e-9, 0.30);
      EXPECT_LE(bench->pulses() - pulses, 80);
    }
  }
}

TEST_F(AxisLimitsTest, RefusesWhatIsBelowTheLowestOfAConfiguration) {
  build(20.0);
  struct Bad {
    AxisLimits limits;
    const char* words;
  };
  for (const Bad& bad : {
           Bad{{5e-324, 0, 0, 0},
               "the max_speed 4.94065646e-324 m/s is below the lowest, 1e-06 m/s"},
           Bad{{0, 5e-324, 0, 0}, "the acceleration 4.94065646e-324 m/s^2 is below the lowest"},
           Bad{{0, 0, 0.9e-6, 0}, "the deceleration 9e-07 m/s^2 is below the lowest"},
           Bad{{0, 0, 0, 0.9e-6}, "which is 0.001 steps/s^3"},
       }) {
    EXPECT_REFUSED(x().setLimits(bad.limits), bad.words);
  }
  EXPECT_EQ(x().limits().max_speed, 1.0);
  EXPECT_EQ(x().limits().acceleration, 2.0);
  x().setLimits({1e-6, 1e-6, 1e-6, 1e-6});
}

TEST_F(AxisLimitsTest, RefusesWhatIsBeyondTheConfiguredOnesAndChangesNothing) {
  build(4.0);
  struct Bad {
    AxisLimits limits;
    const char* words;
  };
  for (const Bad& bad :
       {Bad{{1.01, 0, 0, 0}, "the max_speed 1.01 m/s is above 1 m/s, from the configuration"},
        Bad{{0.5, 2.5, 0, 0},
            "the acceleration 2.5 m/s^2 is above 2 m/s^2, from the configuration"},
        Bad{{0.5, 0, 3, 0}, "the deceleration 3 m/s^2 is above 2 m/s^2, from the configuration"},
        Bad{{0.5, 0, 0, 5}, "the jerk 5 m/s^3 is above 4 m/s^3, from the configuration"},
        Bad{{-1, 0, 0, 0},
            "the max_speed is -1 m/s, but must be a finite number above 0, or 0 for the configured "
            "one"},
        Bad{{kNan, 0, 0, 0}, "the max_speed is nan m/s, but must be a finite number"},
        Bad{{0.5, kInfinity, 0, 0}, "the acceleration is inf m/s^2, but must be a finite number"},
        Bad{{0.5, 0, 0, kNan}, "the jerk is nan m/s^3, but must be a finite number"}}) {
    EXPECT_REFUSED(x().setLimits(bad.limits), bad.words);
    EXPECT_EQ(x().limits().max_speed, 1.0);
    EXPECT_EQ(x().limits().acceleration, 2.0);
    EXPECT_EQ(x().limits().jerk, 4.0);
  }
}

TEST_F(AxisLimitsTest, NamesWhoSetTheLimitThatRefuses) {
  config::AxisConfig config = linearAxis("x");
  config.max_position = 0.2;
  config.max_position_source = config::LimitSource::kRobotDescription;
  config.min_position = -0.1;
  config.max_speed_source = config::LimitSource::kRobotDescription;
  bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config});
  EXPECT_REFUSED(x().moveTo(0.21),
                 "0.21 m is above the soft limit max_position 0.2 m, from robot_description");
  EXPECT_REFUSED(x().moveTo(-0.11),
                 "-0.11 m is below the soft limit min_position -0.1 m, from the configuration");
  const double top = config.max_speed;
  EXPECT_REFUSED(x().moveTo(0.1, false, 2.0 * top), " m/s, from robot_description");
  EXPECT_REFUSED(x().setLimits({2.0 * top, 0.0, 0.0, 0.0}), " m/s, from robot_description");
  x().setLimits({0.5 * top, 0.0, 0.0, 0.0});
  EXPECT_REFUSED(x().moveTo(0.1, false, top), " m/s, from set_limits");
}

TEST_F(AxisLimitsTest, AxesThatMoveTogetherKeepWhatTheyBeganWith) {
  config::AxisConfig x_config = linearAxis("x");
  config::AxisConfig y_config = linearAxis("y");
  bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{x_config, y_config});
  motion::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.05, 0.025};
  const auto move = bench->machine->moveLine(line);
  advance(0.05);
  x().setLimits({0.01, 0.1, 0.1, 0.0});
  const auto result = bench->machine->wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached);
  EXPECT_NEAR(result.duration, move.duration, 1e-9);
  EXPECT_NEAR(bench->move(0.049).duration, 0.2, 1e-3) << "0.001 m at 0.01 m/s with 0.1 m/s^2";
}

TEST_F(AxisLimitsTest, AxesThatMoveTogetherStopAtOnceHoweverSlowTheyAre) {
  bench =
      std::make_unique<Bench>(std::vector<config::AxisConfig>{linearAxis("x"), linearAxis("y")});
  for (axis::Axis* axis : {&bench->axis("x"), &bench->axis("y")}) {
    axis->setLimits({1e-6, 0.0, 0.0, 0.0});
  }
  motion::LineRequest line;
  line.names = {"x", "y"};
  line.positions = {0.05, 0.025};
  const auto move = bench->machine->moveLine(line);
  advance(0.1);
  bench->machine->stop(move);
  advance(0.1);
  EXPECT_TRUE(bench->machine->result(move));
}

}  // namespace
}  // namespace stepdriver
