#include <gtest/gtest.h>
#include <ros/node_handle.h>
#include <ros/param.h>
#include <ros/subscriber.h>
#include <stepdriver/AxisStates.h>
#include <stepdriver/LatchedPositions.h>
#include <stepdriver/RigReport.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <mutex>
#include <optional>
#include <random>
#include <set>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "storm/driver_calls.h"
#include "storm/oracle.h"
#include "storm/pulses.h"
#include "storm/request_log.h"
#include "storm/rig_clock_watch.h"
#include "storm/stall_watch.h"
#include "storm/storm_client.h"
#include "storm/storm_machine.h"
#include "support/node_under_test.h"
#include "support/vcd_reader.h"
#include "support/wait.h"

// Four clients call everything at once for `~seconds`, from `~seed`. Every few seconds there is a
// calm: all clients stop asking for motions, then a request ends the motions that remain, and
// nothing else explains the pulses that come after it.

namespace stepdriver::storm {
namespace {

using node_test::kBound;
using node_test::NodeUnderTest;
using node_test::sleepFor;
using node_test::waitUntil;

constexpr int kClients = 4;
constexpr double kLongestStorm = 2.5;       // [s] between two calms
constexpr double kLongestBackground = 0.8;  // [s] from the last motion that is asked for to its end
constexpr double kRecording = 2.0;          // [s] until a flight recording is written
// [MB] of the node, from the first quarter of the storm on. A node with a sanitizer needs another
// `~most_growth`.
constexpr double kMostGrowth = 8.0;
/// A motion alone may have the lowest limits and speed override.
constexpr std::chrono::seconds kLongestAlone{120};
constexpr std::size_t kMostReported = 10;

/// The last states of the axes that the node has published.
class LatestStates {
 public:
  explicit LatestStates(const std::string& topic)
      : subscriber_(ros::NodeHandle().subscribe<AxisStates>(
            topic, 100, [this](const AxisStates::ConstPtr& states) {
              const std::lock_guard<std::mutex> lock(mutex_);
              latest_ = *states;
              faults_.insert(states->fault.begin(), states->fault.end());
              ++count_;
            })) {}
  ~LatestStates() { subscriber_.shutdown(); }
  LatestStates(const LatestStates&) = delete;
  LatestStates& operator=(const LatestStates&) = delete;

  /// All that faults have said so far.
  std::set<std::string> faults() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return faults_;
  }
  AxisStates latest() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return latest_;
  }
  int count() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return count_;
  }
  /// Whether no axis moved, and no motion was held, when the states were published.
  bool atRest() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    const auto none = [](const auto& flags) {
      return std::none_of(flags.begin(), flags.end(), [](auto flag) { return flag != 0; });
    };
    return none(latest_.moving) && none(latest_.held);
  }

 private:
  mutable std::mutex mutex_;
  AxisStates latest_;
  int count_ = 0;
  std::set<std::string> faults_;
  ros::Subscriber subscriber_;
};

class Storm : public testing::Test {
 protected:
  Storm() : seed_(static_cast<std::uint64_t>(ros::param::param("~seed", 1))), random_(seed_) {}

  void SetUp() override {
    seen_.axes = setUpMachine(node_, machineOf(seed_));
    trace_ = node_.traced();
    node_.start();
    topics_.emplace(node_.name(), log_);
    states_.emplace(node_.full("axis_states"));
    latched_positions_ = ros::NodeHandle().subscribe<LatchedPositions>(
        node_.full("latched_positions"), 100,
        [this](const LatchedPositions::ConstPtr& edge) { noteLatched(*edge); });
    clock_watch_.emplace(node_.full("rig/report"));
    ender_.emplace(node_.name(), kClients, log_);
    ASSERT_TRUE(waitUntil([&] { return topics_->connected() && states_->count() > 0; }));
    for (int i = 0; i < kClients; ++i) {
      clients_.emplace_back(node_.name(), machineOf(seed_), i, seed_, *topics_, log_, weather_);
    }
    for (StormClient& client : clients_) threads_.emplace_back([&client] { client.run(); });
  }

  void TearDown() override {
    weather_ = Weather::kOver;
    if (failed_) {
      // Its flight recorder tells what it was asked and did.
      node_.process().signal(SIGUSR1);
      sleepFor(kRecording);
      // A call that a node never answers would not return.
      node_.process().signal(SIGKILL);
    }
    for (std::thread& thread : threads_) thread.join();
    latched_positions_.shutdown();
  }

  void storm();
  /// Ends all motions, and waits until every call has its answer.
  void calm();
  void endMotions();
  void stopAll();
  void repair();
  /// @param alone see RestPoint
  void noteRest(bool alone);
  void noteLatched(const LatchedPositions& edge);
  void declarePositions();
  /// One motion from rest to rest, of which the oracle knows the whole way; often a slow one.
  void moveAlone();
  void end();
  void judge();

  bool chance(double probability) { return between(0.0, 1.0) < probability; }
  double between(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  bool isAlive() { return !node_.process().waitForExit(std::chrono::seconds(0)); }
  void fail(const std::string& what) {
    failed_ = true;
    ADD_FAILURE() << what << " (seed " << seed_ << ")";
  }
  std::string unanswered() const;

  const std::uint64_t seed_;
  std::mt19937_64 random_;
  NodeUnderTest node_;
  StallWatch stall_watch_;
  std::optional<RigClockWatch> clock_watch_;
  std::string trace_;
  RequestLog log_;
  std::optional<DriverTopics> topics_;
  std::optional<LatestStates> states_;
  std::optional<DriverCalls> ender_;
  std::atomic<Weather> weather_{Weather::kCalm};
  std::deque<StormClient> clients_;
  std::deque<std::thread> threads_;
  std::mutex latched_mutex_;  // for seen_.latched
  ros::Subscriber latched_positions_;
  std::vector<double> memory_;  // [MB] of the node at each calm
  Observation seen_;
  bool failed_ = false;
};

void Storm::storm() {
  weather_ = Weather::kStorm;
  sleepFor(between(0.3, kLongestStorm));
  weather_ = Weather::kCalm;
  sleepFor(between(0.0, kLongestBackground));
}

void Storm::endMotions() {
  const double what = between(0.0, 1.0);
  if (what < 0.25) {
    ender_->trigger(Kind::kStop, kAllAxes, "stop");
  } else if (what < 0.4) {
    for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
      ender_->trigger(Kind::kStop, 1U << axis, kAxisNames[axis] + "/stop");
    }
  } else if (what < 0.65) {
    ender_->trigger(Kind::kHold, kAllAxes, "hold");
    const auto axis = static_cast<std::size_t>(between(0.0, 2.999));
    if (chance(0.5)) ender_->moveTo(axis, between(0.0, 0.06), false, false);
  } else if (what < 0.8) {
    for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
      ender_->set(Kind::kDisable, axis, kAxisNames[axis] + "/enable", false);
    }
  } else {
    ender_->trigger(Kind::kEmergencyStop, kAllAxes, "emergency_stop");
    if (chance(0.6)) ender_->trigger(Kind::kRecover, kAllAxes, "recover");
  }
}

void Storm::stopAll() {
  ender_->trigger(Kind::kStop, kAllAxes, "stop");
  const int states = states_->count();
  const bool idle = waitUntil([&] {
    return !isAlive() || std::all_of(clients_.begin(), clients_.end(),
                                     [](const StormClient& client) { return client.isIdle(); });
  });
  if (idle) return;
  fail("calls have no answer after a stop, but " + std::to_string(states_->count() - states) +
       " axis_states have come: " + unanswered());
}

void Storm::calm() {
  endMotions();
  double longest = 0.0;
  for (const AxisFacts& axis : seen_.axes) longest = std::max(longest, axis.longest_stop);
  // Longer than a stop may take, and longer than a forgotten stream of jogs that begins again.
  sleepFor(2.0 * longest + 0.5);
  if (!isAlive()) return;
  stopAll();
}

void Storm::repair() {
  ender_->trigger(Kind::kRecover, kAllAxes, "recover");
  for (std::size_t axis = 0; axis < kAxisNames.size(); ++axis) {
    if (chance(0.9)) {
      ender_->set(Kind::kWake, axis, kAxisNames[axis] + "/sleep", false);
      ender_->set(Kind::kEnable, axis, kAxisNames[axis] + "/enable", true);
    }
    if (chance(0.5)) ender_->setLimits(axis, 0.0, 0.0, 0.0);
  }
  if (chance(0.5)) ender_->speedOverride(1.0);
}

void Storm::noteRest(bool alone) {
  // A state that is under way may be from before the last motion began.
  const int known = states_->count();
  const auto rests = [&] {
    return !isAlive() || (states_->count() > known + 1 && states_->atRest());
  };
  if (!waitUntil(rests, kLongestAlone)) {
    fail("the axes don't come to rest");
    return;
  }
  // States that are received from now on are states of rest. The rest is noted with the time of its
  // first state: the rig's clock is known only to within a few milliseconds, and the next motion
  // may begin right after the last state.
  const int before = states_->count();
  const std::int64_t at_rest = steadyNow();
  if (!waitUntil([&] { return !isAlive() || states_->count() > before + 1; })) {
    fail("axis_states doesn't come any more");
    return;
  }
  const AxisStates states = states_->latest();
  RestPoint& rest = seen_.rests.emplace_back();
  rest.time = at_rest;
  rest.positions = states.position;
  for (std::size_t axis = 0; axis < states.name.size(); ++axis) {
    rest.valid.push_back(states.position_valid[axis] != 0 && states.fault[axis].empty());
  }
  rest.alone = alone;
  memory_.push_back(static_cast<double>(node_.process().kilobytes("VmRSS")) / 1024.0);
}

void Storm::noteLatched(const LatchedPositions& edge) {
  const std::int64_t now = steadyNow();
  const std::lock_guard<std::mutex> lock(latched_mutex_);
  seen_.latched.push_back({now, std::stoul(edge.goal), edge.active != 0, edge.position});
}

// A position that can't be trusted switches no output.
void Storm::declarePositions() {
  const AxisStates states = states_->latest();
  for (std::size_t axis = 0; axis < states.name.size(); ++axis) {
    if (states.position_valid[axis] == 0) ender_->setPosition(axis, states.position[axis]);
  }
}

void Storm::moveAlone() {
  const std::vector<std::size_t> axes{chance(0.5) ? std::size_t{0} : std::size_t{1}, 2};
  const double velocity = std::pow(10.0, between(-4.0, -1.7));
  if (chance(0.7)) {
    CompareOrder order;
    order.axis = axes[chance(0.7) ? 0 : 1];
    order.direction = std::uniform_int_distribution<int>(-1, 1)(random_);
    order.distance = between(0.001, 0.004);
    order.begin = between(-0.05, -0.04);
    order.end = 0.1;
    order.pulse = between(0.0005, 0.003);
    ender_->comparePulses(order);
  }
  switch (std::uniform_int_distribution<int>(0, 5)(random_)) {
    case 0:
    case 1:
      ender_->moveTo(axes[0], between(-0.04, 0.08), false, true);
      break;
    case 2:
      ender_->moveLine(axes, {between(-0.005, 0.005), between(-0.005, 0.005)}, true, 0.0, true);
      break;
    case 3:
      ender_->probe(0, between(-0.04, 0.08), false, chance(0.5), chance(0.5));
      break;
    default:
      // For two seconds or so.
      ender_->setOutput(kPathOutputIndex, false);
      ender_->followPath(axes, 0.4 * velocity, false, velocity, DriverCalls::Marks::kOnTheWay);
      break;
  }
}

void Storm::end() {
  weather_ = Weather::kOver;
  seen_.clock = clock_watch_->end();
  const auto report = node_.rig();
  for (std::size_t axis = 0; axis < report.name.size(); ++axis) {
    if (report.violations[axis] == 0) continue;
    fail(report.name[axis] + ": " + report.violation_kinds[axis]);
  }
  node_.process().signal(SIGTERM);
  const auto code = node_.process().waitForExit(kBound);
  if (code != 0) fail("the node ended with " + (code ? std::to_string(*code) : "nothing"));
}

void Storm::judge() {
  const auto trace = node_test::readVcd(trace_);
  for (const AxisFacts& axis : seen_.axes) seen_.pulses.push_back(pulsesOf(trace, axis.name));
  std::size_t switches = 0;
  for (const std::string& output : kOutputs) {
    OutputFacts& facts = seen_.outputs.emplace_back();
    facts.name = output;
    if (output == kTimedOutput) {
      facts.is_timed = true;
      facts.max_on = std::llround(kMaxOn * 1e9);
      facts.min_on = std::llround(kMinOn * 1e9);
      facts.min_off = std::llround(kMinOff * 1e9);
    }
    bool on = false;
    std::vector<Switch>& changes = seen_.switches.emplace_back();
    for (const auto& edge : trace.at("outputs/" + output).edges) {
      if (std::exchange(on, edge.level) != edge.level) changes.push_back({edge.time_ns, on});
    }
    switches += changes.size();
  }
  bool pressed = false;
  for (const auto& edge : trace.at("x/flag1").edges) {
    if (std::exchange(pressed, edge.level) != edge.level) {
      seen_.input.push_back({edge.time_ns, pressed});
    }
  }
  seen_.requests = log_.requests();
  seen_.stalls = stall_watch_.stalls();
  std::size_t pulses = 0;
  for (const auto& each : seen_.pulses) pulses += each.size();
  std::printf(
      "storm: seed %llu, %zu requests, %zu pulses, %zu switches, %zu latched edges, %zu calms, "
      "%zu stalls, %zu readings of the rig's clock, %.1f to %.1f MB\n",
      static_cast<unsigned long long>(seed_), seen_.requests.size(), pulses, switches,
      seen_.latched.size(), seen_.rests.size(), seen_.stalls.size(), seen_.clock.size(),
      *std::min_element(memory_.begin(), memory_.end()),
      *std::max_element(memory_.begin(), memory_.end()));
  for (const std::string& fault : states_->faults()) {
    if (fault.find("lost steps") != std::string::npos) fail("no step was lost: " + fault);
  }
  const auto broken = brokenPromises(seen_);
  for (std::size_t i = 0; i < std::min(broken.size(), kMostReported); ++i) fail(broken[i]);
  if (broken.size() > kMostReported) {
    fail(std::to_string(broken.size() - kMostReported) + " more of the kind");
  }
}

std::string Storm::unanswered() const {
  constexpr std::int64_t kBefore = 15'000'000'000;
  std::string text;
  std::int64_t first = steadyNow();
  const auto requests = log_.requests();
  for (const Request& request : requests) {
    if (!request.has_answer || request.answered) continue;
    first = std::min(first, request.sent);
    text += "\n    " + request.text;
  }
  const AxisStates states = states_->latest();
  for (std::size_t i = 0; i < states.name.size(); ++i) {
    text += "\n  " + states.name[i] + (states.moving[i] != 0 ? " moves" : " is at rest") + " at " +
            std::to_string(states.position[i]) + " m, " + std::to_string(states.velocity[i]) +
            " m/s, target " + std::to_string(states.target[i]) +
            (states.held[i] != 0 ? ", held" : "") + (states.enabled[i] != 0 ? "" : ", disabled") +
            ", fault: " + states.fault[i];
  }
  return text + "\n  requests:" + requestsText(requests, first - kBefore, steadyNow(), first);
}

TEST_F(Storm, KeepsThePromises) {
  const auto end_time = std::chrono::steady_clock::now() +
                        std::chrono::duration<double>(ros::param::param("~seconds", 25.0));
  while (std::chrono::steady_clock::now() < end_time && isAlive() && !failed_) {
    repair();
    storm();
    calm();
    if (isAlive() && !failed_) noteRest(false);
    if (!isAlive() || failed_ || !chance(0.5)) continue;
    repair();
    declarePositions();
    if (isAlive() && !failed_) noteRest(false);
    if (!isAlive() || failed_) continue;
    moveAlone();
    if (isAlive() && !failed_) noteRest(true);
  }
  if (!isAlive()) {
    fail("the node has ended with " + std::to_string(node_.process().waitForExit(kBound).value()) +
         " while these had no answer: " + unanswered());
  }
  if (failed_) return;
  end();
  judge();
  const std::size_t quarter = memory_.size() / 4;
  EXPECT_LT(memory_.back() - memory_.at(quarter), ros::param::param("~most_growth", kMostGrowth))
      << "[MB]";
}

}  // namespace
}  // namespace stepdriver::storm
