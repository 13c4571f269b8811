#pragma once

#include <atomic>
#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/pulse/cpu_latency.h"
#include "stepdriver_core/pulse/pulse_engine.h"
#include "stepdriver_core/pulse/realtime.h"

namespace stepdriver::pulse {

/// Keeps an engine served: in a thread of its own, or, on a virtual clock, by whoever waits.
///
/// The thread asks for SCHED_FIFO 50, locked memory and processors that don't sleep where the clock
/// says that being late matters; where that is refused it goes on without, and rights() says so.
class PulseDriver {
 public:
  /// @param engine, clock outlive the driver.
  /// @param latency_device see CpuLatencyHold; empty: the processors may sleep.
  PulseDriver(PulseEngine& engine, Clock& clock, bool threaded,
              const std::string& latency_device = CpuLatencyHold::kDevice);

  /// stop(), where that wasn't called.
  ~PulseDriver();
  PulseDriver(const PulseDriver&) = delete;
  PulseDriver& operator=(const PulseDriver&) = delete;

  /// Hands an order to the engine, from any thread.
  void post(const Command& command);

  /// Ends the thread; no pulse goes out from then on.
  void stop();

  /// Returns when `ready` says so. It is asked often, from the calling thread.
  ///
  /// @throw Error where there is no thread and the engine has nothing to do that could change it.
  void waitFor(const std::function<bool()>& ready);

  /// Serves the engine for this long on the clock. Only without a thread.
  void advance(Nanoseconds time);

  PulseEngine& engine() { return engine_; }
  const PulseEngine& engine() const { return engine_; }
  Clock& clock() const { return clock_; }

  /// Clock time less all slips: the time that profiles are planned in.
  Nanoseconds motionNow() const { return clock_.now() - engine_.state().slipped; }

  /// A number for Follow::group that no other group has.
  std::uint64_t newGroup() { return ++groups_; }

  /// What the thread asked for and was given.
  RealtimeRights rights() const;

 private:
  void run();

  PulseEngine& engine_;
  Clock& clock_;
  std::mutex posting_;
  std::atomic<std::uint64_t> groups_{0};
  std::atomic<bool> stopping_{false};
  std::atomic<int> scheduler_error_{-1};  // errno of the request; -1: not asked for
  std::atomic<int> lock_error_{-1};
  std::optional<CpuLatencyHold> latency_;
  std::thread thread_;
};

}  // namespace stepdriver::pulse
