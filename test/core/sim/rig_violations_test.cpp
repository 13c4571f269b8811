#include <gtest/gtest.h>

#include <algorithm>
#include <string>
#include <vector>

#include "stepdriver_core/sim/rig.h"
#include "support/hand_rig.h"

namespace stepdriver::sim {
namespace {

using test::HandRig;
using test::plainAxis;
using test::Violations;

testing::AssertionResult saw(const HandRig& bench, const Violations& expected) {
  const Violations seen = bench.report().violations;
  if (seen == expected) return testing::AssertionSuccess();
  return testing::AssertionFailure()
         << "seen: " << test::inWords(seen) << "; expected: " << test::inWords(expected);
}

const std::vector<std::string>& allModels() {
  static const std::vector<std::string> all{"a4988", "drv8825", "tb6600"};
  return all;
}

/// Runs the edges of `scenario` with margins around the limit: exactly the limit is no violation,
/// and 1 ns less is one violation of that kind and no other.
template <typename Scenario>
void expectLimit(const std::string& model, std::int64_t limit, Violation violation,
                 Scenario scenario) {
  const std::string name = driver::driverChip(model).title;
  HandRig exact(model);
  scenario(exact.ready(), limit);
  EXPECT_TRUE(saw(exact, {})) << name << " with " << limit << " ns";
  if (limit == 0) return;
  HandRig short_of_it(model);
  scenario(short_of_it.ready(), limit - 1);
  EXPECT_TRUE(saw(short_of_it, {{violation, 1}})) << name << " with " << limit - 1 << " ns";
}

TEST(RigViolations, NoneInACleanSequence) {
  for (const std::string& model : allModels()) {
    HandRig bench(model);
    bench.ready().pulse(5).direction(false).pulse(3);
    bench.set("x.ms1", true).wait(HandRig::kHalf).pulse(2);
    bench.set("x.enable", true).wait(HandRig::kHalf).set("x.enable", false).wait(1'000'000'000);
    bench.pulse(4);
    EXPECT_TRUE(saw(bench, {})) << driver::driverChip(model).title;
    EXPECT_EQ(bench.report().totalViolations(), 0);
  }
}

TEST(RigViolations, PulseTooShort) {
  for (const std::string& model : allModels()) {
    expectLimit(model, driver::driverChip(model).timing.step_high_ns, Violation::kShortStepHigh,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.step", true).wait(time).set("x.step", false);
                });
  }
}

TEST(RigViolations, GapBetweenPulsesTooShort) {
  for (const std::string& model : allModels()) {
    expectLimit(model, driver::driverChip(model).timing.step_low_ns, Violation::kShortStepLow,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.step", true).wait(HandRig::kHalf).set("x.step", false).wait(time);
                  bench.set("x.step", true);
                });
  }
}

TEST(RigViolations, DirectionSetTooLate) {
  for (const std::string& model : allModels()) {
    expectLimit(model, driver::driverChip(model).timing.dir_setup_ns, Violation::kDirSetup,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.dir", false).wait(time).set("x.step", true);
                });
  }
}

TEST(RigViolations, DirectionNotHeld) {
  for (const std::string& model : allModels()) {
    expectLimit(model, driver::driverChip(model).timing.dir_hold_ns, Violation::kDirHold,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.step", true).wait(time).set("x.dir", false);
                });
  }
}

TEST(RigViolations, DirectionWithTheStepIsOneWhicheverComesFirst) {
  HandRig before("a4988");
  before.ready().set("x.dir", false).set("x.step", true);
  EXPECT_TRUE(saw(before, {{Violation::kDirSetup, 1}}));
  HandRig after("a4988");
  after.ready().set("x.step", true).set("x.dir", false);
  EXPECT_TRUE(saw(after, {{Violation::kDirHold, 1}}));
}

TEST(RigViolations, MicrostepPinsSetTooLate) {
  for (const std::string model : {"a4988", "drv8825"}) {
    expectLimit(model, driver::driverChip(model).timing.mode_setup_ns, Violation::kModeSetup,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.ms1", true).wait(time).set("x.step", true);
                });
  }
}

TEST(RigViolations, MicrostepPinsNotHeld) {
  for (const std::string model : {"a4988", "drv8825"}) {
    expectLimit(model, driver::driverChip(model).timing.mode_hold_ns, Violation::kModeHold,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.step", true).wait(time).set("x.ms1", true);
                });
  }
}

TEST(RigViolations, UndefinedModeEvenInPassing) {
  HandRig bench("a4988");
  bench.ready().set("x.ms3", true).set("x.ms1", true).set("x.ms2", true);
  EXPECT_TRUE(saw(bench, {{Violation::kUndefinedMode, 2}})) << "over LLH and HLH to HHH";
  bench.set("x.ms3", false).set("x.ms1", false).set("x.ms2", false);
  EXPECT_TRUE(saw(bench, {{Violation::kUndefinedMode, 2}})) << "over HHL and LHL to LLL";

  HandRig decodes_all("drv8825");
  decodes_all.ready().set("x.ms3", true).set("x.ms2", true).set("x.ms1", true);
  EXPECT_TRUE(saw(decodes_all, {}));
}

TEST(RigViolations, StepInAnUndefinedModeThatTheLinesWereRequestedWith) {
  HandRig bench("a4988");
  bench.request("x.ms3", true).request("x.enable", false);
  bench.request("x.sleep", true).request("x.reset", true).wait(1'000'000);
  EXPECT_TRUE(saw(bench, {}));
  bench.pulse(2);
  EXPECT_TRUE(saw(bench, {{Violation::kUndefinedMode, 2}}));
  EXPECT_EQ(bench.report().microsteps, 1) << "the mode before";
}

TEST(RigViolations, StepWhileDisabledWhetherItCountsOrNot) {
  for (const std::string& model : allModels()) {
    HandRig bench(model);
    bench.ready().set("x.enable", true).wait(1'000'000'000).pulse(3);
    EXPECT_TRUE(saw(bench, {{Violation::kStepWhileDisabled, 3}}))
        << driver::driverChip(model).title;
  }
}

TEST(RigViolations, StepTooSoonAfterEnable) {
  for (const std::string& model : allModels()) {
    expectLimit(model, driver::driverChip(model).timing.enable_ns, Violation::kStepAfterEnable,
                [](HandRig& bench, std::int64_t time) {
                  bench.set("x.enable", true).wait(1'000).set("x.enable", false).wait(time);
                  bench.set("x.step", true);
                });
  }
}

TEST(RigViolations, StepWhileAsleepAndTooSoonAfterWakeUp) {
  for (const std::string model : {"a4988", "drv8825"}) {
    HandRig bench(model);
    bench.ready().set("x.sleep", false).wait(1'000'000'000).pulse(2);
    EXPECT_TRUE(saw(bench, {{Violation::kStepWhileAsleep, 2}})) << driver::driverChip(model).title;
    expectLimit(model, driver::driverChip(model).timing.wake_ns, Violation::kStepAfterWake,
                [](HandRig& awake, std::int64_t time) {
                  awake.set("x.sleep", false).wait(1'000).set("x.sleep", true).wait(time);
                  awake.set("x.step", true);
                });
  }
}

TEST(RigViolations, StepInResetAndTooSoonAfterIt) {
  for (const std::string model : {"a4988", "drv8825"}) {
    HandRig bench(model);
    bench.ready().set("x.reset", false).wait(1'000'000'000).pulse(2);
    EXPECT_TRUE(saw(bench, {{Violation::kStepInReset, 2}})) << driver::driverChip(model).title;
    expectLimit(model, driver::driverChip(model).timing.reset_wait_ns, Violation::kStepInReset,
                [](HandRig& released, std::int64_t time) {
                  released.set("x.reset", false).wait(1'000).set("x.reset", true).wait(time);
                  released.set("x.step", true);
                });
  }
}

TEST(RigViolations, TimesOfEnableAndWakeUpCountFromTheRequest) {
  RigAxisSpec spec = plainAxis("drv8825");
  HandRig bench(spec);
  bench.request("x.step", false).request("x.enable", false);
  bench.request("x.sleep", true).request("x.reset", true);
  bench.wait(600).set("x.step", true);
  EXPECT_TRUE(saw(bench, {{Violation::kStepAfterEnable, 1},
                          {Violation::kStepAfterWake, 1},
                          {Violation::kStepInReset, 1}}));
}

TEST(RigViolations, NoneFromTheRequestItself) {
  HandRig bench(plainAxis("tb6600"));
  bench.request("x.enable", false).wait(200'000'000);
  bench.request("x.dir", true).request("x.step", true).set("x.step", false).wait(5'000);
  bench.set("x.step", true);
  EXPECT_TRUE(saw(bench, {})) << "DIR and STEP have had their levels for ever";
  EXPECT_EQ(bench.report().pulses_forward, 1) << "the request of a high STEP is no pulse";
}

TEST(RigViolations, SeveralOfOneEdge) {
  HandRig bench("drv8825");
  bench.ready().set("x.step", true).wait(100).set("x.step", false).wait(100).set("x.dir", false);
  bench.set("x.ms1", true).set("x.enable", true).wait(100).set("x.step", true);
  EXPECT_TRUE(saw(bench, {{Violation::kShortStepHigh, 1},
                          {Violation::kShortStepLow, 1},
                          {Violation::kDirHold, 1},
                          {Violation::kDirSetup, 1},
                          {Violation::kModeHold, 1},
                          {Violation::kModeSetup, 1},
                          {Violation::kStepWhileDisabled, 1}}));
  EXPECT_EQ(bench.report().totalViolations(), 7);
}

TEST(RigViolations, AreSeenAtTheChipWhereTheWiringInverts) {
  RigAxisSpec spec = plainAxis("tb6600");
  spec.step.inverted = spec.dir.inverted = spec.enable.inverted = true;
  HandRig bench(spec);
  bench.request("x.step", true).request("x.dir", false).request("x.enable", true);
  bench.wait(200'000'000);
  bench.set("x.step", false).wait(5'000).set("x.step", true).wait(5'000).set("x.step", false);
  EXPECT_TRUE(saw(bench, {})) << "a pulse is low on the line";
  bench.wait(4'999).set("x.step", true);
  EXPECT_TRUE(saw(bench, {{Violation::kShortStepHigh, 1}}));
  EXPECT_EQ(bench.report().pulses_forward, 2) << "DIR low on the line is high at the chip";
}

TEST(RigViolations, HaveNames) {
  std::vector<std::string> names;
  for (int i = 0; i <= static_cast<int>(Violation::kStepAgainstBrake); ++i) {
    const std::string name = nameOf(static_cast<Violation>(i));
    EXPECT_EQ(std::count(names.begin(), names.end(), name), 0) << name;
    names.push_back(name);
  }
  EXPECT_EQ(names.front(), "short step high");
}

RigAxisSpec cwCcwSpec() {
  RigAxisSpec spec = plainAxis("dm542");  // 2.5 us high and low, 5 us between the two inputs
  spec.chip.step_inputs = driver::StepInputs::kCwCcw;
  spec.microsteps = 2;
  return spec;
}

TEST(RigViolations, OfCwAndCcwInputs) {
  HandRig clean(cwCcwSpec());
  clean.request("x.step", false).request("x.dir", false).request("x.enable", false);
  clean.wait(1'000'000'000).pulse(3).pulse(5, "x.dir").pulse(1);
  EXPECT_TRUE(saw(clean, {}));
  EXPECT_EQ(clean.report().pulses_forward, 4);
  EXPECT_EQ(clean.report().pulses_backward, 5);
  EXPECT_NEAR(clean.report().carriage, -0.1, 1e-9);

  HandRig both(cwCcwSpec());
  both.request("x.step", false).request("x.dir", false).request("x.enable", false);
  both.wait(1'000'000'000).set("x.step", true).wait(10'000).set("x.dir", true);
  EXPECT_GE(both.report().violations[Violation::kBothInputs], 1);

  for (const std::int64_t gap : {5'000, 4'999}) {
    HandRig close(cwCcwSpec());
    close.request("x.step", false).request("x.dir", false).request("x.enable", false);
    close.wait(1'000'000'000).set("x.step", true).wait(10'000).set("x.step", false).wait(gap);
    close.set("x.dir", true);
    EXPECT_TRUE(saw(close, gap == 5'000 ? Violations{} : Violations{{Violation::kDirSetup, 1}}));
  }
}

TEST(RigViolations, OfStepsOnBothEdges) {
  RigAxisSpec spec = plainAxis("tb6600");
  spec.chip.both_edges = true;
  spec.chip.timing.step_high_ns = 3'000;
  spec.chip.timing.step_low_ns = 4'000;
  const auto edges = [&spec](std::int64_t high, std::int64_t low) {
    HandRig bench(spec);
    bench.request("x.step", false).request("x.dir", true).request("x.enable", false);
    bench.wait(1'000'000'000).set("x.step", true).wait(high).set("x.step", false).wait(low);
    bench.set("x.step", true);
    EXPECT_EQ(bench.report().pulses_forward, 3);
    return bench.report().violations;
  };
  EXPECT_EQ(edges(3'000, 4'000), Violations{});
  EXPECT_EQ(edges(2'999, 4'000), (Violations{{Violation::kShortStepHigh, 1}}));
  EXPECT_EQ(edges(3'000, 3'999), (Violations{{Violation::kShortStepLow, 1}}));
}

}  // namespace
}  // namespace stepdriver::sim
