#include "action_topics.h"

#include <utility>

namespace stepdriver::ros_node {

ActionTopics::ActionTopics(const ros::NodeHandle& node, double status_frequency,
                           LatchedMessages& latched)
    : latched_(latched) {
  if (status_frequency == 0.0) return;
  timer_ = node.createSteadyTimer(
      ros::WallDuration(1.0 / status_frequency),
      [this](const ros::SteadyTimerEvent& /*event*/) { publish(); }, false);
}

void ActionTopics::addStatus(std::function<void()> publish) {
  const std::lock_guard<std::mutex> lock(mutex_);
  statuses_.push_back(std::move(publish));
}

void ActionTopics::publish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& publish : statuses_) publish();
}

}  // namespace stepdriver::ros_node
