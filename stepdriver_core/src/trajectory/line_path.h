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
  /// @param starts at rest; the backlash is taken up.
  /// @param targets [microsteps] of each joint, see PathAxis::restAt().
  /// @param velocity along the path, see motion::LineRequest; 0: as fast as the limits allow.
  /// @param duration [s] of the line; 0: determined by the velocity.
  /// @throw Refused if the limits of the axes don't allow that velocity, or that duration.
  LinePath(std::vector<PathAxis> axes, const std::vector<PathStart>& starts,
           const std::vector<double>& targets, double velocity, double duration);

  /// [s] From rest to rest, as fast as the limits allow.
  double shortestDuration() const;

  /// @return whether it was planned for these axes from these positions.
  bool isOf(const std::vector<PathAxis>& axes, const std::vector<PathStart>& starts) const;

  /// @throw Refused if an axis isn't at rest at the beginning of the line.
  void requireStart(const std::vector<PathStart>& starts) const;

  MotionState begin() const override { return {}; }
  Profile plan(std::int64_t at, const MotionState& from, double speed_override) const override;
  Profile planStop(std::int64_t at, const MotionState& from) const override;
  Profile profileOf(std::size_t member, const Profile& path) const override;

 private:
  MotionLimits tightest(MotionLimits PathAxis::*limits) const;
  /// Linear if a linear axis moves: then the velocity of the line is that of the linear axes.
  config::Kind kindOfVelocity() const;
  double pathSpeed(double velocity) const;
  double checkedSpeed(double velocity) const;
  double durationAt(double speed) const;
  double speedFor(double duration) const;
  double scale(std::size_t member) const;

  std::vector<PathAxis> axes_;
  std::vector<DoubleDouble> origins_;  // microsteps of the motor
  std::vector<DoubleDouble> ways_;
  std::int64_t length_ = 0;   // of the path: the longest distance, plus up to a microstep
  MotionLimits limits_;       // that the axes allow
  MotionLimits stop_limits_;  // the same, for stops
  double speed_ = 0.0;        // requested speed, at a speed override of 1
};

}  // namespace stepdriver::motion
