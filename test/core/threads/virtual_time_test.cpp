#include <gtest/gtest.h>

#include <string>
#include <thread>

#include "support/homing_bench.h"
#include "support/refusal.h"

// A machine with threads on a clock that waits for nobody: each wait ends at once.

namespace stepdriver {
namespace {

using axis::HomingEnd;
using test::Bench;
using test::homingAxis;

// After the switch opens, 5 mm remain: the pulse thread completes them in less than a millisecond.
config::AxisConfig shortHoming(const std::string& name) {
  config::AxisConfig config = homingAxis(name);
  config.homing->max_travel = 0.005;
  config.homing->latch_speed = 0.0005;
  return config;
}

TEST(VirtualTime, DoesNotPassWhatASwitchSaysHoweverLateTheThreads) {
  Bench bench({shortHoming("x"), shortHoming("y")}, true, 0.0);
  for (const auto& axis : bench.machine->axes()) axis->setPosition(0.0);
  for (int i = 0; i < 40; ++i) {
    for (const auto& axis : bench.machine->axes()) {
      const axis::MoveResult moved = axis->wait(axis->moveTo(-0.097));
      ASSERT_EQ(moved.end, axis::MoveEnd::kReached) << moved.message;
    }
    for (const axis::HomingResult& result : bench.machine->home()) {
      ASSERT_EQ(result.end, HomingEnd::kHomed) << i << ": " << result.message;
      // The edge of the switch may come late; then its position is known to within a step.
      const double carriage = bench.report(result.axis).carriage / 1000.0;
      EXPECT_NEAR(result.position, carriage, 2.0 * test::kStep) << i << ", " << result.axis;
    }
  }
}

// Each axis has a client, so the machine often handles something of the other axis when a motion
// ends.
TEST(VirtualTime, ShowsAtOnceWhatAMotionThatEndedHasLeft) {
  Bench bench({shortHoming("x"), shortHoming("y")}, true, 0.0);
  const auto move_and_home = [](axis::Axis& axis) {
    axis.setPosition(0.0);
    for (int i = 0; i < 150 && !testing::Test::HasFailure(); ++i) {
      const axis::MoveResult moved = axis.wait(axis.moveTo(-0.0985));
      ASSERT_EQ(moved.end, axis::MoveEnd::kReached) << moved.message;
      const axis::AxisState after_move = axis.state();
      EXPECT_FALSE(after_move.moving) << i;
      EXPECT_EQ(after_move.position, moved.position) << i;
      const axis::HomingResult homed = axis.home();
      ASSERT_EQ(homed.end, HomingEnd::kHomed) << homed.message;
      const axis::AxisState after_homing = axis.state();
      EXPECT_TRUE(after_homing.homed) << i;
      EXPECT_EQ(after_homing.position, homed.position) << i;
    }
  };
  std::thread other([&] { move_and_home(bench.axis("y")); });
  move_and_home(bench.axis("x"));
  other.join();
}

// The caller and the pulse thread would wait on one clock, and its time could stand still for good.
TEST(VirtualTime, IsNotAdvancedByACallerIfThereAreThreads) {
  Bench bench({homingAxis("x")}, true, 1.0);
  EXPECT_REFUSED(bench.machine->advance(0.001), "only for a machine without threads");
}

}  // namespace
}  // namespace stepdriver
