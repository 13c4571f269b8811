#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/pulse/cpu_latency.h"

namespace stepdriver::pulse {

struct ChannelConfig;

/// How measured times are spread: half of them are at most the median, and so on.
struct Spread {
  Nanoseconds median = 0;
  Nanoseconds p90 = 0;
  Nanoseconds p99 = 0;
  Nanoseconds max = 0;
  std::size_t count = 0;  ///< of the samples
};

/// @param samples not empty.
Spread spreadOf(std::vector<Nanoseconds> samples);

/// What the calls of one channel cost.
struct CallCosts {
  Spread write;  ///< of its STEP line
  Spread read;   ///< of the slower of its endstops; all 0 where it has none
};

/// What the kernel gave a process and a thread that asked for real-time rights.
struct RealtimeRights {
  int scheduler_error = -1;  ///< errno of the request for SCHED_FIFO; 0: granted; -1: not asked for
  int memory_error = -1;     ///< of the request to lock the memory
  int latency_error = -1;    ///< of that to keep the processors awake, see CpuLatencyHold

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

constexpr int kMeasuredWakeUps = 300;  // a millisecond each
constexpr int kMeasuredSleeps = 100;   // a millisecond each
constexpr int kMeasuredCalls = 200;    // of each line; fewer where they take more than 20 ms

/// Measures in a thread with the rights of the pulse thread; takes about 0.4 s of the clock, on a
/// machine that stalls up to 2 s, and what the calls cost. Nothing moves: STEP lines are written
/// the level that they have, and no other line is.
///
/// @param lines not used by anyone else meanwhile; the STEP lines of the channels are at their
///   inactive level.
/// @param clock not waited on by anyone else meanwhile.
/// @param latency_device as the PulseDriver's.
/// @throw GpioError where a line can't be written or read.
Capability measureCapability(gpio::Lines& lines, Clock& clock,
                             const std::vector<ChannelConfig>& channels,
                             const std::string& latency_device = CpuLatencyHold::kDevice);

/// The same without lines: of a machine alone. There are no channels in it.
Capability measureWakeUps(Clock& clock,
                          const std::string& latency_device = CpuLatencyHold::kDevice);

}  // namespace stepdriver::pulse
