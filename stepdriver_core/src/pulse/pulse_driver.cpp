#include "stepdriver_core/pulse/pulse_driver.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cstring>

#include "stepdriver_core/error.h"

namespace stepdriver::pulse {
namespace {

constexpr int kPriority = 50;

int askForScheduler() {
  // Half of the lateness of a wake-up is the default slack of 50 us.
  prctl(PR_SET_TIMERSLACK, 1UL, 0, 0, 0);
  sched_param parameters{};
  parameters.sched_priority = kPriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

int lockMemory() {
  // Under a limit a locked process fails at its next allocation, wherever that is.
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0) return errno;
  if (limit.rlim_cur != RLIM_INFINITY) return EPERM;
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
}

}  // namespace

PulseDriver::PulseDriver(PulseEngine& engine, Clock& clock, bool threaded)
    : engine_(engine), clock_(clock) {
  if (!threaded) return;
  if (clock_.realtime()) lock_error_ = lockMemory();
  thread_ = std::thread([this] { run(); });
}

PulseDriver::~PulseDriver() { stop(); }

void PulseDriver::stop() {
  if (!thread_.joinable()) return;
  stopping_ = true;
  clock_.wake();
  thread_.join();
}

void PulseDriver::post(const Command& command) {
  const std::lock_guard<std::mutex> lock(posting_);
  waitFor([&] { return engine_.post(command); });
}

void PulseDriver::run() {
  pthread_setname_np(pthread_self(), "pulse");
  if (clock_.realtime()) scheduler_error_ = askForScheduler();
  while (!stopping_) clock_.waitUntil(engine_.serve());
}

void PulseDriver::waitFor(const std::function<bool()>& ready) {
  if (thread_.joinable()) {
    // Most waits are over within a few microseconds; one for a move may last.
    for (int i = 0; !ready(); ++i) {
      if (i < 50) {
        std::this_thread::yield();
      } else {
        std::this_thread::sleep_for(std::chrono::microseconds(std::min(2 * i, 1000)));
      }
    }
    return;
  }
  while (!ready()) {
    const Nanoseconds due = engine_.serve();
    if (ready()) return;
    if (due == kNever) throw Error("nothing is under way that could end this wait");
    clock_.waitUntil(due);
  }
}

void PulseDriver::advance(Nanoseconds time) {
  const Nanoseconds end = clock_.now() + time;
  for (;;) {
    const Nanoseconds due = engine_.serve();
    if (due > end && clock_.now() >= end) return;
    clock_.waitUntil(std::min(due, end));
  }
}

std::string PulseDriver::realtime() const {
  const int scheduler = scheduler_error_;
  const int memory = lock_error_;
  if (scheduler < 0) return "real-time rights are not needed: the clock is virtual";
  std::string text = scheduler == 0
                         ? "SCHED_FIFO " + std::to_string(kPriority)
                         : "SCHED_FIFO refused (" + std::string(std::strerror(scheduler)) +
                               "): `@realtime - rtprio 98` in /etc/security/limits.d "
                               "allows it to the group realtime";
  text += memory == 0 ? "; memory locked"
                      : "; memory not locked: `@realtime - memlock unlimited` there allows it";
  return text;
}

}  // namespace stepdriver::pulse
