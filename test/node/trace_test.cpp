#include <gtest/gtest.h>
#include <stepdriver/RigReport.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <string>

#include "support/node_under_test.h"
#include "support/says.h"
#include "support/temporary_file.h"
#include "support/wait.h"

// Tests the file of the simulated rig's trace.

namespace stepdriver::node_test {
namespace {

TEST(Trace, DoesNotOverwriteAFileOfTheUserUnlessItIsToldTo) {
  NodeUnderTest node;
  const TemporaryFile letter(".txt");
  std::ofstream(letter.path()) << "my letter";
  node.set("simulation/trace", letter.path());
  node.launch();
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 1) << node.process().output();
  expectSays(node.process().output(), node.full("simulation/trace") + " is wrong: the trace file " +
                                          letter.path() + " exists and isn't a trace");
  EXPECT_EQ(letter.text(), "my letter");

  node.set("simulation/trace_overwrites_any_file", true);
  node.start();
  EXPECT_TRUE(node.moveTo(0.001, true).success);
  EXPECT_EQ(node.pulses(), 80);
  EXPECT_EQ(letter.text().rfind("$version stepdriver $end", 0), 0U) << letter.text();
}

TEST(Trace, IsReplacedByTheNextOne) {
  NodeUnderTest node;
  const TemporaryFile file(".vcd");
  node.set("simulation/trace", file.path());
  for (int run = 1; run <= 2; ++run) {
    node.start();
    EXPECT_TRUE(node.moveTo(0.001, true).success);
    node.process().signal(SIGTERM);
    EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0) << node.process().output();
    EXPECT_EQ(file.text().rfind("$version stepdriver $end", 0), 0U) << file.text();
  }
}

TEST(Trace, OnAFullDiskIsSaidToBeIncompleteInAReportThatHasAllElse) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full here";
  NodeUnderTest node;
  node.set("simulation/trace", "/dev/full");
  node.set("simulation/trace_overwrites_any_file", true);
  node.start();
  const std::string why =
      "the trace file /dev/full is incomplete, because it couldn't be written: No space left on "
      "device";
  for (int move = 1; move <= 2; ++move) {
    EXPECT_TRUE(node.moveTo(0.001 * move, true).success);
    const RigReport::Response report = node.rig();
    ASSERT_EQ(report.name.size(), 1U);
    EXPECT_EQ(report.pulses_forward.at(0), 80 * move);
    EXPECT_EQ(report.trace_error, why);
  }
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0) << node.process().output();
  expectSays(node.process().output(), why);
}

TEST(Trace, ThatIsCompleteOrNotWantedHasNoError) {
  NodeUnderTest node;
  node.start();
  EXPECT_TRUE(node.moveTo(0.001, true).success);
  EXPECT_EQ(node.rig().trace_error, "");
  node.process().signal(SIGTERM);
  ASSERT_TRUE(node.process().waitForExit(kBound));
  node.traced();
  node.start();
  EXPECT_TRUE(node.moveTo(0.001, true).success);
  EXPECT_EQ(node.rig().trace_error, "");
}

}  // namespace
}  // namespace stepdriver::node_test
