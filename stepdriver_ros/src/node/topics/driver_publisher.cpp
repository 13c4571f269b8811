#include "driver_publisher.h"

#include <stepdriver/DriverState.h>

namespace stepdriver::ros_node {
namespace {

constexpr int kDriverQueueSize = 10;

}  // namespace

DriverPublisher::DriverPublisher(ros::NodeHandle node, const axis::AxisState& state) {
  if (state.drivers) {
    publisher_ = node.advertise<DriverState>("driver", kDriverQueueSize, true);
  }
}

void DriverPublisher::publish(const axis::AxisState& state, ros::Time stamp) {
  if (!state.drivers || state.drivers == published_) return;
  published_ = state.drivers;
  DriverState message;
  message.header.stamp = stamp;
  for (const driver::DriverState& driver : *state.drivers) {
    message.motor.push_back(driver.motor);
    message.set_up.push_back(driver.is_set_up);
    message.run_current.push_back(driver.run_current);
    message.hold_current.push_back(driver.hold_current);
    message.present_current.push_back(driver.present_current);
    message.stealthchop.push_back(driver.stealth_chop);
    message.at_least_celsius.push_back(driver.at_least_celsius);
    message.temperature_warning.push_back(driver.temperature_warning);
    message.open_load_a.push_back(driver.open_load_a);
    message.open_load_b.push_back(driver.open_load_b);
    message.sg_result.push_back(driver.stall_guard.value_or(-1));
    message.sg_position.push_back(driver.stall_guard_position);
    message.sg_velocity.push_back(driver.stall_guard_velocity);
    message.load.push_back(driver::loadOf(driver).value_or(-1.0));
    message.accesses.push_back(driver.transactions);
    message.retries.push_back(driver.retries);
  }
  publisher_.publish(message);
}

}  // namespace stepdriver::ros_node
