#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/homing_bench.h"
#include "support/refusal.h"

// Switches that share a line. On the rig: 80 steps/mm, switches at -100 mm and 100 mm that open
// 0.2 mm from there.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingResult;
using axis::MoveEnd;
using test::Bench;
using test::homingAxis;
using test::kStep;
using test::violationsOf;

config::Endstop sharedSwitch() {
  config::Endstop endstop;
  endstop.line = "ends";
  endstop.active_level = true;
  endstop.shared = true;
  return endstop;
}

/// An axis that is homed to its min switch. Both its ends have the line "ends".
config::AxisConfig sharedEnds(const std::string& name = "x") {
  config::AxisConfig config = homingAxis(name);
  config.endstop_min = config.endstop_max = sharedSwitch();
  config.switch_release = 0.002;
  return config;
}

/// An axis that is homed to its min switch, which has the line "ends".
config::AxisConfig sharedMin(const std::string& name, int order) {
  config::AxisConfig config = homingAxis(name);
  config.endstop_min = sharedSwitch();
  config.homing->order = order;
  return config;
}

class SharedSwitches : public testing::Test {
 protected:
  void build(const std::vector<config::AxisConfig>& configs,
             const std::function<void(sim::RigAxisSpec&)>& change = {}) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(configs);
    if (change) change(specs[0]);
    bench = std::make_unique<Bench>(configs, specs);
  }

  axis::Axis& x() { return bench->axis(); }
  axis::Axis& y() { return bench->axis("y"); }
  axis::MoveResult moveBy(axis::Axis& axis, double way) {
    return axis.wait(axis.moveTo(way, true));
  }
  double carriage(const std::string& name = "x") { return bench->report(name).carriage / 1000.0; }

  /// Somebody moves the carriage, while the motor has no current.
  void moveByHand(double place) {
    x().enable(false);
    bench->rig.placeCarriage("x", place * 1000.0, bench->clock.now());
    x().enable(true);
  }

  void expectHomed(const HomingResult& result, double trigger) {
    EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
    const axis::AxisState state = bench->axis(result.axis).state();
    EXPECT_NEAR(state.position - bench->axis(result.axis).config().homing->offset,
                carriage(result.axis) - trigger, kStep)
        << result.axis;
    EXPECT_EQ(violationsOf(bench->report(result.axis)), "") << result.axis;
  }

  std::unique_ptr<Bench> bench;
};

constexpr const char* kUnknown =
    "x: the switch of both ends is pressed, and it isn't known at which one; move the axis off it "
    "by hand, while its motor has no current";

// ---- both ends of an axis ----

TEST_F(SharedSwitches, AnAxisIsHomedToEitherOfItsEnds) {
  for (const bool at_max : {false, true}) {
    config::AxisConfig config = sharedEnds();
    config.homing->at_max = at_max;
    build({config});
    expectHomed(x().home(), at_max ? 0.1 : -0.1);
  }
}

TEST_F(SharedSwitches, AnAxisStopsAtEitherEndAndLeavesItOnlyInward) {
  build({sharedEnds()});
  for (const bool at_max : {false, true, false}) {
    const double out = at_max ? 1.0 : -1.0;
    EXPECT_EQ(moveBy(x(), out).end, at_max ? MoveEnd::kEndstopMax : MoveEnd::kEndstopMin);
    EXPECT_NEAR(carriage(), out * 0.1, kStep);
    EXPECT_REFUSED(x().moveTo(out * kStep, true),
                   at_max ? "x: the max endstop is active; it moves only towards min"
                          : "x: the min endstop is active; it moves only towards max");
    EXPECT_EQ(moveBy(x(), out * -0.05).end, MoveEnd::kReached);
    EXPECT_NEAR(carriage(), out * 0.05, kStep);
  }
  EXPECT_EQ(violationsOf(bench->report()), "");
}

// By single microsteps too: then the last one before a rest may close the switch.
TEST_F(SharedSwitches, TheLastStepOfAMotionMayCloseTheSwitch) {
  build({sharedEnds()}, [](sim::RigAxisSpec& spec) { spec.start = -99.99; });
  axis::MoveEnd end = MoveEnd::kReached;
  int steps = 0;
  while (end == MoveEnd::kReached && !*x().endstops().min && ++steps < 10) {
    end = moveBy(x(), -kStep).end;
  }
  ASSERT_TRUE(*x().endstops().min);
  EXPECT_REFUSED(x().moveTo(-kStep, true), "the min endstop is active");
  EXPECT_EQ(moveBy(x(), kStep).end, MoveEnd::kReached);
}

TEST_F(SharedSwitches, AfterTheStartNobodyKnowsWhichEndPressesTheSwitch) {
  for (const double start : {-100.0, 100.0}) {
    build({sharedEnds()}, [start](sim::RigAxisSpec& spec) { spec.start = start; });
    for (const double way : {-kStep, kStep}) EXPECT_REFUSED(x().moveTo(way, true), kUnknown);
    EXPECT_REFUSED(x().home(), kUnknown);
    EXPECT_EQ(bench->pulses(), 0);
    moveByHand(0.0);
    expectHomed(x().home(), -0.1);
  }
}

TEST_F(SharedSwitches, WithoutCurrentTheAxisMayHaveComeToTheOtherEnd) {
  build({sharedEnds()});
  EXPECT_EQ(moveBy(x(), -1.0).end, MoveEnd::kEndstopMin);
  moveByHand(0.1);
  for (const double way : {-kStep, kStep}) EXPECT_REFUSED(x().moveTo(way, true), kUnknown);
}

TEST_F(SharedSwitches, AnAssumedEndIsLeftByTheReleaseTravelAtMost) {
  config::AxisConfig config = sharedEnds();
  config.assumed_end_is_max = false;
  build({config}, [](sim::RigAxisSpec& spec) { spec.start = -100.0; });
  EXPECT_REFUSED(x().moveTo(-kStep, true), "the min endstop is active");
  expectHomed(x().home(), -0.1);

  // The assumption is wrong.
  build({config}, [](sim::RigAxisSpec& spec) { spec.start = 100.0; });
  const axis::MoveResult result = moveBy(x(), 0.05);
  EXPECT_EQ(result.end, MoveEnd::kEndstopMax);
  EXPECT_NE(result.message.find("the switch of both ends didn't open within its release travel, "
                                "0.002 m,"),
            std::string::npos)
      << result.message;
  EXPECT_NEAR(carriage(), 0.102, kStep);
}

TEST_F(SharedSwitches, ASwitchThatDoesNotOpenEndsAHoming) {
  build({sharedEnds()});
  EXPECT_EQ(moveBy(x(), -1.0).end, MoveEnd::kEndstopMin);
  sim::RigFaults faults;
  faults.min_stuck = true;
  bench->rig.setFaults("x", faults);
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_NE(result.message.find(
                "the switch of both ends didn't open within its release travel, 0.002 m, while "
                "leaving"),
            std::string::npos)
      << result.message;
  EXPECT_NEAR(carriage(), -0.098, kStep);
}

TEST_F(SharedSwitches, AHomingDoesNotBeginAtTheOtherEnd) {
  build({sharedEnds()});
  EXPECT_EQ(moveBy(x(), 1.0).end, MoveEnd::kEndstopMax);
  EXPECT_REFUSED(x().home(),
                 "x: the switch of both ends is pressed at max, and not where it is homed: first "
                 "move it off");
  EXPECT_EQ(moveBy(x(), -0.01).end, MoveEnd::kReached);
  expectHomed(x().home(), -0.1);
}

TEST_F(SharedSwitches, TheEndIsKnownInEachMicrostepMode) {
  build({sharedEnds()});
  x().setMicrosteps(2);
  EXPECT_EQ(moveBy(x(), -1.0).end, MoveEnd::kEndstopMin);
  EXPECT_EQ(moveBy(x(), 0.001).end, MoveEnd::kReached);
  EXPECT_EQ(moveBy(x(), 1.0).end, MoveEnd::kEndstopMax);
  EXPECT_EQ(moveBy(x(), -0.01).end, MoveEnd::kReached);
}

// Whatever is asked of the axis, no end is passed by more than a step, and it is never stuck.
TEST_F(SharedSwitches, RandomMotionsPassNoEnd) {
  for (unsigned seed = 1; seed <= 20; ++seed) {
    std::mt19937 random(seed);
    config::AxisConfig config = sharedEnds();
    if (seed % 2 == 0) config.backlash = 0.0004;
    const bool bounces = seed % 3 == 0;
    build({config}, [bounces](sim::RigAxisSpec& spec) {
      for (auto* contact : {&spec.min_switch, &spec.max_switch}) {
        (*contact)->bounces = bounces ? 4 : 0;
        (*contact)->bounce_ns = 300'000;
      }
    });
    // Ways of a microstep to twice the whole way, as likely in each decade.
    std::uniform_real_distribution<double> decades(std::log(kStep), std::log(0.4));
    for (int i = 0; i < 200; ++i) {
      const double way = (random() % 2 == 0 ? 1.0 : -1.0) * std::exp(decades(random));
      const std::string what =
          "seed " + std::to_string(seed) + ", motion " + std::to_string(i) + " of ";
      try {
        moveBy(x(), way);
      } catch (const Refused& refused) {
        const bool outward = (way > 0.0) == (carriage() > 0.0);
        ASSERT_TRUE(outward) << what << ": " << refused.what();
        ASSERT_GT(std::abs(carriage()), 0.0997) << what << ": " << refused.what();
      }
      // A bounce lasts 1.2 ms.
      ASSERT_LT(std::abs(carriage()), 0.1 + (bounces ? 0.00013 : 2.5 * kStep)) << what << way;
      ASSERT_EQ(violationsOf(bench->report()), "") << what;
    }
  }
}

// From the end itself it can't begin: nobody knows then which of the two it is.
TEST_F(SharedSwitches, RandomHomingsFindTheirEndOrNameTheCause) {
  std::mt19937 random(37);
  std::uniform_real_distribution<double> starts(-100.2, 100.2);
  std::uniform_real_distribution<double> hysteresis(0.0, 0.8);
  enum class Trouble { kNone, kMissing, kStuckInactive, kStuckActive };
  test::Spread spread;
  int refused = 0;
  for (int i = 0; i < 300; ++i) {
    config::AxisConfig config = sharedEnds();
    config.homing->at_max = i % 2 != 0;
    const double end = config.homing->at_max ? 0.1 : -0.1;
    const Trouble trouble = i % 20 < 17 ? Trouble::kNone : static_cast<Trouble>(i % 20 - 16);
    const double start = i % 20 == 5 ? std::copysign(100.1, starts(random))
                                     : std::round(starts(random) * 80.0) / 80.0;
    build({config}, [&](sim::RigAxisSpec& spec) {
      spec.start = start;
      for (auto* contact : {&spec.min_switch, &spec.max_switch}) {
        (*contact)->hysteresis = hysteresis(random);
        (*contact)->bounces = static_cast<int>(random() % 7);
        (*contact)->bounce_ns = 200'000;
        if (trouble == Trouble::kMissing) contact->reset();
      }
    });
    sim::RigFaults faults;
    if (trouble == Trouble::kStuckInactive) faults.min_stuck = faults.max_stuck = false;
    if (trouble == Trouble::kStuckActive) faults.min_stuck = faults.max_stuck = true;
    bench->rig.setFaults("x", faults);
    SCOPED_TRACE("homing " + std::to_string(i) + " from " + std::to_string(start));
    const bool is_dead = trouble == Trouble::kMissing || trouble == Trouble::kStuckInactive;
    if (trouble == Trouble::kStuckActive || (!is_dead && std::abs(start) >= 100.0)) {
      EXPECT_REFUSED(x().home(), kUnknown);
      EXPECT_EQ(bench->pulses(), 0);
      ++refused;
    } else if (is_dead) {
      const HomingResult result = x().home();
      EXPECT_EQ(result.end, HomingEnd::kFailed);
      const std::string which = config.homing->at_max ? "max" : "min";
      EXPECT_NE(result.message.find("the " + which + " switch didn't close within max_travel"),
                std::string::npos)
          << result.message;
    } else {
      expectHomed(x().home(), end);
      const double beyond = x().state().position - config.homing->offset - (carriage() - end);
      spread.add(std::copysign(1.0, end) * beyond / kStep);
    }
    if (HasFailure()) return;
  }
  spread.expectAStep();
  EXPECT_GE(refused, 30);
}

// ---- switches of several axes ----

TEST_F(SharedSwitches, RandomHomingsOfSeveralAxesFindTheirPlaces) {
  std::mt19937 random(37);
  std::uniform_real_distribution<double> starts(-99.9, 99.0);
  test::Spread spread;
  for (int i = 0; i < 100; ++i) {
    const std::vector<config::AxisConfig> configs{sharedMin("x", i % 2), sharedMin("y", 1 - i % 2)};
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes(configs);
    for (sim::RigAxisSpec& spec : specs) {
      spec.start = std::round(starts(random) * 80.0) / 80.0;
      spec.min_switch->bounces = static_cast<int>(random() % 7);
      spec.min_switch->bounce_ns = 200'000;
    }
    bench = std::make_unique<Bench>(configs, specs);
    SCOPED_TRACE("homing " + std::to_string(i));
    for (const HomingResult& result : bench->machine->home()) {
      expectHomed(result, -0.1);
      spread.add((result.position - carriage(result.axis)) / kStep);
    }
    if (HasFailure()) return;
  }
  spread.expectAStep();
}

TEST_F(SharedSwitches, AxesAreHomedOneAfterTheOther) {
  config::AxisConfig z = sharedMin("z", 2);
  z.homing->at_max = true;
  z.endstop_max = z.endstop_min;
  z.endstop_min.reset();
  build({sharedMin("x", 1), sharedMin("y", 0), z});
  const auto results = bench->machine->home();
  ASSERT_EQ(results.size(), 3U);
  EXPECT_EQ(results[0].axis, "y");
  for (const HomingResult& result : results) expectHomed(result, result.axis == "z" ? 0.1 : -0.1);
}

TEST_F(SharedSwitches, WhileOneAxisIsHomedTheOthersStand) {
  build({sharedMin("x", 0), sharedMin("y", 1)});
  const char* const why = "y: x, which has a switch on the same line, is being homed: wait for it";
  axis::HomingPhase asked_in = axis::HomingPhase::kNone;
  const HomingResult result = x().home([&] {
    const axis::HomingPhase phase = x().state().homing;
    if (phase == std::exchange(asked_in, phase)) return false;
    EXPECT_REFUSED(y().moveTo(0.01, true), why);
    EXPECT_REFUSED(y().jog(0.01), why);
    EXPECT_REFUSED(y().home(), why);
    return false;
  });
  EXPECT_EQ(asked_in, axis::HomingPhase::kPullingOff);
  expectHomed(result, -0.1);
  EXPECT_EQ(moveBy(y(), 0.01).end, MoveEnd::kReached);
  EXPECT_EQ(bench->pulses("y"), 800);
}

TEST_F(SharedSwitches, AHomingWaitsForNoOtherAxis) {
  build({sharedMin("x", 0), sharedMin("y", 1)});
  const axis::Move move = y().moveTo(0.05, true);
  EXPECT_REFUSED(x().home(),
                 "y: busy: it moves; x, which has a switch on the same line, is homed at rest");
  EXPECT_EQ(y().wait(move).end, MoveEnd::kReached);
  expectHomed(x().home(), -0.1);
}

TEST_F(SharedSwitches, AHomingDoesNotBeginIfAnotherAxisMayPressTheSwitch) {
  build({sharedMin("x", 0), sharedMin("y", 1)});
  EXPECT_EQ(moveBy(y(), -1.0).end, MoveEnd::kEndstopMin);
  EXPECT_REFUSED(x().home(),
                 "x: the switch that it shares with y is pressed, and it isn't known by which of "
                 "them: first move the one off it that presses it");
  EXPECT_REFUSED(x().moveTo(-0.01, true),
                 "x: the min endstop, or that of y on the same line, is active; it moves only "
                 "towards max");
  EXPECT_EQ(moveBy(x(), 0.01).end, MoveEnd::kReached) << "no switch is there";
  EXPECT_EQ(moveBy(y(), 0.01).end, MoveEnd::kReached);
  expectHomed(x().home(), -0.1);
}

TEST_F(SharedSwitches, OneThatIsPressedStopsAllThatMoveTowardsTheirs) {
  build({sharedMin("x", 0), sharedMin("y", 1)}, [](sim::RigAxisSpec& spec) { spec.start = -99.0; });
  const axis::Move towards = y().moveTo(-0.05, true);
  const axis::MoveResult of_x = moveBy(x(), -0.05);
  EXPECT_EQ(of_x.end, MoveEnd::kEndstopMin);
  const axis::MoveResult of_y = y().wait(towards);
  EXPECT_EQ(of_y.end, MoveEnd::kEndstopMin);
  EXPECT_NE(of_y.message.find("the min endstop, or that of x on the same line, was met"),
            std::string::npos)
      << of_y.message;
  EXPECT_GT(carriage("y"), -0.01);
}

// As on machines with all switches in series.
TEST_F(SharedSwitches, AllEndsOfAllAxesMayHaveOneLine) {
  config::AxisConfig second = sharedEnds("y");
  second.homing->order = 1;
  build({sharedEnds("x"), second});
  for (const HomingResult& result : bench->machine->home()) expectHomed(result, -0.1);
  EXPECT_EQ(moveBy(x(), 1.0).end, MoveEnd::kEndstopMax);
  // y is far from its ends, but nobody knows that: off the end towards which it has moved last, and
  // only by the release travel.
  EXPECT_REFUSED(y().moveTo(0.01, true),
                 "the max endstop, or that of x on the same line, is active");
  EXPECT_EQ(moveBy(y(), -0.001).end, MoveEnd::kReached);
  EXPECT_EQ(moveBy(x(), -0.01).end, MoveEnd::kReached);
  EXPECT_EQ(moveBy(y(), 0.05).end, MoveEnd::kReached);
}

}  // namespace
}  // namespace stepdriver
