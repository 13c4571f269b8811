#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// While a program holds it open with a latency of 0, the kernel keeps all processors out of idle
/// states that take time to wake from. It costs power.
constexpr const char* kCpuLatencyDevice = "/dev/cpu_dma_latency";

/// How measured times are spread: half of them are at most the median, and so on.
struct Spread {
  Nanoseconds median = 0;
  Nanoseconds p90 = 0;
  Nanoseconds p99 = 0;
  Nanoseconds max = 0;
  std::size_t count = 0;  ///< of the samples
};

/// How late pulses were: half of them by at most p50, and so on. The percentiles are rounded up, by
/// at most a sixteenth.
struct LatenessFigures {
  std::uint64_t count = 0;  ///< of the pulses
  Nanoseconds p50 = 0;      ///< the median
  Nanoseconds p99 = 0;
  Nanoseconds p999 = 0;
  Nanoseconds max = 0;  ///< exact
};

/// What the calls of one channel cost.
struct CallCosts {
  Spread write;  ///< of its STEP line
  Spread read;   ///< of the slower of its endstops; all 0 where it has none
};

/// What the kernel gave a process and a thread that asked for real-time rights.
struct RealtimeRights {
  int scheduler_error = -1;  ///< errno of the request for SCHED_FIFO; 0: granted; -1: not asked for
  int memory_error = -1;     ///< of the request to lock the memory
  int latency_error = -1;    ///< of that to keep the processors awake, see kCpuLatencyDevice

  /// Without them pulses may be late by any time. What sleeping processors cost is measured with
  /// the wake-ups, and some machines have no such states.
  bool granted() const { return scheduler_error == 0 && memory_error == 0; }
  bool anyRefused() const { return scheduler_error > 0 || memory_error > 0 || latency_error > 0; }

  /// In a sentence, with the remedy where something was refused.
  std::string text() const;
};

/// What a machine and its lines can do, as measured there and then.
struct Capability {
  Spread lateness;        ///< of wake-ups, as the pulse thread waits
  Spread sleep_lateness;  ///< of those of waits that may not spin (see Clock::sleepUntil())
  Nanoseconds guard = 0;  ///< Clock::guard()
  std::vector<CallCosts> channels;
  RealtimeRights rights;
};

/// Measures the wake-ups of this machine alone, in a thread with the rights of the pulse thread.
/// Takes about 0.4 s of the clock, up to 2 s if the machine stalls.
///
/// @param clock must not be waited on by anyone else meanwhile.
/// @param latency_device see kCpuLatencyDevice; empty: the processors may sleep.
/// @return without channels.
Capability measureWakeUps(Clock& clock, const std::string& latency_device = kCpuLatencyDevice);

}  // namespace stepdriver::pulse
