#include "stepdriver_core/error.h"

#include <gtest/gtest.h>

namespace stepdriver {
namespace {

TEST(ConfigErrorTest, SaysEverythingThatIsWrongOnItsOwnLine) {
  const ConfigError error({{"/axes/x/driver", "must be given"}, {"/axes/x/microsteps", "is 3"}});
  EXPECT_STREQ(error.what(), "/axes/x/driver: must be given\n/axes/x/microsteps: is 3");
  ASSERT_EQ(error.issues().size(), 2U);
  EXPECT_EQ(error.issues()[1].key, "/axes/x/microsteps");
}

}  // namespace
}  // namespace stepdriver
