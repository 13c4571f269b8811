#include <gtest/gtest.h>

#include <cerrno>
#include <cmath>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/homing_bench.h"

// How a homing ends if it doesn't find its switch, and what it takes for a glitch.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingPhase;
using axis::HomingResult;
using test::homingAxis;
using test::HomingTest;
using test::kStep;
using test::violationsOf;

class HomingFailure : public HomingTest {
 protected:
  /// Expects the axis not homed, at rest and enabled, and these words in the message.
  void expectFailed(const HomingResult& result, const std::string& words,
                    HomingEnd end = HomingEnd::kFailed) {
    EXPECT_EQ(result.end, end);
    EXPECT_NE(result.message.find(words), std::string::npos) << result.message;
    EXPECT_EQ(result.message.rfind("x isn't homed: ", 0), 0U) << result.message;
    const axis::AxisState state = x().state();
    EXPECT_FALSE(state.homed);
    EXPECT_FALSE(state.moving);
    EXPECT_TRUE(state.enabled);
    EXPECT_EQ(state.homing, HomingPhase::kNone);
    EXPECT_DOUBLE_EQ(result.position, state.position);
  }

  void stick(std::optional<bool> min, std::optional<bool> max = {}) {
    sim::RigFaults faults;
    faults.min_stuck = min;
    faults.max_stuck = max;
    bench->rig.setFaults("x", faults);
  }

  /// Homes, and calls a function once the axis has moved this far in a phase [steps].
  HomingResult homeAnd(HomingPhase phase, std::int64_t steps, const std::function<void()>& action) {
    std::optional<std::int64_t> entered;
    bool done = false;
    return x().home([&, phase, steps] {
      if (done || x().state().homing != phase) return false;
      if (!entered) entered = bench->pulses();
      if (std::abs(bench->pulses() - *entered) < steps) return false;
      done = true;
      action();
      return false;
    });
  }
};

TEST_F(HomingFailure, SaysThatTheSwitchNeverCloses) {
  config::AxisConfig config = homingAxis();
  config.homing->max_travel = 0.06;
  build(config);
  expectFailed(x().home(), "the min switch didn't close within max_travel, 0.06 m");
  EXPECT_EQ(bench->pulses(), -4800);
}

TEST_F(HomingFailure, SaysThatTheSwitchDoesNotCloseInTime) {
  config::AxisConfig config = homingAxis();
  config.homing->timeout = 1.0;
  build(config);
  expectFailed(x().home(), "the min switch didn't close within timeout_s, 1 s");
  // 50 mm/s for a second, and a ramp down.
  EXPECT_NEAR(carriage(), -0.05, 0.002);
}

TEST_F(HomingFailure, SaysThatTheSwitchNeverOpens) {
  config::AxisConfig config = homingAxis();
  config.homing->max_travel = 0.02;
  build(config);
  stick(true);
  expectFailed(x().home(), "the min switch didn't open within max_travel, 0.02 m");
  EXPECT_EQ(bench->pulses(), 1600);
}

TEST_F(HomingFailure, SaysThatTheSwitchDoesNotOpenInTime) {
  config::AxisConfig config = homingAxis();
  config.homing->timeout = 2.0;
  build(config);
  stick(true);
  expectFailed(x().home(), "the min switch didn't open within timeout_s, 2 s");
}

TEST_F(HomingFailure, SaysThatTheSwitchDoesNotCloseAgain) {
  config::AxisConfig config = homingAxis();
  config.homing->max_travel = 0.12;
  build(config);
  const auto broken = [this] { stick(false); };
  expectFailed(homeAnd(HomingPhase::kLatching, 1, broken),
               "the min switch didn't close again within max_travel");
}

TEST_F(HomingFailure, SaysThatItMetTheOtherEndstop) {
  stick(true);
  expectFailed(x().home(), "the max endstop was met while leaving");
}

TEST_F(HomingFailure, SaysThatTheSwitchBouncesWithoutEnd) {
  build(homingAxis(), [](sim::RigAxisSpec& spec) {
    spec.min_switch->bounces = 1'000'000;
    spec.min_switch->bounce_ns = 700'000;
  });
  expectFailed(x().home(), "the min switch bounces without end");
}

TEST_F(HomingFailure, SaysWhyOfAStopInAnyPhase) {
  for (const HomingPhase phase : {HomingPhase::kSeeking, HomingPhase::kBackingOff,
                                  HomingPhase::kLatching, HomingPhase::kPullingOff}) {
    build(homingAxis());
    expectFailed(homeAnd(phase, 3, [this] { x().stop(); }), "it was stopped");
    EXPECT_EQ(violationsOf(bench->report()), "");
  }
}

TEST_F(HomingFailure, EndsWithAStopWhileTheSwitchSettles) {
  // Between two strokes no motion is under way that a stop could end.
  bool done = false;
  const HomingResult result = x().home([&] {
    if (done || !x().endstops().min.value_or(false)) return false;
    if (x().state().velocity != 0.0) return false;
    done = true;
    x().stop();
    return false;
  });
  expectFailed(result, "it was stopped");
  EXPECT_NEAR(carriage(), -0.1, kStep);
}

TEST_F(HomingFailure, DeceleratesWhenItIsCancelled) {
  bool cancel = false;
  const HomingResult result = x().home([&] {
    cancel = cancel || bench->pulses() < -2000;
    return cancel;
  });
  expectFailed(result, "it was cancelled", HomingEnd::kCancelled);
  // 50 mm/s at 1000 mm/s^2: 1.25 mm.
  EXPECT_NEAR(static_cast<double>(-bench->pulses()), 2000.0 + 100.0, 10.0);
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(HomingFailure, DoesNotBeginWhereItIsCancelledBefore) {
  expectFailed(x().home([] { return true; }), "it was cancelled", HomingEnd::kCancelled);
  EXPECT_LE(std::abs(bench->pulses()), 10);
}

TEST_F(HomingFailure, SaysThatAnotherCommandTookOver) {
  axis::Move move;
  const auto other = [&] { move = x().moveTo(0.01); };
  const HomingResult result = homeAnd(HomingPhase::kSeeking, 1000, other);
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_EQ(result.message, "x isn't homed: another command took over");
  EXPECT_FALSE(x().state().homed);
  EXPECT_EQ(x().wait(move).end, axis::MoveEnd::kReached);
  EXPECT_EQ(bench->pulses(), 800);
}

TEST_F(HomingFailure, SaysThatItWasDisabled) {
  const HomingResult result = homeAnd(HomingPhase::kSeeking, 1000, [this] { x().enable(false); });
  EXPECT_NE(result.message.find("it was disabled"), std::string::npos) << result.message;
  EXPECT_FALSE(x().state().homed);
  EXPECT_FALSE(x().state().enabled);
}

TEST_F(HomingFailure, SaysThatItIsTheEmergencyStop) {
  expectFailed(homeAnd(HomingPhase::kLatching, 3, [this] { bench->machine->emergencyStop(); }),
               "emergency stop");
  bench->machine->recover();
  expectHomed(x().home());
}

TEST_F(HomingFailure, SaysThatALineFails) {
  bench->rig.failWrites("x.step", 2000, EIO);
  expectFailed(x().home(), "the STEP line x.step can't be written");
}

TEST_F(HomingFailure, EndsWithTheMachine) {
  const HomingResult result =
      homeAnd(HomingPhase::kSeeking, 1000, [this] { bench->machine->shutdown(); });
  EXPECT_NE(result.message.find("the machine was shut down"), std::string::npos) << result.message;
}

// ---- bounces and glitches ----

TEST_F(HomingFailure, TakesTheFirstContactOfASwitchThatBounces) {
  build(homingAxis(), [](sim::RigAxisSpec& spec) {
    spec.min_switch->bounces = 4;
    spec.min_switch->bounce_ns = 1'200'000;  // the latch makes a step in 2.5 ms
  });
  expectHomed(x().home());
  EXPECT_NEAR(x().state().position - -0.1, carriage() + 0.1 - 0.5 * kStep, 1e-9);
}

// The switch opens again for less than the debounce time after the latch has ended; the contact
// after that comes too late to count.
TEST_F(HomingFailure, TakesNoContactForTheFirstThatComesAfterTheLatch) {
  std::int64_t ended = 0;
  int changes = 0;
  const HomingResult result = x().home([&] {
    const std::int64_t now = bench->clock.now();
    const axis::AxisState state = x().state();
    if (ended == 0 && state.homing == HomingPhase::kLatching && *x().endstops().min &&
        state.velocity == 0.0) {
      ended = now;
    }
    if (ended != 0 && changes == 0 && now - ended > 2'000'000) {
      ++changes;
      stick(false);
    } else if (changes == 1 && now - ended > 5'000'000) {
      ++changes;
      stick({});
    }
    return false;
  });
  EXPECT_EQ(changes, 2);
  expectHomed(result);
  EXPECT_NEAR(x().state().position - -0.1, carriage() + 0.1 - 0.5 * kStep, 1e-9);
}

TEST_F(HomingFailure, GoesOnAfterAGlitchThatIsShorterThanTheDebounce) {
  for (const HomingPhase phase : {HomingPhase::kSeeking, HomingPhase::kLatching}) {
    build(homingAxis());
    std::int64_t began = 0;
    bool over = false;
    const HomingResult result = x().home([&] {
      if (!over && began == 0 && x().state().homing == phase && x().state().velocity < -0.004) {
        began = bench->clock.now();
        stick(true);
      }
      if (!over && began != 0 && bench->clock.now() - began > 3'000'000) {
        over = true;
        stick({});
      }
      return false;
    });
    EXPECT_TRUE(over);
    expectHomed(result);
    EXPECT_EQ(violationsOf(bench->report()), "");
  }
}

}  // namespace
}  // namespace stepdriver
