#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "motion/compose.h"
#include "motion/rate.h"
#include "shared_path.h"

namespace stepdriver::axis {

/// A trajectory. The path's unit is a second of it; at a lower rate the axes stay on its curve.
class TrajectoryPath : public SharedPath {
 public:
  /// The motion of one axis.
  struct Member {
    std::shared_ptr<const motion::Profile> curve;  ///< of the motor, from time 0 on
    motion::MotorBounds bounds;                    ///< of its motor
    motion::MotorBounds stop_bounds;               ///< the same, for stops
  };

  /// @param members at least one.
  explicit TrajectoryPath(std::vector<Member> members);

  motion::MotionState begin() const override { return {0.0, 1.0, 0.0}; }
  motion::Profile plan(std::int64_t at, const motion::MotionState& from,
                       double speed_override) const override;
  motion::Profile planStop(std::int64_t at, const motion::MotionState& from) const override;
  motion::Profile profileOf(std::size_t member, const motion::Profile& path) const override;

 private:
  using Bounds = motion::MotorBounds Member::*;

  void endTogether();
  motion::Profile changeRate(std::int64_t at, const motion::MotionState& from, double rate,
                             Bounds bounds) const;
  motion::RateLimits steepest(const motion::MotionState& from, double delay, Bounds bounds) const;
  bool keeps(const motion::Profile& path, Bounds bounds) const;

  std::vector<Member> members_;
};

}  // namespace stepdriver::axis
