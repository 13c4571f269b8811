#include <dlfcn.h>
#include <gtest/gtest.h>
#include <pthread.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <iostream>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/tmc_axis.h"
#include "support/watched_thread.h"
#include "support/wired_stream.h"

using stepdriver::test::is_watched;
using stepdriver::test::thread_calls;

// Replace the library's functions in the whole program.
[[gnu::noinline]] void* operator new(std::size_t size) {
  if (is_watched) ++thread_calls->allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* memory) noexcept {
  if (is_watched) ++thread_calls->allocations;
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*size*/) noexcept { operator delete(memory); }

namespace {

using LockCall = int (*)(pthread_mutex_t*);
const LockCall kLibraryLock = reinterpret_cast<LockCall>(dlsym(RTLD_NEXT, "pthread_mutex_lock"));
// A condition variable has a lock of its own.
using WakeCall = int (*)(pthread_cond_t*);
const WakeCall kLibraryWake = reinterpret_cast<WakeCall>(dlsym(RTLD_NEXT, "pthread_cond_signal"));

}  // namespace

extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  if (is_watched) ++thread_calls->locks;
  // Until the functions are found, there is only one thread.
  return kLibraryLock == nullptr ? 0 : kLibraryLock(mutex);
}

extern "C" int pthread_cond_signal(pthread_cond_t* condition) noexcept {
  if (is_watched) ++thread_calls->locks;
  return kLibraryWake == nullptr ? 0 : kLibraryWake(condition);
}

namespace stepdriver::machine {
namespace {

/// Checks that the test notices a misdeed of the pulse thread, done in a write. Deep calls are
/// allowed.
enum class Misdeed { kNone, kAllocation, kLock, kSystemCall, kNewMemory, kDeepCall };

bool isPulseThread() {
  std::array<char, 16> name{};
  pthread_getname_np(pthread_self(), name.data(), name.size());
  return std::string(name.data()) == "pulse";
}

/// Lines whose calls are an ioctl each, like those of a GPIO chip. The first write of the pulse
/// thread starts the watch on it.
class WatchingLines : public gpio::Lines {
 public:
  WatchingLines(Misdeed misdeed, const std::vector<gpio::OutputRequest>& outputs,
                const std::vector<gpio::InputRequest>& inputs)
      : misdeed_(misdeed) {
    for (const gpio::OutputRequest& output : outputs) outputs_.push_back(output.line);
    for (const gpio::InputRequest& input : inputs) inputs_.push_back(input.line);
  }

  int write(const gpio::LineWrite* /*writes*/, std::size_t /*count*/) noexcept override {
    if (!is_watched) {
      if (!isPulseThread()) return 0;
      allocate();  // its first call makes system calls
      test::watchThisThread();
    } else if (misdeed_ == Misdeed::kDeepCall) {
      callDeeply();
    }
    ioctl(-1, 0);
    if (misdeed_ == Misdeed::kAllocation) allocate();
    if (misdeed_ == Misdeed::kLock) const std::lock_guard<std::mutex> lock(mutex_);
    if (misdeed_ == Misdeed::kSystemCall) syscall(SYS_getppid);
    if (misdeed_ == Misdeed::kNewMemory) {
      new_memory_[(kPage * ++pages_) % kNewMemory] = 1;
    }
    return 0;
  }
  int read(int /*input*/) noexcept override {
    ioctl(-1, 0);
    return 0;
  }
  int waitForEdges(std::int64_t timeout_ns, gpio::EdgeEvent*, std::size_t) noexcept override {
    if (timeout_ns > 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
    return 0;
  }
  void interrupt() noexcept override {}
  const std::string& outputName(int output) const override {
    return outputs_[static_cast<std::size_t>(output)];
  }
  const std::string& inputName(int input) const override {
    return inputs_[static_cast<std::size_t>(input)];
  }

 private:
  static constexpr std::size_t kPage = 4096;
  static constexpr std::size_t kNewMemory = 16 << 20;

  static void allocate() { delete new int(7); }
  [[gnu::noinline]] static void callDeeply() {
    std::array<volatile char, 10 * kPage> stack;
    for (std::size_t i = 0; i < stack.size(); i += kPage) stack[i] = 1;
  }

  const Misdeed misdeed_;
  char* const new_memory_ = static_cast<char*>(
      mmap(nullptr, kNewMemory, PROT_READ | PROT_WRITE, MAP_PRIVATE | MAP_ANONYMOUS, -1, 0));
  std::size_t pages_ = 0;
  std::mutex mutex_;
  std::vector<std::string> outputs_;
  std::vector<std::string> inputs_;
};

class WatchingBackend : public gpio::Backend {
 public:
  explicit WatchingBackend(Misdeed misdeed) : misdeed_(misdeed) { wire_.add(0); }
  std::unique_ptr<gpio::Lines> request(const std::vector<gpio::OutputRequest>& outputs,
                                       const std::vector<gpio::InputRequest>& inputs) override {
    return std::make_unique<WatchingLines>(misdeed_, outputs, inputs);
  }
  SerialExchange simulatedSerial(const std::string& /*port*/) override {
    return [this](const std::uint8_t* bytes, std::size_t count, bool pause) {
      std::unique_lock<std::mutex> lock(mutex_);
      fed_.wait(lock, [this] { return !starves_; });
      if (pause) wire_.wire.pause();
      return wire_.wire.send(bytes, count);
    };
  }
  /// From now on the thread of the serial port gets no further, or it does again.
  void starve(bool starves) {
    const std::lock_guard<std::mutex> lock(mutex_);
    starves_ = starves;
    fed_.notify_all();
  }

 private:
  const Misdeed misdeed_;
  test::WiredStream wire_;
  std::mutex mutex_;
  std::condition_variable fed_;
  bool starves_ = false;
};

/// A machine on the steady clock whose axes get new targets every few milliseconds, while its pulse
/// thread is watched.
class BusyMachine {
 public:
  explicit BusyMachine(Misdeed misdeed)
      : backend_(misdeed), machine_(axes(), backend_, clock_, options()) {}

  // All that a pulse thread does: pulses, targets that follow each other, pins, inputs, stops. The
  // thread of a driver's UART is starved meanwhile.
  void run() {
    while (!machine_.axis("y").state().drivers->front().is_set_up) pause();
    backend_.starve(true);
    for (int i = 0; i < 20; ++i) {
      for (const auto& axis : machine_.axes()) axis->moveTo(i % 2 == 0 ? 0.004 : -0.003);
      (void)machine_.jog({{"x", 0.01, {}}});
      awaitPulses(10);
    }
    machine_.stop();
    machine_.axis("y").moveTo(0.1, true);
    awaitPulses(200);
    backend_.starve(false);
    machine_.emergencyStop();
    machine_.recover();
    for (const auto& axis : machine_.axes()) {
      axis->enable(true);
      axis->setMicrosteps(8);
      axis->moveTo(0.0, true);
    }
    test::notePageFaults();
    thread_calls->memory_locked =
        machine_.figures().realtime.find("; memory locked") != std::string::npos;
  }

 private:
  static std::vector<config::AxisConfig> axes() {
    std::vector<config::AxisConfig> axes;
    for (const char* name : {"x", "y", "z"}) {
      axes.push_back(name == std::string("y") ? test::tmcAxis(name)
                                              : test::linearAxis(name, 80'000.0, 0.06, 0.6));
      axes.back().max_speed = 0.06;
      axes.back().acceleration = axes.back().deceleration = 0.6;
      axes.back().jerk = 25.0;
      axes.back().endstop_min->active_level = axes.back().endstop_max->active_level = true;
      axes.back().align_on_microstep_change = true;
    }
    return axes;
  }
  static MachineOptions options() {
    MachineOptions options;
    options.emergency_stop = config::InputSwitch{"emergency_stop", true};
    options.heartbeat = HeartbeatConfig{};
    options.heartbeat->line = "heartbeat";
    options.record_seconds = 1.0;
    options.max_lateness = 60.0;
    return options;
  }

  // More pulses than now.
  void awaitPulses(std::uint64_t more) {
    const std::uint64_t before = machine_.figures().pulses;
    while (machine_.figures().pulses < before + more) pause();
  }
  static void pause() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

  WatchingBackend backend_;
  pulse::SteadyClock clock_;
  Machine machine_;
};

/// Runs the misdeed in a process of its own, because the filter ends the process.
class PulseThreadCalls : public testing::Test {
 protected:
  void SetUp() override {
    void* memory = mmap(nullptr, sizeof(test::ThreadCalls), PROT_READ | PROT_WRITE,
                        MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    ASSERT_NE(memory, MAP_FAILED);
    thread_calls = new (memory) test::ThreadCalls;
  }
  void TearDown() override { munmap(thread_calls, sizeof(test::ThreadCalls)); }

  static void run(Misdeed misdeed) {
    const pid_t child = fork();
    ASSERT_GE(child, 0);
    if (child == 0) {
      auto* machine = new BusyMachine(misdeed);  // its thread can't end after this
      try {
        machine->run();
      } catch (const Error& error) {
        std::cerr << error.what() << '\n';
        _exit(1);
      }
      _exit(0);
    }
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 0) << "status " << status;
  }
};

TEST_F(PulseThreadCalls, AreTheWaitAndTheLinesAlone) {
  ASSERT_NO_FATAL_FAILURE(run(Misdeed::kNone));
  EXPECT_EQ(thread_calls->allocations, 0U);
  EXPECT_EQ(thread_calls->locks, 0U);
  if (thread_calls->filter_error != 0) {
    GTEST_SKIP() << "the system calls weren't counted: seccomp is refused here ("
                 << std::strerror(thread_calls->filter_error) << ")";
  }
  EXPECT_EQ(thread_calls->system_calls, 0U)
      << "the last one has the number " << thread_calls->last_system_call;
}

TEST_F(PulseThreadCalls, TouchNoMemoryThatIsMissing) {
  ASSERT_NO_FATAL_FAILURE(run(Misdeed::kDeepCall));
  if (!thread_calls->memory_locked) GTEST_SKIP() << "memory can't be locked here";
  EXPECT_EQ(thread_calls->page_faults, 0);
}

TEST_F(PulseThreadCalls, WouldBeSeen) {
  ASSERT_NO_FATAL_FAILURE(run(Misdeed::kAllocation));
  EXPECT_GT(thread_calls->allocations, 100U);
  EXPECT_EQ(thread_calls->locks, 0U);
  ASSERT_NO_FATAL_FAILURE(run(Misdeed::kLock));
  EXPECT_GT(thread_calls->locks, 100U);
  EXPECT_EQ(thread_calls->system_calls, 0U);
  ASSERT_NO_FATAL_FAILURE(run(Misdeed::kSystemCall));
  if (thread_calls->filter_error == 0) {
    EXPECT_GT(thread_calls->system_calls, 100U);
    EXPECT_EQ(thread_calls->last_system_call, SYS_getppid);
  }
  ASSERT_NO_FATAL_FAILURE(run(Misdeed::kNewMemory));
  EXPECT_GT(thread_calls->page_faults, 100);
}

}  // namespace
}  // namespace stepdriver::machine
