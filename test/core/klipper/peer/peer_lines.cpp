// A library that is loaded into a program in front of the C library: see peer_lines.h. Besides the
// lines it gives the program a clock without the pauses of this computer.

#include "peer_lines.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <linux/gpio.h>
#include <sys/mman.h>
#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdlib>
#include <cstring>

using stepdriver::test::PeerLines;

namespace {

constexpr const char* kChip = "/dev/gpiochip0";
constexpr int kMostFiles = 1024;
constexpr int kChipItself = -2;
constexpr int kNoLine = -1;

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

struct Lines {
  Lines() {
    for (int& line : line_of) line = kNoLine;
    const char* path = std::getenv(PeerLines::kFileVariable);
    if (path == nullptr) return;
    const int file = next<int (*)(const char*, int, ...)>("open")(path, O_RDWR | O_CLOEXEC);
    if (file < 0) return;
    void* memory = mmap(nullptr, sizeof(PeerLines), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
    next<int (*)(int)>("close")(file);  // not the one below, which needs these lines
    if (memory != MAP_FAILED) shared = static_cast<PeerLines*>(memory);
  }

  void set(int line, bool level) {
    auto& now = shared->levels.at(static_cast<std::size_t>(line));
    if (level && now == 0) ++shared->rises.at(static_cast<std::size_t>(line));
    now = level ? 1 : 0;
  }

  PeerLines* shared = nullptr;
  int line_of[kMostFiles];  // by the file of its request
};

Lines& lines() {
  static Lines only;
  return only;
}

bool isChip(const char* path) { return lines().shared != nullptr && std::strcmp(path, kChip) == 0; }

int openNothing() { return next<int (*)(const char*, int, ...)>("open")("/dev/null", O_RDWR); }

constexpr std::int64_t kSecond = 1'000'000'000;
// The program may be that late for a deadline of its timer, and it sees some time pass in any case.
constexpr std::int64_t kMostLate = 200'000;
constexpr std::int64_t kLeastPassed = 200;

/// The monotonic clock without the pauses in which this computer lets the program wait for a
/// processor: a microcontroller has none. Of one thread.
struct SteadyTime {
  std::int64_t hidden = 0;    // the sum of the pauses [ns]
  std::int64_t last = 0;      // the last time that was told
  std::int64_t deadline = 0;  // of the timer that is set; 0: none is
};

SteadyTime& steadyTime() {
  static SteadyTime only;
  return only;
}

std::int64_t nanosecondsOf(const timespec& time) {
  return std::int64_t{time.tv_sec} * kSecond + time.tv_nsec;
}

timespec timeOf(std::int64_t nanoseconds) {
  return {static_cast<time_t>(nanoseconds / kSecond), static_cast<long>(nanoseconds % kSecond)};
}

}  // namespace

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  const int result = next<int (*)(clockid_t, timespec*)>("clock_gettime")(clock, time);
  if (result != 0 || clock != CLOCK_MONOTONIC) return result;
  SteadyTime& steady = steadyTime();
  const std::int64_t real = nanosecondsOf(*time);
  std::int64_t now = real - steady.hidden;
  if (steady.deadline != 0) now = std::min(now, steady.deadline + kMostLate);
  now = std::max(now, steady.last + kLeastPassed);
  steady.hidden = std::max(steady.hidden, real - now);
  steady.last = now;
  *time = timeOf(now);
  return 0;
}

extern "C" int timer_settime(timer_t timer, int flags, const itimerspec* value,
                             itimerspec* old) noexcept {
  const auto set = next<int (*)(timer_t, int, const itimerspec*, itimerspec*)>("timer_settime");
  const std::int64_t deadline = nanosecondsOf(value->it_value);
  SteadyTime& steady = steadyTime();
  steady.deadline = 0;
  if ((flags & TIMER_ABSTIME) == 0 || deadline <= 1) return set(timer, flags, value, old);
  steady.deadline = std::max(deadline, steady.last);
  itimerspec real = *value;
  real.it_value = timeOf(deadline + steady.hidden);
  return set(timer, flags, &real, old);
}

extern "C" int access(const char* path, int mode) noexcept {
  if (isChip(path)) return 0;
  return next<int (*)(const char*, int)>("access")(path, mode);
}

extern "C" int open(const char* path, int flags, ...) {
  if (isChip(path)) {
    const int file = openNothing();
    if (file >= 0 && file < kMostFiles) lines().line_of[file] = kChipItself;
    return file;
  }
  va_list arguments;
  va_start(arguments, flags);
  const int mode = va_arg(arguments, int);
  va_end(arguments);
  return next<int (*)(const char*, int, ...)>("open")(path, flags, mode);
}

extern "C" int close(int file) {
  if (file >= 0 && file < kMostFiles) lines().line_of[file] = kNoLine;
  return next<int (*)(int)>("close")(file);
}

extern "C" int ioctl(int file, unsigned long request, ...) noexcept {
  va_list arguments;
  va_start(arguments, request);
  void* const argument = va_arg(arguments, void*);
  va_end(arguments);
  const int line = file >= 0 && file < kMostFiles ? lines().line_of[file] : kNoLine;
  if (line == kNoLine) {
    return next<int (*)(int, unsigned long, ...)>("ioctl")(file, request, argument);
  }
  if (line == kChipItself && request == GPIO_GET_LINEHANDLE_IOCTL) {
    auto* wanted = static_cast<gpiohandle_request*>(argument);
    const int handle = openNothing();
    if (handle < 0 || handle >= kMostFiles || wanted->lineoffsets[0] >= PeerLines::kLines) {
      errno = EINVAL;
      return -1;
    }
    lines().line_of[handle] = static_cast<int>(wanted->lineoffsets[0]);
    wanted->fd = handle;
    if ((wanted->flags & GPIOHANDLE_REQUEST_OUTPUT) != 0) {
      lines().set(static_cast<int>(wanted->lineoffsets[0]), wanted->default_values[0] != 0);
    }
    return 0;
  }
  auto* data = static_cast<gpiohandle_data*>(argument);
  if (line >= 0 && request == GPIOHANDLE_SET_LINE_VALUES_IOCTL) {
    lines().set(line, data->values[0] != 0);
    return 0;
  }
  if (line >= 0 && request == GPIOHANDLE_GET_LINE_VALUES_IOCTL) {
    data->values[0] = lines().shared->levels.at(static_cast<std::size_t>(line));
    return 0;
  }
  errno = ENOTTY;
  return -1;
}
