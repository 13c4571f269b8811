#pragma once

#include <cstdint>
#include <vector>

#include "motion_limits.h"
#include "planner.h"
#include "profile/profile.h"

namespace stepdriver::motion {

/// The beginning of a motion whose jerk limit is lower than that of the motion before. With the
/// lower jerk, the acceleration of the motion before could take the speed past standstill or beyond
/// its maximum. The acceleration is therefore reduced to 0 first, with the jerk that this needs, or
/// at once if that would take less than a nanosecond.
class AccelerationRampDown {
 public:
  /// @param most_jerk [microsteps/s^3] the jerk limit of the motion before; 0: it had none.
  AccelerationRampDown(std::int64_t start_ns, const MotionState& from, const MotionLimits& limits,
                       double most_jerk);

  bool isNeeded() const { return !pieces_.empty(); }
  /// The state from which the rest is to be planned, and its time. It is the given state if no ramp
  /// is needed.
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
