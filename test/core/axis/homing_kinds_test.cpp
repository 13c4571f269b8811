#include <gtest/gtest.h>

#include <algorithm>
#include <array>
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
    const bool is_missing = i % 20 == 19;
    buildBlock(blockAxis(1 + i % 2), start, !is_missing);
    const HomingResult result = x().home();
    if (is_missing) {
      ASSERT_NE(result.message.find("the input stall didn't report a block within max_travel"),
                std::string::npos)
          << start << ": " << result.message;
      continue;
    }
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

// ---- a flag ----

// A flag from 20 to 30 mm, of which the edge at 20 mm counts on the way to max.
config::AxisConfig flagAxis(HomingKind kind = HomingKind::kFlag) {
  config::AxisConfig config = homingAxis();
  config.homing->kind = kind;
  config.homing->at_max = true;
  config.homing->input = "flag";
  config.homing->pull_off = 0.0;
  return config;
}

class HomingToFlagTest : public HomingKinds {
 protected:
  struct Rig {
    double start = 0.0;  // [mm]
    double hysteresis = 0.0;
    int bounces = 0;
    bool has_flag = true;
  };

  void buildFlag(const config::AxisConfig& config, const Rig& rig) {
    config::InputConfig flag = inputOf("flag");
    flag.debounce_ns = 2'000'000;
    build(config, {flag, inputOf("index")}, [&](sim::RigAxisSpec& spec) {
      spec.start = rig.start;
      sim::SwitchSpec contact;
      contact.line = "io.flag";
      contact.active_level = true;
      contact.position = 20.0;
      contact.end = 30.0;
      contact.hysteresis = rig.hysteresis;
      contact.bounces = rig.bounces;
      contact.bounce_ns = 200'000;
      if (rig.has_flag) spec.flags.push_back(contact);
      // A turn of 40 mm: at -15 mm, 25 mm and 65 mm.
      contact = sim::SwitchSpec{};
      contact.line = "io.index";
      contact.active_level = true;
      contact.position = index_at;
      contact.end = index_at + 0.1;
      contact.every = 40.0;
      spec.flags.push_back(contact);
    });
  }

  /// Expects the axis homed. @return [steps] see errorOf()
  double homed(double trigger, const std::string& what) {
    const HomingResult result = x().home();
    EXPECT_EQ(result.end, HomingEnd::kHomed) << what << ": " << result.message;
    EXPECT_EQ(violationsOf(bench->report()), "") << what;
    return errorOf(trigger);
  }

  /// A homing whose flag is missing, or doesn't change, must fail and name it.
  /// @param active what it always tells; empty: it isn't there
  void expectNamed(const config::AxisConfig& config, Rig rig, std::optional<bool> active) {
    rig.has_flag = active.has_value();
    buildFlag(config, rig);
    if (active) bench->rig.stickInput("flag", *active, bench->clock.now());
    const HomingResult result = x().home();
    const std::string what = active ? *active ? "active" : "inactive" : "missing";
    EXPECT_EQ(result.end, HomingEnd::kFailed) << what << " from " << rig.start;
    EXPECT_NE(result.message.find("the input flag didn't become"), std::string::npos)
        << what << " from " << rig.start << ": " << result.message;
    EXPECT_FALSE(x().state().homed);
    EXPECT_EQ(violationsOf(bench->report()), "") << what;
  }

  /// The spread of the home position over random starts, with random bounces and hysteresis of the
  /// flag. Some of the starts are with a flag that is missing or stuck.
  /// @return [steps] by how much
  double spreadOf(const config::AxisConfig& config, double trigger) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> starts(-99.0, 99.0);
    std::uniform_real_distribution<double> hysteresis(0.0, 0.8);
    const std::array<std::optional<bool>, 3> troubles{std::nullopt, true, false};
    double least = 1e9;
    double most = -1e9;
    for (std::size_t i = 0; i < 1000; ++i) {
      Rig rig;
      rig.start = std::round(starts(random) * 80.0) / 80.0;
      if (i == 1) rig.start = 100.0;  // on the endstop ahead
      rig.hysteresis = hysteresis(random);
      rig.bounces = static_cast<int>(random() % 7);
      if (i % 20 == 19) {
        expectNamed(config, rig, troubles[i / 20 % troubles.size()]);
        if (HasFailure()) return 0.0;
        continue;
      }
      buildFlag(config, rig);
      const double error = homed(trigger, "from " + std::to_string(rig.start));
      if (HasFailure()) return 0.0;
      least = std::min(least, error);
      most = std::max(most, error);
    }
    RecordProperty("spread_in_thousandths_of_a_step", static_cast<int>(1e3 * (most - least)));
    EXPECT_NEAR(most, 0.0, 1.0);
    return most - least;
  }

  double index_at = 25.0;  // [mm]
};

TEST_F(HomingToFlagTest, TakesTheEdgeFromTheSameSideWhereverItStarts) {
  for (const double start : {-99.0, 0.0, 20.0, 25.0, 30.0, 35.0, 99.0, 100.0}) {
    buildFlag(flagAxis(), {start});
    EXPECT_NEAR(homed(0.02, std::to_string(start)), 0.5, 0.51) << start;
  }
}

TEST_F(HomingToFlagTest, FromAnyPlaceFindsTheSameOne) {
  EXPECT_LE(spreadOf(flagAxis(), 0.02), 1.0);
}

TEST_F(HomingToFlagTest, FindsTheMiddleWhateverTheHysteresis) {
  // The switch opens 0.3 mm beyond each edge.
  EXPECT_LE(spreadOf(flagAxis(HomingKind::kFlagCentre), 0.025), 1.0);
  buildFlag(flagAxis(HomingKind::kFlagCentre), {});
  const double without = homed(0.025, "without");
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
  std::vector<sim::RigAxisSpec> specs;
  build(config, {inputOf("flag")}, [](sim::RigAxisSpec& spec) {
    spec.start = 50.0;
    sim::SwitchSpec contact;
    contact.line = "io.flag";
    contact.active_level = true;
    contact.position = 20.0;
    contact.end = 30.0;
    contact.every = 100.0;  // a turn
    spec.flags.push_back(contact);
  });
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
  build(config, {inputOf("flag")}, [](sim::RigAxisSpec& spec) {
    sim::SwitchSpec contact;
    contact.line = "io.flag";
    contact.active_level = true;
    contact.position = 20.0;
    contact.end = 30.0;
    spec.flags.push_back(contact);
  });
  // The rig has no backlash: on the way to max the joint is a whole one behind.
  const HomingResult result = x().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  const double joint = bench->pulses() * kStep - x().state().slack;
  const double trigger = 0.02 - 0.5 * kStep - 0.001;
  EXPECT_NEAR(x().state().position - config.homing->offset, joint - trigger, 1e-9);
}

/// A rig of which the kernel doesn't report some edges.
class ForgetfulRig : public sim::Rig {
 public:
  using sim::Rig::Rig;
  /// @param loses whether the edge with this number, from 1, is lost.
  void forget(std::function<bool(int)> loses) { loses_ = std::move(loses); }
  void watchInput(int line, gpio::EdgeListener listener) override {
    if (!listener) return sim::Rig::watchInput(line, nullptr);
    sim::Rig::watchInput(line, [this, listener](bool level, std::int64_t time_ns) {
      if (!loses_(++edges_)) listener(level, time_ns);
    });
  }

 private:
  std::function<bool(int)> loses_;
  int edges_ = 0;
};

struct ForgetfulHoming {
  HomingResult result;
  double error = 0.0;  // [steps] of the home position
};

/// A homing from 0 to the flag from 20 to 30 mm, or to its middle.
ForgetfulHoming homeForgetful(HomingKind kind, const std::function<bool(int)>& loses) {
  const config::AxisConfig config = flagAxis(kind);
  std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
  sim::SwitchSpec contact;
  contact.line = "io.flag";
  contact.active_level = true;
  contact.position = 20.0;
  contact.end = 30.0;
  specs[0].flags.push_back(contact);
  machine::MachineOptions options;
  options.inputs = {inputOf("flag")};
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
  config::AxisConfig config = flagAxis(HomingKind::kIndex);
  config.homing->input = "index";
  config.homing->flag = "flag";
  config.steps_per_round = 3200.0;  // 40 mm
  index_at = 38.0;                  // 18 mm from the flag's edge
  EXPECT_LE(spreadOf(config, 0.038), 1.0);
  EXPECT_EQ(x().home().message.find("may be taken"), std::string::npos);
}

TEST_F(HomingToFlagTest, WarnsIfTheIndexIsNearTheFlagsEdge) {
  config::AxisConfig config = flagAxis(HomingKind::kIndex);
  config.homing->input = "index";
  config.homing->flag = "flag";
  config.steps_per_round = 3200.0;
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
  config::AxisConfig config = flagAxis(HomingKind::kIndex);
  config.homing->input = "index";
  config.homing->flag = "flag";
  config.steps_per_round = 3200.0;
  buildFlag(config, {});
  bench->rig.stickInput("index", false, bench->clock.now());
  const HomingResult result = x().home();
  EXPECT_NE(result.message.find(
                "the index index didn't come within a turn of the edge of the input flag"),
            std::string::npos)
      << result.message;
}

TEST_F(HomingToFlagTest, AnIndexAloneIsTheNextOne) {
  config::AxisConfig config = flagAxis(HomingKind::kIndex);
  config.homing->input = "index";
  config.steps_per_round = 3200.0;
  for (const double start : {-14.0, 0.0, 24.9, 25.0, 25.1}) {
    buildFlag(config, {start});
    EXPECT_NEAR(homed(0.025, std::to_string(start)), 0.5, 0.51) << start;
  }
  buildFlag(config, {26.0});
  EXPECT_NEAR(homed(0.065, "26"), 0.5, 0.51);
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
