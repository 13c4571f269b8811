#pragma once

#include <sys/types.h>

#include <atomic>
#include <cstdint>
#include <optional>
#include <string>
#include <thread>

#include "pulse/cpu_latency.h"
#include "pulse/pulse_engine.h"
#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// A thread that serves an engine.
///
/// It requests SCHED_FIFO 50, locked memory, processors that don't sleep and, if wanted, one
/// processor for itself alone, if the clock is a real-time one. If any of these is refused, it
/// works without it, and rights() says so. On a virtual clock that keeps real time it requests a
/// lower priority, so that a stop doesn't wait for a processor.
class PulseThread {
 public:
  /// @param engine, clock outlive the thread. @param listener is told when an alarm goes off; may
  ///   be nullptr.
  PulseThread(PulseEngine& engine, Clock& clock, NewsListener* listener = nullptr,
              const RealtimeRequest& request = {});

  /// Calls stop() if that wasn't called.
  ~PulseThread();
  PulseThread(const PulseThread&) = delete;
  PulseThread& operator=(const PulseThread&) = delete;

  /// Ends the thread; no pulse goes out from then on.
  void stop();

  /// Sets the alarm: the listener is told when the clock reaches this time, and a virtual clock
  /// doesn't jump past it. Replaces the previous alarm; kNever: no alarm. Safe from any thread.
  void setAlarm(Nanoseconds time);

  /// Changes when a pass of the engine begins and when it ends; odd during a pass. Safe from any
  /// thread.
  std::uint64_t passes() const { return passes_.load(std::memory_order_acquire); }

  /// Whether the thread waits, in a system call or for a lock: false if it runs, or if it only
  /// waits for a processor. Safe from any thread.
  bool isBlocked() const;

  /// What the thread requested and was granted.
  RealtimeRights rights() const;

 private:
  void run();

  PulseEngine& engine_;
  Clock& clock_;
  NewsListener* const listener_;
  std::atomic<Nanoseconds> alarm_{kNever};
  std::atomic<bool> stopping_{false};
  std::atomic<std::uint64_t> passes_{0};
  std::atomic<pid_t> id_{0};              // the thread's id
  std::atomic<int> scheduler_error_{-1};  // errno of the request; -1: not requested
  std::atomic<int> lock_error_{-1};
  std::atomic<int> cpu_error_{-1};
  const int cpu_;  // -1: any
  std::optional<CpuLatencyHold> latency_;
  std::thread thread_;
};

}  // namespace stepdriver::pulse
