#include <gtest/gtest.h>
#include <ros/service.h>
#include <std_srvs/Trigger.h>
#include <sys/ptrace.h>
#include <sys/types.h>
#include <sys/wait.h>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

#include "support/ask_node.h"
#include "support/call_service.h"
#include "support/node_process.h"
#include "support/node_under_test.h"
#include "support/says.h"
#include "support/tcpros_client.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

const std::vector<std::string> kStops{"stop", "hold", "x/stop", "emergency_stop"};

/// The output of rosservice.
std::string rosservice(const std::vector<std::string>& arguments) {
  std::vector<std::string> all{"rosservice"};
  all.insert(all.end(), arguments.begin(), arguments.end());
  NodeProcess process(all, "/usr/bin/env");
  EXPECT_EQ(process.waitForExit(5 * kBound).value_or(-1), 0) << arguments.front();
  return process.output();
}

TEST(StopServices, ComeInApartFromAllOtherMessages) {
  NodeUnderTest node;
  node.start();
  const std::string others = serviceUri(node.full("x/move_to"));
  const std::string stops = serviceUri(node.full("stop"));
  const std::string emergency = serviceUri(node.full("emergency_stop"));
  EXPECT_NE(stops, others);
  EXPECT_NE(emergency, others);
  EXPECT_NE(emergency, stops);
  EXPECT_EQ(serviceUri(node.full("hold")), stops);
  EXPECT_EQ(serviceUri(node.full("x/stop")), stops);
}

/// Stops the threads of a process that have the process's own name: main's and roscpp's, which
/// don't set a name.
class NamelessThreadsStopped {
 public:
  explicit NamelessThreadsStopped(pid_t process) {
    const std::filesystem::path tasks = "/proc/" + std::to_string(process) + "/task";
    const std::string name = nameOf(tasks / std::to_string(process));
    for (const auto& task : std::filesystem::directory_iterator(tasks)) {
      if (nameOf(task.path()) != name) continue;
      const pid_t thread = std::stoi(task.path().filename().string());
      if (ptrace(PTRACE_SEIZE, thread, nullptr, nullptr) != 0) continue;
      threads_.push_back(thread);
      ptrace(PTRACE_INTERRUPT, thread, nullptr, nullptr);
      waitpid(thread, nullptr, __WALL);
    }
  }
  ~NamelessThreadsStopped() {
    for (const pid_t thread : threads_) ptrace(PTRACE_DETACH, thread, nullptr, nullptr);
  }
  NamelessThreadsStopped(const NamelessThreadsStopped&) = delete;
  NamelessThreadsStopped& operator=(const NamelessThreadsStopped&) = delete;

  std::size_t count() const { return threads_.size(); }

 private:
  static std::string nameOf(const std::filesystem::path& task) {
    std::ifstream file(task / "comm");
    std::string name;
    std::getline(file, name);
    return name;
  }

  std::vector<pid_t> threads_;
};

TEST(StopServices, AreAnsweredWhileRoscppIsBusy) {
  NodeUnderTest node;
  node.start();
  const auto process = static_cast<int>(askNode(node.name(), "getPid"));
  std::vector<std::unique_ptr<TcprosClient>> clients;
  for (const std::string& service : kStops) {
    clients.push_back(std::make_unique<TcprosClient>(node.full(service)));
    ASSERT_TRUE(clients.back()->introduce(node.full(service), true));
  }
  const NamelessThreadsStopped stopped(process);
  // main's thread, and those that read the connections and answer the calls of other nodes.
  if (stopped.count() < 3) GTEST_SKIP() << "no thread of another process can be stopped here";
  for (std::size_t i = 0; i < kStops.size(); ++i) {
    ASSERT_TRUE(clients[i]->call()) << kStops[i] << " over a kept connection";
    const TcprosClient newcomer(node.full(kStops[i]));
    ASSERT_TRUE(newcomer.introduce(node.full(kStops[i]), false)) << kStops[i];
    ASSERT_TRUE(newcomer.call()) << kStops[i] << " over a new connection";
  }
}

TEST(StopServices, ServeClientsOfRoscpp) {
  NodeUnderTest node;
  node.start();
  for (const std::string& service : kStops) {
    ros::NodeHandle handle;
    auto kept = handle.serviceClient<std_srvs::Trigger>(node.full(service), true);
    std_srvs::Trigger call;
    for (int i = 0; i < 10; ++i) {
      ASSERT_TRUE(kept.call(call)) << service << ", call " << i;
      EXPECT_TRUE(call.response.success) << call.response.message;
    }
    EXPECT_TRUE(kept.isValid()) << service;
    // The server lets the client close the connection, so roscpp never misses an answer.
    for (int i = 0; i < 10; ++i) {
      ASSERT_TRUE(ros::service::call(node.full(service), call)) << service << ", call " << i;
      EXPECT_TRUE(call.response.success) << call.response.message;
    }
  }
}

TEST(StopServices, ServeClientsOfRospy) {
  NodeUnderTest node;
  node.start();
  for (const std::string& service : kStops) {
    expectSays(rosservice({"call", node.full(service)}), "success: True");
  }
  const std::string info = rosservice({"info", node.full("stop")});
  expectSays(info, "Node: " + node.name());
  expectSays(info, "URI: " + serviceUri(node.full("stop")));
  expectSays(info, "Type: std_srvs/Trigger");
  expectSays(rosservice({"type", node.full("emergency_stop")}), "std_srvs/Trigger");
  const std::string list = rosservice({"list"});
  for (const std::string& service : kStops) expectSays(list, node.full(service));
}

TEST(StopServices, RefuseAClientOfAnotherType) {
  NodeUnderTest node;
  node.start();
  MoveTo call;
  EXPECT_FALSE(callService(node.full("stop"), call));
  expectSays(rosservice({"call", node.full("stop")}), "success: True");
}

TEST(StopServices, EndWithTheNode) {
  NodeUnderTest node;
  node.start();
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  const std::string list = rosservice({"list"});
  for (const std::string& service : kStops) {
    EXPECT_EQ(list.find(node.full(service)), std::string::npos) << service << " is still known";
  }
}

}  // namespace
}  // namespace stepdriver::node_test
