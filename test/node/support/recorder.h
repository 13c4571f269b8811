#pragma once

#include <ros/node_handle.h>
#include <ros/subscriber.h>

#include <functional>
#include <mutex>
#include <string>
#include <vector>

#include "support/wait.h"

namespace stepdriver::node_test {

/// Keeps every message of a topic from now on.
template <typename Message>
class Recorder {
 public:
  explicit Recorder(const std::string& topic)
      : subscriber_(ros::NodeHandle().subscribe<Message>(
            topic, 10000, [this](const typename Message::ConstPtr& message) {
              const std::lock_guard<std::mutex> lock(mutex_);
              messages_.push_back(*message);
            })) {}
  ~Recorder() { subscriber_.shutdown(); }
  Recorder(const Recorder&) = delete;
  Recorder& operator=(const Recorder&) = delete;

  /// Whether the topic has a publisher.
  bool connected() const { return subscriber_.getNumPublishers() > 0; }

  std::vector<Message> messages() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_;
  }

  std::size_t count() const {
    const std::lock_guard<std::mutex> lock(mutex_);
    return messages_.size();
  }

  /// Waits for a message that meets a condition; messages that have already arrived count.
  bool waitFor(const std::function<bool(const Message&)>& wanted) const {
    return waitUntil([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      for (const Message& message : messages_) {
        if (wanted(message)) return true;
      }
      return false;
    });
  }

  /// Waits until the newest message meets a condition.
  bool waitForLatest(const std::function<bool(const Message&)>& wanted) const {
    return waitUntil([&] {
      const std::lock_guard<std::mutex> lock(mutex_);
      return !messages_.empty() && wanted(messages_.back());
    });
  }

 private:
  mutable std::mutex mutex_;
  std::vector<Message> messages_;
  ros::Subscriber subscriber_;
};

}  // namespace stepdriver::node_test
