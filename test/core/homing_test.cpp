#include <gtest/gtest.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/bench.h"
#include "support/refusal.h"

// Homing on the rig: 80 steps/mm, switches at -100 mm and 100 mm.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingPhase;
using axis::HomingResult;
using test::Bench;
using test::linearAxis;
using test::violationsOf;

constexpr double kStep = 1.0 / 80'000.0;  // [m]

/// Towards min at 50 mm/s, latched at 5 mm/s, 2 mm off the trigger point, which is at -0.1 m.
axis::AxisConfig homingAxis(const std::string& name = "x") {
  axis::AxisConfig config = linearAxis(name);
  axis::HomingConfig homing;
  homing.seek_speed = 0.05;
  homing.latch_speed = 0.005;
  homing.pull_off = 0.002;
  homing.offset = -0.1;
  homing.max_travel = 0.3;
  config.homing = homing;
  return config;
}

class HomingTest : public testing::Test {
 protected:
  void build(const axis::AxisConfig& config,
             const std::function<void(sim::RigAxisSpec&)>& change = {}) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    if (change) change(specs[0]);
    bench = std::make_unique<Bench>(std::vector<axis::AxisConfig>{config}, specs);
  }
  void SetUp() override { build(homingAxis()); }

  axis::Axis& x() { return bench->axis(); }
  double carriage() { return bench->report().carriage / 1000.0; }

  /// Homed, with the trigger point at the offset, whose place on the rig is `place` [m].
  void expectHomed(const HomingResult& result, double place = -0.1) {
    EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
    const axis::AxisState state = x().state();
    EXPECT_TRUE(state.homed);
    EXPECT_TRUE(state.position_valid);
    EXPECT_FALSE(state.moving);
    EXPECT_TRUE(state.enabled);
    EXPECT_EQ(state.homing, HomingPhase::kNone);
    EXPECT_DOUBLE_EQ(result.position, state.position);
    const double offset = x().config().homing->offset;
    EXPECT_NEAR(state.position - offset, carriage() - place, kStep);
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(HomingTest, TakesTheHalfStepLineWhereTheSwitchClosedForTheTriggerPoint) {
  expectHomed(x().home());
  // The step to the switch at -8000 steps went out where the curve crossed -7999.5: 2 mm off that
  // is -7839.5, which rounds to -7840.
  EXPECT_NEAR(carriage(), -0.098, 1e-9);
  EXPECT_NEAR(x().state().position, -0.1 + 159.5 * kStep, 1e-12);
  EXPECT_EQ(violationsOf(bench->report()), "");
  EXPECT_EQ(bench->machine->figures().slips, 0U);
}

TEST_F(HomingTest, GoesToEitherSwitch) {
  axis::AxisConfig config = homingAxis();
  config.homing->at_max = true;
  config.homing->offset = 0.25;
  config.pins.dir.inverted = true;
  build(config);
  expectHomed(x().home(), 0.1);
  EXPECT_NEAR(carriage(), 0.098, 1e-9);
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(HomingTest, StandsOnTheTriggerPointWithoutAPullOff) {
  axis::AxisConfig config = homingAxis();
  config.homing->pull_off = 0.0;
  build(config);
  expectHomed(x().home());
  EXPECT_NEAR(x().state().position, -0.1, kStep);
}

TEST_F(HomingTest, BacksOffFirstWhereItStartsOnTheSwitch) {
  build(homingAxis(), [](sim::RigAxisSpec& spec) { spec.start = -105.0; });
  expectHomed(x().home());
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(HomingTest, BacksOffUntilTheSwitchOpensHoweverFarThatIs) {
  build(homingAxis(), [](sim::RigAxisSpec& spec) { spec.min_switch->hysteresis = 12.0; });
  expectHomed(x().home());
}

TEST_F(HomingTest, LatchesAtItsOwnSpeed) {
  expectHomed(x().home());
  const std::int64_t closed = bench->trace->times("x", "endstop_min", false).back();
  const auto steps = bench->trace->times("x", "step", true);
  const auto last = std::find(steps.begin(), steps.end(), closed);
  ASSERT_NE(last, steps.end());
  EXPECT_NEAR(static_cast<double>(*last - *std::prev(last)), 1e9 / 400.0, 2.0);
}

// ---- failures ----

class HomingFailure : public HomingTest {
 protected:
  /// Not homed, at rest, enabled, with these words in the message.
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

  /// Homes, and does something once, when the axis has moved this far in a phase [steps].
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
  axis::AxisConfig config = homingAxis();
  config.homing->max_travel = 0.06;
  build(config);
  expectFailed(x().home(), "the min switch didn't close within max_travel, 0.06 m");
  EXPECT_EQ(bench->pulses(), -4800);
}

TEST_F(HomingFailure, SaysThatTheSwitchDoesNotCloseInTime) {
  axis::AxisConfig config = homingAxis();
  config.homing->timeout = 1.0;
  build(config);
  expectFailed(x().home(), "the min switch didn't close within timeout_s, 1 s");
  // 50 mm/s for a second, and a ramp down.
  EXPECT_NEAR(carriage(), -0.05, 0.002);
}

TEST_F(HomingFailure, SaysThatTheSwitchNeverOpens) {
  axis::AxisConfig config = homingAxis();
  config.homing->max_travel = 0.02;
  build(config);
  stick(true);
  expectFailed(x().home(), "the min switch didn't open within max_travel, 0.02 m");
  EXPECT_EQ(bench->pulses(), 1600);
}

TEST_F(HomingFailure, SaysThatTheSwitchDoesNotOpenInTime) {
  axis::AxisConfig config = homingAxis();
  config.homing->timeout = 2.0;
  build(config);
  stick(true);
  expectFailed(x().home(), "the min switch didn't open within timeout_s, 2 s");
}

TEST_F(HomingFailure, SaysThatTheSwitchDoesNotCloseAgain) {
  axis::AxisConfig config = homingAxis();
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
  // Between two strokes nothing is under way that a stop could end.
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

// ---- several axes ----

class HomingOfSeveral : public testing::Test {
 protected:
  void build(int order_of_x, int order_of_y) {
    std::vector<axis::AxisConfig> configs{homingAxis("x"), homingAxis("y"), linearAxis("z")};
    configs[0].homing->order = order_of_x;
    configs[1].homing->order = order_of_y;
    configs[1].homing->at_max = true;
    bench = std::make_unique<Bench>(configs);
  }

  /// When an axis made its first and its last step.
  std::pair<std::int64_t, std::int64_t> stepsOf(const std::string& axis) {
    const auto times = bench->trace->times(axis, "step", true);
    return {times.front(), times.back()};
  }

  std::unique_ptr<Bench> bench;
};

TEST_F(HomingOfSeveral, GoesByTheirOrder) {
  build(1, 0);
  const auto results = bench->machine->home();
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0].axis, "y");
  EXPECT_EQ(results[1].axis, "x");
  for (const HomingResult& result : results) {
    EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
    EXPECT_TRUE(bench->axis(result.axis).state().homed);
  }
  EXPECT_LT(stepsOf("y").second, stepsOf("x").first);
  EXPECT_EQ(bench->pulses("z"), 0);
}

TEST_F(HomingOfSeveral, GoesAtOnceWhereTheOrderIsTheSame) {
  build(2, 2);
  const auto results = bench->machine->home({"y", "x"});
  ASSERT_EQ(results.size(), 2U);
  for (const HomingResult& result : results) {
    EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
    EXPECT_EQ(violationsOf(bench->report(result.axis)), "");
  }
  EXPECT_LT(stepsOf("y").first, stepsOf("x").second);
  EXPECT_LT(stepsOf("x").first, stepsOf("y").second);
  EXPECT_NEAR(bench->report("x").carriage, -98.0, 1e-9);
  EXPECT_NEAR(bench->report("y").carriage, 98.0, 1e-9);
}

TEST_F(HomingOfSeveral, LeavesOutWhatComesAfterOneThatFails) {
  build(0, 1);
  sim::RigFaults faults;
  faults.min_stuck = false;
  bench->rig.setFaults("x", faults);
  const auto results = bench->machine->home();
  ASSERT_EQ(results.size(), 2U);
  EXPECT_EQ(results[0].end, HomingEnd::kFailed);
  EXPECT_EQ(results[1].end, HomingEnd::kFailed);
  EXPECT_EQ(results[1].message, "y isn't homed: x comes before it, and isn't homed");
  EXPECT_EQ(bench->pulses("y"), 0);
}

TEST_F(HomingOfSeveral, RefusesWithoutAStep) {
  build(0, 1);
  EXPECT_REFUSED(bench->machine->home({"x", "w"}), "there is no axis w");
  EXPECT_REFUSED(bench->machine->home({"x", "z"}), "z: homing isn't configured");
  EXPECT_REFUSED(bench->machine->home({"x", "x"}), "the axis x is named twice");
  bench->axis("y").enable(false);
  EXPECT_REFUSED(bench->machine->home(), "y: disabled");
  EXPECT_EQ(bench->pulses("x"), 0);
}

// ---- what a homing is worth ----

TEST_F(HomingTest, FindsTheSamePlaceFromRandomOnes) {
  std::mt19937 random(20);
  std::uniform_real_distribution<double> anywhere(-103.0, 99.0);
  for (int i = 0; i < 20; ++i) {
    bench->rig.placeCarriage("x", anywhere(random), bench->clock.now());
    expectHomed(x().home());
    bench->move(0.0);
    EXPECT_NEAR(carriage(), 0.0, kStep);
  }
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(HomingTest, TakesSoftLimitsForNothingWhileItHomes) {
  axis::AxisConfig config = homingAxis();
  config.min_position = -0.01;
  config.max_position = 0.2;
  config.homing->offset = 0.0;
  build(config);
  expectHomed(x().home());
  EXPECT_REFUSED(x().moveTo(-0.05), "min_position");
}

TEST_F(HomingTest, RefusesWhatCannotBeDoneMeanwhile) {
  std::string position;
  std::string again;
  x().home([&] {
    if (position.empty() && bench->pulses() < -100) {
      position = test::refusal([&] { x().setPosition(0.0); });
      again = test::refusal([&] { x().home(); });
    }
    return false;
  });
  EXPECT_EQ(position, "x: busy: it is being homed; its position is set at rest");
  EXPECT_EQ(again, "x: busy: it is being homed; it is homed at rest");
  EXPECT_TRUE(x().state().homed);
}

TEST_F(HomingTest, RefusesWhereItCannotBegin) {
  x().moveTo(0.01);
  EXPECT_REFUSED(x().home(), "busy: it moves; it is homed at rest");
  x().enable(false);
  EXPECT_REFUSED(x().home(), "disabled");
  build(linearAxis("x"));
  EXPECT_REFUSED(x().home(), "homing isn't configured");
}

TEST_F(HomingTest, IsWorthNothingWhenThePositionIsNot) {
  expectHomed(x().home());
  bench->move(0.0);
  EXPECT_TRUE(x().state().homed);
  x().sleep(true);
  x().sleep(false);
  x().setPosition(0.0);
  EXPECT_TRUE(x().state().position_valid);
  EXPECT_FALSE(x().state().homed) << "the motor was free meanwhile";
  expectHomed(x().home());
  x().enable(false);
  EXPECT_FALSE(x().state().homed);
}

TEST_F(HomingTest, IsRequiredOfAbsoluteMovesWhereThatIsConfigured) {
  axis::AxisConfig config = homingAxis();
  config.require_homing = true;
  build(config);
  EXPECT_REFUSED(x().moveTo(0.01), "x: it isn't homed, and require_homing");
  EXPECT_EQ(x().wait(x().moveTo(0.01, true)).end, axis::MoveEnd::kReached);
  x().jog(0.01);
  x().stop();
  bench->machine->advance(0.1);
  expectHomed(x().home());
  EXPECT_EQ(bench->move(0.0).end, axis::MoveEnd::kReached);
  x().enable(false);
  x().enable(true);
  EXPECT_REFUSED(x().moveTo(0.01), "it isn't homed");
}

TEST(HomingThreaded, WorksWithAPulseThreadOfItsOwn) {
  const axis::AxisConfig config = homingAxis();
  Bench bench({config}, true);
  const HomingResult result = bench.axis().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(bench.report().carriage, -98.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

/// A rig that tells of no edge.
class SilentRig : public sim::Rig {
 public:
  using sim::Rig::Rig;
  void watchInput(const std::string& /*line*/, gpio::EdgeListener /*listener*/) override {}
};

TEST(HomingWithoutEdges, KnowsTheTriggerPointToAStepByTheCount) {
  const axis::AxisConfig config = homingAxis();
  SilentRig rig(Bench::rigAxes({config}));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  machine::MachineOptions options;
  options.threaded = false;
  machine::Machine machine({config}, backend, clock, options);
  const HomingResult result = machine.axis("x").home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(result.position, rig.report("x").carriage / 1000.0, kStep);
}

}  // namespace
}  // namespace stepdriver
