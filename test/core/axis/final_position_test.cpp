#include <gtest/gtest.h>

#include <cmath>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "support/constants.h"
#include "support/homing_kinds_bench.h"

// Homings after which the axis stands at homing/final_position. The offset is the place of the
// trigger point on the rig, so positions are those of the rig: 80 steps/mm, endstops at -100 mm and
// 100 mm, a flag from 20 to 30 mm, an index at 38 mm and each 40 mm, and a block at -80 mm.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using axis::HomingResult;
using config::HomingKind;
using test::blockAxis;
using test::flagAxis;
using test::homingAxis;
using test::indexAxis;
using test::kStep;

class FinalPosition : public test::HomingKindsTest {
 protected:
  /// Expects that the axis is homed, and stands at a final position [m|rad].
  /// @param turn [m|rad] The rig is at that position, or whole turns away; 0: it doesn't turn.
  void expectAt(double wanted, double step, double turn = 0.0) {
    SCOPED_TRACE("final position " + std::to_string(wanted));
    const HomingResult result = x().home();
    ASSERT_EQ(result.end, HomingEnd::kHomed) << result.message;
    EXPECT_NEAR(result.position, wanted, 0.51 * step);
    EXPECT_EQ(x().state().position, result.position);
    EXPECT_TRUE(x().state().homed);
    EXPECT_FALSE(x().state().moving);
    // The rig has no backlash: with one, the joint is behind its carriage.
    const double apart = carriage() - x().state().slack - wanted;
    EXPECT_NEAR(turn > 0.0 ? std::remainder(apart, turn) : apart, 0.0, 1.51 * step);
    EXPECT_EQ(test::violationsOf(bench->report()), "");
  }
};

TEST_F(FinalPosition, IsReachedFromTheSwitchOfEitherEnd) {
  for (const bool at_max : {false, true}) {
    const double end = at_max ? 0.1 : -0.1;
    for (const double wanted : {0.0, 0.03, -0.03, end, 0.999 * end}) {
      config::AxisConfig config = homingAxis();
      config.homing->at_max = at_max;
      config.homing->offset = end;
      config.homing->final_position = wanted;
      build(config, {}, [](sim::RigAxisSpec& /*spec*/) {});
      expectAt(wanted, kStep);
      // From there, and so from the other side, too.
      expectAt(wanted, kStep);
    }
  }
}

TEST_F(FinalPosition, OnEitherSideOfAFlagOrAnIndexIsReached) {
  index_at = 38.0;
  struct Kind {
    config::AxisConfig config;
    double trigger;  // [m]
  };
  for (const Kind& kind : {Kind{flagAxis(), 0.02}, Kind{flagAxis(HomingKind::kFlagCentre), 0.025},
                           Kind{indexAxis("flag"), 0.038}, Kind{indexAxis(), 0.038}}) {
    for (const double backlash : {0.0, 0.0005}) {
      SCOPED_TRACE("trigger at " + std::to_string(kind.trigger) + " " + kind.config.homing->flag);
      for (const double wanted : {0.0, kind.trigger, 0.06, -0.05, kind.trigger + 0.4 * kStep}) {
        config::AxisConfig config = kind.config;
        config.backlash = backlash;
        config.homing->final_position = wanted;
        // A sensor is found on the way to max, where the joint is behind by the backlash, and the
        // middle of a flag on the way back too.
        const bool both_ways = config.homing->kind == HomingKind::kFlagCentre;
        config.homing->offset = kind.trigger - (both_ways ? 0.5 * backlash : backlash);
        Rig rig;
        rig.hysteresis = backlash > 0.0 ? 0.6 : 0.0;  // no edge while the backlash is taken up
        buildFlag(config, rig);
        expectAt(wanted, kStep);
        // An index alone is the next one.
        const bool is_alone =
            config.homing->kind == HomingKind::kIndex && config.homing->flag.empty();
        if (!is_alone) expectAt(wanted, kStep);
      }
    }
  }
}

TEST_F(FinalPosition, IsReachedFromABlock) {
  for (const int approaches : {1, 2}) {
    for (const double wanted : {0.0, 0.05, -0.0799}) {
      config::AxisConfig config = blockAxis(approaches);
      config.homing->offset = -0.08;
      config.homing->final_position = wanted;
      buildBlock(config);
      expectAt(wanted, kStep);
      expectAt(wanted, kStep);
    }
  }
}

TEST_F(FinalPosition, OfADirectHomingIsItsOffset) {
  config::AxisConfig config = homingAxis();
  config.homing = config::HomingConfig{};
  config.homing->kind = HomingKind::kDirect;
  for (const double offset : {0.0, 0.25, -3.0}) {
    config.homing->offset = offset;
    build(config, {}, [](sim::RigAxisSpec& /*spec*/) {});
    const HomingResult result = x().home();
    ASSERT_EQ(result.end, HomingEnd::kHomed) << result.message;
    EXPECT_NEAR(result.position, offset, 1e-12);
    EXPECT_EQ(bench->pulses(), 0);
  }
}

// What is in mm elsewhere is in mrad. The motor has 480 steps a turn, of 40 mrad.
TEST_F(FinalPosition, OfARotaryAxisIsReachedInAnyRound) {
  constexpr double kRound = 2.0 * test::kPi;
  constexpr double kAngle = 0.04 / 480.0;
  index_at = 38.0;
  struct Kind {
    config::AxisConfig config;
    double trigger;  // [rad]
    double turn;     // [rad] from a trigger point to the next one
  };
  for (const Kind& kind :
       {Kind{flagAxis(), 0.02, kRound}, Kind{flagAxis(HomingKind::kFlagCentre), 0.025, kRound},
        Kind{indexAxis("flag"), 0.038, 0.04}, Kind{indexAxis(), 0.038, 0.04}}) {
    SCOPED_TRACE("trigger at " + std::to_string(kind.trigger) + " " + kind.config.homing->flag);
    for (const double wanted : {-0.3, 2.0, -kRound}) {
      config::AxisConfig config = kind.config;
      config.kind = config::Kind::kRotary;
      config.continuous = true;
      config.steps_per_unit = 1.0 / kAngle;
      config.steps_per_round = 480.0;
      config.max_speed = 3.0;
      config.acceleration = config.deceleration = 30.0;
      config.endstop_min.reset();
      config.endstop_max.reset();
      config.homing->seek_speed = 1.5;
      config.homing->latch_speed = 0.15;
      config.homing->max_travel = 1.1 * kRound;
      config.homing->offset = kind.trigger;
      config.homing->final_position = wanted;
      Rig rig;
      rig.start = 1e3;
      rig.flag_every = 1e3 * kRound;
      buildFlag(config, rig);
      expectAt(wanted, kAngle, kind.turn);
      expectAt(wanted, kAngle, kind.turn);
    }
  }
}

}  // namespace
}  // namespace stepdriver
