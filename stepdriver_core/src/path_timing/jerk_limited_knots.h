#pragma once

#include <cstddef>
#include <vector>

#include "acceleration_limited.h"
#include "geometry/path_grid.h"
#include "moving_average.h"

namespace stepdriver::motion {

/// The knots of a motion between two stops, at any time.
class JerkLimitedKnots {
 public:
  explicit JerkLimitedKnots(std::size_t axes) : axes_(axes) {}

  struct Knot {
    double time = 0.0;      ///< [s]
    double distance = 0.0;  ///< [unit]
    double speed = 0.0;     ///< [unit/s]
    std::size_t interval = 0;
    std::size_t part = 0;       ///< the smoothed motion's part that ends at it or contains it
    double parameter = 0.0;     ///< the segment's parameter
    double acceleration = 0.0;  ///< [unit/s^2]
    bool even = false;          ///< see AveragedPart
  };

  void append(const Knot& knot, const double* position, const double* first, const double* second) {
    knots_.push_back(knot);
    const double square = knot.speed * knot.speed;
    for (std::size_t j = 0; j < axes_; ++j) {
      states_.push_back(
          {position[j], first[j] * knot.speed, first[j] * knot.acceleration + second[j] * square});
    }
  }

  struct State {
    double position = 0.0;
    double velocity = 0.0;
    double acceleration = 0.0;
  };

  std::size_t axes() const { return axes_; }
  std::size_t size() const { return knots_.size(); }
  const Knot& operator[](std::size_t index) const { return knots_[index]; }
  const Knot& back() const { return knots_.back(); }
  const State& state(std::size_t index, std::size_t axis) const {
    return states_[index * axes_ + axis];
  }

 private:
  std::size_t axes_;
  std::vector<Knot> knots_;
  std::vector<State> states_;
};

/// [unit/s^3] The highest s''' at which the axes keep to their jerk limits on a straight line in
/// the directions of an interval, and build up their accelerations in `time` at the earliest.
double highestJerk(const PathGrid& grid, std::size_t interval,
                   const std::vector<TimingLimits>& limits, double time);

/// The knots of a smoothed motion along a grid: where its jerk changes, and at the places of
/// curves. What would be too close to the knot before it is left out: after the shortest time,
/// there is a knot with another state of the same motion instead, so that the motion from there on
/// is the same. Small changes of the jerk are left out if the quintic without them deviates by a
/// hundredth of `resolution` or less.
///
/// @param time The time of the average [s].
/// @param closest for each interval [s]. A knot is at least this much later than the one before it,
///   by the longest of the intervals on the way between them.
JerkLimitedKnots makeKnots(const PathGrid& grid, const std::vector<TimingLimits>& limits,
                           const std::vector<AveragedPart>& parts, double time,
                           const std::vector<double>& closest, double resolution);

}  // namespace stepdriver::motion
