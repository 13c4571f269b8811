#include "path_timing/jerk_limited.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "geometry/path_grid.h"
#include "support/constants.h"
#include "support/jerk_limited_optimum.h"
#include "support/path_line.h"
#include "support/random_path.h"

// The motion along a path with jerk limits: within all limits, on the path, and how much longer it
// takes than without them. A unit is a microstep.

namespace stepdriver {
namespace {

using motion::Continuity;
using motion::CurveSegment;
using motion::Path;
using motion::PathPoint;
using motion::TimingKnot;
using motion::TimingLimits;
using test::kPi;
using test::lineTo;

double secondsOf(const std::vector<TimingKnot>& knots) {
  return static_cast<double>(knots.back().time_ns) * 1e-9;
}

// A quintic between two knots, at a part u of its duration.
struct QuinticState {
  double position;
  double velocity;
  double acceleration;
  double jerk;
};

QuinticState quinticAt(const TimingKnot& from, const TimingKnot& to, std::size_t axis, double u) {
  const double h = static_cast<double>(to.time_ns - from.time_ns) * 1e-9;
  const double way = to.positions[axis] - from.positions[axis];
  const double v0 = h * from.velocities[axis];
  const double v1 = h * to.velocities[axis];
  const double a0 = h * h * from.accelerations[axis] / 2.0;
  const double a1 = h * h * to.accelerations[axis] / 2.0;
  const double c3 = 10.0 * way - 6.0 * v0 - 4.0 * v1 - 3.0 * a0 + a1;
  const double c4 = -15.0 * way + 8.0 * v0 + 7.0 * v1 + 3.0 * a0 - 2.0 * a1;
  const double c5 = 6.0 * way - 3.0 * v0 - 3.0 * v1 - a0 + a1;
  return {from.positions[axis] + u * (v0 + u * (a0 + u * (c3 + u * (c4 + u * c5)))),
          (v0 + u * (2.0 * a0 + u * (3.0 * c3 + u * (4.0 * c4 + u * 5.0 * c5)))) / h,
          (2.0 * a0 + u * (6.0 * c3 + u * (12.0 * c4 + u * 20.0 * c5))) / (h * h),
          (6.0 * c3 + u * (24.0 * c4 + u * 60.0 * c5)) / (h * h * h)};
}

// How far a point is from the path near some of its segments.
class NearPath {
 public:
  NearPath(const Path& path, std::size_t first, std::size_t last)
      : path_(path), first_(first), last_(last) {
    for (std::size_t near = first - std::min<std::size_t>(first, 1);
         near < std::min(last + 2, path.size()); ++near) {
      for (int i = 0; i <= kParts; ++i) {
        path.evaluate(near, static_cast<double>(i) / kParts, point_);
        places_.push_back({near, static_cast<double>(i) / kParts, point_.position});
      }
    }
  }
  bool isOf(std::size_t first, std::size_t last) const { return first == first_ && last == last_; }

  double distance(const std::vector<double>& position) {
    std::vector<double> squares;
    for (const Place& place : places_) squares.push_back(squareTo(position, place.position));
    double least = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < places_.size(); ++i) {
      const bool before = i % (kParts + 1) == 0 || squares[i] <= squares[i - 1];
      const bool after = i % (kParts + 1) == kParts || squares[i] <= squares[i + 1];
      if (before && after) least = std::min(least, leastAround(places_[i], position));
    }
    return std::sqrt(least);
  }

 private:
  static constexpr int kParts = 400;
  struct Place {
    std::size_t segment;
    double parameter;
    std::vector<double> position;
  };

  static double squareTo(const std::vector<double>& a, const std::vector<double>& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
    return sum;
  }

  double leastAround(const Place& place, const std::vector<double>& position) {
    const auto square_at = [&](double u) {
      path_.evaluate(place.segment, u, point_);
      return squareTo(position, point_.position);
    };
    double low = std::max(0.0, place.parameter - 1.0 / kParts);
    double high = std::min(1.0, place.parameter + 1.0 / kParts);
    for (int i = 0; i < 60; ++i) {
      const double third = (high - low) / 3.0;
      if (square_at(low + third) < square_at(high - third)) {
        high -= third;
      } else {
        low += third;
      }
    }
    return square_at(low);
  }

  const Path& path_;
  std::size_t first_;
  std::size_t last_;
  PathPoint point_;
  std::vector<Place> places_;
};

TEST(JerkLimitedTiming, OfALineHasTheSevenPhasesOfTheFastest) {
  const auto duration = [](double length, const TimingLimits& limits) {
    const Path path({0.0}, {lineTo({length}, 0.0)}, 1.0, Continuity::kCurvature);
    return secondsOf(motion::planJerkLimited(path, {limits}).knots);
  };
  // 1000/1000 + 1000/5000 + 5000/50000
  EXPECT_NEAR(duration(1000.0, {1000.0, 5000.0, 5000.0, 50'000.0}), 1.3, 1e-6);
  // Without the highest speed: sqrt((a/j)^2 + 4 length/a) + a/j
  EXPECT_NEAR(duration(1000.0, {1e6, 5000.0, 5000.0, 50'000.0}), std::sqrt(0.01 + 0.8) + 0.1, 1e-6);
  // Without the highest acceleration: 4 cbrt(length/(2 j))
  EXPECT_NEAR(duration(1000.0, {1e6, 1e6, 1e6, 50'000.0}),
              4.0 * std::cbrt(1000.0 / (2.0 * 50'000.0)), 1e-6);
}

TEST(JerkLimitedTiming, PassesACircleOfLinesWithoutStopping) {
  std::vector<CurveSegment> segments;
  for (int i = 1; i <= 100; ++i) {
    const double angle = 2.0 * kPi * i / 100.0;
    segments.push_back(lineTo({1600.0 * std::cos(angle) - 1600.0, 1600.0 * std::sin(angle)}, 1.6));
  }
  const std::vector<TimingLimits> limits(2, {8000.0, 80'000.0, 80'000.0, 1.6e6});
  const Path path({0.0, 0.0}, segments, 1.0, Continuity::kCurvature);
  const double smooth = secondsOf(motion::planJerkLimited(path, limits).knots);
  const double fastest = secondsOf(motion::planAccelerationLimited(path, limits).knots);
  RecordProperty("smooth", std::to_string(smooth));
  RecordProperty("fastest", std::to_string(fastest));
  EXPECT_LE(smooth, 1.5 * fastest);
}

// The moving average that the optimum begins with takes 1.502 s. At 0.1 m/s and without ramps, the
// circle would take 1.257 s.
TEST(JerkLimitedTiming, PassesDenseChordsNearlyAtTheirHighestSpeed) {
  std::vector<CurveSegment> segments;
  for (int i = 1; i <= 1000; ++i) {
    const double angle = 2.0 * kPi * i / 1000.0;
    segments.push_back(lineTo({1600.0 * std::cos(angle) - 1600.0, 1600.0 * std::sin(angle)}, 4.0));
  }
  const std::vector<TimingLimits> limits(2, {8000.0, 80'000.0, 80'000.0, 1.6e6});
  const Path path({0.0, 0.0}, segments, 1.0, Continuity::kCurvature);
  EXPECT_LE(secondsOf(motion::planJerkLimited(path, limits).knots), 1.31);
}

// On random paths: limits, rest at both ends, the distance from the path, and the duration against
// that without a jerk limit, which no motion with one can go below by more than the 2 % or so that
// it is above its own optimum (see IsNearTheOptimumOnRandomPaths). The Beziers of the last paths
// lack handles.
TEST(JerkLimitedTiming, KeepsLimitsOnRandomPaths) {
  std::mt19937 random(2027);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  constexpr int kPaths = 1000;
  constexpr int kWithoutHandles = 200;
  double worst_ratio = 0.0;
  double ratios = 0.0;
  double worst_jerk = 0.0;
  double worst_distance = 0.0;
  for (int i = 0; i < kPaths + kWithoutHandles; ++i) {
    test::RandomPath given_path = test::randomPath(random);
    if (i >= kPaths) test::dropHandles(given_path);
    // Accelerations that take 1 to 100 ms to build up; some axes have no jerk limit.
    for (std::size_t axis = 0; axis < given_path.limits.size(); ++axis) {
      if (axis > 0 && number(0.0, 1.0) < 0.3) continue;
      given_path.limits[axis].jerk =
          given_path.limits[axis].acceleration * std::pow(10.0, number(1.0, 3.0));
    }
    const Path rounded = given_path.path(Continuity::kCurvature);
    const motion::PathTiming plan = motion::planJerkLimited(rounded, given_path.limits);
    const Path path = rounded.withStops(plan.stops);
    const std::vector<TimingKnot>& knots = plan.knots;
    ASSERT_EQ(knots.front().time_ns, 0);
    for (std::size_t axis = 0; axis < path.axes(); ++axis) {
      ASSERT_NEAR(knots.back().positions[axis], given_path.segments.back().end[axis], 1e-9);
      for (const TimingKnot* end : {&knots.front(), &knots.back()}) {
        ASSERT_EQ(end->velocities[axis], 0.0);
        ASSERT_EQ(end->accelerations[axis], 0.0);
      }
    }
    std::vector<NearPath> near;
    for (std::size_t k = 1; k < knots.size(); ++k) {
      const TimingKnot& from = knots[k - 1];
      const TimingKnot& to = knots[k];
      ASSERT_LT(from.time_ns, to.time_ns);
      constexpr int kParts = 10;
      std::vector<double> middle;
      for (std::size_t axis = 0; axis < path.axes(); ++axis) {
        const TimingLimits& limits = given_path.limits[axis];
        for (int part = 0; part <= kParts; ++part) {
          const QuinticState state = quinticAt(from, to, axis, static_cast<double>(part) / kParts);
          const double most = std::max(limits.acceleration, limits.deceleration);
          ASSERT_LE(std::abs(state.velocity), limits.speed * (1.0 + 1e-6)) << "path " << i;
          ASSERT_LE(std::abs(state.acceleration), most * (1.0 + 1e-3)) << "path " << i;
          ASSERT_LE(std::abs(state.jerk), limits.jerk * (1.0 + 1e-3))
              << "path " << i << " knot " << k << " axis " << axis;
          worst_jerk = std::max(worst_jerk, std::abs(state.jerk) / limits.jerk);
          if (2 * part == kParts) middle.push_back(state.position);
        }
      }
      if (i % 10 != 0) continue;
      if (near.empty() || !near.back().isOf(from.segment, to.segment)) {
        near.emplace_back(path, from.segment, to.segment);
      }
      const double distance = near.back().distance(middle);
      worst_distance = std::max(worst_distance, distance);
      ASSERT_LE(distance, 0.1) << "path " << i << " knot " << k << " of " << knots.size();
    }
    const double ratio =
        secondsOf(knots) /
        secondsOf(motion::planAccelerationLimited(rounded, given_path.limits).knots);
    EXPECT_GE(ratio, 0.97) << "path " << i;
    if (i >= kPaths) continue;
    worst_ratio = std::max(worst_ratio, ratio);
    ratios += ratio;
  }
  EXPECT_LE(ratios / kPaths, 1.12);
  RecordProperty("mean_ratio", std::to_string(ratios / kPaths));
  RecordProperty("worst_ratio", std::to_string(worst_ratio));
  RecordProperty("worst_jerk", std::to_string(worst_jerk));
  RecordProperty("worst_distance", std::to_string(worst_distance));
}

// The largest part of its limits that an axis uses between two knots.
double demandBetween(const TimingKnot& from, const TimingKnot& to,
                     const std::vector<TimingLimits>& limits) {
  double most = 0.0;
  constexpr int kParts = 10;
  for (std::size_t axis = 0; axis < limits.size(); ++axis) {
    for (int part = 0; part <= kParts; ++part) {
      const QuinticState state = quinticAt(from, to, axis, static_cast<double>(part) / kParts);
      most = std::max({most, std::abs(state.velocity) / limits[axis].speed,
                       std::abs(state.acceleration) / limits[axis].acceleration,
                       std::abs(state.jerk) / limits[axis].jerk});
    }
  }
  return most;
}

// Only the places at which a limit is exceeded become slower: on 500 lines in random directions,
// the motion is at a limit in every part that takes a second, less the 0.15 of the jerk that is
// left for a stop along the path.
TEST(JerkLimitedTiming, IsNotSlowedDownAsAWholeForOnePlace) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> way(-160.0, 160.0);
  std::vector<CurveSegment> segments;
  std::vector<double> place(3, 0.0);
  for (int i = 0; i < 500; ++i) {
    for (double& x : place) x += way(random);
    segments.push_back(lineTo(place, 4.0));
  }
  const std::vector<TimingLimits> limits(3, {8000.0, 80'000.0, 80'000.0, 1.6e6});
  const Path path({0.0, 0.0, 0.0}, segments, 1.0, Continuity::kCurvature);
  const std::vector<TimingKnot> knots = motion::planJerkLimited(path, limits).knots;
  std::vector<double> demands(static_cast<std::size_t>(secondsOf(knots)) + 1, 0.0);
  for (std::size_t k = 1; k < knots.size(); ++k) {
    double& most = demands[static_cast<std::size_t>(knots[k].time_ns / 1'000'000'000)];
    most = std::max(most, demandBetween(knots[k - 1], knots[k], limits));
  }
  demands.pop_back();  // is shorter
  const double least = *std::min_element(demands.begin(), demands.end());
  EXPECT_GE(least, 0.84);
  RecordProperty("least", std::to_string(least));
  RecordProperty("seconds", std::to_string(secondsOf(knots)));
}

// The same path, with stops at all corners or with one tolerance for all of them.
double secondsWithTolerance(std::vector<double> start, std::vector<CurveSegment> segments,
                            const std::vector<TimingLimits>& limits, double tolerance) {
  for (CurveSegment& segment : segments) segment.tolerance = tolerance;
  const Path path(std::move(start), segments, 1.0, Continuity::kCurvature);
  return secondsOf(motion::planJerkLimited(path, limits).knots);
}

// The motion stops at tight corners: passing them takes longer.
TEST(JerkLimitedTiming, StopsAtCornersThatItCanNotPassFaster) {
  constexpr double kMillimetre = 80.0;
  const std::vector<double> tolerances{0.08, 0.8, 4.0, 8.0};
  const auto expect_not_slower = [&](const char* name, const std::vector<CurveSegment>& segments,
                                     const std::vector<TimingLimits>& limits) {
    const std::vector<double> start(limits.size(), 0.0);
    const double stopping = secondsWithTolerance(start, segments, limits, 0.0);
    for (const double tolerance : tolerances) {
      EXPECT_LE(secondsWithTolerance(start, segments, limits, tolerance), 1.001 * stopping)
          << name << " with " << tolerance;
    }
  };
  const TimingLimits limit{8000.0, 80'000.0, 80'000.0, 1.6e6};
  std::vector<CurveSegment> zigzag;
  for (int i = 1; i <= 4; ++i) {
    zigzag.push_back(lineTo({i * kMillimetre, i % 2 == 0 ? 0.0 : 2.0 * kMillimetre}, 0.0));
  }
  expect_not_slower("zigzag", zigzag, {2, limit});

  std::mt19937 random(5);
  std::uniform_real_distribution<double> way(-2.0 * kMillimetre, 2.0 * kMillimetre);
  std::vector<CurveSegment> lines;
  std::vector<double> place(3, 0.0);
  for (int i = 0; i < 100; ++i) {
    for (double& x : place) x += way(random);
    lines.push_back(lineTo(place, 0.0));
  }
  expect_not_slower("random lines", lines, {3, limit});
  // With stops at all corners 13.4 s; with lines and corners planned as averages 12.94 s.
  EXPECT_LE(secondsWithTolerance({0.0, 0.0, 0.0}, lines, {3, limit}, 4.0), 12.8);

  const double length = 1000.0 * kMillimetre;
  CurveSegment arc;
  arc.shape = CurveSegment::Shape::kArc;
  arc.plane = {0, 1};
  arc.angle = 1.0;
  arc.centre = {length - length / 2.0 * std::sin(1.0), length / 2.0 * std::cos(1.0)};
  const double end = 2.0 - kPi / 2.0;
  arc.end = {arc.centre[0] + length / 2.0 * std::cos(end),
             arc.centre[1] + length / 2.0 * std::sin(end)};
  expect_not_slower("line and arc", {lineTo({length, 0.0}, 0.0), arc},
                    {2, {40'000.0, 160'000.0, 160'000.0, 4e6}});
}

// What is appended to a path may begin in the middle of a corner, from where there is no way to a
// stop at it.
TEST(JerkLimitedTiming, BeginsInTheMiddleOfACorner) {
  std::mt19937 random(37);
  std::uniform_real_distribution<double> part(0.0, 1.0);
  int begun = 0;
  for (int run = 0; run < 200; ++run) {
    test::RandomPath drawn = test::randomPath(random);
    for (TimingLimits& limit : drawn.limits) limit.jerk = limit.acceleration * 50.0;
    const Path path = drawn.path(Continuity::kCurvature);
    if (path.size() < 2 || path.blendAfter(0) == 0.0) continue;
    motion::TimingStart begin;
    begin.parameter = 1.0;
    begin.speed = part(random) < 0.5 ? 1.0 : 100.0 * part(random);
    const motion::PathTiming made = motion::planJerkLimited(path, drawn.limits, begin);
    if (made.excess > 1.0 + 1e-3) continue;
    ++begun;
    ASSERT_FALSE(made.knots.empty()) << run;
    PathPoint corner;
    path.evaluate(0, 1.0, corner);
    EXPECT_NEAR(made.knots.front().positions[0], corner.position[0], 1e-6) << run;
    EXPECT_EQ(made.knots.back().segment, path.size() - 1) << run;
  }
  EXPECT_GT(begun, 20);
}

TEST(JerkLimitedTiming, IsNotSlowerThanWithStopsOnRandomPaths) {
  std::mt19937 random(2027);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  double worst = 0.0;
  for (int i = 0; i < 250; ++i) {
    test::RandomPath given_path = test::randomPath(random);
    for (TimingLimits& limits : given_path.limits) {
      limits.jerk = limits.acceleration * std::pow(10.0, number(0.0, 3.0));
    }
    const double stopping =
        secondsWithTolerance(given_path.start, given_path.segments, given_path.limits, 0.0);
    for (const double tolerance : {0.02, 0.3, 4.0, 50.0, 600.0}) {
      const double seconds =
          secondsWithTolerance(given_path.start, given_path.segments, given_path.limits, tolerance);
      EXPECT_LE(seconds, 1.001 * stopping) << "path " << i << " with " << tolerance;
      worst = std::max(worst, seconds / stopping);
    }
  }
  RecordProperty("worst", std::to_string(worst));
}

// The distance and the speed along a section at a time, from its knots.
class AlongSection {
 public:
  AlongSection(const motion::PathGrid& grid, const std::vector<TimingKnot>& knots) : knots_(knots) {
    double begin = 0.0;
    std::size_t interval = 0;
    for (const TimingKnot& knot : knots) {
      const auto ends_before = [&](const motion::PathGrid::Interval& of) {
        return of.segment < knot.segment || (of.segment == knot.segment && of.to < knot.parameter);
      };
      while (interval + 1 < grid.size() && ends_before(grid[interval])) {
        begin += grid[interval++].length;
      }
      const motion::PathGrid::Interval& in = grid[interval];
      const double part = std::clamp((knot.parameter - in.from) / (in.to - in.from), 0.0, 1.0);
      distances_.push_back(begin + part * in.length);
    }
  }

  struct State {
    double distance;
    double speed;
  };
  State at(double time) const {
    std::size_t k = 1;
    while (k + 1 < knots_.size() && static_cast<double>(knots_[k].time_ns) * 1e-9 < time) ++k;
    const double begin = static_cast<double>(knots_[k - 1].time_ns) * 1e-9;
    const double h = static_cast<double>(knots_[k].time_ns) * 1e-9 - begin;
    const double u = std::clamp((time - begin) / h, 0.0, 1.0);
    const double v0 = h * knots_[k - 1].speed;
    const double v1 = h * knots_[k].speed;
    const double way = distances_[k] - distances_[k - 1];
    const double c2 = 3.0 * way - 2.0 * v0 - v1;
    const double c3 = v0 + v1 - 2.0 * way;
    return {distances_[k - 1] + u * (v0 + u * (c2 + u * c3)),
            (v0 + u * (2.0 * c2 + u * 3.0 * c3)) / h};
  }

 private:
  const std::vector<TimingKnot>& knots_;
  std::vector<double> distances_;
};

// [s] The optimum between two stops, at places that the planned motion passes at even times.
double optimumOf(const Path& section, const std::vector<TimingLimits>& limits,
                 const std::vector<TimingKnot>& knots, int parts) {
  const motion::PathGrid grid(section);
  std::vector<double> begins{0.0};
  for (std::size_t i = 0; i < grid.size(); ++i) begins.push_back(begins.back() + grid[i].length);
  const AlongSection along(grid, knots);
  std::vector<test::JerkLimitedOptimum::Place> places;
  std::vector<double> squares;
  PathPoint point;
  PathPoint before;
  PathPoint after;
  std::size_t interval = 0;
  for (int i = 0; i <= parts; ++i) {
    const AlongSection::State state = along.at(secondsOf(knots) * i / parts);
    const double distance = i == parts ? begins.back() : state.distance;
    if (i > 0 && i < parts && distance < places.back().distance + 1e-9 * begins.back()) continue;
    while (interval + 1 < grid.size() && begins[interval + 1] <= distance) ++interval;
    const double in = std::clamp(distance - begins[interval], 0.0, grid[interval].length);
    grid.evaluateAt(interval, in, point);
    test::JerkLimitedOptimum::Place place{distance, std::numeric_limits<double>::infinity(),
                                          point.first, point.second,
                                          std::vector<double>(limits.size())};
    if (!grid[interval].straight) {
      const double near = std::max(0.0, in - 1e-3 * grid[interval].length);
      const double far = std::min(grid[interval].length, in + 1e-3 * grid[interval].length);
      grid.evaluateAt(interval, near, before);
      grid.evaluateAt(interval, far, after);
      for (std::size_t j = 0; j < limits.size(); ++j) {
        place.third[j] = (after.second[j] - before.second[j]) / (far - near);
      }
    }
    const std::vector<bool>& measured = section.measured(grid[interval].segment);
    double sum = 0.0;
    for (std::size_t j = 0; j < limits.size(); ++j) {
      const double square = point.first[j] * point.first[j];
      if (measured.empty() || measured[j]) sum += square;
      if (square > 0.0)
        place.most = std::min(place.most, limits[j].speed * limits[j].speed / square);
    }
    const double speed = section.speed(grid[interval].segment);
    if (sum > 0.0) place.most = std::min(place.most, speed * speed / sum);
    places.push_back(std::move(place));
    squares.push_back(std::max(1e-12, state.speed * state.speed));
  }
  return test::JerkLimitedOptimum(std::move(places), limits, std::move(squares)).duration();
}

TEST(JerkLimitedTiming, HasAKnownOptimumOnALine) {
  const auto durations = [](double length, const TimingLimits& limit) {
    const Path path({0.0}, {lineTo({length}, 0.0)}, 1.0, Continuity::kCurvature);
    const std::vector<TimingLimits> limits{limit};
    const std::vector<TimingKnot> knots = motion::planJerkLimited(path, limits).knots;
    return std::pair(secondsOf(knots), optimumOf(path, limits, knots, 400));
  };
  for (const double jerk : {20'000.0, 50'000.0, 1e6}) {
    const auto [planned, found] = durations(1000.0, {1000.0, 5000.0, 5000.0, jerk});
    EXPECT_NEAR(found, 1.0 + 0.2 + 5000.0 / jerk, 0.01 * planned);
    EXPECT_NEAR(found, planned, 0.01 * planned);
  }
}

// How much longer the planned motion takes than an optimum with the same limits.
TEST(JerkLimitedTiming, IsNearTheOptimumOnRandomPaths) {
  std::mt19937 random(2027);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  constexpr int kPaths = 100;
  double ratios = 0.0;
  double worst = 0.0;
  double jerk_ratios = 0.0;
  for (int i = 0; i < kPaths; ++i) {
    test::RandomPath given_path = test::randomPath(random);
    for (TimingLimits& limits : given_path.limits) {
      limits.jerk = limits.acceleration * std::pow(10.0, number(1.0, 3.0));
    }
    const Path path = given_path.path(Continuity::kCurvature);
    double planned = 0.0;
    double optimum = 0.0;
    for (std::size_t first = 0; first < path.size();) {
      std::size_t last = first;
      while (!path.stopsAfter(last) && last + 1 < path.size()) ++last;
      const Path section = path.part(first, last);
      const std::vector<TimingKnot> knots =
          motion::planJerkLimited(section, given_path.limits).knots;
      planned += secondsOf(knots);
      optimum += optimumOf(section, given_path.limits, knots, 600);
      first = last + 1;
    }
    const double ratio = planned / optimum;
    EXPECT_GE(ratio, 0.98) << "path " << i;
    ratios += ratio;
    worst = std::max(worst, ratio);
    jerk_ratios +=
        optimum / secondsOf(motion::planAccelerationLimited(path, given_path.limits).knots);
  }
  EXPECT_LE(ratios / kPaths, 1.02);
  EXPECT_LE(worst, 1.15);
  RecordProperty("mean_ratio", std::to_string(ratios / kPaths));
  RecordProperty("worst_ratio", std::to_string(worst));
  RecordProperty("optimum_with_jerk_to_without", std::to_string(jerk_ratios / kPaths));
}

// Far from 0, with a tiny and a very long line at the end, and accelerations that take 10 us to 10
// s to build up: rounding doesn't take the jerk beyond what a trajectory may have.
TEST(JerkLimitedTiming, KeepsTheJerkAtExtremes) {
  std::mt19937 random(77);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 100; ++i) {
    test::RandomPath given_path = test::randomPath(random);
    const double offset = number(0.0, 1.0) < 0.5 ? 0.0 : 1e7;
    const auto shift = [&](std::vector<double>& position) {
      for (double& x : position) x += offset;
    };
    shift(given_path.start);
    for (CurveSegment& segment : given_path.segments) {
      shift(segment.end);
      shift(segment.control1);
      shift(segment.control2);
      for (double& x : segment.centre) x += offset;
    }
    std::vector<double> end = given_path.segments.back().end;
    for (const double length : {0.001, 1e6}) {
      end[0] += length;
      given_path.segments.push_back(lineTo(end, 0.1));
    }
    for (TimingLimits& limits : given_path.limits) {
      limits.jerk = limits.acceleration * std::pow(10.0, number(-1.0, 5.0));
    }
    const Path path = given_path.path(Continuity::kCurvature);
    const std::vector<TimingKnot> knots = motion::planJerkLimited(path, given_path.limits).knots;
    for (std::size_t axis = 0; axis < path.axes(); ++axis) {
      for (std::size_t k = 1; k < knots.size(); ++k) {
        for (const double u : {0.0, 0.5, 1.0}) {
          const QuinticState state = quinticAt(knots[k - 1], knots[k], axis, u);
          ASSERT_LE(std::abs(state.jerk), 1.01 * given_path.limits[axis].jerk)
              << "path " << i << " knot " << k << " axis " << axis;
        }
      }
    }
  }
}

}  // namespace
}  // namespace stepdriver
