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

/// A trajectory that is planned and checked except for its first segment, which depends on the
/// positions of the axes when it begins. Preparing it takes time in proportion to its points, in
/// any thread; joining it to the motions of the axes then takes a bounded time.
///
/// It is made from a copy of the facts about the axes. Before joining it, the caller compares that
/// copy with the present facts: if axes() differs (other limits, another scale or origin), it must
/// be prepared again.
class PreparedTrajectory {
 public:
  /// @throw Refused if no trajectory has such points, or if an axis can't do its part after the
  ///   first segment.
  PreparedTrajectory(std::vector<PathAxis> axes, const std::vector<TrajectoryPoint>& points);
  PreparedTrajectory(const PreparedTrajectory&) = delete;
  PreparedTrajectory& operator=(const PreparedTrajectory&) = delete;

  const std::vector<PathAxis>& axes() const { return axes_; }
  /// [microsteps] The position at which each axis will come to rest.
  double target(std::size_t member) const { return parts_[member].ends.back().position; }

  /// The path from the current positions of the axes. If there is a backlash, it is taken up until
  /// the result matches what was prepared, mostly at the first reversal.
  ///
  /// @param prepared is shared by the path, and by all profiles along it.
  /// @param starts one for each axis, at the time at which the path begins.
  ///
  /// A single point without velocities is a straight line to rest, in its time.
  ///
  /// @throw Refused if an axis can't do its part from there; or if reversals follow each other so
  ///   closely that the backlash is never at rest, so that checking would take unbounded time.
  static std::shared_ptr<const SharedPath> join(
      const std::shared_ptr<const PreparedTrajectory>& prepared,
      const std::vector<PathStart>& starts);

 private:
  // Everything that is known about one axis in advance. A motor tail points into the spline tail.
  struct Part {
    std::vector<motion::Waypoint> ends;  // the first waypoint, and the last
    bool begins_at_start = false;        // the first of several points is at time 0
    std::unique_ptr<const motion::SplineTail> spline;
    std::unique_ptr<const motion::MotorTail> motor;  // only with a backlash
    motion::MotorBounds bounds;                      // reached by the tail
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
  bool lone_position_ = false;  // its only point gives only positions
};

}  // namespace stepdriver::axis
