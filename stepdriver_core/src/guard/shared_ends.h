#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <optional>

#include "channel/channel_config.h"

namespace stepdriver::pulse {

/// Which end of an axis presses the switch that both ends share. The line doesn't tell, but the way
/// of the axis does: it is the end towards which the axis moved last when the switch closed.
///
/// A switch may close again on the way off, or just after a short way back and forth. So the
/// direction is that of a way of at least half of the release travel: like a part that the axis
/// drags along with a play of that travel, whose side tells the direction.
class SharedEnds {
 public:
  /// @param assumed the end that presses the switch if nothing tells; empty: it isn't known then.
  explicit SharedEnds(std::optional<AxisEnd> assumed) : assumed_(assumed) {}

  /// The axis may have moved without a step.
  void forget() {
    count_.reset();
    play_ = 0.0;
    was_open_ = is_pressed_ = false;
    by_.reset();
  }

  /// A motion begins: it may leave the switch by the release travel.
  void begin(std::int64_t count) { leaves_from_ = count; }

  /// Whether a step may go out. @param release [microsteps] see ChannelConfig::switch_release
  bool mayStep(std::int64_t count, int direction, bool is_active, double release) {
    follow(count, release);
    if (!is_active) {
      was_open_ = true;
      is_pressed_ = false;
      return true;
    }
    if (!is_pressed_) {
      by_ = nextPressed();
      is_pressed_ = true;
      leaves_from_ = count;
    }
    const AxisEnd ahead = direction > 0 ? AxisEnd::kMax : AxisEnd::kMin;
    return by_ && *by_ != ahead && std::abs(static_cast<double>(count - leaves_from_)) < release;
  }

  /// The axis has come to rest.
  void follow(std::int64_t count, double release) {
    if (count_) {
      const double moved = static_cast<double>(count - *count_);
      play_ = std::clamp(play_ + moved, -0.5 * release, 0.5 * release);
    }
    count_ = count;
  }

  /// The end that presses the switch, if it is pressed; empty: it isn't known.
  std::optional<AxisEnd> pressed() const { return is_pressed_ ? by_ : nextPressed(); }

 private:
  std::optional<AxisEnd> nextPressed() const {
    if (!was_open_ || play_ == 0.0) return assumed_;
    return play_ > 0.0 ? AxisEnd::kMax : AxisEnd::kMin;
  }

  const std::optional<AxisEnd> assumed_;
  std::optional<std::int64_t> count_;  // empty: nothing has been read since forget()
  double play_ = 0.0;                  // [microsteps] above 0: the last way was towards max
  bool was_open_ = false;
  bool is_pressed_ = false;    // by the last reading
  std::optional<AxisEnd> by_;  // that end
  std::int64_t leaves_from_ = 0;
};

}  // namespace stepdriver::pulse
