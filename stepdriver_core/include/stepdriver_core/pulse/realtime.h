#pragma once

#include <string>

namespace stepdriver::pulse {

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

/// The priority that askForScheduler() asks for.
constexpr int kRealtimePriority = 50;

/// Asks for SCHED_FIFO, and for timers without slack, for the calling thread.
/// @return 0, or the errno of the refusal.
int askForScheduler();

/// Locks the memory of the process, now and to come: what was used once stays where it is. Code and
/// data of the program and its libraries are brought in before, but for tables of more than 4 MB;
/// all else takes no memory that it doesn't use. Only where the process has no limit, or may lift
/// it: under one a locked process fails at its next allocation, wherever that is.
///
/// @return 0, or the errno of the refusal.
int lockMemory();

/// Brings the stack of the calling thread in, as deep as a pulse thread goes.
void touchStack();

}  // namespace stepdriver::pulse
