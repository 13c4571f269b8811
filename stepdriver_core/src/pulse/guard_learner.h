#pragma once

#include <algorithm>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Learns from the lateness of sleeps how long before its deadline a wait must stop sleeping, so
/// that kPart of the sleeps end in time.
///
/// A sleep that is later than the guard raises it by a twentieth, any other lowers it by a 2048th:
/// it settles when one sleep in a hundred is later. However late a sleep is, it counts only once,
/// so that a computer that stalls doesn't drive the guard up.
class GuardLearner {
 public:
  static constexpr double kPart = 0.99;
  static constexpr Nanoseconds kFirst = 60'000;
  static constexpr Nanoseconds kShortest = 5'000;
  /// At 1000 waits per second, spinning then takes 20 % of the time.
  static constexpr Nanoseconds kLongest = 200'000;

  /// @param late how long after its intended end the sleep ended.
  void slept(Nanoseconds late) {
    const double step = kStep * guard_;
    guard_ += late > guard() ? step * kPart / (1.0 - kPart) : -step;
    guard_ = std::clamp(guard_, static_cast<double>(kShortest), static_cast<double>(kLongest));
  }

  Nanoseconds guard() const { return static_cast<Nanoseconds>(guard_); }

 private:
  static constexpr double kStep = 1.0 / 2048.0;

  double guard_ = static_cast<double>(kFirst);  // [ns]
};

}  // namespace stepdriver::pulse
