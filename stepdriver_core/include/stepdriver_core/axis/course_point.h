#pragma once

#include <vector>

namespace stepdriver::axis {

/// What a trajectory wants of its axes at one time; one number for each axis, in their units.
struct CoursePoint {
  double time = 0.0;  ///< [s] after the start
  std::vector<double> positions;
  std::vector<double> velocities;     ///< or none
  std::vector<double> accelerations;  ///< or none
};

/// Relative. A curve between points that keep to a limit may go beyond it by so much.
constexpr double kTrajectoryTolerance = 0.01;

}  // namespace stepdriver::axis
