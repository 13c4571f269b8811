#include <gtest/gtest.h>

#include <cstddef>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "give_way.h"
#include "stepdriver_core/machine/machine.h"
#include "support/path_bench.h"
#include "support/refusal.h"

// A long path is planned for seconds. What comes meanwhile and ends its request also ends the plan.

namespace stepdriver {
namespace {

using test::PathRequest;

struct Ending {
  const char* name;
  std::function<void()> end;
  const char* why;
};

class InterruptedPlan : public test::PathBench {
 protected:
  void SetUp() override { restart(); }
  void restart() {
    config::AxisConfig x = plotterAxis("x");
    x.jerk = 20.0;
    build({x, plotterAxis("y")});
  }

  static PathRequest longPath() {
    PathRequest request = test::circle();
    const std::vector<test::PathSegment> turn = request.segments;
    for (int i = 1; i < 40; ++i) {
      request.segments.insert(request.segments.end(), turn.begin(), turn.end());
    }
    return request;
  }

  std::vector<Ending> endings() {
    return {
        {"emergency stop", [this] { machine().emergencyStop(); }, "emergency stop"},
        {"stop", [this] { machine().stop(); }, "it was stopped"},
        {"stop y", [this] { bench->axis("y").stop(); }, "it was stopped"},
        {"disable y", [this] { bench->axis("y").enable(false); }, "disabled"},
        {"shut down", [this] { machine().shutdown(); }, "the machine was shut down"},
    };
  }

  /// Plans, and ends that in its midst. @return how often the plan looked whether it is wanted
  /// after the end.
  template <typename Plan>
  std::size_t looksAfter(const Ending& ending, const Plan& plan) {
    std::size_t looks = 0;
    std::optional<std::size_t> ended;
    const Interruptible counting([&] {
      if (++looks == 20) {
        ending.end();
        ended = looks;
      }
      return false;
    });
    EXPECT_REFUSED(plan(), ending.why);
    EXPECT_TRUE(ended) << "it was planned too fast";
    return looks - ended.value_or(0);
  }
};

TEST_F(InterruptedPlan, OfAPathIsAnsweredAtOnce) {
  for (const Ending& ending : endings()) {
    SCOPED_TRACE(ending.name);
    restart();
    EXPECT_LE(looksAfter(ending, [this] { followPath(longPath()); }), 1U);
    EXPECT_EQ(bench->pulses("x"), 0);
  }
}

TEST_F(InterruptedPlan, OfAnAppendIsAnsweredAtOnce) {
  for (const Ending& ending : endings()) {
    SCOPED_TRACE(ending.name);
    restart();
    PathRequest first = test::circle();
    first.more_follows = true;
    const test::CoordinatedMove move = followPath(first);
    advance(0.1);
    const motion::PathAppend append{move.id(), longPath().segments, true};
    EXPECT_LE(looksAfter(ending, [&] { machine().appendPath(append); }), 1U);
    EXPECT_NE(machine().wait(move).end, axis::MoveEnd::kReached);
  }
}

TEST_F(InterruptedPlan, OfATrajectoryIsAnsweredAtOnce) {
  motion::TrajectoryRequest request{{"x", "y"}, {}};
  for (int i = 0; i < 30'000; ++i) {
    const double time = 0.02 * i;
    request.points.push_back({time, {0.02 * std::sin(time), 0.02 * std::sin(2.0 * time)}, {}, {}});
  }
  for (const Ending& ending : endings()) {
    SCOPED_TRACE(ending.name);
    restart();
    EXPECT_LE(looksAfter(ending, [&] { machine().followTrajectory(request); }), 1U);
    EXPECT_EQ(bench->pulses("x"), 0);
  }
}

}  // namespace
}  // namespace stepdriver
