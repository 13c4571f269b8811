#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "support/homing_bench.h"

namespace stepdriver::test {

/// An input with a name, whose line is io.name.
inline config::InputConfig inputNamed(const std::string& name) {
  config::InputConfig input;
  input.name = name;
  input.line = {"io." + name, true, Bias::kAsIs};
  return input;
}

/// A flag that is an input with a name.
/// @param from, to [mm] where the carriage presses it
inline sim::SwitchSpec flagOf(const std::string& name, double from, double to) {
  sim::SwitchSpec contact;
  contact.line = "io." + name;
  contact.active_level = true;
  contact.position = from;
  contact.end = to;
  return contact;
}

/// An axis without endstops that is homed to a block towards min, which the input stall reports.
inline config::AxisConfig blockAxis(int approaches = 1) {
  config::AxisConfig config = homingAxis();
  config.endstop_min.reset();
  config.endstop_max.reset();
  config.homing->kind = config::HomingKind::kBlock;
  config.homing->input = "stall";
  config.homing->approaches = approaches;
  config.homing->latch_speed = approaches == 2 ? 0.01 : 0.0;
  return config;
}

/// An axis that is homed to a flag from 20 to 30 mm, of which the edge at 20 mm counts on the way
/// to max.
inline config::AxisConfig flagAxis(config::HomingKind kind = config::HomingKind::kFlag) {
  config::AxisConfig config = homingAxis();
  config.homing->kind = kind;
  config.homing->at_max = true;
  config.homing->input = "flag";
  config.homing->pull_off = 0.0;
  return config;
}

/// An axis that is homed to an index, which comes each 40 mm.
/// @param flag the input that is passed before it; empty: there is none
inline config::AxisConfig indexAxis(const std::string& flag = "") {
  config::AxisConfig config = flagAxis(config::HomingKind::kIndex);
  config.homing->input = "index";
  config.homing->flag = flag;
  config.steps_per_round = 3200.0;
  return config;
}

/// Where x starts, and how its sensors are.
struct HomingRig {
  double start = 0.0;       // [mm]
  double hysteresis = 0.0;  // [mm] of the flag and the index
  int bounces = 0;          // What tells the trigger point bounces so often.
  bool has_flag = true;
  bool has_index = true;
  double flag_every = 0.0;  // [mm] 0: there is one flag
};

/// A machine of the axis x, which is homed to something else than a limit switch. On the rig its
/// endstops are at -100 mm and 100 mm.
class HomingKindsTest : public testing::Test {
 protected:
  using Rig = HomingRig;

  void build(const config::AxisConfig& config, const std::vector<config::InputConfig>& inputs,
             const std::function<void(sim::RigAxisSpec&)>& change) {
    std::vector<sim::RigAxisSpec> specs = Bench::rigAxes({config});
    change(specs[0]);
    machine::MachineOptions options;
    options.inputs = inputs;
    bench = std::make_unique<Bench>(std::vector<config::AxisConfig>{config}, specs, false, 0.0,
                                    options);
  }

  /// A block at -80 mm. Its report comes with the first step that it stops, or bounces from the
  /// step to it on.
  void buildBlock(const config::AxisConfig& config, const Rig& rig = {}, bool wired = true) {
    build(config, {inputNamed("stall")}, [&](sim::RigAxisSpec& spec) {
      spec.start = rig.start;
      spec.block_min = -80.0;
      if (!wired) return;
      if (rig.bounces == 0) {
        spec.stall_line = "io.stall";
        return;
      }
      sim::SwitchSpec contact = flagOf("stall", -90.0, -80.0);
      contact.bounces = rig.bounces;
      contact.bounce_ns = 200'000;
      spec.flags.push_back(contact);
    });
  }

  /// A flag from 20 to 30 mm, and an index each 40 mm.
  void buildFlag(const config::AxisConfig& config, const Rig& rig) {
    config::InputConfig flag = inputNamed("flag");
    flag.debounce_ns = 2'000'000;
    build(config, {flag, inputNamed("index")}, [&](sim::RigAxisSpec& spec) {
      spec.start = rig.start;
      const auto add = [&](sim::SwitchSpec contact, double every) {
        contact.every = every;
        contact.hysteresis = rig.hysteresis;
        contact.bounces = rig.bounces;
        contact.bounce_ns = bounce_ns;
        spec.flags.push_back(contact);
      };
      if (rig.has_flag) add(flagOf("flag", 20.0, 30.0), rig.flag_every);
      if (rig.has_index) add(flagOf("index", index_at, index_at + 0.1), 40.0);
    });
  }

  axis::Axis& x() { return bench->axis(); }
  double carriage() { return bench->report().carriage / 1000.0; }

  /// [steps] How far the home position is from where it should be, by the carriage.
  /// @param trigger [m] where the carriage was at the trigger point.
  double errorOf(double trigger) {
    const config::AxisConfig& config = x().config();
    return (x().state().position - config.homing->offset - (carriage() - trigger)) *
           config.steps_per_unit;
  }

  /// Expects the axis homed. @return [steps] see errorOf()
  double homed(double trigger, const std::string& what) {
    const axis::HomingResult result = x().home();
    EXPECT_EQ(result.end, axis::HomingEnd::kHomed) << what << ": " << result.message;
    EXPECT_EQ(violationsOf(bench->report()), "") << what;
    return errorOf(trigger);
  }

  /// Expects that a homing fails, and says this.
  void expectFails(const std::string& words, const std::string& what = "") {
    const axis::HomingResult result = x().home();
    EXPECT_EQ(result.end, axis::HomingEnd::kFailed) << what;
    EXPECT_NE(result.message.find(words), std::string::npos) << what << ": " << result.message;
    EXPECT_FALSE(x().state().homed) << what;
    EXPECT_FALSE(x().state().moving) << what;
    EXPECT_EQ(violationsOf(bench->report()), "") << what;
  }

  std::unique_ptr<Bench> bench;
  double index_at = 25.0;            // [mm] the first one of a turn: -15 mm, 25 mm and 65 mm
  std::int64_t bounce_ns = 200'000;  // That long a flag or an index bounces.
};

}  // namespace stepdriver::test
