#pragma once

#include <algorithm>
#include <optional>

#include "pulse/guard_learner.h"
#include "pulse/running_share.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// Exact waits of one thread: it sleeps until a guard time before the deadline, then spins. It
/// spins for at most kMostSpinning of the time, and leaves time for the other threads: see
/// RunningShare. It has no clock of its own, so that it works with any.
class HybridWait {
 public:
  /// If a real-time thread keeps spinning, the kernel stops it for the rest of the second
  /// (sched_rt_runtime_us), which costs far more than one late wake-up.
  static constexpr double kMostSpinning = 0.8;
  /// A wait that isn't longer always spins: those for the times of chips are of 1 to 5 us, and the
  /// shortest sleep takes many times that. They count as spinning.
  static constexpr Nanoseconds kShortWait = 5'000;

  /// @param guard how long before the deadline the sleep ends; empty: GuardLearner learns it.
  explicit HybridWait(std::optional<Nanoseconds> guard) : fixed_guard_(guard) {}

  Nanoseconds guard() const { return fixed_guard_.value_or(learner_.guard()); }

  /// Returns at the given time, or earlier if the system is woken.
  ///
  /// @param system has now(), woken(), and sleepUntil(time), which returns early if it is woken.
  template <typename System>
  void waitUntil(System& system, Nanoseconds time, bool may_spin = true) {
    Nanoseconds now = system.now();
    const Nanoseconds wake = begin(now, time, may_spin);
    while (!system.woken() && now < wake) {
      const Nanoseconds asleep = now;
      system.sleepUntil(wake);
      now = system.now();
      slept(asleep, wake, now);
    }
    const Nanoseconds spinning = now;
    while (!system.woken() && now < time) now = system.now();
    spun_ += now - spinning;
  }

 private:
  static constexpr Nanoseconds kWindow = 100'000'000;

  // Returns the time at which the sleep must end.
  Nanoseconds begin(Nanoseconds now, Nanoseconds time, bool may_spin) {
    if (running_since_) share_.ran(now - *running_since_);
    running_since_ = now;
    if (now - window_ > kWindow) {
      window_ = now;
      spun_ = 0;
    }
    const auto most = static_cast<Nanoseconds>(kMostSpinning * kWindow);
    const bool is_short = time - now <= kShortWait;
    const bool spins = may_spin && time != kNever && (is_short || spun_ < most);
    const Nanoseconds wake = spins ? time - std::max(guard(), is_short ? kShortWait : 0) : time;
    const Nanoseconds rest = share_.rest();
    return rest == 0 ? wake : std::max(wake, now + rest);
  }

  void slept(Nanoseconds from, Nanoseconds wake, Nanoseconds now) {
    share_.slept(now - from);
    running_since_ = now;
    if (now >= wake) learner_.slept(now - wake);  // otherwise it was woken
  }

  const std::optional<Nanoseconds> fixed_guard_;
  GuardLearner learner_;
  RunningShare share_;
  std::optional<Nanoseconds> running_since_;  // the time before that is in share_
  Nanoseconds window_ = 0;  // start of the window in which spun_ was spent spinning
  Nanoseconds spun_ = 0;
};

}  // namespace stepdriver::pulse
