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
#include <cstdint>
#include <cstdlib>
#include <cstring>
#include <memory>
#include <mutex>
#include <new>
#include <string>
#include <thread>
#include <vector>

#include "pulse/pulse_thread.h"
#include "support/plan_from_rest.h"
#include "support/watched_thread.h"

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

}  // namespace

extern "C" int pthread_mutex_lock(pthread_mutex_t* mutex) noexcept {
  if (is_watched) ++thread_calls->locks;
  // Until the functions are found, there is only one thread.
  return kLibraryLock == nullptr ? 0 : kLibraryLock(mutex);
}

namespace stepdriver::pulse {
namespace {

constexpr int kChannels = 3;

/// Checks that the test notices a misdeed of the pulse thread, done in a write. Deep calls are
/// allowed.
enum class Misdeed { kNone, kAllocation, kLock, kSystemCall, kNewMemory, kDeepCall };

/// Lines whose calls are an ioctl each, like those of a GPIO chip. The first write starts the watch
/// on its thread.
class WatchingLines : public gpio::Lines {
 public:
  explicit WatchingLines(Misdeed misdeed) : misdeed_(misdeed) {}

  int write(const gpio::LineWrite* /*writes*/, std::size_t /*count*/) noexcept override {
    if (!is_watched) {
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
  int waitForEdges(std::int64_t, gpio::EdgeEvent*, std::size_t) noexcept override { return 0; }
  void interrupt() noexcept override {}
  const std::string& outputName(int /*output*/) const override { return name_; }
  const std::string& inputName(int /*input*/) const override { return name_; }

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
  const std::string name_ = "a line";
};

/// A pulse thread on the steady clock, which gets an order with a new target every few
/// milliseconds.
class Retargeting {
 public:
  explicit Retargeting(Misdeed misdeed) : lines_(misdeed) {}

  // Waits until this many targets were taken; then pins, inputs, and an emergency stop.
  void run(int targets) {
    for (int taken = 0; taken < targets;) {
      if (retarget(taken % 2 == 0 ? 4'000 : -3'000)) ++taken;
      engine_.inputsChanged();
    }
    while (engine_.channel(0).pulses < 200) pause();
    engine_.emergencyStop();
    while (engine_.channel(0).following != 0) pause();
    while (engine_.stopsServed() == 0) pause();
    engine_.clearEmergencyStop(engine_.stopsServed());
    Command order;
    order.kind = Command::Kind::kReserve;
    order.serial = ++attempts_;
    post(order);
    order.kind = Command::Kind::kRelease;
    order.serial = ++attempts_;
    post(order);
    while (engine_.channel(0).accepted != attempts_) pause();
    test::notePageFaults();
    thread_calls->memory_error = thread_.rights().memory_error;
  }

 private:
  // The ring must be there before the thread begins.
  PulseEngine& recorded() {
    engine_.recordTo(ring_);
    return engine_;
  }
  void post(const Command& command) {
    while (!engine_.post(command)) pause();
  }
  static void pause() { std::this_thread::sleep_for(std::chrono::milliseconds(1)); }

  static std::vector<ChannelConfig> configs() {
    std::vector<ChannelConfig> configs(kChannels);
    for (int i = 0; i < kChannels; ++i) {
      ChannelConfig& config = configs[static_cast<std::size_t>(i)];
      config.step.line = 2 * i;
      config.dir.line = 2 * i + 1;
      config.endstop_min = config.endstop_max = Signal{i, true};
      config.step_high = config.step_low = 2'000;
      config.dir_setup = config.dir_hold = 1'000;
    }
    return configs;
  }

  // @return whether it happened in time.
  bool retarget(std::int64_t target) {
    const Nanoseconds start = (clock_.now() - engine_.state().slipped) + 20'000'000;
    // On a machine that stalls, the motion may already be over.
    const ChannelState now = engine_.channel(0);
    const bool rests = now.following == 0;
    const motion::MotionState state =
        rests ? motion::MotionState{motion::fromInteger(now.count)} : followed_->stateAt(start);
    profiles_.push_back(std::make_unique<motion::Profile>(
        motion::planMove(start, state, target, {0.0, 5'000.0, 50'000.0, 50'000.0, 2e6}).profile));
    follows_.push_back(std::vector<Follow>());
    const std::uint64_t continues = rests ? 0 : serial_;
    const std::uint64_t ordered = ++attempts_;
    for (int i = 0; i < kChannels; ++i) {
      follows_.back().push_back({i, ordered, profiles_.back().get(), continues, 0, 7});
    }
    Command command;
    command.follows = follows_.back().data();
    command.follow_count = follows_.back().size();
    post(command);
    while (engine_.channel(0).taken < ordered) pause();
    if (engine_.channel(0).accepted != ordered) return false;
    followed_ = profiles_.back().get();
    serial_ = ordered;
    return true;
  }

  WatchingLines lines_;
  SteadyClock clock_;
  PinRing ring_{std::vector<bool>(std::size_t{2} * kChannels), 1'000};
  PulseEngine engine_{lines_, clock_, configs(), 60'000'000'000};
  PulseThread thread_{recorded(), clock_};
  std::vector<std::unique_ptr<motion::Profile>> profiles_;
  std::vector<std::vector<Follow>> follows_;
  const motion::Profile* followed_ = nullptr;
  std::uint64_t serial_ = 0;  // of the last one that was taken
  std::uint64_t attempts_ = 0;
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
      auto* retargeting = new Retargeting(misdeed);  // its thread can't end after this
      retargeting->run(20);
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
  if (thread_calls->memory_error != 0) {
    GTEST_SKIP() << "memory can't be locked here: " << std::strerror(thread_calls->memory_error);
  }
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
}  // namespace stepdriver::pulse
