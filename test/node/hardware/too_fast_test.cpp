#include <gtest/gtest.h>

#include <csignal>

#include "hardware/board_and_expander.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// A node whose axis x is configured for a million steps/s, which no machine can sustain.
class TooFast : public BoardAndExpander {
 protected:
  void SetUp() override {
    BoardAndExpander::SetUp();
    if (IsSkipped()) return;
    node->set("axes/x/max_speed_mm_s", 12500.0);
    node->set("axes/x/timing/step_high_us", 0.1);
    node->set("axes/x/timing/step_low_us", 0.1);
  }

  unsigned number(unsigned offset) const { return numberOf(board->lines(), offset); }
};

TEST_F(TooFast, DoesNotStartWhereThatIsEnforcedAndLeavesEveryLineSafe) {
  node->set("realtime/policy", "enforce");
  node->launch();
  EXPECT_EQ(node->process().waitForExit(kBound).value_or(-1), 3) << node->process().output();
  expectSays(node->process().output(), "x needs 1000000 steps/s");
  const auto trace = record->read();
  EXPECT_TRUE(trace.edges(number(HardwareNode::kX.step)).empty());
  EXPECT_TRUE(timesSet(trace, number(HardwareNode::kX.enable), false).empty()) << "it was enabled";
  EXPECT_FALSE(timesSet(trace, number(HardwareNode::kX.enable), true).empty());
}

TEST_F(TooFast, SaysSoAndStartsElse) {
  node->start();
  expectSays(node->process().output(), "x needs 1000000 steps/s");
  EXPECT_TRUE(record->read().edges(number(HardwareNode::kX.step)).empty())
      << "it measured with edges";
  node->process().signal(SIGTERM);
  EXPECT_EQ(node->process().waitForExit(kBound).value_or(-1), 0) << node->process().output();
}

}  // namespace
}  // namespace stepdriver::node_test
