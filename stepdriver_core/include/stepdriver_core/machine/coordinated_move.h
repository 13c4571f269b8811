#pragma once

#include <string>
#include <vector>

#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::machine {

/// A straight line of several axes. A unit is m on a linear axis, rad on a rotary one.
struct LineRequest {
  std::vector<std::string> names;  ///< of the axes, each once
  std::vector<double> positions;   ///< [unit] one for each name
  bool relative = false;           ///< positions are from where the axes stand
  /// Highest speed along the path; 0: as the axes' limits allow. Where a linear axis moves it is
  /// that of the linear axes, the root of the sum of their squared speeds [m/s], and rotary axes go
  /// along; where only rotary axes move, the same of theirs [rad/s].
  double velocity = 0.0;
  /// [s] That the line takes; 0: as fast as the limits allow. Not together with a velocity.
  double duration = 0.0;
};

/// A trajectory of several axes, as Machine::followTrajectory() takes it.
struct TrajectoryRequest {
  std::vector<std::string> names;  ///< of the axes, each once; need not be all
  std::vector<axis::TrajectoryPoint> points;
};

/// A motion of several axes that was accepted.
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
