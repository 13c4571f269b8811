#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "motion/backlash.h"
#include "motion/compose.h"
#include "motion/profile_peaks.h"
#include "motion/spline.h"
#include "path_axis.h"
#include "stepdriver_core/axis/axis_state.h"
#include "trajectory_path.h"

namespace stepdriver::axis {

/// A trajectory that is planned and checked but for its first segment, which depends on where the
/// axes are when it begins. It takes as long as it has points, in whatever thread wants it; joining
/// it to the motions of the axes then takes a bounded time.
///
/// It is made from a copy of what it needs to know of the axes. Whoever joins it compares that with
/// what is true by then: if axes() differs (other limits, another scale or origin), it has to be
/// prepared again.
class PreparedTrajectory {
 public:
  /// @throw Refused if no trajectory has such points, or if an axis can't do its part after the
  ///   first segment.
  PreparedTrajectory(std::vector<PathAxis> axes, const std::vector<TrajectoryPoint>& points);
  PreparedTrajectory(const PreparedTrajectory&) = delete;
  PreparedTrajectory& operator=(const PreparedTrajectory&) = delete;

  const std::vector<PathAxis>& axes() const { return axes_; }
  /// [microsteps] Where each axis is to come to rest.
  double target(std::size_t member) const { return parts_[member].ends.back().position; }

  /// The path from where the axes are. With a backlash also what takes it up until that is what was
  /// prepared, which is mostly at the first turn.
  ///
  /// @param prepared is shared by the path, and by all profiles along it.
  /// @param starts one for each axis, at the time at which the path begins.
  ///
  /// One point alone without velocities is a straight line to rest, in its time.
  ///
  /// @throw Refused if an axis can't do its part from there; or if the backlash is taken up anew at
  ///   turn after turn and never at rest in between, so that it would take unbounded time to say.
  static std::shared_ptr<const SharedPath> join(
      const std::shared_ptr<const PreparedTrajectory>& prepared,
      const std::vector<PathStart>& starts);

 private:
  // All that is known of one axis beforehand. What has a motor tail points into its spline tail.
  struct Part {
    std::vector<motion::Waypoint> ends;  // the first waypoint, and the last
    bool begins_at_start = false;        // the first is at time 0, one of several
    std::unique_ptr<const motion::SplineTail> spline;
    std::unique_ptr<const motion::MotorTail> motor;  // with a backlash only
    motion::MotorBounds bounds;                      // that the tail comes to
  };

  std::shared_ptr<const SharedPath> lineTo(const std::vector<PathStart>& starts) const;
  Part prepare(std::size_t member, const std::vector<TrajectoryPoint>& points) const;
  motion::Waypoint waypointOf(std::size_t member, std::size_t index, const TrajectoryPoint& point,
                              const std::vector<motion::Waypoint>& before) const;
  TrajectoryPath::Member joinMember(const std::shared_ptr<const PreparedTrajectory>& own,
                                    std::size_t member, const PathStart& start) const;
  motion::MotorPlan planWhole(std::size_t member, const motion::Profile& joint, double slack) const;
  motion::MotionLimits motorLimits(std::size_t member) const;

  std::vector<PathAxis> axes_;
  std::vector<Part> parts_;
  bool lone_position_ = false;  // its only point has nothing but positions
};

}  // namespace stepdriver::axis
