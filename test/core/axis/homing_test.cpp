#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <memory>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/homing_bench.h"
#include "support/refusal.h"

// Homing on the rig: 80 steps/mm, switches at -100 mm and 100 mm.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingPhase;
using axis::HomingResult;
using test::Bench;
using test::homingAxis;
using test::HomingTest;
using test::kStep;
using test::linearAxis;
using test::violationsOf;

TEST_F(HomingTest, TakesTheHalfStepLineWhereTheSwitchClosedForTheTriggerPoint) {
  expectHomed(x().home());
  // The step to the switch at -8000 steps was sent when the curve crossed -7999.5. 2 mm from there
  // is -7839.5, which rounds to -7840.
  EXPECT_NEAR(carriage(), -0.098, 1e-9);
  EXPECT_NEAR(x().state().position, -0.1 + 159.5 * kStep, 1e-12);
  EXPECT_EQ(violationsOf(bench->report()), "");
  EXPECT_EQ(bench->machine->figures().slips, 0U);
}

TEST_F(HomingTest, GoesToEitherSwitch) {
  config::AxisConfig config = homingAxis();
  config.homing->at_max = true;
  config.homing->offset = 0.25;
  config.pins.dir.inverted = true;
  build(config);
  expectHomed(x().home(), 0.1);
  EXPECT_NEAR(carriage(), 0.098, 1e-9);
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(HomingTest, StandsOnTheTriggerPointWithoutAPullOff) {
  config::AxisConfig config = homingAxis();
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

TEST_F(HomingTest, FindsTheTriggerPointInATimelineThatHasSlid) {
  x().moveTo(0.05);
  bench->machine->advance(0.1);
  bench->clock.waitUntil(bench->clock.now() + 4'000'000);
  bench->rig.clockStalled();
  bench->machine->advance(1.0);
  ASSERT_GT(bench->machine->figures().slipped, 0.003);
  expectHomed(x().home());
  EXPECT_NEAR(x().state().position - -0.1, carriage() + 0.1 - 0.5 * kStep, 1e-9);
}

TEST_F(HomingTest, KnowsTheTriggerPointToAStepWhereTheTimelineSlidesAfterIt) {
  bool closed = false;
  expectHomed(x().home([&] {
    if (!closed && x().state().homing == HomingPhase::kLatching && *x().endstops().min) {
      closed = true;
      bench->clock.waitUntil(bench->clock.now() + 100'000'000);  // forty steps of the latch
      bench->rig.clockStalled();
    }
    return false;
  }));
  EXPECT_TRUE(closed);
  EXPECT_GT(bench->machine->figures().slipped, 0.09);
}

// ---- several axes ----

class HomingOfSeveral : public testing::Test {
 protected:
  void build(int order_of_x, int order_of_y) {
    std::vector<config::AxisConfig> configs{homingAxis("x"), homingAxis("y"), linearAxis("z")};
    configs[0].homing->order = order_of_x;
    configs[1].homing->order = order_of_y;
    configs[1].homing->at_max = true;
    bench = std::make_unique<Bench>(configs);
  }

  /// The times at which an axis made its first and its last step.
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

// ---- how exact a homing is, and how long it is valid ----

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

// With random bounces and hysteresis of the switch. Some of the starts are with a switch that is
// missing or stuck.
TEST_F(HomingTest, FromAnyPlaceFindsTheSameSwitchOrSaysWhatIsWrongWithIt) {
  std::mt19937 random(37);
  std::uniform_real_distribution<double> starts(-100.0, 99.0);
  std::uniform_real_distribution<double> hysteresis(0.0, 0.8);
  test::Spread spread;
  for (int i = 0; i < 1000; ++i) {
    const bool is_broken = i % 20 == 19;
    config::AxisConfig config = homingAxis();
    if (is_broken) config.homing->max_travel = 0.1;
    build(config, [&](sim::RigAxisSpec& spec) {
      spec.start = std::round(starts(random) * 80.0) / 80.0;
      spec.min_switch->hysteresis = hysteresis(random);
      spec.min_switch->bounces = static_cast<int>(random() % 7);
      spec.min_switch->bounce_ns = 200'000;
      if (is_broken) spec.start = -0.5 * std::abs(spec.start);
    });
    const std::string what = "start " + std::to_string(i) + " at " + std::to_string(carriage());
    sim::RigFaults faults;
    faults.min_stuck = i / 20 % 2 == 0;
    if (is_broken) bench->rig.setFaults("x", faults);
    const HomingResult result = x().home();
    ASSERT_EQ(violationsOf(bench->report()), "") << what;
    if (is_broken) {
      ASSERT_EQ(result.end, HomingEnd::kFailed) << what;
      ASSERT_NE(result.message.find(*faults.min_stuck ? "the min switch didn't open"
                                                      : "the min switch didn't close"),
                std::string::npos)
          << what << ": " << result.message;
      continue;
    }
    ASSERT_EQ(result.end, HomingEnd::kHomed) << what << ": " << result.message;
    spread.add((x().state().position - carriage()) / kStep);
  }
  spread.expectAStep();
}

TEST_F(HomingTest, IsLostWithAHomingThatFails) {
  expectHomed(x().home());
  EXPECT_EQ(x().home([] { return true; }).end, HomingEnd::kCancelled);
  EXPECT_FALSE(x().state().homed);
}

TEST_F(HomingTest, TakesSoftLimitsForNothingWhileItHomes) {
  config::AxisConfig config = homingAxis();
  config.min_position = -0.01;
  config.max_position = 0.2;
  config.homing->offset = -0.01;
  build(config);
  expectHomed(x().home());
  EXPECT_REFUSED(x().moveTo(-0.05), "min_position");
}

TEST_F(HomingTest, IsHeldWhereItStandsBetweenTwoStrokes) {
  bool held = false;
  expectHomed(x().home([&] {
    if (held || !*x().endstops().min || x().state().moving) return false;
    held = true;
    const std::int64_t at_rest = bench->pulses();
    bench->machine->hold();
    bench->machine->advance(1.0);
    EXPECT_EQ(bench->pulses(), at_rest);
    EXPECT_TRUE(x().state().held);
    bench->machine->resume();
    return false;
  }));
  EXPECT_TRUE(held);
}

TEST_F(HomingTest, IsHeldAtAnyMomentForLongerThanItsTimeOutAndGoesOn) {
  for (std::int64_t moment = 0; moment < 32; ++moment) {
    SCOPED_TRACE(moment);
    config::AxisConfig config = homingAxis();
    config.homing->timeout = 4.0;
    build(config);
    const std::int64_t begin = bench->clock.now() + moment * 70'000'000;
    bool held = false;
    const HomingResult result = x().home([&] {
      if (held || bench->clock.now() < begin) return false;
      held = true;
      bench->machine->hold();
      EXPECT_TRUE(x().state().held);
      bench->machine->advance(1.0);
      const std::int64_t at_rest = bench->pulses();
      bench->machine->advance(60.0);
      EXPECT_EQ(bench->pulses(), at_rest);
      bench->machine->resume();
      EXPECT_FALSE(x().state().held);
      return false;
    });
    EXPECT_TRUE(held);
    expectHomed(result);
    EXPECT_NEAR(carriage(), -0.098, 2.0 * kStep);
    EXPECT_EQ(violationsOf(bench->report()), "");
  }
}

TEST_F(HomingTest, CountsTheTimeBeforeAndAfterAHold) {
  config::AxisConfig config = homingAxis();
  config.homing->timeout = 1.5;
  build(config);
  bool held = false;
  const HomingResult result = x().home([&] {
    if (held || bench->clock.now() < 1'000'000'000) return false;
    held = true;
    bench->machine->hold();
    bench->machine->advance(10.0);
    bench->machine->resume();
    return false;
  });
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_NE(result.message.find("didn't close within timeout_s, 1.5 s"), std::string::npos)
      << result.message;
  EXPECT_NEAR(carriage(), -0.075, 0.005);
}

TEST_F(HomingTest, IsEndedByAStopOrACancelWhileItIsHeld) {
  for (const bool cancel : {false, true}) {
    build(homingAxis());
    bool held = false;
    const HomingResult result = x().home([&] {
      if (!held && bench->pulses() < -1000) {
        held = true;
        bench->machine->hold();
      }
      if (!held || x().state().moving) return false;
      if (!cancel) bench->machine->stop();
      return cancel;
    });
    EXPECT_EQ(result.end, cancel ? HomingEnd::kCancelled : HomingEnd::kFailed) << result.message;
    EXPECT_EQ(x().state().held, cancel) << "only a stop ends a hold";
    bench->machine->resume();
    EXPECT_EQ(bench->move(-0.01).end, axis::MoveEnd::kReached);
  }
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
  config::AxisConfig config = homingAxis();
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
  const config::AxisConfig config = homingAxis();
  Bench bench({config}, true);
  const HomingResult result = bench.axis().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(bench.report().carriage, -98.0, 1e-9);
  EXPECT_EQ(violationsOf(bench.report()), "");
}

/// A rig that reports no edges.
class SilentRig : public sim::Rig {
 public:
  using sim::Rig::Rig;
  void watchInput(int /*line*/, gpio::EdgeListener /*listener*/) override {}
};

TEST(HomingWithoutEdges, KnowsTheTriggerPointToAStepByTheCount) {
  const config::AxisConfig config = homingAxis();
  SilentRig rig(Bench::rigAxes({config}));
  pulse::VirtualClock clock;
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine({config}, backend, clock);
  const HomingResult result = machine.axis("x").home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(result.position, rig.report("x").carriage / 1000.0, kStep);
}

}  // namespace
}  // namespace stepdriver
