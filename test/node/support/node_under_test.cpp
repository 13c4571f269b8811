#include "support/node_under_test.h"

#include <csignal>

#include "support/wait.h"

namespace stepdriver::node_test {
namespace {

std::string testName() {
  const auto* test = testing::UnitTest::GetInstance()->current_test_info();
  std::string name = std::string(test->test_suite_name()) + "_" + test->name();
  for (char& c : name) {
    if (c == '/') c = '_';
  }
  return name;
}

}  // namespace

NodeUnderTest::NodeUnderTest() : space_("/" + testName()), name_(space_ + "/stepdriver") {
  set("gpio/backend", "simulated");
  set("simulation/speed", 20.0);
  set("axes/x/driver", "a4988");
  set("axes/x/joint", "x_joint");
  for (const char* pin : {"step", "dir", "enable", "ms1", "ms2", "ms3", "sleep", "reset"}) {
    set(std::string("axes/x/pins/") + pin, std::string("x_") + pin);
  }
  set("axes/x/microsteps", 16);
  set("axes/x/steps_per_mm", 80.0);
  set("axes/x/steps_per_round", 3200);
  set("axes/x/max_speed_mm_s", 100.0);
  set("axes/x/acceleration_mm_s2", 500.0);
  set("axes/x/min_position_mm", 0.0);
  set("axes/x/max_position_mm", 200.0);
  for (const char* end : {"min", "max"}) {
    set(std::string("axes/x/endstops/") + end + "/pin", std::string("x_endstop_") + end);
    set(std::string("axes/x/endstops/") + end + "/active_level", "high");
  }
  set("axes/x/enable_on_start", true);
}

NodeUnderTest::~NodeUnderTest() {
  if (process_) {
    process_->signal(SIGTERM);
    process_->waitForExit(kBound);
    if (testing::Test::HasFailure()) std::fputs(process_->output().c_str(), stderr);
  }
  ros::param::del(space_);
}

void NodeUnderTest::erase(const std::string& key) { ros::param::del(full(key)); }

std::string NodeUnderTest::traced() {
  trace_ = std::make_unique<TemporaryFile>(".vcd");
  set("simulation/trace", trace_->path());
  return trace_->path();
}

NodeProcess& NodeUnderTest::launch() {
  process_ = std::make_unique<NodeProcess>(
      std::vector<std::string>{"__ns:=" + space_, "__name:=stepdriver"});
  return *process_;
}

NodeProcess& NodeUnderTest::start() {
  launch();
  const bool ready = waitUntil([this] {
    return process_->output().find("Ready") != std::string::npos ||
           process_->waitForExit(std::chrono::seconds(0));
  });
  EXPECT_TRUE(ready && !process_->waitForExit(std::chrono::seconds(0))) << "the node isn't up";
  return *process_;
}

MoveTo::Response NodeUnderTest::moveTo(double position, bool wait, double velocity) {
  MoveTo::Request request;
  request.position = position;
  request.velocity = velocity;
  request.wait = wait;
  return call<MoveTo>("x/move_to", request);
}

std::int64_t NodeUnderTest::pulses() {
  const RigReport::Response report = rig();
  std::int64_t sum = 0;
  for (const std::int64_t forward : report.pulses_forward) sum += forward;
  for (const std::int64_t backward : report.pulses_backward) sum += backward;
  return sum;
}

}  // namespace stepdriver::node_test
