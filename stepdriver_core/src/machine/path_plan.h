#pragma once

#include <vector>

#include "axis/path_axis.h"
#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/machine/coordinated_move.h"

namespace stepdriver::machine {

/// The place of an axis at rest when its path begins.
struct PathOrigin {
  double rest = 0.0;       ///< [microsteps] the joint; after a stop it may be between two counts
  double commanded = 0.0;  ///< [unit] the commanded position
};

/// The trajectory along a path.
struct PathPlan {
  /// The first one is where the axes are at rest. The last one is on whole microsteps: if the path
  /// ends between two of them, the last piece brings the axes there. It makes no step.
  std::vector<axis::TrajectoryPoint> points;
  std::vector<double> targets;  ///< [microsteps] the end of the path
};

/// @param axes, origins one for each name of the request.
/// @throw Refused as Machine::followPath(), except for what PreparedTrajectory finds.
PathPlan planPath(const PathRequest& request, const std::vector<axis::PathAxis>& axes,
                  const std::vector<PathOrigin>& origins);

}  // namespace stepdriver::machine
