#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <cstdint>
#include <memory>
#include <string>
#include <thread>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/fake_hardware.h"

// A computer that has no time for the pulses: the timeline slides by seconds, and eight busy loops
// compete with the threads of a machine in real time.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::Bench;
using test::linearAxis;

TEST(SlidTime, OfSecondsLosesNoStepBunchesNoneAndIsInTheDuration) {
  test::LateClock clock;
  test::SlowBackend backend(clock);
  int waits = 0;
  const auto late = [&waits]() -> pulse::Nanoseconds {
    return ++waits % 50 == 0 ? 200'000'000 : 0;
  };
  machine::MachineOptions options;
  options.late_steps = 0.0;
  test::UnthreadedMachine machine({linearAxis("x")}, backend, clock, options);
  clock.spun = clock.slept = late;
  axis::Axis& x = machine.axis("x");
  // At a speed from which the motor can start again: 800 steps/s for a second.
  const axis::Move move = x.moveTo(0.01, false, 0.01);
  const axis::MoveResult result = x.wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  const double slipped = machine.figures().slipped;
  EXPECT_GT(slipped, 3.0);
  EXPECT_NEAR(result.duration, move.duration + slipped, 0.25);
  EXPECT_DOUBLE_EQ(x.state().position, 0.01);
  EXPECT_EQ(x.state().fault, "");

  std::vector<pulse::Nanoseconds> rises;
  for (const test::SlowBackend::Write& write : backend.written) {
    if (write.line == "x.step" && write.edge && write.level) rises.push_back(write.time);
  }
  ASSERT_EQ(rises.size(), 800U);
  for (std::size_t k = 1; k < rises.size(); ++k) {
    EXPECT_GE(rises[k] - rises[k - 1], 1'250'000 * 3 / 4) << k;
  }
}

/// Threads that do nothing but use up the processors.
class BusyLoops {
 public:
  explicit BusyLoops(int count) {
    while (count-- > 0) {
      threads_.emplace_back([this] {
        while (!ended_) ++turns_;
      });
    }
  }
  ~BusyLoops() {
    ended_ = true;
    for (std::thread& thread : threads_) thread.join();
  }
  BusyLoops(const BusyLoops&) = delete;
  BusyLoops& operator=(const BusyLoops&) = delete;

 private:
  std::atomic<bool> ended_{false};
  std::atomic<std::int64_t> turns_{0};
  std::vector<std::thread> threads_;
};

class BusyHost : public testing::Test {
 protected:
  BusyHost()
      : axes_{linearAxis("x"), linearAxis("y")},
        rig_(Bench::rigAxes(axes_)),
        backend_(rig_, [this] { return clock_.now(); }),
        machine_(axes_, backend_, clock_) {}

  void expectPositionsOfThePulses() {
    for (const char* name : {"x", "y"}) {
      const sim::RigAxisReport seen = rig_.report(name);
      const std::int64_t pulses = seen.pulses_forward - seen.pulses_backward;
      EXPECT_DOUBLE_EQ(machine_.axis(name).state().position, static_cast<double>(pulses) / 80'000.0)
          << name;
      EXPECT_EQ(test::violationsOf(seen), "") << name;
    }
  }

  pulse::SteadyClock clock_;
  std::vector<config::AxisConfig> axes_;
  sim::Rig rig_;
  gpio::SimulatedBackend backend_;
  machine::Machine machine_;
  const BusyLoops loops_{8};
};

// The motor can start again at this speed: a late pulse only puts off the rest.
TEST_F(BusyHost, LosesNoStepOfASlowLine) {
  const machine::CoordinatedMove line =
      machine_.moveLine({{"x", "y"}, {0.008, 0.004}, false, 0.01});
  const machine::CoordinatedResult result = machine_.wait(line);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_EQ(rig_.report("x").pulses_forward, 640);
  EXPECT_EQ(rig_.report("y").pulses_forward, 320);
  expectPositionsOfThePulses();
}

TEST_F(BusyHost, EndsAFastMoveAtItsTargetOrByAFaultThatSaysItWasLate) {
  machine_.axis("x").setPosition(0.0);
  const axis::MoveResult result = machine_.axis("x").wait(machine_.axis("x").moveTo(0.05));
  const axis::AxisState state = machine_.axis("x").state();
  if (result.end == MoveEnd::kReached) {
    EXPECT_EQ(rig_.report("x").pulses_forward, 4000);
    EXPECT_TRUE(state.position_valid);
  } else {
    EXPECT_EQ(result.end, MoveEnd::kFault) << result.message;
    EXPECT_NE(state.fault.find("late"), std::string::npos) << state.fault;
    EXPECT_FALSE(state.position_valid);
  }
  EXPECT_FALSE(state.moving);
  expectPositionsOfThePulses();
}

TEST_F(BusyHost, HoldsUpNoStop) {
  machine_.axis("x").jog(0.01);
  machine_.axis("y").jog(-0.01);
  while (rig_.report("x").pulses_forward == 0 || rig_.report("y").pulses_backward == 0) {
    std::this_thread::yield();
  }
  machine_.emergencyStop();
  const std::int64_t x = rig_.report("x").pulses_forward;
  const std::int64_t y = rig_.report("y").pulses_backward;
  machine_.recover();
  EXPECT_EQ(rig_.report("x").pulses_forward, x);
  EXPECT_EQ(rig_.report("y").pulses_backward, y);
  expectPositionsOfThePulses();
}

}  // namespace
}  // namespace stepdriver
