#pragma once

namespace stepdriver::pulse {

/// The SCHED_FIFO priority of a thread that serves pulses on real lines.
constexpr int kRealtimePriority = 50;
/// The SCHED_FIFO priority of threads whose work is short and must not wait while all processors
/// are busy: the controller, and on a rig that keeps real time also the pulses.
constexpr int kPromptPriority = 10;

/// Requests SCHED_FIFO, and timers without slack, for the calling thread.
/// @return 0, or the errno of the refusal.
int askForScheduler(int priority);

/// Lets the calling thread run on one processor only.
///
/// @param cpu its number, from 0.
/// @return 0, or the errno of the refusal.
int stayOnProcessor(int cpu);

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
