#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>
#include <vector>

#include "support/refusal.h"
#include "support/trajectory_bench.h"

// A trajectory of one point that has only positions is a move from rest to rest in its time.

namespace stepdriver {
namespace {

using axis::MoveEnd;
using test::trajectoryAxis;

class LonePoint : public test::TrajectoryBench {
 protected:
  /// [m/s] The highest speed of x, from step to step.
  double highestSpeed() {
    const auto seen = crossings("x");
    double highest = 0.0;
    for (std::size_t i = 1; i < seen.size(); ++i) {
      const double way = std::abs(seen[i].position - seen[i - 1].position) / 1000.0;
      highest = std::max(highest,
                         way / (static_cast<double>(seen[i].time_ns - seen[i - 1].time_ns) * 1e-9));
    }
    return highest;
  }
};

TEST_F(LonePoint, IsReachedInItsTime) {
  const auto move = follow({{"x", "y"}, {{2.0, {1.0, -0.5}, {}, {}}}});
  EXPECT_NEAR(move.duration, 2.0, 1e-6);
  const auto result = machine().wait(move);
  EXPECT_EQ(result.end, MoveEnd::kReached) << result.message;
  EXPECT_NEAR(result.duration, 2.0, 1e-6);
  EXPECT_EQ(state("x").position, 1.0);
  EXPECT_EQ(state("y").position, -0.5);
  expectClean();
}

TEST_F(LonePoint, IsReachedInTheShortestTimeThatTheLimitsAllow) {
  // 2 m/s and 10 m/s^2: 1 m in 0.7 s.
  const auto move = follow({{"x"}, {{0.7, {1.0}, {}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_LT(highestSpeed(), 2.001);
  expectClean();
}

TEST_F(LonePoint, IsRefusedWithTheShortestTime) {
  EXPECT_EQ(test::refusal([&] {
              follow({{"x"}, {{0.6, {1.0}, {}, {}}}});
            }),
            "x: the target can't be reached in 0.6 s; the limits of the axes allow 0.7 s, which it "
            "takes with allow_slower");
  EXPECT_EQ(bench->pulses("x"), 0);
}

TEST_F(LonePoint, IsReachedMoreSlowlyIfThatIsAllowed) {
  const auto move = follow({{"x"}, {{0.6, {1.0}, {}, {}}}, true});
  EXPECT_NEAR(move.duration, 0.7, 1e-6);
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(state("x").position, 1.0);
  expectClean();
}

TEST_F(LonePoint, IsRefusedBeyondTheSoftLimits) {
  const std::string why = test::refusal([&] { follow({{"x"}, {{2.0, {-6.0}, {}, {}}}}); });
  EXPECT_NE(why.find("min_position"), std::string::npos) << why;
}

TEST_F(LonePoint, KeepsToTheJerkLimit) {
  std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
  axes[0].jerk = 50.0;
  build(axes);
  // 2 m/s, 10 m/s^2, 50 m/s^3: four phases of jerk of 0.2 s each.
  const auto move = follow({{"x"}, {{0.9, {1.0}, {}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(state("x").position, 1.0);
  const std::string why = test::refusal([&] { follow({{"x"}, {{0.8, {0.0}, {}, {}}}}); });
  EXPECT_NE(why.find("allow 0.9 s"), std::string::npos) << why;
}

TEST_F(LonePoint, TakesUpTheBacklashOnItsWay) {
  std::vector<config::AxisConfig> axes{trajectoryAxis("x"), trajectoryAxis("y")};
  axes[0].backlash = 0.02;
  build(axes);
  for (const double target : {0.5, 0.2, 0.2, 0.6}) {
    const auto move = follow({{"x"}, {{1.0, {target}, {}, {}}}});
    EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
    EXPECT_NEAR(state("x").position, target, 1e-12);
  }
  expectClean();
}

TEST_F(LonePoint, TakesOverFromAMotionWithoutAJump) {
  bench->axis("x").moveTo(2.0);
  advance(0.5);
  const auto move = follow({{"x"}, {{1.5, {1.5}, {}, {}}}});
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kReached);
  EXPECT_EQ(state("x").position, 1.5);
  EXPECT_LT(highestSpeed(), 2.02);
  expectClean();
}

TEST_F(LonePoint, IsStoppedAndHeldOnItsWay) {
  const auto move = follow({{"x", "y"}, {{2.0, {1.0, -0.5}, {}, {}}}});
  advance(0.7);
  machine().hold();
  awaitRest();
  EXPECT_NEAR(state("x").position, -2.0 * state("y").position, 2e-3);
  machine().resume();
  advance(0.3);
  machine().stop();
  awaitRest();
  EXPECT_EQ(machine().wait(move).end, MoveEnd::kStopped);
  EXPECT_NEAR(state("x").position, -2.0 * state("y").position, 2e-3);
  expectClean();
}

}  // namespace
}  // namespace stepdriver
