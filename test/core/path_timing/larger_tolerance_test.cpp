#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdlib>
#include <limits>
#include <random>
#include <string>
#include <vector>

#include "path_timing/jerk_limited.h"
#include "profile/errors.h"
#include "support/random_path.h"

// A larger tolerance allows everything that a smaller one does: a motion along a path doesn't
// become longer with it. Each random path is planned with ten tolerances, and each duration is
// compared with the shortest one of all smaller tolerances. STEPDRIVER_PATHS=1000 in the
// environment tries so many paths.

namespace stepdriver {
namespace {

using motion::Continuity;
using motion::CurveSegment;
using motion::Path;
using motion::TimingLimits;

int pathsToTry(int by_default) {
  const char* const text = std::getenv("STEPDRIVER_PATHS");
  return text == nullptr ? by_default : std::max(1, std::atoi(text));
}

// Tells how the durations of random paths grow.
class GrowthOfDurations {
 public:
  explicit GrowthOfDurations(Continuity continuity) : continuity_(continuity) {}

  void tryPaths(int count) {
    std::mt19937 random(2029);
    while (paths_ < count) {
      test::RandomPath path = test::randomPath(random);
      for (TimingLimits& limits : path.limits) {
        const double exponent = std::uniform_real_distribution<double>(0.0, 3.0)(random);
        if (continuity_ == Continuity::kCurvature) {
          limits.jerk = limits.acceleration * std::pow(10.0, exponent);
        }
      }
      const bool has_corners = path.limits.size() > 1 && path.segments.size() > 1;
      if (has_corners && !hasCusp(path)) tryPath(path);
    }
  }

  int paths() const { return paths_; }
  /// How many paths become longer by more than 0.1 % with a larger tolerance.
  int growing() const { return growing_; }
  /// The largest factor.
  double worst() const { return worst_; }
  /// Describes the paths that become longer.
  const std::string& text() const { return text_; }

 private:
  static bool hasCusp(const test::RandomPath& path) {
    try {
      path.path();
    } catch (const motion::Malformed&) {
      return true;
    }
    return false;
  }

  double seconds(const test::RandomPath& path, double tolerance) const {
    std::vector<CurveSegment> segments = path.segments;
    for (CurveSegment& segment : segments) segment.tolerance = tolerance;
    const Path rounded(path.start, segments, 1.0, continuity_);
    const motion::PathTiming timing = continuity_ == Continuity::kCurvature
                                          ? motion::planJerkLimited(rounded, path.limits)
                                          : motion::planAccelerationLimited(rounded, path.limits);
    return static_cast<double>(timing.knots.back().time_ns) * 1e-9;
  }

  void tryPath(const test::RandomPath& path) {
    double least = std::numeric_limits<double>::infinity();
    double worst = 1.0;
    std::string how;
    for (const double tolerance : {0.0, 0.02, 0.1, 0.5, 2.0, 8.0, 30.0, 120.0, 600.0, 3000.0}) {
      const double duration = seconds(path, tolerance);
      if (duration > worst * least) {
        worst = duration / least;
        how = " tolerance " + std::to_string(tolerance) + ": " + std::to_string(duration) +
              " s instead of " + std::to_string(least) + "\n";
      }
      least = std::min(least, duration);
    }
    if (worst > 1.001) {
      ++growing_;
      text_ += "path " + std::to_string(paths_) + how;
    }
    worst_ = std::max(worst_, worst);
    ++paths_;
  }

  Continuity continuity_;
  int paths_ = 0;
  int growing_ = 0;
  double worst_ = 1.0;
  std::string text_;
};

TEST(LargerTolerance, MakesNoAccelerationLimitedMotionLonger) {
  GrowthOfDurations growth(Continuity::kDirection);
  growth.tryPaths(pathsToTry(100));
  EXPECT_LE(growth.growing(), 0.025 * growth.paths()) << growth.text();
  EXPECT_LE(growth.worst(), 1.03) << growth.text();
  RecordProperty("growing", growth.growing());
  RecordProperty("worst", std::to_string(growth.worst()));
}

// The optimum is found from the best moving average, and where the motion stops is chosen among
// the motions that are found: another choice may be longer by some percent.
TEST(LargerTolerance, MakesFewJerkLimitedMotionsLonger) {
  GrowthOfDurations growth(Continuity::kCurvature);
  growth.tryPaths(pathsToTry(40));
  EXPECT_LE(growth.growing(), 0.15 * growth.paths()) << growth.text();
  EXPECT_LE(growth.worst(), 1.06) << growth.text();
  RecordProperty("growing", growth.growing());
  RecordProperty("worst", std::to_string(growth.worst()));
}

}  // namespace
}  // namespace stepdriver
