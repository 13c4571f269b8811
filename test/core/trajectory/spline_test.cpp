#include "trajectory/spline.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "profile/profile_peaks.h"
#include "profile/step_finder.h"
#include "support/constants.h"

namespace stepdriver::motion {
namespace {

using test::kSecond;

// The textbook's polynomial of one segment over t/T, in long double.
struct TextbookSpline {
  long double duration;
  long double c[6] = {};

  TextbookSpline(const Waypoint& begin, const Waypoint& end)
      : duration((end.time_ns - begin.time_ns) / 1e9L) {
    const long double way = static_cast<long double>(end.position) - begin.position;
    c[0] = begin.position;
    if (!begin.velocity || !end.velocity) {
      c[1] = way;
      return;
    }
    const long double v0 = *begin.velocity * duration;
    const long double v1 = *end.velocity * duration;
    c[1] = v0;
    if (!begin.acceleration || !end.acceleration) {
      c[2] = 3.0L * way - 2.0L * v0 - v1;
      c[3] = -2.0L * way + v0 + v1;
      return;
    }
    const long double a0 = *begin.acceleration * duration * duration;
    const long double a1 = *end.acceleration * duration * duration;
    c[2] = a0 / 2.0L;
    c[3] = 10.0L * way - 6.0L * v0 - 4.0L * v1 - 1.5L * a0 + 0.5L * a1;
    c[4] = -15.0L * way + 8.0L * v0 + 7.0L * v1 + 1.5L * a0 - a1;
    c[5] = 6.0L * way - 3.0L * v0 - 3.0L * v1 - 0.5L * a0 + 0.5L * a1;
  }

  long double at(long double t) const {
    const long double u = t / duration;
    return c[0] + u * (c[1] + u * (c[2] + u * (c[3] + u * (c[4] + u * c[5]))));
  }
  bool quintic() const { return c[4] != 0.0L || c[5] != 0.0L; }
};

/// The first time after `low` at which the textbook's motion is on a half-step line [s].
long double crossing(const TextbookSpline& textbook, long double line, long double low,
                     long double high) {
  for (int i = 0; i < 100; ++i) {
    const long double middle = (low + high) / 2.0L;
    (textbook.at(middle) < line ? low : high) = middle;
  }
  return low;
}

MotionState restAt(double position) { return {position, 0.0, 0.0}; }

// Compares 40 times of each segment: lines and cubics up to rounding, quintics up to the stated
// error.
void expectTextbook(const Profile& profile, Waypoint begin, std::vector<Waypoint> waypoints) {
  waypoints.back().position = std::nearbyint(waypoints.back().position);
  for (std::size_t index = 0; index < waypoints.size(); ++index) {
    const Waypoint& end = waypoints[index];
    const TextbookSpline textbook(begin, end);
    const double allowed = textbook.quintic() ? kQuinticError + 1e-9 : 1e-9;
    for (std::int64_t k = 0; k <= 40; ++k) {
      const std::int64_t time = (end.time_ns - begin.time_ns) / 40 * k;
      const DoubleDouble position =
          profile.stateAt(profile.startNs() + begin.time_ns + time).position;
      const long double error =
          static_cast<long double>(position.hi) + position.lo - textbook.at(time / 1e9L);
      ASSERT_LE(std::abs(error), allowed) << "segment " << index << ", time " << time;
    }
    begin = end;
  }
}

void expectContinuous(const Profile& profile) {
  const auto& pieces = profile.pieces();
  for (std::size_t k = 1; k < pieces.size(); ++k) {
    const Piece& before = pieces[k - 1];
    const double gap = (before.positionAt(before.duration) - pieces[k].p0).value();
    ASSERT_LE(std::abs(gap), 1e-10) << "piece " << k;
  }
}

std::vector<Waypoint> randomWaypoints(std::mt19937_64& random, std::size_t count) {
  std::uniform_real_distribution<double> spread(-1.0, 1.0);
  std::vector<Waypoint> waypoints;
  std::int64_t time = 0;
  for (std::size_t k = 0; k < count; ++k) {
    time += 1'000'000 + static_cast<std::int64_t>(5e8 * std::abs(spread(random)));
    Waypoint waypoint{time, 300.0 * spread(random), std::nullopt, std::nullopt};
    if (spread(random) > -0.7) waypoint.velocity = 1000.0 * spread(random);
    if (spread(random) > -0.3) waypoint.acceleration = 5000.0 * spread(random);
    waypoints.push_back(waypoint);
  }
  return waypoints;
}

TEST(Spline, FollowsRandomTrajectoriesLikeTheTextbook) {
  std::mt19937_64 random(20261121);
  for (int round = 0; round < 5000; ++round) {
    SCOPED_TRACE(round);
    const auto waypoints = randomWaypoints(random, 1 + static_cast<std::size_t>(round % 6));
    const Profile profile = planSpline(77, {3.0, -20.0, 50.0}, waypoints);
    ASSERT_EQ(profile.endNs(), 77 + waypoints.back().time_ns);
    ASSERT_NO_FATAL_FAILURE(expectTextbook(profile, {0, 3.0, -20.0, 50.0}, waypoints));
    ASSERT_NO_FATAL_FAILURE(expectContinuous(profile));
    StepFinder finder(profile, 3);
    Step step;
    std::int64_t last = 77;
    while (finder.next(step)) {
      ASSERT_GE(step.time_ns, last);
      last = step.time_ns;
    }
    ASSERT_EQ(finder.count(), std::llrint(waypoints.back().position));
  }
}

TEST(Spline, StepsOfACubicComeWithinANanosecond) {
  const std::vector<Waypoint> waypoints{{2 * kSecond, 10000.0, 0.0, std::nullopt}};
  const TextbookSpline textbook({0, 0.0, 0.0, std::nullopt}, waypoints[0]);
  const Profile profile = planSpline(0, restAt(0.0), waypoints);
  StepFinder finder(profile, 0);
  Step step;
  for (int k = 0; k < 10000; ++k) {
    ASSERT_TRUE(finder.next(step));
    const long double time = crossing(textbook, k + 0.5L, 0.0L, 2.0L);
    ASSERT_LE(std::abs(step.time_ns - time * 1e9L), 1.0L) << "step " << k;
  }
  EXPECT_FALSE(finder.next(step));
}

// Compares positions rather than times, because the axis hardly moves at the ends.
TEST(Spline, StepsOfAQuinticComeWhereThePolynomialIsWithinAHundredthOfAStep) {
  const std::vector<Waypoint> waypoints{{2 * kSecond, 10000.0, 0.0, 0.0}};
  const TextbookSpline textbook({0, 0.0, 0.0, 0.0}, waypoints[0]);
  ASSERT_TRUE(textbook.quintic());
  const Profile profile = planSpline(0, restAt(0.0), waypoints);
  StepFinder finder(profile, 0);
  Step step;
  for (int k = 0; k < 10000; ++k) {
    ASSERT_TRUE(finder.next(step));
    const long double off = textbook.at(step.time_ns / 1e9L) - (k + 0.5L);
    // A nanosecond is 1e-5 steps at the peak of 9375 steps/s.
    ASSERT_LE(std::abs(off), kQuinticError + 1e-5L) << "step " << k;
    if (k < 100 || k >= 9900) continue;
    const long double time = crossing(textbook, k + 0.5L, 0.0L, 2.0L);
    const long double speed = 1.0L / (crossing(textbook, k + 1.5L, 0.0L, 2.0L) - time);
    ASSERT_LE(std::abs(step.time_ns / 1e9L - time), 1.1L * kQuinticError / speed) << "step " << k;
  }
  EXPECT_FALSE(finder.next(step));
}

// If both segments at a waypoint have a velocity for it, they join without a jump. So do the cubics
// that approximate a quintic.
TEST(Spline, JoinsWithoutAJumpOfVelocity) {
  std::mt19937_64 random(20261122);
  for (int round = 0; round < 1000; ++round) {
    SCOPED_TRACE(round);
    std::vector<Waypoint> waypoints = randomWaypoints(random, 4);
    for (Waypoint& waypoint : waypoints) waypoint.velocity = waypoint.velocity.value_or(0.0);
    const Profile profile = planSpline(0, {3.0, -20.0, 50.0}, waypoints);
    double fastest = 20.0;
    for (const Piece& piece : profile.pieces()) fastest = std::max(fastest, std::abs(piece.v0));
    DoubleDouble before(-20.0);
    for (const Piece& piece : profile.pieces()) {
      ASSERT_NEAR(piece.v0, before.value(), 1e-9 * fastest);
      before = piece.velocityAt(piece.duration);
    }
    ASSERT_NEAR(before.value(), *waypoints.back().velocity, 1e-9 * fastest);
    ASSERT_LE(std::abs(profilePeaks(profile, -20.0).velocity_jump.value) -
                  std::abs(*waypoints.back().velocity),
              1e-9 * fastest);
  }
}

// From rest to rest the textbook has the peaks in closed form: 1.5 L/T at T/2 and 6 L/T^2 at both
// ends for the cubic, 15/8 L/T at T/2 and 10/sqrt(3) L/T^2 at T/2 -+ T/sqrt(12) for the quintic.
TEST(Spline, OfASegmentFromRestToRestHasThePeaksOfTheTextbook) {
  const double length = 10000.0;
  const double time = 2.0;
  const auto peaks = [&](std::optional<double> acceleration) {
    return profilePeaks(planSpline(0, restAt(0.0), {{2 * kSecond, length, 0.0, acceleration}}));
  };
  const ProfilePeaks cubic = peaks({});
  EXPECT_NEAR(cubic.velocity.value, 1.5 * length / time, 1e-6);
  EXPECT_NEAR(cubic.velocity.time_s, time / 2.0, 1e-6);
  EXPECT_NEAR(std::abs(cubic.acceleration.value), 6.0 * length / (time * time), 1e-6);
  const ProfilePeaks quintic = peaks(0.0);
  EXPECT_NEAR(quintic.velocity.value, 15.0 / 8.0 * length / time, 1e-3 * length);
  EXPECT_NEAR(quintic.velocity.time_s, time / 2.0, 0.01 * time);
  EXPECT_NEAR(std::abs(quintic.acceleration.value), 10.0 / std::sqrt(3.0) * length / (time * time),
              0.02 * 10.0 * length);
  for (const ProfilePeaks& each : {cubic, quintic}) {
    EXPECT_NEAR(each.lowest.value, 0.0, 1e-9);
    EXPECT_NEAR(each.highest.value, length, 1e-9);
    EXPECT_NEAR(each.velocity_jump.value, 0.0, 1e-6);
  }
}

// From rest up to an acceleration of 1000, which the quintic doesn't exceed: 1000 (3 u^2 - 2 u^3).
TEST(Spline, KeepsTheAccelerationThatItsQuinticKeeps) {
  constexpr double kMost = 1000.0;
  constexpr double kTime = 0.01;
  const std::vector<Waypoint> waypoints = {
      {0, 0.0, 0.0, 0.0},
      {10'000'000, 0.15 * kMost * kTime * kTime, 0.5 * kMost * kTime, kMost},
      {kSecond, 100.0, 0.0, 0.0}};
  const auto first = [&](double most) {
    const Profile curve = planSpline(0, {}, waypoints, {most});
    std::vector<Piece> pieces;
    for (const Piece& piece : curve.pieces()) {
      if (piece.p0.value() < waypoints[1].position) pieces.push_back(piece);
    }
    return pieces;
  };
  const auto last = [](const Piece& piece) { return piece.a + piece.j * piece.duration.value(); };
  const std::vector<Piece> unbounded = first(std::numeric_limits<double>::infinity());
  ASSERT_EQ(unbounded.size(), 1U);
  EXPECT_NEAR(last(unbounded.back()), 1.1 * kMost, 1e-6);
  const std::vector<Piece> bounded = first(kMost);
  EXPECT_LE(last(bounded.back()), (1.0 + kQuinticLimitError) * kMost);
  EXPECT_LE(bounded.size(), 32U);
  EXPECT_EQ(first(1.2 * kMost).size(), 1U) << "it is divided only if it exceeds the limit";
  EXPECT_LE(first(1e-6 * kMost).size(), 64U) << "what exceeds it itself isn't divided without end";
}

// A ramp that ends at its speed halfway: the quintic stays below 1, one cubic reaches 1.03.
TEST(Spline, KeepsTheSpeedThatItsQuinticKeeps) {
  constexpr double kSpeed = 1e-3;
  const std::vector<Waypoint> waypoints = {{10'000'000, 4.18e-7, 0.6854e-3, 0.5978},
                                           {12'012'000, 2.2985e-6, 0.9843e-3, 0.0},
                                           {kSecond, 0.0005, 0.0, 0.0}};
  const auto fastest = [&](double most) {
    const Profile curve =
        planSpline(0, {}, waypoints, {std::numeric_limits<double>::infinity(), most});
    double speed = 0.0;
    double time = 0.0;
    for (const Piece& piece : curve.pieces()) {
      const double t = piece.duration.value();
      if (time > 0.0099 && time < 0.0120) {
        for (int k = 0; k <= 100; ++k) {
          const double at = t * k / 100.0;
          speed = std::max(speed, std::abs(piece.velocityAt(DoubleDouble(at)).value()));
        }
      }
      time += t;
    }
    return speed;
  };
  EXPECT_GT(fastest(std::numeric_limits<double>::infinity()), 1.01 * kSpeed);
  EXPECT_LE(fastest(kSpeed), (1.0 + kQuinticLimitError) * kSpeed);
}

TEST(Spline, StaysOnItsWaypointsOver10000) {
  std::mt19937_64 random(7);
  const auto waypoints = randomWaypoints(random, 10000);
  const Profile profile = planSpline(0, restAt(0.0), waypoints);
  EXPECT_EQ(profile.endNs(), waypoints.back().time_ns);
  expectTextbook(profile, {0, 0.0, 0.0, 0.0}, waypoints);
}

TEST(Spline, HoldsWhereThePositionStays) {
  const Profile profile =
      planSpline(0, restAt(5.0), {{kSecond, 5.0, {}, {}}, {2 * kSecond, 5.0, 0.0, 0.0}});
  Step step;
  EXPECT_FALSE(StepFinder(profile, 5).next(step));
}

TEST(Spline, LeavesOutAFirstWaypointAtTime0) {
  const Profile profile = planSpline(0, restAt(1.0), {{0, 9.0, {}, {}}, {kSecond, 3.0, {}, {}}});
  ASSERT_EQ(profile.pieces().size(), 1U);
  EXPECT_EQ(profile.pieces()[0].v0, 2.0);
}

TEST(ProfilePeaks, AreThoseOfDenseSampling) {
  std::mt19937_64 random(11);
  for (int round = 0; round < 300; ++round) {
    const Profile profile = planSpline(0, restAt(0.0), randomWaypoints(random, 3));
    const ProfilePeaks peaks = profilePeaks(profile);
    double velocity = 0.0;
    double lowest = 0.0;
    double highest = 0.0;
    double acceleration = 0.0;
    for (const Piece& piece : profile.pieces()) {
      for (int k = 0; k <= 400; ++k) {
        const double t = piece.duration.value() / 400.0 * k;
        const double position = piece.positionAt(t).value();
        velocity = std::max(velocity, std::abs(piece.velocityAt(t).value()));
        acceleration = std::max(acceleration, std::abs(piece.a + piece.j * t));
        lowest = std::min(lowest, position);
        highest = std::max(highest, position);
      }
    }
    ASSERT_NEAR(acceleration, std::abs(peaks.acceleration.value), 1e-6 * acceleration);
    ASSERT_LE(velocity, std::abs(peaks.velocity.value) + 1e-6);
    ASSERT_GE(velocity, std::abs(peaks.velocity.value) * 0.999);
    ASSERT_LE(peaks.lowest.value, lowest + 1e-9);
    ASSERT_NEAR(peaks.lowest.value, lowest, 0.02);
    ASSERT_GE(peaks.highest.value, highest - 1e-9);
    ASSERT_NEAR(peaks.highest.value, highest, 0.02);
  }
}

TEST(ProfilePeaks, NameTheJumpBetweenTwoLines) {
  const Profile profile =
      planSpline(0, restAt(0.0), {{kSecond, 10.0, {}, {}}, {2 * kSecond, -20.0, {}, {}}});
  const ProfilePeaks peaks = profilePeaks(profile);
  EXPECT_DOUBLE_EQ(peaks.velocity_jump.value, -40.0);
  EXPECT_DOUBLE_EQ(peaks.velocity_jump.time_s, 1.0);
}

// What a planner sends: a trapezoid of velocity exactly at the limits, sampled at even times from a
// phase on.
struct SampledTrapezoid {
  double length;
  double speed;
  double acceleration;

  double ramp() const { return speed / acceleration; }
  double duration() const { return length / speed + ramp(); }
  Waypoint at(double t, bool with_acceleration) const {
    const double left = duration() - t;
    const double way = t < ramp()      ? acceleration * t * t / 2.0
                       : left < ramp() ? length - acceleration * left * left / 2.0
                                       : speed * (t - ramp() / 2.0);
    const double v = acceleration * std::max(0.0, std::min({t, ramp(), left}));
    Waypoint made{std::llround(t * 1e9), way, v, {}};
    if (with_acceleration)
      made.acceleration = t < ramp() ? acceleration : left > ramp() ? 0.0 : -acceleration;
    return made;
  }
  std::vector<Waypoint> samples(double period, double phase, bool with_acceleration) const {
    std::vector<Waypoint> made;
    for (double t = phase * period; t < duration() - 1e-6; t += period) {
      if (t > 0.0) made.push_back(at(t, with_acceleration));
    }
    made.push_back({std::llround(duration() * 1e9), length, 0.0, {}});
    if (with_acceleration) made.back().acceleration = 0.0;
    return made;
  }
};

TEST(Spline, KeepsTheLimitsThatTheSamplesOfATrapezoidKeep) {
  const SampledTrapezoid trapezoid{8000.0, 8000.0, 40000.0};
  const double speed = trapezoid.speed;
  const double acceleration = trapezoid.acceleration;
  double without = 0.0;
  for (const bool with_acceleration : {true, false}) {
    for (const double period : {0.1, 0.05, 0.02, 0.01}) {
      for (const double phase : {1.0, 0.1, 1.0 / 3.0, 0.5, 0.77, 0.99}) {
        const std::vector<Waypoint> points = trapezoid.samples(period, phase, with_acceleration);
        const ProfilePeaks plain = profilePeaks(planSpline(0, {}, points));
        without = std::max(without, std::abs(plain.acceleration.value) / acceleration);
        const Profile profile = planSpline(0, {}, points, {acceleration, speed, 1.01});
        const ProfilePeaks peaks = profilePeaks(profile);
        const std::string which = "period " + std::to_string(period) + " s, phase " +
                                  std::to_string(phase) +
                                  (with_acceleration ? ", with accelerations" : "");
        EXPECT_LE(std::abs(peaks.acceleration.value), 1.01 * acceleration) << which;
        EXPECT_LE(std::abs(peaks.velocity.value), 1.01 * speed) << which;
        EXPECT_LE(std::abs(peaks.velocity_jump.value), 1e-6 * speed) << which;
        EXPECT_EQ(profile.stateAt(points.back().time_ns).position.value(), 8000.0) << which;
      }
    }
  }
  EXPECT_GT(without, 1.3) << "the test needs samples whose quintics and cubics overshoot";
}

// Velocities that change evenly, at up to the limits, between points at any times: over twelve
// decades.
TEST(Spline, IsNeverHeldAgainstAPlanWithinTheLimits) {
  std::mt19937 random(7);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  const auto decades = [&](double low, double high) {
    return low * std::pow(high / low, unit(random));
  };
  int replaced = 0;
  for (int i = 0; i < 4000; ++i) {
    const double time = 1e-9 * std::ceil(1e9 * decades(1e-6, 1e6));
    const double speed = decades(1e-3, 1e9);
    const double acceleration = speed / time * decades(1e-2, 1e2);
    // Three stretches of an even acceleration each, within the limits.
    const double v0 = speed * (2.0 * unit(random) - 1.0);
    double v = v0;
    double way = 0.0;
    double left = time;
    for (int k = 0; k < 3; ++k) {
      const double part = k == 2 ? left : left * unit(random);
      const double change = std::clamp(acceleration * part * (2.0 * unit(random) - 1.0) * 2.0,
                                       -acceleration * part, acceleration * part);
      const double next = std::clamp(v + change, -speed, speed);
      way += part * (v + next) / 2.0;
      v = next;
      left -= part;
    }
    // The last waypoint is a whole step.
    if (!(std::abs(way) < 1e12)) continue;
    const std::vector<Waypoint> points = {
        {std::llround(time * 1e9), way, v, 0.0},
        {std::llround(time * 1e9) + 1000 * kSecond, 0.0, 0.0, 0.0}};
    const MotionState from{0.0, v0, unit(random) < 0.5 ? 0.0 : acceleration};
    const auto first = [&](double beyond) {
      std::vector<Piece> pieces;
      const Profile whole = planSpline(0, from, points, {acceleration, speed, beyond});
      for (std::size_t k = 0; k < whole.pieceCount(); ++k) {
        if (whole.pieceStart(k).value() < time * (1.0 - 1e-9)) pieces.push_back(whole.piece(k));
      }
      return Profile(0, pieces);
    };
    const Profile plain = first(1e300);
    const Profile kept = first(1.0001);
    if (kept.pieceCount() != plain.pieceCount()) ++replaced;
    const ProfilePeaks peaks = profilePeaks(kept, v0, v);
    ASSERT_LE(std::abs(peaks.acceleration.value), 1.0002 * acceleration) << i;
    ASSERT_LE(std::abs(peaks.velocity.value), 1.0002 * speed) << i;
    ASSERT_LE(std::abs(peaks.velocity_jump.value), 1e-6 * speed) << i;
  }
  EXPECT_GT(replaced, 200);
}

void expectRefused(const std::vector<Waypoint>& waypoints, const std::string& words) {
  try {
    planSpline(0, restAt(0.0), waypoints);
    ADD_FAILURE() << "accepted; expected: " << words;
  } catch (const std::exception& error) {
    EXPECT_NE(std::string(error.what()).find(words), std::string::npos) << error.what();
  }
}

TEST(Spline, RefusesWhatItCannotFollow) {
  const double infinity = std::numeric_limits<double>::infinity();
  expectRefused({}, "0 waypoints");
  expectRefused({{0, 1.0, {}, {}}}, "at least 1 ns");
  expectRefused({{-1, 1.0, {}, {}}}, "waypoint 0 is -1 ns");
  expectRefused({{5, 1.0, {}, {}}, {5, 1.0, {}, {}}}, "waypoint 1 is 5 ns");
  expectRefused({{5, std::nan(""), {}, {}}}, "position of waypoint 0 is nan");
  expectRefused({{5, 1e15, {}, {}}}, "position of waypoint 0 is 1000000000000000");
  expectRefused({{5, 1.0, infinity, {}}}, "velocity of waypoint 0 is inf");
  expectRefused({{5, 1.0, 0.0, -infinity}}, "acceleration of waypoint 0 is -inf");
  expectRefused({{kSecond, 1.0, 1e300, {}}}, "on the way to waypoint 0");
  expectRefused({{kSecond, 1.0, 1.0, 1e300}}, "on the way to waypoint 0");
  expectRefused({{4'000'000'000 * kSecond, 1.0, {}, {}}}, "126 years");
}

}  // namespace
}  // namespace stepdriver::motion
