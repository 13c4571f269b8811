#include <fmt/format.h>
#include <fmt/ranges.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <optional>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "geometry/path.h"
#include "sim/motion_judge.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/machine/machine.h"
#include "support/constants.h"
#include "support/planned_path.h"
#include "trajectory/path_reader.h"

// Paths whose lengths, speeds, accelerations, jerks and tolerances are drawn over many decades:
// what their steps say, not their plans.

namespace stepdriver {
namespace {

using motion::PathRequest;
using motion::PathSegment;
using test::AxisSteps;
using test::PlannedPath;

// Two axes of a microstep a unit, and a third one that hardly moves.
using Point = std::array<double, 2>;

struct Drawn {
  PathRequest request{{"x", "y"}, {}, false, 0.0, 0.0};
  std::vector<PathSegment> appended;
  std::vector<motion::PathAxis> axes;
  std::vector<double> begin{0.0, 0.0};
  std::string text;
};

class Decades {
 public:
  // @param edges how often a limit is one of the two that the reader accepts.
  // @param farthest where the third axis begins at most [decades]; empty: there is none
  Decades(unsigned seed, double edges, std::optional<double> farthest)
      : random_(seed), edges_(edges), farthest_(farthest) {}

  double number(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  double decades(double low, double high) { return std::pow(10.0, number(low, high)); }
  bool often(double part) { return number(0.0, 1.0) < part; }

  Drawn path(bool jerk, bool fed) {
    Drawn drawn;
    for (const std::string name : {"x", "y"}) {
      test::PathAxisLimits limits;
      limits.steps_per_unit = 1.0;
      limits.speed = edge(-3.0, 6.0);
      limits.acceleration = edge(-3.0, 12.0);
      if (jerk) limits.jerk = edge(-3.0, 15.0);
      drawn.axes.push_back(test::pathAxis(name, limits));
      drawn.text += name + fmt::format(": {:.3g} /s, {:.3g} /s^2, {:.3g} /s^3; ", limits.speed,
                                       limits.acceleration, limits.jerk);
    }
    if (farthest_) addThird(drawn, jerk);
    drawn.request.tolerance = often(0.3) ? 0.0 : decades(-6.0, 3.0);
    drawn.request.velocity = often(0.2) ? 0.0 : decades(-3.0, 6.0);
    drawn.request.more_follows = fed;
    drawn.text += fmt::format("tolerance {:.3g}, velocity {:.3g}; ", drawn.request.tolerance,
                              drawn.request.velocity);
    place_ = {0.0, 0.0};
    const int segments = static_cast<int>(number(1.0, 5.0));
    for (int i = 0; i < segments; ++i) drawn.request.segments.push_back(segment(drawn.text));
    for (int i = 0; i < (fed ? 2 : 0); ++i) drawn.appended.push_back(segment(drawn.text));
    return drawn;
  }

 private:
  double edge(double low, double high) {
    if (often(edges_)) return std::pow(10.0, often(0.5) ? low : high);
    return decades(low, high);
  }

  void addThird(Drawn& drawn, bool jerk) {
    test::PathAxisLimits limits;
    limits.steps_per_unit = 1.0;
    limits.speed = edge(-3.0, 3.0);
    limits.acceleration = edge(-3.0, 3.0);
    if (jerk) limits.jerk = edge(-3.0, 6.0);
    third_ = std::round(decades(0.0, *farthest_));
    drawn.begin.push_back(third_);
    drawn.axes.push_back(test::pathAxis("z", limits));
    drawn.request.names.emplace_back("z");
    drawn.text += fmt::format("z: {:.3g} /s, {:.3g} /s^2, {:.3g} /s^3 from {}; ", limits.speed,
                              limits.acceleration, limits.jerk, third_);
  }

  void moveThird(PathSegment& made) {
    const double from = third_;
    if (often(0.6)) third_ += decades(-13.0, -3.0) * (often(0.5) ? 1.0 : -1.0);
    made.end.push_back(third_);
    if (made.shape != PathSegment::Shape::kBezier) return;
    made.control1.push_back(from + (third_ - from) / 3.0);
    made.control2.push_back(third_ - (third_ - from) / 3.0);
  }

  PathSegment segment(std::string& text) {
    PathSegment made;
    const double length = decades(-6.0, 3.5);
    const double angle = number(0.0, 2.0 * test::kPi);
    const bool along_x = often(0.3);
    const Point way{along_x ? length : length * std::cos(angle),
                    along_x ? 0.0 : length * std::sin(angle)};
    made.end = {place_[0] + way[0], place_[1] + way[1]};
    if (often(0.3)) made.velocity = decades(-3.0, 6.0);
    const char* shape = "line";
    if (length > 10.0 && often(0.2)) {
      shape = "arc";
      made.shape = PathSegment::Shape::kArcThrough;
      made.plane = {"x", "y"};
      const double bow = number(-1.0, 1.0);
      made.point = {place_[0] + way[0] / 2.0 - way[1] * bow,
                    place_[1] + way[1] / 2.0 + way[0] * bow};
    } else if (often(0.2)) {
      shape = "Bezier";
      made.shape = PathSegment::Shape::kBezier;
      const double bow = number(-0.5, 0.5);
      made.control1 = {place_[0] + way[0] / 3.0 - way[1] * bow,
                       place_[1] + way[1] / 3.0 + way[0] * bow};
      made.control2 = {place_[0] + way[0] * 2.0 / 3.0 - way[1] * bow,
                       place_[1] + way[1] * 2.0 / 3.0 + way[0] * bow};
    }
    if (farthest_) moveThird(made);
    text += fmt::format("{} to {:.6g} at {:.3g}; ", shape, fmt::join(made.end, " "), made.velocity);
    place_ = {made.end[0], made.end[1]};
    return made;
  }

  std::mt19937 random_;
  double edges_;
  std::optional<double> farthest_;
  Point place_{};
  double third_ = 0.0;
};

double distanceTo(const Point& point, const Point& a, const Point& b) {
  const double x = b[0] - a[0];
  const double y = b[1] - a[1];
  const double square = x * x + y * y;
  const double along = (point[0] - a[0]) * x + (point[1] - a[1]) * y;
  const double part = square > 0.0 ? std::clamp(along / square, 0.0, 1.0) : 0.0;
  return std::hypot(point[0] - a[0] - part * x, point[1] - a[1] - part * y);
}

// What a path allows at a place.
class Hull {
 public:
  explicit Hull(const Drawn& drawn) {
    motion::PathFrame frame{drawn.request.names,
                            std::vector<double>(drawn.axes.size()),
                            drawn.request.velocity,
                            drawn.request.tolerance,
                            {}};
    motion::PathReader reader(frame, drawn.axes, drawn.begin);
    std::vector<motion::CurveSegment> segments;
    for (const PathSegment& segment : drawn.request.segments) reader.read(segment, segments);
    for (const PathSegment& segment : drawn.appended) reader.read(segment, segments);
    if (segments.empty()) return;
    const motion::Path path(drawn.begin, segments, 1.0);
    motion::PathPoint point;
    for (std::size_t i = 0; i < segments.size(); ++i) {
      const int parts = path.isLine(i) ? 1 : 200;
      for (int k = 0; k < parts; ++k) {
        Stretch& stretch = stretches_.emplace_back();
        path.evaluateGiven(i, static_cast<double>(k) / parts, point);
        stretch.from = {point.position[0], point.position[1]};
        path.evaluateGiven(i, (k + 1.0) / parts, point);
        stretch.to = {point.position[0], point.position[1]};
        stretch.speed = segments[i].speed;
      }
    }
  }

  double distance(const Point& place) const {
    double nearest = std::hypot(place[0], place[1]);
    for (const Stretch& each : stretches_) {
      nearest = std::min(nearest, distanceTo(place, each.from, each.to));
    }
    return nearest;
  }
  // The highest speed of what is within a distance.
  double speedNear(const Point& place, double within) const {
    double speed = 0.0;
    for (const Stretch& each : stretches_) {
      if (distanceTo(place, each.from, each.to) <= within) speed = std::max(speed, each.speed);
    }
    return speed;
  }

 private:
  struct Stretch {
    Point from{};
    Point to{};
    double speed = 0.0;
  };
  std::vector<Stretch> stretches_;
};

// The microstep itself, half a one of each axis, and what the plan may deviate by.
constexpr double kNear = 1.0 + 0.71 + 0.2;
constexpr double kRounding = 2e-9;  // [s] the times of two steps are rounded by this

// Also of what happens in the shortest time between two knots.
sim::MotionJudge judgeOf(const motion::PathAxis& axis) {
  return sim::MotionJudge(
      {axis.limits.max_speed, std::max(axis.limits.acceleration, axis.limits.deceleration)});
}

void expectGoodSteps(const Drawn& drawn, const PlannedPath& path) {
  const Hull hull(drawn);
  struct Step {
    std::int64_t time;
    std::size_t axis;
    int direction;
  };
  std::vector<Step> all;
  for (std::size_t k = 0; k < 2; ++k) {
    for (const auto& [time, direction] : path.steps(k)) all.push_back({time, k, direction});
  }
  std::sort(all.begin(), all.end(), [](const Step& a, const Step& b) { return a.time < b.time; });
  std::array<sim::MotionJudge, 2> judges{judgeOf(drawn.axes[0]), judgeOf(drawn.axes[1])};
  Point place{};
  std::array<Step, 2> last{Step{0, 0, 0}, Step{0, 1, 0}};
  for (const Step& step : all) {
    place[step.axis] += step.direction;
    ASSERT_LE(hull.distance(place), drawn.request.tolerance + kNear)
        << "at " << place[0] << ' ' << place[1] << " after " << step.time << " ns";
    judges.at(step.axis).step(step.direction, step.time, 0);
    ASSERT_EQ(judges.at(step.axis).firstViolation(), "") << "axis " << step.axis;
    const Step before = std::exchange(last[step.axis], step);
    if (before.direction != step.direction) continue;
    const double interval = static_cast<double>(step.time - before.time) * 1e-9;
    const double asked = hull.speedNear(place, drawn.request.tolerance + kNear + 1.0);
    const double allowed = std::min(drawn.axes[step.axis].limits.max_speed, asked);
    ASSERT_GE((interval + kRounding) * allowed * test::kMostOverSpeed, 1.0)
        << "between steps to " << place[0] << ' ' << place[1] << " at " << step.time << " ns, "
        << interval << " s apart; " << allowed << " /s are allowed";
  }
  const PathSegment& end =
      drawn.appended.empty() ? drawn.request.segments.back() : drawn.appended.back();
  for (std::size_t k = 0; k < 2; ++k) {
    // A last segment that leads nowhere may be left out.
    EXPECT_NEAR(place[k], end.end[k], 0.5 + 2e-3) << "axis " << k;
  }
}

void followMany(bool jerk, bool fed, int paths, double edges = 0.1,
                std::optional<double> farthest = {}) {
  Decades decades(static_cast<unsigned>(7 + 2 * jerk + fed), edges, farthest);
  int followed = 0;
  for (int i = 0; i < paths; ++i) {
    const Drawn drawn = decades.path(jerk, fed);
    SCOPED_TRACE("path " + std::to_string(i) + ": " + drawn.text);
    PlannedPath path;
    try {
      path = test::planned(drawn.request, drawn.axes, drawn.begin);
      if (fed) {
        const double from = decades.number(0.0, 1.0) * path.duration();
        path = test::fed(path, drawn.appended, from);
      }
    } catch (const Refused& error) {
      const std::string why = error.what();
      const bool is_long = why.find("longer than") != std::string::npos;
      const bool is_cusp = why.find("cusp") != std::string::npos;
      ASSERT_TRUE(is_long || is_cusp) << why;
      continue;
    }
    ++followed;
    expectGoodSteps(drawn, path);
    if (testing::Test::HasFailure()) return;
  }
  EXPECT_GE(followed, paths / 2);
}

TEST(PathDecades, AreFollowedWithoutAJerkLimit) { followMany(false, false, 1000); }
TEST(PathDecades, AreFollowedWithAJerkLimit) { followMany(true, false, 300); }
TEST(PathDecades, AreFollowedIfTheyAreFed) { followMany(false, true, 300); }
TEST(PathDecades, AreFollowedIfTheyAreFedWithAJerkLimit) { followMany(true, true, 100); }
// An axis with the lowest limits may stand still while another one moves with the highest ones.
TEST(PathDecades, AreFollowedAtTheEdgesOfAllLimits) {
  followMany(false, false, 1000, 0.7);
  followMany(true, false, 500, 0.7);
  followMany(true, true, 100, 0.7);
}
// The farther an axis is from 0, the more its places are rounded, and the farther apart its knots
// have to be.
TEST(PathDecades, AreFollowedBesideAnAxisThatHardlyMoves) {
  for (const double edges : {0.1, 0.7}) {
    followMany(false, false, 300, edges, 6.0);
    followMany(true, false, 100, edges, 3.0);
    followMany(false, true, 100, edges, 6.0);
  }
}

}  // namespace
}  // namespace stepdriver
