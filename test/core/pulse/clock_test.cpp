#include "stepdriver_core/pulse/clock.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <thread>

namespace stepdriver::pulse {
namespace {

TEST(SteadyClock, NeverWakesEarly) {
  SteadyClock clock;
  for (const Nanoseconds wait : {0, 1'000, 50'000, 300'000, 2'000'000}) {
    const Nanoseconds time = clock.now() + wait;
    clock.waitUntil(time);
    EXPECT_GE(clock.now(), time) << "waited for " << wait << " ns";
  }
}

TEST(SteadyClock, EndsItsWaitAtAWake) {
  SteadyClock clock;
  std::thread waker([&clock] { clock.wake(); });
  clock.waitUntil(kNever);
  waker.join();
  clock.wake();
  clock.waitUntil(kNever);  // the wake came before the wait
}

TEST(VirtualClock, GoesFromEventToEventExactly) {
  VirtualClock clock;
  EXPECT_EQ(clock.now(), 0);
  clock.waitUntil(123'456'789'012'345);
  EXPECT_EQ(clock.now(), 123'456'789'012'345);
  clock.waitUntil(5);  // in the past
  EXPECT_EQ(clock.now(), 123'456'789'012'345);
}

TEST(VirtualClock, StandsStillAfterAWake) {
  VirtualClock clock;
  clock.wake();
  clock.waitUntil(1'000'000);
  EXPECT_EQ(clock.now(), 0);
  clock.waitUntil(1'000'000);
  EXPECT_EQ(clock.now(), 1'000'000);
}

TEST(VirtualClock, IsNotLateAfterAHold) {
  VirtualClock clock(1.0);
  const Nanoseconds due = 1'000'000;
  clock.hold();
  std::thread waiter([&] { clock.waitUntil(due); });
  std::this_thread::sleep_for(std::chrono::nanoseconds(VirtualClock::kStall + 200'000'000));
  clock.release();
  waiter.join();
  EXPECT_EQ(clock.now(), due);
}

// The process whose clock is held while it is suspended: tells its parent that it is ready, and
// continues when the parent says so.
[[noreturn]] void beSuspendedInAHold(int ready, int go) {
  VirtualClock clock(1.0);
  const Nanoseconds due = 1'000'000;
  clock.hold();
  std::thread waiter([&] { clock.waitUntil(due); });
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  char byte = 0;
  const bool told = write(ready, &byte, 1) == 1 && read(go, &byte, 1) == 1;
  std::this_thread::sleep_for(std::chrono::milliseconds(300));
  clock.release();
  waiter.join();
  _exit(told && clock.now() >= due + VirtualClock::kStall ? 0 : 1);
}

TEST(VirtualClock, IsLateIfItsProcessIsSuspendedInAHold) {
  std::array<int, 2> ready{};
  std::array<int, 2> go{};
  ASSERT_EQ(pipe(ready.data()), 0);
  ASSERT_EQ(pipe(go.data()), 0);
  const pid_t child = fork();
  ASSERT_GE(child, 0);
  if (child == 0) beSuspendedInAHold(ready[1], go[0]);
  close(ready[1]);
  close(go[0]);
  char byte = 0;
  ASSERT_EQ(read(ready[0], &byte, 1), 1);
  ASSERT_EQ(kill(child, SIGSTOP), 0);
  std::this_thread::sleep_for(std::chrono::nanoseconds(VirtualClock::kStall + 500'000'000));
  ASSERT_EQ(kill(child, SIGCONT), 0);
  ASSERT_EQ(write(go[1], &byte, 1), 1);
  int status = 0;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status));
  EXPECT_EQ(WEXITSTATUS(status), 0);
  close(ready[0]);
  close(go[1]);
}

TEST(VirtualClock, IsNeverLateBecauseItsThreadIsSlow) {
  VirtualClock clock(1e6);  // a pace that no computer can keep
  const auto begin = std::chrono::steady_clock::now();
  auto last = begin;
  for (Nanoseconds time = 1'000; last - begin < std::chrono::milliseconds(1200); time += 1'000) {
    clock.waitUntil(time);
    const auto now = std::chrono::steady_clock::now();
    if (now - last > std::chrono::milliseconds(900)) return;  // this computer stalled
    last = now;
    ASSERT_EQ(clock.now(), time);
  }
}

TEST(VirtualClock, StandsStillWhileItIsHeld) {
  for (const double speed : {0.0, 1000.0}) {
    VirtualClock clock(speed);
    std::atomic<bool> arrived{false};
    Nanoseconds held = 0;
    std::thread waiter;
    {
      const ClockHold hold(clock);
      held = clock.now();
      waiter = std::thread([&] {
        clock.waitUntil(held + 1'000);
        arrived = true;
      });
      for (int i = 0; i < 1000; ++i) {
        ASSERT_EQ(clock.now(), held);
        ASSERT_FALSE(arrived);
        std::this_thread::yield();
      }
    }
    waiter.join();
    EXPECT_GE(clock.now(), held + 1'000);
  }
}

TEST(VirtualClock, PacedNeverPassesTheEventThatIsWaitedFor) {
  VirtualClock clock(1e6);  // a wall nanosecond is a virtual millisecond: the pace is far ahead
  std::atomic<bool> done{false};
  std::atomic<Nanoseconds> awaited{0};
  std::thread waiter([&] {
    for (Nanoseconds time = 1; time <= 2000; ++time) {
      awaited = time;
      clock.waitUntil(time);
      ASSERT_EQ(clock.now(), time);
    }
    done = true;
  });
  while (!done) {
    const Nanoseconds now = clock.now();
    ASSERT_LE(now, awaited);
  }
  waiter.join();
}

TEST(VirtualClock, PacedGoesOnWhileThereIsNothingToWaitFor) {
  VirtualClock clock(10.0);
  std::thread waiter([&] { clock.waitUntil(kNever); });
  while (clock.now() < 1'000'000) std::this_thread::yield();
  clock.wake();
  waiter.join();
  EXPECT_GE(clock.now(), 1'000'000);
}

}  // namespace
}  // namespace stepdriver::pulse
