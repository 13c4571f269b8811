#pragma once

#include <cstdint>
#include <vector>

#include "path_axis.h"
#include "point_to_point/motion_limits.h"
#include "shared_path.h"

namespace stepdriver::motion {

/// A straight line from the positions of the axes at rest. The path's unit is about a microstep of
/// the axis that makes the most of them.
class LinePath : public SharedPath {
 public:
  /// @param starts the axes are at rest, and their backlash is taken up.
  /// @param targets [microsteps] those of the joints, see PathAxis::restAt().
  /// @param velocity the velocity along the path, see motion::LineRequest; 0: as fast as the limits
  ///   allow.
  /// @param duration [s] the duration of the line; 0: the velocity determines it.
  /// @throw Refused if the limits of the axes don't allow that velocity, or that duration.
  LinePath(std::vector<PathAxis> axes, const std::vector<PathStart>& starts,
           const std::vector<double>& targets, double velocity, double duration);

  /// [s] The duration from rest to rest, as fast as the limits allow.
  double shortestDuration() const;

  /// Whether the line was planned for these axes from these positions.
  bool isOf(const std::vector<PathAxis>& axes, const std::vector<PathStart>& starts) const;

  /// @throw Refused if an axis isn't at rest at the beginning of the line.
  void requireStart(const std::vector<PathStart>& starts) const;

  MotionState begin() const override { return {}; }
  Profile plan(std::int64_t at, const MotionState& from, double speed_override) const override;
  Profile planStop(std::int64_t at, const MotionState& from) const override;
  Profile profileOf(std::size_t member, const Profile& path) const override;

 private:
  MotionLimits tightest(MotionLimits PathAxis::*limits) const;
  /// The kind is linear if a linear axis moves: the velocity of the line is then that of the linear
  /// axes.
  config::Kind kindOfVelocity() const;
  double pathSpeed(double velocity) const;
  double checkedSpeed(double velocity) const;
  double durationAt(double speed) const;
  double speedFor(double duration) const;
  double scale(std::size_t member) const;

  std::vector<PathAxis> axes_;
  std::vector<DoubleDouble> origins_;  // [microsteps] the positions of the motors
  std::vector<DoubleDouble> ways_;
  std::int64_t length_ = 0;   // the longest distance of an axis, plus up to a microstep
  MotionLimits limits_;       // those along the path that the axes allow
  MotionLimits stop_limits_;  // the same, for stops
  double speed_ = 0.0;        // the requested one, at a speed override of 1
};

}  // namespace stepdriver::motion
