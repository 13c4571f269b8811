#include <gtest/gtest.h>

#include <limits>

#include "support/axis_config.h"
#include "support/constants.h"

namespace stepdriver::config {
namespace {

using test::kNan;
using test::kPi;

TEST(ReadMotion, ChecksEachNumberOfTheMotion) {
  for (const std::string key : {"steps_per_mm", "max_speed_mm_s", "acceleration_mm_s2",
                                "deceleration_mm_s2", "stop_deceleration_mm_s2"}) {
    expectIssues(linearAxis(),
                 {{key, 0, "is 0, but must be above 0"},
                  {key, -5, "is -5, but must be above 0"},
                  {key, kNan, "is nan, but must be a finite number above 0"},
                  {key, true, "is true (a boolean), but must be a number above 0"},
                  {key, "fast", "is \"fast\" (a string), but must be a number above 0"}});
  }
  expectIssues(
      linearAxis(),
      {{"start_speed_mm_s", -0.1, "is -0.1, but must be 0 or more"},
       {"start_speed_mm_s", 5e-324,
        "is 4.94065645841247e-324, but must be 0 or at least 1.25e-05, which is 0.001 steps/s"},
       {"start_speed_mm_s", 1.25e-5, ""},
       {"start_speed_mm_s", 0.0, ""},
       {"start_speed_mm_s", 100.0, ""},
       {"start_speed_mm_s", 101, "is 101, but must be at most max_speed_mm_s, which is 100.0"},
       {"min_position_mm", kNan, "is nan, but must be a finite number"},
       {"max_position_mm", "far", "is \"far\" (a string), but must be a number"}});
}

TEST(ReadMotion, TakesNoJerkLimitAndNoDecelerationOfAStopWhereNoneIsGiven) {
  ConfigValue axis = linearAxis();
  EXPECT_EQ(readX(axis).jerk, 0.0);
  EXPECT_FALSE(readX(axis).stop_deceleration);
  put(axis, "stop_deceleration_mm_s2", 2000);
  put(axis, "jerk_mm_s3", 5000.0);
  EXPECT_EQ(readX(axis).stop_deceleration, 2.0);
  EXPECT_EQ(readX(axis).jerk, 5.0);
  ConfigValue rotary = rotaryAxis();
  put(rotary, "jerk_deg_s3", 180.0);
  put(rotary, "stop_deceleration_deg_s2", 720.0);
  EXPECT_DOUBLE_EQ(readX(rotary).jerk, kPi);
  EXPECT_DOUBLE_EQ(readX(rotary).stop_deceleration.value_or(0.0), 4.0 * kPi);
}

TEST(ReadMotion, ChecksTheJerkAndTheDecelerationOfAStop) {
  expectIssues(
      linearAxis(),
      {{"backlash_mm", 0.2, ""},
       {"backlash_mm", -0.1, "is -0.1, but must be 0 or more"},
       {"backlash_mm", 12501.0, "is 12501.0, but must be at most 12500, which is 1000000 steps"},
       {"jerk_mm_s3", 0, ""},
       {"jerk_mm_s3", -1.0, "is -1.0, but must be 0 or more"},
       {"jerk_mm_s3", kNan, "is nan, but must be a finite number of 0 or more"},
       {"jerk_mm_s3", 1e-6,
        "is 1e-06, but must be 0 for none, or from 1.25e-05 to 12500000000000, which is 0.001 to "
        "1e+15 steps/s^3"},
       {"stop_deceleration_mm_s2", 500.0, ""},
       {"stop_deceleration_mm_s2", 499.0,
        "is 499.0, but must be at least acceleration_mm_s2, which is 500.0: a stop must not end "
        "beyond the target"}});
  ConfigValue axis = linearAxis();
  put(axis, "deceleration_mm_s2", 800.0);
  expectIssues(axis, {{"stop_deceleration_mm_s2", 700.0,
                       "is 700.0, but must be at least deceleration_mm_s2, which is 800.0: a stop "
                       "must not end beyond the target"}});
}

TEST(ReadMotion, WantsTheLowerLimitBelowTheUpper) {
  ConfigValue axis = linearAxis();
  put(axis, "max_position_mm", 200);
  expectIssues(
      axis,
      {{"min_position_mm", 199.9, ""},
       {"min_position_mm", 200.0, "is 200.0, but must be below max_position_mm, which is 200"},
       {"min_position_mm", 300.0, "is 300.0, but must be below max_position_mm, which is 200"}});
}

TEST(ReadMotion, RefusesTwoUnitsInOneAxis) {
  ConfigValue axis = linearAxis();
  put(axis, "start_speed_deg_s", 5.0);
  const std::string mixed =
      "/axes/x: has steps_per_mm and start_speed_deg_s, but must be either linear, with all keys "
      "in mm, or rotary, with all keys in degrees";
  EXPECT_EQ(issuesOfX(axis), Lines{mixed});
  put(axis, "start_speed_deg_s", -5.0);
  put(axis, "max_speed_mm_s", 0);
  EXPECT_EQ(issuesOfX(axis), (Lines{mixed, "/axes/x/max_speed_mm_s: is 0, but must be above 0",
                                    "/axes/x/start_speed_deg_s: is -5.0, but must be 0 or more"}));
}

TEST(ReadMotion, SaysWhereAnAxisHasNoUnit) {
  ConfigValue axis = linearAxis();
  for (const char* key : {"steps_per_mm", "max_speed_mm_s", "acceleration_mm_s2"}) drop(axis, key);
  EXPECT_EQ(issuesOfX(axis),
            Lines{"/axes/x: has no key with a unit; it must have steps_per_mm, max_speed_mm_s and "
                  "acceleration_mm_s2 if it is linear, or steps_per_degree, max_speed_deg_s and "
                  "acceleration_deg_s2 if it is rotary"});
}

TEST(ReadMotion, ScalesALinearAxisByTheRoundsOfItsMotor) {
  ConfigValue axis = linearAxis();
  drop(axis, "steps_per_mm");
  put(axis, "full_steps_per_round", 200);
  put(axis, "mm_per_round", 40);
  EXPECT_EQ(readX(axis).steps_per_unit, 80000.0);
  EXPECT_EQ(readX(axis).steps_per_round, 3200.0);
  put(axis, "gear_ratio", 2.5);
  EXPECT_EQ(readX(axis).steps_per_unit, 200000.0);
  EXPECT_EQ(readX(axis).steps_per_round, 3200.0) << "of the motor, not of the gear";

  expectIssues(axis, {{"mm_per_round", 0.0, "is 0.0, but must be above 0"},
                      {"gear_ratio", -1, "is -1, but must be above 0"},
                      {"full_steps_per_round", 200.0,
                       "is 200.0 (a number with a decimal point), but must be an integer from 1 to "
                       "1000000"},
                      {"full_steps_per_round", 0, "is 0, but must be from 1 to 1000000"}});
  expectMissing(
      axis,
      {{"mm_per_round", "a number above 0, or else wheel_diameter_mm must be given"},
       {"full_steps_per_round", "an integer of 1 or more, as the axis is scaled by mm_per_round"}});
}

TEST(ReadMotion, ScalesAWheelByItsDiameter) {
  ConfigValue axis = linearAxis();
  drop(axis, "steps_per_mm");
  put(axis, "microsteps", 8);
  put(axis, "full_steps_per_round", 200);
  put(axis, "wheel_diameter_mm", 100);
  const AxisConfig wheel = readX(axis);
  EXPECT_EQ(wheel.kind, Kind::kLinear);
  EXPECT_NEAR(1000.0 / wheel.steps_per_unit, 0.19635, 1e-6) << "mm a pulse of 10 cm at 1600 pulses";
  EXPECT_DOUBLE_EQ(wheel.steps_per_unit, 1600.0 / (0.1 * kPi));
  EXPECT_EQ(wheel.steps_per_round, 1600.0);
  put(axis, "gear_ratio", 2.5);
  EXPECT_DOUBLE_EQ(readX(axis).steps_per_unit, 4000.0 / (0.1 * kPi));

  const std::string beyond =
      ", which makes 1.27324e-10 steps per mm, but must make from 1e-09 to 1000000000";
  expectIssues(axis,
               {{"wheel_diameter_mm", 0.0, "is 0.0, but must be above 0"},
                {"wheel_diameter_mm", -65, "is -65, but must be above 0"},
                {"wheel_diameter_mm", kNan, "is nan, but must be a finite number above 0"},
                {"wheel_diameter_mm", "big", "is \"big\" (a string), but must be a number above 0"},
                {"wheel_diameter_mm", 1e13, "is 10000000000000.0" + beyond},
                {"wheel_diamter_mm", 65, "is not known; did you mean wheel_diameter_mm?"}});
  expectMissing(axis, {{"full_steps_per_round",
                        "an integer of 1 or more, as the axis is scaled by wheel_diameter_mm"}});
}

TEST(ReadMotion, RefusesAWheelWithAnotherTravelOrInDegrees) {
  ConfigValue axis = linearAxis();
  drop(axis, "steps_per_mm");
  put(axis, "full_steps_per_round", 200);
  put(axis, "mm_per_round", 40);
  expectIssues(axis, {{"wheel_diameter_mm", 65.0,
                       "is 65.0, but mm_per_round must not be given with it: a revolution travels "
                       "either that or pi times the diameter"}});
  ConfigValue rotary = rotaryAxis();
  put(rotary, "wheel_diameter_mm", 65.0);
  EXPECT_EQ(issuesOfX(rotary),
            Lines{"/axes/x: has wheel_diameter_mm and steps_per_degree, but must be either linear, "
                  "with all keys in mm, or rotary, with all keys in degrees"});
}

TEST(ReadMotion, ScalesARotaryAxisByTheRoundsOfItsMotor) {
  ConfigValue axis = rotaryAxis();
  drop(axis, "steps_per_degree");
  put(axis, "full_steps_per_round", 200);
  EXPECT_DOUBLE_EQ(readX(axis).steps_per_unit, 6400.0 / (2.0 * kPi));
  EXPECT_EQ(readX(axis).steps_per_round, 6400.0);
  put(axis, "gear_ratio", 5);
  EXPECT_DOUBLE_EQ(readX(axis).steps_per_unit, 32000.0 / (2.0 * kPi));
  expectMissing(axis, {{"full_steps_per_round",
                        "an integer of 1 or more, as the axis is scaled by gear_ratio"}});
}

TEST(ReadMotion, RefusesTwoScales) {
  const std::string rest =
      " must not be given with it: the axis is scaled by either (the motor's own steps can be "
      "given "
      "as steps_per_round)";
  ConfigValue axis = linearAxis();
  put(axis, "full_steps_per_round", 200);
  EXPECT_EQ(issuesOfX(axis),
            Lines{"/axes/x/steps_per_mm: is 80.0, but full_steps_per_round" + rest});
  put(axis, "mm_per_round", 40.0);
  put(axis, "gear_ratio", 1);
  EXPECT_EQ(issuesOfX(axis),
            Lines{"/axes/x/steps_per_mm: is 80.0, but full_steps_per_round, mm_per_round and "
                  "gear_ratio" +
                  rest});
  drop(axis, "mm_per_round");
  put(axis, "wheel_diameter_mm", 65.0);
  EXPECT_EQ(issuesOfX(axis), Lines{"/axes/x/steps_per_mm: is 80.0, but full_steps_per_round, "
                                   "wheel_diameter_mm and gear_ratio" +
                                   rest});
}

TEST(ReadMotion, ChecksTheStepsOfARound) {
  expectIssues(
      linearAxis(),
      {{"steps_per_round", 3200, ""},
       {"steps_per_round", 3208,
        "is 3208, but must be a multiple of microsteps, which is 16: it counts the "
        "microsteps of whole full steps"},
       {"steps_per_round", -1, "is -1, but must be 1 or more"},
       {"steps_per_round", 3200.0,
        "is 3200.0 (a number with a decimal point), but must be an integer of 1 or more"}});
  ConfigValue axis = linearAxis();
  drop(axis, "steps_per_mm");
  put(axis, "full_steps_per_round", 200);
  put(axis, "mm_per_round", 40.0);
  expectIssues(axis,
               {{"steps_per_round", 3200, ""},
                {"steps_per_round", 1600,
                 "is 1600, but must be 3200: full_steps_per_round (200) times microsteps (16)"}});
}

TEST(ReadMotion, KeepsTheSpeedWithinWhatTheChipCanCount) {
  expectIssues(
      linearAxis(),
      {{"max_speed_mm_s", 6250, ""},
       {"max_speed_mm_s", 6250.1,
        "is 6250.1, but must be at most 6250: it is 500008 steps/s (at 80 steps per mm), and "
        "the A4988 takes at most 500000 steps/s (1 us high, 1 us low)"}});
  ConfigValue axis = linearAxis();
  put(axis, "timing", mapOf({{"step_high_us", 24}, {"step_low_us", 101.0}}));
  EXPECT_EQ(readX(axis).max_speed, 0.1) << "8000 of 8000 steps/s";
  put(axis, "timing/step_low_us", 101.1);
  EXPECT_EQ(issuesOfX(axis),
            Lines{"/axes/x/max_speed_mm_s: is 100.0, but must be at most 99.92: it is 8000 steps/s "
                  "(at 80 steps per mm), and the A4988 takes at most 7993.6 steps/s (24 us high, "
                  "101.1 us low)"});
  ConfigValue rotary = rotaryAxis();
  put(rotary, "max_speed_deg_s", 30000.0);
  EXPECT_EQ(
      issuesOfX(rotary),
      Lines{"/axes/x/max_speed_deg_s: is 30000.0, but must be at most 25000: it is 300000 steps/s "
            "(at 10 steps per degree), and the DRV8825 takes at most 250000 steps/s (1.9 us high, "
            "2.1 us low)"});
}

TEST(ReadMotion, AcceptsTheSpeedThatItsMessageNames) {
  for (const double scale : {80.0, 133.333, 7.7, 0.0123, 98765.4321}) {
    for (const double low_us : {1.0, 1.9, 6.3}) {
      ConfigValue axis = linearAxis();
      put(axis, "steps_per_mm", scale);
      put(axis, "timing/step_low_us", low_us);
      put(axis, "max_speed_mm_s", 1e12);
      const Lines lines = issuesOfX(axis);
      ASSERT_EQ(lines.size(), 1U);
      const std::string before = "must be at most ";
      const double named = std::stod(lines[0].substr(lines[0].find(before) + before.size()));
      put(axis, "max_speed_mm_s", named);
      EXPECT_EQ(issuesOfX(axis), Lines{});
      put(axis, "max_speed_mm_s", named * 1.0001);
      EXPECT_EQ(issuesOfX(axis).size(), 1U) << lines[0];
    }
  }
}

TEST(ReadMotion, RefusesWhatNoMotionCanCountOrTime) {
  expectIssues(
      linearAxis(),
      {{"max_speed_mm_s", 1e-6, "is 1e-06, but must be at least 1.25e-05, which is 0.001 steps/s"},
       {"max_speed_mm_s", 1.25e-5, ""},
       {"acceleration_mm_s2", 1e-300,
        "is 1e-300, but must be from 1.25e-05 to 12500000000, which is 0.001 to "
        "1000000000000 steps/s^2"},
       {"deceleration_mm_s2", 1e300,
        "is 1e+300, but must be from 1.25e-05 to 12500000000, which is 0.001 to "
        "1000000000000 steps/s^2"},
       {"max_position_mm", 1e300,
        "is 1e+300, but must be from -112589000000000 to 112589000000000, which is as far "
        "as steps are counted"},
       {"steps_per_mm", 1e-200,
        "is 1e-200, which makes 1e-200 steps per mm, but must make "
        "from 1e-09 to 1000000000"}});
}

TEST(ReadMotion, LetsOnlyARotaryAxisWithoutSoftLimitsBeContinuous) {
  ConfigValue axis = rotaryAxis();
  EXPECT_FALSE(readX(axis).continuous);
  put(axis, "continuous", true);
  EXPECT_TRUE(readX(axis).continuous);
  put(axis, "max_position_deg", 90.0);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("continuous",
                    "is true, but must be false, as max_position_deg is given: an axis "
                    "that turns without end has no soft limits"));
  axis = linearAxis();
  put(axis, "continuous", true);
  EXPECT_EQ(issuesOfX(axis),
            lineOfX("continuous",
                    "is true, but must be false: only a rotary axis, with its keys in "
                    "degrees, turns without end"));
}

TEST(ReadMotion, SaysNothingAboutWhatFollowsFromAMistake) {
  ConfigValue axis = linearAxis();
  put(axis, "max_speed_mm_s", 1e6);  // too fast for any scale but a wrong one
  for (const auto& [path, value] :
       std::vector<std::pair<std::string, ConfigValue>>{{"steps_per_mm", -80.0},
                                                        {"driver", "a1"},
                                                        {"timing/step_high_us", 0.0},
                                                        {"timing", "slow"}}) {
    ConfigValue wrong = axis;
    put(wrong, path, value);
    const Lines lines = issuesOfX(wrong);
    ASSERT_EQ(lines.size(), 1U) << path << ": " << lines.back();
    EXPECT_EQ(lines[0].rfind("/axes/x/" + path + ": ", 0), 0U) << lines[0];
  }
}

}  // namespace
}  // namespace stepdriver::config
