#pragma once

#include <string>

namespace stepdriver::pulse {

constexpr int kRealtimePriority = 50;

/// What the kernel said when a thread that must not be late asked for its rights. Each is an errno;
/// 0: granted, -1: not asked for.
struct RealtimeRights {
  int scheduler = -1;
  int memory = -1;
};

/// Asks for SCHED_FIFO 50 for the calling thread, and for sleeps as short as they are asked for.
///
/// @return 0 or an errno.
int requestScheduling();

/// Locks the memory of the process where RLIMIT_MEMLOCK is unlimited: under a limit a locked
/// process fails at its next allocation, wherever that is.
///
/// @return 0 or an errno.
int lockMemory();

/// In a sentence, with the way to get what was refused.
std::string describe(const RealtimeRights& rights);

}  // namespace stepdriver::pulse
