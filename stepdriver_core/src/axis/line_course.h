#pragma once

#include <cstdint>
#include <vector>

#include "course.h"
#include "stepdriver_core/motion/limits.h"

namespace stepdriver::axis {

/// A straight line from where the axes rest. The path's unit is about a microstep of the axis
/// that makes the most of them.
class LineCourse : public Course {
 public:
  /// @param axes at rest. @param targets [microsteps] of each.
  /// @param velocity along the path, as machine::LineRequest has it; 0: as the limits allow.
  LineCourse(std::vector<Axis::Impl*> axes, const std::vector<std::int64_t>& targets,
             double velocity);

  /// Slows the line down so that it takes a time [s]. @throw Refused where it can't be that fast.
  void stretchTo(double duration);

  void start(std::int64_t at) override;
  motion::MotionState begin() const override;
  motion::Profile plan(std::int64_t at, const motion::MotionState& from,
                       double speed_override) const override;
  motion::Profile planStop(std::int64_t at, const motion::MotionState& from) const override;
  motion::Profile profileOf(std::size_t member, const motion::Profile& path) const override;

 private:
  void takeLimits();
  double pathSpeed(double velocity) const;
  double durationAt(double speed) const;
  double scale(std::size_t member) const;

  std::vector<motion::DoubleDouble> origins_;  // microsteps of the motor
  std::vector<motion::DoubleDouble> ways_;
  std::int64_t length_ = 0;      // of the path: the longest way, and up to a microstep more
  motion::MotionLimits limits_;  // as the axes allow
  double stop_deceleration_ = 0.0;
  double speed_ = 0.0;  // wanted, at a speed override of 1
};

}  // namespace stepdriver::axis
