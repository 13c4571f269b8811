#include "action_statuses.h"

#include <utility>

namespace stepdriver::ros_node {

ActionStatuses::ActionStatuses(const ros::NodeHandle& node, double frequency) {
  if (frequency == 0.0) return;
  timer_ = node.createSteadyTimer(
      ros::WallDuration(1.0 / frequency),
      [this](const ros::SteadyTimerEvent& /*event*/) { publish(); }, false);
}

void ActionStatuses::add(std::function<void()> publish) {
  const std::lock_guard<std::mutex> lock(mutex_);
  actions_.push_back(std::move(publish));
}

void ActionStatuses::publish() {
  const std::lock_guard<std::mutex> lock(mutex_);
  for (const auto& publish : actions_) publish();
}

}  // namespace stepdriver::ros_node
