#pragma once

#include <algorithm>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::activity {

/// Waits until a switch has stayed at one level for its debounce time.
class SwitchSettling {
 public:
  enum class State { kWaits, kSettled, kBounces };

  /// @param closed its level now. @param now clock time.
  SwitchSettling(pulse::Nanoseconds debounce, bool closed, pulse::Nanoseconds now)
      : debounce_(debounce), closed_(closed), began_(now), steady_since_(now) {}

  /// @param last_edge clock time of its last edge since steadySince(), or that.
  /// @return kBounces: it has not come to rest for so long that it is broken.
  State sample(bool closed, pulse::Nanoseconds last_edge, pulse::Nanoseconds now) {
    if (closed != closed_) steady_since_ = now;
    closed_ = closed;
    steady_since_ = std::max(steady_since_, last_edge);
    if (now - steady_since_ >= debounce_) return State::kSettled;
    return now - began_ > kMostDebounces * debounce_ ? State::kBounces : State::kWaits;
  }

  bool closed() const { return closed_; }
  pulse::Nanoseconds began() const { return began_; }
  pulse::Nanoseconds steadySince() const { return steady_since_; }

 private:
  // A switch that has not come to rest after this many debounce times is broken.
  static constexpr int kMostDebounces = 50;

  pulse::Nanoseconds debounce_;
  bool closed_;
  pulse::Nanoseconds began_;
  pulse::Nanoseconds steady_since_;
};

}  // namespace stepdriver::activity
