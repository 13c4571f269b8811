#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::machine {

/// A straight line of several axes. A unit is m on a linear axis, rad on a rotary one.
struct LineRequest {
  std::vector<std::string> names;  ///< of the axes, each once
  std::vector<double> positions;   ///< [unit] one for each name
  bool relative = false;           ///< positions are relative, see Machine::moveLine()
  /// Highest speed along the path; 0: as fast as the limits of all axes allow, and it must not be
  /// above that. If a linear axis moves, it is the root of the sum of the squared speeds of the
  /// linear axes [m/s], and rotary axes follow. If only rotary axes move, it is the same of their
  /// speeds [rad/s].
  double velocity = 0.0;
  /// [s] Time that the line takes; 0: as fast as the limits of all axes allow. Not together with a
  /// velocity.
  double duration = 0.0;
};

/// A trajectory of several axes, as Machine::followTrajectory() takes it.
struct TrajectoryRequest {
  std::vector<std::string> names;  ///< of the axes, each once; need not be all
  std::vector<axis::TrajectoryPoint> points;
};

/// An accepted motion of several axes.
struct CoordinatedMove {
  /// The part of one axis in it.
  struct Member {
    std::string axis;
    axis::Move move;
  };
  std::vector<Member> members;  ///< in the order of the request
  double duration = 0.0;        ///< [s] as planned
};

/// How and where a motion of several axes ended.
struct CoordinatedResult {
  /// How it ended: kReached, or what ended it first.
  axis::MoveEnd end = axis::MoveEnd::kReached;
  std::string message;            ///< a sentence that says how, and names the axis that ended it
  std::vector<double> positions;  ///< [unit] where the members stand
  double duration = 0.0;          ///< [s] that it took
};

}  // namespace stepdriver::machine
