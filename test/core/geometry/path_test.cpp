#include "geometry/path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstddef>
#include <random>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "profile/errors.h"
#include "support/constants.h"
#include "support/path_line.h"
#include "support/random_path.h"

// The geometry of paths: what rounds a corner, and how far it is from the corner.

namespace stepdriver {
namespace {

using motion::Continuity;
using motion::CurveSegment;
using motion::Path;
using motion::PathPoint;
using test::kPi;
using test::lineTo;

double distance(const std::vector<double>& a, const std::vector<double>& b) {
  double sum = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) sum += (a[i] - b[i]) * (a[i] - b[i]);
  return std::sqrt(sum);
}

// The direction and the curvature of a path at a place.
struct Shape {
  std::vector<double> direction;
  std::vector<double> curvature;
};

Shape shapeOf(const PathPoint& point) {
  const double rate = distance(point.first, std::vector<double>(point.first.size()));
  double along = 0.0;
  for (std::size_t i = 0; i < point.first.size(); ++i) along += point.first[i] * point.second[i];
  Shape shape;
  for (std::size_t i = 0; i < point.first.size(); ++i) {
    shape.direction.push_back(point.first[i] / rate);
    shape.curvature.push_back((point.second[i] - point.first[i] * along / (rate * rate)) /
                              (rate * rate));
  }
  return shape;
}

TEST(Path, RoundsACornerByTheTolerance) {
  const Path path({0.0, 0.0}, {lineTo({100.0, 0.0}, 2.0), lineTo({100.0, 100.0}, 0.0)}, 1.0);
  // d = tolerance / (3/8 sin 45)
  const double d = 2.0 / (0.375 * std::sin(kPi / 4.0));
  EXPECT_NEAR(path.roundedFrom(0), 1.0 - d / 100.0, 1e-12);
  EXPECT_NEAR(path.roundedUntil(1), d / 100.0, 1e-12);
  EXPECT_FALSE(path.stopsAfter(0));
  PathPoint middle;
  path.evaluate(0, 1.0, middle);
  EXPECT_NEAR(distance(middle.position, {100.0, 0.0}), 2.0, 1e-12);
  EXPECT_NEAR(middle.position[0] - 100.0, -middle.position[1], 1e-12);
}

TEST(Path, RoundsAtMostHalfOfASegment) {
  const Path path({0.0, 0.0},
                  {lineTo({10.0, 0.0}, 50.0), lineTo({10.0, 6.0}, 50.0), lineTo({20.0, 6.0}, 0.0)},
                  1.0);
  EXPECT_NEAR(path.roundedUntil(1), 0.5, 1e-12);
  EXPECT_NEAR(path.roundedFrom(1), 0.5, 1e-12);
  EXPECT_NEAR(path.roundedFrom(0), 0.7, 1e-12);
}

TEST(Path, StopsWithoutToleranceAndAtATurn) {
  const double turn = 171.0 / 180.0 * kPi;
  const std::vector<double> back{10.0 + 10.0 * std::cos(turn), 10.0 * std::sin(turn)};
  const auto stops = [](const std::vector<double>& end, double tolerance) {
    return Path({0.0, 0.0}, {lineTo({10.0, 0.0}, tolerance), lineTo(end, 0.0)}, 1.0).stopsAfter(0);
  };
  EXPECT_TRUE(stops({10.0, 10.0}, 0.0));
  EXPECT_FALSE(stops({10.0, 10.0}, 0.1));
  EXPECT_TRUE(stops({0.0, 0.0}, 1.0));
  EXPECT_TRUE(stops(back, 1.0));
  EXPECT_FALSE(stops({20.0, 0.0}, 0.0)) << "a straight line has no corner";
}

TEST(Path, PassesATangentArcUnchanged) {
  CurveSegment arc;
  arc.shape = CurveSegment::Shape::kArc;
  arc.plane = {0, 1};
  arc.centre = {10.0, 5.0};
  arc.angle = kPi / 2.0;
  arc.end = {15.0, 5.0, 7.0};
  const Path path({0.0, 0.0, 0.0}, {lineTo({10.0, 0.0, 0.0}, 1.0), arc}, 1.0);
  // The third axis begins to move with the arc: a corner.
  EXPECT_LT(path.roundedFrom(0), 1.0);
  arc.end[2] = 0.0;
  const Path flat({0.0, 0.0, 0.0}, {lineTo({10.0, 0.0, 0.0}, 1.0), arc}, 1.0);
  EXPECT_EQ(flat.roundedFrom(0), 1.0);
  EXPECT_FALSE(flat.stopsAfter(0));
  PathPoint point;
  flat.evaluate(1, 1.0, point);
  EXPECT_NEAR(distance(point.position, arc.end), 0.0, 1e-12);
  EXPECT_NEAR(point.first[1], 5.0 * kPi / 2.0, 1e-12);
}

TEST(Path, RoundsAJumpOfTheCurvatureIfItHasToBeContinuous) {
  CurveSegment arc;
  arc.shape = CurveSegment::Shape::kArc;
  arc.plane = {0, 1};
  arc.centre = {10.0, 5.0};
  arc.angle = kPi / 2.0;
  arc.end = {15.0, 5.0};
  const auto path = [&](double tolerance) {
    return Path({0.0, 0.0}, {lineTo({10.0, 0.0}, tolerance), arc}, 1.0, Continuity::kCurvature);
  };
  // 0.0108 d^2/5 = tolerance
  EXPECT_NEAR(path(1e-3).roundedFrom(0), 1.0 - std::sqrt(1e-3 * 5.0 / 0.0108) / 10.0, 1e-9);
  EXPECT_NEAR(path(1.0).roundedFrom(0), 1.0 - 1.25 / 10.0, 1e-12) << "a quarter of the radius";
  EXPECT_FALSE(path(1e-3).stopsAfter(0));
  EXPECT_TRUE(path(0.0).stopsAfter(0));
  const Path straight({0.0, 0.0}, {lineTo({10.0, 0.0}, 0.0), lineTo({20.0, 0.0}, 0.0)}, 1.0,
                      Continuity::kCurvature);
  EXPECT_FALSE(straight.stopsAfter(0));
}

// Lines of very different lengths that turn a little at each corner, and some not at all.
std::vector<CurveSegment> overlappingLines(std::mt19937& random) {
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  std::vector<CurveSegment> lines;
  std::vector<double> end{0.0, 0.0, 0.0};
  double direction = 0.0;
  for (int i = 0; i < 60; ++i) {
    if (number(0.0, 1.0) > 0.1) direction += number(0.0, 1.0) < 0.02 ? 1.0 : number(-0.1, 0.2);
    const double length = std::pow(10.0, number(0.0, 2.0));
    end[0] += length * std::cos(direction);
    end[1] += length * std::sin(direction);
    end[2] += 0.1 * length;
    lines.push_back(lineTo(end, number(0.0, 1.0) < 0.03 ? 0.0 : number(0.5, 2.0)));
  }
  return lines;
}

// What gentle lines must keep: the deviation, continuity, and a derivative that isn't small.
void expectGentle(const Path& path, const std::vector<CurveSegment>& lines, int* overlaps) {
  PathPoint point;
  PathPoint given;
  path.evaluate(0, 0.0, point);
  ASSERT_LT(distance(point.position, path.start()), 1e-12);
  for (std::size_t segment = 0; segment < path.size(); ++segment) {
    const double first = path.roundedUntil(segment);
    const double last = path.roundedFrom(segment);
    ASSERT_LE(first, last);
    *overlaps += first == last ? 1 : 0;
    const double before = segment == 0 ? 0.0 : lines[segment - 1].tolerance;
    // A corner without a turn has no rounding of its own: its neighbours' count.
    double most = std::max(before, lines[segment].tolerance);
    if (segment > 1) most = std::max(most, lines[segment - 2].tolerance);
    if (segment + 1 < path.size()) most = std::max(most, lines[segment + 1].tolerance);
    for (int k = 0; k <= 100; ++k) {
      const double u = k / 100.0;
      path.evaluate(segment, u, point);
      path.evaluateGiven(segment, u, given);
      ASSERT_LE(distance(point.position, given.position), most * (1.0 + 1e-9) + 1e-9)
          << "segment " << segment << " at " << u;
      const std::vector<double> zero(3);
      ASSERT_GT(distance(point.first, zero), 0.49 * distance(given.first, zero));
      if (u > first + 1e-9 && u < last - 1e-9) {
        ASSERT_LT(distance(point.position, given.position), 1e-12);
      }
    }
    if (segment + 1 == path.size()) continue;
    const Shape in = shapeOf(point);
    path.evaluate(segment + 1, 0.0, given);
    ASSERT_LT(distance(point.position, given.position), 1e-9);
    if (path.stopsAfter(segment)) {
      ASSERT_LT(distance(point.position, lines[segment].end), 1e-9);
      continue;
    }
    const Shape out = shapeOf(given);
    ASSERT_LT(distance(in.direction, out.direction), 1.1e-6);
    ASSERT_LT(distance(in.curvature, out.curvature), 1e-6) << "segment " << segment;
  }
}

TEST(Path, OverlapsTheRoundingsOfShortLines) {
  std::mt19937 random(11);
  int overlaps = 0;
  for (int i = 0; i < 100; ++i) {
    SCOPED_TRACE("path " + std::to_string(i));
    const std::vector<CurveSegment> lines = overlappingLines(random);
    const Path path({0.0, 0.0, 0.0}, lines, 1.0, Continuity::kCurvature);
    ASSERT_NO_FATAL_FAILURE(expectGentle(path, lines, &overlaps));
  }
  EXPECT_GT(overlaps, 2000);
}

// A path that continues: what was rounded up to a place on it stays as it is, and the other
// corners are rounded again, together with those of the added lines.
TEST(Path, KeepsTheRoundingsThatHaveBegun) {
  std::mt19937 random(12);
  int overlaps = 0;
  int widened = 0;
  for (int i = 0; i < 100; ++i) {
    SCOPED_TRACE("path " + std::to_string(i));
    std::vector<CurveSegment> lines = overlappingLines(random);
    const std::size_t count =
        std::uniform_int_distribution<std::size_t>(2, lines.size() - 1)(random);
    const std::vector<double> start(3);
    const Path shorter(start, {lines.begin(), lines.begin() + static_cast<std::ptrdiff_t>(count)},
                       1.0, Continuity::kCurvature, true);
    const std::size_t at = std::uniform_int_distribution<std::size_t>(0, count - 1)(random);
    const double parameter = std::uniform_real_distribution<double>(0.0, 1.0)(random);
    double away = 0.0;
    for (std::size_t k = 0; k + 1 < count; ++k) {
      const double length = distance(k == 0 ? start : lines[k - 1].end, lines[k].end);
      if (k >= at) away += k == at ? (1.0 - parameter) * length : length;
      if (k < at || shorter.blendAfter(k) > away) lines[k].blend = shorter.blendAfter(k);
    }
    lines[at].kept = parameter;
    const Path longer(start, lines, 1.0, Continuity::kCurvature);
    PathPoint before;
    PathPoint after;
    for (std::size_t segment = 0; segment <= at; ++segment) {
      for (int k = 0; k <= 20; ++k) {
        const double u = k / 20.0 * (segment == at ? parameter : 1.0);
        shorter.evaluate(segment, u, before);
        longer.evaluate(segment, u, after);
        ASSERT_LT(distance(before.position, after.position), 1e-9) << segment << " at " << u;
        ASSERT_LT(distance(before.first, after.first), 1e-9) << segment << " at " << u;
      }
    }
    widened +=
        longer.blendAfter(count - 1) > distance(lines[count - 2].end, lines[count - 1].end) / 2.0;
    ASSERT_NO_FATAL_FAILURE(expectGentle(longer, lines, &overlaps));
  }
  EXPECT_GT(overlaps, 1000);
  EXPECT_GT(widened, 20);
}

TEST(Path, FindsTheCircleOfAnArc) {
  const motion::Arc arc = motion::arcThrough({1.0, 0.0}, {0.0, 1.0}, {-1.0, 0.0});
  EXPECT_NEAR(arc.centre[0], 0.0, 1e-12);
  EXPECT_NEAR(arc.centre[1], 0.0, 1e-12);
  EXPECT_NEAR(arc.angle, kPi, 1e-12);
  EXPECT_NEAR(motion::arcThrough({1.0, 0.0}, {0.0, -1.0}, {0.0, 1.0}).angle, -1.5 * kPi, 1e-12);
  EXPECT_EQ(motion::arcThrough({0.0, 0.0}, {1.0, 1.0}, {3.0, 3.0}).angle, 0.0);
  EXPECT_EQ(motion::arcThrough({0.0, 0.0}, {3.0, 3.0}, {3.0, 3.0}).angle, 0.0);
  EXPECT_NEAR(motion::arcAround({1.0, 0.0}, {0.0, 0.0}, {1.0, 0.0}, true).angle, -2.0 * kPi, 1e-12);
  EXPECT_NEAR(motion::arcAround({1.0, 0.0}, {0.0, 0.0}, {0.0, 1.0}, true).angle, -1.5 * kPi, 1e-12);
}

// 1000 and 1001 from the centre: the radius changes evenly, and so does the angle.
TEST(Path, OfAnArcWhoseEndsAreNotEquallyFarHasARadiusThatChangesEvenly) {
  CurveSegment segment = lineTo({-1001.0, 0.0}, 0.0);
  segment.shape = CurveSegment::Shape::kArc;
  segment.plane = {0, 1};
  segment.angle = motion::arcAround({1000.0, 0.0}, {0.0, 0.0}, {-1001.0, 0.0}, false).angle;
  EXPECT_NEAR(segment.angle, kPi, 1e-12);
  const Path path({1000.0, 0.0}, {segment}, 1.0);
  PathPoint before;
  PathPoint point;
  PathPoint after;
  double most = 0.0;
  for (int i = 0; i <= 1000; ++i) {
    const double u = i / 1000.0;
    path.evaluate(0, u, point);
    EXPECT_NEAR(std::hypot(point.position[0], point.position[1]), 1000.0 + u, 1e-9);
    most = std::max(most, point.position[1]);
    constexpr double kStep = 1e-4;
    path.evaluate(0, u - kStep, before);
    path.evaluate(0, u + kStep, after);
    for (std::size_t k = 0; k < 2; ++k) {
      EXPECT_NEAR(point.first[k], (after.position[k] - before.position[k]) / (2.0 * kStep), 1e-3);
      EXPECT_NEAR(point.second[k], (after.first[k] - before.first[k]) / (2.0 * kStep), 1e-3);
    }
  }
  EXPECT_NEAR(path.range(0, 1).second, most, 1e-2);
  EXPECT_GE(path.range(0, 1).second, most);
  EXPECT_NEAR(path.range(0, 0).first, -1001.0, 1e-9);
}

TEST(Path, RefusesACusp) {
  CurveSegment bezier;
  bezier.shape = CurveSegment::Shape::kBezier;
  bezier.end = {10.0, 0.0};
  bezier.control1 = {10.0, 10.0};
  bezier.control2 = {0.0, 10.0};
  EXPECT_THROW(Path({0.0, 0.0}, {bezier}, 1.0), motion::Malformed);
  bezier.control1 = {9.0, 10.0};
  EXPECT_NO_THROW(Path({0.0, 0.0}, {bezier}, 1.0));
}

// As many drawings have: the curve is as given, and has a direction everywhere.
TEST(Path, TakesABezierWithAControlPointAtItsEnd) {
  std::mt19937 random(12);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 500; ++i) {
    const double size = std::pow(10.0, number(0.5, 6.0));
    const auto place = [&] {
      return std::vector<double>{number(-size, size), number(-size, size), number(-size, size)};
    };
    const std::vector<double> start = place();
    CurveSegment bezier;
    bezier.shape = CurveSegment::Shape::kBezier;
    bezier.end = place();
    bezier.control1 = i % 3 == 1 ? place() : start;
    bezier.control2 = i % 3 == 0 ? place() : bezier.end;
    if (i % 7 == 0) bezier.control2 = start;
    const Path path(start, {bezier}, 1.0);
    PathPoint point;
    for (int k = 0; k <= 100; ++k) {
      const double u = k / 100.0;
      path.evaluate(0, u, point);
      ASSERT_GT(distance(point.first, {0.0, 0.0, 0.0}), 0.1) << i << " at " << u;
      if (i % 3 == 2) continue;  // a straight line has another parameter
      double square = 0.0;
      for (std::size_t j = 0; j < 3; ++j) {
        const double given = std::pow(1.0 - u, 3.0) * start[j] +
                             3.0 * u * (1.0 - u) * (1.0 - u) * bezier.control1[j] +
                             3.0 * u * u * (1.0 - u) * bezier.control2[j] +
                             u * u * u * bezier.end[j];
        square += (point.position[j] - given) * (point.position[j] - given);
      }
      ASSERT_LT(std::sqrt(square), 0.1) << i << " at " << u;
    }
  }
}

// An axis that stands still on the next segment would otherwise move by a rounding.
TEST(Path, HasTheSamePlaceAtBothSidesOfACorner) {
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {
    const test::RandomPath made = test::randomPath(random);
    for (const Continuity continuity : {Continuity::kDirection, Continuity::kCurvature}) {
      const Path path = made.path(continuity);
      PathPoint begin;
      PathPoint end;
      PathPoint near;
      for (std::size_t k = 0; k < path.size(); ++k) {
        path.evaluateGiven(k, 0.0, begin);
        path.evaluateGiven(k, 1.0, end);
        EXPECT_EQ(begin.position, k == 0 ? made.start : made.segments[k - 1].end);
        EXPECT_EQ(end.position, made.segments[k].end);
        // Nor does it jump there.
        path.evaluateGiven(k, 1.0 - 1e-15, near);
        EXPECT_LE(distance(near.position, end.position), 1e-9) << "segment " << k;
        if (k + 1 == path.size()) continue;
        path.evaluate(k, 1.0, end);
        path.evaluate(k + 1, 0.0, begin);
        EXPECT_EQ(begin.position, end.position) << "segment " << k;
      }
    }
  }
}

TEST(Path, HasNoRoundingBeyondAnEndThatIsNotRounded) {
  const Path path({0.0, 0.0}, {lineTo({10.0, 0.0}, 1.0), lineTo({20.0, 0.0}, 1.0)}, 1.0);
  PathPoint point;
  for (const auto& [segment, parameter] : {std::pair{0, 1.0 + 1e-9}, std::pair{1, -1e-9}}) {
    path.evaluate(static_cast<std::size_t>(segment), parameter, point);
    EXPECT_NEAR(point.position[0], 10.0, 2e-8);
    EXPECT_EQ(point.first, (std::vector<double>{10.0, 0.0}));
  }
}

TEST(Path, KnowsTheRangeOfEachAxis) {
  std::mt19937 random(7);
  for (int i = 0; i < 200; ++i) {
    const Path path = test::randomPath(random).path();
    PathPoint point;
    for (std::size_t segment = 0; segment < path.size(); ++segment) {
      for (std::size_t axis = 0; axis < path.axes(); ++axis) {
        const auto [low, high] = path.range(segment, axis);
        double lowest = high;
        double highest = low;
        for (int k = 0; k <= 2000; ++k) {
          path.evaluateGiven(segment, k / 2000.0, point);
          lowest = std::min(lowest, point.position[axis]);
          highest = std::max(highest, point.position[axis]);
        }
        const double close = 1e-5 * (1.0 + high - low);
        ASSERT_NEAR(low, lowest, close) << i << " segment " << segment << " axis " << axis;
        ASSERT_NEAR(high, highest, close) << i << " segment " << segment << " axis " << axis;
      }
    }
  }
}

// Corners of every two shapes: within the tolerance, tangential, with a curvature that is
// continuous where the rounding begins and ends (and, if it has to be, in its middle), and never
// without a direction.
void expectRounded(Continuity continuity) {
  std::mt19937 random(20);
  int corners = 0;
  for (int i = 0; i < 400; ++i) {
    const test::RandomPath given_path = test::randomPath(random);
    const Path path = given_path.path(continuity);
    PathPoint point;
    PathPoint given;
    const auto shape_at = [&](std::size_t segment, double parameter) {
      path.evaluate(segment, parameter, point);
      return shapeOf(point);
    };
    for (std::size_t segment = 0; segment < path.size(); ++segment) {
      const double first = path.roundedUntil(segment);
      const double last = path.roundedFrom(segment);
      ASSERT_LE(first, last);
      const double before = segment == 0 ? 0.0 : given_path.segments[segment - 1].tolerance;
      for (int k = 0; k <= 1000; ++k) {
        const double u = k / 1000.0;
        path.evaluate(segment, u, point);
        path.evaluateGiven(segment, u, given);
        const double after = given_path.segments[segment].tolerance;
        // Roundings that overlap reach beyond half of a line.
        const double most = std::max(before, after);
        ASSERT_LE(distance(point.position, given.position), most * (1.0 + 1e-9) + 1e-9)
            << "path " << i << " segment " << segment << " at " << u;
        ASSERT_GT(distance(point.first, std::vector<double>(path.axes())), 0.0);
      }
      if (segment + 1 == path.size() || path.stopsAfter(segment)) continue;
      ASSERT_LT(distance(shape_at(segment, 1.0).direction, shape_at(segment + 1, 0.0).direction),
                1.1e-6)
          << "path " << i << " segment " << segment;
      if (continuity == Continuity::kCurvature) {
        const std::vector<double> in = shape_at(segment, 1.0).curvature;
        const std::vector<double> out = shape_at(segment + 1, 0.0).curvature;
        const double zero = distance(in, std::vector<double>(path.axes()));
        ASSERT_LT(distance(in, out), 1e-5 * zero + 1e-12) << "path " << i << " segment " << segment;
      }
      if (last == 1.0) continue;
      ++corners;
      const double scale = distance(point.first, std::vector<double>(path.axes()));
      for (const double edge : {first, last}) {
        if (edge < 1e-6 || edge > 1.0 - 1e-6) continue;
        struct Change {
          double direction;
          double curvature;
          double rounding;  // by which the curvature is rounded
        };
        const auto change = [&](double away) {
          const Shape in = shape_at(segment, edge - away);
          const Shape out = shape_at(segment, edge + away);
          const double size = distance(in.curvature, std::vector<double>(path.axes()));
          return Change{distance(in.direction, out.direction),
                        distance(in.curvature, out.curvature) * scale, 1e-6 * size * scale};
        };
        // It doesn't jump if it changes the less, the nearer both places are.
        const Change near = change(1e-8);
        const Change far = change(1e-7);
        ASSERT_LT(near.direction, 0.2 * far.direction + 1.1e-6)
            << "path " << i << " segment " << segment;
        ASSERT_LT(near.curvature, 0.2 * far.curvature + 1e-3 + near.rounding)
            << "path " << i << " segment " << segment;
      }
    }
  }
  EXPECT_GT(corners, 500);
}

TEST(Path, StaysWithinTheToleranceOnRandomPaths) { expectRounded(Continuity::kDirection); }

TEST(Path, StaysWithinTheToleranceWithAContinuousCurvature) {
  expectRounded(Continuity::kCurvature);
}

}  // namespace
}  // namespace stepdriver
