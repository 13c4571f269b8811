#include <gtest/gtest.h>

#include <string>
#include <vector>

#include "common/robot_description.h"
#include "stepdriver_core/config/axis_config.h"
#include "support/contents_of.h"
#include "support/says.h"

// Robot descriptions that urdfdom's own reader of XML, libtinyxml, must not see.

namespace stepdriver::node_test {
namespace {

/// An axis x, which no robot description has limited yet.
config::AxisConfig axisX() {
  config::AxisConfig x;
  x.name = "x";
  x.joint = "x_joint";
  x.max_speed = 0.1;
  x.steps_per_unit = 80000.0;
  return x;
}

/// The mistake that is found in a robot description for one axis, x; empty: none.
std::string mistakeIn(const std::string& urdf) {
  std::vector<config::AxisConfig> axes{axisX()};
  std::vector<ConfigIssue> issues;
  ros_node::applyRobotDescription(urdf, "/robot_description", axes, issues);
  EXPECT_LE(issues.size(), 1U);
  return issues.empty() ? "" : issues[0].key + " " + issues[0].message;
}

std::string robot(const std::string& before = {}, const std::string& inside = {}) {
  return before + "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/>" + inside +
         "<joint name=\"x_joint\" type=\"prismatic\"><parent link=\"a\"/><child link=\"b\"/>"
         "<limit lower=\"0\" upper=\"0.1\" velocity=\"0.1\" effort=\"1\"/></joint></robot>";
}

/// An element in an element, and so on.
std::string nested(int depth) {
  std::string elements;
  for (int i = 0; i < depth; ++i) elements += "<a>";
  for (int i = 0; i < depth; ++i) elements += "</a>";
  return elements;
}

TEST(ReadingARobotDescription, AcceptsWhatIsWellFormed) {
  EXPECT_EQ(mistakeIn(robot()), "");
  EXPECT_EQ(mistakeIn(robot("<?xml version=\"1.0\" encoding=\"utf-8\"?>\n<!-- \xc3\xa4 -->\n")),
            "");
  EXPECT_EQ(mistakeIn(robot({}, "<gazebo><sensor:camera/></gazebo>")), "")
      << "old descriptions don't declare that prefix";
  EXPECT_EQ(mistakeIn(robot({}, nested(50))), "");
}

// libtinyxml reads beyond the end of this file.
TEST(ReadingARobotDescription, NamesThePlaceOfWhatIsNotWellFormed) {
  expectSays(mistakeIn(test::contentsOf(STEPDRIVER_SOURCES
                                        "/test/fuzz/corpus/robot_description/read_beyond_its_end")),
             "/robot_description can't be read as XML: line 6, column 41: "
             "Input is not proper UTF-8");
  expectSays(mistakeIn("<robot name=\"r\">\n  <link name=\"a\">\n</robot>"),
             "can't be read as XML: line 3, column 9: Opening and ending tag mismatch");
  expectSays(mistakeIn(robot({}, "<a b=\"1\" b=\"2\"/>")), "Attribute b redefined");
  expectSays(mistakeIn(robot({}, "&unknown;")), "Entity 'unknown' not defined");
  expectSays(mistakeIn(std::string(robot(), 0, 60)), "line 1, column 6");
}

TEST(ReadingARobotDescription, RefusesEntities) {
  const std::string bomb =
      "<!DOCTYPE robot [<!ENTITY a \"aaaaaaaaaa\"><!ENTITY b \"&a;&a;&a;&a;&a;&a;&a;&a;\">]>\n";
  expectSays(mistakeIn(robot(bomb, "&b;")), "document type declaration");
  expectSays(mistakeIn(robot("<!DOCTYPE robot SYSTEM \"file:///etc/hostname\">")),
             "document type declaration");
}

// libtinyxml reads it by recursion, which took the whole stack.
TEST(ReadingARobotDescription, RefusesWhatIsNestedTooDeep) {
  expectSays(mistakeIn(robot({}, nested(100'000))), "Excessive depth");
}

/// An axis x that was fitted to a joint with this limit.
config::AxisConfig fitted(const std::string& limit, std::vector<std::string>* warnings = nullptr,
                          std::vector<ConfigIssue>* issues = nullptr) {
  std::vector<config::AxisConfig> axes{axisX()};
  std::vector<ConfigIssue> found;
  const std::string urdf =
      "<robot name=\"r\"><link name=\"a\"/><link name=\"b\"/><link name=\"c\"/>"
      "<joint name=\"y_joint\" type=\"prismatic\"><parent link=\"a\"/><child link=\"c\"/>"
      "<limit lower=\"0\" upper=\"1\" velocity=\"1\" effort=\"1\"/></joint>"
      "<joint name=\"x_joint\" type=\"prismatic\"><parent link=\"a\"/><child link=\"b\"/>" +
      limit + "</joint></robot>";
  const auto said = ros_node::applyRobotDescription(urdf, "/robot_description", axes, found);
  if (warnings != nullptr) *warnings = said;
  if (issues == nullptr) {
    for (const ConfigIssue& issue : found) ADD_FAILURE() << issue.message;
  } else {
    *issues = found;
  }
  return axes.front();
}

TEST(ReadingARobotDescription, TakesLimitsBeyondAllStepsForNone) {
  for (const std::string far : {"1e16", "1e300"}) {
    const config::AxisConfig free = fitted("<limit lower=\"-" + far + "\" upper=\"" + far +
                                           "\" velocity=\"1e16\" effort=\"1e16\"/>");
    EXPECT_FALSE(free.min_position) << far;
    EXPECT_FALSE(free.max_position) << far;
    EXPECT_EQ(free.max_speed, 0.1);
  }
  const config::AxisConfig half =
      fitted("<limit lower=\"-0.2\" upper=\"1e16\" velocity=\"1\" effort=\"1\"/>");
  EXPECT_EQ(half.min_position, -0.2);
  EXPECT_FALSE(half.max_position);
  std::vector<ConfigIssue> issues;
  fitted("<limit lower=\"1e16\" upper=\"2e16\" velocity=\"1\" effort=\"1\"/>", nullptr, &issues);
  ASSERT_EQ(issues.size(), 1U) << "no position is in it";
  expectSays(issues[0].message, "as far as steps are counted");
}

TEST(ReadingARobotDescription, TightensLimitsByASafetyController) {
  const std::string limit = "<limit lower=\"0\" upper=\"0.2\" velocity=\"1\" effort=\"1\"/>";
  const auto safety = [&limit](const std::string& soft) {
    return limit + "<safety_controller " + soft + " k_velocity=\"10\"/>";
  };
  const config::AxisConfig tight =
      fitted(safety("soft_lower_limit=\"0.01\" soft_upper_limit=\"0.15\""));
  EXPECT_EQ(tight.min_position, 0.01);
  EXPECT_EQ(tight.max_position, 0.15);
  EXPECT_EQ(tight.min_position_source, config::LimitSource::kRobotDescription);
  const config::AxisConfig wide =
      fitted(safety("soft_lower_limit=\"-1\" soft_upper_limit=\"0.15\""));
  EXPECT_EQ(wide.min_position, 0.0);
  EXPECT_EQ(wide.max_position, 0.15);
  const config::AxisConfig without = fitted(safety(""));
  EXPECT_EQ(without.min_position, 0.0);
  EXPECT_EQ(without.max_position, 0.2);
  std::vector<ConfigIssue> issues;
  fitted(safety("soft_lower_limit=\"0.3\" soft_upper_limit=\"0.4\""), nullptr, &issues);
  ASSERT_EQ(issues.size(), 1U);
  expectSays(issues[0].message, "soft_lower_limit=0.3 and soft_upper_limit=0.4");
}

TEST(ReadingARobotDescription, WarnsOfAnAxisWhoseJointMimicsAnother) {
  std::vector<std::string> warnings;
  fitted("<limit lower=\"0\" upper=\"0.2\" velocity=\"1\" effort=\"1\"/><mimic joint=\"y_joint\"/>",
         &warnings);
  ASSERT_EQ(warnings.size(), 1U);
  expectSays(warnings[0], "axis x has the joint x_joint, which mimics y_joint");
}

}  // namespace
}  // namespace stepdriver::node_test
