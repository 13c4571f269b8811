#include "flooded_node.h"

#include <ros/param.h>
#include <std_srvs/SetBool.h>
#include <std_srvs/Trigger.h>
#include <sys/resource.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <stdexcept>
#include <thread>

#include "support/wait.h"

namespace stepdriver::bad_days {
namespace {

using node_test::kBound;
using node_test::NodeProcess;
using node_test::waitUntil;

constexpr double kStepsPerMetre = 80'000.0;
constexpr double kFar = 0.19;       // [m]
constexpr double kEnd = 0.012;      // [m]
constexpr double kSlowly = 0.0005;  // [m/s]
constexpr int kStoppedMoves = 3;
// Longer than the interval between two pulses of such a move, 25 ms.
constexpr std::chrono::milliseconds kSeveralPulses{100};

/// What the unit of systemd that is delivered allows the node, such as MemoryMax [bytes].
std::size_t limitOfUnit(const std::string& name) {
  std::ifstream unit(STEPDRIVER_SOURCES "/config/systemd/stepdriver.service");
  for (std::string line; std::getline(unit, line);) {
    if (line.rfind(name + "=", 0) != 0) continue;
    const std::size_t megabyte = line.back() == 'M' ? std::size_t{1} << 20 : 1;
    return megabyte * std::stoul(line.substr(name.size() + 1));
  }
  throw std::runtime_error("the unit has no " + name);
}

}  // namespace

FloodedNode::FloodedNode() : seconds_(ros::param::param("~seconds", 2.0)) {
  node_.set("simulation/speed", 1.0);
  node_.start();
  const auto most = static_cast<rlim_t>(limitOfUnit("LimitNOFILE"));
  const rlimit limit{most, most};
  EXPECT_EQ(prlimit(node_.process().pid(), RLIMIT_NOFILE, &limit, nullptr), 0);
}

void FloodedNode::SetUp() {
  states_ =
      std::make_unique<node_test::Recorder<sensor_msgs::JointState>>(node_.beside("joint_states"));
  probe_ = std::make_unique<EmergencyProbe>(node_.full("emergency_stop"));
  ASSERT_TRUE(node_.moveTo(0.01, true).success);
  ASSERT_TRUE(waitUntil([this] { return states_->count() > 0; }));
  noteBefore();
}

void FloodedNode::noteBefore() {
  descriptors_before_ = node_.process().descriptors();
  memory_before_ = node_.process().kilobytes("VmRSS");
  own_memory_before_ = node_.process().kilobytes("RssAnon");
}

void FloodedNode::TearDown() {
  ASSERT_NO_FATAL_FAILURE(expectAlive());
  most_memory_ = node_.process().kilobytes("VmHWM");
  expectDescriptorsBack();
  expectNothingMoves();
  // What the flood has sent may still be carried out, and take the place of a move.
  EXPECT_TRUE(waitUntil([this] { return recover() && node_.moveTo(kEnd, true).success; }));
  expectLittleMemory();
  expectCountsEqual();
  print();
}

void FloodedNode::endure(const std::function<std::string()>& flood) {
  probe_->run(seconds_);
  flood_ = flood();
  for (int i = 0; i < kStoppedMoves; ++i) {
    ASSERT_NO_FATAL_FAILURE(beginMove());
    endMove();
  }
}

bool FloodedNode::recover() {
  if (!node_.call<std_srvs::Trigger>("recover").success) return false;
  std_srvs::SetBool::Request on;
  on.data = 1;
  return node_.call<std_srvs::SetBool>("x/enable", on).success;
}

void FloodedNode::beginMove() {
  ASSERT_TRUE(recover());
  const std::int64_t before = node_.pulses();
  ASSERT_TRUE(node_.moveTo(kFar, false, kSlowly).success);
  ASSERT_TRUE(waitUntil([&] { return node_.pulses() > before; })) << "the axis doesn't move";
}

void FloodedNode::endMove() {
  probe_->callEach();
  expectNothingMoves();
}

void FloodedNode::expectNothingMoves() {
  const std::int64_t before = node_.pulses();
  std::this_thread::sleep_for(kSeveralPulses);
  EXPECT_EQ(node_.pulses(), before) << "pulses after the emergency stop";
}

void FloodedNode::expectAlive() {
  const auto code = node_.process().waitForExit(std::chrono::seconds(0));
  ASSERT_FALSE(code) << "the node ended with exit code " << *code;
}

void FloodedNode::expectCountsEqual() {
  const auto report = node_.rig();
  const double place =
      static_cast<double>(report.pulses_forward.at(0) - report.pulses_backward.at(0)) /
      kStepsPerMetre;
  EXPECT_EQ(report.violations.at(0), 0) << report.violation_kinds.at(0);
  const bool told = states_->waitForLatest([place](const sensor_msgs::JointState& state) {
    return std::abs(state.position.at(0) - place) < 1e-9;
  });
  EXPECT_TRUE(told) << "joint_states say " << states_->messages().back().position.at(0)
                    << ", but the pulses " << place;
}

void FloodedNode::expectDescriptorsBack() {
  const NodeProcess& process = node_.process();
  EXPECT_TRUE(waitUntil([&] { return process.descriptors() <= descriptors_before_; }))
      << process.descriptors() << " descriptors, before the flood " << descriptors_before_;
}

// Code that the node has run for the first time stays in memory, too, but the system can drop it.
std::size_t FloodedNode::growth() {
  const std::size_t own = node_.process().kilobytes("RssAnon");
  return own > own_memory_before_ ? own - own_memory_before_ : 0;
}

void FloodedNode::expectLittleMemory() {
  EXPECT_LT(most_memory_, limitOfUnit("MemoryMax") / 1024) << "kB";
}

void FloodedNode::print() {
  const double megabyte = 1024.0;
  std::printf(
      "%s\n    emergency_stop [ms: p50, p99, max]: kept connection %s; fresh connection %s; %zu of "
      "each\n    lookup at the master [ms]: %s\n    memory [MB]: before %.1f, most %.1f, then %.1f "
      "more than before\n",
      flood_.c_str(), probe_->kept().text().c_str(), probe_->fresh().text().c_str(),
      probe_->fresh().count(), probe_->lookup().text().c_str(),
      static_cast<double>(memory_before_) / megabyte, static_cast<double>(most_memory_) / megabyte,
      static_cast<double>(growth()) / megabyte);
}

}  // namespace stepdriver::bad_days
