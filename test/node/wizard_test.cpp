#include <gtest/gtest.h>
#include <std_srvs/SetBool.h>
#include <stepdriver/Endstops.h>

#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "support/node_under_test.h"
#include "support/program.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/tmux.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

const std::string kWizard = std::string(STEPDRIVER_PROGRAMS) + "/console";

/// `console --wizard` with a machine that differs from its configuration: its direction is
/// inverted, it has 100 steps/mm, its switches are swapped, and the one at the max end has the
/// wrong polarity.
class WizardTest : public testing::Test {
 protected:
  void SetUp() override {
    if (!Tmux::possible()) GTEST_SKIP() << "this machine has no terminals: /dev/pts isn't mounted";
  }

  WizardTest() {
    node.set("simulation/speed", 1.0);
    node.set("simulation/axes/x/start_mm", 100.0);
    node.set("simulation/axes/x/wiring/dir_inverted", true);
    node.set("simulation/axes/x/wiring/steps_per_mm", 100.0);
    node.set("simulation/axes/x/wiring/min_pin", "x_endstop_max");
    node.set("simulation/axes/x/wiring/max_pin", "x_endstop_min");
    node.set("simulation/axes/x/wiring/max_active_level", "low");
    node.set("axes/x/max_speed_mm_s", 50.0);
    node.set("axes/x/enable_on_start", false);
    node.erase("axes/x/min_position_mm");
    node.erase("axes/x/max_position_mm");
    node.set("simulation/axes/x/min_switch_mm", -2.0);
    node.set("simulation/axes/x/max_switch_mm", 202.0);
  }

  void open(const std::string& more = {}) {
    node.start();
    terminal.type(kWizard + " --wizard --driver " + node.name() + " --output " + file.path() +
                  more + "; echo ended $?");
    ASSERT_TRUE(terminal.waitFor("switch at the minus end"));
  }
  void press(const std::string& end, bool pressed) {
    std_srvs::SetBool::Request request;
    request.data = pressed;
    const auto answer = node.call<std_srvs::SetBool>("rig/x/press_" + end, request);
    EXPECT_TRUE(answer.success) << answer.message;
  }
  void skipSwitches() {
    terminal.press("Enter");
    ASSERT_TRUE(terminal.waitFor("No switch has changed at the minus end"));
    terminal.press("Enter");
    ASSERT_TRUE(terminal.waitFor("is disabled. Enable it?"));
  }
  void answer(const std::string& question, const std::string& line) {
    ASSERT_TRUE(terminal.waitFor(question));
    terminal.type(line);
  }
  double carriage() { return node.rig().carriage.at(0); }

  /// Answers that the small move was wrong. The next one is 90 mm, and is under way afterwards.
  void beginALongMove() {
    ASSERT_NO_FATAL_FAILURE(skipSwitches());
    terminal.type("y");
    ASSERT_NO_FATAL_FAILURE(answer("About which position is it?", ""));
    ASSERT_NO_FATAL_FAILURE(answer("2 mm towards plus", "n"));
    ASSERT_NO_FATAL_FAILURE(answer("Try again?", "n"));
    EXPECT_EQ(node.pulses(), 0);
    ASSERT_NO_FATAL_FAILURE(answer("How far should x move", "90"));
    ASSERT_NO_FATAL_FAILURE(answer("Is there room", "y"));
    ASSERT_TRUE(terminal.waitFor("take up the play"));
    terminal.type("y");
    ASSERT_NO_FATAL_FAILURE(answer("Mark where x stands", ""));
    ASSERT_NO_FATAL_FAILURE(answer("will move 90 mm", "y"));
    ASSERT_TRUE(waitUntil([this] { return node.pulses() > 200; }));
  }

  NodeUnderTest node;
  const Tmux terminal{100, 60};
  const TemporaryFile file{".yaml"};
};

TEST_F(WizardTest, WritesAConfigurationThatIsRightForTheMachine) {
  ASSERT_NO_FATAL_FAILURE(open());
  press("min", true);
  ASSERT_TRUE(terminal.waitFor("max has changed; release it"));
  press("min", false);
  ASSERT_TRUE(terminal.waitFor("switch at the plus end by hand"));
  press("max", true);
  ASSERT_TRUE(terminal.waitFor("min has changed; release it"));
  press("max", false);
  ASSERT_TRUE(terminal.waitFor("It is inverted"));
  EXPECT_EQ(node.pulses(), 0) << "nothing moves while the switches are looked at";

  ASSERT_NO_FATAL_FAILURE(answer("is disabled. Enable it?", "y"));
  ASSERT_NO_FATAL_FAILURE(answer("About which position is it?", "50"));
  // min reads active: the driver wouldn't move towards it, and the wizard doesn't ask it to.
  ASSERT_NO_FATAL_FAILURE(answer("2 mm towards plus", "y"));
  ASSERT_NO_FATAL_FAILURE(answer("Which way did x move?", "-"));
  ASSERT_NO_FATAL_FAILURE(answer("Invert its direction?", ""));
  EXPECT_NEAR(carriage(), 0.1 - 0.0016, 1e-9);
  ASSERT_NO_FATAL_FAILURE(answer("How far should x move", ""));
  ASSERT_TRUE(terminal.waitFor("x can't move 22 mm towards minus: the min switch ahead of it"));
  ASSERT_NO_FATAL_FAILURE(answer("towards your minus end:", ""));
  ASSERT_TRUE(terminal.waitFor("take up the play"));
  terminal.type("y");
  ASSERT_TRUE(terminal.waitFor("Mark where x stands"));
  const double mark = carriage();
  terminal.press("Enter");
  ASSERT_NO_FATAL_FAILURE(answer("will move 20 mm", "y"));
  ASSERT_TRUE(terminal.waitFor("How far did x really move?"));
  const double measured = 1e3 * std::abs(carriage() - mark);
  EXPECT_NEAR(measured, 16.0, 1e-6);
  terminal.type(std::to_string(measured));
  ASSERT_TRUE(terminal.waitFor("80 x 20 / 16 = 100 steps per mm"));
  ASSERT_NO_FATAL_FAILURE(answer("Use the new value?", ""));
  ASSERT_NO_FATAL_FAILURE(answer("Write all parameters to", ""));
  ASSERT_TRUE(terminal.waitFor("ended 0"));

  // The driver accepts the configuration, and the machine behaves accordingly.
  node.process().signal(SIGTERM);
  ASSERT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  ros::param::del(node.name());
  ASSERT_EQ(std::system(("rosparam load " + file.path() + " " + node.name()).c_str()), 0);
  node.set("axes/x/enable_on_start", true);
  node.start();
  const double before = carriage();
  ASSERT_TRUE(node.moveTo(0.03, true).success);
  EXPECT_NEAR(carriage() - before, 0.03, 1e-9);
  const Recorder<Endstops> endstops(node.full("endstops"));
  const auto read = [&](bool min, bool max) {
    return endstops.waitForLatest([&](const Endstops& now) {
      return (now.min.at(0) != 0) == min && (now.max.at(0) != 0) == max;
    });
  };
  EXPECT_TRUE(read(false, false));
  press("min", true);
  EXPECT_TRUE(read(true, false));
  press("min", false);
  press("max", true);
  EXPECT_TRUE(read(false, true));
  EXPECT_EQ(node.rig().violations.at(0), 0) << node.rig().violation_kinds.at(0);
}

TEST_F(WizardTest, KeepsTheCommentsOfTheDriversFile) {
  const TemporaryFile own{"_own.yaml"};
  ASSERT_EQ(std::system(("rosparam dump " + own.path() + " " + node.name()).c_str()), 0);
  std::string text = own.text();
  const std::string scale = "steps_per_mm: 80.0";
  ASSERT_NE(text.find(scale), std::string::npos) << text;
  text.replace(text.find(scale), scale.size(), scale + "   # 20 teeth");
  std::ofstream(own.path()) << "# The machine in the corner.\n" << text;
  ASSERT_NO_FATAL_FAILURE(open(" --config " + own.path()));
  ASSERT_NO_FATAL_FAILURE(skipSwitches());
  terminal.type("y");
  ASSERT_NO_FATAL_FAILURE(answer("About which position is it?", "50"));
  ASSERT_NO_FATAL_FAILURE(answer("2 mm towards plus", "y"));
  ASSERT_NO_FATAL_FAILURE(answer("Which way did x move?", "+"));
  ASSERT_NO_FATAL_FAILURE(answer("How far should x move", ""));
  ASSERT_NO_FATAL_FAILURE(
      answer("Is there room for 22 mm towards your plus end: 2 mm to take up the play, "
             "then 20 mm?",
             ""));
  ASSERT_NO_FATAL_FAILURE(answer("take up the play", "y"));
  ASSERT_NO_FATAL_FAILURE(answer("Mark where x stands", ""));
  ASSERT_NO_FATAL_FAILURE(answer("will move 20 mm", "y"));
  ASSERT_NO_FATAL_FAILURE(answer("How far did x really move?", "25"));
  ASSERT_NO_FATAL_FAILURE(answer("Use the new value?", ""));
  ASSERT_NO_FATAL_FAILURE(answer("and its comments, to", ""));
  ASSERT_TRUE(terminal.waitFor("ended 0"));
  text.replace(text.find(scale), scale.size(), "steps_per_mm: 64.0");
  EXPECT_EQ(file.text(), "# The machine in the corner.\n" + text);
}

TEST_F(WizardTest, RefusesAFileThatIsNotTheRunningDriversOne) {
  const TemporaryFile own{"_own.yaml"};
  std::ofstream(own.path()) << "axes: {x: {steps_per_mm: 100.0}}\n";
  node.start();
  const ProgramEnd end =
      runProgram("console", {"--wizard", "--driver", node.name(), "--config", own.path()});
  EXPECT_EQ(end.code, 1);
  expectSays(end.output, "isn't the configuration of the running driver: axes/x/");
  expectSays(end.output, "missing in the file");
}

TEST_F(WizardTest, StopsAMoveByEnterAndEndsByControlC) {
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_NO_FATAL_FAILURE(beginALongMove());
  terminal.press("Enter");
  ASSERT_NO_FATAL_FAILURE(answer("Nothing is measured. Try again?", "y"));
  EXPECT_TRUE(terminal.waitFor("Stopped: you asked for it"));
  const std::int64_t stopped = node.pulses();
  EXPECT_LT(stopped, 7360) << "of 92 mm";
  terminal.press("C-c");
  EXPECT_TRUE(terminal.waitFor("Nothing is written: ended by SIGINT"));
  EXPECT_TRUE(terminal.waitFor("ended 2"));
  EXPECT_FALSE(file.exists());
  EXPECT_EQ(node.pulses(), stopped);
}

TEST_F(WizardTest, ASwitchThatChangesStopsAMove) {
  ASSERT_NO_FATAL_FAILURE(open());
  ASSERT_NO_FATAL_FAILURE(beginALongMove());
  // With its present configuration, the driver doesn't treat this switch as the one ahead.
  press("max", true);
  EXPECT_TRUE(terminal.waitFor("Stopped: a switch has changed"));
  EXPECT_LT(node.pulses(), 7360);
  node.process().signal(SIGKILL);
  EXPECT_TRUE(terminal.waitFor("arrives any more"));
  EXPECT_TRUE(terminal.waitFor("ended 1"));
}

TEST_F(WizardTest, WrapsItsLinesInANarrowWindow) {
  terminal.resize(60, 40);
  ASSERT_NO_FATAL_FAILURE(open());
  EXPECT_TRUE(
      terminal.waitFor("Press the switch at the minus end by hand, then release it.\n"
                       "  (Enter: there is no switch, or nothing happens)"));
}

TEST_F(WizardTest, ReplacesNoFileWithoutBeingTold) {
  std::ofstream(file.path()) << "mine\n";
  node.start();
  terminal.type(kWizard + " --wizard --driver " + node.name() + " --output " + file.path() +
                "; echo ended $?");
  EXPECT_TRUE(terminal.waitFor("exists already: --overwrite replaces it"));
  EXPECT_TRUE(terminal.waitFor("ended 1"));
  EXPECT_EQ(file.text(), "mine\n");

  // Without a terminal, with lines from a pipe.
  terminal.type("clear; printf '\\n\\nn\\n\\n' | " + kWizard + " --wizard --driver " + node.name() +
                " --overwrite --output " + file.path() + "; echo ended $?");
  EXPECT_TRUE(terminal.waitFor("ended 0"));
  EXPECT_EQ(node.pulses(), 0);
  expectSays(file.text(), "Nothing had to be changed");
  expectSays(file.text(), "steps_per_mm: 80.0");
  EXPECT_EQ(runProgram("console", {"--axis", "x"}).code, 64);
  const ProgramEnd end = runProgram(
      "console", {"--wizard", "--driver", node.name(), "--axis", "z", "--output", "/tmp/none"});
  EXPECT_EQ(end.code, 1);
  expectSays(end.output, "--axis z: there is no such axis; the driver has x");
}

}  // namespace
}  // namespace stepdriver::node_test
