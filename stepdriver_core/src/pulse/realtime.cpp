#include "stepdriver_core/pulse/realtime.h"

#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>

#include <cerrno>
#include <cstring>

#include "stepdriver_core/pulse/cpu_latency.h"

namespace stepdriver::pulse {
namespace {

std::string latencyText(int error) {
  if (error < 0) return "";
  if (error == 0) return "; processors kept awake";
  std::string text = std::string("; processors not kept awake: ") + CpuLatencyHold::kDevice;
  if (error == EACCES || error == EPERM) {
    return text +
           " is closed to this user: config/udev/60-stepdriver-gpio.rules opens it to the "
           "group realtime";
  }
  if (error == ENOENT) return text + " isn't there: this kernel or container hasn't got it";
  return text + " can't be held (" + std::strerror(error) + ")";
}

}  // namespace

int askForScheduler() {
  // Half of the lateness of a wake-up is the default slack of 50 us.
  prctl(PR_SET_TIMERSLACK, 1UL, 0, 0, 0);
  sched_param parameters{};
  parameters.sched_priority = kRealtimePriority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

int lockMemory() {
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0) return errno;
  if (limit.rlim_cur != RLIM_INFINITY) return EPERM;
  return mlockall(MCL_CURRENT | MCL_FUTURE) == 0 ? 0 : errno;
}

std::string RealtimeRights::text() const {
  if (scheduler_error < 0) return "real-time rights are not needed: the clock is virtual";
  std::string text = scheduler_error == 0
                         ? "SCHED_FIFO " + std::to_string(kRealtimePriority)
                         : "SCHED_FIFO refused (" + std::string(std::strerror(scheduler_error)) +
                               "): `@realtime - rtprio 98` in /etc/security/limits.d "
                               "allows it to the group realtime";
  text += memory_error == 0
              ? "; memory locked"
              : "; memory not locked: `@realtime - memlock unlimited` there allows it";
  return text + latencyText(latency_error);
}

}  // namespace stepdriver::pulse
