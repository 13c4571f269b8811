#pragma once

#include <linux/filter.h>
#include <linux/futex.h>
#include <linux/seccomp.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <csignal>
#include <cstddef>
#include <cstdint>
#include <fstream>
#include <iterator>
#include <limits>
#include <string>

namespace stepdriver::test {

/// Counts what one thread does that a real-time thread must not do, from watchThisThread() on.
/// Functions that a test program puts in front of the library's count allocations and locks; see
/// pulse_thread_calls_test.cpp.
struct ThreadCalls {
  std::atomic<std::uint64_t> allocations{0};
  std::atomic<std::uint64_t> locks{0};
  std::atomic<std::uint64_t> system_calls{0};  ///< other than allowed ones
  std::atomic<int> last_system_call{-1};
  std::atomic<int> filter_error{-1};  ///< errno of the request for the filter; 0: it is there
  std::atomic<std::int64_t> page_faults{0};  ///< until the last call of notePageFaults()
  std::atomic<std::int64_t> page_faults_before{0};
  std::atomic<pid_t> thread{0};
  std::atomic<bool> memory_locked{false};  ///< whether the process has locked its memory
};

/// The counts of the process; set before a thread is watched.
inline ThreadCalls* thread_calls = nullptr;
inline thread_local bool is_watched = false;

inline void noteSystemCall(int /*signal*/, siginfo_t* info, void* /*context*/) {
  ++thread_calls->system_calls;
  thread_calls->last_system_call = info->si_syscall;
}

/// Counts the page faults of the watched thread since watchThisThread(). Called by another thread.
inline void notePageFaults() {
  std::ifstream stat("/proc/self/task/" + std::to_string(thread_calls->thread) + "/stat");
  stat.ignore(std::numeric_limits<std::streamsize>::max(), ')');  // the name may have blanks
  std::string skipped;
  for (int field = 3; field < 10; ++field) stat >> skipped;
  std::int64_t minor = 0;
  std::int64_t of_children = 0;
  std::int64_t major = 0;
  stat >> minor >> of_children >> major;
  thread_calls->page_faults = stat ? minor + major - thread_calls->page_faults_before : -1;
}

/// From now on the calling thread has no system calls except ioctl(), waiting for a futex as a
/// clock does (a contended lock does so in another way), waking a thread that waits for one, and
/// the end of the process. Others are counted, and not executed. clock_gettime() is allowed: if the
/// kernel gives programs no clock to read (no vDSO), it is the read of the clock.
///
/// This can't be undone: it is for threads that live as long as their process.
inline void watchThisThread() {
  thread_calls->thread = gettid();
  rusage usage{};
  getrusage(RUSAGE_THREAD, &usage);
  thread_calls->page_faults_before = usage.ru_minflt + usage.ru_majflt;
  struct sigaction action {};
  action.sa_sigaction = noteSystemCall;
  action.sa_flags = SA_SIGINFO;
  sigaction(SIGSYS, &action, nullptr);
  const auto number = static_cast<unsigned>(offsetof(seccomp_data, nr));
  const auto futex_call = static_cast<unsigned>(offsetof(seccomp_data, args) + sizeof(__u64));
  sock_filter program[] = {
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, number),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_ioctl, 8, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_clock_gettime, 7, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_rt_sigreturn, 6, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_exit_group, 5, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, SYS_futex, 0, 3),
      BPF_STMT(BPF_LD | BPF_W | BPF_ABS, futex_call),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, FUTEX_WAIT_BITSET_PRIVATE, 2, 0),
      BPF_JUMP(BPF_JMP | BPF_JEQ | BPF_K, FUTEX_WAKE_PRIVATE, 1, 0),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_TRAP),
      BPF_STMT(BPF_RET | BPF_K, SECCOMP_RET_ALLOW),
  };
  sock_fprog filter{static_cast<unsigned short>(std::size(program)), program};
  const bool done = prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0) == 0 &&
                    prctl(PR_SET_SECCOMP, SECCOMP_MODE_FILTER, &filter) == 0;
  thread_calls->filter_error = done ? 0 : errno;
  is_watched = true;
}

}  // namespace stepdriver::test
