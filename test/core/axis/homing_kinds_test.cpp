#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iterator>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/forgetful_rig.h"
#include "support/homing_kinds_bench.h"

// Homings to something else than a limit switch, on the rig: 80 steps/mm, endstops at -100 mm and
// 100 mm.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingResult;
using config::HomingKind;
using test::Bench;
using test::blockAxis;
using test::flagAxis;
using test::flagOf;
using test::ForgetfulRig;
using test::homingAxis;
using test::HomingKindsTest;
using test::indexAxis;
using test::inputNamed;
using test::kStep;
using test::violationsOf;

// ---- a block ----

class HomingToBlockTest : public HomingKindsTest {};

TEST_F(HomingToBlockTest, EndsAtTheFirstStepThatTheBlockStops) {
  buildBlock(blockAxis());
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_TRUE(x().state().homed);
  EXPECT_TRUE(x().state().position_valid);
  EXPECT_NEAR(carriage(), -0.078, 1e-9);
  EXPECT_NEAR(errorOf(-0.08), 0.0, 1e-6);
  EXPECT_EQ(violationsOf(bench->report()), "");
}

TEST_F(HomingToBlockTest, ComesAgainSlowlyIfTwoApproachesAreConfigured) {
  buildBlock(blockAxis(2));
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(errorOf(-0.08), 0.0, 1e-6);
  // 0.01 m/s are 800 steps/s.
  const auto steps = bench->trace->times("x", "step", true);
  const std::int64_t stalled = bench->trace->times("x", "stall", true).back();
  const auto last = std::find(steps.begin(), steps.end(), stalled);
  ASSERT_NE(last, steps.end());
  EXPECT_NEAR(static_cast<double>(*last - *std::prev(last)), 1e9 / 800.0, 2.0);
}

TEST_F(HomingToBlockTest, SaysThatNothingReportedTheBlock) {
  config::AxisConfig config = blockAxis();
  config.homing->max_travel = 0.1;
  buildBlock(config, {}, false);
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_EQ(result.message,
            "x isn't homed: the input stall didn't report a block within max_travel, 0.1 m; it "
            "stands at -0.1 m");
  EXPECT_FALSE(x().state().homed);
  EXPECT_FALSE(x().state().position_valid);
}

TEST_F(HomingToBlockTest, SaysThatTheReportWasThereBeforeTheFirstStep) {
  buildBlock(blockAxis());
  bench->rig.stickInput("stall", true, bench->clock.now());
  const HomingResult result = x().home();
  EXPECT_EQ(result.message,
            "x isn't homed: the input stall reports a block before the axis has moved; it stands "
            "at 0 m");
  EXPECT_EQ(bench->pulses(), 0);
}

// Something else has ended the first approach.
TEST_F(HomingToBlockTest, SaysThatTheSecondApproachMetNoBlock) {
  buildBlock(blockAxis(2));
  bool pressed = false;
  const HomingResult result = x().home([&] {
    if (!pressed && x().state().position < -0.04) {
      bench->rig.pressInput("stall", true, bench->clock.now());
      bench->rig.pressInput("stall", false, bench->clock.now());
      pressed = true;
    }
    return false;
  });
  EXPECT_TRUE(pressed);
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_NE(result.message.find(
                "the input stall didn't report a block again within 0.002 m of the place of the "
                "first one"),
            std::string::npos)
      << result.message;
}

// A report that never ends would be taken for the block of the second approach.
TEST_F(HomingToBlockTest, SaysThatTheReportDoesNotEndAfterTheFirstApproach) {
  buildBlock(blockAxis(2));
  const HomingResult result = x().home([&] {
    if (x().state().homing == axis::HomingPhase::kBackingOff) {
      bench->rig.stickInput("stall", true, bench->clock.now());
    }
    return false;
  });
  EXPECT_EQ(result.message,
            "x isn't homed: the input stall still reports a block 0.002 m off it; it stands at "
            "-0.07801 m");
  EXPECT_FALSE(x().state().position_valid);
}

TEST_F(HomingToBlockTest, SaysThatNothingReportedTheBlockInTime) {
  config::AxisConfig config = blockAxis(2);
  config.homing->timeout = 1.0;  // the block is 1.6 s away
  buildBlock(config);
  expectFails("x isn't homed: the input stall didn't report a block within timeout_s, 1 s");
  EXPECT_FALSE(x().state().position_valid);
  config.homing->latch_speed = 0.001;  // 2 s for the second approach
  config.homing->timeout = 3.0;
  buildBlock(config);
  expectFails("the input stall didn't report a block again within timeout_s, 3 s");
}

// The drivers' outputs for stalls are pulses: between two steps nothing may read them.
TEST_F(HomingToBlockTest, TakesAReportThatIsShorterThanTheTimeBetweenTwoSteps) {
  config::AxisConfig config = blockAxis();
  config.homing->seek_speed = 0.0001;  // 8 steps/s
  config.homing->max_travel = 0.001;
  config.homing->pull_off = 0.0;
  buildBlock(config);
  bool pressed = false;
  const HomingResult result = x().home([&] {
    if (!pressed && bench->pulses() == -4) {
      bench->rig.pressInput("stall", true, bench->clock.now());
      bench->rig.pressInput("stall", false, bench->clock.now());
      pressed = true;
    }
    return false;
  });
  EXPECT_TRUE(pressed);
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_EQ(bench->pulses(), -4);
}

TEST_F(HomingToBlockTest, IsHeldAndGoesOn) {
  buildBlock(blockAxis(2));
  int looks = 0;
  const HomingResult result = x().home([&] {
    if (++looks % 20 == 0) {
      bench->machine->hold();
      bench->machine->advance(0.2);
      bench->machine->resume();
    }
    return false;
  });
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_GT(looks, 20);
  EXPECT_NEAR(errorOf(-0.08), 0.0, 1e-6);
}

TEST_F(HomingToBlockTest, EndsWithAStopADisableAndAnEmergencyStop) {
  const std::vector<std::function<void()>> ends{[this] { x().stop(); },
                                                [this] { x().enable(false); },
                                                [this] { bench->machine->emergencyStop(); }};
  for (std::size_t i = 0; i < ends.size(); ++i) {
    buildBlock(blockAxis());
    bool done = false;
    const HomingResult result = x().home([&] {
      if (!done && x().state().position < -0.02) {
        done = true;
        ends[i]();
      }
      return false;
    });
    EXPECT_TRUE(done);
    EXPECT_EQ(result.end, HomingEnd::kFailed) << i;
    EXPECT_FALSE(x().state().homed) << i;
    EXPECT_FALSE(x().state().position_valid) << i;
    EXPECT_GT(carriage(), -0.05) << i;
  }
}

// A driver that reports stalls and faults on one line: in an approach it is no fault.
TEST_F(HomingToBlockTest, CanBeReportedByTheFaultOutputOfTheDriver) {
  config::AxisConfig config = blockAxis();
  config.homing->input = "";
  config.driver = driver::driverChip("drv8825");
  config.fault = config::FaultPin{"x.diag", Bias::kAsIs};
  build(config, {}, [&](sim::RigAxisSpec& spec) {
    spec.block_min = -80.0;
    spec.stall_line = "x.diag";
    spec.stall_active = *config.driver.fault_active;
  });
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_EQ(x().state().fault, "");
  EXPECT_NEAR(errorOf(-0.08), 0.0, 1e-6);
  // In any other motion it is one.
  x().moveTo(-0.105);
  for (int i = 0; i < 100; ++i) bench->machine->advance(0.01);  // each reads the inputs
  EXPECT_NE(x().state().fault, "");
}

TEST_F(HomingToBlockTest, NeedsAnInputThatIsThere) {
  try {
    build(blockAxis(), {inputNamed("probe")}, [](sim::RigAxisSpec& /*spec*/) {});
    ADD_FAILURE() << "the machine was made";
  } catch (const ConfigError& error) {
    EXPECT_NE(
        std::string(error.what())
            .find("axes/x/homing/input: is \"stall\", but must be the name of an input: probe"),
        std::string::npos)
        << error.what();
  }
}

// ---- a flag ----

class HomingToFlagTest : public HomingKindsTest {};

TEST_F(HomingToFlagTest, TakesTheEdgeFromTheSameSideWhereverItStarts) {
  for (const double start : {-99.0, 0.0, 20.0, 25.0, 30.0, 35.0, 99.0, 100.0}) {
    buildFlag(flagAxis(), {start});
    EXPECT_NEAR(homed(0.02, std::to_string(start)), 0.5, 0.51) << start;
  }
}

TEST_F(HomingToFlagTest, FindsTheMiddleWhateverTheHysteresis) {
  buildFlag(flagAxis(HomingKind::kFlagCentre), {});
  const double without = homed(0.025, "without");
  // The switch opens 2 mm beyond each edge.
  buildFlag(flagAxis(HomingKind::kFlagCentre), {0.0, 2.0});
  EXPECT_NEAR(homed(0.025, "with"), without, 1e-6);
}

TEST_F(HomingToFlagTest, AFlagOnARotaryAxisNeedsNoEndstop) {
  config::AxisConfig config = flagAxis();
  config.endstop_min.reset();
  config.endstop_max.reset();
  buildFlag(config, {50.0});
  // Beyond the flag: without an endstop to turn at, it isn't found within the travel.
  const HomingResult result = x().home();
  EXPECT_EQ(result.message,
            "x isn't homed: the input flag didn't become active within max_travel, 0.3 m; it "
            "stands at 0.3 m");
  Rig turning;
  turning.start = 50.0;
  turning.flag_every = 100.0;
  buildFlag(config, turning);
  EXPECT_NEAR(homed(0.12, "turning"), 0.5, 0.51);
}

TEST_F(HomingToFlagTest, SaysThatThereIsNoFlag) {
  buildFlag(flagAxis(), {0.0, 0.0, 0, false});
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kFailed);
  EXPECT_NE(result.message.find("the min endstop was met, and the input flag didn't become active "
                                "between the two"),
            std::string::npos)
      << result.message;
}

TEST_F(HomingToFlagTest, SaysThatTheFlagIsStuck) {
  buildFlag(flagAxis(), {});
  bench->rig.stickInput("flag", true, bench->clock.now());
  const HomingResult stuck = x().home();
  EXPECT_EQ(stuck.end, HomingEnd::kFailed);
  EXPECT_NE(stuck.message.find("the min endstop was met while leaving: the input flag "
                               "didn't become inactive"),
            std::string::npos)
      << stuck.message;
  config::AxisConfig config = flagAxis();
  config.homing->max_travel = 0.05;
  buildFlag(config, {});
  bench->rig.stickInput("flag", true, bench->clock.now());
  EXPECT_NE(x().home().message.find("the input flag didn't become inactive within max_travel"),
            std::string::npos);
}

TEST_F(HomingToFlagTest, SaysThatTheFlagBreaksBeforeTheLatch) {
  config::AxisConfig config = flagAxis();
  config.homing->max_travel = 0.05;
  buildFlag(config, {});
  const HomingResult result = x().home([&] {
    if (x().state().homing == axis::HomingPhase::kLatching) {
      bench->rig.stickInput("flag", false, bench->clock.now());
    }
    return false;
  });
  EXPECT_NE(result.message.find("the input flag didn't become active again within max_travel"),
            std::string::npos)
      << result.message;
}

TEST_F(HomingToFlagTest, TheTimeoutNamesTheFlag) {
  config::AxisConfig config = flagAxis();
  config.homing->timeout = 0.2;
  buildFlag(config, {});
  EXPECT_NE(x().home().message.find("the input flag didn't become active within timeout_s, 0.2 s"),
            std::string::npos);
}

TEST_F(HomingToFlagTest, TheTimeoutOfTheMiddleNamesTheFlagInEachPhase) {
  struct Case {
    double timeout;  // [s]
    const char* words;
  };
  for (const Case& each :
       {Case{0.2, "the input flag didn't become active within timeout_s, 0.2 s; it stands at 0.01"},
        Case{0.8, "the input flag didn't become active again within timeout_s, 0.8 s"},
        Case{1.0,
             "the input flag didn't become inactive within timeout_s, 1 s; it stands at 0.020"},
        Case{3.2,
             "the input flag didn't become inactive within timeout_s, 3.2 s; it stands at "
             "0.028"}}) {
    config::AxisConfig config = flagAxis(HomingKind::kFlagCentre);
    config.homing->timeout = each.timeout;
    buildFlag(config, {});
    expectFails(each.words, std::to_string(each.timeout));
  }
}

TEST_F(HomingToFlagTest, SaysThatTheFlagBouncesWithoutEnd) {
  bounce_ns = 700'000;
  for (const config::AxisConfig& config :
       {flagAxis(), flagAxis(HomingKind::kFlagCentre), indexAxis("flag")}) {
    buildFlag(config, {0.0, 0.0, 1'000'000});
    expectFails(
        "x isn't homed: the input flag bounces without end: after 100 ms it still hasn't been at "
        "rest for debounce_ms, 2 ms");
  }
}

TEST_F(HomingToFlagTest, IsHeldAtAnyMomentAndFindsTheSamePlace) {
  buildFlag(flagAxis(), {});
  const double undisturbed = homed(0.02, "undisturbed");
  for (int period = 20; period < 100; period += 8) {
    buildFlag(flagAxis(), {});
    int looks = 0;
    const HomingResult result = x().home([&] {
      if (++looks % period == 0) {
        bench->machine->hold();
        bench->machine->advance(0.3);
        bench->machine->resume();
      }
      return false;
    });
    EXPECT_EQ(result.end, HomingEnd::kHomed) << period << ": " << result.message;
    EXPECT_NEAR(errorOf(0.02), undisturbed, 1e-3) << period;
  }
}

TEST_F(HomingToFlagTest, EndsWithAStopADisableAndAnEmergencyStopInAnyPhase) {
  const std::vector<std::function<void()>> ends{[this] { x().stop(); },
                                                [this] { x().enable(false); },
                                                [this] { bench->machine->emergencyStop(); }};
  for (const auto phase : {axis::HomingPhase::kSeeking, axis::HomingPhase::kBackingOff,
                           axis::HomingPhase::kLatching}) {
    for (const auto& end : ends) {
      buildFlag(flagAxis(), {});
      bool done = false;
      const HomingResult result = x().home([&] {
        if (!done && x().state().homing == phase) {
          done = true;
          end();
        }
        return false;
      });
      EXPECT_TRUE(done);
      EXPECT_EQ(result.end, HomingEnd::kFailed) << axis::nameOf(phase);
      EXPECT_FALSE(x().state().homed);
      EXPECT_FALSE(x().state().moving);
    }
  }
}

TEST_F(HomingToFlagTest, KnowsThePlaceOfTheJointWithABacklash) {
  config::AxisConfig config = flagAxis();
  config.backlash = 0.001;
  build(config, {inputNamed("flag")},
        [](sim::RigAxisSpec& spec) { spec.flags.push_back(flagOf("flag", 20.0, 30.0)); });
  // The rig has no backlash: on the way to max the joint is a whole one behind.
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  const double joint = bench->pulses() * kStep - x().state().slack;
  const double trigger = 0.02 - 0.5 * kStep - 0.001;
  EXPECT_NEAR(x().state().position - config.homing->offset, joint - trigger, 1e-9);
}

struct ForgetfulHoming {
  HomingResult result;
  double error = 0.0;  // [steps] of the home position
};

/// A homing from 0 to the flag from 20 to 30 mm, or to its middle.
ForgetfulHoming homeForgetful(HomingKind kind, const std::function<bool(int)>& loses) {
  const config::AxisConfig config = flagAxis(kind);
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
  specs[0].flags.push_back(flagOf("flag", 20.0, 30.0));
  machine::MachineOptions options;
  options.inputs = {inputNamed("flag")};
  ForgetfulRig rig(specs, nullptr, {}, {}, Bench::ioOf(options));
  rig.forget(loses);
  pulse::VirtualClock clock;
  gpio::SimulatedBackend backend(rig, [&clock] { return clock.now(); });
  test::UnthreadedMachine machine({config}, backend, clock, options);
  ForgetfulHoming homing{machine.axis("x").home()};
  const double trigger = kind == HomingKind::kFlag ? 0.02 : 0.025;
  homing.error = (homing.result.position - config.homing->offset -
                  (rig.report("x").carriage / 1000.0 - trigger)) /
                 kStep;
  return homing;
}

// Whichever edges are lost, the place of the one that counts is exact. Without a loss the latch to
// the flag is its third edge, and those to its middle are the third to the sixth.
TEST_F(HomingToFlagTest, ApproachesAgainIfTheKernelHasLostTheEdge) {
  for (const HomingKind kind : {HomingKind::kFlag, HomingKind::kFlagCentre}) {
    const double usual = homeForgetful(kind, [](int) { return false; }).error;
    for (int first = 1; first <= 8; ++first) {
      for (int last = first; last <= 8; ++last) {
        const ForgetfulHoming homing =
            homeForgetful(kind, [first, last](int edge) { return edge >= first && edge <= last; });
        if (homing.result.end == HomingEnd::kFailed) {
          EXPECT_NE(homing.result.message.find("no edge of the input flag"), std::string::npos)
              << homing.result.message;
          EXPECT_GE(last - first, 4) << "three approaches need more";
          continue;
        }
        EXPECT_NEAR(homing.error, usual, 1e-3) << first << " to " << last;
      }
    }
  }
}

TEST_F(HomingToFlagTest, FailsIfTheKernelReportsNoEdgeOfTheFlag) {
  const ForgetfulHoming homing = homeForgetful(HomingKind::kFlag, [](int) { return true; });
  EXPECT_EQ(homing.result.end, HomingEnd::kFailed);
  EXPECT_NE(homing.result.message.find(
                "x isn't homed: the kernel has reported no edge of the input flag when it changed, "
                "in 3 approaches: its place is only known to the time between two readings"),
            std::string::npos)
      << homing.result.message;
}

// ---- an index ----

TEST_F(HomingToFlagTest, TakesTheIndexAfterTheFlag) {
  index_at = 38.0;  // 18 mm from the flag's edge
  buildFlag(indexAxis("flag"), {});
  EXPECT_NEAR(homed(0.038, "after the flag"), 0.5, 0.51);
  EXPECT_EQ(x().home().message.find("may be taken"), std::string::npos);
}

TEST_F(HomingToFlagTest, WarnsIfTheIndexIsNearTheFlagsEdge) {
  const config::AxisConfig config = indexAxis("flag");
  index_at = 22.0;
  buildFlag(config, {});
  HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed);
  EXPECT_NE(result.message.find("the index index comes 5 % of a turn from the edge of the input "
                                "flag"),
            std::string::npos)
      << result.message;
  index_at = 18.8;  // the next one comes at 58.8 mm
  buildFlag(config, {});
  result = x().home();
  EXPECT_NEAR(errorOf(0.0588), 0.5, 0.51);
  EXPECT_NE(result.message.find("comes 3 % of a turn"), std::string::npos) << result.message;
}

TEST_F(HomingToFlagTest, SaysThatNoIndexComesWithinATurn) {
  const config::AxisConfig config = indexAxis("flag");
  buildFlag(config, {});
  bench->rig.stickInput("index", false, bench->clock.now());
  const HomingResult result = x().home();
  EXPECT_NE(result.message.find(
                "the index index didn't come within a turn of the edge of the input flag"),
            std::string::npos)
      << result.message;
}

TEST_F(HomingToFlagTest, AnIndexAloneIsTheNextOne) {
  const config::AxisConfig config = indexAxis();
  for (const double start : {-14.0, 0.0, 24.9, 25.0, 25.1}) {
    buildFlag(config, {start});
    EXPECT_NEAR(homed(0.025, std::to_string(start)), 0.5, 0.51) << start;
  }
  buildFlag(config, {26.0});
  EXPECT_NEAR(homed(0.065, "26"), 0.5, 0.51);
}

TEST_F(HomingToFlagTest, TheTimeoutNamesTheIndex) {
  for (const std::string flag : {"flag", ""}) {
    config::AxisConfig config = indexAxis(flag);
    config.homing->timeout = flag.empty() ? 1.0 : 3.0;
    index_at = 38.0;
    buildFlag(config, {});
    expectFails("x isn't homed: the index index didn't come within timeout_s", flag);
  }
}

TEST_F(HomingToFlagTest, SaysThatAnIndexAloneDoesNotComeWithinTheTravel) {
  config::AxisConfig config = indexAxis();
  config.homing->max_travel = 0.02;  // it is 25 mm away
  buildFlag(config, {});
  expectFails("x isn't homed: the index index didn't come within max_travel, 0.02 m; it stands at");
  EXPECT_EQ(bench->pulses(), 1600);
}

TEST_F(HomingToFlagTest, SaysThatAnIndexIsStuckActive) {
  const auto expect_stuck = [this](const config::AxisConfig& config, const std::string& words) {
    buildFlag(config, {});
    bench->rig.stickInput("index", true, bench->clock.now());
    expectFails(words);
  };
  config::AxisConfig alone = indexAxis();
  expect_stuck(alone,
               "the min endstop was met while leaving: the input index didn't become inactive");
  alone.homing->max_travel = 0.02;
  expect_stuck(alone, "the input index didn't become inactive within max_travel, 0.02 m");
  alone.homing->timeout = 0.2;
  expect_stuck(alone, "the input index didn't become inactive within timeout_s, 0.2 s");
  expect_stuck(indexAxis("flag"),
               "the index index didn't come within a turn of the edge of the input flag");
}

// ---- where it stands ----

TEST_F(HomingKindsTest, ADirectHomingMakesNoStep) {
  config::AxisConfig config = homingAxis();
  config.homing = config::HomingConfig{};
  config.homing->kind = HomingKind::kDirect;
  config.homing->offset = 0.25;
  build(config, {}, [](sim::RigAxisSpec& /*spec*/) {});
  x().setPosition(0.0);
  bench->move(0.01);
  const std::int64_t pulses = bench->pulses();
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed);
  EXPECT_EQ(result.message, "x is homed, and stands at 0.25 m");
  EXPECT_TRUE(x().state().homed);
  EXPECT_TRUE(x().state().position_valid);
  EXPECT_NEAR(x().state().position, 0.25, 1e-12);
  EXPECT_EQ(bench->pulses(), pulses);
  bench->move(0.26);
  EXPECT_NEAR(carriage(), 0.02, kStep);
}

TEST_F(HomingKindsTest, ADirectHomingIsRefusedWhileTheAxisIsDisabled) {
  config::AxisConfig config = homingAxis();
  config.homing = config::HomingConfig{};
  config.homing->kind = HomingKind::kDirect;
  build(config, {}, [](sim::RigAxisSpec& /*spec*/) {});
  x().enable(false);
  EXPECT_THROW(x().home(), Refused);
  EXPECT_FALSE(x().state().homed);
}

}  // namespace
}  // namespace stepdriver
