// A library that a test loads into a program in front of the C library: see injected_faults.h.

#include "injected_faults.h"

#include <dlfcn.h>
#include <fcntl.h>
#include <pthread.h>
#include <sys/mman.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <new>
#include <string>

using stepdriver::node_test::InjectedFaults;

namespace {

constexpr std::int64_t kSecond = 1'000'000'000;
// The longest part of a wait on the wall clock: then it looks whether the clock was set.
constexpr std::int64_t kLook = kSecond / 50;
// Later than any time of the monotonic clock: such a deadline is one of the wall clock.
constexpr std::int64_t kWallClock = 1'000'000'000;

InjectedFaults* mapped() {
  const char* path = std::getenv(InjectedFaults::kFileVariable);
  if (path == nullptr) return nullptr;
  const int file = static_cast<int>(open(path, O_RDWR | O_CLOEXEC));
  if (file < 0) return nullptr;
  void* memory = mmap(nullptr, sizeof(InjectedFaults), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  return memory == MAP_FAILED ? nullptr : static_cast<InjectedFaults*>(memory);
}

InjectedFaults* injected = nullptr;
__attribute__((constructor)) void begin() { injected = mapped(); }

template <typename Function>
Function next(const char* name) {
  return reinterpret_cast<Function>(dlsym(RTLD_NEXT, name));
}

std::int64_t wallOffset() { return injected == nullptr ? 0 : injected->wall_clock_ns.load(); }

timespec timeOf(std::int64_t nanoseconds) {
  return {static_cast<time_t>(nanoseconds / kSecond), static_cast<long>(nanoseconds % kSecond)};
}

std::int64_t nanosecondsOf(const timespec& time) {
  return std::int64_t{time.tv_sec} * kSecond + time.tv_nsec;
}

bool isInFolder(const char* path) {
  return injected != nullptr && injected->folder[0] != '\0' &&
         std::strncmp(path, injected->folder, std::strlen(injected->folder)) == 0;
}

bool isInFolder(int file) {
  char link[64];
  std::snprintf(link, sizeof link, "/proc/self/fd/%d", file);
  char path[512];
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return false;
  path[length] = '\0';
  return isInFolder(path);
}

/// @return whether the call fails.
bool fails(bool concerned, std::atomic<int> InjectedFaults::*which) {
  if (!concerned || injected == nullptr) return false;
  const int error = (injected->*which).load();
  if (error != 0) errno = error;
  return error != 0;
}

bool allocationFails() {
  if (injected == nullptr) return false;
  injected->allocations.fetch_add(1, std::memory_order_relaxed);
  if (injected->allocations_left.load(std::memory_order_relaxed) < 0) return false;
  if (injected->allocations_left.load() > 0 && injected->allocations_left.fetch_sub(1) > 0) {
    return false;
  }
  injected->allocations_left.store(0);
  return true;
}

/// Waits in parts, so that a wait on the wall clock sees that the clock was set.
template <typename Wait>
int waitOnWallClock(const timespec& deadline, const Wait& wait) {
  for (;;) {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    const std::int64_t left = nanosecondsOf(deadline) - nanosecondsOf(now);
    if (left <= 0) return ETIMEDOUT;
    const std::int64_t real =
        nanosecondsOf(now) - wallOffset() + std::min<std::int64_t>(left, kLook);
    const timespec part = timeOf(real);
    const int result = wait(&part);
    if (result != ETIMEDOUT) return result;
  }
}

}  // namespace

// ---- the wall clock ----

extern "C" int clock_gettime(clockid_t clock, timespec* time) noexcept {
  static const auto real = next<int (*)(clockid_t, timespec*)>("clock_gettime");
  const int result = real(clock, time);
  const bool wall = clock == CLOCK_REALTIME || clock == CLOCK_REALTIME_COARSE;
  if (result == 0 && wall) *time = timeOf(nanosecondsOf(*time) + wallOffset());
  return result;
}

extern "C" int gettimeofday(timeval* time, void* /*zone*/) noexcept {
  timespec now{};
  if (clock_gettime(CLOCK_REALTIME, &now) != 0) return -1;
  time->tv_sec = now.tv_sec;
  time->tv_usec = now.tv_nsec / 1000;
  return 0;
}

extern "C" time_t time(time_t* time) noexcept {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  if (time != nullptr) *time = now.tv_sec;
  return now.tv_sec;
}

extern "C" int pthread_cond_timedwait(pthread_cond_t* condition, pthread_mutex_t* mutex,
                                      const timespec* deadline) {
  using Wait = int (*)(pthread_cond_t*, pthread_mutex_t*, const timespec*);
  // Without a version, dlsym() finds one that is for another pthread_cond_t.
  static void* const versioned = dlvsym(RTLD_NEXT, "pthread_cond_timedwait", "GLIBC_2.3.2");
  static const auto real = versioned != nullptr ? reinterpret_cast<Wait>(versioned)
                                                : next<Wait>("pthread_cond_timedwait");
  if (deadline->tv_sec < kWallClock) return real(condition, mutex, deadline);
  return waitOnWallClock(*deadline,
                         [&](const timespec* part) { return real(condition, mutex, part); });
}

extern "C" int pthread_cond_clockwait(pthread_cond_t* condition, pthread_mutex_t* mutex,
                                      clockid_t clock, const timespec* deadline) {
  static const auto real =
      next<int (*)(pthread_cond_t*, pthread_mutex_t*, clockid_t, const timespec*)>(
          "pthread_cond_clockwait");
  if (clock != CLOCK_REALTIME) return real(condition, mutex, clock, deadline);
  return waitOnWallClock(*deadline,
                         [&](const timespec* part) { return real(condition, mutex, clock, part); });
}

// ---- files ----

// Some programs call it by one name, some by the other.
static int openFile(const char* name, const char* path, int flags, va_list arguments) {
  const mode_t mode = (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
  if (fails(isInFolder(path), &InjectedFaults::open_error)) return -1;
  return next<int (*)(const char*, int, ...)>(name)(path, flags, mode);
}

extern "C" int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const int file = openFile("open", path, flags, arguments);
  va_end(arguments);
  return file;
}

extern "C" int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const int file = openFile("open64", path, flags, arguments);
  va_end(arguments);
  return file;
}

extern "C" ssize_t read(int file, void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, void*, size_t)>("read");
  const bool armed = injected != nullptr && injected->read_error != 0;
  if (fails(armed && isInFolder(file), &InjectedFaults::read_error)) return -1;
  return real(file, data, size);
}

extern "C" ssize_t write(int file, const void* data, size_t size) {
  static const auto real = next<ssize_t (*)(int, const void*, size_t)>("write");
  const bool armed = injected != nullptr && injected->write_error != 0;
  if (fails(armed && isInFolder(file), &InjectedFaults::write_error)) return -1;
  return real(file, data, size);
}

extern "C" int fsync(int file) {
  static const auto real = next<int (*)(int)>("fsync");
  if (fails(isInFolder(file), &InjectedFaults::sync_error)) return -1;
  return real(file);
}

extern "C" int rename(const char* from, const char* to) noexcept {
  static const auto real = next<int (*)(const char*, const char*)>("rename");
  if (fails(isInFolder(to), &InjectedFaults::rename_error)) return -1;
  return real(from, to);
}

// ---- threads and memory ----

extern "C" int pthread_create(pthread_t* thread, const pthread_attr_t* attributes,
                              void* (*start)(void*), void* argument) noexcept {
  static const auto real =
      next<int (*)(pthread_t*, const pthread_attr_t*, void* (*)(void*), void*)>("pthread_create");
  const bool limited = injected != nullptr && injected->threads_left.load() >= 0;
  if (limited && injected->threads_left.fetch_sub(1) <= 0) {
    injected->threads_left.store(0);
    return EAGAIN;
  }
  return real(thread, attributes, start, argument);
}

// As the standard describes it: the new handler is called until there is memory.
void* operator new(std::size_t size) {
  for (;;) {
    void* memory = allocationFails() ? nullptr : std::malloc(size == 0 ? 1 : size);
    if (memory != nullptr) return memory;
    const std::new_handler handler = std::get_new_handler();
    if (handler == nullptr) throw std::bad_alloc();
    handler();
  }
}
void* operator new[](std::size_t size) { return operator new(size); }
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete[](void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t /*size*/) noexcept { std::free(memory); }
void operator delete[](void* memory, std::size_t /*size*/) noexcept { std::free(memory); }
