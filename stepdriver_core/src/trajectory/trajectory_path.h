#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "feed_rate.h"
#include "profile/composition.h"
#include "shared_path.h"

namespace stepdriver::axis {

/// A trajectory, or the rest of one whose beginning is no longer needed. The path's unit is a
/// second of it; at a lower rate the axes stay on its curve.
class TrajectoryPath : public SharedPath {
 public:
  /// The motion of one axis.
  struct Member {
    std::shared_ptr<const motion::Profile> curve;  ///< of the motor; it starts at time 0
    motion::MotorBounds bounds;                    ///< of its motor
    motion::MotorBounds stop_bounds;               ///< the same, for stops
  };

  /// @param members at least one. @param origin [s] the position on the path at which the curves
  ///   start.
  explicit TrajectoryPath(std::vector<Member> members, motion::DoubleDouble origin = {});

  const std::vector<Member>& members() const { return members_; }
  motion::DoubleDouble origin() const { return origin_; }
  /// The position of its end.
  motion::DoubleDouble end() const { return origin_ + members_.front().curve->duration(); }

  motion::MotionState begin() const override { return {origin_, 1.0, 0.0}; }
  /// At full rate, if all axes are at rest there anyway.
  motion::MotionState restart(motion::DoubleDouble position) const override;
  motion::Profile plan(std::int64_t at, const motion::MotionState& from,
                       double speed_override) const override;
  motion::Profile planStop(std::int64_t at, const motion::MotionState& from) const override;
  motion::Profile profileOf(std::size_t member, const motion::Profile& path) const override;

 private:
  using Bounds = motion::MotorBounds Member::*;

  void endTogether();
  /// Of the position on the curves.
  motion::Profile changeRate(std::int64_t at, const motion::MotionState& from, double rate,
                             Bounds bounds) const;
  /// @return no value if the limits leave no room for it.
  std::optional<motion::Profile> fastestChange(std::int64_t at, const motion::MotionState& from,
                                               double rate, Bounds bounds) const;
  std::vector<motion::Piece> levelOff(std::int64_t at, const motion::MotionState& from) const;
  /// As changeRate(), or a steeper fall of the rate.
  motion::Profile slowDown(std::int64_t at, const motion::MotionState& from, double rate,
                           Bounds bounds) const;
  /// The steepest fall to a rate, if it takes less than a time [s].
  std::optional<motion::Profile> brake(std::int64_t at, const motion::MotionState& from,
                                       double rate, Bounds bounds, double sooner_than) const;
  motion::Profile onPath(const motion::Profile& on_curves) const;
  motion::MotionState onCurves(const motion::MotionState& on_path) const;
  motion::RateLimits steepest(const motion::MotionState& from, double delay, Bounds bounds) const;
  bool keeps(const motion::Profile& path, Bounds bounds) const;

  std::vector<Member> members_;
  const motion::DoubleDouble origin_;
};

}  // namespace stepdriver::axis
