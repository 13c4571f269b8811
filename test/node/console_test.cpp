#include <gtest/gtest.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/IoStates.h>
#include <stepdriver/SpeedOverride.h>

#include <csignal>
#include <cstdint>
#include <functional>
#include <string>

#include "support/node_under_test.h"
#include "support/program.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/tmux.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

const std::string kConsole = std::string(STEPDRIVER_PROGRAMS) + "/console";

/// The console of a node under test, in a terminal of 80 by 24.
class ConsoleTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Tmux::possible()) GTEST_SKIP() << "this machine has no terminals: /dev/pts isn't mounted";
  }

  ConsoleTest() {
    node.set("simulation/speed", 1.0);
    node.set("axes/x/homing/switch", "min");
    node.set("axes/x/homing/seek_speed_mm_s", 20.0);
    node.set("axes/x/homing/latch_speed_mm_s", 5.0);
    node.set("axes/x/homing/pull_off_mm", 4.0);
    node.set("axes/x/homing/offset_mm", -2.0);
    node.set("axes/x/homing/max_travel_mm", 250.0);
    node.set("axes/x/require_homing", false);
  }

  /// Starts the console as a user does, and keeps the terminal's settings before and after.
  void open() {
    terminal.type("stty -a >" + before.path() + "; sh -c 'echo $$ >" + process.path() + "; exec " +
                  kConsole + " --driver " + node.name() + "'; echo ended $?; stty -a >" +
                  after.path());
    ASSERT_TRUE(terminal.waitFor("SPACE EMERGENCY STOP"));
    ASSERT_TRUE(terminal.waitFor(" live"));
  }
  void expectTerminalGivenBack() {
    EXPECT_TRUE(terminal.waitFor("ended 0"));
    EXPECT_TRUE(terminal.waitUntilGone("SPACE EMERGENCY STOP"));
    EXPECT_TRUE(waitUntil([this] { return after.text().size() == before.text().size(); }));
    EXPECT_EQ(after.text(), before.text());
    EXPECT_FALSE(before.text().empty());
  }
  void signalConsole(int number) const { kill(std::stoi(process.text()), number); }

  /// Holds a key until a condition is true.
  bool holdUntil(const std::string& key, const std::function<bool()>& happened) const {
    return waitUntil([&] {
      terminal.press(key);
      return happened();
    });
  }

  /// Waits for a state, received from now on, in which the axis is at rest.
  static bool rests(const Recorder<AxisStates>& states) {
    const std::size_t before = states.count();
    return waitUntil([&] {
      const auto all = states.messages();
      return all.size() > before + 1 && all.back().moving.at(0) == 0;
    });
  }

  NodeUnderTest node;
  const Tmux terminal{80, 24};
  const TemporaryFile before{"_before"};
  const TemporaryFile after{"_after"};
  const TemporaryFile process{"_pid"};
};

TEST_F(ConsoleTest, ShowsAnAxisLiveAndMovesItByKeys) {
  node.set("axes/x/enable_on_start", false);
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_TRUE(terminal.waitFor("off    rest unverified"));
  terminal.press("Right");
  terminal.press("+");
  EXPECT_TRUE(terminal.waitFor("x isn't moved: it isn't enabled"));
  EXPECT_EQ(node.pulses(), 0) << "nothing moves that isn't enabled";

  terminal.press("e");
  EXPECT_TRUE(terminal.waitFor("on     rest"));
  terminal.press("+");
  EXPECT_TRUE(terminal.waitFor("0.0125 mm"));
  EXPECT_EQ(node.pulses(), 1) << "one step is one edge";
  terminal.press("-");
  EXPECT_TRUE(terminal.waitFor(" 0.0000 mm"));
  EXPECT_EQ(node.pulses(), 2);
  EXPECT_EQ(node.rig().pulses_backward.at(0), 1);

  EXPECT_TRUE(holdUntil("Right", [this] { return node.pulses() > 500; }));
  EXPECT_TRUE(rests(states)) << "without repeats it comes to rest";
  EXPECT_TRUE(holdUntil("<", [this] { return node.rig().pulses_backward.at(0) > 100; }));
  terminal.press("s");  // comes after all keys that are still on their way
  EXPECT_TRUE(terminal.waitFor("all axes stop"));
  EXPECT_TRUE(rests(states));

  terminal.press("h");
  EXPECT_TRUE(terminal.waitFor("x is homed and stands at 2.00"));
  EXPECT_TRUE(terminal.waitFor("rest homed"));
  EXPECT_TRUE(node.moveTo(0.01, true).success);
  EXPECT_TRUE(terminal.waitFor("10.00")) << "what others do is shown too";
  terminal.press("d");
  EXPECT_TRUE(terminal.waitFor("off    rest"));
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
  terminal.press("q");
  expectTerminalGivenBack();
}

TEST_F(ConsoleTest, SwitchesTheOutputThatIsChosen) {
  node.set("outputs/lamp/pin", "lamp");
  node.set("outputs/pump/pin", "pump");
  node.start();
  const Recorder<IoStates> states(node.full("io_states"));
  const auto are = [&states](bool lamp, bool pump) {
    return states.waitForLatest([&](const IoStates& now) {
      return (now.output_on.at(0) != 0) == lamp && (now.output_on.at(1) != 0) == pump;
    });
  };
  ASSERT_TRUE(are(false, false));
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_TRUE(terminal.waitFor("> lamp: off"));
  terminal.press("t");
  EXPECT_TRUE(are(true, false));
  EXPECT_TRUE(terminal.waitFor("> lamp: on"));
  terminal.press("n");
  EXPECT_TRUE(terminal.waitFor("> pump: off"));
  terminal.press("t");
  EXPECT_TRUE(are(true, true));
  EXPECT_TRUE(terminal.waitFor("> pump: on"));
  terminal.press("t");
  EXPECT_TRUE(are(true, false)) << "the one that is chosen, off again";
  terminal.press("q");
  expectTerminalGivenBack();
}

TEST_F(ConsoleTest, GoesToPositionsInMmAndSetsZero) {
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  terminal.press("g");
  EXPECT_TRUE(terminal.waitFor("Move x to [mm]: _"));
  terminal.type("20");
  EXPECT_TRUE(terminal.waitFor("x moves to 20.0000 mm in"));
  EXPECT_TRUE(terminal.waitFor(" 20.0000 mm      0.00 mm/s"));
  EXPECT_NEAR(node.rig().carriage.at(0), 0.02, 1e-9);

  const std::int64_t pulses = node.pulses();
  terminal.type("g250");
  EXPECT_TRUE(terminal.waitFor(
      "x isn't moved: 250.0000 mm is outside its limits, 0.0000 mm to 200.0000 mm"));
  terminal.type("g1.2.3");
  EXPECT_TRUE(terminal.waitFor("\"1.2.3\" isn't a number in mm"));
  EXPECT_EQ(node.pulses(), pulses);

  terminal.press("z");
  EXPECT_TRUE(terminal.waitFor("Set the position of x to 0?"));
  terminal.press("y");
  EXPECT_TRUE(terminal.waitFor("x: this position is 0.0000 mm from now on"));
  EXPECT_TRUE(terminal.waitFor(" 0.0000 mm      0.00 mm/s"));
  for (const char* size : {"0.1 mm", "1 mm", "10 mm"}) {
    terminal.press("i");
    EXPECT_TRUE(terminal.waitFor(std::string("- + steps: ") + size));
  }
  terminal.press("+");
  EXPECT_TRUE(terminal.waitFor(" 10.0000 mm      0.00 mm/s"));
  EXPECT_NEAR(node.rig().carriage.at(0), 0.03, 1e-9);
  terminal.press("-");
  EXPECT_TRUE(terminal.waitFor(" 0.0000 mm      0.00 mm/s"));
  terminal.press("-");
  EXPECT_TRUE(terminal.waitFor("x: step REFUSED: x: the position -10.0000 mm is below the soft"));
}

TEST_F(ConsoleTest, HoldsResumesAndSlowsDown) {
  node.start();
  const Recorder<AxisStates> states(node.full("axis_states"));
  ASSERT_NO_FATAL_FAILURE(open());
  for (const char* factor : {"90 %", "80 %", "70 %"}) {
    terminal.press("[");
    EXPECT_TRUE(terminal.waitFor(std::string("speed override: ") + factor));
  }
  SpeedOverride::Request other;
  other.factor = 0.3;
  EXPECT_TRUE(node.call<SpeedOverride>("speed_override", other).success);
  EXPECT_TRUE(terminal.waitFor("speed override: 30 %")) << "it was set by another client";
  other.factor = 0.7;
  EXPECT_TRUE(node.call<SpeedOverride>("speed_override", other).success);
  EXPECT_TRUE(terminal.waitFor("speed override: 70 %"));
  terminal.press("]");
  EXPECT_TRUE(terminal.waitFor("all axes move at 80 % of the commanded speed"));
  ASSERT_TRUE(node.moveTo(0.19, false, 0.05).success);
  EXPECT_TRUE(terminal.waitFor(" 40.00 mm/s"));
  terminal.press("p");
  EXPECT_TRUE(terminal.waitFor("HELD"));
  EXPECT_TRUE(rests(states));
  const std::int64_t pulses = node.pulses();
  EXPECT_LT(pulses, 15200);
  terminal.press("+");
  EXPECT_TRUE(terminal.waitFor("x isn't moved: it is on hold; c resumes, s stops"));
  EXPECT_EQ(node.pulses(), pulses);
  terminal.press("c");
  EXPECT_TRUE(terminal.waitFor(" 190.0000 mm"));
  EXPECT_EQ(node.pulses(), 15200);
}

TEST_F(ConsoleTest, SpaceStopsWhileAPositionIsTyped) {
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_TRUE(node.moveTo(0.19, false, 0.005).success);
  terminal.press("g");
  terminal.press("5");
  EXPECT_TRUE(terminal.waitFor("Move x to [mm]: 5_"));
  terminal.press("Space");
  EXPECT_TRUE(terminal.waitFor("*** EMERGENCY STOP: the driver has stopped every axis ***"));
  EXPECT_TRUE(terminal.waitUntilGone("Move x to"));
  EXPECT_TRUE(terminal.waitUntilGone("moving"));
  terminal.press("Enter");
  terminal.press("r");
  EXPECT_TRUE(terminal.waitUntilGone("FAULT"));
  EXPECT_LT(node.pulses(), 15200) << "nothing goes to a position that was typed before the stop";
}

TEST_F(ConsoleTest, ShowsNineAxesInNarrowWindows) {
  for (int i = 1; i <= 8; ++i) {
    const std::string axis = "axes/carriage_with_a_long_name_" + std::to_string(i) + "/";
    node.set(axis + "driver", "tb6600");
    node.set(axis + "microsteps", 8);
    node.set(axis + "pins/step", "step" + std::to_string(i));
    node.set(axis + "pins/dir", "dir" + std::to_string(i));
    node.set(axis + "steps_per_mm", 80.0);
    node.set(axis + "max_speed_mm_s", 50.0);
    node.set(axis + "acceleration_mm_s2", 500.0);
  }
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  for (const int columns : {80, 60}) {
    terminal.resize(columns, 30);
    for (const char* words : {"> x ", "  carria~ame_1", "  carria~ame_8", "SPACE EMERGENCY STOP"}) {
      EXPECT_TRUE(terminal.waitFor(words)) << words << " isn't on:\n" << terminal.screen();
    }
  }
}

TEST_F(ConsoleTest, SpaceStopsEverythingWhileACallIsUnderWay) {
  node.set("simulation/axes/x/start_mm", 190.0);
  node.set("axes/x/homing/seek_speed_mm_s", 2.0);
  node.set("axes/x/homing/latch_speed_mm_s", 1.0);
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  terminal.press("h");
  EXPECT_TRUE(terminal.waitFor("x: home: under way"));
  terminal.press("Space");
  EXPECT_TRUE(terminal.waitFor("*** EMERGENCY STOP: the driver has stopped every axis ***"));
  EXPECT_TRUE(terminal.waitFor("FAULT x: emergency stop"));
  EXPECT_TRUE(terminal.waitFor("x: home REFUSED"));
  const std::int64_t pulses = node.pulses();
  EXPECT_GT(pulses, 0);
  terminal.press("+");
  EXPECT_TRUE(terminal.waitFor("it has a fault; r recovers"));
  EXPECT_EQ(node.pulses(), pulses);
  terminal.press("r");
  EXPECT_TRUE(terminal.waitUntilGone("*** EMERGENCY STOP"));
  EXPECT_TRUE(terminal.waitUntilGone("FAULT"));
}

TEST_F(ConsoleTest, StopDeceleratesAndRefusalsAreShownInTheirWords) {
  node.erase("axes/x/homing");
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  terminal.press("h");
  EXPECT_TRUE(terminal.waitFor("x: home REFUSED: x: homing isn't configured"));
  ASSERT_TRUE(node.moveTo(0.19, false, 0.005).success);
  EXPECT_TRUE(terminal.waitFor("moving"));
  terminal.press("s");
  EXPECT_TRUE(terminal.waitFor("all axes stop"));
  EXPECT_TRUE(terminal.waitFor("rest unverified"));
  EXPECT_LT(node.pulses(), 15200);
}

TEST_F(ConsoleTest, GivesTheTerminalBackWhenItIsTerminated) {
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_TRUE(holdUntil("Right", [this] { return node.pulses() > 0; }));
  signalConsole(SIGTERM);
  expectTerminalGivenBack();
  EXPECT_EQ(node.process().waitForExit(std::chrono::seconds(0)).value_or(-1), -1);
}

TEST_F(ConsoleTest, OutlivesItsDriverAndFindsItAgain) {
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  node.process().signal(SIGKILL);
  EXPECT_TRUE(terminal.waitFor("NO STATE FOR"));
  EXPECT_TRUE(terminal.waitFor("(0.0000 mm)"));
  EXPECT_TRUE(terminal.waitFor("no state of " + node.name()));
  terminal.press("Space");
  EXPECT_TRUE(terminal.waitFor("EMERGENCY STOP FAILED: nobody answers. CUT THE POWER BY HAND"));
  node.set("axes/x/enable_on_start", false);
  node.start();
  EXPECT_TRUE(terminal.waitFor(" live"));
  EXPECT_TRUE(terminal.waitFor("off    rest"));
  terminal.press("Space");
  EXPECT_TRUE(terminal.waitFor("the driver has stopped every axis"));
  node.process().signal(SIGKILL);
  EXPECT_TRUE(terminal.waitFor("NO STATE FOR"));
  terminal.press("q");
  expectTerminalGivenBack();
}

TEST_F(ConsoleTest, FollowsTheSizeOfItsWindow) {
  node.start();
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_TRUE(terminal.waitFor("mm/s"));
  terminal.resize(40, 10);
  EXPECT_TRUE(terminal.waitFor("too narrow to show: speed"));
  EXPECT_TRUE(terminal.waitFor("SPACE EMERGENCY STOP"));
  terminal.resize(100, 30);
  EXPECT_TRUE(terminal.waitFor("mm/s"));
}

TEST_F(ConsoleTest, SaysWhatItNeedsToStart) {
  const ProgramEnd no_driver = runProgram("console", {"--driver", "nobody"});
  EXPECT_EQ(no_driver.code, 1);
  expectSays(no_driver.output, "no stepdriver_node is running as /nobody");
  node.start();
  const ProgramEnd no_terminal = runProgram("console", {"--driver", node.name()});
  EXPECT_EQ(no_terminal.code, 1);
  expectSays(no_terminal.output, "must be a terminal");
  const ProgramEnd other = runProgram("console", {"--driver", "nobody"});
  expectSays(other.output, node.name());
  expectSays(other.output, "give its name by --driver");
  terminal.type("ROS_MASTER_URI=http://127.0.0.1:1 " + kConsole + "; echo ended $?");
  EXPECT_TRUE(terminal.waitFor("there is no ROS master at http://127.0.0.1:1"));
  EXPECT_TRUE(terminal.waitFor("ended 1"));
  terminal.type("clear; TERM=dumb " + kConsole + " --driver " + node.name());
  EXPECT_TRUE(terminal.waitFor("can't show a screen: TERM is dumb"));
  EXPECT_EQ(runProgram("console", {"--hlep"}).code, 64);
  expectSays(runProgram("console", {"--slow", "101"}).output, "--slow 101: it must be a number");
}

}  // namespace
}  // namespace stepdriver::node_test
