#include <gtest/gtest.h>

#include <chrono>
#include <future>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"

// What a watchdog asks.

namespace stepdriver {
namespace {

using namespace std::chrono_literals;
using test::Bench;
using test::linearAxis;

constexpr std::chrono::seconds kLongestResponse{20};

TEST(Responds, IsTrueAtRestInMotionAndAtAFault) {
  Bench bench({linearAxis("x")}, true, 1.0);
  EXPECT_TRUE(bench.machine->responds(kLongestResponse));
  const axis::Move move = bench.axis("x").moveTo(0.01);
  EXPECT_TRUE(bench.machine->responds(kLongestResponse));
  bench.machine->emergencyStop();
  bench.axis("x").wait(move);
  for (int i = 0; i < 100; ++i) EXPECT_TRUE(bench.machine->responds(kLongestResponse));
  bench.machine->shutdown();
  EXPECT_TRUE(bench.machine->responds(kLongestResponse));
}

TEST(Responds, IsTrueWithoutThreads) {
  EXPECT_TRUE(Bench({linearAxis("x")}).machine->responds(1ms));
}

TEST(Responds, IsFalseWhileTheThreadThatAllWaitForHangs) {
  machine::MachineOptions options;
  options.record_seconds = 1.0;
  const std::vector<config::AxisConfig> axes{linearAxis("x")};
  Bench bench(axes, Bench::rigAxes(axes), true, 1.0, options);
  std::promise<void> hangs;
  std::promise<void> released;
  // That thread calls it, and it must return at once.
  bench.machine->onFault([&] {
    hangs.set_value();
    released.get_future().wait();
  });
  const auto stop = std::async(std::launch::async, [&bench] { bench.machine->emergencyStop(); });
  hangs.get_future().wait();
  EXPECT_FALSE(bench.machine->responds(50ms));
  EXPECT_FALSE(bench.machine->responds(50ms));
  released.set_value();
  EXPECT_TRUE(bench.machine->responds(kLongestResponse));
  stop.wait();
}

}  // namespace
}  // namespace stepdriver
