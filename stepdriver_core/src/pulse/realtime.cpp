#include "pulse/realtime.h"

#include <fmt/format.h>
#include <link.h>
#include <pthread.h>
#include <sched.h>
#include <sys/mman.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <cstddef>
#include <cstring>

#include "pulse/cpu_latency.h"
#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::pulse {
namespace {

std::string latencyText(int error) {
  if (error < 0) return "";
  if (error == 0) return "; processors kept awake";
  std::string text = std::string("; processors not kept awake: ") + kCpuLatencyDevice;
  if (error == EACCES || error == EPERM) {
    return text +
           " is closed to this user: config/udev/60-stepdriver-gpio.rules opens it to the "
           "group realtime";
  }
  if (error == ENOENT) return text + " doesn't exist in this kernel or container";
  return fmt::format("{} can't be held ({})", text, std::strerror(error));
}

std::string processorText(int cpu, int error) {
  if (error < 0) return "";
  if (error == 0) return fmt::format("; only on processor {}", cpu);
  return fmt::format(
      "; not on processor {} ({}): realtime/cpu must be the number of a processor that is online "
      "and "
      "that this process may use, as in /sys/devices/system/cpu/online",
      cpu, std::strerror(error));
}

// The constants of the pulse thread's own code are smaller. This keeps out the tables of libraries
// that it doesn't call: ICU's, which the log library depends on, take 30 MB.
constexpr std::size_t kLargestConstants = 4 << 20;

/// Loads the code and the data of a program or library into memory, for dl_iterate_phdr().
/// @return 0, or the errno of the refusal.
int bringIn(dl_phdr_info* object, std::size_t /*size*/, void* /*data*/) {
  for (int i = 0; i < object->dlpi_phnum; ++i) {
    const ElfW(Phdr)& part = object->dlpi_phdr[i];
    if (part.p_type != PT_LOAD || part.p_memsz == 0) continue;
    const bool constants = (part.p_flags & (PF_X | PF_W)) == 0;
    if (constants && part.p_memsz > kLargestConstants) continue;
    // NOLINTNEXTLINE(performance-no-int-to-ptr): the loader says addresses as numbers
    const auto* const begin = reinterpret_cast<const void*>(object->dlpi_addr + part.p_vaddr);
    if (mlock(begin, part.p_memsz) != 0) return errno;
  }
  return 0;
}

/// [bytes] More than the pulse thread uses of its stack.
constexpr std::size_t kStackDepth = 64 << 10;

}  // namespace

int askForScheduler(int priority) {
  // The default slack of 50 us is half of the lateness of a wake-up.
  prctl(PR_SET_TIMERSLACK, 1UL, 0, 0, 0);
  sched_param parameters{};
  parameters.sched_priority = priority;
  return pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameters);
}

int stayOnProcessor(int cpu) {
  if (cpu < 0 || cpu >= CPU_SETSIZE) return EINVAL;
  cpu_set_t only;
  CPU_ZERO(&only);
  CPU_SET(static_cast<std::size_t>(cpu), &only);
  return pthread_setaffinity_np(pthread_self(), sizeof only, &only);
}

int lockMemory() {
  // Root may lift it, and any user may raise it up to the hard limit.
  const rlimit none{RLIM_INFINITY, RLIM_INFINITY};
  rlimit limit{};
  if (getrlimit(RLIMIT_MEMLOCK, &limit) != 0) return errno;
  if (limit.rlim_cur != RLIM_INFINITY && setrlimit(RLIMIT_MEMLOCK, &none) != 0) return errno;
  if (mlockall(MCL_CURRENT | MCL_FUTURE | MCL_ONFAULT) != 0) return errno;
  return dl_iterate_phdr(&bringIn, nullptr);
}

[[gnu::noinline]] void touchStack() {
  std::array<volatile char, kStackDepth> stack;
  const auto page = static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
  for (std::size_t i = 0; i < stack.size(); i += page) stack[i] = 0;
}

std::string RealtimeRights::text() const {
  if (scheduler_error < 0) return "virtual clock, no real-time priority needed";
  static_assert(kRealtimePriority == 50, "the limit below allows that priority, and no higher one");
  std::string text = scheduler_error == 0
                         ? fmt::format("SCHED_FIFO {}", kRealtimePriority)
                         : fmt::format(
                               "SCHED_FIFO refused ({}): `@realtime - rtprio 50` in "
                               "/etc/security/limits.d allows it to the group realtime",
                               std::strerror(scheduler_error));
  text += memory_error == 0 ? "; memory locked"
                            : fmt::format(
                                  "; memory not locked ({}): `@realtime - memlock unlimited` in "
                                  "/etc/security/limits.d allows it to the group realtime",
                                  std::strerror(memory_error));
  return text + latencyText(latency_error) + processorText(cpu, cpu_error);
}

}  // namespace stepdriver::pulse
