#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/constants.h"
#include "support/differences.h"
#include "support/refusal.h"

// Streams of setpoints, and messages for several axes. The position of an axis is that of the
// pulses; 100 microsteps/mm unless stated otherwise.

namespace stepdriver {
namespace {

using machine::SetpointMode;
using machine::StreamMessage;
using test::Bench;
using test::Crossing;
using test::Differences;
using test::kPi;
using test::linearAxis;
using test::violationsOf;

constexpr double kScale = 100'000.0;  // microsteps/m
constexpr double kTimeout = 0.1;      // s

config::AxisConfig configOf(const std::string& name, double jerk = 0.0) {
  config::AxisConfig config = linearAxis(name, kScale, 0.2, 2.0);
  config.jerk = jerk;
  return config;
}

class Setpoints : public testing::Test {
 protected:
  void build(const std::vector<config::AxisConfig>& configs) {
    bench = std::make_unique<Bench>(configs);
    began = bench->clock.now();
  }
  void SetUp() override { build({configOf("x"), configOf("y")}); }

  axis::Axis& x() { return bench->axis(); }
  void advance(double seconds) { bench->machine->advance(seconds); }
  double now() { return static_cast<double>(bench->clock.now() - began) * 1e-9; }
  double place() { return static_cast<double>(bench->pulses()) / kScale; }

  std::vector<std::string> send(SetpointMode mode, const std::vector<StreamMessage>& messages) {
    return bench->machine->followSetpoints(mode, kTimeout, messages);
  }
  void expectTaken(SetpointMode mode, double value, const std::string& axis = "x") {
    for (const std::string& why : send(mode, {{axis, value, {}}})) EXPECT_EQ(why, "");
  }

  /// A stream of positions. @return how far the axis ever was from where the stream was `lag` ago
  /// [m], from the time `settled` on.
  double stream(const std::function<double(double)>& position, double period, double duration,
                double lag, double settled) {
    const double start = now();
    double worst = 0.0;
    for (int i = 0; i < static_cast<int>(std::lround(duration / period)); ++i) {
      const double sent = now() - start;
      expectTaken(SetpointMode::kPosition, position(sent));
      while (now() - start < static_cast<double>(i + 1) * period - 1e-9) {
        advance(std::min(0.0005, static_cast<double>(i + 1) * period - (now() - start)));
        const double at = now() - start;
        if (at < settled) continue;
        worst = std::max(worst, std::abs(place() - position(at - lag)));
      }
    }
    return worst;
  }

  /// The crossings of half-step lines of an axis, by its edges.
  std::vector<Crossing> crossings(const std::string& axis = "x") {
    const int step = bench->trace->pin(axis, "step");
    const int dir = bench->trace->pin(axis, "dir");
    bool forward = bench->trace->levels()[static_cast<std::size_t>(dir)];
    double count = 0.0;
    std::vector<Crossing> found;
    for (const auto& edge : bench->trace->edges()) {
      if (edge.pin == dir) forward = edge.level;
      if (edge.pin != step || !edge.level) continue;
      count += forward ? 1.0 : -1.0;
      found.push_back({edge.time_ns, forward ? count - 0.5 : count + 0.5});
    }
    return found;
  }
  std::int64_t firstStep(const std::string& axis) {
    const std::vector<Crossing> found = crossings(axis);
    return found.empty() ? 0 : found.front().time_ns;
  }
  void expectClean() {
    for (const auto& axis : bench->machine->axes()) {
      EXPECT_EQ(violationsOf(bench->report(axis->config().name)), "");
      EXPECT_EQ(std::llround(axis->state().position * kScale), bench->pulses(axis->config().name));
    }
    EXPECT_EQ(bench->machine->figures().slips, 0U);
  }
  void expectWithinLimits(const config::AxisConfig& config, const std::string& axis = "x") {
    const double apart = 0.002;
    const Differences most = test::differencesOf(crossings(axis), apart);
    EXPECT_LE(most.speed, config.max_speed * kScale * (1.0 + 1e-9) + 2e-9 / apart * 2e4);
    EXPECT_LE(most.acceleration, config.acceleration * kScale + 4.0 * 2e4 * 1e-9 / apart / apart);
    if (config.jerk > 0.0) {
      EXPECT_LE(most.jerk, config.jerk * kScale + 8.0 * 2e4 * 1e-9 / apart / apart / apart);
    }
  }

  std::unique_ptr<Bench> bench;
  std::int64_t began = 0;
};

// ---- positions ----

TEST_F(Setpoints, ALonePositionIsReachedAsByAMove) {
  expectTaken(SetpointMode::kPosition, 0.002);
  advance(kTimeout);
  EXPECT_FALSE(x().state().moving);
  EXPECT_EQ(bench->pulses(), 200);
  expectClean();
}

TEST_F(Setpoints, AStreamIsFollowedAtMostOnePeriodAndTwoMillisecondsLater) {
  for (const double jerk : {0.0, 200.0}) {
    for (const double rate : {20.0, 50.0, 100.0, 250.0, 500.0}) {
      const config::AxisConfig config = configOf("x", jerk);
      build({config});
      const double period = 1.0 / rate;
      // At most 0.063 m/s and 0.4 m/s^2; it begins without a jump of speed.
      const auto wave = [](double t) {
        return t <= 0.0 ? 0.0 : 0.005 * (1.0 - std::cos(2.0 * kPi * t));
      };
      // Between two lags lies what the stream does in their difference.
      const double slack = 0.063 * (period + 0.002) / 2.0 + 1.0 / kScale;
      const double settled = 10.0 * period;
      const double worst = stream(wave, period, 1.5, (period + 0.002) / 2.0, settled);
      EXPECT_LE(worst, slack) << rate << " Hz, jerk " << jerk;
      expectWithinLimits(config);
      expectClean();
    }
  }
}

TEST_F(Setpoints, AStreamDoesNotStopBetweenItsMessages) {
  const double speed = 0.05;
  for (const double rate : {20.0, 100.0, 500.0}) {
    build({configOf("x")});
    stream([=](double t) { return speed * t; }, 1.0 / rate, 1.0, 0.0, 1e9);
    const std::vector<Crossing> found = crossings();
    ASSERT_GT(found.size(), 4000U);
    const std::int64_t even = std::llround(1e9 / (speed * kScale));
    std::int64_t longest = 0;
    for (std::size_t i = found.size() / 2; i < found.size(); ++i) {
      longest = std::max(longest, found[i].time_ns - found[i - 1].time_ns);
    }
    EXPECT_NEAR(static_cast<double>(longest), static_cast<double>(even), 2.0) << rate << " Hz";
    expectWithinLimits(configOf("x"));
    expectClean();
  }
}

TEST_F(Setpoints, AStreamThatIsTooFastIsFollowedAtTheLimitAndCaughtUpWith) {
  for (const double jerk : {0.0, 200.0}) {
    const config::AxisConfig config = configOf("x", jerk);
    build({config});
    const auto rush = [](double t) { return std::clamp(0.4 * t, 0.0, 0.06); };
    const double worst = stream(rush, 0.01, 0.8, 0.01, 0.6);
    EXPECT_LE(worst, 1.0 / kScale) << "0.06 m at 0.2 m/s and 2 m/s^2 take 0.4 s";
    expectWithinLimits(config);
    expectClean();
  }
}

TEST_F(Setpoints, AJumpOfThePositionIsMadeWithinTheLimits) {
  for (const double jerk : {0.0, 200.0}) {
    const config::AxisConfig config = configOf("x", jerk);
    build({config});
    const auto jumps = [](double t) { return std::fmod(t, 0.5) < 0.25 ? 0.0 : 0.01; };
    stream(jumps, 0.02, 1.2, 0.0, 1e9);
    expectWithinLimits(config);
    expectClean();
  }
}

TEST_F(Setpoints, ARegularStreamWhoseMessagesComeIrregularlyIsFollowedEvenly) {
  const double speed = 0.05;
  const double period = 0.01;
  for (int i = 1; i < 150; ++i) {
    expectTaken(SetpointMode::kPosition, speed * period * i);
    const double next = period * (i + 1) + (i % 3 == 0 ? 0.001 : i % 3 == 1 ? -0.001 : 0.0);
    advance(next - now());
    if (i < 50) continue;
    EXPECT_NEAR(x().state().velocity, speed, 0.1 * speed) << i;
  }
  expectWithinLimits(configOf("x"));
  expectClean();
}

TEST_F(Setpoints, WithoutAnotherMessageTheAxisRestsOnTheLastPosition) {
  const double speed = 0.05;
  stream([=](double t) { return speed * t; }, 0.01, 0.5, 0.0, 1e9);
  advance(kTimeout);
  EXPECT_FALSE(x().state().moving);
  EXPECT_EQ(bench->pulses(), std::lround(speed * 0.49 * kScale));
  expectWithinLimits(configOf("x"));
  expectClean();
}

// They come within the timeout, but more slowly than any stream: nothing says that the next one
// lies farther in their direction.
TEST_F(Setpoints, PositionsThatComeMoreSlowlyThanAStreamAreNeverPassed) {
  for (const double jerk : {0.0, 200.0}) {
    for (const double interval : {0.08, 0.1, 0.125, 0.2, 0.5, 2.0}) {
      build({configOf("x", jerk)});
      double highest = 0.0;
      for (int i = 1; i <= 8; ++i) {
        const double position = 0.001 * i;
        const auto refused =
            bench->machine->followSetpoints(SetpointMode::kPosition, 5.0, {{"x", position, {}}});
        EXPECT_EQ(refused.front(), "");
        // No other one comes after the last one.
        const double until = i < 8 ? interval : 3.0 * interval;
        for (double waited = 0.0; waited < until; waited += 0.0005) {
          advance(0.0005);
          highest = std::max(highest, place());
          EXPECT_LE(highest, position + 0.5 / kScale) << interval << " s, jerk " << jerk;
        }
      }
      expectClean();
    }
  }
}

// A stream of 20 Hz that becomes slower is no stream any more from its first long interval on.
TEST_F(Setpoints, AStreamThatBecomesTooSlowEndsWithItsLongInterval) {
  double sent = 0.0;
  const auto set_position = [&] {
    sent += 0.001;
    const auto refused =
        bench->machine->followSetpoints(SetpointMode::kPosition, 5.0, {{"x", sent, {}}});
    EXPECT_EQ(refused.front(), "");
  };
  for (int i = 0; i < 10; ++i) {
    set_position();
    advance(0.05);
  }
  advance(0.05);
  for (int i = 0; i < 5; ++i) {
    set_position();
    for (int k = 0; k < 200; ++k) {
      advance(0.0005);
      // When the first one comes, it has already passed the last one of the stream.
      EXPECT_TRUE(i == 0 || place() <= sent + 0.5 / kScale) << place() << " m, beyond " << sent;
    }
  }
  expectClean();
}

TEST_F(Setpoints, SilenceBringsTheAxisToRestWithinTheTimeoutAndItsDeceleration) {
  expectTaken(SetpointMode::kPosition, 0.09);
  advance(kTimeout + 0.001);
  EXPECT_TRUE(x().state().moving);
  // It begins 1 ms after the message.
  const double fastest = 2.0 * (kTimeout - 0.001);
  EXPECT_NEAR(x().state().velocity, fastest - 2.0 * 0.001, 1e-4);
  advance(fastest / 2.0);
  EXPECT_FALSE(x().state().moving);
  EXPECT_NEAR(place(), fastest * fastest / 2.0, 1.0 / kScale);
  expectWithinLimits(configOf("x"));
  expectClean();
}

TEST_F(Setpoints, APositionBeyondASoftLimitIsReplacedByTheLimit) {
  config::AxisConfig config = configOf("x");
  config.min_position = -0.01;
  config.max_position = 0.02;
  for (const double sign : {1.0, -1.0}) {
    build({config});
    double farthest = 0.0;
    for (int i = 0; i < 100; ++i) {
      expectTaken(SetpointMode::kPosition, sign * 0.001 * i);
      advance(0.01);
      farthest = std::max(farthest, sign * place());
    }
    EXPECT_EQ(farthest, sign > 0.0 ? 0.02 : 0.01);
    EXPECT_EQ(place(), sign * farthest);
    expectWithinLimits(config);
    expectClean();
  }
}

TEST_F(Setpoints, ABacklashIsTakenUpAtEachTurn) {
  config::AxisConfig config = configOf("x");
  config.backlash = 0.0005;
  build({config});
  const auto wave = [](double t) { return 0.005 * (1.0 - std::cos(2.0 * kPi * t)); };
  stream(wave, 0.02, 1.75, 0.0, 1e9);
  advance(kTimeout);
  EXPECT_NEAR(x().state().position, wave(1.74), 1.0 / kScale);
  expectWithinLimits(config);
  EXPECT_EQ(violationsOf(bench->report()), "");
}

// To join the stream, which rises, the axis would pass its soft limit. It goes straight to the last
// position, which lies below it: the backlash is opened, not taken up.
TEST_F(Setpoints, AStreamThatWouldLeadBeyondASoftLimitEndsOnItsPositionFromAbove) {
  config::AxisConfig config = configOf("x");
  config.backlash = 0.0005;
  config.max_position = 0.05;
  for (const double period : {0.001, 0.002, 0.003, 0.005}) {
    build({config});
    ASSERT_EQ(bench->move(0.04995).end, axis::MoveEnd::kReached);
    expectTaken(SetpointMode::kPosition, 0.0496);
    advance(period);
    expectTaken(SetpointMode::kPosition, 0.0499);
    advance(1.0);
    EXPECT_NEAR(x().state().position, 0.0499, 1e-9) << period;
    EXPECT_EQ(x().state().slack, 0.0) << period;
  }
}

TEST_F(Setpoints, APositionAtWhichTheAxisStandsMovesNothing) {
  for (int i = 0; i < 20; ++i) {
    expectTaken(SetpointMode::kPosition, 0.0);
    advance(0.01);
    EXPECT_FALSE(x().state().moving);
  }
  EXPECT_TRUE(crossings().empty());
}

// ---- velocities ----

TEST_F(Setpoints, VelocitiesAreFollowedWithinTheAccelerationAndEndWithTheTimeout) {
  for (int i = 1; i <= 50; ++i) {
    expectTaken(SetpointMode::kVelocity, 0.1 * std::sin(2.0 * kPi * 0.02 * i));
    advance(0.02);
    EXPECT_NEAR(x().state().velocity, 0.1 * std::sin(2.0 * kPi * 0.02 * i), 1e-6) << i;
  }
  expectTaken(SetpointMode::kVelocity, 0.05);
  advance(kTimeout);
  EXPECT_NEAR(x().state().velocity, 0.05, 1e-6);
  advance(0.05 / 2.0 + 0.002);
  EXPECT_FALSE(x().state().moving);
  expectWithinLimits(configOf("x"));
  expectClean();
}

TEST_F(Setpoints, AVelocityEndsAtTheSoftLimit) {
  config::AxisConfig config = configOf("x");
  config.max_position = 0.02;
  build({config});
  for (int i = 0; i < 60; ++i) {
    const std::string why = send(SetpointMode::kVelocity, {{"x", 0.1, {}}}).front();
    if (x().state().moving || i == 0) {
      EXPECT_EQ(why, "");
    }
    advance(0.01);
    EXPECT_LE(place(), 0.02);
  }
  EXPECT_EQ(place(), 0.02);
  EXPECT_NE(send(SetpointMode::kVelocity, {{"x", 0.1, {}}}).front().find("soft limit"),
            std::string::npos);
  expectClean();
}

TEST_F(Setpoints, AVelocityOfZeroLeavesOtherMotionsAlone) {
  const axis::Move move = x().moveTo(0.01);
  advance(0.02);
  expectTaken(SetpointMode::kVelocity, 0.0);
  EXPECT_EQ(x().wait(move).end, axis::MoveEnd::kReached);
  expectTaken(SetpointMode::kVelocity, 0.05);
  advance(0.05);
  expectTaken(SetpointMode::kVelocity, 0.0);
  advance(0.03);
  EXPECT_FALSE(x().state().moving);
  expectClean();
}

TEST_F(Setpoints, TheEndOfAJogLeavesSetpointsAloneAndTheOtherWayRound) {
  expectTaken(SetpointMode::kVelocity, 0.05);
  advance(0.05);
  x().jog(0.0);
  advance(0.02);
  EXPECT_NEAR(x().state().velocity, 0.05, 1e-9);
  x().jog(0.05);
  expectTaken(SetpointMode::kVelocity, 0.0);
  advance(2.0 * kTimeout);
  EXPECT_NEAR(x().state().velocity, 0.05, 1e-9);
}

// ---- other commands ----

TEST_F(Setpoints, AStreamDoesNotContinueThroughWhatStopsTheAxis) {
  const std::vector<std::function<void()>> stops = {[this] { x().stop(); },
                                                    [this] { bench->machine->stop(); },
                                                    [this] {
                                                      bench->machine->hold();
                                                      advance(0.2);
                                                      bench->machine->resume();
                                                    },
                                                    [this] {
                                                      x().enable(false);
                                                      x().enable(true);
                                                    },
                                                    [this] {
                                                      bench->machine->emergencyStop();
                                                      bench->machine->recover();
                                                    }};
  for (const auto& stop : stops) {
    for (const SetpointMode mode : {SetpointMode::kPosition, SetpointMode::kVelocity}) {
      build({configOf("x")});
      const std::uint64_t since = x().state().stops;
      const auto next = [&](int i) {
        return mode == SetpointMode::kPosition ? 0.0005 * (i + 1) : 0.05;
      };
      for (int i = 0; i < 20; ++i) {
        EXPECT_EQ(send(mode, {{"x", next(i), since}}).front(), "");
        advance(0.01);
      }
      stop();
      advance(0.3);
      const std::int64_t rest = bench->pulses();
      for (int i = 20; i < 30; ++i) {
        EXPECT_NE(send(mode, {{"x", next(i), since}}).front().find("were stopped"),
                  std::string::npos);
        advance(0.01);
      }
      EXPECT_EQ(bench->pulses(), rest);
      EXPECT_FALSE(x().state().moving);
    }
  }
}

TEST_F(Setpoints, AMoveTakesOverFromASetpointAndTheOtherWayRound) {
  expectTaken(SetpointMode::kPosition, 0.05);
  advance(0.05);
  const axis::Move move = x().moveTo(-0.01);
  advance(0.05);
  expectTaken(SetpointMode::kPosition, 0.001);
  const axis::MoveResult replaced = x().wait(move);
  EXPECT_EQ(replaced.end, axis::MoveEnd::kReplaced);
  EXPECT_NE(replaced.message.find("a setpoint took over"), std::string::npos) << replaced.message;
  advance(kTimeout + 0.1);
  EXPECT_FALSE(x().state().moving);
  expectWithinLimits(configOf("x"));
  expectClean();
}

// The velocity of a stream between the setpoints before and after another command is none.
TEST_F(Setpoints, ASetpointAfterAnotherCommandIsReachedAsByAMove) {
  const std::vector<std::function<void()>> commands = {
      [this] { x().moveTo(0.009); }, [this] { x().jog(0.03); },
      [this] {
        bench->machine->moveLine({{"x", "y"}, {0.009, 0.002}});
      }};
  for (const auto& command : commands) {
    build({configOf("x"), configOf("y")});
    const auto set_position = [this](double position) {
      constexpr double kLongTimeout = 0.5;  // s
      const auto refused = bench->machine->followSetpoints(SetpointMode::kPosition, kLongTimeout,
                                                           {{"x", position, {}}});
      EXPECT_EQ(refused.front(), "");
    };
    set_position(0.006);
    advance(0.04);
    command();
    advance(0.04);
    set_position(0.001);
    double lowest = place();
    while (x().state().moving) {
      advance(0.001);
      lowest = std::min(lowest, place());
    }
    EXPECT_EQ(bench->pulses(), 100);
    EXPECT_EQ(std::lround(lowest * kScale), 100);
    expectWithinLimits(configOf("x"));
    expectClean();
  }
}

TEST_F(Setpoints, NothingIsDoneWithWhatIsNoNumber) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const std::vector<std::string> why =
      send(SetpointMode::kPosition, {{"x", nan, {}}, {"y", 0.001, {}}});
  EXPECT_NE(why[0].find("must be a finite number"), std::string::npos) << why[0];
  EXPECT_EQ(why[1], "");
  advance(kTimeout);
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 100);
}

TEST_F(Setpoints, AMessageThatNamesNoAxisOrOneTwiceMovesNothing) {
  const std::vector<StreamMessage> unknown = {{"x", 0.01, {}}, {"q", 0.01, {}}};
  EXPECT_REFUSED(send(SetpointMode::kPosition, unknown), "there is no axis q");
  const std::vector<StreamMessage> twice = {{"x", 0.01, {}}, {"x", 0.02, {}}};
  EXPECT_REFUSED(send(SetpointMode::kPosition, twice), "named twice");
  EXPECT_REFUSED(bench->machine->jog(unknown).clear(), "there is no axis q");
  advance(kTimeout);
  EXPECT_EQ(bench->pulses("x"), 0);
}

// ---- several axes ----

TEST_F(Setpoints, OneMessageStartsAllItsAxesAtTheSameNanosecond) {
  const auto start = [this](const std::string& what, const std::function<void()>& begin) {
    const std::int64_t x_first = firstStep("x");
    const std::int64_t y_first = firstStep("y");
    EXPECT_EQ(x_first, 0);
    EXPECT_EQ(y_first, 0);
    begin();
    advance(0.05);
    EXPECT_NE(firstStep("x"), 0) << what;
    EXPECT_EQ(firstStep("x"), firstStep("y")) << what;
  };
  start("jog", [this] {
    for (const std::string& why : bench->machine->jog({{"y", 0.05, {}}, {"x", 0.05, {}}})) {
      EXPECT_EQ(why, "");
    }
  });
  build({configOf("x"), configOf("y")});
  start("setpoint", [this] {
    for (const std::string& why :
         send(SetpointMode::kPosition, {{"x", 0.01, {}}, {"y", -0.01, {}}})) {
      EXPECT_EQ(why, "");
    }
  });
  // They change their velocities at the same time too.
  for (const std::string& why : bench->machine->jog({{"x", 0.04, {}}, {"y", -0.04, {}}})) {
    EXPECT_EQ(why, "");
  }
  advance(0.1);
  std::vector<Crossing> of_x = crossings("x");
  std::vector<Crossing> of_y = crossings("y");
  ASSERT_EQ(of_x.size(), of_y.size());
  for (std::size_t i = 0; i < of_x.size(); ++i) {
    EXPECT_EQ(of_x[i].time_ns, of_y[i].time_ns) << i;
    EXPECT_EQ(of_x[i].position, -of_y[i].position) << i;
  }
}

TEST_F(Setpoints, AxesThatAreIdleAreWokenBeforeOneMessageStartsThem) {
  config::AxisConfig idle = configOf("y");
  idle.idle_timeout = 0.5;
  idle.driver.timing.enable_ns = 50'000'000;
  build({configOf("x"), idle});
  advance(1.0);
  ASSERT_TRUE(bench->axis("y").state().idle);
  for (const std::string& why : bench->machine->jog({{"x", 0.05, {}}, {"y", 0.05, {}}})) {
    EXPECT_EQ(why, "");
  }
  advance(0.2);
  EXPECT_NE(firstStep("x"), 0);
  EXPECT_EQ(firstStep("x"), firstStep("y"));
  expectClean();
}

TEST_F(Setpoints, AnAxisThatRefusesDoesNotKeepTheOthersFromMoving) {
  bench->axis("y").enable(false);
  const std::vector<std::string> why = bench->machine->jog({{"y", 0.05, {}}, {"x", 0.05, {}}});
  EXPECT_NE(why[0].find("y: disabled"), std::string::npos) << why[0];
  EXPECT_EQ(why[1], "");
  advance(0.05);
  EXPECT_GT(bench->pulses("x"), 0);
  EXPECT_EQ(bench->pulses("y"), 0);
}

// The rounding of a calculation: to the soft limit it would take a million years.
TEST_F(Setpoints, AVelocityThatMakesNoStepIsRestAndLetsTheOthersMove) {
  for (const std::string& why : bench->machine->jog({{"x", 1e-17, {}}, {"y", 0.05, {}}})) {
    EXPECT_EQ(why, "");
  }
  advance(0.05);
  EXPECT_FALSE(x().state().moving);
  EXPECT_GT(bench->pulses("y"), 0);
  EXPECT_EQ(bench->machine->jog({{"x", 0.0, {}}, {"y", 1e-17, {}}}),
            (std::vector<std::string>{"", ""}));
  advance(1.0);
  EXPECT_FALSE(bench->axis("y").state().moving);
}

TEST_F(Setpoints, AxesThatBeganTogetherAreIndependent) {
  for (const std::string& why : bench->machine->jog({{"x", 0.05, {}}, {"y", 0.05, {}}})) {
    EXPECT_EQ(why, "");
  }
  x().stop();  // before the first step
  advance(0.1);
  EXPECT_EQ(bench->pulses("x"), 0);
  EXPECT_NEAR(bench->axis("y").state().velocity, 0.05, 1e-9);
  bench->axis("x").moveTo(0.01);
  advance(0.02);
  EXPECT_NEAR(bench->axis("y").state().velocity, 0.05, 1e-9);
  bench->axis("y").stop();
  advance(0.01);
  EXPECT_TRUE(x().state().moving);
  advance(1.0);
  EXPECT_EQ(bench->pulses("x"), 1000);
  expectClean();
}

TEST_F(Setpoints, AHoldEndsAJogThatWaitsForItsMotors) {
  config::AxisConfig idle = configOf("x");
  idle.idle_timeout = 0.5;
  config::AxisConfig other = configOf("y");
  other.idle_timeout = 0.5;
  build({idle, other});
  advance(1.0);
  bench->machine->hold();
  const std::vector<std::string> why = bench->machine->jog({{"x", 0.05, {}}, {"y", 0.05, {}}});
  EXPECT_NE(why[0].find("on hold"), std::string::npos) << why[0];
  bench->machine->resume();
  advance(0.3);
  EXPECT_EQ(bench->pulses("x"), 0);
}

}  // namespace
}  // namespace stepdriver
