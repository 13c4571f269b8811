// Tests what happens to a running node if its ROS master ends, hangs or is restarted. The test
// and the node use a master of the test's own, and not rostest's.
#include <diagnostic_msgs/DiagnosticArray.h>
#include <gtest/gtest.h>
#include <netinet/in.h>
#include <ros/init.h>
#include <ros/master.h>
#include <ros/node_handle.h>
#include <ros/param.h>
#include <ros/spinner.h>
#include <ros/this_node.h>
#include <sensor_msgs/JointState.h>
#include <sensor_msgs/Joy.h>
#include <std_msgs/Float64.h>
#include <std_srvs/Trigger.h>
#include <stepdriver/Jog.h>
#include <sys/socket.h>
#include <unistd.h>

#include <csignal>
#include <cstdlib>
#include <memory>
#include <set>
#include <string>
#include <vector>

#include "support/call_service.h"
#include "support/node_process.h"
#include "support/node_under_test.h"
#include "support/recorder.h"
#include "support/says.h"
#include "support/tmux.h"
#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

using diagnostic_msgs::DiagnosticArray;
using diagnostic_msgs::DiagnosticStatus;
using std_srvs::Trigger;

int freePort() {
  sockaddr_in address{};
  address.sin_family = AF_INET;
  address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
  socklen_t size = sizeof(address);
  const int listening = socket(AF_INET, SOCK_STREAM | SOCK_CLOEXEC, 0);
  EXPECT_EQ(bind(listening, reinterpret_cast<sockaddr*>(&address), size), 0);
  EXPECT_EQ(getsockname(listening, reinterpret_cast<sockaddr*>(&address), &size), 0);
  close(listening);
  return ntohs(address.sin_port);
}

/// A master without parameters and nodes, always at the same address.
class Master {
 public:
  explicit Master(int port) : port_(std::to_string(port)) {}

  void start() {
    process_ = std::make_unique<NodeProcess>(
        std::vector<std::string>{"rosmaster", "--core", "-p", port_}, "/usr/bin/env");
  }
  bool answers() const {
    return waitUntil([] { return ros::master::check(); });
  }
  void kill() {
    process_->signal(SIGKILL);
    process_->waitForExit(kBound);
  }
  void signal(int number) const { process_->signal(number); }

 private:
  const std::string port_;
  std::unique_ptr<NodeProcess> process_;
};

Master* master = nullptr;

/// Calls the master's API. The test fails if it refuses.
XmlRpc::XmlRpcValue askMaster(const std::string& method,
                              const std::vector<std::string>& arguments) {
  XmlRpc::XmlRpcValue request;
  for (const std::string& argument : arguments)
    request[request.valid() ? request.size() : 0] = argument;
  XmlRpc::XmlRpcValue response;
  XmlRpc::XmlRpcValue value;
  EXPECT_TRUE(ros::master::execute(method, request, response, value, false)) << method;
  return value;
}

/// "published NAME", "subscribed NAME" and "service NAME" for all that the master knows of a node.
std::set<std::string> registered(const std::string& node) {
  std::set<std::string> all;
  XmlRpc::XmlRpcValue state = askMaster("getSystemState", {ros::this_node::getName()});
  const char* const kinds[] = {"published ", "subscribed ", "service "};
  for (int kind = 0; kind < 3; ++kind) {
    for (int i = 0; i < state[kind].size(); ++i) {
      XmlRpc::XmlRpcValue& nodes = state[kind][i][1];
      for (int j = 0; j < nodes.size(); ++j) {
        if (static_cast<std::string>(nodes[j]) != node) continue;
        all.insert(kinds[kind] + static_cast<std::string>(state[kind][i][0]));
      }
    }
  }
  return all;
}

class MasterTest : public testing::Test {
 protected:
  MasterTest() {
    node.set("simulation/speed", 1.0);
    node.set("axes/x/max_speed_mm_s", 20.0);
  }

  void start() {
    node.start();
    // Clients that are connected before the master is lost.
    move = ros::NodeHandle().serviceClient<MoveTo>(node.full("x/move_to"), true);
    report = ros::NodeHandle().serviceClient<RigReport>(node.full("rig/report"), true);
    ASSERT_TRUE(move.isValid() && report.isValid());
    ASSERT_TRUE(waitUntil([this] { return masterStatus().level == DiagnosticStatus::OK; }));
    before = registered(node.name());
    ASSERT_GT(before.size(), 30U);
  }
  /// The node has lost the master, and is stopped while a new one starts: what comes to that one
  /// now came before the node.
  void restartBeforeTheNodeSeesIt() {
    start();
    master->kill();
    ASSERT_TRUE(isLost());
    node.process().signal(SIGSTOP);
    master->start();
    ASSERT_TRUE(master->answers());
  }
  void TearDown() override {
    // Whatever happened, the next test needs a master.
    if (ros::master::check()) return;
    master->start();
    ASSERT_TRUE(master->answers());
  }

  DiagnosticStatus masterStatus() const {
    const std::vector<DiagnosticArray> arrays = diagnostics.messages();
    for (auto array = arrays.rbegin(); array != arrays.rend(); ++array) {
      for (const DiagnosticStatus& status : array->status) {
        if (status.name == node.name().substr(1) + ": ROS master") return status;
      }
    }
    DiagnosticStatus none;
    none.level = DiagnosticStatus::STALE;
    return none;
  }
  bool isLost() const {
    return waitUntil([this] { return masterStatus().level == DiagnosticStatus::ERROR; });
  }
  bool isRegisteredAgain() const {
    return waitUntil([this] { return registered(node.name()) == before; });
  }
  MoveTo::Response moveTo(double position, bool wait) {
    MoveTo call;
    call.request.position = position;
    call.request.wait = wait;
    EXPECT_TRUE(move.call(call)) << "no answer";
    return call.response;
  }
  std::int64_t pulses() {
    RigReport call;
    EXPECT_TRUE(report.call(call)) << "no answer";
    return call.response.pulses_forward.at(0);
  }
  Trigger::Response ask(const std::string& service) const {
    Trigger call;
    EXPECT_TRUE(callService(node.full(service), call)) << service << " doesn't answer";
    return call.response;
  }

  NodeUnderTest node;
  Recorder<DiagnosticArray> diagnostics{"/diagnostics"};
  ros::ServiceClient move;
  ros::ServiceClient report;
  std::set<std::string> before;
};

TEST_F(MasterTest, ThatIsRestartedFindsEverythingOfTheNode) {
  start();
  master->kill();
  ASSERT_TRUE(isLost());
  expectSays(masterStatus().message, "doesn't answer");
  EXPECT_TRUE(moveTo(0.001, true).success) << "by a connection that was there before";
  master->start();
  ASSERT_TRUE(master->answers());
  ASSERT_TRUE(isRegisteredAgain());
  EXPECT_TRUE(ask("emergency_stop").success);
  EXPECT_TRUE(ask("recover").success);
  const Recorder<sensor_msgs::JointState> states(node.beside("joint_states"));
  EXPECT_TRUE(waitUntil([&] { return states.count() > 0; }));
  EXPECT_TRUE(waitUntil([this] { return masterStatus().level == DiagnosticStatus::OK; }));
  expectSays(node.process().output(), "was restarted");
}

TEST_F(MasterTest, ThatIsRestartedTellsOfPublishersThatCameBeforeTheNode) {
  ASSERT_NO_FATAL_FAILURE(restartBeforeTheNodeSeesIt());
  const auto publisher = ros::NodeHandle().advertise<Jog>(node.full("jog"), 1);
  node.process().signal(SIGCONT);
  ASSERT_TRUE(isRegisteredAgain());
  EXPECT_TRUE(waitUntil([&] { return publisher.getNumSubscribers() == 1; }));
}

// Its message was published before the node could receive it.
TEST_F(MasterTest, ThatIsRestartedMakesNoLatchedMessageMoveAnything) {
  ASSERT_NO_FATAL_FAILURE(restartBeforeTheNodeSeesIt());
  const auto publisher =
      ros::NodeHandle().advertise<std_msgs::Float64>(node.full("x/setpoint"), 1, true);
  std_msgs::Float64 message;
  message.data = 0.01;
  publisher.publish(message);
  node.process().signal(SIGCONT);
  ASSERT_TRUE(isRegisteredAgain());
  EXPECT_TRUE(waitUntil([&] {
    return pulses() > 0 || node.process().output().find(", which latches") != std::string::npos;
  }));
  EXPECT_EQ(pulses(), 0);
  publisher.publish(message);
  EXPECT_TRUE(waitUntil([this] { return pulses() > 0; })) << "a newer one";
}

// As after `rosnode cleanup`, if the node didn't answer it in time.
TEST_F(MasterTest, ThatForgetsTheNodeLearnsOfItAgain) {
  start();
  const std::string name = node.name();
  const auto api =
      static_cast<std::string>(askMaster("lookupNode", {ros::this_node::getName(), name}));
  for (const std::string& registration : before) {
    const std::string resource = registration.substr(registration.find(' ') + 1);
    if (registration.rfind("published ", 0) == 0) {
      askMaster("unregisterPublisher", {name, resource, api});
    } else if (registration.rfind("subscribed ", 0) == 0) {
      askMaster("unregisterSubscriber", {name, resource, api});
    }
  }
  const std::string stop = node.full("emergency_stop");
  const auto uri = static_cast<std::string>(askMaster("lookupService", {name, stop}));
  askMaster("unregisterService", {name, stop, uri});
  EXPECT_TRUE(isRegisteredAgain());
}

// As always in ROS, the name goes to the newer node: the master forgets the older one, and asks it
// to end.
TEST_F(MasterTest, ThatKnowsANewerNodeOfTheNameKeepsIt) {
  start();
  node.process().signal(SIGSTOP);
  const std::string service = node.full("service_of_the_newer_one");
  askMaster("registerService",
            {node.name(), service, "rosrpc://127.0.0.1:1", "http://127.0.0.1:1/"});
  sleepFor(1.5);  // the node asks each second, so now it does at once
  node.process().signal(SIGCONT);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  expectSays(node.process().output(), "Ending on a shutdown call");
  EXPECT_EQ(registered(node.name()), std::set<std::string>{"service " + service});
}

TEST_F(MasterTest, ThatIsLostEndsNoMotion) {
  start();
  ASSERT_TRUE(moveTo(0.1, false).success);  // 5 s
  master->kill();
  ASSERT_TRUE(isLost());
  EXPECT_TRUE(waitUntil([this] { return pulses() == 8000; })) << "0.1 m";
}

TEST_F(MasterTest, ThatIsLostEndsTheMotionsIfThatIsWanted) {
  node.set("on_master_lost", "stop");
  node.set("axes/x/max_speed_mm_s", 5.0);
  start();
  ASSERT_TRUE(moveTo(0.1, false).success);  // 20 s
  ASSERT_TRUE(waitUntil([this] { return pulses() > 10; }));
  master->kill();
  ASSERT_TRUE(isLost());
  std::int64_t last = -1;
  ASSERT_TRUE(waitUntil([&] {
    usleep(100'000);  // a tenth of a second, 40 pulses
    const std::int64_t now = pulses();
    return std::exchange(last, now) == now;
  }));
  EXPECT_LT(last, 7000);
  expectSays(node.process().output(), "on_master_lost is stop");
  EXPECT_TRUE(moveTo(0.0, true).success) << "new commands are served";
}

TEST_F(MasterTest, ThatHangsIsReportedAndHoldsUpNothing) {
  start();
  master->signal(SIGSTOP);
  EXPECT_TRUE(isLost());
  EXPECT_TRUE(moveTo(0.001, true).success);
  node.process().signal(SIGTERM);
  EXPECT_EQ(node.process().waitForExit(kBound).value_or(-1), 0);
  master->signal(SIGCONT);
}

// roslaunch ends the master that it has started, and the next launch starts another one.
TEST(Console, FindsADriverThatIsRestartedWithTheMaster) {
  if (!Tmux::possible()) GTEST_SKIP() << "this machine has no terminals: /dev/pts isn't mounted";
  const Tmux terminal(80, 24);
  {
    NodeUnderTest node;
    node.start();
    terminal.type(std::string(STEPDRIVER_PROGRAMS) + "/console --driver " + node.name());
    ASSERT_TRUE(terminal.waitFor(" live"));
  }
  ASSERT_TRUE(terminal.waitFor("NO STATE FOR"));
  master->kill();
  ASSERT_TRUE(terminal.waitFor("the ROS master doesn't answer"));
  master->start();
  ASSERT_TRUE(master->answers());
  NodeUnderTest node;
  node.start();
  ASSERT_TRUE(terminal.waitFor(" live"));
  terminal.press("+");
  EXPECT_TRUE(waitUntil([&] { return node.pulses() == 1; })) << terminal.screen();
  terminal.press(" ");
  EXPECT_TRUE(terminal.waitFor("EMERGENCY STOP: the driver has stopped every axis"));
  terminal.press("q");
}

/// A node under test with the axes left and right, which are wheels, and a node that sends commands
/// to it.
class ClientNode : public testing::Test {
 protected:
  ClientNode() {
    node.erase("axes/x");
    for (const std::string name : {"left", "right"}) {
      const std::string axis = "axes/" + name + "/";
      node.set(axis + "driver", "a4988");
      for (const std::string pin : {"step", "dir"}) node.set(axis + "pins/" + pin, name + pin);
      node.set(axis + "microsteps", 16);
      node.set(axis + "full_steps_per_round", 200);
      node.set(axis + "wheel_diameter_mm", 100.0);
      node.set(axis + "max_speed_mm_s", 500.0);
      node.set(axis + "acceleration_mm_s2", 1000.0);
      node.set(axis + "enable_on_start", true);
    }
    node.start();
  }

  /// @return a parameter of the node of that name.
  std::string parameter(const std::string& name, const std::string& key) const {
    return node.beside(name + "/" + key);
  }
  void launch(const std::string& name, const std::string& program) {
    name_ = name;
    const std::string space = node.beside("");
    client = std::make_unique<NodeProcess>(
        std::vector<std::string>{"__ns:=" + space.substr(0, space.size() - 1), "__name:=" + name},
        program);
  }
  bool says(const std::string& words) const {
    return waitUntil([&] { return client->output().find(words) != std::string::npos; });
  }
  void expectThatARestartedMasterFindsIt() {
    const std::set<std::string> before = registered(node.beside(name_));
    EXPECT_GE(before.size(), 4U);
    master->kill();
    EXPECT_TRUE(says("doesn't answer"));
    master->start();
    ASSERT_TRUE(master->answers());
    EXPECT_TRUE(waitUntil([&] { return registered(node.beside(name_)) == before; }));
    client->signal(SIGTERM);
    EXPECT_EQ(client->waitForExit(kBound).value_or(-1), 0);
    if (HasFailure()) std::fputs(client->output().c_str(), stderr);
  }

  NodeUnderTest node;
  std::unique_ptr<NodeProcess> client;

 private:
  std::string name_;
};

TEST_F(ClientNode, OfAJoystickRegistersAgainWithARestartedMaster) {
  ros::param::set(parameter("joystick", "axes/left/joystick_axis"), 0);
  ros::param::set(parameter("joystick", "axes/left/max_speed_mm_s"), 50.0);
  launch("joystick", kStepdriverJoystick);
  auto sticks = ros::NodeHandle().advertise<sensor_msgs::Joy>(node.beside("joy"), 1);
  const Recorder<Jog> jogs(node.full("jog"));
  sensor_msgs::Joy deflected;
  deflected.axes = {1.0F};
  ASSERT_TRUE(waitUntil([&] {
    sticks.publish(deflected);
    return jogs.count() > 0;
  })) << client->output();
  expectThatARestartedMasterFindsIt();
}

TEST_F(ClientNode, OfABaseRegistersAgainWithARestartedMaster) {
  ros::param::set(parameter("base", "separation_mm"), 300.0);
  for (const std::string side : {"left", "right"}) {
    ros::param::set(parameter("base", "wheels/" + side + "/side"), side);
  }
  launch("base", kStepdriverBase);
  ASSERT_TRUE(says("Ready")) << client->output();
  expectThatARestartedMasterFindsIt();
}

}  // namespace
}  // namespace stepdriver::node_test

int main(int argc, char** argv) {
  using namespace stepdriver::node_test;
  testing::InitGoogleTest(&argc, argv);
  const int port = freePort();
  setenv("ROS_MASTER_URI", ("http://127.0.0.1:" + std::to_string(port)).c_str(), 1);
  Master own(port);
  master = &own;
  own.start();
  ros::init(argc, argv, "master_test", ros::init_options::AnonymousName);
  if (!own.answers()) return 1;
  const ros::NodeHandle node;
  ros::AsyncSpinner spinner(2);
  spinner.start();
  return RUN_ALL_TESTS();
}
