#include "periodic_poll.h"

#include <utility>

namespace stepdriver::ros_node {

PeriodicPoll::PeriodicPoll(const ros::NodeHandle& node, ros::WallDuration period,
                           std::function<bool()> poll)
    : poll_(std::move(poll)),
      timer_(node.createSteadyTimer(
          period, [this](const ros::SteadyTimerEvent& /*event*/) { call(); }, false, false)) {}

void PeriodicPoll::begin() {
  const std::lock_guard<std::mutex> lock(mutex_);
  begun_ = true;
  timer_.start();
}

void PeriodicPoll::call() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    begun_ = false;
  }
  const bool more = poll_();
  const std::lock_guard<std::mutex> lock(mutex_);
  // Something may have begun during the call, too late for the call to see it.
  if (!more && !begun_) timer_.stop();
}

}  // namespace stepdriver::ros_node
