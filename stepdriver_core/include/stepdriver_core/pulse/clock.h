#pragma once

#include <atomic>
#include <condition_variable>
#include <cstdint>
#include <limits>
#include <memory>
#include <mutex>
#include <optional>

namespace stepdriver::pulse {

class HybridWait;

/// Nanoseconds on a Clock. The zero is arbitrary; that of the steady clock is CLOCK_MONOTONIC's.
using Nanoseconds = std::int64_t;

constexpr Nanoseconds kNever = std::numeric_limits<Nanoseconds>::max();

/// The clock that times the pulses. now() and wake() may be called from any thread, waitUntil()
/// only from the thread that serves the pulses.
class Clock {
 public:
  virtual ~Clock() = default;

  /// Never decreases.
  virtual Nanoseconds now() = 0;

  /// Returns at the given time, or earlier after a wake(). kNever waits only for a wake().
  virtual void waitUntil(Nanoseconds time) = 0;

  /// The same without spinning, like a wait after the clock has spun for as long as it may: it
  /// returns when the system wakes the thread. For measurements.
  virtual void sleepUntil(Nanoseconds time) { waitUntil(time); }

  /// How long before the deadline waitUntil() begins to spin; 0: it doesn't spin.
  virtual Nanoseconds guard() const { return 0; }

  /// Ends the wait in progress; if there is none, ends the next one.
  virtual void wake() = 0;

  /// Whether lateness matters: the thread that serves the pulses then requests real-time
  /// permissions.
  virtual bool realtime() const { return false; }

  /// Whether it takes as long as real time, or longer, from one event to the next. The threads that
  /// serve it then sleep most of the time, and request to run before others when they wake up.
  virtual bool keepsRealTime() const { return realtime(); }

  /// Whether time passes while nothing is waited for.
  virtual bool passesByItself() const { return true; }

  /// While anyone holds the clock, a virtual clock stands still; a real one continues.
  virtual void hold() {}
  virtual void release() {}
};

/// Holds a clock during its lifetime: for planning against a moment that must not pass.
class ClockHold {
 public:
  explicit ClockHold(Clock& clock) : clock_(clock) { clock_.hold(); }
  ~ClockHold() { clock_.release(); }
  ClockHold(const ClockHold&) = delete;
  ClockHold& operator=(const ClockHold&) = delete;

 private:
  Clock& clock_;
};

/// CLOCK_MONOTONIC: sleeps until a guard time before the deadline, then spins, for at most four
/// fifths of the time.
class SteadyClock : public Clock {
 public:
  /// @param guard how long before the deadline the sleep ends, at most 200 us. By default the clock
  ///   learns it from its sleeps.
  explicit SteadyClock(std::optional<Nanoseconds> guard = {});
  ~SteadyClock() override;

  Nanoseconds now() override;
  void waitUntil(Nanoseconds time) override;
  void sleepUntil(Nanoseconds time) override;
  /// The current guard time. Not to be called while another thread waits.
  Nanoseconds guard() const override;
  void wake() override;
  bool realtime() const override { return true; }

 private:
  void wait(Nanoseconds time, bool may_spin);

  std::unique_ptr<HybridWait> wait_;
  std::atomic<std::uint32_t> wakes_{0};
  std::uint32_t seen_ = 0;
};

/// Virtual time: it jumps from event to event, each at its exact nanosecond, however late the
/// thread that serves them is. Only if a paced clock stands still for more than kStall of real
/// time between two waits, for example in a process that was suspended, does the next wait end as
/// late as it would on real lines.
///
/// @code{.cpp}
/// pulse::VirtualClock at_once;          // for tests: an hour of motion takes seconds
/// pulse::VirtualClock as_fast(1.0);     // as fast as the real one
/// std::cout << at_once.now() << " ns\n";  // "0 ns"
/// @endcode
class VirtualClock : public Clock {
 public:
  /// @param speed virtual seconds per second of CLOCK_MONOTONIC; 0: a wait ends at once, and the
  ///   clock stands still while there is nothing to wait for.
  explicit VirtualClock(double speed = 0.0);

  /// [ns] of CLOCK_MONOTONIC
  static constexpr Nanoseconds kStall = 1'000'000'000;

  Nanoseconds now() override;
  void waitUntil(Nanoseconds time) override;
  void wake() override;
  /// How often a wait has ended late. For any thread.
  std::uint64_t stalls() const { return stalls_.load(std::memory_order_acquire); }
  bool keepsRealTime() const override { return speed_ > 0.0 && speed_ <= 1.0; }
  bool passesByItself() const override { return speed_ > 0.0; }
  void hold() override;
  void release() override;

 private:
  Nanoseconds current() const;
  Nanoseconds paced() const;
  Nanoseconds atPace(Nanoseconds real) const;
  void checkForStall();
  void countStall();

  const double speed_;
  const Nanoseconds started_;
  std::mutex mutex_;
  std::condition_variable changed_;
  // Changed only with the mutex. Without a speed it can be read at any time.
  std::atomic<Nanoseconds> now_{0};
  std::atomic<std::uint64_t> stalls_{0};
  Nanoseconds awaited_ = kNever;
  Nanoseconds lag_ = 0;  // behind its pace, at the end of the last wait
  bool waiting_ = false;
  bool woken_ = false;
  int holds_ = 0;
  // [ns] of CLOCK_MONOTONIC:
  Nanoseconds held_since_ = 0;  // later by the stalls in it
  Nanoseconds checked_ = 0;     // when a waiting thread last checked the time
};

}  // namespace stepdriver::pulse
