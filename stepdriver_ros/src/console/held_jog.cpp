#include "held_jog.h"

#include <utility>

namespace stepdriver::console {

void HeldJog::press(const std::string& axis, double velocity, double now) {
  if (axis != axis_ || velocity != velocity_) next_ = now;
  axis_ = axis;
  velocity_ = velocity;
  until_ = now + kHold;
}

std::optional<HeldJog::Order> HeldJog::due(double now) {
  if (!active()) return {};
  if (now >= until_) return end();
  if (now < next_) return {};
  next_ = now + period_;
  return Order{axis_, velocity_};
}

std::optional<HeldJog::Order> HeldJog::end() {
  if (!active()) return {};
  velocity_ = 0.0;
  return Order{std::exchange(axis_, std::string()), 0.0};
}

}  // namespace stepdriver::console
