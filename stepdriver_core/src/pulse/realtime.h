#pragma once

namespace stepdriver::pulse {

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
