#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// While a program keeps this device open with a latency of 0, no processor enters an idle state
/// that takes time to wake up from. This costs power.
constexpr const char* kCpuLatencyDevice = "/dev/cpu_dma_latency";

/// What a pulse thread requests on a real clock, in addition to SCHED_FIFO and locked memory.
struct RealtimeRequest {
  std::string latency_device = kCpuLatencyDevice;  ///< held open; empty: processors may sleep
  std::optional<int> cpu{};  ///< the processor that it runs on, from 0; empty: any of them
};

/// The distribution of measured times: half of them are at most the median, and so on.
struct Spread {
  Nanoseconds median = 0;
  Nanoseconds p90 = 0;
  Nanoseconds p99 = 0;
  Nanoseconds max = 0;
  std::size_t count = 0;  ///< the number of samples
};

/// The lateness of pulses: half of them were late by at most p50, and so on. The percentiles are
/// rounded up, by at most a sixteenth.
struct LatenessFigures {
  std::uint64_t count = 0;  ///< the number of pulses
  Nanoseconds p50 = 0;      ///< the median
  Nanoseconds p99 = 0;
  Nanoseconds p999 = 0;
  Nanoseconds max = 0;  ///< exact
};

/// The costs of the calls for one channel.
struct CallCosts {
  Spread write;  ///< a write of its STEP line
  Spread read;   ///< a read of the slower of its endstops; all 0 if it has no endstop
};

/// What the kernel granted to a process and a thread that requested real-time permissions.
struct RealtimeRights {
  int scheduler_error = -1;  ///< errno of the request for SCHED_FIFO; 0: granted; -1: not requested
  int memory_error = -1;     ///< the answer to the request to lock the memory
  int latency_error = -1;    ///< the same for keeping the processors awake, see kCpuLatencyDevice
  int cpu_error = -1;        ///< the same for running on one processor
  int cpu = -1;              ///< the number of that processor

  /// Without these, pulses may be late by any time. The processors' idle states don't count: their
  /// cost is measured with the wake-ups, and some computers have none.
  bool granted() const { return scheduler_error == 0 && memory_error == 0 && cpu_error <= 0; }
  bool anyRefused() const {
    return scheduler_error > 0 || memory_error > 0 || latency_error > 0 || cpu_error > 0;
  }

  /// A sentence, with the remedy if something was refused.
  std::string text() const;
};

/// The measured performance of a computer and its lines.
struct Capability {
  /// [full steps] as configured, see machine::MachineOptions: what a lateness means for a motion.
  double late_steps = 0.25;
  Spread lateness;        ///< how late wake-ups are, waiting as the pulse thread does
  Spread sleep_lateness;  ///< how late wake-ups from waits that don't spin are (see
                          ///< Clock::sleepUntil())
  Nanoseconds guard = 0;  ///< Clock::guard()
  std::vector<CallCosts> channels;
  RealtimeRights rights;
};

/// Measures only the wake-ups of this computer, in a thread with the permissions of the pulse
/// thread. Takes about 0.4 s of the clock, up to 2 s if the computer stalls.
///
/// @param clock nobody else may wait on it meanwhile.
/// @return without channels.
///
/// @code{.cpp}
/// const pulse::Capability measured = pulse::measureWakeUps(clock);
/// std::cout << "99 % of all wake-ups are late by less than " << measured.lateness.p99 << " ns\n";
/// @endcode
Capability measureWakeUps(Clock& clock, const RealtimeRequest& request = {});

}  // namespace stepdriver::pulse
