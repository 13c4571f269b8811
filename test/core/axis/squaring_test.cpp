#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/error.h"
#include "support/gantry_bench.h"
#include "support/refusal.h"

// The homing of an axis with two motors makes it square, or stops and says which side is wrong.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingPhase;
using axis::HomingResult;
using test::gantryAxis;
using test::GantryTest;
using test::kStep;

constexpr double kStepMm = kStep * 1000.0;

class Squaring : public GantryTest {
 protected:
  void buildRacked(double by_mm, const config::AxisConfig& config = gantryAxis()) {
    build(config, [by_mm](auto& left, auto& right) {
      left.start = -92.0;
      right.start = -92.0 + by_mm;
    });
  }

  /// Homes, and expects it square. @param place [m] of the left carriage's trigger point.
  void expectSquare(double place = -0.1) {
    const HomingResult result = y().home();
    EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
    const axis::AxisState state = y().state();
    EXPECT_TRUE(state.homed);
    EXPECT_TRUE(state.position_valid);
    EXPECT_EQ(state.skew, 0.0);
    EXPECT_LE(std::abs(skew()), kStepMm * 1.001);
    EXPECT_NEAR(state.position - -0.1, left().carriage / 1000.0 - place, kStep * 1.001);
    expectNoViolations();
  }

  /// Expects that the homing fails and says this, within the allowed skew.
  void expectStops(const std::string& words, double skew_before) {
    const HomingResult result = y().home();
    EXPECT_EQ(result.end, HomingEnd::kFailed);
    EXPECT_NE(result.message.find(words), std::string::npos) << result.message;
    EXPECT_LE(std::abs(skew() - skew_before), 6.0 + kStepMm * 1.001);
    EXPECT_FALSE(y().state().homed);
    EXPECT_FALSE(y().state().position_valid);
  }
};

TEST_F(Squaring, MakesEveryRackedBeamSquare) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> racked(-5.0, 5.0);
  for (int i = 0; i < 1000; ++i) {
    const double by = racked(random);
    SCOPED_TRACE(by);
    buildRacked(by);
    expectSquare();
    if (HasFailure()) return;
  }
}

TEST_F(Squaring, SaysHowFarApartTheMotorsWere) {
  buildRacked(3.5);
  const HomingResult result = y().home();
  EXPECT_NEAR(result.skew, 0.0035, 2.001 * kStep);
  EXPECT_NE(result.message.find("y is homed, its motors were 0.0035"), std::string::npos)
      << result.message;
  EXPECT_LE(y().home().skew, kStep * 1.001);
}

TEST_F(Squaring, StartsOnASwitch) {
  build(gantryAxis(), [](auto& left, auto& right) {
    left.start = -100.5;
    right.start = -98.0;
  });
  expectSquare();
}

TEST_F(Squaring, GoesToTheMaxSwitches) {
  config::AxisConfig config = gantryAxis();
  config.homing->at_max = true;
  config.homing->offset = 0.25;
  build(config, [](auto& left, auto& right) {
    left.start = 94.0;
    right.start = 91.3;
  });
  const HomingResult result = y().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_LE(std::abs(skew()), kStepMm * 1.001);
  EXPECT_NEAR(y().state().position - 0.25, left().carriage / 1000.0 - 0.1, kStep * 1.001);
  expectNoViolations();
}

TEST_F(Squaring, KnowsWhereEachSwitchIs) {
  for (const double offset_mm : {0.4, -0.4}) {
    for (const bool of_left : {false, true}) {
      config::AxisConfig config = gantryAxis();
      (of_left ? config.offset : config.twins[0].offset) = offset_mm / 1000.0;
      build(config, [&](auto& left, auto& right) {
        left.start = -92.0;
        right.start = -94.0;
        (of_left ? left : right).min_switch->position += offset_mm;
      });
      SCOPED_TRACE(offset_mm);
      expectSquare();
    }
  }
}

TEST_F(Squaring, TakesUpTheBacklashOfBothMotors) {
  config::AxisConfig config = gantryAxis();
  config.backlash = 0.0005;
  buildRacked(2.0, config);
  const HomingResult result = y().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_LE(std::abs(skew()), kStepMm * 1.001);
}

TEST_F(Squaring, NeedsNoSwitchOnBothSides) {
  config::AxisConfig config = gantryAxis();
  config.endstop_min.reset();
  config.max_skew = 0.0;
  build(config, [](auto& left, auto& right) {
    left.start = -92.0;
    right.start = -91.0;
  });
  const HomingResult result = y().home();
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_NEAR(skew(), 1.0, 1e-9);
  expectNoViolations();
}

// ---- what is wrong on a side ----

TEST_F(Squaring, StopsIfASwitchIsMissing) {
  for (const char* side : {"left", "right"}) {
    buildRacked(1.0);
    sim::RigFaults missing;
    missing.min_stuck = false;
    bench->rig.setFaults(side == std::string("left") ? "y" : "y.right", missing);
    expectStops(std::string("the min switch of motor ") + side +
                    " didn't close within max_skew, 0.006 m, of another motor's",
                1.0);
  }
}

TEST_F(Squaring, StopsIfASwitchIsStuck) {
  config::AxisConfig config = gantryAxis();
  config.homing->max_travel = 0.05;
  buildRacked(1.0, config);
  sim::RigFaults stuck;
  stuck.min_stuck = true;
  bench->rig.setFaults("y.right", stuck);
  expectStops("the min switch of motor right didn't open within max_travel", 1.0);
}

TEST_F(Squaring, StopsIfTheSwitchesAreSwapped) {
  build(gantryAxis(), [](auto& left, auto& right) {
    std::swap(left.min_switch->line, right.min_switch->line);
    left.start = -92.0;
    right.start = -89.0;
  });
  expectStops("didn't close within max_skew", 3.0);
}

TEST_F(Squaring, DoesNotGetFartherApartWithEachAttempt) {
  buildRacked(0.0);
  sim::RigFaults missing;
  missing.min_stuck = false;
  bench->rig.setFaults("y.right", missing);
  for (int i = 0; i < 3; ++i) {
    expectStops("the min switch of motor right", 0.0);
    EXPECT_NEAR(y().state().skew, 0.006, kStep * 1.001);
    y().wait(y().moveTo(0.004, true));
  }
  bench->rig.setFaults("y.right", {});
  expectSquare();
}

// ---- what comes in its middle ----

TEST_F(Squaring, ContinuesAfterAHoldWithOneMotorAtItsSwitch) {
  buildRacked(4.0);
  bool held = false;
  const HomingResult result = y().home([&] {
    if (!held && y().state().homing == HomingPhase::kSeeking && y().state().skew > 0.001) {
      held = true;
      bench->machine->hold();
      bench->machine->advance(1.0);
      EXPECT_FALSE(y().state().moving);
      bench->machine->resume();
    }
    return false;
  });
  EXPECT_TRUE(held);
  EXPECT_EQ(result.end, HomingEnd::kHomed) << result.message;
  EXPECT_LE(std::abs(skew()), kStepMm * 1.001);
  expectNoViolations();
}

TEST_F(Squaring, EndsWithAStopADisableAndAnEmergencyStopAtAnySkew) {
  const std::vector<std::function<void()>> endings = {[this] { y().stop(); },
                                                      [this] { y().enable(false); },
                                                      [this] { bench->machine->emergencyStop(); }};
  for (const auto& end : endings) {
    for (const double at : {0.0, 0.0005, 0.003}) {
      buildRacked(4.0);
      bool ended = false;
      std::int64_t pulses = 0;
      const HomingResult result = y().home([&] {
        if (!ended && y().state().homing == HomingPhase::kSeeking && y().state().moving &&
            y().state().skew >= at) {
          ended = true;
          end();
          pulses = bench->pulses("y") + bench->pulses("y.right");
        }
        return false;
      });
      EXPECT_TRUE(ended);
      EXPECT_EQ(result.end, HomingEnd::kFailed);
      // No more than the way of a stop from 50 mm/s.
      EXPECT_LE(pulses - bench->pulses("y") - bench->pulses("y.right"), 2 * 110);
      bench->machine->recover();
      y().enable(true);
      expectSquare();
    }
  }
}

}  // namespace
}  // namespace stepdriver
