#include <gtest/gtest.h>

#include <cmath>
#include <ostream>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/rotary_axis.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// A robot of one joint, x_joint.
std::string robot(const std::string& type, const std::string& limit) {
  return "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><joint name=\"x_joint\" type=\"" +
         type + "\"><parent link=\"a\"/><child link=\"b\"/><axis xyz=\"1 0 0\"/>" + limit +
         "</joint></robot>";
}

const char* const kTighter = R"(<limit lower="0.02" upper="0.05" velocity="0.05" effort="1"/>)";
const char* const kLooser = R"(<limit lower="-9" upper="9" velocity="9" effort="1"/>)";

TEST(RobotDescription, ThatIsAbsentIsSaidAndNoMistake) {
  NodeUnderTest node;
  node.start();
  expectSays(node.process().output(), "no robot_description");
}

TEST(RobotDescription, TightensTheLimitsAndSaysWhereTheyCameFrom) {
  NodeUnderTest node;
  node.describe(robot("prismatic", kTighter));
  node.start();
  expectSays(node.process().output(), "min position 0.02 m (from robot_description)");
  expectSays(node.process().output(), "max position 0.05 m (from robot_description)");
  expectSays(node.process().output(), "speed 0.05 m/s (from robot_description)");
  expectSays(node.moveTo(0.06, true).message,
             "above the soft limit max_position 0.05 m, from robot_description");
  expectSays(node.moveTo(0.01, true).message,
             "below the soft limit min_position 0.02 m, from robot_description");
  expectSays(node.moveTo(0.05, true, 0.06).message,
             "above the maximum 0.05 m/s, from robot_description");
  EXPECT_EQ(node.pulses(), 0);
  const auto answer = node.moveTo(0.05, true);
  EXPECT_TRUE(answer.success) << answer.message;
  EXPECT_GT(answer.duration, 1.0) << "0.05 m at 0.05 m/s";
}

TEST(RobotDescription, ThatIsLooserLeavesTheLimitsOfTheAxis) {
  NodeUnderTest node;
  node.describe(robot("prismatic", kLooser));
  node.start();
  expectSays(node.process().output(), "min position 0 m (from the configuration)");
  expectSays(node.process().output(), "max position 0.2 m (from the configuration)");
  expectSays(node.process().output(), "speed 0.1 m/s (from the configuration)");
  EXPECT_FALSE(node.moveTo(0.3, true).success);
}

TEST(RobotDescription, IsNotReadIfItsLimitsAreNotWanted) {
  NodeUnderTest node;
  node.describe(robot("fixed", kTighter));
  node.set("urdf_limits", false);
  node.start();
  expectSays(node.moveTo(0.3, true).message, "max_position 0.2 m, from the configuration");
  EXPECT_TRUE(node.moveTo(0.06, true).success);
}

TEST(RobotDescription, LimitsARevoluteJoint) {
  NodeUnderTest node;
  makeRotary(node);
  node.describe(robot("revolute", R"(<limit lower="-1" upper="1" velocity="2" effort="1"/>)"));
  node.start();
  expectSays(node.process().output(), "min position -1 rad (from robot_description)");
  expectSays(node.process().output(), "speed 2 rad/s (from robot_description)");
  EXPECT_FALSE(node.moveTo(1.1, true).success);
  EXPECT_TRUE(node.moveTo(1.0, true).success);
}

TEST(RobotDescription, LeavesAContinuousJointWithoutPositionLimits) {
  NodeUnderTest node;
  makeRotary(node);
  node.describe(robot("continuous", ""));
  node.start();
  expectSays(node.process().output(), "max position none");
  EXPECT_EQ(node.process().output().find("has soft limits"), std::string::npos);
  EXPECT_TRUE(node.moveTo(10.0, true).success);
  EXPECT_EQ(node.pulses(), std::llround(10.0 * 3200 / (2 * std::acos(-1.0))));
}

TEST(RobotDescription, WarnsOfAContinuousJointWhoseAxisHasSoftLimits) {
  NodeUnderTest node;
  makeRotary(node);
  node.set("axes/x/max_position_deg", 90.0);
  node.describe(robot("continuous", R"(<limit velocity="2" effort="1"/>)"));
  node.start();
  expectSays(
      node.process().output(),
      "axis x has soft limits, but its joint x_joint is continuous in the robot description");
  expectSays(node.process().output(), "speed 2 rad/s (from robot_description)");
  const auto beyond = node.moveTo(1.6, true);
  EXPECT_FALSE(beyond.success);
  expectSays(beyond.message, "above the soft limit max_position");
  EXPECT_TRUE(node.moveTo(-7.0, true).success) << "on that side it has none";
}

struct BadDescription {
  std::string name;
  bool rotary;
  std::string urdf;
  std::string words;
};

void PrintTo(const BadDescription& bad, std::ostream* out) {  // NOLINT: GoogleTest's name for it
  *out << bad.name;
}

class BadRobotDescription : public testing::TestWithParam<BadDescription> {};

TEST_P(BadRobotDescription, IsAReasonNotToStart) {
  NodeUnderTest node;
  if (GetParam().rotary) makeRotary(node);
  node.describe(GetParam().urdf);
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  expectSays(node.process().output(), node.beside("robot_description") + " ");
  expectSays(node.process().output(), GetParam().words);
}

const std::vector<BadDescription> kBadDescriptions = {
    {"Empty", false, "", "can't be read as XML: line 1, column 1"},
    {"NoXml", false, "robot", "can't be read as XML: line 1, column 1"},
    {"Unfinished", false, "<robot name=\"r\"><link", "can't be read as XML: line 1, column 22"},
    {"NoRobot", false, "<sdf/>", "can't be read as a URDF"},
    {"PrismaticWithoutLimit", false, robot("prismatic", ""), "joint without <limit"},
    {"RevoluteWithoutLimit", true, robot("revolute", ""), "joint without <limit"},
    {"WithoutTheJoint", false, "<robot name=\"r\"><link name=\"a\"/></robot>",
     "no joint \"x_joint\""},
    {"Fixed", false, robot("fixed", ""), "is fixed, but must be prismatic"},
    {"Floating", true, robot("floating", ""), "is floating, but must be revolute or continuous"},
    {"RevoluteInMm", false, robot("revolute", kLooser), "is revolute, but must be prismatic"},
    {"ContinuousInMm", false, robot("continuous", ""), "is continuous, but must be prismatic"},
    {"PrismaticInDegrees", true, robot("prismatic", kLooser),
     "is prismatic, but must be revolute or continuous"},
    {"LowerAboveUpper", false,
     robot("prismatic", R"(<limit lower="0.1" upper="0.05" velocity="1" effort="1"/>)"),
     "lower=0.1 and upper=0.05"},
    {"NoBounds", false, robot("prismatic", R"(<limit velocity="1" effort="1"/>)"),
     "a missing one is 0"},
    {"NoVelocity", false,
     robot("prismatic", R"(<limit lower="0" upper="0.1" velocity="0" effort="1"/>)"),
     "velocity limit 0"},
    {"VelocityBelowTheLowest", false,
     robot("prismatic", R"(<limit lower="0" upper="0.1" velocity="1e-300" effort="1"/>)"),
     "which is 0.001 steps/s"},
    {"FartherThanStepsAreCounted", true,
     robot("revolute", R"(<limit lower="1e16" upper="1e300" velocity="1" effort="1"/>)"),
     "which is as far as steps are counted"},
    {"ElsewhereThanTheAxis", false,
     robot("prismatic", R"(<limit lower="1" upper="2" velocity="1" effort="1"/>)"),
     "doesn't overlap the axis's own range"},
};

INSTANTIATE_TEST_SUITE_P(That, BadRobotDescription, testing::ValuesIn(kBadDescriptions),
                         [](const auto& value) { return "is" + value.param.name; });

TEST(RobotDescription, OfAWrongTypeIsAReasonNotToStart) {
  NodeUnderTest node;
  ros::param::set(node.beside("robot_description"), 5);
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  expectSays(node.process().output(), "must be the XML of a URDF");
}

}  // namespace
}  // namespace stepdriver::node_test
