#pragma once

#include <gtest/gtest.h>

#include <cstdlib>
#include <string>

namespace stepdriver::node_test {

/// Skips the test if there is no gpio-sim.
class NeedsGpioSim : public testing::Test {
 protected:
  void SetUp() override {
    const char* const wanted = std::getenv("STEPDRIVER_GPIO_SIM");
    if (wanted != nullptr && std::string(wanted) == "1") return;
    GTEST_SKIP() << "runs in the test kernel (scripts/test.sh --kernel --ros)";
  }
};

}  // namespace stepdriver::node_test
