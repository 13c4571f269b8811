#include "stepdriver_core/pulse/clock.h"

#include <algorithm>
#include <chrono>
#include <cmath>

#include "pulse/futex.h"
#include "pulse/hybrid_wait.h"
#include "steady_now.h"

namespace stepdriver::pulse {
namespace {

// How often a thread that waits for a paced clock looks at the time.
constexpr Nanoseconds kCheckPeriod = VirtualClock::kStall / 10;

// The calling thread, as a system for HybridWait.
struct WakeableThread {
  std::atomic<std::uint32_t>& wakes;
  const std::uint32_t seen;

  static Nanoseconds now() { return steadyNow(); }
  bool woken() const { return wakes.load(std::memory_order_acquire) != seen; }
  void sleepUntil(Nanoseconds time) { sleepOnWord(time, wakes, seen); }
};

}  // namespace

SteadyClock::SteadyClock(std::optional<Nanoseconds> guard)
    : wait_(std::make_unique<HybridWait>(
          guard ? std::clamp<Nanoseconds>(*guard, 0, GuardLearner::kLongest) : guard)) {}

SteadyClock::~SteadyClock() = default;

Nanoseconds SteadyClock::guard() const { return wait_->guard(); }

Nanoseconds SteadyClock::now() { return steadyNow(); }

void SteadyClock::waitUntil(Nanoseconds time) { wait(time, true); }

void SteadyClock::sleepUntil(Nanoseconds time) { wait(time, false); }

void SteadyClock::wait(Nanoseconds time, bool may_spin) {
  WakeableThread thread{wakes_, seen_};
  wait_->waitUntil(thread, time, may_spin);
  seen_ = wakes_.load(std::memory_order_acquire);
}

void SteadyClock::wake() {
  wakes_.fetch_add(1, std::memory_order_release);
  wakeSleeper(wakes_);
}

VirtualClock::VirtualClock(double speed) : speed_(speed), started_(steadyNow()) {}

// The time of the clock according to its pace, but never later than the awaited event.
Nanoseconds VirtualClock::current() const {
  if (!waiting_ || holds_ > 0 || speed_ == 0.0) return now_;
  const Nanoseconds now = now_;
  return std::clamp(paced(), now, std::max(now, awaited_));
}

Nanoseconds VirtualClock::paced() const { return atPace(steadyNow() - started_); }

Nanoseconds VirtualClock::atPace(Nanoseconds real) const {
  return std::llround(static_cast<double>(real) * speed_);
}

Nanoseconds VirtualClock::now() {
  if (speed_ == 0.0) return now_.load(std::memory_order_acquire);
  const std::lock_guard<std::mutex> lock(mutex_);
  return current();
}

void VirtualClock::waitUntil(Nanoseconds time) {
  std::unique_lock<std::mutex> lock(mutex_);
  awaited_ = time;
  waiting_ = true;
  while (!woken_ && now_ < time) {
    if (holds_ > 0 && speed_ > 0.0 && time != kNever) {
      changed_.wait_for(lock, std::chrono::nanoseconds(kCheckPeriod));
      checkForStall();
    } else if (holds_ > 0 || (time == kNever && speed_ == 0.0)) {
      changed_.wait(lock);
    } else if (speed_ == 0.0) {
      now_.store(time, std::memory_order_release);
    } else {
      now_ = current();
      if (now_ >= time) break;
      const auto wall_ns = static_cast<double>(time - now_) / speed_;
      // A wait for a wake is split as well: the sum with now() must not overflow.
      const double longest = time == kNever ? 3.6e12 : static_cast<double>(kCheckPeriod);
      changed_.wait_for(lock, std::chrono::nanoseconds(std::llround(std::min(longest, wall_ns))));
      checkForStall();
    }
  }
  if (woken_) now_ = current();
  if (speed_ > 0.0) {
    checkForStall();
    countStall();
  }
  woken_ = false;
  waiting_ = false;
}

// A hold excuses no stall: a thread that waits for an event checks the time so often that
// it misses a check only if it doesn't run.
void VirtualClock::checkForStall() {
  const Nanoseconds now = steadyNow();
  const Nanoseconds unseen = now - std::max(checked_, held_since_);
  if (holds_ > 0 && awaited_ != kNever && unseen > kStall) held_since_ += unseen;
  checked_ = now;
}

// A thread that is only slow falls behind by little from wait to wait, and nothing is late.
void VirtualClock::countStall() {
  const Nanoseconds lag = paced() - now_;
  if (woken_) {
    lag_ = std::min(lag_, lag);
  } else if (lag - lag_ <= atPace(kStall)) {
    lag_ = lag;
  } else {
    now_ += lag - lag_;
    ++stalls_;
  }
}

void VirtualClock::wake() {
  const std::lock_guard<std::mutex> lock(mutex_);
  woken_ = true;
  changed_.notify_all();
}

void VirtualClock::hold() {
  const std::lock_guard<std::mutex> lock(mutex_);
  now_ = current();
  if (holds_++ == 0) held_since_ = steadyNow();
}

void VirtualClock::release() {
  const std::lock_guard<std::mutex> lock(mutex_);
  checkForStall();
  // On real lines nothing stands still for it.
  if (--holds_ == 0) lag_ += atPace(steadyNow() - held_since_);
  changed_.notify_all();
}

}  // namespace stepdriver::pulse
