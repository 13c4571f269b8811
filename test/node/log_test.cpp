#include <gtest/gtest.h>
#include <rosgraph_msgs/Log.h>
#include <stepdriver/Jog.h>

#include <chrono>
#include <csignal>
#include <string>
#include <thread>
#include <vector>

#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/wait.h"

// What the node writes to its log: what happens, and nothing at a steady rate.

namespace stepdriver::node_test {
namespace {

using rosgraph_msgs::Log;

class LogTest : public testing::Test {
 protected:
  void start() {
    log = std::make_unique<Recorder<Log>>("/rosout");
    node.set("simulation/speed", 1.0);
    node.start();
    jogs = ros::NodeHandle().advertise<Jog>(node.full("jog"), 10);
    ASSERT_TRUE(waitUntil([&] { return jogs.getNumSubscribers() > 0; }));
    ASSERT_TRUE(waitUntil([&] { return says("Ready: ") > 0; }));
  }

  std::vector<std::string> lines() const {
    std::vector<std::string> texts;
    for (const Log& line : log->messages()) {
      if (line.name == node.name()) texts.push_back(line.msg);
    }
    return texts;
  }
  /// Lines with these words.
  int says(const std::string& words) const {
    int count = 0;
    for (const std::string& text : lines()) count += text.find(words) != std::string::npos;
    return count;
  }

  /// Jogs 50 times a second for 3 s. @return how long that took [s].
  double jogFor3s(double velocity) {
    const auto begin = std::chrono::steady_clock::now();
    Jog jog;
    jog.name = {"x"};
    jog.velocity = {velocity};
    for (int i = 0; i < 150; ++i) {
      jogs.publish(jog);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
  }

  /// What it has written before it ends is here then.
  void end() {
    node.process().signal(SIGTERM);
    ASSERT_TRUE(waitUntil([&] { return says("Ending on SIGTERM") > 0; }));
  }

  NodeUnderTest node;
  std::unique_ptr<Recorder<Log>> log;
  ros::Publisher jogs;
};

TEST_F(LogTest, HasNotALineOfAnIdleNode) {
  start();
  const auto before = lines();
  std::this_thread::sleep_for(std::chrono::seconds(3));
  end();
  auto wanted = before;
  wanted.push_back("Ending on SIGTERM");
  EXPECT_EQ(lines(), wanted);
}

TEST_F(LogTest, HasNotALineOfAJogUntilThatRunsOut) {
  node.set("jog_timeout", 30.0);
  start();
  const auto before = lines();
  jogFor3s(0.02);
  EXPECT_GT(node.pulses(), 0);
  end();
  auto wanted = before;
  wanted.push_back("Ending on SIGTERM");
  EXPECT_EQ(lines(), wanted);
}

TEST_F(LogTest, HasWhatIsRefusedOnceASecondByTheNameOfTheAxis) {
  start();
  const double took = jogFor3s(5.0);
  EXPECT_TRUE(waitUntil([&] { return says("x: the velocity 5 m/s is above the maximum") > 0; }));
  EXPECT_LE(says("x: the velocity 5 m/s"), static_cast<int>(took) + 1);
  EXPECT_GE(says("x: the velocity 5 m/s"), 2);
  end();
}

}  // namespace
}  // namespace stepdriver::node_test
