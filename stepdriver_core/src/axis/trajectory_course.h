#pragma once

#include <cstdint>
#include <vector>

#include "course.h"
#include "stepdriver_core/axis/coordination.h"
#include "stepdriver_core/motion/along.h"
#include "stepdriver_core/motion/limits.h"
#include "stepdriver_core/motion/rate.h"
#include "stepdriver_core/motion/spline.h"

namespace stepdriver::axis {

/// A trajectory. The path's unit is a second of it; to run through it more slowly is to stay on its
/// curve.
class TrajectoryCourse : public Course {
 public:
  /// @throw Refused for points that no trajectory has.
  TrajectoryCourse(std::vector<Axis::Impl*> axes, const std::vector<CoursePoint>& points);

  /// [microsteps] Where each axis comes to rest.
  std::vector<std::int64_t> targets() const;

  /// @throw Refused where an axis can't do its part.
  void start(std::int64_t at) override;
  motion::MotionState begin() const override;
  motion::Profile plan(std::int64_t at, const motion::MotionState& from,
                       double speed_override) const override;
  motion::Profile planStop(std::int64_t at, const motion::MotionState& from) const override;
  motion::Profile profileOf(std::size_t member, const motion::Profile& path) const override;

 private:
  void takePoint(std::size_t member, std::size_t index, const CoursePoint& point);
  void requireStart(std::size_t member) const;
  void requirePositions(std::size_t member, const motion::Profile& joint) const;
  void requireSmooth(std::size_t member, const motion::SplineJerk& jerk) const;
  void requireLimits(std::size_t member, double velocity_before);
  void requireWithin(std::size_t member, const motion::Peak& peak, double most, const char* what,
                     const char* per) const;
  motion::Profile motorOf(std::size_t member, const motion::Profile& joint, double slack) const;
  void endTogether();
  motion::Profile changeRate(std::int64_t at, const motion::MotionState& from, double rate,
                             const std::vector<motion::AlongLimits>& most) const;
  motion::RateLimits steepest(const motion::MotionState& from, double delay,
                              const std::vector<motion::AlongLimits>& most) const;
  bool keeps(const motion::Profile& path, const std::vector<motion::AlongLimits>& most) const;

  // Of each axis.
  std::vector<std::vector<motion::Waypoint>> waypoints_;
  std::vector<motion::Profile> curves_;    // of the motor, from time 0 on
  std::vector<motion::AlongLimits> most_;  // that each may have
};

}  // namespace stepdriver::axis
