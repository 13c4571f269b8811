#include "config/read_kinematics.h"

#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

ConfigValue::List row(double a, double b) { return {a, b}; }

ConfigValue axisOn(const std::string& chip) {
  ConfigValue axis = linearAxis(chip);
  put(axis, "max_speed_mm_s", 50.0);
  return axis;
}

/// x and y of a CoreXY.
ConfigValue coreXy() {
  return mapOf(
      {{"axes", mapOf({{"x", axisOn("gpiochip0")}, {"y", axisOn("gpiochip1")}})},
       {"kinematics", mapOf({{"type", "corexy"},
                             {"axes", ConfigValue::List{std::string("x"), std::string("y")}}})}});
}

std::vector<AxisConfig> read(const ConfigValue& tree, Lines& lines) {
  std::vector<ConfigIssue> issues;
  ConfigReader reader(tree, "", issues);
  auto axes = readAxes(reader.value("axes"), "/axes", issues);
  readKinematics(reader.map("kinematics"), issues.empty(), axes);
  lines = linesOf(issues);
  return axes;
}

Lines issuesWith(const std::string& path, const ConfigValue& value) {
  ConfigValue tree = coreXy();
  put(tree, path, value);
  Lines lines;
  read(tree, lines);
  return lines;
}

TEST(ReadKinematics, KnowsNamedArrangements) {
  for (const std::string type : {"corexy", "h_bot", "differential"}) {
    ConfigValue tree = coreXy();
    put(tree, "kinematics/type", type);
    Lines lines;
    const std::vector<AxisConfig> axes = read(tree, lines);
    EXPECT_EQ(lines, Lines{});
    ASSERT_EQ(axes.size(), 2U);
    ASSERT_NE(axes[0].kinematics, nullptr);
    EXPECT_EQ(axes[1].kinematics, axes[0].kinematics);
    EXPECT_EQ(axes[0].kinematics->axes, (std::vector<std::string>{"x", "y"}));
    EXPECT_EQ(axes[0].kinematics->matrix, (Matrix{{1.0, 1.0}, {1.0, -1.0}}));
    EXPECT_EQ(axes[0].kinematics->inverse, (Matrix{{0.5, 0.5}, {0.5, -0.5}}));
  }
}

TEST(ReadKinematics, TakesAnyMatrixThatCanBeInverted) {
  ConfigValue tree = coreXy();
  drop(tree, "kinematics/type");
  put(tree, "kinematics/matrix", ConfigValue::List{row(0.0, 2.0), row(-1.0, 0.5)});
  Lines lines;
  const std::vector<AxisConfig> axes = read(tree, lines);
  EXPECT_EQ(lines, Lines{});
  ASSERT_NE(axes[0].kinematics, nullptr);
  EXPECT_EQ(axes[0].kinematics->inverse, (Matrix{{0.25, -1.0}, {0.5, 0.0}}));
}

TEST(ReadKinematics, RefusesMatricesThatDontMoveEachAxisAlone) {
  ConfigValue tree = coreXy();
  drop(tree, "kinematics/type");
  const auto issues_of_matrix = [&](const ConfigValue& matrix) {
    put(tree, "kinematics/matrix", matrix);
    Lines lines;
    read(tree, lines);
    return lines;
  };
  EXPECT_EQ(issues_of_matrix(ConfigValue::List{row(1.0, 2.0), row(2.0, 4.0)}),
            (Lines{"/kinematics/matrix: is singular, but must be one with which each axis can be "
                   "moved alone; no rows may be multiples of each other"}));
  EXPECT_EQ(
      issues_of_matrix(ConfigValue::List{row(1.0, 1.0), row(1.0, 1.01)}),
      (Lines{"/kinematics/matrix: has the condition 404.01, but must have one of at most 100: a "
             "microstep of a motor would move an axis too far"}));
  for (const double small : {5e-324, 1e-300, 0.009}) {
    EXPECT_EQ(issues_of_matrix(ConfigValue::List{row(small, small), row(small, -small)}),
              (Lines{"/kinematics/matrix: moves no motor by 0.01 or more for 1 of x, but must move "
                     "one: an axis must not make more than 100 times the way of its motors"}));
    EXPECT_EQ(issues_of_matrix(ConfigValue::List{row(1.0, small), row(1.0, -small)}),
              (Lines{"/kinematics/matrix: moves no motor by 0.01 or more for 1 of y, but must move "
                     "one: an axis must not make more than 100 times the way of its motors"}));
  }
  EXPECT_EQ(issues_of_matrix(ConfigValue::List{row(0.01, 0.01), row(0.01, -0.01)}), Lines());
  EXPECT_EQ(issues_of_matrix(ConfigValue::List{row(1.0, 1.0)}),
            (Lines{"/kinematics/matrix: is a list of 1, but must be a list of as many lists of "
                   "numbers as each has: [[1, 1], [1, -1]]"}));
  EXPECT_EQ(
      issues_of_matrix(ConfigValue::List{ConfigValue::List{1.0}}),
      (Lines{"/kinematics/matrix: has 1 motors, but must have as many as there are axes, 2"}));
}

TEST(ReadKinematics, RefusesWrongNames) {
  const auto names = [](const std::string& a, const std::string& b) {
    return ConfigValue::List{a, b};
  };
  EXPECT_EQ(issuesWith("kinematics/axes", names("x", "x")),
            (Lines{"/kinematics/axes: names x twice"}));
  EXPECT_EQ(issuesWith("kinematics/axes", names("x", "z")),
            (Lines{"/kinematics/axes: has \"z\", but must have names of axes only"}));
  EXPECT_EQ(issuesWith("kinematics/axes", ConfigValue::List{std::string("x")}),
            (Lines{"/kinematics/axes: has 1 axes, but must be a list of 2 to 4 axes"}));
  EXPECT_EQ(issuesWith("kinematics/kind", 1).size(), 1U);
}

TEST(ReadKinematics, RefusesWhatAxesThatShareMotorsCantHave) {
  const auto only = [](const std::string& path, const ConfigValue& value) {
    const Lines lines = issuesWith(path, value);
    return lines.size() == 1 ? lines.front() : std::to_string(lines.size()) + " issues";
  };
  EXPECT_EQ(only("axes/y/backlash_mm", 0.1),
            "/kinematics/axes: has y with a backlash, which it must not have: a backlash belongs "
            "to a motor, and this axis shares all of them");
  EXPECT_EQ(only("axes/y/pins/enable", std::string("E")),
            "/kinematics/axes: has y, whose pins/enable must be wired or not like that of x: the "
            "motors are switched together");
  EXPECT_EQ(only("axes/y/holds_position_unpowered", true),
            "/kinematics/axes: has y, whose holds_position_unpowered must be that of x");
}

TEST(ReadKinematics, RefusesAHomingThatWouldCostTheOtherAxisItsPosition) {
  ConfigValue tree = coreXy();
  for (const std::string axis : {"x", "y"}) {
    put(tree, "axes/" + axis + "/endstops/min/pin", axis + ".min");
    put(tree, "axes/" + axis + "/endstops/min/active_level", std::string("low"));
    put(tree, "axes/" + axis + "/homing",
        mapOf({{"switch", "min"},
               {"seek_speed_mm_s", 10.0},
               {"latch_speed_mm_s", 1.0},
               {"pull_off_mm", 1.0},
               {"max_travel_mm", 100.0},
               {"order", axis == "x" ? 0 : 1}}));
  }
  Lines lines;
  read(tree, lines);
  EXPECT_EQ(lines, Lines{});
  put(tree, "axes/y/homing/order", 0);
  read(tree, lines);
  EXPECT_EQ(lines, (Lines{"/kinematics/axes: has x and y, whose homing/order must differ: the one "
                          "moves the motors of the other"}));
  put(tree, "axes/y/homing/order", 1);
  put(tree, "axes/y/homing/seek_speed_mm_s", 20.0);
  read(tree, lines);
  ASSERT_EQ(lines.size(), 1U);
  EXPECT_EQ(lines[0].find("/kinematics/axes: has y, whose homing must seek the switch at 14.1"), 0U)
      << lines[0];
}

void homeToFlag(ConfigValue& tree) {
  put(tree, "axes/x/homing",
      mapOf({{"kind", "flag"},
             {"towards", "max"},
             {"input", "home"},
             {"seek_speed_mm_s", 10.0},
             {"latch_speed_mm_s", 1.0},
             {"max_travel_mm", 100.0}}));
}

// The index of a motor of a CoreXY comes at a place of x that depends on where y is.
TEST(ReadKinematics, RefusesAHomingToAnIndexOfAMotorThatTheOtherAxisTurnsToo) {
  ConfigValue tree = coreXy();
  put(tree, "axes/x/steps_per_round", 3200);
  homeToFlag(tree);
  Lines lines;
  read(tree, lines);
  EXPECT_EQ(lines, Lines{});
  put(tree, "axes/x/homing/kind", std::string("index"));
  read(tree, lines);
  EXPECT_EQ(lines, (Lines{"/kinematics/axes: has x, whose homing/kind must not be index: an index "
                          "comes once a turn of a motor, which the other axes turn too"}));
}

TEST(ReadKinematics, RefusesAHomingToAStallOfAMotorThatTheOtherAxisTurnsToo) {
  for (const std::string type : {"corexy", "differential"}) {
    ConfigValue tree = coreXy();
    put(tree, "kinematics/type", type);
    int address = 0;
    for (const std::string axis : {"axes/x", "axes/y"}) {
      put(tree, axis + "/driver", "tmc2209");
      put(tree, axis + "/tmc",
          mapOf({{"port", "/dev/serial0"},
                 {"address", address++},
                 {"sense_resistor_mohm", 110.0},
                 {"run_current_a", 0.8},
                 {"stall_threshold", 60}}));
    }
    homeToFlag(tree);
    Lines lines;
    read(tree, lines);
    EXPECT_EQ(lines, Lines{});
    put(tree, "axes/x/homing",
        mapOf({{"kind", "stall"},
               {"towards", "max"},
               {"seek_speed_mm_s", 40.0},
               {"pull_off_mm", 20.0},
               {"offset_mm", 0.0},
               {"max_travel_mm", 100.0}}));
    read(tree, lines);
    EXPECT_EQ(lines,
              (Lines{"/kinematics/axes: has x, whose homing/kind must not be stall: a stall is of "
                     "one motor, and the others would move the axis on"}));
  }
}

TEST(ReadKinematics, RefusesTopSpeedsThatADriverCantStepTogether) {
  ConfigValue tree = coreXy();
  for (const std::string axis : {"x", "y"}) {
    put(tree, "axes/" + axis + "/max_speed_mm_s", 4000.0);  // 320,000 steps/s of the 500,000
  }
  Lines lines;
  read(tree, lines);
  EXPECT_EQ(lines.size(), 2U);
  ASSERT_FALSE(lines.empty());
  EXPECT_EQ(
      lines[0],
      "/kinematics/axes: need 640000 steps/s of the motor with the pins of x when all move at "
      "their top speeds, but the A4988 allows 500000; lower their top speeds or microsteps");
}

}  // namespace
}  // namespace stepdriver::config
