#include <gtest/gtest.h>

#include <csignal>
#include <string>

#include "support/node_under_test.h"
#include "support/program.h"
#include "support/rotary_axis.h"
#include "support/says.h"
#include "support/temporary_file.h"

namespace stepdriver::node_test {
namespace {

TEST(PlotMotion, DrawsWhatARunningNodeWouldDoAndMovesNothing) {
  NodeUnderTest node;
  node.start();
  const TemporaryFile picture(".svg");
  const auto end = runProgram("plot_motion", {"plan", "--node", node.name(), "--axis", "x", "--to",
                                              "0.1", "-o", picture.path()});
  EXPECT_EQ(end.code, 0);
  expectSays(end.output, "x: from 0 to 100 mm in 1.2 s");
  expectSays(end.output, picture.path());
  for (const char* words :
       {"velocity [mm/s]", "step period [us]", "position [mm]", "no jerk to show"}) {
    expectSays(picture.text(), words);
  }
  EXPECT_EQ(node.pulses(), 0);
}

TEST(PlotMotion, TakesDegreesForARotaryAxis) {
  NodeUnderTest node;
  makeRotary(node);
  node.start();
  const TemporaryFile picture(".svg");
  for (const char* how : {"--by", "--to"}) {
    const auto end = runProgram("plot_motion", {"plan", "--node", node.name(), "--axis", "x", how,
                                                "90", "--velocity", "45", "-o", picture.path()});
    EXPECT_EQ(end.code, 0) << end.output;
    expectSays(end.output, "x: from 0 to 90 deg in 2.");
  }
}

TEST(PlotMotion, SaysWhyItDrawsNothing) {
  NodeUnderTest node;
  node.start();
  const TemporaryFile picture(".svg");
  const auto expect_fails = [&](const std::string& axis, const std::string& to, int code,
                                const std::string& words) {
    const auto end = runProgram("plot_motion", {"plan", "--node", node.name(), "--axis", axis,
                                                "--to", to, "-o", picture.path()});
    EXPECT_EQ(end.code, code);
    expectSays(end.output, words);
    EXPECT_FALSE(picture.exists());
  };
  expect_fails("x", "0.3", 1, "above the soft limit");
  expect_fails("x", "0", 1, "x is already at 0 mm, so nothing would move");
  expect_fails("z", "0.1", 1, "has no axis z: its axes are x");
  const auto none = runProgram("plot_motion", {"plan", "--node", "/nobody", "--axis", "x", "--to",
                                               "0.1", "-o", picture.path()});
  EXPECT_EQ(none.code, 1);
  expectSays(none.output, "the parameter /nobody/axes has no axis; it must have x");
  expect_fails("x", "nan", 64, "must be a finite number");
}

TEST(PlotMotion, DrawsThePulsesOfATrace) {
  NodeUnderTest node;
  const std::string trace = node.traced();
  node.start();
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound), 0);
  const TemporaryFile picture(".png");
  const auto end =
      runProgram("plot_motion", {"trace", trace, "--steps-per-mm", "80", "-o", picture.path()});
  EXPECT_EQ(end.code, 0) << end.output;
  EXPECT_EQ(picture.text().substr(1, 3), "PNG");
  expectSays(end.output, "x: 800 pulses in ");
  expectSays(end.output, "from 0 to 10 mm (least 0, greatest 10 mm)");
  EXPECT_EQ(runProgram("plot_motion", {"trace", trace, "--axis", "y"}).code, 1);
  EXPECT_EQ(runProgram("plot_motion", {"trace", trace, "--from", "9999"}).code, 1);
}

TEST(PlotMotion, HasHelpAndRefusesWhatItDoesNotKnow) {
  const auto help = runProgram("plot_motion", {"--help"});
  EXPECT_EQ(help.code, 0);
  expectSays(help.output, "plot_motion plan --axis x --to 0.15");
  EXPECT_EQ(runProgram("plot_motion", {}).code, 64);
  EXPECT_EQ(runProgram("plot_motion", {"bag", "none.bag", "-o", "x.gif"}).code, 64);
}

}  // namespace
}  // namespace stepdriver::node_test
