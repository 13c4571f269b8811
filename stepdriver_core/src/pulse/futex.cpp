#include "pulse/futex.h"

#include <linux/futex.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <ctime>

#include "steady_now.h"

namespace stepdriver::pulse {
namespace {

// The call that takes the C library's timespec. A computer of 32 bits has two.
#ifdef SYS_futex_time64
constexpr long kFutex = sizeof(timespec) == 2 * sizeof(long) ? SYS_futex : SYS_futex_time64;
#else
constexpr long kFutex = SYS_futex;
#endif

}  // namespace

void sleepOnWord(Nanoseconds time, std::atomic<std::uint32_t>& word, std::uint32_t value) noexcept {
  timespec deadline{};
  deadline.tv_sec = static_cast<time_t>(time / 1'000'000'000);
  deadline.tv_nsec = static_cast<decltype(deadline.tv_nsec)>(time % 1'000'000'000);
  syscall(kFutex, reinterpret_cast<std::uint32_t*>(&word), FUTEX_WAIT_BITSET_PRIVATE, value,
          time == kNever ? nullptr : &deadline, nullptr, FUTEX_BITSET_MATCH_ANY);
}

void wakeSleeper(std::atomic<std::uint32_t>& word) noexcept {
  syscall(kFutex, reinterpret_cast<std::uint32_t*>(&word), FUTEX_WAKE_PRIVATE, 1, nullptr, nullptr,
          0);
}

void WakeFlag::wait(Nanoseconds until) noexcept {
  while (!consume() && (until == kNever || steadyNow() < until)) sleepOnWord(until, word_, 0);
}

}  // namespace stepdriver::pulse
