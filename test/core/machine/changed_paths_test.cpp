#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/path_bench.h"

// Holds, resumes and speed overrides at random times on random paths, also while the rate is still
// changing: from the pins, the axes stay on the path and within their limits.

namespace stepdriver {
namespace {

using namespace test;  // NOLINT(google-build-using-namespace)
using axis::MoveEnd;

constexpr double kCornerTolerance = 200e-6;  // m
constexpr double kNoJerkLimit = 0.0;

class ChangedPaths : public PathBench, public testing::WithParamInterface<double> {
 protected:
  void SetUp() override {}

  double number(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }

  PathRequest randomPath() {
    PathRequest request{{"x", "y"}, {}, false, 0.0, kCornerTolerance};
    const double size = std::pow(10.0, number(-3.0, -2.0));
    Place place{0.0, 0.0};
    for (int i = 0; i < 40; ++i) {
      for (double& x : place) x = std::clamp(x + number(-size, size), -0.05, 0.05);
      request.segments.push_back(lineTo({place[0], place[1]}));
    }
    return request;
  }

  void change() {
    const double kind = number(0.0, 3.0);
    if (kind < 1.0) {
      machine().setSpeedOverride(number(0.1, 1.0));
    } else if (kind < 2.0) {
      machine().hold();
    } else {
      machine().resume();
    }
  }

  std::mt19937 random_{41};
};

TEST_P(ChangedPaths, StayOnThePathAndKeepTheLimits) {
  const double jerk = GetParam();
  for (int round = 0; round < 40; ++round) {
    std::vector<config::AxisConfig> axes{plotterAxis("x"), plotterAxis("y")};
    for (config::AxisConfig& axis : axes) axis.jerk = jerk;
    build(axes);
    const PathRequest request = randomPath();
    const CoordinatedMove move = followPath(request);
    for (int i = 0; i < 8; ++i) {
      advance(std::pow(10.0, number(-3.0, -0.5)));
      change();
    }
    machine().setSpeedOverride(1.0);
    machine().resume();
    const CoordinatedResult result = machine().wait(move);
    ASSERT_EQ(result.end, MoveEnd::kReached) << round << ": " << result.message;
    expectAtRest();
    ASSERT_LE(farthest(pulsePlaces(), corners(request)),
              kCornerTolerance + kHalfMicrosteps + 0.1 * kMicrostep)
        << round;
    constexpr double kApart = 0.02;  // s
    for (const std::string name : {"x", "y"}) {
      const Differences seen = differences(name, kApart);
      ASSERT_LE(seen.speed, 0.1 / kMicrostep * 1.001) << round << name;
      ASSERT_LE(seen.acceleration, 1.0 / kMicrostep * 1.02) << round << name;
      // The 8 parts of a difference that the cubics and half a microstep may add, over its cube.
      if (jerk == kNoJerkLimit) continue;
      ASSERT_LE(seen.jerk, 1.01 * jerk / kMicrostep + 8.0 * 0.03 / (kApart * kApart * kApart))
          << round << name;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Jerk, ChangedPaths, testing::Values(kNoJerkLimit, 10.0, 100.0));

}  // namespace
}  // namespace stepdriver
