#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <functional>
#include <iterator>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/homing_bench.h"

// Homings to something else than a limit switch, on the rig: 80 steps/mm, endstops at -100 mm and
// 100 mm.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingResult;
using config::HomingKind;
using test::Bench;
using test::homingAxis;
using test::kStep;
using test::violationsOf;

class HomingKinds : public testing::Test {
 protected:
  /// A machine of one axis.
  void build(const config::AxisConfig& config, const std::vector<config::InputConfig>& inputs,
             const std::function<void(sim::RigAxisSpec&)>& change) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    change(specs[0]);
    machine::MachineOptions options;
    options.inputs = inputs;
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config}, specs, false, 0.0,
                                    options);
  }

  axis::Axis& x() { return bench->axis(); }
  double carriage() { return bench->report().carriage / 1000.0; }

  /// [steps] How far the home position is from where it should be, by the carriage.
  /// @param trigger [m] where the carriage was at the trigger point.
  double errorOf(double trigger) {
    const double offset = x().config().homing->offset;
    return (x().state().position - offset - (carriage() - trigger)) / kStep;
  }

  std::unique_ptr<Bench> bench;
};

config::InputConfig inputOf(const std::string& name) {
  config::InputConfig input;
  input.name = name;
  input.line = {"io." + name, true, Bias::kAsIs};
  return input;
}

// ---- a block ----

config::AxisConfig blockAxis(int approaches = 1) {
  config::AxisConfig config = homingAxis();
  config.endstop_min.reset();
  config.endstop_max.reset();
  config.homing->kind = HomingKind::kBlock;
  config.homing->input = "stall";
  config.homing->approaches = approaches;
  config.homing->latch_speed = approaches == 2 ? 0.01 : 0.0;
  return config;
}

class HomingToBlockTest : public HomingKinds {
 protected:
  /// The block is at -80 mm.
  void buildBlock(const config::AxisConfig& config, double start = 0.0, bool wired = true) {
    build(config, {inputOf("stall")}, [&](sim::RigAxisSpec& spec) {
      spec.start = start;
      spec.block_min = -80.0;
      if (wired) spec.stall_line = "io.stall";
    });
  }
};

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

TEST_F(HomingToBlockTest, FromAnyPlaceFindsTheSameOne) {
  std::mt19937 random(37);
  std::uniform_real_distribution<double> starts(-79.9, 60.0);
  double least = 1e9;
  double most = -1e9;
  for (int i = 0; i < 1000; ++i) {
    const double start = std::round(starts(random) * 80.0) / 80.0;
    buildBlock(blockAxis(1 + i % 2), start);
    const HomingResult result = x().home();
    ASSERT_EQ(result.end, HomingEnd::kHomed) << start << ": " << result.message;
    least = std::min(least, errorOf(-0.08));
    most = std::max(most, errorOf(-0.08));
  }
  EXPECT_LE(most - least, 1.0);
  RecordProperty("spread_in_thousandths_of_a_step", static_cast<int>(1e3 * (most - least)));
}

TEST_F(HomingToBlockTest, SaysThatNothingReportedTheBlock) {
  config::AxisConfig config = blockAxis();
  config.homing->max_travel = 0.1;
  buildBlock(config, 0.0, false);
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
    build(blockAxis(), {inputOf("probe")}, [](sim::RigAxisSpec& /*spec*/) {});
    ADD_FAILURE() << "the machine was made";
  } catch (const ConfigError& error) {
    EXPECT_NE(
        std::string(error.what())
            .find("axes/x/homing/input: is \"stall\", but must be the name of an input: probe"),
        std::string::npos)
        << error.what();
  }
}

// ---- the final position ----

TEST_F(HomingKinds, StandsAtTheFinalPositionWithANumberOfItsOwn) {
  config::AxisConfig config = homingAxis();
  config.homing->final_position = 0.03;
  build(config, {}, [](sim::RigAxisSpec& /*spec*/) {});
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(result.position, 0.03, kStep);
  EXPECT_NEAR(carriage(), 0.03, 1.5 * kStep);
}

// ---- where it stands ----

TEST_F(HomingKinds, ADirectHomingMakesNoStep) {
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

TEST_F(HomingKinds, ADirectHomingIsRefusedWhileTheAxisIsDisabled) {
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
