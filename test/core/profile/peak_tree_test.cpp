#include "profile/peak_tree.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <vector>

#include "profile/profile_parts.h"
#include "trajectory/spline.h"

namespace stepdriver::motion {
namespace {

Profile randomCurve(std::mt19937& random, int points) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  std::vector<Waypoint> waypoints;
  for (int i = 1; i <= points; ++i) {
    waypoints.push_back(
        {i * std::int64_t{10'000'000}, 50.0 * any(random), 900.0 * any(random), {}});
  }
  return planSpline(0, {}, waypoints);
}

Highest highestOf(const Profile& profile) {
  Highest highest;
  for (const Piece& piece : profile.pieces()) highest = larger(highest, highestOf(piece));
  return highest;
}

TEST(PeakTree, TellsTheHighestValuesOfAnyTime) {
  std::mt19937 random(7);
  for (const int points : {1, 2, 3, 7, 100}) {
    const Profile curve = randomCurve(random, points);
    const PeakTree tree(curve);
    const double duration = curve.duration().value();
    std::uniform_real_distribution<double> time(0.0, 1.2 * duration);
    for (int i = 0; i < 300; ++i) {
      const double a = time(random);
      const double b = time(random);
      if (a == b) continue;
      const Highest seen = tree.between(std::min(a, b), std::max(a, b));
      const Highest wanted = highestOf(part(curve, std::min(a, b), std::max(a, b)));
      EXPECT_EQ(seen.speed, wanted.speed) << points << ": " << a << ", " << b;
      EXPECT_EQ(seen.acceleration, wanted.acceleration) << points << ": " << a << ", " << b;
      EXPECT_EQ(seen.jerk, wanted.jerk) << points << ": " << a << ", " << b;
    }
  }
}

TEST(PeakTree, HasNothingForAMotionThatIsNone) {
  const Profile rest(0, 5.0);
  EXPECT_EQ(PeakTree(rest).between(0.0, 1.0).speed, 0.0);
}

}  // namespace
}  // namespace stepdriver::motion
