#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/service.h>
#include <roscpp/SetLoggerLevel.h>
#include <stepdriver/Jog.h>

#include <chrono>
#include <csignal>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "support/node_under_test.h"
#include "support/wait.h"

// The node logs events, and nothing periodic.

namespace stepdriver::node_test {
namespace {

class LogTest : public testing::Test {
 protected:
  void start() {
    node.set("simulation/speed", 1.0);
    node.start();
    jogs = ros::NodeHandle().advertise<Jog>(node.full("jog"), 10);
    ASSERT_TRUE(waitUntil([&] { return jogs.getNumSubscribers() > 0; }));
    const std::string ready =
        "Ready: 1 axis on the simulated rig (virtual clock, no real-time priority needed)";
    ASSERT_TRUE(waitUntil([&] { return count(ready) > 0; })) << node.process().output();
  }

  std::vector<std::string> lines() {
    std::istringstream output(node.process().output());
    std::vector<std::string> lines;
    for (std::string line; std::getline(output, line);) lines.push_back(line);
    return lines;
  }
  /// The number of lines with these words.
  int count(const std::string& words) {
    int found = 0;
    for (const std::string& line : lines()) found += line.find(words) != std::string::npos ? 1 : 0;
    return found;
  }

  /// Jogs 50 times a second, for at least 3 s.
  void jogFor3s(double velocity) {
    Jog jog;
    jog.name = {"x"};
    jog.velocity = {velocity};
    for (int i = 0; i < 150; ++i) {
      jogs.publish(jog);
      std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
  }

  /// Ends the node, which logs that in one line.
  void end() {
    node.process().signal(SIGTERM);
    EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
    EXPECT_EQ(count("Ending on SIGTERM"), 1) << node.process().output();
  }

  NodeUnderTest node;
  ros::Publisher jogs;
};

TEST_F(LogTest, HasNotALineOfAnIdleNode) {
  start();
  const std::size_t before = lines().size();
  std::this_thread::sleep_for(std::chrono::seconds(3));
  end();
  EXPECT_EQ(lines().size(), before + 1) << node.process().output();
}

TEST_F(LogTest, HasNotALineOfAJog) {
  node.set("jog_timeout", 30.0);
  start();
  const std::size_t before = lines().size();
  jogFor3s(0.005);
  EXPECT_GT(node.pulses(), 0);
  end();
  EXPECT_EQ(lines().size(), before + 1) << node.process().output();
}

TEST_F(LogTest, HasWhatIsRefusedOnceASecondByTheNameOfTheAxis) {
  start();
  const std::size_t before = lines().size();
  const auto begin = std::chrono::steady_clock::now();
  jogFor3s(5.0);
  end();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const int said = count("x: the velocity 5 m/s is above the maximum");
  EXPECT_GE(said, 2) << node.process().output();
  EXPECT_LE(said, static_cast<int>(took.count()) + 1);
  EXPECT_EQ(lines().size(), before + static_cast<std::size_t>(said) + 1);
}

TEST_F(LogTest, HasARefusedServiceOnceASecondByItsReason) {
  start();
  const std::size_t before = lines().size();
  const auto begin = std::chrono::steady_clock::now();
  for (int i = 0; i < 50; ++i) EXPECT_FALSE(node.moveTo(5.0 + 0.01 * i, true).success);
  EXPECT_FALSE(node.moveTo(0.01, true, 5.0).success);
  end();
  const std::chrono::duration<double> took = std::chrono::steady_clock::now() - begin;
  const int said = count("Refused: x: the position 5");
  EXPECT_GE(said, 1) << node.process().output();
  EXPECT_LE(said, static_cast<int>(took.count()) + 1);
  EXPECT_EQ(count("Refused: x: the velocity 5 m/s is above the maximum"), 1)
      << node.process().output();
  EXPECT_EQ(lines().size(), before + static_cast<std::size_t>(said) + 2);
}

TEST_F(LogTest, IsSilentWhereALoggerIsSetSoByName) {
  start();
  roscpp::SetLoggerLevel silence;
  silence.request.logger = "ros.stepdriver.jog";
  silence.request.level = "error";
  ASSERT_TRUE(ros::service::call(node.full("set_logger_level"), silence));
  const std::size_t before = lines().size();
  jogFor3s(5.0);
  end();
  EXPECT_EQ(lines().size(), before + 1) << node.process().output();
}

}  // namespace
}  // namespace stepdriver::node_test
