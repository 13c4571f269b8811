#include "trajectory/queued_path.h"

#include <gtest/gtest.h>
#include <malloc.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "profile/profile_peaks.h"
#include "stepdriver_core/error.h"
#include "support/random_path.h"
#include "trajectory/path_plan.h"
#include "trajectory/prepared_trajectory.h"
#include "trajectory/spline.h"

// The motion along a path that is extended: the longer path continues the shorter one without a
// jump, within all limits. A unit is a microstep.

namespace stepdriver {
namespace {

using motion::PathAxis;
using motion::PathRequest;
using motion::PathSegment;
using motion::Profile;
using motion::QueuedPath;

std::vector<PathAxis> axesOf(const std::vector<motion::TimingLimits>& limits,
                             std::int64_t backlash) {
  std::vector<PathAxis> axes;
  for (const motion::TimingLimits& limit : limits) {
    PathAxis& axis = axes.emplace_back();
    axis.name = std::string("x") + std::to_string(axes.size());
    axis.backlash = backlash;
    axis.limits = {std::min(10.0, limit.speed), limit.speed, limit.acceleration, limit.deceleration,
                   std::isfinite(limit.jerk) ? limit.jerk : 0.0};
    axis.stop_limits = axis.limits;
  }
  return axes;
}

PathRequest requestOf(const test::RandomPath& path, const std::vector<PathAxis>& axes) {
  PathRequest request;
  for (const PathAxis& axis : axes) request.names.push_back(axis.name);
  for (const motion::CurveSegment& given : path.segments) {
    PathSegment& segment = request.segments.emplace_back();
    segment.end = given.end;
    segment.tolerance = given.tolerance;
    if (std::isfinite(given.speed)) segment.velocity = given.speed;
    if (given.shape == motion::CurveSegment::Shape::kArc) {
      segment.shape = PathSegment::Shape::kArcAround;
      segment.plane = {axes[0].name, axes[1].name};
      segment.point = given.centre;
      segment.clockwise = given.angle < 0.0;
    }
    if (given.shape == motion::CurveSegment::Shape::kBezier) {
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
  const std::vector<motion::PathOrigin> origins(axes.size());
  const motion::PathPlan plan = motion::planPath(request, axes, origins);
  const std::vector<motion::MotionState> expected(axes.size());
  const auto prepared =
      std::make_shared<const motion::PreparedTrajectory>(axes, plan.points, expected);
  return std::make_shared<const QueuedPath>(
      motion::PreparedTrajectory::join(prepared, std::vector<motion::PathStart>(axes.size())),
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
  const double more = axis.limits.jerk > 0.0 ? 1e-3 + motion::kQuinticLimitError : 1e-3;
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

// The distances of a motion from the given path, of which no corner is rounded.
class SharpPath {
 public:
  explicit SharpPath(test::RandomPath given) {
    for (motion::CurveSegment& segment : given.segments) {
      tolerance_ = std::max(tolerance_, segment.tolerance);
      segment.tolerance = 0.0;
    }
    path_.emplace(given.path());
  }
  double tolerance() const { return tolerance_; }  // the largest

  double distanceTo(const std::vector<double>& place) {
    double nearest = std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < path_->size(); ++i) {
      for (std::size_t part = 0; part < kParts; ++part) {
        nearest = std::min(nearest, leastWithin(i, part, place));
      }
    }
    return nearest;
  }

 private:
  static constexpr std::size_t kParts = 32;  // parts of each segment

  // In a part of a segment, in which the distance has one minimum.
  double leastWithin(std::size_t segment, std::size_t part, const std::vector<double>& place) {
    double low = static_cast<double>(part) / kParts;
    double high = static_cast<double>(part + 1) / kParts;
    const double ends[] = {distanceAt(segment, low, place), distanceAt(segment, high, place)};
    // The part is hardly longer than the way between its ends.
    if (std::min(ends[0], ends[1]) > 2.0 * wayBetween(segment, low, high) + tolerance_)
      return ends[0];
    for (int i = 0; i < 40; ++i) {
      const double third = (high - low) / 3.0;
      const bool first =
          distanceAt(segment, low + third, place) < distanceAt(segment, high - third, place);
      (first ? high : low) += first ? -third : third;
    }
    return std::min({ends[0], ends[1], distanceAt(segment, low, place)});
  }
  double wayBetween(std::size_t segment, double from, double to) {
    path_->evaluate(segment, from, point_);
    const std::vector<double> place = point_.position;
    return distanceAt(segment, to, place);
  }
  double distanceAt(std::size_t segment, double u, const std::vector<double>& place) {
    path_->evaluate(segment, u, point_);
    double square = 0.0;
    for (std::size_t k = 0; k < place.size(); ++k) {
      square += (place[k] - point_.position[k]) * (place[k] - point_.position[k]);
    }
    return std::sqrt(square);
  }

  std::optional<motion::Path> path_;
  motion::PathPoint point_;
  double tolerance_ = 0.0;
};

// @param motions of all axes, from a position on the path on.
void expectOnPath(SharpPath& path, const std::vector<Profile>& motions) {
  constexpr int kPlaces = 50;
  constexpr double kDeviation = 0.2;  // how far cubics and quintics may be off the path
  double longest = 0.0;
  for (const Profile& motion : motions) longest = std::max(longest, motion.duration().value());
  std::vector<double> place(motions.size());
  for (int i = 0; i <= kPlaces; ++i) {
    const double time = longest * i / kPlaces;
    for (std::size_t k = 0; k < motions.size(); ++k) {
      const double at = std::min(time, motions[k].duration().value());
      place[k] = motions[k].stateAt(std::llround(at * 1e9)).position.value();
    }
    ASSERT_LE(path.distanceTo(place), path.tolerance() + kDeviation) << i << "/" << kPlaces;
  }
}

struct Axes {
  std::int64_t backlash;  // microsteps
  bool jerk;              // limited
};

class RandomQueue : public testing::TestWithParam<Axes> {};

TEST_P(RandomQueue, IsContinuousOnThePathAndKeepsLimits) {
  std::mt19937 random(2027);
  int paths = 0;
  double ratios = 0.0;
  for (int i = 0; i < 300; ++i) {
    test::RandomPath given = test::randomPath(random);
    for (motion::TimingLimits& limits : given.limits) {
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
    SharpPath sharp(given);
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
      std::vector<Profile> motions;
      for (std::size_t k = 0; k < axes.size(); ++k) {
        const Profile before = motionOf(*path, k, now);
        const Profile& after = motions.emplace_back(motionOf(*longer.path, k, now));
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
      // With a backlash, these are the motions of the motors.
      if (GetParam().backlash == 0) expectOnPath(sharp, motions);
      if (testing::Test::HasFatalFailure()) return;
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
    std::vector<motion::TimingLimits> limits;
    for (int k = 0; k < 2; ++k) {
      const double acceleration = std::pow(10.0, number(3.0, 5.0));
      limits.push_back({std::pow(10.0, number(2.5, 4.5)), acceleration, acceleration,
                        acceleration * std::pow(10.0, number(1.0, 3.0))});
    }
    const std::vector<PathAxis> axes = axesOf(limits, 0);
    test::RandomPath given;
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

std::size_t allocatedBytes() {
#if __GLIBC_PREREQ(2, 33)
  return mallinfo2().uordblks;
#else  // Ubuntu 20.04: counts modulo 4 GB
  return static_cast<unsigned>(mallinfo().uordblks);
#endif
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
    if (fed == 10'001) before = allocatedBytes();
  }
  const std::size_t after = allocatedBytes();
  EXPECT_LT(after, before + 200'000) << "bytes, at ten times the length";
}

}  // namespace
}  // namespace stepdriver
