#pragma once

#include <cstdint>
#include <vector>

#include "motion_limits.h"
#include "planner.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// The beginning of a motion within limits of which the jerk is lower than that of the motion
/// before: from its acceleration, the lower jerk may take the speed past standstill, or beyond its
/// maximum. Then the acceleration is first taken back to 0, with the jerk that this needs; at once
/// if that would take less than a nanosecond.
class AccelerationRampDown {
 public:
  /// @param most_jerk [microsteps/s^3] of the motion before; 0: it had no limit.
  AccelerationRampDown(std::int64_t start_ns, const MotionState& from, const MotionLimits& limits,
                       double most_jerk);

  bool isNeeded() const { return !pieces_.empty(); }
  /// The state from which to plan the rest, and its time. As given if it isn't needed.
  const MotionState& end() const { return end_; }
  std::int64_t endNs() const { return end_ns_; }
  /// The whole motion.
  Plan followedBy(Plan rest) const;

 private:
  std::int64_t start_ns_;
  std::vector<Piece> pieces_;
  MotionState end_;
  std::int64_t end_ns_;
};

}  // namespace stepdriver::motion
