#pragma once

#include <cstddef>
#include <vector>

#include "geometry/path_grid.h"
#include "jerk_limited_knots.h"
#include "limit_usage.h"
#include "moving_average.h"
#include "squared_speed_optimum.h"

namespace stepdriver::motion {

/// The fastest motion along a grid, from rest to rest, found from another one: see
/// SquaredSpeedOptimum.
///
/// Its pieces take a tenth of the time over which the other motion was averaged, and end at the
/// places of curves: the jerk of an axis changes there. They are shorter near both ends, and longer
/// far from any change of the acceleration.
///
/// It leaves a part of the limits for a stop along the path.
class OptimalMotion {
 public:
  /// The squares of the highest speeds at both ends of an interval [unit^2/s^2].
  struct Caps {
    double begin = 0.0;
    double end = 0.0;
  };

  /// @param grid outlives this. @param caps, middles for each interval; `middles` are the
  ///   second derivatives of each axis in the middle of each interval.
  /// @param given a motion from rest to rest. @param average [s] the time over which it was
  ///   averaged.
  OptimalMotion(const PathGrid& grid, const std::vector<TimingLimits>& limits,
                const std::vector<Caps>& caps, const std::vector<double>& middles,
                const JerkLimitedKnots& given, double average);

  /// Finds the optimum. @return false: the motion is too short for it.
  bool solve();
  /// The motion, in parts of constant jerk.
  std::vector<AveragedPart> parts() const;
  /// Divides the limits between two distances by the parts of them that the motion uses, for the
  /// next solve().
  void tighten(double from, double to, const LimitUsage& usage);

 private:
  bool isTooShort() const;
  void divide(const JerkLimitedKnots& given, double average);
  void appendPieces(const std::vector<Caps>& caps, const std::vector<double>& middles);

  const PathGrid& grid_;
  std::vector<TimingLimits> limits_;  // lower ones
  std::vector<double> ends_;          // [unit] of the pieces, from the start of the grid
  std::vector<double> squares_;       // [unit^2/s^2] of the speed in the middle of each piece
  SquaredSpeedOptimum optimum_;
};

}  // namespace stepdriver::motion
