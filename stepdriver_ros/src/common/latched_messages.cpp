#include "latched_messages.h"

#include <ros/console.h>

#include <algorithm>
#include <chrono>
#include <thread>

#include "stepdriver_core/error.h"

namespace stepdriver::ros_node {
namespace {

// The master has just answered when this node read its parameters.
constexpr int kAttempts = 10;
constexpr std::chrono::seconds kRetryPeriod{1};
// Publishers of a topic that are remembered: a few hundred bytes each. `rostopic pub` has another
// name each time.
constexpr std::size_t kMostPublishers = 1000;

std::string valueOf(const ros::M_string& header, const std::string& key) {
  const auto found = header.find(key);
  return found == header.end() ? std::string() : found->second;
}

bool isSame(const boost::weak_ptr<ros::M_string>& one, const LatchedMessages::Connection& other) {
  return !one.owner_before(other) && !other.owner_before(one);
}

/// Whether a node of the same name is another process.
bool isAnother(const std::optional<std::string>& before, const std::optional<std::string>& now) {
  return before && now && !now->empty() && *before != *now;
}

}  // namespace

LatchedMessages::LatchedMessages(PublisherDirectory& directory) : directory_(directory) {
  for (int attempt = 0; attempt < kAttempts; ++attempt) {
    if (attempt > 0) std::this_thread::sleep_for(kRetryPeriod);
    if (auto publishers = directory_.publishers()) {
      at_begin_ = std::move(*publishers);
      return;
    }
  }
  throw Error("the ROS master doesn't say who publishes the topics of this node");
}

void LatchedMessages::expect(const std::string& topic) {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    known_[topic];
  }
  add(topic, at_begin_);
}

bool LatchedMessages::lookAgain() {
  const std::optional<Publishers> publishers = directory_.publishers();
  if (!publishers) return false;
  std::vector<std::string> topics;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    for (const auto& [topic, known] : known_) topics.push_back(topic);
  }
  for (const std::string& topic : topics) add(topic, *publishers);
  return true;
}

void LatchedMessages::add(const std::string& topic, const Publishers& publishers) {
  const auto found = publishers.find(topic);
  if (found == publishers.end()) return;
  for (const std::string& name : found->second) {
    std::optional<std::string> address = directory_.addressOf(name);
    if (address && address->empty()) address.reset();
    const std::lock_guard<std::mutex> lock(mutex_);
    Publisher& publisher = known_[topic][name];
    publisher.address = std::move(address);
    publisher.turn = ++turn_;
  }
}

bool LatchedMessages::isOld(const std::string& topic, const Connection& connection) {
  if (!connection || valueOf(*connection, "latching") != "1") return false;
  const std::string name = valueOf(*connection, "callerid");
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    const Known& known = known_[topic];
    const auto found = known.find(name);
    if (found != known.end() && isSame(found->second.connection, connection)) return false;
  }
  // The mutex is free meanwhile: no other message waits for the master.
  const std::optional<std::string> address = directory_.addressOf(name);
  bool was_there = false;
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    Known& known = known_[topic];
    const auto [found, is_unknown] = known.try_emplace(name);
    Publisher& publisher = found->second;
    was_there = !is_unknown && !isAnother(publisher.address, address);
    if (is_unknown || (address && !address->empty())) publisher.address = address;
    publisher.connection = connection;
    publisher.turn = ++turn_;
    forgetOldest(known);
  }
  if (was_there) {
    ROS_WARN_NAMED("latched",
                   "%s: a message of %s, which latches and was there before, is ignored: it may be "
                   "old. Its next message counts",
                   topic.c_str(), name.c_str());
  }
  return was_there;
}

void LatchedMessages::forgetOldest(Known& known) {
  if (known.size() <= kMostPublishers) return;
  known.erase(std::min_element(known.begin(), known.end(), [](const auto& one, const auto& other) {
    return one.second.turn < other.second.turn;
  }));
}

}  // namespace stepdriver::ros_node
