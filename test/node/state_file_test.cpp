#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/SetPosition.h>
#include <sys/stat.h>
#include <unistd.h>

#include <csignal>
#include <fstream>
#include <string>

#include "support/contents_of.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/temporary_folder.h"
#include "support/wait.h"

// Tests positions that survive the node.

namespace stepdriver::node_test {
namespace {

class StateFile : public testing::Test {
 protected:
  void SetUp() override {
    node_.set("state_file", file());
    node_.set("axes/x/holds_position_unpowered", true);
  }

  std::string file() const { return folder_.path() + "/state"; }
  void end(int signal) {
    node_.process().signal(signal);
    ASSERT_TRUE(node_.process().waitForExit(kBound));
  }
  void standAt(double position) {
    SetPosition::Request here;
    here.position = 0.0;
    EXPECT_TRUE(node_.call<SetPosition>("x/set_position", here).success);
    EXPECT_TRUE(node_.moveTo(position, true).success);
  }
  // The file at the start, before anything has moved.
  AxisStates first() {
    const Recorder<AxisStates> states(node_.full("axis_states"));
    EXPECT_TRUE(states.waitFor([](const AxisStates&) { return true; }));
    return states.messages().at(0);
  }

  const test::TemporaryFolder folder_;
  NodeUnderTest node_;
};

TEST_F(StateFile, BringsThePositionBackAfterAShutdown) {
  node_.start();
  expectSays(first().position_note.at(0), "didn't exist yet");
  standAt(0.008);
  end(SIGTERM);
  node_.start();
  const AxisStates states = first();
  EXPECT_DOUBLE_EQ(states.position.at(0), 0.008);
  EXPECT_TRUE(states.position_valid.at(0));
  EXPECT_EQ(states.position_note.at(0), "");
  EXPECT_TRUE(node_.moveTo(0.010, true).success);
  EXPECT_EQ(node_.pulses(), 160);
}

TEST_F(StateFile, SaysThatThePositionOfAKilledNodeIsUnverified) {
  node_.start();
  standAt(0.008);
  end(SIGKILL);
  node_.start();
  const AxisStates after = first();
  EXPECT_FALSE(after.position_valid.at(0));
  expectSays(after.position_note.at(0), "wasn't shut down");
  end(SIGTERM);
  expectSays(node_.process().output(), "x: its position is unverified: the node that kept");
}

TEST_F(StateFile, SaysThatTheAxisOfAKilledNodeWasMovingAndFromWhere) {
  node_.set("simulation/speed", 1.0);
  node_.start();
  standAt(0.008);
  EXPECT_TRUE(node_.moveTo(0.2, false, 0.001).success);  // takes minutes
  const auto text = [this] { return test::contentsOf(file()); };
  const auto has = [&text](const char* words) { return text().find(words) != std::string::npos; };
  ASSERT_TRUE(waitUntil([&] { return has("80000 0.008") && has(" 1\n"); })) << text();
  end(SIGKILL);
  node_.start();
  const AxisStates after = first();
  EXPECT_FALSE(after.position_valid.at(0));
  EXPECT_DOUBLE_EQ(after.position.at(0), 0.008);
  expectSays(after.position_note.at(0), "wasn't shut down: the axis was moving, from 0.008 m");
}

TEST_F(StateFile, BeyondTheLimitsDoesNotStopTheStartAndIsNotBelieved) {
  std::ofstream(file()) << "stepdriver state 1\nclean\nx linear 80000 5 0 1 1 1 0\n";
  node_.start();
  const AxisStates states = first();
  EXPECT_DOUBLE_EQ(states.position.at(0), 0.0);
  EXPECT_FALSE(states.position_valid.at(0));
  EXPECT_EQ(states.position_note.at(0),
            "in the state file " + file() +
                ", the position 5 m is above the soft limit max_position 0.2 m, from the "
                "configuration");
  end(SIGTERM);
  expectSays(node_.process().output(), "x: its position is unverified: in the state file");
}

TEST_F(StateFile, ThatIsAPipeEndsTheStartAtOnce) {
  ASSERT_EQ(mkfifo(file().c_str(), 0600), 0);
  NodeProcess& process = node_.launch();
  EXPECT_EQ(process.waitForExit(kBound).value_or(-1), 1);
  expectSays(process.output(), "is a named pipe, but must be a regular file");
}

TEST_F(StateFile, ThatCannotBeWrittenIsInDiagnosticsAndHasAnExitCodeOfItsOwn) {
  using diagnostic_msgs::DiagnosticArray;
  using diagnostic_msgs::DiagnosticStatus;
  node_.start();
  const Recorder<DiagnosticArray> diagnostics("/diagnostics");
  const auto comes = [&](int level, const std::string& message) {
    return diagnostics.waitForLatest([&](const DiagnosticArray& array) {
      for (const DiagnosticStatus& status : array.status) {
        if (status.name != node_.name().substr(1) + ": state file") continue;
        return status.level == level && status.message == message;
      }
      return false;
    });
  };
  EXPECT_TRUE(comes(DiagnosticStatus::OK, "written"));
  const std::string obstacle = file() + ".new";
  ASSERT_EQ(mkdir(obstacle.c_str(), 0700), 0);
  const std::string why = "the state file " + obstacle + " can't be written: Is a directory";
  standAt(0.008);
  EXPECT_TRUE(comes(DiagnosticStatus::ERROR, why));
  ASSERT_EQ(rmdir(obstacle.c_str()), 0);
  EXPECT_TRUE(comes(DiagnosticStatus::OK, "written"));

  ASSERT_EQ(mkdir(obstacle.c_str(), 0700), 0);
  node_.process().signal(SIGTERM);
  EXPECT_EQ(node_.process().waitForExit(kBound).value_or(-1), 4);
  ASSERT_EQ(rmdir(obstacle.c_str()), 0);
  const std::string output = node_.process().output();
  expectSays(output, why + "; the next start may not know the positions, or not trust them");
  EXPECT_EQ(output.find("Not all could be disabled"), std::string::npos) << output;
}

TEST_F(StateFile, StopsTheStartWhereItCannotBe) {
  node_.set("state_file", std::string("positions"));
  NodeProcess& process = node_.launch();
  EXPECT_EQ(process.waitForExit(kBound).value_or(-1), 1);
  expectSays(process.output(),
             "state_file is \"positions\", but must be an absolute path, or empty for none");
  node_.set("state_file", folder_.path() + "/nowhere/state");
  NodeProcess& other = node_.launch();
  EXPECT_EQ(other.waitForExit(kBound).value_or(-1), 1);
  expectSays(other.output(), "can't be written: No such file or directory");
}

}  // namespace
}  // namespace stepdriver::node_test
