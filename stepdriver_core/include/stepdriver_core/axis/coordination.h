#pragma once

#include <vector>

#include "stepdriver_core/axis/axis.h"

namespace stepdriver::axis {

/// What a trajectory wants of its axes at one time; one number for each axis, in their units.
struct CoursePoint {
  double time = 0.0;  ///< [s] after the start
  std::vector<double> positions;
  std::vector<double> velocities;     ///< or none
  std::vector<double> accelerations;  ///< or none
};

/// Motions that several axes of one machine make as one. All are accepted whole, or throw Refused
/// and change nothing. What ends one of the axes before its time ends all of them at once; a stop
/// or a hold of one slows all of them down along their path.
class Coordination {
 public:
  /// A straight line, as machine::LineRequest has it. Axes that move come to rest first, which the
  /// call waits for.
  ///
  /// @param axes at least one, each once.
  /// @param positions one for each axis.
  static std::vector<Move> moveLine(const std::vector<Axis*>& axes,
                                    const std::vector<double>& positions, bool relative,
                                    double velocity, double duration);

  /// The splines of motion::planSpline() through the points, from whatever the axes do, which they
  /// replace. The points' time is the trajectory's: a hold or a speed override below 1 runs through
  /// it more slowly, one above 1 does nothing. Refused where a position is beyond a soft limit, a
  /// velocity by more than kTolerance beyond the maximum, an acceleration beyond the larger of
  /// acceleration and deceleration, or where a velocity jumps by more than the start speed; for an
  /// axis with a jerk limit also where the jerk is beyond that or the acceleration jumps, by more
  /// than kTolerance of its limit. A backlash is taken up beside the joint's own motion, see
  /// motion::planMotor(), which may last longer than the points; refused where that has no room.
  static std::vector<Move> follow(const std::vector<Axis*>& axes,
                                  const std::vector<CoursePoint>& points);

  /// Relative. A curve between points that keep to a limit goes a little beyond it.
  static constexpr double kTolerance = 0.01;

  /// Whether a hold or a resume is to be asked of this axis: of those that move together it is of
  /// one, and goes for all of them.
  static bool leads(const Axis& axis);

 private:
  static std::vector<Axis::Impl*> implsOf(const std::vector<Axis*>& axes);
};

}  // namespace stepdriver::axis
