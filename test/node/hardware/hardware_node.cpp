#include "hardware/hardware_node.h"

#include <cmath>

namespace stepdriver::node_test {
namespace {

constexpr double kStepsPerMm = 80.0;

}  // namespace

HardwareNode::HardwareNode() {
  erase("simulation");
  erase("axes");
  set("gpio/backend", "libgpiod");
  set("realtime/max_lateness_ms", 1000.0);  // the test kernel's machine is virtual
  setAxis("x", "a4988", "board", kX);
  setAxis("y", "a4988", "board", kY);
  setAxis("z", "drv8825", "expander", kZ);
  set("axes/y/max_speed_mm_s", 1.9);  // unlike x: now and then both step at the same time
  set("axes/y/endstops/max/pin", "expander:" + std::to_string(kY.max));
  set("axes/z/pins/fault", "expander:" + std::to_string(kZFault));
  set("axes/z/fault_bias", "pull_up");
  set("axes/z/timing/reset_low_ms", 300.0);  // long enough for a test to see the pulse
}

void HardwareNode::setAxis(const std::string& axis, const std::string& driver,
                           const std::string& chip, const Axis& lines) {
  const std::string key = "axes/" + axis + "/";
  const auto line = [&chip](unsigned offset) { return chip + ":" + std::to_string(offset); };
  set(key + "driver", driver);
  set(key + "pins/step", line(lines.step));
  set(key + "pins/dir", line(lines.dir));
  set(key + "pins/enable", line(lines.enable));
  set(key + "pins/sleep", line(lines.sleep));
  set(key + "pins/reset", line(lines.reset));
  set(key + "endstops/max/pin", line(lines.max));
  set(key + "endstops/max/active_level", "high");
  set(key + "microsteps", 16);
  set(key + "steps_per_mm", kStepsPerMm);
  set(key + "max_speed_mm_s", 2.0);
  set(key + "acceleration_mm_s2", 500.0);
  set(key + "enable_on_start", true);
}

std::int64_t HardwareNode::stepsOf(double position) {
  return std::llround(position * 1000.0 * kStepsPerMm);
}

MoveTo::Response HardwareNode::move(const std::string& axis, double position, bool wait) {
  MoveTo::Request request;
  request.position = position;
  request.wait = wait;
  return call<MoveTo>(axis + "/move_to", request);
}

}  // namespace stepdriver::node_test
