#include "machine/queued_path.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "axis/prepared_trajectory.h"
#include "machine/path_plan.h"
#include "motion/profile_peaks.h"
#include "motion/spline.h"
#include "stepdriver_core/error.h"
#include "support/random_contour.h"

// The motion along a path that is extended: the longer path continues the shorter one without a
// jump, within all limits. A unit is a microstep.

namespace stepdriver {
namespace {

using axis::PathAxis;
using machine::PathRequest;
using machine::PathSegment;
using machine::QueuedPath;
using motion::Profile;

std::vector<PathAxis> axesOf(const std::vector<motion::ContourLimits>& limits,
                             std::int64_t backlash) {
  std::vector<PathAxis> axes;
  for (const motion::ContourLimits& limit : limits) {
    PathAxis& axis = axes.emplace_back();
    axis.name = std::string("x") + std::to_string(axes.size());
    axis.backlash = backlash;
    axis.limits = {std::min(10.0, limit.speed), limit.speed, limit.acceleration, limit.deceleration,
                   std::isfinite(limit.jerk) ? limit.jerk : 0.0};
    axis.stop_limits = axis.limits;
  }
  return axes;
}

PathRequest requestOf(const test::RandomContour& path, const std::vector<PathAxis>& axes) {
  PathRequest request;
  for (const PathAxis& axis : axes) request.names.push_back(axis.name);
  for (const motion::ContourSegment& given : path.segments) {
    PathSegment& segment = request.segments.emplace_back();
    segment.end = given.end;
    segment.tolerance = given.tolerance;
    if (std::isfinite(given.speed)) segment.velocity = given.speed;
    if (given.shape == motion::ContourSegment::Shape::kArc) {
      segment.shape = PathSegment::Shape::kArcAround;
      segment.plane = {axes[0].name, axes[1].name};
      segment.point = given.centre;
      segment.clockwise = given.angle < 0.0;
    }
    if (given.shape == motion::ContourSegment::Shape::kBezier) {
      segment.shape = PathSegment::Shape::kBezier;
      segment.control1 = given.control1;
      segment.control2 = given.control2;
    }
  }
  request.more_follows = true;
  return request;
}

std::shared_ptr<const QueuedPath> firstOf(const PathRequest& request,
                                          const std::vector<PathAxis>& axes) {
  const std::vector<machine::PathOrigin> origins(axes.size());
  const machine::PathPlan plan = machine::planPath(request, axes, origins);
  const std::vector<motion::MotionState> expected(axes.size());
  const auto prepared =
      std::make_shared<const axis::PreparedTrajectory>(axes, plan.points, expected);
  return std::make_shared<const QueuedPath>(
      axis::PreparedTrajectory::join(prepared, std::vector<axis::PathStart>(axes.size())),
      plan.window, true);
}

// The motion of an axis at full rate from a position on the path [s] to its end.
Profile motionOf(const QueuedPath& path, std::size_t axis, double from) {
  return path.profileOf(axis, path.plan(0, {from, 1.0, 0.0}, 1.0));
}

double endOf(const QueuedPath& path) { return path.aheadOf(0.0).time; }

// Differences of the velocity around a time [s], which cover several of the cubics of a quintic.
void expectJerkWithin(const Profile& profile, const PathAxis& axis, double around) {
  const double apart = 0.3 * axis.mostAcceleration() / axis.limits.jerk;
  const double most = axis.backlash > 0 ? 1.05 : 1.01;
  const auto velocity = [&](double time) {
    return profile.stateAt(std::llround(time * 1e9)).velocity;
  };
  const double last = std::min(around + 20.0 * apart, profile.duration().value() - 2.0 * apart);
  for (double t = std::max(0.0, around - 20.0 * apart); t < last; t += apart / 2.0) {
    const double jerk =
        (velocity(t + 2.0 * apart) - 2.0 * velocity(t + apart) + velocity(t)) / (apart * apart);
    ASSERT_LE(std::abs(jerk), most * axis.limits.jerk) << "at " << t << " s";
    const double acceleration = (velocity(t + apart) - velocity(t)) / apart;
    ASSERT_LE(std::abs(acceleration), most * axis.mostAcceleration()) << "at " << t << " s";
  }
}

void expectWithin(const Profile& profile, const PathAxis& axis, double seam) {
  const double more = axis.limits.jerk > 0.0 ? 1e-3 + motion::kQuinticAccelerationError : 1e-3;
  for (const motion::Piece& piece : profile.pieces()) {
    for (const motion::DoubleDouble t : {motion::DoubleDouble(), piece.duration}) {
      ASSERT_LE(std::abs(piece.velocityAt(t).value()), axis.limits.max_speed * (1.0 + 1e-6));
      ASSERT_LE(std::abs(piece.accelerationAt(t).value()), axis.mostAcceleration() * (1.0 + more));
    }
  }
  if (axis.limits.jerk > 0.0) expectJerkWithin(profile, axis, seam);
  const double jump = motion::profilePeaks(profile, profile.piece(0).v0).velocity_jump.value;
  ASSERT_LE(std::abs(jump), 1e-3 * axis.limits.max_speed);
}

struct Axes {
  std::int64_t backlash;  // microsteps
  bool jerk;              // limited
};

class RandomQueue : public testing::TestWithParam<Axes> {};

TEST_P(RandomQueue, IsContinuousAndKeepsLimits) {
  std::mt19937 random(2027);
  int paths = 0;
  double ratios = 0.0;
  for (int i = 0; i < 300; ++i) {
    test::RandomContour given = test::randomContour(random);
    for (motion::ContourLimits& limits : given.limits) {
      if (!GetParam().jerk) break;
      // Accelerations that take 1 to 100 ms to build up.
      const double rate = std::pow(10.0, std::uniform_real_distribution<double>(1.0, 3.0)(random));
      limits.jerk = limits.acceleration * rate;
    }
    const std::vector<PathAxis> axes = axesOf(given.limits, GetParam().backlash);
    const PathRequest whole = requestOf(given, axes);
    std::shared_ptr<const QueuedPath> path;
    std::shared_ptr<const QueuedPath> in_one_go;
    PathRequest first = whole;
    first.segments.resize(1);
    try {
      in_one_go = firstOf(whole, axes);
      path = firstOf(first, axes);
    } catch (const Refused&) {
      continue;  // a cusp, or no room for the backlash
    }
    SCOPED_TRACE("path " + std::to_string(i));
    double now = 0.0;
    bool late = false;
    for (std::size_t fed = 1; fed < whole.segments.size(); ++fed) {
      // Half of the paths are fed at once, the others while they are followed.
      if (i % 2 == 0) now = std::uniform_real_distribution<double>(now, endOf(*path))(random);
      if (i % 20 == 0) now = endOf(*path);
      late = late || i % 2 == 0;
      QueuedPath::Longer longer;
      try {
        longer = path->extended({whole.segments[fed]}, true, now, now);
      } catch (const Refused& refused) {
        ASSERT_NE(std::string(refused.what()).find("backlash"), std::string::npos)
            << refused.what();
        break;
      }
      ASSERT_GE(longer.same_until, now - 1e-9);
      for (std::size_t k = 0; k < axes.size(); ++k) {
        const Profile before = motionOf(*path, k, now);
        const Profile after = motionOf(*longer.path, k, now);
        SCOPED_TRACE("axis " + std::to_string(k) + " from " + std::to_string(now) + " same until " +
                     std::to_string(longer.same_until));
        const auto same_ns = std::llround((longer.same_until - now) * 1e9);
        for (const double part : {0.0, 0.3, 0.7, 1.0}) {
          const auto at = static_cast<std::int64_t>(part * static_cast<double>(same_ns));
          ASSERT_NEAR(before.stateAt(at).position.value(), after.stateAt(at).position.value(),
                      1e-5);
        }
        expectWithin(after, axes[k], longer.same_until - now);
        if (testing::Test::HasFatalFailure()) return;
      }
      path = longer.path;
    }
    const std::vector<double> targets = path->targets();
    for (std::size_t k = 0; k < axes.size(); ++k) {
      const double slack = static_cast<double>(GetParam().backlash);
      const double end = motionOf(*path, k, now).endPosition().value();
      ASSERT_GE(end, targets[k] - 0.5 - 1e-9);
      ASSERT_LE(end, targets[k] + 0.5 + slack + 1e-9);
    }
    if (late) continue;
    ++paths;
    ratios += endOf(*path) / endOf(*in_one_go);
  }
  EXPECT_GT(paths, 30);
  // With a backlash a motion changes only while nothing of it is being taken up.
  EXPECT_LE(ratios / paths, GetParam().backlash > 0 ? 1.03 : 1.003);
  RecordProperty("ratio", std::to_string(ratios / paths));
}

INSTANTIATE_TEST_SUITE_P(Axes, RandomQueue,
                         testing::Values(Axes{0, false}, Axes{7, false}, Axes{0, true},
                                         Axes{7, true}),
                         [](const testing::TestParamInfo<Axes>& axes) {
                           return std::string(axes.param.backlash > 0 ? "Backlash" : "NoBacklash") +
                                  (axes.param.jerk ? "Jerk" : "NoJerk");
                         });

TEST(RandomLines, WithAJerkLimitKeepTheAccelerationAndAreNotRefused) {
  std::mt19937 random(60);
  const auto number = [&](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random);
  };
  for (int i = 0; i < 60; ++i) {
    std::vector<motion::ContourLimits> limits;
    for (int k = 0; k < 2; ++k) {
      const double acceleration = std::pow(10.0, number(3.0, 5.0));
      limits.push_back({std::pow(10.0, number(2.5, 4.5)), acceleration, acceleration,
                        acceleration * std::pow(10.0, number(1.0, 3.0))});
    }
    const std::vector<PathAxis> axes = axesOf(limits, 0);
    test::RandomContour given;
    given.start = {0.0, 0.0};
    std::vector<double> at = given.start;
    for (int line = 0; line < 60; ++line) {
      for (double& x : at) x += number(-100.0, 100.0);
      given.segments.emplace_back().end = at;
      given.segments.back().tolerance = number(0.5, 10.0);
    }
    try {
      const auto path = firstOf(requestOf(given, axes), axes);
      for (std::size_t k = 0; k < axes.size(); ++k) {
        expectWithin(motionOf(*path, k, 0.0), axes[k], endOf(*path) / 2.0);
        if (testing::Test::HasFatalFailure()) FAIL() << "path " << i << ", axis " << k;
      }
    } catch (const Refused& refused) {
      ADD_FAILURE() << "path " << i << ": " << refused.what();
    }
  }
}

TEST(QueuedPath, NeedsMemoryForWhatLiesAheadOnly) {
  const std::vector<PathAxis> axes = axesOf({{8000.0, 80'000.0, 80'000.0}, {8000.0, 8e4, 8e4}}, 3);
  int made = 0;
  const auto next = [&] {
    ++made;
    PathSegment segment;
    segment.end = {4000.0 * (std::cos(made * 0.01) - 1.0), 4000.0 * std::sin(made * 0.01)};
    return segment;
  };
  PathRequest request{{"x1", "x2"}, {next()}, false, 0.0, 4.0, true};
  std::shared_ptr<const QueuedPath> path = firstOf(request, axes);
  std::size_t before = 0;
  for (int fed = 1; fed <= 100'000; fed += 100) {
    std::vector<PathSegment> more;
    for (int i = 0; i < 100; ++i) more.push_back(next());
    const double now = std::max(0.0, endOf(*path) - 0.5);
    path = path->extended(more, true, now, now).path;
    if (fed == 10'001) before = mallinfo2().uordblks;
  }
  const std::size_t after = mallinfo2().uordblks;
  EXPECT_LT(after, before + 200'000) << "bytes, at ten times the length";
}

}  // namespace
}  // namespace stepdriver
