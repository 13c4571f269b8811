#include <gtest/gtest.h>

#include <cstddef>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/bench.h"
#include "support/fake_hardware.h"

namespace stepdriver {
namespace {

using test::kStep;

/// A machine of x and y. Every 50th write takes longer than a step, so the timeline slides.
class LateMove : public testing::Test {
 protected:
  LateMove() {
    backend.write_cost = [this] { return ++writes % 50 == 0 ? 1'300'000 : 0; };
    std::vector<config::AxisConfig> axes{test::linearAxis("x"), test::linearAxis("y")};
    for (config::AxisConfig& axis : axes) {
      axis.start_speed = axis.max_speed;
      axis.endstop_min.reset();
      axis.endstop_max.reset();
    }
    machine.emplace(axes, backend, clock);
    backend.written.clear();
  }

  /// [s] From the first rising edge of STEP to the last one.
  double timeOfEdges(const std::string& line) const {
    std::vector<pulse::Nanoseconds> times;
    for (const test::SlowBackend::Write& write : backend.written) {
      if (write.line == line && write.edge && write.level) times.push_back(write.time);
    }
    return static_cast<double>(times.back() - times.front()) * 1e-9;
  }

  std::size_t writes = 0;
  test::LateClock clock;
  test::SlowBackend backend{clock};
  std::optional<test::UnthreadedMachine> machine;
};

// From the beginning to the first edge, from the last edge to the end, and one late write.
constexpr double kLatestEnd = 1.8e-3;  // [s]

TEST_F(LateMove, LastsAsLongAsItsEdges) {
  axis::Axis& x = machine->axis("x");
  const axis::Move move = x.moveTo(4000.0 * kStep);
  const axis::MoveResult result = x.wait(move);
  ASSERT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_GT(machine->figures().slips, 50U);
  EXPECT_GT(result.duration, move.duration + 0.05);
  EXPECT_NEAR(result.duration, timeOfEdges("x.step"), kLatestEnd);
}

TEST_F(LateMove, DoesNotCountWhatSlidBeforeIt) {
  machine->axis("x").wait(machine->axis("x").moveTo(4000.0 * kStep));
  backend.write_cost = [] { return 0; };
  axis::Axis& y = machine->axis("y");
  const axis::Move move = y.moveTo(4000.0 * kStep);
  EXPECT_NEAR(y.wait(move).duration, move.duration, 1e-6);
}

TEST_F(LateMove, OfALineLastsAsLongAsItsEdges) {
  const auto line = machine->moveLine({{"x", "y"}, {4000.0 * kStep, 1000.0 * kStep}});
  const machine::CoordinatedResult result = machine->wait(line);
  ASSERT_EQ(result.end, axis::MoveEnd::kReached) << result.message;
  EXPECT_GT(result.duration, line.duration + 0.05);
  EXPECT_NEAR(result.duration, timeOfEdges("x.step"), kLatestEnd);
}

}  // namespace
}  // namespace stepdriver
