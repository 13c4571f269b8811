#include "looking.h"

#include <utility>

namespace stepdriver::ros_node {

Looking::Looking(const ros::NodeHandle& node, ros::WallDuration period, std::function<bool()> look)
    : look_(std::move(look)),
      timer_(node.createSteadyTimer(
          period, [this](const ros::SteadyTimerEvent& /*event*/) { call(); }, false, false)) {}

void Looking::begin() {
  const std::lock_guard<std::mutex> lock(mutex_);
  begun_ = true;
  timer_.start();
}

void Looking::call() {
  {
    const std::lock_guard<std::mutex> lock(mutex_);
    begun_ = false;
  }
  const bool more = look_();
  const std::lock_guard<std::mutex> lock(mutex_);
  // What began during the look may be something that it didn't see.
  if (!more && !begun_) timer_.stop();
}

}  // namespace stepdriver::ros_node
