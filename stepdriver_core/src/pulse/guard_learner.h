#pragma once

#include <algorithm>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Learns how long before its time a wait must stop sleeping, from how late its sleeps have ended:
/// so that kPart of them end in time.
///
/// A sleep that ends later than the guard raises it by a twentieth, one that doesn't lowers it by a
/// 2048th: it is at rest where the first come once in a hundred. However late one sleep ended, it
/// counts as one, so that a machine that stalls doesn't drive it up.
class GuardLearner {
 public:
  static constexpr double kPart = 0.99;
  static constexpr Nanoseconds kFirst = 60'000;
  static constexpr Nanoseconds kShortest = 5'000;
  /// At 1000 waits in a second the spin is 20 % of the time then.
  static constexpr Nanoseconds kLongest = 200'000;

  /// @param late by how much the sleep ended after the time that it was to end at.
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
