#include "profile/profile_parts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstdint>

#include "point_to_point/planner.h"

namespace stepdriver::motion {
namespace {

constexpr std::int64_t kStart = 5'000'000;

Profile move(std::int64_t target, double jerk) {
  return planMove(kStart, {}, target, {0.0, 1000.0, 2000.0, 3000.0, jerk}).profile;
}

void expectState(const MotionState& seen, const MotionState& wanted, std::int64_t t) {
  EXPECT_NEAR((seen.position - wanted.position).value(), 0.0, 1e-12) << t;
  EXPECT_NEAR(seen.velocity, wanted.velocity, 1e-9) << t;
  EXPECT_NEAR(seen.acceleration, wanted.acceleration, 1e-9) << t;
}

TEST(PartOfAProfile, IsWhatTheProfileDoesInThatTime) {
  const Profile whole = move(1000, 20'000.0);
  const Profile middle = part(whole, 0.1234, 1.2);
  EXPECT_EQ(middle.startNs(), kStart);
  EXPECT_EQ(middle.endNs(), kStart + 1'076'600'000);
  for (std::int64_t t = 7; t < 1'076'600'000; t += 1'000'003) {
    expectState(middle.stateAt(kStart + t), whole.stateAt(kStart + t + 123'400'000), t);
  }
}

TEST(PartOfAProfile, RestsBeyondItsEnd) {
  const Profile whole = move(1000, 0.0);
  const Profile longer = part(whole, 0.0, 5.0);
  EXPECT_EQ(longer.endNs(), kStart + 5'000'000'000);
  EXPECT_EQ(longer.stateAt(kStart + 4'000'000'000).velocity, 0.0);
  EXPECT_EQ(longer.endPosition().value(), 1000.0);
  EXPECT_TRUE(part(whole, 1.0, 1.0).pieces().empty());
}

TEST(SumOfProfiles, IsBothAtOnce) {
  const Profile far = move(1000, 20'000.0);
  const Profile near = move(-77, 0.0);
  for (const bool swapped : {false, true}) {
    const Profile both = swapped ? sum(near, far) : sum(far, near);
    EXPECT_EQ(both.endNs(), std::max(far.endNs(), near.endNs()));
    EXPECT_EQ(both.endPosition().value(), 923.0);
    for (std::int64_t t = 11; kStart + t < both.endNs(); t += 1'000'003) {
      const MotionState a = far.stateAt(kStart + t);
      const MotionState b = near.stateAt(kStart + t);
      expectState(
          both.stateAt(kStart + t),
          {a.position + b.position, a.velocity + b.velocity, a.acceleration + b.acceleration}, t);
    }
  }
}

TEST(SumOfProfiles, TakesRestForAMotion) {
  const Profile moved = sum(move(100, 0.0), Profile(0, 30.0));
  EXPECT_EQ(moved.endPosition().value(), 130.0);
  EXPECT_EQ(moved.stateAt(kStart).position.value(), 30.0);
  EXPECT_EQ(sum(Profile(3, 1.0), Profile(3, 2.0)).endPosition().value(), 3.0);
}

}  // namespace
}  // namespace stepdriver::motion
