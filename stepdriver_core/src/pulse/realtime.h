#pragma once

namespace stepdriver::pulse {

/// The priority that askForScheduler() requests.
constexpr int kRealtimePriority = 50;

/// Requests SCHED_FIFO, and timers without slack, for the calling thread.
/// @return 0, or the errno of the refusal.
int askForScheduler();

/// Locks the present and future memory of the process: pages that were used once stay in memory.
/// Code and data of the program and its libraries are loaded first, except for tables of more than
/// 4 MB; everything else takes no memory until it is used. This is done only if the process has no
/// limit or may lift it: with a limit, a locked process would fail at some later allocation.
///
/// @return 0, or the errno of the refusal.
int lockMemory();

/// Loads the stack of the calling thread, as deep as a pulse thread uses it.
void touchStack();

}  // namespace stepdriver::pulse
