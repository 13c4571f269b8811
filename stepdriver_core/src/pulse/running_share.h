#pragma once

#include <algorithm>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Keeps a thread that outranks all others from taking all of the time where it can't keep up: of
/// each second it runs for at most 0.91. It owes sleep for what it runs, a ninth of it, and what it
/// sleeps pays that back; where it owes kAllowed, it is to rest.
///
/// The rests are short: a pulse that one of them makes late is late by far less than what a motor
/// must stop for, and the timeline slides by it as by any lateness. So of a long run, or of a stall
/// of the machine that looks like one, no more than kLongestRest is made good.
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

  /// How long it is to sleep now at least; 0: it need not.
  Nanoseconds rest() const {
    const auto owed = static_cast<Nanoseconds>(owed_);
    return owed < kAllowed ? 0 : owed - kAllowed + kRest;
  }

 private:
  double owed_ = 0.0;  // [ns]
};

}  // namespace stepdriver::pulse
