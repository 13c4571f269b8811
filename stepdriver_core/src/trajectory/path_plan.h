#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "geometry/path.h"
#include "path_axis.h"
#include "path_timing/acceleration_limited.h"
#include "queued_path.h"
#include "stepdriver_core/trajectory/requests.h"

namespace stepdriver::motion {

/// The place of an axis at rest when its path begins.
struct PathOrigin {
  double rest = 0.0;  ///< [microsteps] the joint's place; after a stop it may be between two counts
  double commanded = 0.0;  ///< [unit] the commanded position
};

/// The trajectory along a path.
struct PathPlan {
  /// The axes are at rest at the first point. The last point is on whole microsteps: if the path
  /// ends between two of them, the last piece brings the axes there, without a step.
  std::vector<TrajectoryPoint> points;
  std::vector<double> targets;               ///< [microsteps] the end of the path for each axis
  std::shared_ptr<const PathMarks> marks;    ///< nullptr: there are none
  std::shared_ptr<const PathWindow> window;  ///< only with PathRequest::more_follows
};

/// Plans the trajectory along a path.
///
/// @param axes, origins one for each name of the request. @param outputs all outputs of the
/// machine.
/// @throw Refused as Machine::followPath(), except for what PreparedTrajectory finds.
PathPlan planPath(const PathRequest& request, const std::vector<PathAxis>& axes,
                  const std::vector<PathOrigin>& origins,
                  const std::vector<config::OutputConfig>& outputs = {});

/// @name The steps of planPath()
/// @{
/// [unit] The limits on a path. @param share the part of the axes' limits that it may use.
std::vector<TimingLimits> timingLimits(const std::vector<PathAxis>& axes, double share);
/// Whether one of the axes has a jerk limit, so that accelerations may not jump.
bool hasJerkLimit(const std::vector<PathAxis>& axes);
/// [unit] A microstep of the finest axis.
double resolutionOf(const std::vector<PathAxis>& axes);
/// Requires a path to be within the soft limits.
///
/// @param segments those of the path: a refusal names their numbers.
/// @throw Refused if a segment leads beyond a soft limit.
void requireRange(const Path& path, const std::vector<PathAxis>& axes,
                  const std::vector<CurveSegment>& segments);

/// The way from the end of a path to the microsteps on which the axes come to rest. It is half a
/// microstep or less, so it makes no step.
struct RestOfPath {
  double duration = 0.0;  ///< [s] 0: the path ends on these microsteps
  std::vector<double> positions;
};
/// @param smooth the acceleration must not jump.
RestOfPath restOf(const std::vector<PathAxis>& axes, const std::vector<double>& end, bool smooth);

/// The points of a trajectory along a path that ends at rest.
///
/// @param end [unit] the given end of the path. The last knot is there except for rounding, which
///   would decide between two microsteps if the end is in their middle.
/// @param segments those of the knots: a refusal names their numbers.
/// @throw Refused if a rounded corner leads beyond a soft limit.
std::vector<TrajectoryPoint> pointsOf(std::vector<TimingKnot> knots,
                                      const std::vector<PathAxis>& axes,
                                      const std::vector<double>& end,
                                      const std::vector<CurveSegment>& segments);

/// Sets how far the corners of segments are rounded.
///
/// @param first the number of the first of the segments in the path.
/// @param stops the segments at whose end the motion stops instead.
void setBlends(std::vector<CurveSegment>& segments, const Path& path, std::size_t first,
               const std::vector<std::size_t>& stops);
/// Appends knots to those of a window.
///
/// @param time_ns, segment are added to the times and segments of the knots.
void appendKnots(std::vector<PathWindow::Knot>& window, const std::vector<TimingKnot>& knots,
                 std::int64_t time_ns, std::size_t segment);
/// @}

}  // namespace stepdriver::motion
