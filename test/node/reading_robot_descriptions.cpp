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

/// The mistake that is found in a robot description for one axis, x; empty: none.
std::string mistakeIn(const std::string& urdf) {
  config::AxisConfig x;
  x.name = "x";
  x.joint = "x_joint";
  x.max_speed = 0.1;
  x.steps_per_unit = 80000.0;
  std::vector<config::AxisConfig> axes{x};
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

}  // namespace
}  // namespace stepdriver::node_test
