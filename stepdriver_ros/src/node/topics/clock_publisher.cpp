#include "clock_publisher.h"

#include <rosgraph_msgs/Clock.h>

#include <cstdint>

namespace stepdriver::ros_node {
namespace {

const ros::WallDuration kClockPeriod(0.01);
constexpr int kQueuedTimes = 10;

}  // namespace

ClockPublisher::ClockPublisher(ros::NodeHandle node, pulse::Clock& clock)
    : clock_(clock),
      began_(ros::WallTime::now()),
      began_at_(clock.now()),
      publisher_(node.advertise<rosgraph_msgs::Clock>("/clock", kQueuedTimes)),
      timer_(node.createSteadyTimer(
          kClockPeriod, [this](const ros::SteadyTimerEvent& /*event*/) { publish(); })) {}

void ClockPublisher::publish() {
  rosgraph_msgs::Clock message;
  message.clock.fromNSec(began_.toNSec() + static_cast<std::uint64_t>(clock_.now() - began_at_));
  publisher_.publish(message);
}

}  // namespace stepdriver::ros_node
