#include "path_timing/acceleration_limited.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <functional>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "profile/profile_peaks.h"
#include "support/constants.h"
#include "support/path_line.h"
#include "support/random_path.h"
#include "trajectory/spline.h"

// The motion along a path: within all limits, and as fast as they allow. A unit is a microstep.

namespace stepdriver {
namespace {

using motion::CurveSegment;
using motion::Path;
using motion::PathPoint;
using motion::Profile;
using motion::TimingKnot;
using motion::TimingLimits;
using test::kPi;
using test::lineTo;

// What the engine follows on one axis.
Profile profileOf(const Path& path, const std::vector<TimingKnot>& knots, std::size_t axis) {
  std::vector<motion::Waypoint> waypoints;
  for (const TimingKnot& knot : knots) {
    waypoints.push_back({knot.time_ns, knot.positions[axis], knot.velocities[axis], {}});
  }
  motion::MotionState from;
  from.position = path.start()[axis];
  return motion::planSpline(0, from, waypoints);
}

double durationOf(const std::vector<TimingKnot>& knots) {
  return static_cast<double>(knots.back().time_ns) * 1e-9;
}

// The shortest time in which a fine grid can be passed: with s'' constant on each interval and the
// limits kept in its middle, by bisection of the speed at each place.
class FineGrid {
 public:
  FineGrid(const Path& path, const std::vector<TimingLimits>& limits)
      : path_(path), limits_(limits) {
    for (std::size_t i = 0; i < path.size(); ++i) {
      const double first = path.roundedUntil(i);
      const double last = path.roundedFrom(i);
      addSpan(i, 0.0, first);
      addSpan(i, first, last);
      addSpan(i, last, 1.0);
      if (path.stopsAfter(i)) intervals_.back().stops = true;
    }
  }

  double shortestTime() const {
    std::vector<double> reachable(intervals_.size() + 1, 0.0);
    for (std::size_t i = intervals_.size(); i-- > 1;) {
      if (intervals_[i - 1].stops) continue;
      double low = 0.0;
      double high = std::min(intervals_[i].cap, intervals_[i - 1].cap);
      if (feasible(i, high, reachable[i + 1])) low = high;
      for (int k = 0; k < 60 && low < high; ++k) {
        const double x = (low + high) / 2.0;
        (feasible(i, x, reachable[i + 1]) ? low : high) = x;
      }
      reachable[i] = low;
    }
    double time = 0.0;
    double x = 0.0;
    for (std::size_t i = 0; i < intervals_.size(); ++i) {
      const double length = intervals_[i].length;
      const double u = range(i, x, reachable[i + 1]).high;
      const double next = std::max(0.0, x + 2.0 * length * u);
      time += 2.0 * length / (std::sqrt(x) + std::sqrt(next));
      x = next;
    }
    return time;
  }

 private:
  struct Interval {
    double length = 0.0;
    double cap = 0.0;
    bool stops = false;  // at its end
    std::vector<double> first;
    std::vector<double> second;
  };
  struct Range {
    double low;
    double high;
  };

  void addSpan(std::size_t segment, double from, double to) {
    constexpr int kParts = 300;
    if (!(to - from > 1e-9)) return;
    for (int i = 0; i < kParts; ++i) {
      const double h = (to - from) / kParts;
      PathPoint point;
      path_.evaluate(segment, from + (i + 0.5) * h, point);
      Interval made;
      double square = 0.0;
      double along = 0.0;
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        square += point.first[j] * point.first[j];
        along += point.first[j] * point.second[j];
      }
      const double rate = std::sqrt(square);
      made.length = rate * h;
      made.cap = path_.speed(segment) * path_.speed(segment);
      for (std::size_t j = 0; j < limits_.size(); ++j) {
        made.first.push_back(point.first[j] / rate);
        made.second.push_back((point.second[j] - point.first[j] * along / square) / square);
        const double speed = limits_[j].speed / std::abs(made.first[j]);
        made.cap = std::min(made.cap, speed * speed);
      }
      intervals_.push_back(std::move(made));
    }
  }

  // s'' that lead from x to at most `end`.
  Range range(std::size_t index, double x, double end) const {
    const Interval& interval = intervals_[index];
    const double twice = 2.0 * interval.length;
    Range u{-x / twice, (end - x) / twice};
    for (std::size_t j = 0; j < limits_.size(); ++j) {
      const bool up = interval.first[j] > 0.0;
      const double most = up ? limits_[j].acceleration : limits_[j].deceleration;
      const double least = -(up ? limits_[j].deceleration : limits_[j].acceleration);
      // first u + second (x + length u)
      const double factor = interval.first[j] + interval.second[j] * interval.length;
      const double rest = interval.second[j] * x;
      if (std::abs(factor) < 1e-12) {
        if (rest > most || rest < least) return {1.0, 0.0};
        continue;
      }
      const double a = (most - rest) / factor;
      const double b = (least - rest) / factor;
      u.low = std::max(u.low, std::min(a, b));
      u.high = std::min(u.high, std::max(a, b));
    }
    return u;
  }
  bool feasible(std::size_t index, double x, double end) const {
    const Range u = range(index, x, end);
    return u.low <= u.high;
  }

  const Path& path_;
  const std::vector<TimingLimits>& limits_;
  std::vector<Interval> intervals_;
};

// The points of the path as given, close to each other.
std::vector<std::vector<double>> samplesOf(const Path& path, std::size_t segment) {
  std::vector<std::vector<double>> samples;
  PathPoint point;
  for (int i = 0; i <= 2000; ++i) {
    path.evaluateGiven(segment, i / 2000.0, point);
    samples.push_back(point.position);
  }
  return samples;
}

double distanceToLine(const std::vector<double>& point, const std::vector<double>& a,
                      const std::vector<double>& b) {
  double square = 0.0;
  double along = 0.0;
  for (std::size_t j = 0; j < point.size(); ++j) {
    square += (b[j] - a[j]) * (b[j] - a[j]);
    along += (point[j] - a[j]) * (b[j] - a[j]);
  }
  const double part = square > 0.0 ? std::clamp(along / square, 0.0, 1.0) : 0.0;
  double sum = 0.0;
  for (std::size_t j = 0; j < point.size(); ++j) {
    const double away = point[j] - a[j] - part * (b[j] - a[j]);
    sum += away * away;
  }
  return std::sqrt(sum);
}

TEST(AccelerationLimitedTiming, OfALineIsATrapezoid) {
  const Path path({0.0}, {lineTo({1000.0}, 0.0)}, 1.0);
  const std::vector<TimingKnot> knots =
      motion::planAccelerationLimited(path, {{1000.0, 2000.0, 4000.0}}).knots;
  // 1000/1000 + 1000/2/2000 + 1000/2/4000
  EXPECT_NEAR(durationOf(knots), 1.375, 1e-9);
  ASSERT_EQ(knots.size(), 4U);
  EXPECT_EQ(knots[1].time_ns, 500'000'000);
  EXPECT_NEAR(knots[2].positions[0], 875.0, 1e-9);
}

TEST(AccelerationLimitedTiming, OfACircleKeepsItsSpeed) {
  CurveSegment arc;
  arc.shape = CurveSegment::Shape::kArc;
  arc.plane = {0, 1};
  arc.centre = {-1600.0, 0.0};
  arc.angle = 2.0 * kPi;
  arc.end = {0.0, 0.0};
  arc.speed = 8000.0;
  const Path path({0.0, 0.0}, {arc}, 1.0);
  const std::vector<TimingLimits> limits(2, {8000.0, 80'000.0, 80'000.0});
  // L/v + v/a: the circle needs half of the acceleration at its speed, and the ramps are short.
  const double expected = 2.0 * kPi * 1600.0 / 8000.0 + 0.1;
  EXPECT_NEAR(durationOf(motion::planAccelerationLimited(path, limits).knots), expected,
              0.01 * expected);
}

TEST(AccelerationLimitedTiming, StopsOnlyWhereItHasTo) {
  const Path path(
      {0.0, 0.0},
      {lineTo({1000.0, 0.0}, 20.0), lineTo({1000.0, 1000.0}, 0.0), lineTo({0.0, 1000.0}, 20.0)},
      1.0);
  const std::vector<TimingKnot> knots =
      motion::planAccelerationLimited(path, {{1000.0, 2000.0, 2000.0}, {1000.0, 2000.0, 2000.0}})
          .knots;
  int stops = 0;
  for (const TimingKnot& knot : knots) {
    if (knot.velocities[0] != 0.0 || knot.velocities[1] != 0.0) continue;
    ++stops;
    if (stops == 2) {
      EXPECT_EQ(knot.positions, (std::vector<double>{1000.0, 1000.0}));
    }
  }
  EXPECT_EQ(stops, 3);
}

// What a plan costs grows with its knots.
TEST(AccelerationLimitedTiming, IsNearlyTimeOptimalWithFewKnots) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> way(-160.0, 160.0);
  std::vector<double> place(3, 0.0);
  std::vector<CurveSegment> segments;
  for (int i = 0; i < 200; ++i) {
    for (double& x : place) x += way(random);
    segments.push_back(lineTo(place, 4.0));
  }
  const Path path({0.0, 0.0, 0.0}, segments, 1.0);
  const std::vector<TimingLimits> limits(3, {8000.0, 80'000.0, 80'000.0});
  const std::vector<TimingKnot> knots = motion::planAccelerationLimited(path, limits).knots;
  EXPECT_LE(knots.size(), 19 * segments.size());
  EXPECT_LE(durationOf(knots), 1.004 * FineGrid(path, limits).shortestTime());
}

// A curve that is given as many chords is nearly as fast as the curve: their roundings overlap. The
// axes pass the shortest ones here in 0.15 ms, and knots are at least 20 us apart.
TEST(AccelerationLimitedTiming, IsNearlyTimeOptimalOnDenseChords) {
  constexpr int kChords = 200;
  for (const double length : {30.0, 10.0, 3.0, 0.3}) {
    const double radius = length * kChords / (2.0 * kPi);
    std::vector<CurveSegment> segments;
    for (int i = 1; i <= kChords; ++i) {
      const double angle = 2.0 * kPi * i / kChords;
      segments.push_back(
          lineTo({radius * (std::cos(angle) - 1.0), 0.5 * radius * std::sin(angle)}, 1.6));
    }
    const Path path({0.0, 0.0}, segments, 1.0);
    const std::vector<TimingLimits> limits(2, {100'000.0, 400'000.0, 400'000.0});
    EXPECT_LE(durationOf(motion::planAccelerationLimited(path, limits).knots),
              1.001 * FineGrid(path, limits).shortestTime())
        << "chords of " << length << " microsteps";
  }
}

// 10,000 chords of 0.1 mm at up to 0.1 m/s, 1 m/s^2, with a tolerance of 0.05 mm.
double secondsOfChords(const std::function<double(int)>& turnAt) {
  constexpr double kLength = 8.0;  // microsteps
  std::vector<CurveSegment> segments;
  std::vector<double> place(2, 0.0);
  double direction = 0.0;
  for (int i = 0; i < 10'000; ++i) {
    direction += turnAt(i);
    place[0] += kLength * std::cos(direction);
    place[1] += kLength * std::sin(direction);
    segments.push_back(lineTo(place, 4.0));
  }
  const Path path({0.0, 0.0}, segments, 1.0);
  return durationOf(motion::planAccelerationLimited(path, {2, {8000.0, 80'000.0, 80'000.0}}).knots);
}

TEST(AccelerationLimitedTiming, UsesTheToleranceOnDenseChords) {
  // A curve with a radius of 10 mm or more: at least 10 s less what the tolerance cuts off.
  EXPECT_LE(secondsOfChords([](int i) { return 0.01 * std::sin(2.0 * kPi * i / 700.0); }), 9.6);
  std::mt19937 random(5);
  std::uniform_real_distribution<double> turn(-0.1, 0.1);
  EXPECT_LE(secondsOfChords([&](int) { return turn(random); }), 16.5);
}

// On random paths: limits, rest at both ends, the distance from the path, and the duration against
// the fine grid's. That isn't fine enough for the last paths, whose Beziers lack handles.
TEST(AccelerationLimitedTiming, KeepsLimitsAndIsTimeOptimalOnRandomPaths) {
  std::mt19937 random(2026);
  constexpr int kPaths = 1000;
  constexpr int kWithoutHandles = 200;
  double worst_ratio = 0.0;
  double ratios = 0.0;
  double worst_excess = 0.0;
  double worst_distance = 0.0;
  for (int i = 0; i < kPaths + kWithoutHandles; ++i) {
    test::RandomPath given_path = test::randomPath(random);
    if (i >= kPaths) test::dropHandles(given_path);
    const Path path = given_path.path();
    const std::vector<TimingKnot> knots =
        motion::planAccelerationLimited(path, given_path.limits).knots;
    ASSERT_EQ(knots.front().time_ns, 0);
    std::vector<Profile> profiles;
    for (std::size_t axis = 0; axis < path.axes(); ++axis) {
      const TimingLimits& limits = given_path.limits[axis];
      ASSERT_EQ(knots.front().velocities[axis], 0.0);
      ASSERT_EQ(knots.back().velocities[axis], 0.0);
      ASSERT_NEAR(knots.back().positions[axis], given_path.segments.back().end[axis], 1e-9);
      profiles.push_back(profileOf(path, knots, axis));
      const motion::ProfilePeaks peaks = motion::profilePeaks(profiles.back());
      const double speed = std::abs(peaks.velocity.value) / limits.speed;
      ASSERT_LE(speed, 1.0 + 1e-6) << "path " << i << " axis " << axis;
      // A rounded time of a nanosecond may make a jump of the velocity times 1e-9/s.
      ASSERT_LE(std::abs(peaks.velocity_jump.value), 1e-9 * limits.speed) << "path " << i;
      for (const motion::Piece& piece : profiles.back().pieces()) {
        const double v0 = piece.v0;
        const double v1 = piece.velocityAt(piece.duration).value();
        for (const double a : {piece.a, piece.accelerationAt(piece.duration).value()}) {
          const double rounding = 1e-6 * std::max(std::abs(v0), std::abs(v1));
          const bool turns = std::min(v0, v1) < -rounding && std::max(v0, v1) > rounding;
          const double least = std::min(limits.acceleration, limits.deceleration);
          const bool rises = a * (v0 + v1) > 0.0;
          const double most = turns ? least : rises ? limits.acceleration : limits.deceleration;
          worst_excess = std::max(worst_excess, std::abs(a) / most);
          ASSERT_LE(std::abs(a), most * (1.0 + 1e-3))
              << "path " << i << " axis " << axis << " v " << v0 << ' ' << v1;
        }
      }
    }
    if (i < kPaths) {
      const double ratio = durationOf(knots) / FineGrid(path, given_path.limits).shortestTime();
      worst_ratio = std::max(worst_ratio, ratio);
      ratios += ratio;
      EXPECT_LE(ratio, 1.02) << "path " << i << " of " << path.size() << " segments, "
                             << path.axes() << " axes";
      EXPECT_GE(ratio, 0.98) << "path " << i;
    }
    if (i % 10 != 0) continue;
    for (std::size_t k = 1; k < knots.size(); ++k) {
      const std::size_t segment = knots[k].segment;
      double tolerance = 0.0;
      std::vector<std::vector<double>> samples;
      for (std::size_t near = segment - std::min<std::size_t>(segment, 1);
           near < std::min(segment + 2, path.size()); ++near) {
        const auto more = samplesOf(path, near);
        samples.insert(samples.end(), more.begin(), more.end());
        tolerance = std::max(tolerance, given_path.segments[near].tolerance);
      }
      const std::int64_t time = (knots[k - 1].time_ns + knots[k].time_ns) / 2;
      std::vector<double> place;
      for (const Profile& profile : profiles) {
        place.push_back(profile.stateAt(time).position.value());
      }
      double nearest = std::numeric_limits<double>::infinity();
      for (std::size_t s = 1; s < samples.size(); ++s) {
        nearest = std::min(nearest, distanceToLine(place, samples[s - 1], samples[s]));
      }
      worst_distance = std::max(worst_distance, nearest - tolerance);
      // The chords of the samples deviate too.
      ASSERT_LE(nearest, tolerance + 0.1) << "path " << i << " knot " << k;
    }
  }
  EXPECT_LE(ratios / kPaths, 1.002);
  RecordProperty("worst_ratio", std::to_string(worst_ratio));
  RecordProperty("worst_acceleration", std::to_string(worst_excess));
  RecordProperty("worst_distance", std::to_string(worst_distance));
}

}  // namespace
}  // namespace stepdriver
