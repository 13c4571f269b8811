#include "jog_sequence.h"

#include <limits>

namespace stepdriver::joystick {
namespace {

constexpr double kRetryAfter = 1.0;

}  // namespace

JogSequence JogSequence::disabling(double disable_after) {
  JogSequence sequence;
  sequence.disable_after_ = disable_after;
  sequence.power_ = Power::kOff;
  sequence.not_before_ = -std::numeric_limits<double>::infinity();
  return sequence;
}

JogOrders JogSequence::orders(double velocity, double now) {
  if (power_ == Power::kOn) return ordersWhileOn(velocity, now);
  JogOrders orders;
  if (power_ == Power::kOff && velocity != 0.0 && now >= not_before_) {
    orders.enable = true;
    power_ = Power::kEnabling;
  }
  return orders;
}

JogOrders JogSequence::ordersWhileOn(double velocity, double now) {
  JogOrders orders;
  if (velocity != 0.0) {
    orders.velocity = velocity;
    jogging_ = true;
    return orders;
  }
  if (jogging_) {
    orders.velocity = 0.0;
    jogging_ = false;
    in_dead_band_since_ = now;
  }
  if (disable_after_ && now - in_dead_band_since_ >= *disable_after_ && now >= not_before_) {
    orders.enable = false;
    power_ = Power::kDisabling;
  }
  return orders;
}

void JogSequence::answered(bool success, double now) {
  if (!success) not_before_ = now + kRetryAfter;
  // The axis is on if it could be enabled, and also if it couldn't be disabled.
  power_ = (power_ == Power::kEnabling) == success ? Power::kOn : Power::kOff;
  in_dead_band_since_ = now;
}

}  // namespace stepdriver::joystick
