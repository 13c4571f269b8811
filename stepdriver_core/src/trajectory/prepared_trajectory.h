#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "backlash.h"
#include "path_axis.h"
#include "profile/composition.h"
#include "profile/profile_peaks.h"
#include "spline.h"
#include "stepdriver_core/trajectory/requests.h"
#include "trajectory_path.h"

namespace stepdriver::motion {

/// A trajectory that is planned and checked except for its first segment, which depends on the
/// positions of the axes when it begins. Preparing it takes time in proportion to its points, in
/// any thread; joining it to the motions of the axes then takes a bounded time.
///
/// It is made from a copy of the facts about the axes. Before joining it, the caller compares that
/// copy with the present facts: if axes() differs (other limits, another scale or origin), it must
/// be prepared again.
///
/// Points that give only positions get the velocities of motion::interpolate(). If a limit doesn't
/// allow the times of the points, all of them are multiplied by the same factor, the smallest that
/// the limits allow, if the request has `allow_slower`; otherwise the trajectory is refused. A
/// single point to rest is reached from moving axes by the fastest motion of each axis.
class PreparedTrajectory {
 public:
  /// @param expected [microsteps] the state of each joint in which the trajectory will probably
  ///   begin. Velocities of points without them, and the factor, depend on it; the path begins in
  ///   the actual state nevertheless.
  /// @param allow_slower whether the times of the points may become longer.
  /// @param marks where outputs are switched along it; nullptr: nowhere.
  /// @throw Refused if no trajectory has such points, or if an axis can't do its part after the
  ///   first segment.
  PreparedTrajectory(std::vector<PathAxis> axes, const std::vector<TrajectoryPoint>& points,
                     const std::vector<MotionState>& expected, bool allow_slower = false,
                     std::shared_ptr<const PathMarks> marks = nullptr);
  PreparedTrajectory(const PreparedTrajectory&) = delete;
  PreparedTrajectory& operator=(const PreparedTrajectory&) = delete;

  const std::vector<PathAxis>& axes() const { return axes_; }
  /// [microsteps] The position at which each axis will come to rest.
  double target(std::size_t member) const { return parts_[member].target; }

  /// The path from the current positions of the axes. If there is a backlash, it is taken up until
  /// the result matches what was prepared, mostly at the first reversal. A single point without
  /// velocities is a straight line from rest to rest, in its time.
  ///
  /// @param prepared is shared by the path, and by all profiles along it.
  /// @param starts one for each axis, at the time at which the path begins.
  /// @throw Refused if an axis can't do its part from there; or if reversals follow each other so
  ///   closely that the backlash is never at rest, so that checking would take unbounded time.
  static std::shared_ptr<const SharedPath> join(
      const std::shared_ptr<const PreparedTrajectory>& prepared,
      const std::vector<PathStart>& starts);

 private:
  // Everything that is known about one axis in advance. A motor's tail refers to the spline's tail.
  struct Part {
    std::vector<Waypoint> ends;    // the first and the last waypoint
    double target = 0.0;           // [microsteps] the commanded last position
    bool begins_at_start = false;  // the first of several points is at time 0
    std::unique_ptr<const SplineTail> spline;
    std::unique_ptr<const MotorTail> motor;  // only with a backlash
    MotorBounds bounds;                      // what the tail needs
  };

  // The points from which a trajectory is made.
  struct Source {
    const std::vector<TrajectoryPoint>& points;
    const std::vector<MotionState>& expected;
    double slowdown = 1.0;  // the times of the points are multiplied by it

    double duration() const { return slowdown * points.back().time; }
  };
  // The way to the first point.
  struct Head {
    std::vector<Piece> pieces;
    SplineJerk jerk;
  };

  std::shared_ptr<const SharedPath> lineTo(const std::vector<PathStart>& starts) const;
  std::shared_ptr<const SharedPath> joinAll(const std::shared_ptr<const PreparedTrajectory>& own,
                                            const std::vector<PathStart>& starts,
                                            bool at_rest) const;
  /// The smallest factor on the times that the limits allow, at least that of the source; empty if
  /// the limits allow none.
  std::optional<double> slowdownFor(Source source) const;
  Part prepare(std::size_t member, const Source& source) const;
  void requirePoints(const std::vector<TrajectoryPoint>& points) const;
  /// Whether the velocities and accelerations of a single point aren't used.
  bool onlyPositionsCount(const std::vector<TrajectoryPoint>& points) const;
  std::vector<Waypoint> waypointsOf(std::size_t member, const Source& source) const;
  double wantedDuration() const;  // [s]
  Head headOf(std::size_t member, const PathStart& start) const;
  /// The fastest motion to rest at the last point.
  std::vector<Piece> quickestTo(std::size_t member, const PathStart& start) const;
  /// Whether the trajectory has a single segment, which ends at rest.
  bool isOneRest() const;
  TrajectoryPath::Member joinMember(const std::shared_ptr<const PreparedTrajectory>& own,
                                    std::size_t member, const PathStart& start, const Head& given,
                                    const std::function<std::string()>& remedy) const;
  MotorPlan planWhole(std::size_t member, const Profile& joint, double slack) const;
  MotionLimits motorLimits(std::size_t member) const;
  SplineLimits curveLimits(std::size_t member) const;

  std::vector<PathAxis> axes_;
  std::vector<Part> parts_;
  bool lone_position_ = false;   // there is a single point, and only its positions count
  bool has_velocities_ = false;  // all points have velocities
  bool allow_slower_ = false;
  std::shared_ptr<const PathMarks> marks_;
};

}  // namespace stepdriver::motion
