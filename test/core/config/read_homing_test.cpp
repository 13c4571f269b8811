#include "config/read_homing.h"

#include <gtest/gtest.h>

#include <limits>

#include "support/axis_config.h"
#include "support/constants.h"

namespace stepdriver::config {
namespace {

using test::kNan;
using test::kPi;

ConfigValue withSwitch(ConfigValue axis, const std::string& side) {
  put(axis, "endstops/" + side + "/pin", "gpiochip0:23");
  put(axis, "endstops/" + side + "/active_level", "low");
  return axis;
}

/// Soft limits 0 and 200 mm, 100 mm/s; 500 mm/s^2 and 0.2 mm a full step: 14.1 mm/s after one.
ConfigValue homingAxis() {
  ConfigValue axis = withSwitch(linearAxis(), "min");
  put(axis, "min_position_mm", 0.0);
  put(axis, "max_position_mm", 200.0);
  put(axis, "homing/switch", "min");
  put(axis, "homing/seek_speed_mm_s", 50.0);
  put(axis, "homing/latch_speed_mm_s", 5.0);
  put(axis, "homing/pull_off_mm", 4.0);
  put(axis, "homing/offset_mm", -3.0);
  put(axis, "homing/max_travel_mm", 250.0);
  return axis;
}

TEST(ReadHoming, TakesNoneWhereNoneIsGiven) {
  const AxisConfig config = readX(linearAxis());
  EXPECT_FALSE(config.homing);
  EXPECT_FALSE(config.require_homing);
}

TEST(ReadHoming, ReadsAllOfItInSiUnits) {
  ConfigValue axis = homingAxis();
  AxisConfig config = readX(axis);
  ASSERT_TRUE(config.homing);
  EXPECT_FALSE(config.homing->at_max);
  EXPECT_DOUBLE_EQ(config.homing->seek_speed, 0.05);
  EXPECT_DOUBLE_EQ(config.homing->latch_speed, 0.005);
  EXPECT_DOUBLE_EQ(config.homing->pull_off, 0.004);
  EXPECT_DOUBLE_EQ(config.homing->offset, -0.003);
  EXPECT_DOUBLE_EQ(config.homing->max_travel, 0.25);
  EXPECT_EQ(config.homing->timeout, 60.0);
  EXPECT_EQ(config.homing->debounce, 0.005);
  EXPECT_EQ(config.homing->order, 0);
  put(axis, "homing/timeout_s", 20);
  put(axis, "homing/debounce_ms", 2);
  put(axis, "homing/order", 3);
  put(axis, "require_homing", true);
  config = readX(axis);
  EXPECT_EQ(config.homing->timeout, 20.0);
  EXPECT_DOUBLE_EQ(config.homing->debounce, 0.002);
  EXPECT_EQ(config.homing->order, 3);
  EXPECT_TRUE(config.require_homing);
}

TEST(ReadHoming, CountsDegreesOnARotaryAxis) {
  ConfigValue axis = withSwitch(rotaryAxis(), "max");
  put(axis, "homing/switch", "max");
  put(axis, "homing/seek_speed_deg_s", 90.0);
  put(axis, "homing/latch_speed_deg_s", 9.0);
  put(axis, "homing/pull_off_deg", 18.0);
  put(axis, "homing/max_travel_deg", 360.0);
  const AxisConfig config = readX(axis);
  ASSERT_TRUE(config.homing);
  EXPECT_TRUE(config.homing->at_max);
  EXPECT_DOUBLE_EQ(config.homing->seek_speed, kPi / 2.0);
  EXPECT_DOUBLE_EQ(config.homing->latch_speed, kPi / 20.0);
  EXPECT_DOUBLE_EQ(config.homing->pull_off, kPi / 10.0);
  EXPECT_EQ(config.homing->offset, 0.0);
  EXPECT_DOUBLE_EQ(config.homing->max_travel, 2.0 * kPi);
}

TEST(ReadHoming, ChecksEachValue) {
  for (const std::string key : {"seek_speed_mm_s", "latch_speed_mm_s", "max_travel_mm"}) {
    expectIssues(homingAxis(),
                 {{"homing/" + key, 0, "is 0, but must be above 0"},
                  {"homing/" + key, kNan, "is nan, but must be a finite number above 0"},
                  {"homing/" + key, "far", "is \"far\" (a string), but must be a number above 0"}});
  }
  for (const std::string key : {"seek_speed_mm_s", "latch_speed_mm_s"}) {
    ConfigValue axis = homingAxis();
    put(axis, "homing/seek_speed_mm_s", 1.25e-5);
    put(axis, "homing/latch_speed_mm_s", 1.25e-5);
    EXPECT_EQ(issuesOfX(axis), Lines{});
    put(axis, "homing/latch_speed_mm_s", 1e-300);
    put(axis, "homing/" + key, 1e-300);
    const Lines issues = issuesOfX(axis);
    ASSERT_FALSE(issues.empty());
    EXPECT_EQ(issues.front(), "/axes/x/homing/" + key +
                                  ": is 1e-300, but must be at least 1.25e-05, which is 0.001 "
                                  "steps/s");
  }
  expectIssues(homingAxis(),
               {{"homing/switch", "left", "is \"left\", but must be min or max"},
                {"homing/switch", "max",
                 "is \"max\", but must be a switch that the axis has: endstops/max is missing"},
                {"homing/pull_off_mm", -1, "is -1, but must be 0 or more"},
                {"homing/offset_mm", "here", "is \"here\" (a string), but must be a number"},
                {"homing/timeout_s", 0, "is 0, but must be above 0 and at most 86400"},
                {"homing/debounce_ms", -1, "is -1, but must be from 0 to 1000"},
                {"homing/debounce_ms", 0, ""},
                {"homing/order", -1, "is -1, but must be from 0 to 1000"},
                {"homing/order", 1.5,
                 "is 1.5 (a number with a decimal point), but must be an integer from 0 to 1000"},
                {"homing/speed", 5,
                 "is not known; known here: debounce_ms, final_position_mm, kind, "
                 "latch_speed_mm_s, max_travel_mm, offset_mm, order, pull_off_mm, "
                 "seek_speed_mm_s, switch and timeout_s"},
                {"homing", 5, "is 5 (an integer), but must be a map"},
                {"require_homing", 1, "is 1 (an integer), but must be true or false"}});
}

TEST(ReadHoming, ChecksItAgainstTheAxis) {
  expectIssues(
      homingAxis(),
      {{"homing/seek_speed_mm_s", 100.0, ""},
       {"homing/seek_speed_mm_s", 101.0,
        "is 101.0, but must be at most max_speed_mm_s, which is 100.0"},
       {"homing/seek_speed_mm_s", 5.0, ""},
       {"homing/latch_speed_mm_s", 14.1421, ""},
       {"homing/latch_speed_mm_s", 14.15,
        "is 14.15, but must be at most 14.1421, the speed that the motor stops from without a ramp "
        "(start_speed_mm_s, or that after one full step)"},
       {"homing/max_travel_mm", 1e11,
        "is 100000000000.0, but must be at most 13743800000, which is 2^40 steps"},
       {"homing/pull_off_mm", 251.0, "is 251.0, but must be at most max_travel_mm, which is 250.0"},
       {"homing/offset_mm", -4.0, ""},
       {"homing/offset_mm", 4.0, ""},
       {"homing/offset_mm", 4.1,
        "is 4.1, so that nothing of the way between the min switch and min_position_mm, which is "
        "0.0, can be reached, because no motion passes an endstop; it must be at most 4, or "
        "min_position_mm must be at least 0.1"},
       {"homing/offset_mm", -4.1,
        "is -4.1, so that the axis stands at -0.1 when it is homed, but that must be at least "
        "min_position_mm, which is 0.0"},
       {"homing/offset_mm", 100.0,
        "is 100.0, so that nothing of the way between the min switch and min_position_mm, which is "
        "0.0, can be reached, because no motion passes an endstop; it must be at most 4, or "
        "min_position_mm must be at least 96"}});
}

TEST(ReadHoming, RefusesATriggerThatIsAtTheOtherEnd) {
  ConfigValue axis = withSwitch(homingAxis(), "max");
  drop(axis, "endstops/min");
  put(axis, "homing/switch", "max");
  put(axis, "homing/pull_off_mm", 0.0);
  drop(axis, "homing/offset_mm");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/offset_mm",
                    "is missing, and so 0, so that nothing of the way between the max switch and "
                    "max_position_mm, which is 200.0, can be reached, because no motion passes an "
                    "endstop; it must be at least 200, or max_position_mm must be at most 0"));
  put(axis, "homing/offset_mm", 200.0);
  EXPECT_EQ(issuesOfX(axis), Lines{});
}

TEST(ReadHoming, IsRequiredIfItIsConfiguredUnlessTheFileSaysOtherwise) {
  ConfigValue axis = homingAxis();
  EXPECT_TRUE(readX(axis).require_homing);
  put(axis, "require_homing", false);
  EXPECT_FALSE(readX(axis).require_homing);
}

TEST(ReadHoming, LatchesNoFasterThanItSeeks) {
  ConfigValue axis = homingAxis();
  put(axis, "homing/seek_speed_mm_s", 4.0);
  EXPECT_EQ(issuesOfX(axis), lineOfX("homing/latch_speed_mm_s",
                                     "is 5.0, but must be at most seek_speed_mm_s, which is 4.0"));
}

TEST(ReadHoming, NamesWhatIsMissing) {
  expectMissing(homingAxis(), {{"homing/switch", "min or max"},
                               {"homing/seek_speed_mm_s", "a number above 0"},
                               {"homing/latch_speed_mm_s", "a number above 0"},
                               {"homing/pull_off_mm", "a number of 0 or more"},
                               {"homing/max_travel_mm", "a number above 0"}});
  ConfigValue axis = linearAxis();
  put(axis, "require_homing", true);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("require_homing", "is true, but must be false if there is no homing"));
}

// ---- kinds ----

ConfigValue blockAxis() {
  ConfigValue axis = linearAxis();
  put(axis, "min_position_mm", 0.0);
  put(axis, "max_position_mm", 200.0);
  put(axis, "homing/kind", "block");
  put(axis, "homing/towards", "min");
  put(axis, "homing/input", "stall");
  put(axis, "homing/seek_speed_mm_s", 50.0);
  put(axis, "homing/pull_off_mm", 4.0);
  put(axis, "homing/max_travel_mm", 250.0);
  return axis;
}

TEST(ReadHoming, ReadsAHomingToABlock) {
  ConfigValue axis = blockAxis();
  EXPECT_EQ(readX(axis).homing->kind, HomingKind::kBlock);
  EXPECT_EQ(readX(axis).homing->input, "stall");
  EXPECT_EQ(readX(axis).homing->approaches, 1);
  EXPECT_FALSE(readX(axis).homing->at_max);
  // The second approach has a speed of its own, which may be higher than that of a latch.
  put(axis, "homing/approaches", 2);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/latch_speed_mm_s", "is missing; it must be a number above 0"));
  put(axis, "homing/latch_speed_mm_s", 40.0);
  EXPECT_DOUBLE_EQ(readX(axis).homing->latch_speed, 0.04);
  put(axis, "homing/pull_off_mm", 0.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/pull_off_mm",
                    "is 0.0, but must be above 0, from where the second approach begins"));
}

TEST(ReadHoming, ABlockNeedsSomethingThatReportsIt) {
  ConfigValue axis = blockAxis();
  drop(axis, "homing/input");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/input",
                    "must be the name of an input that reports the block, because pins/fault of "
                    "each motor isn't wired"));
}

TEST(ReadHoming, ABlockHasNoSwitchAndNoDebounce) {
  ConfigValue axis = blockAxis();
  put(axis, "homing/debounce_ms", 5.0);
  const Lines issues = issuesOfX(axis);
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_NE(issues[0].find("homing/debounce_ms: is not known"), std::string::npos) << issues[0];
}

TEST(ReadHoming, ReadsTheCheckAtTheFlag) {
  ConfigValue axis = blockAxis();
  put(axis, "homing/kind", "flag");
  put(axis, "homing/latch_speed_mm_s", 5.0);
  EXPECT_EQ(readX(axis).homing->check_at_flag, FlagCheck::kNone);
  put(axis, "homing/check_at_flag", "fault");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/check_tolerance_mm", "is missing; it must be a number above 0"));
  put(axis, "homing/check_tolerance_mm", 0.4);
  EXPECT_EQ(readX(axis).homing->check_at_flag, FlagCheck::kFault);
  EXPECT_DOUBLE_EQ(readX(axis).homing->flag_tolerance, 0.0004);
  put(axis, "homing/check_tolerance_mm", 0.001);
  EXPECT_EQ(issuesOfX(axis).size(), 1U);
  put(axis, "homing/check_tolerance_mm", 0.4);
  put(axis, "homing/kind", "block");
  drop(axis, "homing/latch_speed_mm_s");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/check_at_flag", "is given, but this homing has no flag"));
}

TEST(ReadHoming, ReadsAFinalPositionInPlaceOfThePullOff) {
  ConfigValue axis = homingAxis();
  drop(axis, "homing/pull_off_mm");
  put(axis, "homing/final_position_mm", 100.0);
  EXPECT_DOUBLE_EQ(*readX(axis).homing->final_position, 0.1);
  EXPECT_DOUBLE_EQ(restOf(*readX(axis).homing), 0.1);
  put(axis, "homing/final_position_mm", 201.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/final_position_mm",
                    "is 201.0, but must be at most max_position_mm, which is 200.0"));
  put(axis, "min_position_mm", -10.0);
  put(axis, "homing/final_position_mm", -4.0);
  EXPECT_EQ(issuesOfX(axis), lineOfX("homing/final_position_mm",
                                     "is -4.0, but must be at least offset_mm, which is -3"));
}

TEST(ReadHoming, ADirectHomingIsANumber) {
  ConfigValue axis = linearAxis();
  put(axis, "homing/kind", "direct");
  put(axis, "homing/offset_mm", 12.0);
  EXPECT_EQ(readX(axis).homing->kind, HomingKind::kDirect);
  EXPECT_DOUBLE_EQ(readX(axis).homing->offset, 0.012);
  put(axis, "max_position_mm", 10.0);
  EXPECT_EQ(
      issuesOfX(axis),
      lineOfX("homing/offset_mm", "is 12.0, but must be at most max_position_mm, which is 10.0"));
  drop(axis, "max_position_mm");
  drop(axis, "homing/offset_mm");
  EXPECT_EQ(issuesOfX(axis), lineOfX("homing/offset_mm", "is missing; it must be a number"));
}

TEST(ReadHoming, ReadsAFlagAndAnIndex) {
  ConfigValue axis = blockAxis();
  put(axis, "steps_per_round", 3200);
  drop(axis, "homing/pull_off_mm");
  put(axis, "homing/latch_speed_mm_s", 40.0);
  for (const auto& [kind, wanted] :
       {std::pair("flag", HomingKind::kFlag), std::pair("flag_centre", HomingKind::kFlagCentre),
        std::pair("index", HomingKind::kIndex)}) {
    put(axis, "homing/kind", kind);
    EXPECT_EQ(readX(axis).homing->kind, wanted);
    EXPECT_EQ(readX(axis).homing->input, "stall");
    EXPECT_EQ(readX(axis).homing->pull_off, 0.0);
  }
  put(axis, "homing/flag", "home");
  EXPECT_EQ(readX(axis).homing->flag, "home");
  put(axis, "homing/kind", "flag");
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("homing/flag", "is given, but only an index comes after a flag"));
  drop(axis, "homing/flag");
  drop(axis, "homing/input");
  EXPECT_EQ(issuesOfX(axis), lineOfX("homing/input", "is missing; it must be a string"));
}

}  // namespace
}  // namespace stepdriver::config
