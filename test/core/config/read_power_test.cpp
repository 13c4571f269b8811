#include <gtest/gtest.h>

#include <string>

#include "support/axis_config.h"

namespace stepdriver::config {
namespace {

TEST(ReadPower, TakesAnIdleTimeoutOnlyWithThePinThatItNeeds) {
  ConfigValue good = linearAxis();
  put(good, "pins/enable", std::string("E"));
  put(good, "idle_timeout_s", 30.0);
  const AxisConfig config = readX(good);
  EXPECT_EQ(config.idle_timeout, 30.0);
  EXPECT_EQ(config.idle_action, IdleAction::kDisable);
  EXPECT_FALSE(config.holds_position_unpowered);
  expectIssues(good, {{"idle_timeout_s", -1.0, "is -1.0, but must be from 0 to 86400"},
                      {"idle_action", std::string("off"),
                       "is \"off\", but must be disable, sleep or lower_current"}});
  ConfigValue sleeps = good;
  put(sleeps, "idle_action", std::string("sleep"));
  EXPECT_EQ(issuesOfX(sleeps),
            lineOfX("idle_timeout_s",
                    "is 30.0, but with idle_action sleep that needs /axes/x/pins/sleep, which "
                    "isn't wired"));
  put(sleeps, "pins/sleep", std::string("S"));
  EXPECT_EQ(readX(sleeps).idle_action, IdleAction::kSleep);
  drop(good, "pins/enable");
  EXPECT_EQ(issuesOfX(good),
            lineOfX("idle_timeout_s",
                    "is 30.0, but with idle_action disable that needs /axes/x/pins/enable, which "
                    "isn't wired"));
  put(good, "pins/enable", 5);
  EXPECT_EQ(issuesOfX(good).size(), 1U) << "what is wrong with the pin is said once";
}

}  // namespace
}  // namespace stepdriver::config
