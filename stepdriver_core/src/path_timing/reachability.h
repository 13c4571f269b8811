#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "acceleration_limited.h"
#include "geometry/path.h"
#include "geometry/path_grid.h"

namespace stepdriver::motion {

/// The accelerations that keep to the limits of the axes in an interval that isn't straight.
enum class CheckedAcceleration {
  kMean,
  kAtBothEnds,  ///< with a constant s''
};

/// The square of the highest speed along a path at each place of its grid, see
/// planAccelerationLimited().
class Reachability {
 public:
  /// @param path, grid, limits outlive this.
  /// @param begin [unit^2/s^2] the square of the speed at the begin.
  Reachability(const Path& path, const PathGrid& grid, const std::vector<TimingLimits>& limits,
               double begin = 0.0, CheckedAcceleration checked = CheckedAcceleration::kAtBothEnds);

  /// Lowers the limits of an interval for the next plan() by dividing its accelerations and speeds.
  void lower(std::size_t interval, double acceleration, double speed);
  /// Limits the square of the speed in an interval [unit^2/s^2], and the acceleration along it
  /// [unit/s^2], for the next plan().
  void restrict(std::size_t interval, double square, double acceleration);
  /// From the next plan() on, an interval keeps to the accelerations at both ends.
  ///
  /// @return whether that is new.
  bool checkBothEnds(std::size_t interval);
  /// The factor by which the square of the speed before an interval would be higher if only the
  /// mean of its accelerations counted; 1 if it is lower anyway. Call it after plan().
  double lossOfBothEnds(std::size_t interval);
  /// Follows a division of the grid by PathGrid::divideEach().
  void regrid(const Division& division);
  /// Plans everything the first time, then only what has changed since.
  void plan();

  /// [unit^2/s^2] The highest square of the speed that the speeds alone allow at the begin and at
  /// the end of an interval.
  double capAtBegin(std::size_t interval) const {
    return stale_[interval] ? capAt(interval, grid_.firstAtBegin(interval))
                            : allowed_[interval].cap_at_begin;
  }
  double capAtEnd(std::size_t interval) const {
    return stale_[interval] ? capAt(interval, grid_.firstAtEnd(interval))
                            : allowed_[interval].cap_at_end;
  }

  /// [unit^2/s^2] The square of the speed at a place, from 0 to the size of the grid.
  double square(std::size_t place) const { return squares_[place]; }
  /// [unit^2/s^2] The highest square of the speed from which the motion can still slow down for
  /// everything ahead.
  double controllable(std::size_t place) const { return controllable_[place]; }
  /// A place up to which the plan stays the same if the path continues at its end: whether the
  /// motion needn't slow down there, or must be at rest half a segment before it, at the first
  /// place at which the rounding of a corner may begin. Call it after plan().
  ///
  /// @param open from this place on, the speed may be higher then.
  std::size_t settledUntil(std::size_t open = std::numeric_limits<std::size_t>::max());

  /// The accelerations along a straight interval that the axes allow [unit/s^2].
  struct Ramp {
    double up = 0.0;
    double down = 0.0;
  };
  const Ramp& ramp(std::size_t interval) const { return allowed_[interval].ramp; }
  /// [unit^2/s^2] The highest square of the speed in a straight interval.
  double peakSquare(std::size_t interval) const;

 private:
  // A bound of u = s'' for x = s'^2: offset + slope x.
  struct Bound {
    double offset = 0.0;
    double slope = 0.0;
    double at(double x) const { return offset + slope * x; }
  };
  // u lies between least + slope x and most + slope x.
  struct Band {
    double least = 0.0;
    double most = 0.0;
    double slope = 0.0;
  };
  // What the limits allow in an interval: a ramp if it is straight, or else bands.
  struct Allowed {
    double cap_at_begin = 0.0;  // the highest x there
    double cap_at_end = 0.0;
    Ramp ramp;
    double most_x = 0.0;
    std::size_t first_band = 0;
    std::size_t bands = 0;
    std::size_t most_bands = 0;  // the number of bands that have room from first_band on
  };
  // Bounds of the lowest and the highest u at an x.
  struct Range {
    Bound low;
    Bound high;
  };

  double capAt(std::size_t interval, const double* first) const;
  double capBefore(std::size_t place) const;
  void findAllowed(std::size_t interval);
  void collectBands(std::size_t interval, Allowed& allowed);
  Range tightestAt(std::size_t interval, double end, double x) const;
  double largestBefore(std::size_t interval, double end) const;
  double largestAfter(std::size_t interval, double begin, double end) const;

  const Path& path_;
  const PathGrid& grid_;
  const std::vector<TimingLimits>& limits_;
  std::vector<double> acceleration_shares_;  // for each interval
  std::vector<double> speed_shares_;
  std::vector<double> most_squares_;
  std::vector<double> most_accelerations_;
  std::vector<CheckedAcceleration> checked_;
  std::vector<char> stale_;  // whether each interval has changed since the last plan
  std::vector<Allowed> allowed_;
  std::vector<Band> bands_;  // those of all intervals
  // The largest x at each place from which the motion can slow down.
  std::vector<double> controllable_;
  std::vector<double> squares_;  // x at each place
};

/// The sign of the motion of an axis in an interval with these velocities at its ends; 0: it turns,
/// or doesn't move.
inline int directionOf(double begin, double end) {
  const double rounding = 1e-9 * std::max(std::abs(begin), std::abs(end));
  if (begin > rounding || end > rounding) return begin < -rounding || end < -rounding ? 0 : 1;
  return begin < -rounding || end < -rounding ? -1 : 0;
}

/// The highest acceleration towards plus or minus of an axis that moves in this direction.
inline double accelerationTowards(const TimingLimits& limits, int direction, int sign) {
  if (direction == 0) return std::min(limits.acceleration, limits.deceleration);
  return direction == sign ? limits.acceleration : limits.deceleration;
}

}  // namespace stepdriver::motion
