#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/planned_path.h"
#include "support/refusal.h"

// Segments that lead nowhere, ends next to a microstep, and arcs with two radii: drawings and CAM
// programs contain them.

namespace stepdriver {
namespace {

using motion::PathRequest;
using motion::PathSegment;
using test::kPi;
using test::pathAxis;
using test::planned;
using test::PlannedPath;

constexpr double kPerMetre = 80'000.0;  // microsteps/m

PathSegment lineTo(double x, double y) {
  PathSegment segment;
  segment.end = {x, y};
  return segment;
}

PathSegment arcTo(double x, double y, std::array<double, 2> centre) {
  PathSegment segment = lineTo(x, y);
  segment.shape = PathSegment::Shape::kArcAround;
  segment.plane = {"x", "y"};
  segment.point = centre;
  return segment;
}

PathRequest pathOf(std::vector<PathSegment> segments) {
  return {{"x", "y"}, std::move(segments), false, 0.0, 20e-6};
}

/// With and without a jerk limit [m/s^3].
class ShortSegments : public testing::TestWithParam<double> {
 protected:
  PlannedPath follow(const PathRequest& request) const { return planned(request, axes()); }
  std::vector<motion::PathAxis> axes() const {
    return {pathAxis("x", {kPerMetre, 0.1, 1.0, GetParam()}),
            pathAxis("y", {kPerMetre, 0.1, 1.0, GetParam()})};
  }
  void expectSameSteps(const PathRequest& request, const PathRequest& plain) const {
    const PlannedPath path = follow(request);
    const PlannedPath expected = follow(plain);
    EXPECT_EQ(path.steps(0), expected.steps(0));
    EXPECT_EQ(path.steps(1), expected.steps(1));
  }
};

INSTANTIATE_TEST_SUITE_P(Jerk, ShortSegments, testing::Values(0.0, 20.0));

TEST_P(ShortSegments, OfNoLengthAreLeftOut) {
  const PathSegment a = lineTo(0.010, 0.0);
  const PathSegment b = lineTo(0.010, 0.010);
  PathSegment doubled_bezier = b;
  doubled_bezier.shape = PathSegment::Shape::kBezier;
  doubled_bezier.control1 = doubled_bezier.control2 = b.end;
  const PathRequest plain = pathOf({a, b});
  expectSameSteps(pathOf({lineTo(0.0, 0.0), a, b}), plain);
  expectSameSteps(pathOf({a, a, a, b}), plain);
  expectSameSteps(pathOf({a, b, b}), plain);
  expectSameSteps(pathOf({a, b, doubled_bezier}), plain);
  expectSameSteps(pathOf({a, b, lineTo(0.010 + 1e-17, 0.010 - 1e-15)}), plain);
}

TEST_P(ShortSegments, AloneMakeNoStep) {
  const PlannedPath path = follow(pathOf({lineTo(0.0, 0.0), lineTo(1e-17, 0.0)}));
  EXPECT_TRUE(path.steps(0).empty());
  EXPECT_TRUE(path.steps(1).empty());
  EXPECT_LE(path.duration(), 1e-6);
  EXPECT_EQ(path.plan.targets, (std::vector<double>{0.0, 0.0}));
}

TEST_P(ShortSegments, ThatBeginAFedPathAreFollowedByTheOthers) {
  PathRequest request = pathOf({lineTo(0.0, 0.0)});
  request.more_follows = true;
  const PlannedPath path = test::fed(follow(request), {lineTo(0.010, 0.0)}, 0.0);
  EXPECT_EQ(path.endCount(0), 800);
}

TEST_P(ShortSegments, CloseAShape) {
  const PathRequest plain =
      pathOf({lineTo(0.010, 0.0), lineTo(0.010, 0.010), lineTo(0.0, 0.010), lineTo(0.0, 0.0)});
  PathRequest closed = plain;
  closed.segments.push_back(lineTo(1e-18, 0.0));
  expectSameSteps(closed, plain);
}

TEST_P(ShortSegments, UseTheLowerToleranceAtTheirCorner) {
  PathSegment stop = lineTo(0.010, 0.0);
  stop.tolerance = 0.0;
  const PathRequest path = pathOf({lineTo(0.010, 0.0), stop, lineTo(0.010, 0.010)});
  expectSameSteps(path, pathOf({stop, lineTo(0.010, 0.010)}));
}

TEST_P(ShortSegments, CountInARefusal) {
  EXPECT_REFUSED(follow(pathOf({lineTo(0.0, 0.0), lineTo(0.01, 0.0), lineTo(1e30, 0.0)})),
                 "segment 2 of the path");
}

// At 0 and at 10 m.
TEST_P(ShortSegments, AnEndNextToAMicrostepIsReached) {
  for (const double away : {0.0, 10.0}) {
    const double clean = follow(pathOf({lineTo(away + 0.01, 0.0), lineTo(away, 0.0)})).duration();
    for (const double off : {1e-17, -4.9e-18, 1e-14, 3e-11, -3e-11}) {
      SCOPED_TRACE(std::to_string(away) + " m and " + std::to_string(off * 1e15) + " fm");
      const PlannedPath path = follow(pathOf({lineTo(away + 0.01, 0.0), lineTo(away + off, 0.0)}));
      EXPECT_EQ(path.endCount(0), std::llround(away * kPerMetre));
      EXPECT_NEAR(path.duration(), clean, 1e-3);
    }
  }
}

TEST_P(ShortSegments, OctagonsAreClosed) {
  for (int size = 1; size <= 15; ++size) {
    SCOPED_TRACE(std::to_string(size) + " mm");
    const double radius = 1e-3 * size;
    std::vector<PathSegment> segments;
    for (int i = 1; i <= 8; ++i) {
      const double angle = 2.0 * kPi * i / 8.0;
      segments.push_back(lineTo(radius * (std::cos(angle) - 1.0), radius * std::sin(angle)));
    }
    const PlannedPath path = follow(pathOf(segments));
    EXPECT_EQ(path.endCount(0), 0);
    EXPECT_EQ(path.endCount(1), 0);
  }
}

TEST_P(ShortSegments, AnArcWithTwoRadiiEndsAtItsEnd) {
  struct Case {
    double radius;
    double off;
    bool taken;
  };
  for (const Case& given :
       {Case{0.001, 4.9e-6, true}, Case{0.001, -4.9e-6, true}, Case{0.001, 5.1e-6, false},
        Case{0.02, 19.9e-6, true}, Case{0.02, 20.1e-6, false}, Case{1.0, -0.499e-3, true},
        Case{1.0, 0.501e-3, false}}) {
    for (const double turn : {0.1, 0.25, 0.5, 0.75, 0.999, 1.0}) {
      SCOPED_TRACE(std::to_string(given.radius) + " m, " + std::to_string(turn) + " turns");
      const double end = given.radius + given.off;
      const double angle = 2.0 * kPi * turn;
      const double x = turn == 1.0 ? given.off : end * std::cos(angle) - given.radius;
      const double y = turn == 1.0 ? 0.0 : end * std::sin(angle);
      const PathRequest request = pathOf({arcTo(x, y, {-given.radius, 0.0})});
      if (!given.taken) {
        EXPECT_REFUSED(follow(request), "from its centre and ends");
        continue;
      }
      const PlannedPath path = follow(request);
      EXPECT_EQ(path.endCount(0), std::llround(x * kPerMetre));
      EXPECT_EQ(path.endCount(1), std::llround(y * kPerMetre));
      const auto steps = static_cast<double>(path.steps(1).size());
      if (turn < 1.0) continue;
      EXPECT_NEAR(steps, 4.0 * given.radius * kPerMetre, 6.0 + 0.004 * steps);
    }
  }
}

}  // namespace
}  // namespace stepdriver
