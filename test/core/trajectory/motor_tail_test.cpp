#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <utility>
#include <vector>

#include "profile/profile_peaks.h"
#include "profile/step_finder.h"
#include "support/random_motion.h"
#include "support/steps_of.h"
#include "trajectory/backlash.h"
#include "trajectory/spline.h"

// A trajectory whose tail is prepared before its head is known is the same as a trajectory that is
// planned at once.

namespace stepdriver::motion {
namespace {

constexpr std::int64_t kBacklash = 20;
constexpr MotionLimits kLimits{0.0, 4'000.0, 60'000.0, 60'000.0, 0.0};
constexpr MotionLimits kJerkLimits{0.0, 4'000.0, 60'000.0, 60'000.0, 4e6};

/// Waypoints every 0.2 s; at some of them the joint stays where it is, or nearly.
std::vector<Waypoint> randomWaypoints(Random& random, int count) {
  std::vector<Waypoint> waypoints;
  double position = 0.0;
  for (int i = 1; i <= count; ++i) {
    const bool rests = random.whole(0, 3) == 0;
    position += rests ? random.within(-0.4, 0.4) : random.within(-60.0, 60.0);
    const double velocity = rests ? 0.0 : random.within(-200.0, 200.0);
    Waypoint waypoint{i * std::int64_t{200'000'000}, position, velocity, {}};
    if (random.whole(0, 1) == 0) waypoint.acceleration = random.within(-500.0, 500.0);
    waypoints.push_back(waypoint);
  }
  waypoints.back().velocity = 0.0;
  waypoints.back().acceleration = 0.0;
  return waypoints;
}

void expectSameSteps(const Profile& seen, const Profile& wanted) {
  const auto a = stepsOf(seen);
  const auto b = stepsOf(wanted);
  EXPECT_EQ(a.size(), b.size());
  const std::size_t count = std::min(a.size(), b.size());
  for (std::size_t i = 0; i < count; ++i) {
    ASSERT_EQ(a[i], b[i]) << "step " << i << " of " << count;
  }
}

std::shared_ptr<const Profile> joined(const SplineTail& tail, const MotionState& from,
                                      DoubleDouble* begin) {
  const Profile head(0, tail.head(from));
  *begin = head.duration();
  Sections sections;
  sections.add(tail.head(from));
  if (const Profile* rest = tail.profile()) {
    const std::shared_ptr<const Profile> shared(std::shared_ptr<void>(), rest);
    sections.add(Excerpt{shared, 0.0, rest->duration()});
  }
  return std::make_shared<const Profile>(0, std::move(sections));
}

MotionState randomState(Random& random) {
  if (random.whole(0, 1) == 0) return {random.within(-5.0, 5.0), 0.0, 0.0};
  return {random.within(-5.0, 5.0), random.within(-200.0, 200.0), random.within(-500.0, 500.0)};
}

double randomSlack(Random& random) {
  const double some = random.within(0.0, static_cast<double>(kBacklash));
  const double all[] = {0.0, static_cast<double>(kBacklash), std::round(some), some};
  return all[random.whole(0, 3)];
}

TEST(SplineTail, IsTheTrajectoryWithItsHead) {
  Random random(1);
  for (int i = 0; i < 200; ++i) {
    SCOPED_TRACE(i);
    const auto waypoints = randomWaypoints(random, 1 + random.whole(0, 19));
    const MotionState from = randomState(random);
    const SplineTail tail(waypoints);
    DoubleDouble begin;
    const Profile whole = planSpline(0, from, waypoints);
    const auto profile = joined(tail, from, &begin);
    EXPECT_EQ(profile->pieceCount(), whole.pieceCount());
    EXPECT_EQ(profile->endNs(), whole.endNs());
    expectSameSteps(*profile, whole);
    const SplineJerk jerk = splineJerk(from, waypoints);
    const SplineJerk of_head = tail.headJerk(from);
    const auto largest = [](double a, double b) { return std::max(std::abs(a), std::abs(b)); };
    EXPECT_EQ(largest(of_head.jerk.value, tail.jerk().jerk.value), std::abs(jerk.jerk.value));
    EXPECT_EQ(largest(of_head.acceleration_jump.value, tail.jerk().acceleration_jump.value),
              std::abs(jerk.acceleration_jump.value));
    if (HasFailure()) return;
  }
}

TEST(MotorTail, TakesUpTheBacklashAsIfPlannedAtOnce) {
  Random random(2);
  int joins = 0;
  int prepared = 0;
  for (int i = 0; i < 500; ++i) {
    SCOPED_TRACE(i);
    const auto waypoints = randomWaypoints(random, 2 + random.whole(0, 19));
    const SplineTail tail(waypoints);
    const MotionLimits limits = random.whole(0, 1) == 0 ? kLimits : kJerkLimits;
    const auto motor = std::make_shared<const MotorTail>(*tail.profile(), kBacklash, limits);
    const MotionState from = randomState(random);
    const double slack = randomSlack(random);
    DoubleDouble begin;
    const auto joint = joined(tail, from, &begin);
    const MotorPlan whole = planMotor(*joint, slack, kBacklash, limits);
    if (motor->noRoom()) {
      EXPECT_TRUE(whole.no_room);
      continue;
    }
    const auto plan = motor->join(motor, joint, begin, slack);
    ASSERT_TRUE(plan);
    EXPECT_EQ(plan->no_room.has_value(), whole.no_room.has_value());
    if (plan->no_room || whole.no_room) continue;
    EXPECT_EQ(plan->profile.endNs(), whole.profile.endNs());
    expectSameSteps(plan->profile, whole.profile);
    ++joins;
    prepared += plan->fresh.size() < 6 ? 1 : 0;
    if (HasFailure()) return;
  }
  EXPECT_GT(joins, 200);
  EXPECT_GT(prepared, joins * 3 / 4) << "of " << joins;
}

}  // namespace
}  // namespace stepdriver::motion
