#pragma once

#include <algorithm>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Keeps a thread that outranks all others from taking all of the time if it can't keep up: it runs
/// for at most 0.91 of each second. It owes a ninth of its running time as sleep, and sleeping pays
/// that back; when it owes kAllowed, it must rest.
///
/// The rests are short: a pulse that one of them delays is late by far less than the lateness at
/// which a motor must stop, and slides the timeline like any other late pulse. For a long run, or a
/// stall of the computer that looks like one, no more than kLongestRest is repaid.
class RunningShare {
 public:
  static constexpr double kMost = 0.9;
  static constexpr Nanoseconds kAllowed = 10'000'000;
  static constexpr Nanoseconds kRest = 200'000;
  static constexpr Nanoseconds kLongestRest = 1'000'000;

  /// The thread ran, and then slept, for this long.
  void ran(Nanoseconds time) {
    owed_ += static_cast<double>(time) * (1.0 - kMost) / kMost;
    owed_ = std::min(owed_, static_cast<double>(kAllowed + kLongestRest - kRest));
  }
  void slept(Nanoseconds time) { owed_ = std::max(0.0, owed_ - static_cast<double>(time)); }

  /// How long it must sleep now at least; 0: it needn't.
  Nanoseconds rest() const {
    const auto owed = static_cast<Nanoseconds>(owed_);
    return owed < kAllowed ? 0 : owed - kAllowed + kRest;
  }

 private:
  double owed_ = 0.0;  // [ns]
};

}  // namespace stepdriver::pulse
