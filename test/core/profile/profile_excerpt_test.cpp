#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <memory>
#include <random>
#include <utility>
#include <vector>

#include "profile/composition.h"
#include "profile/step_finder.h"
#include "support/steps_of.h"
#include "trajectory/feed_rate.h"
#include "trajectory/spline.h"

// Excerpts compute their pieces on demand. Here the same pieces are made in advance.

namespace stepdriver::motion {
namespace {

using Shared = std::shared_ptr<const Profile>;

Shared randomCourse(std::mt19937& random, int points) {
  std::uniform_real_distribution<double> any(-1.0, 1.0);
  std::vector<Waypoint> waypoints;
  for (int i = 1; i <= points; ++i) {
    Waypoint waypoint{i * std::int64_t{20'000'000}, 90.0 * any(random), 900.0 * any(random), {}};
    if (random() % 2 == 0) waypoint.acceleration = 9'000.0 * any(random);
    waypoints.push_back(waypoint);
  }
  return std::make_shared<const Profile>(planSpline(0, {}, waypoints));
}

/// One piece at a constant rate for each piece of the course in the stretch.
void appendAtRate(std::vector<Piece>& pieces, const Profile& course, const Piece& stretch) {
  const DoubleDouble rate(stretch.v0, stretch.v0_rest);
  const DoubleDouble end = stretch.positionAt(stretch.duration);
  for (std::size_t i = 0; i < course.pieceCount(); ++i) {
    const bool last = i + 1 == course.pieceCount();
    const DoubleDouble from = std::max(stretch.p0, course.pieceStart(i));
    const DoubleDouble to = last ? end : std::min(end, course.pieceStart(i + 1));
    if (!((to - from).hi > 1e-15)) continue;
    const Piece piece = course.piece(i);
    const DoubleDouble after = from - course.pieceStart(i);
    const DoubleDouble v = rate * piece.velocityAt(after);
    const DoubleDouble a = rate * rate * piece.accelerationAt(after);
    const double j = (rate * rate * rate * DoubleDouble(piece.j)).value();
    pieces.push_back({(to - from) / rate, piece.positionAt(after), v.hi, a.hi, j, v.lo, a.lo});
  }
}

Profile composedBeforehand(const Shared& course, const Profile& path) {
  std::vector<Piece> pieces;
  for (const Piece& stretch : path.pieces()) {
    if (stretch.a == 0.0 && stretch.j == 0.0) {
      appendAtRate(pieces, *course, stretch);
    } else {
      const Profile changing = composeAlong(course, Profile(0, {stretch}));
      for (const Piece& piece : changing.pieces()) pieces.push_back(piece);
    }
  }
  return {path.startNs(), pieces};
}

void expectSame(const Profile& seen, const Profile& wanted) {
  ASSERT_EQ(seen.pieceCount(), wanted.pieceCount());
  EXPECT_EQ(seen.endNs(), wanted.endNs());
  EXPECT_NEAR((seen.endPosition() - wanted.endPosition()).value(), 0.0, 1e-20);
  EXPECT_GE(seen.peakSpeed(), wanted.peakSpeed() * (1.0 - 1e-12));
  EXPECT_EQ(stepsOf(seen), stepsOf(wanted));
  for (std::int64_t t = seen.startNs() - 5; t < seen.endNs() + 5; t += 3'000'017) {
    const MotionState a = seen.stateAt(t);
    const MotionState b = wanted.stateAt(t);
    EXPECT_NEAR((a.position - b.position).value(), 0.0, 1e-18) << t;
    EXPECT_EQ(a.velocity, b.velocity) << t;
    EXPECT_EQ(a.acceleration, b.acceleration) << t;
  }
}

/// A path from a random place: to another rate, to rest, or at the rate of the beginning.
Profile randomPath(std::mt19937& random, const Profile& course) {
  std::uniform_real_distribution<double> share(0.0, 1.0);
  const DoubleDouble end = course.duration();
  const double place = random() % 3 == 0 ? 0.0 : 0.8 * share(random) * end.value();
  const double rate = random() % 2 == 0 ? 1.0 : share(random);
  const double wanted = random() % 3 == 0 ? 0.0 : random() % 2 == 0 ? 1.0 : share(random);
  const FeedRateLimits limits{1.0 + 20.0 * share(random), random() % 2 == 0 ? 0.0 : 100.0};
  const double after = rate > 0.0 && random() % 3 == 0 ? 0.05 * share(random) : 0.0;
  return planFeedRate(static_cast<std::int64_t>(random() % 1000), {place, rate, 0.0}, wanted,
                      limits, after, end);
}

TEST(ProfileExcerpt, HasTheStepsOfPiecesThatAreMadeBeforehand) {
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {
    SCOPED_TRACE(i);
    const Shared course = randomCourse(random, 1 + static_cast<int>(random() % 40));
    const Profile path = randomPath(random, *course);
    if (path.pieceCount() == 0) continue;
    expectSame(composeAlong(course, path), composedBeforehand(course, path));
    if (HasFailure()) return;
  }
}

TEST(ProfileExcerpt, IsTheProfileItselfAtItsOwnRate) {
  std::mt19937 random(5);
  const Shared course = randomCourse(random, 50);
  const Profile run(0, [&] {
    Sections sections;
    sections.add(Excerpt{course, 0.0, course->duration()});
    return sections;
  }());
  EXPECT_EQ(stepsOf(run), stepsOf(*course));
  EXPECT_EQ(run.peakSpeed(), course->peakSpeed());
}

TEST(ProfileExcerpt, MayBeOfAProfileThatHasExcerptsItself) {
  std::mt19937 random(11);
  for (int i = 0; i < 50; ++i) {
    SCOPED_TRACE(i);
    const Shared rest = randomCourse(random, 30);
    const double from = 0.3 * rest->duration().value();
    const MotionState there = rest->stateAt(static_cast<std::int64_t>(from * 1e9));
    Sections sections;
    sections.add(Piece{0.1, there.position - DoubleDouble(0.1 * there.velocity), there.velocity});
    sections.add(Excerpt{rest, from, rest->duration()});
    const auto joined = std::make_shared<const Profile>(0, std::move(sections));
    const Profile path = randomPath(random, *joined);
    if (path.pieceCount() == 0) continue;
    expectSame(composeAlong(joined, path), composedBeforehand(joined, path));
    if (HasFailure()) return;
  }
}

TEST(ProfileExcerpt, FindsAPieceByItsTimeAsByItsNumber) {
  std::mt19937 random(17);
  const Shared course = randomCourse(random, 200);
  Sections sections;
  sections.add(Piece{0.5, 1.0, 0.0});
  sections.add(Excerpt{course, 1.2345, 2.3456, 0.7});
  sections.add({Piece{0.5, 1.0, 0.0}, Piece{0.25, 1.0, 0.0}});
  sections.add(Excerpt{course, 0.0, course->duration(), 0.3});
  const Profile profile(0, std::move(sections));
  for (std::size_t i = 0; i < profile.pieceCount(); ++i) {
    const DoubleDouble begin = profile.pieceStart(i);
    const DoubleDouble duration = profile.piece(i).duration;
    EXPECT_NEAR((profile.pieceStart(i + 1) - begin - duration).value(), 0.0, 1e-20) << i;
    EXPECT_EQ(profile.pieceAt(begin + duration * DoubleDouble(0.5)), i);
  }
}

}  // namespace
}  // namespace stepdriver::motion
