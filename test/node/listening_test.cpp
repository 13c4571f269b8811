// Tests who can reach the nodes: the addresses on which they listen.
#include <gtest/gtest.h>
#include <ros/master.h>
#include <ros/param.h>
#include <ros/this_node.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "support/node_under_test.h"
#include "support/roslaunch.h"
#include "support/says.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

/// Sets an environment variable for the processes that a test starts; without a value, removes it.
class Variable {
 public:
  Variable(const char* name, const char* value) : name_(name) {
    if (const char* was = std::getenv(name); was != nullptr) was_ = was;
    put(value);
  }
  ~Variable() { put(was_ ? was_->c_str() : nullptr); }
  Variable(const Variable&) = delete;
  Variable& operator=(const Variable&) = delete;

 private:
  void put(const char* value) const {
    if (value != nullptr) {
      setenv(name_, value, 1);
    } else {
      unsetenv(name_);
    }
  }

  const char* name_;
  std::optional<std::string> was_;
};

std::string outputOf(const std::string& command) {
  std::string output;
  std::FILE* const pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) throw std::runtime_error("can't run " + command);
  std::array<char, 4096> buffer{};
  while (std::fgets(buffer.data(), buffer.size(), pipe) != nullptr) output += buffer.data();
  EXPECT_EQ(pclose(pipe), 0) << command << ": " << output;
  return output;
}

/// The addresses on which a process listens, as `ss` prints them: 127.0.0.1:PORT, and
/// 0.0.0.0%lo:PORT for every address that is reached through the loopback.
std::vector<std::string> listensOn(pid_t process) {
  std::vector<std::string> addresses;
  std::istringstream lines(outputOf("ss -Htulnp"));
  for (std::string line; std::getline(lines, line);) {
    if (line.find("pid=" + std::to_string(process) + ",") == std::string::npos) continue;
    std::istringstream columns(line);
    std::string protocol, state, received, sent, address;
    columns >> protocol >> state >> received >> sent >> address;
    addresses.push_back(address);
  }
  return addresses;
}

bool isLocal(const std::string& address) {
  return address.compare(0, 10, "127.0.0.1:") == 0 || address.find("%lo:") != std::string::npos;
}

// XML-RPC, topics and services, topics by UDP; the node has two servers of its own for calls that
// stop.
constexpr std::size_t kPortsOfRoscpp = 3;
constexpr std::size_t kPortsOfNode = kPortsOfRoscpp + 2;

void expectListens(pid_t process, bool only_local, std::size_t ports) {
  std::vector<std::string> addresses = listensOn(process);
  // A process that this program starts inherits roscpp's sockets of this program.
  const std::vector<std::string> inherited = listensOn(getpid());
  addresses.erase(std::remove_if(addresses.begin(), addresses.end(),
                                 [&](const std::string& address) {
                                   return std::find(inherited.begin(), inherited.end(), address) !=
                                          inherited.end();
                                 }),
                  addresses.end());
  EXPECT_EQ(addresses.size(), ports) << testing::PrintToString(addresses);
  for (const std::string& address : addresses) EXPECT_EQ(isLocal(address), only_local) << address;
}

void waitForText(NodeProcess& process, const std::string& text) {
  ASSERT_TRUE(waitUntil([&] { return process.output().find(text) != std::string::npos; }))
      << "it doesn't print " << text << ": " << process.output();
}

bool warns(const std::string& output) { return output.find("WARN") != std::string::npos; }

// An address for documentation: no computer has it.
constexpr const char* kOtherAddress = "192.0.2.1";

TEST(Listening, NodeOnTheLoopbackIsClosedToOtherComputers) {
  const Variable address("ROS_IP", "127.0.0.1");
  const Variable name("ROS_HOSTNAME", nullptr);
  NodeUnderTest node;
  node.start();
  expectListens(node.process().pid(), true, kPortsOfNode);
  EXPECT_FALSE(warns(node.process().output())) << node.process().output();
}

TEST(Listening, NodeWithAnAddressIsOpenToOtherComputers) {
  const Variable address("ROS_IP", kOtherAddress);
  const Variable name("ROS_HOSTNAME", nullptr);
  NodeUnderTest node;
  waitForText(node.launch(), "Ready");
  expectListens(node.process().pid(), false, kPortsOfNode);
}

TEST(Listening, NodeThatNobodyMayReachSaysSo) {
  const Variable address("ROS_IP", "127.0.0.1");
  const Variable name("ROS_HOSTNAME", kOtherAddress);
  NodeUnderTest node;
  waitForText(node.launch(), "Ready");
  expectSays(node.process().output(),
             "listens on 127.0.0.1, because of ROS_IP, but tells others the "
             "address 192.0.2.1, because of ROS_HOSTNAME");
}

// rospy listens on the loopback with this name, but roscpp doesn't.
TEST(Listening, NodeThatIsOpenInSpiteOfItsNameSaysSo) {
  const Variable address("ROS_IP", nullptr);
  const Variable name("ROS_HOSTNAME", "127.0.0.1");
  NodeUnderTest node;
  waitForText(node.launch(), "Ready");
  expectListens(node.process().pid(), false, kPortsOfNode);
  expectSays(node.process().output(),
             "tells others the address 127.0.0.1, but listens on every address");
}

TEST(Listening, JoystickOnTheLoopbackIsClosedToOtherComputers) {
  const Variable address("ROS_IP", "127.0.0.1");
  const Variable name("ROS_HOSTNAME", nullptr);
  const std::string space = "/joystick_" + std::to_string(getpid());
  ros::param::set(space + "/joystick/axes/x/joystick_axis", 0);
  ros::param::set(space + "/joystick/axes/x/max_speed_mm_s", 50.0);
  NodeProcess joystick({"__ns:=" + space}, kStepdriverJoystick);
  waitForText(joystick, "Ready");
  expectListens(joystick.pid(), true, kPortsOfRoscpp);
  ros::param::del(space);
}

TEST(ListeningOfThePage, IsOnTheLoopbackUnlessTheArgumentSaysOtherwise) {
  const Variable address("ROS_IP", kOtherAddress);
  const Variable name("ROS_HOSTNAME", nullptr);
  for (const char* file : {"axis.launch panel:=true", "panel.launch"}) {
    const std::string dump =
        std::string("roslaunch --dump-params " STEPDRIVER_SOURCES "/launch/") + file;
    expectSays(outputOf(dump), "/panel/listen: 127.0.0.1");
    expectSays(outputOf(dump + " listen:=192.0.2.1"), "/panel/listen: 192.0.2.1");
  }
}

/// What `roslaunch --args` prints: the environment and the command of a node.
std::string nodeOf(const std::string& file, const std::string& node, const std::string& arguments) {
  return outputOf("roslaunch --args " + node + " " + file + " " + arguments);
}

void expectListenArgument(const std::string& file, const std::string& node) {
  SCOPED_TRACE(file + ": " + node);
  const Variable address("ROS_IP", nullptr);
  const Variable name("ROS_HOSTNAME", nullptr);
  expectSays(nodeOf(file, node, ""), "ROS_IP=\"127.0.0.1\"");
  const std::string open = nodeOf(file, node, "listen:=192.0.2.1");
  expectSays(open, "ROS_IP=\"192.0.2.1\"");
  expectSays(open, "ROS_HOSTNAME=\"192.0.2.1\"");
}

TEST(ListeningOfLaunchFiles, IsOnTheLoopbackUnlessTheArgumentSaysOtherwise) {
  int files = 0;
  for (const char* folder : {"/launch", "/launch/examples"}) {
    for (const auto& entry :
         std::filesystem::directory_iterator(std::string(STEPDRIVER_SOURCES) + folder)) {
      if (entry.path().extension() != ".launch") continue;
      const std::string name = entry.path().stem();
      const bool other = name == "joystick" || name == "base" || name == "panel";
      expectListenArgument(entry.path(), other ? "/" + name : "/stepdriver");
      ++files;
    }
  }
  EXPECT_EQ(files, 12);
  expectListenArgument(STEPDRIVER_SOURCES "/launch/examples/esp32_two_sticks.launch", "/joystick");
  expectListenArgument(STEPDRIVER_SOURCES "/launch/examples/stm32_car.launch", "/base");
}

TEST(ListeningOfLaunchFiles, IsWhatTheEnvironmentSays) {
  const std::string file = STEPDRIVER_SOURCES "/launch/axis.launch";
  {
    const Variable address("ROS_IP", "192.0.2.1");
    const Variable name("ROS_HOSTNAME", nullptr);
    expectSays(nodeOf(file, "/stepdriver", ""), "ROS_HOSTNAME=\"192.0.2.1\"");
  }
  const Variable address("ROS_IP", nullptr);
  const Variable name("ROS_HOSTNAME", "robot");
  expectSays(nodeOf(file, "/stepdriver", ""), "ROS_IP=\"robot\"");
}

/// The process that listens on the port of a URI.
pid_t processAt(const std::string& port) {
  std::istringstream lines(outputOf("ss -Htlnp"));
  for (std::string line; std::getline(lines, line);) {
    const auto pid = line.find("pid=");
    if (line.find(":" + port + " ") != std::string::npos && pid != std::string::npos) {
      return std::stoi(line.substr(pid + 4));
    }
  }
  ADD_FAILURE() << "nothing listens on port " << port;
  return -1;
}

pid_t processOf(const std::string& node) {
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = ros::this_node::getName();
  request[1] = node;
  EXPECT_TRUE(ros::master::execute("lookupNode", request, response, payload, false)) << node;
  const std::string uri = payload;
  const auto colon = uri.rfind(':');
  return processAt(uri.substr(colon + 1, uri.find('/', colon) - colon - 1));
}

TEST(ListeningOfLaunchFiles, IsThatOfTheRunningNode) {
  for (const bool open : {false, true}) {
    Roslaunch launch("axis.launch",
                     {std::string("listen:=") + (open ? kOtherAddress : "127.0.0.1")});
    ASSERT_TRUE(launch.isReady());
    expectListens(processOf(Roslaunch::space() + "/stepdriver"), !open, kPortsOfNode);
  }
}

}  // namespace
}  // namespace stepdriver::node_test
