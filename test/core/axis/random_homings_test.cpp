#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "stepdriver_core/axis/axis.h"
#include "support/constants.h"
#include "support/homing_kinds_bench.h"

// Homings from random places, with sensors that bounce and have a hysteresis. They all find the
// same place, or name the sensor that is missing or stuck.

namespace stepdriver {
namespace {

using config::HomingKind;
using test::blockAxis;
using test::flagAxis;
using test::indexAxis;
using test::kStep;
using test::Spread;

constexpr int kMostBounces = 6;  // 2.4 ms, longer than the debounce time

class RandomHomings : public test::HomingKindsTest {
 protected:
  /// How a sensor may be broken, one after the other.
  enum class Trouble { kMissing, kStuckActive, kStuckInactive };

  struct Plan {
    double trigger = 0.0;         // [m]
    double turn = 0.0;            // [m] there is a trigger point each turn; 0: only one
    double first = -99.0;         // [mm] the starts
    double last = 99.0;           // [mm]
    std::string sensor = "flag";  // which is broken at every 20th start
    double flag_every = 0.0;      // [mm]
    int starts = 1000;
  };

  /// [mm] A whole microstep.
  double drawStart(double first, double last, double steps_per_mm = 80.0) {
    const double start = std::uniform_real_distribution<double>(first, last)(random_);
    return std::round(start * steps_per_mm) / steps_per_mm;
  }
  int drawBounces() { return static_cast<int>(random_() % (kMostBounces + 1)); }

  /// The homing must fail, and name the sensor.
  void expectNamed(const config::AxisConfig& config, Rig rig, const std::string& sensor,
                   Trouble trouble) {
    if (trouble == Trouble::kMissing) (sensor == "flag" ? rig.has_flag : rig.has_index) = false;
    buildFlag(config, rig);
    if (trouble != Trouble::kMissing) {
      bench->rig.stickInput(sensor, trouble == Trouble::kStuckActive, bench->clock.now());
    }
    const bool must_leave = config.homing->flag.empty() && trouble == Trouble::kStuckActive;
    expectFails(sensor == "flag" ? "the input flag didn't become"
                : must_leave     ? "the input index didn't become inactive"
                                 : "the index index didn't come",
                "trouble " + std::to_string(static_cast<int>(trouble)) + " from " +
                    std::to_string(rig.start));
  }

  void homeFromRandomPlaces(const config::AxisConfig& config, const Plan& plan) {
    std::uniform_real_distribution<double> hysteresis(0.0, 0.8);
    Spread spread;
    for (int i = 0; i < plan.starts; ++i) {
      Rig rig;
      rig.start = drawStart(plan.first, plan.last, config.steps_per_unit / 1e3);
      if (i == 1) rig.start = plan.last;
      rig.hysteresis = hysteresis(random_);
      rig.bounces = drawBounces();
      rig.flag_every = plan.flag_every;
      if (i % 20 == 19) {
        expectNamed(config, rig, plan.sensor, static_cast<Trouble>(i / 20 % 3));
      } else {
        buildFlag(config, rig);
        const double error = homed(plan.trigger, "from " + std::to_string(rig.start));
        spread.add(plan.turn > 0.0 ? std::remainder(error, plan.turn * config.steps_per_unit)
                                   : error);
      }
      if (HasFailure()) return;
    }
    spread.expectAStep();
  }

  std::mt19937 random_{7};
};

TEST_F(RandomHomings, ToABlockFindTheSameOneOrSayWhatIsWrongWithItsReport) {
  Spread spread;
  for (int i = 0; i < 1000; ++i) {
    Rig rig;
    rig.start = drawStart(-79.9, 60.0);
    rig.bounces = drawBounces();
    const std::string what = "start " + std::to_string(i) + " at " + std::to_string(rig.start);
    const bool is_missing = i % 20 == 19;
    const bool is_stuck = i % 20 == 9;
    buildBlock(blockAxis(1 + i % 2), rig, !is_missing);
    if (is_stuck) bench->rig.stickInput("stall", true, bench->clock.now());
    if (is_missing) {
      expectFails("the input stall didn't report a block within max_travel", what);
    } else if (is_stuck) {
      expectFails("the input stall reports a block before the axis has moved", what);
      ASSERT_EQ(bench->pulses(), 0) << what;
    } else {
      spread.add(homed(-0.08, what));
      // The block has stopped the step that reports it, or none if a contact does.
      const double lost =
          (carriage() - rig.start / 1e3) / kStep - static_cast<double>(bench->pulses());
      ASSERT_NEAR(lost, rig.bounces > 0 ? 0.0 : 1.0 + i % 2, 1e-6) << what;
    }
    if (HasFailure()) return;
  }
  spread.expectAStep();
}

TEST_F(RandomHomings, ToAFlagFindTheSameEdgeOrNameTheFlag) {
  Plan plan;
  plan.trigger = 0.02;
  plan.last = 100.0;  // on the endstop ahead
  homeFromRandomPlaces(flagAxis(), plan);
}

TEST_F(RandomHomings, ToTheMiddleOfAFlagFindItOrNameTheFlag) {
  Plan plan;
  plan.trigger = 0.025;
  plan.last = 100.0;
  homeFromRandomPlaces(flagAxis(HomingKind::kFlagCentre), plan);
}

TEST_F(RandomHomings, ToAnIndexAfterAFlagFindTheSameOneOrNameTheFlag) {
  Plan plan;
  plan.trigger = 0.038;
  plan.last = 100.0;
  index_at = 38.0;  // 18 mm from the flag's edge
  homeFromRandomPlaces(indexAxis("flag"), plan);
}

TEST_F(RandomHomings, ToAnIndexAfterAFlagNameAnIndexThatDoesNotCome) {
  index_at = 38.0;
  for (int i = 0; i < 60; ++i) {
    Rig rig;
    rig.start = drawStart(-99.0, 100.0);
    rig.bounces = drawBounces();
    expectNamed(indexAxis("flag"), rig, "index", static_cast<Trouble>(i % 3));
    if (HasFailure()) return;
  }
}

// It comes each 40 mm, the last time at 65 mm.
TEST_F(RandomHomings, ToAnIndexAloneFindTheNextOneOrNameIt) {
  Plan plan;
  plan.trigger = 0.025;
  plan.turn = 0.04;
  plan.last = 65.0;
  plan.sensor = "index";
  homeFromRandomPlaces(indexAxis(), plan);
}

// It turns by 16,000 microsteps a revolution; what is in mm elsewhere is in mrad.
TEST_F(RandomHomings, OfARotaryAxisToAFlagFindTheSameAngleOrNameTheFlag) {
  constexpr double kRound = 2.0 * test::kPi;
  config::AxisConfig config = flagAxis();
  config.kind = config::Kind::kRotary;
  config.continuous = true;
  config.steps_per_unit = 16'000.0 / kRound;
  config.max_speed = 3.0;
  config.acceleration = config.deceleration = 30.0;
  config.endstop_min.reset();
  config.endstop_max.reset();
  config.homing->seek_speed = 1.5;
  config.homing->latch_speed = 0.15;
  config.homing->max_travel = 1.1 * kRound;
  Plan plan;
  plan.trigger = 0.02;
  plan.turn = kRound;
  plan.flag_every = 1e3 * kRound;
  plan.first = -0.5e3 * kRound;
  plan.last = 1.5e3 * kRound;
  plan.starts = 200;
  homeFromRandomPlaces(config, plan);
}

}  // namespace
}  // namespace stepdriver
