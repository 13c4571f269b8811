#include <gtest/gtest.h>

#include <string>
#include <utility>
#include <vector>

#include "common/node_config.h"
#include "stepdriver_core/gpio/libgpiod_lines.h"

namespace stepdriver::ros_node {
namespace {

using config::ConfigValue;

std::vector<ConfigIssue> issuesOfBackend(const std::string& backend) {
  const ConfigValue tree(ConfigValue::Map{{"gpio", ConfigValue::Map{{"backend", backend}}}});
  std::vector<ConfigIssue> all;
  readNodeConfig(tree, "/stepdriver", all);
  std::vector<ConfigIssue> issues;
  for (const ConfigIssue& issue : all) {
    if (issue.key == "/stepdriver/gpio/backend") issues.push_back(issue);
  }
  return issues;
}

TEST(WithoutLibgpiod, TheBackendIsRefusedWithTheWayToGetIt) {
  const auto issues = issuesOfBackend("libgpiod");
  ASSERT_EQ(issues.size(), 1U);
  EXPECT_NE(issues[0].message.find("libgpiod-dev"), std::string::npos) << issues[0].message;
}

TEST(WithoutLibgpiod, TheSimulatedRigIsThereAndRealLinesAreNot) {
  EXPECT_TRUE(issuesOfBackend("simulated").empty());
  EXPECT_EQ(gpio::libgpiodVersion(), "");
  EXPECT_THROW(gpio::makeLibgpiodBackend(), GpioError);
  EXPECT_THROW(gpio::gpioChips(), GpioError);
}

}  // namespace
}  // namespace stepdriver::ros_node
