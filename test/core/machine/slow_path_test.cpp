#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/planned_path.h"

// Paths on which a ramp lasts microseconds and the way at constant speed minutes: what the plan
// leaves out of the ramp must not change the way.

namespace stepdriver {
namespace {

using motion::PathRequest;
using motion::PathSegment;
using test::AxisSteps;
using test::pathAxis;
using test::PathAxisLimits;
using test::planned;
using test::PlannedPath;

PathRequest lines(const std::vector<std::pair<double, double>>& ends_and_speeds) {
  PathRequest request{{"x"}, {}, false, 0.0, 0.0};
  for (const auto& [end, speed] : ends_and_speeds) {
    PathSegment& segment = request.segments.emplace_back();
    segment.end = {end};
    segment.velocity = speed;
  }
  return request;
}

/// Each step leads ahead, the last one to the end, and none comes sooner than the speeds allow.
void expectSteadySteps(const PathRequest& request, const PathAxisLimits& limits) {
  const PlannedPath path = planned(request, {pathAxis("x", limits)});
  const AxisSteps steps = path.steps(0);
  const double scale = limits.steps_per_unit;
  ASSERT_EQ(static_cast<std::int64_t>(steps.size()),
            std::llround(request.segments.back().end[0] * scale));
  double fastest = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    ASSERT_EQ(steps[i].second, 1) << "step " << i;
    if (i == 0) continue;
    const double interval = static_cast<double>(steps[i].first - steps[i - 1].first) * 1e-9;
    const double place = (static_cast<double>(i) - 0.5) / scale;
    // The last microstep of a segment may already have the speed of the next one.
    double allowed = 0.0;
    for (std::size_t k = 0; k < request.segments.size(); ++k) {
      const double begin = k == 0 ? 0.0 : request.segments[k - 1].end[0];
      const bool touches =
          begin <= place + 1.5 / scale && request.segments[k].end[0] >= place - 1.5 / scale;
      if (touches) allowed = std::max(allowed, request.segments[k].velocity);
    }
    fastest = std::max(fastest, 1.0 / (scale * interval) / allowed);
  }
  EXPECT_LE(fastest, 1.0001);
  double shortest = 0.0;
  double before = 0.0;
  for (const PathSegment& segment : request.segments) {
    shortest += (segment.end[0] - before) / segment.velocity;
    before = segment.end[0];
  }
  EXPECT_LE(path.duration(), shortest + 0.2);
}

TEST(SlowPath, OfAHalfMillimetreMakesItsFortySteps) {
  expectSteadySteps(lines({{0.0005, 7e-6}}), {80'000.0, 0.1, 3.0, 100.0});
}

TEST(SlowPath, OfARotaryAxisTurnsOnlyToItsEnd) {
  // 3200 microsteps a revolution.
  motion::PathAxis axis = pathAxis("x", {3200.0 / (2.0 * test::kPi), 10.0, 3000.0, 1e5});
  axis.kind = config::Kind::kRotary;
  const PlannedPath path = planned(lines({{0.5, 1e-3}}), {axis});
  const AxisSteps steps = path.steps(0);
  EXPECT_EQ(steps.size(), 255U);
  EXPECT_TRUE(std::all_of(steps.begin(), steps.end(), [](const auto& s) { return s.second == 1; }));
}

TEST(SlowPath, ThatSlowsDownOnTheWayStaysOnIt) {
  for (const double jerk : {10'000.0, 0.0}) {
    SCOPED_TRACE(jerk);
    expectSteadySteps(lines({{0.010, 1e-3}, {0.110, 1e-4}}), {80'000.0, 0.1, 60.0, jerk});
  }
}

TEST(SlowPath, KeepsItsSpeedAllAlongALine) {
  for (const double jerk : {1000.0, 0.0}) {
    SCOPED_TRACE(jerk);
    expectSteadySteps(lines({{0.002, 1e-5}}), {80'000.0, 0.1, 3.0, jerk});
  }
}

// x and y have a microstep a unit. There is no room for a rounding before the end at which the path
// stops, so the motion can't go on from the speed that it has right before it.
TEST(SlowPath, ThatIsContinuedNextToItsEndDoesNotPassIt) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 21.5, 3.31e4, 0.0}),
                                              pathAxis("y", {1.0, 5.62e5, 3.16e11, 0.0})};
  const auto line_to = [](double x, double y) {
    PathSegment segment;
    segment.end = {x, y};
    return segment;
  };
  PathRequest request{{"x", "y"}, {line_to(6.0, -2.0), line_to(432.0, 957.0)}, false, 0.0171, 10.4};
  request.more_follows = true;
  const PlannedPath first = planned(request, axes);
  for (const double part : {0.8, 0.99, 0.9999, 1.0}) {
    SCOPED_TRACE(part);
    const PlannedPath path = test::fed(first, {line_to(1475.0, 530.0)}, part * first.duration());
    std::int64_t count = 0;
    std::int64_t highest = 0;
    for (const auto& step : path.steps(1)) highest = std::max(highest, count += step.second);
    EXPECT_LE(highest, 957);
    EXPECT_GE(highest, 957 - 10) << "the tolerance of a corner that is still rounded";
    EXPECT_EQ(count, 530);
  }
}

// A knot right before the end of a line may be beyond it by rounding: there is no corner to round.
TEST(SlowPath, ThatIsContinuedAtTheVeryEndOfALineFollowsIt) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 1e6, 0.001, 11963015701203.42}),
                                              pathAxis("y", {1.0, 1e6, 1e12, 1e15})};
  const auto line_to = [](double x, double y, double velocity) {
    PathSegment segment;
    segment.end = {x, y};
    segment.velocity = velocity;
    return segment;
  };
  PathRequest request{{"x", "y"}, {}, false, 44.163953657607436, 0.00016340833237044595, true};
  request.segments = {line_to(0.10154743253002302, 0.0, 0.0), line_to(744.07185447244331, 0.0, 0.0),
                      line_to(744.81577395268141, 0.0, 313.21105492709307),
                      line_to(744.42605677204301, 1.4957532667175146, 0.0)};
  const PlannedPath first = planned(request, axes);
  const PlannedPath path = test::fed(first,
                                     {line_to(744.42663820597841, 1.4961840872570629, 0.0),
                                      line_to(1064.4813164357722, 1.4961840872570629, 0.0)},
                                     136.38848243120549);
  EXPECT_EQ(path.endCount(0), 1064);
  EXPECT_EQ(path.endCount(1), 1);
}

// While x moves fast, y rests: its low acceleration makes no difference to how the knots of x may
// lie.
TEST(SlowPath, BeforeAFastLineDoesNotMakeThatOneFaster) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 1e6, 1e12, 0.0}),
                                              pathAxis("y", {1.0, 1e6, 0.001, 0.0})};
  PathRequest request{{"x", "y"}, {}, false, 17'600.0, 0.0};
  for (const double x : {-170.0, -166.0}) {
    request.segments.emplace_back().end = {x, 133.0};
  }
  const PlannedPath path = planned(request, axes);
  const AxisSteps steps = path.steps(0);
  ASSERT_EQ(steps.size(), 174U);
  for (std::size_t i = 171; i < steps.size(); ++i) {
    EXPECT_GE(static_cast<double>(steps[i].first - steps[i - 1].first) * 1e-9 * 17'600.0, 0.999);
  }
}

// The lowest limits of y need a long time between knots for its way of a few roundings of a double.
// In that time, x and z could make the whole square.
TEST(SlowPath, OfAnAxisThatHardlyMovesLeavesOutNoWayOfTheOthers) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 1e6, 1e12, 1e15}),
                                              pathAxis("y", {1.0, 1e-3, 1e-3, 1e-3}),
                                              pathAxis("z", {1.0, 1e6, 1e12, 1e15})};
  for (const double way : {1e-13, 1e-12, 1e-11}) {
    SCOPED_TRACE(way);
    PathRequest request{{"x", "y", "z"}, {}, false, 0.0, 1.0};
    double y = 0.0;
    for (const auto& [x, z] : std::vector<std::pair<double, double>>{
             {1e4, 0.0}, {11e3, 0.0}, {11e3, 1e3}, {1e4, 1e3}, {1e4, 0.0}}) {
      request.segments.emplace_back().end = {x, y, z};
      y += way;
    }
    const PlannedPath path = planned(request, axes);
    EXPECT_EQ(path.steps(0).size(), 12'000U);
    EXPECT_EQ(path.steps(2).size(), 2000U);
  }
}

// [microsteps/s] The highest speed between two steps of an axis.
double highestSpeed(const AxisSteps& steps) {
  std::int64_t shortest = std::numeric_limits<std::int64_t>::max();
  for (std::size_t i = 1; i < steps.size(); ++i) {
    if (steps[i].second != steps[i - 1].second) continue;
    shortest = std::min(shortest, steps[i].first - steps[i - 1].first);
  }
  return 1e9 / static_cast<double>(shortest);
}

// The end of the slow line and that of the fast one, which takes 0.2 us, were left out: the slow
// one took its whole time to slow down.
TEST(SlowPath, KeepsItsSpeedBeforeALineThatTakesNoTime) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 1e6, 1e12, 0.0}),
                                              pathAxis("y", {1.0, 266.0, 0.001, 0.0})};
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0};
  for (const double x : {-7.83e-6, 2194.714, 2194.722}) {
    request.segments.emplace_back().end = {x, 2.01e-6};
  }
  request.segments[1].velocity = 0.002;
  request.segments.emplace_back().end = {2194.455, 0.2};
  AxisSteps steps = planned(request, axes).steps(0);
  while (!steps.empty() && steps.back().second < 0) steps.pop_back();
  EXPECT_EQ(steps.size(), 2195U);
  EXPECT_LE(highestSpeed(steps), 0.002 * test::kMostOverSpeed);
}

// z begins to move at the begin of the Bezier, at an angle of 5e-8 to the line before it.
TEST(SlowPath, KeepsTheLimitsOfAnAxisThatBeginsToMoveWithoutACorner) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 31'330.0, 7.8e10, 0.0}),
                                              pathAxis("z", {1.0, 0.001, 0.001, 0.0})};
  PathRequest request{{"x", "z"}, {}, false, 0.0, 0.0055};
  request.segments.emplace_back().end = {7.679, 0.0};
  PathSegment& slow = request.segments.emplace_back();
  slow.shape = PathSegment::Shape::kBezier;
  slow.end = {7.699, -1e-9};
  slow.control1 = {7.679 + 0.02 / 3.0, -1e-9 / 3.0};
  slow.control2 = {7.679 + 0.04 / 3.0, -2e-9 / 3.0};
  EXPECT_EQ(planned(request, axes).endCount(0), 8);
}

// z is so far from 0 that its knots are 80 ms apart. In that time x would have reached the end of
// the rounded corners, in which it is slow, and their highest speed at it.
TEST(SlowPath, IsNotLeftBecauseAnAxisThatHardlyMovesIsFarAway) {
  const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 30'000.0, 1e12, 0.0}),
                                              pathAxis("y", {1.0, 0.001, 1e12, 0.0}),
                                              pathAxis("z", {1.0, 0.001, 0.001, 0.0})};
  constexpr double kFar = 389'766.0;
  PathRequest request{{"x", "y", "z"}, {}, false, 16'434.0, 0.353996436};
  request.segments.emplace_back().end = {0.000374222238, 0.001293368900, kFar};
  request.segments.emplace_back().end = {0.030429483023, -0.019606667196, kFar + 1.2e-10};
  request.segments.emplace_back().end = {0.757693221311, -0.019606667196, kFar + 1.2e-10};
  request.segments.emplace_back().end = {-140.443705438, 248.032553250, kFar + 1.7e-9};
  request.segments[1].velocity = 0.002093522910;
  const PlannedPath path = planned(request, axes, {0.0, 0.0, kFar});
  EXPECT_EQ(path.endCount(0), -140);
  EXPECT_LE(path.steps(0).size(), 142U) << "it turns once, after a step";
}

// z moves by no more than a few roundings of a double, and rests at the whole count next to them.
// These differences took more than its acceleration in the time that x and y need for a ramp.
TEST(SlowPath, DoesNotMoveAnAxisThatIsFarAwayByItsRounding) {
  struct Case {
    double scale;  // [microsteps/unit]
    double far;    // [microsteps]
    double speed;
    double way;  // [microsteps] of z
    std::vector<std::pair<double, double>> ends;
  };
  for (const Case& made :
       {Case{1.0, 27'561'620.0, 0.00737, 3.8e-9, {{0.01374, -0.0024}, {-0.00148, -0.0178}}},
        Case{1.0, 722'777'944.0, 1e6, -2.4e-7, {{-0.712, -0.364}, {43.584, -0.364}}},
        Case{80'001.7, 999'999'999.0, 1e6, 0.0, {{0.01, 0.0}, {0.01, 0.02}}},
        Case{0.3, 1e9 + 1.0, 1e6, 0.0, {{0.1, 0.0}, {400.1, 40.3}}}}) {
    for (const double jerk : {0.0, 1e6}) {
      SCOPED_TRACE(testing::Message() << made.far << ", jerk " << jerk);
      const std::vector<motion::PathAxis> axes = {
          pathAxis("x", {made.scale, 18.8, 3e11, jerk}),
          pathAxis("y", {made.scale, made.speed, 3e5, jerk}),
          pathAxis("z", {made.scale, 0.03 / made.scale, 0.001 / made.scale, jerk})};
      PathRequest request{{"x", "y", "z"}, {}, false, 0.29, 0.0};
      const double z = (made.far + made.way) / made.scale;
      for (const auto& [x, y] : made.ends) request.segments.emplace_back().end = {x, y, z};
      const PlannedPath path = planned(request, axes, {0.0, 0.0, made.far});
      const auto& [x, y] = made.ends.back();
      EXPECT_EQ(path.endCount(0), std::llround(x * made.scale));
      EXPECT_EQ(path.endCount(1), std::llround(y * made.scale));
      EXPECT_TRUE(path.steps(2).empty());
    }
  }
}

// Knots are so close to each other that the motion has to run ahead between two of them: the speed
// along the path counts there, too.
TEST(SlowPath, KeepsItsSpeedBetweenKnotsThatAreAsCloseAsTheyMayBe) {
  struct Case {
    double tolerance;
    double velocity;
    double jerk;
    std::vector<std::pair<double, double>> ends;
  };
  for (const Case& made :
       {Case{0.0626, 24'340.0, 1e15, {{0.00341, 0.0}, {-1497.27, 546.282}, {-1494.92, 546.797}}},
        Case{0.0, 16'280.0, 1e15, {{5.01928, 0.0}}}, Case{0.0, 60'000.0, 1e15, {{13.0325, 0.0}}},
        Case{0.0, 150'000.0, 1e15, {{100.0, 0.0}}}}) {
    SCOPED_TRACE(made.velocity);
    const std::vector<motion::PathAxis> axes = {pathAxis("x", {1.0, 1e6, 1e12, made.jerk}),
                                                pathAxis("y", {1.0, 1e6, 1e12, made.jerk})};
    PathRequest request{{"x", "y"}, {}, false, made.velocity, made.tolerance};
    for (const auto& [x, y] : made.ends) request.segments.emplace_back().end = {x, y};
    EXPECT_LE(highestSpeed(planned(request, axes).steps(0)), made.velocity * test::kMostOverSpeed);
  }
}

// x stops from a high speed 0.1 us before y, which needs 0.5 ms between knots, begins to move.
TEST(SlowPath, DoesNotRunAheadIntoAPartOnWhichKnotsAreFartherApart) {
  const std::vector<motion::PathAxis> axes = {
      pathAxis("x", {1.0, 90'035.614, 745'192'562'223.6, 0.0}),
      pathAxis("y", {1.0, 9.371011661, 0.1329103175, 0.0})};
  PathRequest request{{"x", "y"}, {}, false, 0.0, 1.7559892387237139};
  request.segments.emplace_back().end = {0.19006369593557199, 0.0};
  PathSegment& slow = request.segments.emplace_back();
  slow.shape = PathSegment::Shape::kBezier;
  slow.end = {0.25340538849034422, -0.060777528484635475};
  slow.control1 = {0.22783535412363043, -0.0028986354928957105};
  slow.control2 = {0.24894925164188783, -0.02315781165444087};
  slow.velocity = 0.004884493446022895;
  PathSegment& arc = request.segments.emplace_back();
  arc.shape = PathSegment::Shape::kArcThrough;
  arc.plane = {"x", "y"};
  arc.end = {-198.86743082986632, 1885.232135093469};
  arc.point = {744.2316498283019, 1031.6785315401421};
  arc.velocity = 3584.968013695498;
  const PlannedPath path = planned(request, axes);
  ASSERT_FALSE(path.steps(0).empty());
  EXPECT_GT(path.steps(0).front().first, 10'000'000'000);
}

}  // namespace
}  // namespace stepdriver
