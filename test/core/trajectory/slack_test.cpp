#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>
#include <vector>

#include "profile/profile.h"
#include "support/constants.h"
#include "support/random_motion.h"
#include "trajectory/backlash.h"

// How much of a backlash is taken up at a time of a motor's motion.

namespace stepdriver::motion {
namespace {

using test::kSecond;

/// A second for each way [microsteps], at a constant speed.
Profile ways(const std::vector<double>& lengths) {
  std::vector<Piece> pieces;
  double place = 0.0;
  for (const double length : lengths) {
    pieces.push_back({DoubleDouble(1.0), DoubleDouble(place), length});
    place += length;
  }
  return {5 * kSecond, pieces};
}

TEST(SlackAt, IsWhatTheMotorHasTurnedSinceItsLastTurn) {
  const Profile motor = ways({100.0, -30.0, 5.0, -2.0});
  const auto after = [&motor](double seconds) {
    return slackAt(motor, 5 * kSecond + static_cast<std::int64_t>(seconds * 1e9), 20)
        .value_or(-1.0);
  };
  EXPECT_NEAR(after(0.5), 20.0, 1e-9);
  EXPECT_NEAR(after(1.0), 20.0, 1e-9);
  EXPECT_NEAR(after(1.25), 12.5, 1e-9);
  EXPECT_NEAR(after(2.0), 0.0, 1e-9);
  EXPECT_NEAR(after(2.5), 2.5, 1e-9);
  EXPECT_NEAR(after(3.5), 4.0, 1e-9);
  EXPECT_NEAR(after(4.0), 3.0, 1e-9);
  EXPECT_NEAR(after(1e6), 3.0, 1e-9) << "after its end";
}

TEST(SlackAt, IsUnknownIfTheMotionIsShorterThanTheBacklash) {
  EXPECT_EQ(slackAt(ways({10.0, -5.0}), 7 * kSecond, 20), std::nullopt);
  EXPECT_EQ(slackAt(Profile(0, DoubleDouble(3.0)), kSecond, 20), std::nullopt);
  EXPECT_EQ(slackAt(ways({10.0}), 5 * kSecond, 0), 0.0);
}

TEST(SlackAt, IsThatOfEachStepOneAfterTheOther) {
  Random random(7);
  for (int i = 0; i < 300; ++i) {
    std::vector<double> lengths;
    for (int k = 0; k < 12; ++k) lengths.push_back(random.within(-40.0, 40.0));
    const Profile motor = ways(lengths);
    const double end = random.within(0.0, 12.0);
    const auto until = 5 * kSecond + static_cast<std::int64_t>(end * 1e9);
    double place = 0.0;
    // From both ends of the backlash, small steps must lead to the same.
    double low = 0.0;
    double high = 30.0;
    for (std::int64_t time = 5 * kSecond; time < until; time += kSecond / 1000) {
      const double next = motor.stateAt(std::min(until, time + kSecond / 1000)).position.value();
      low = std::clamp(low + next - place, 0.0, 30.0);
      high = std::clamp(high + next - place, 0.0, 30.0);
      place = next;
    }
    const auto found = slackAt(motor, until, 30);
    if (!found) continue;
    ASSERT_NEAR(*found, low, 0.1);
    ASSERT_NEAR(*found, high, 0.1);
  }
}

}  // namespace
}  // namespace stepdriver::motion
