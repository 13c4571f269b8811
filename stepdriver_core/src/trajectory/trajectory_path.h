#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "feed_rate.h"
#include "profile/composition.h"
#include "shared_path.h"

namespace stepdriver::motion {

/// A trajectory, or the rest of one whose beginning is no longer needed. The path's unit is a
/// second of it; at a lower rate the axes stay on its curve.
class TrajectoryPath : public SharedPath {
 public:
  /// The motion of one axis.
  struct Member {
    std::shared_ptr<const Profile> curve;  ///< the motor's; it starts at time 0
    MotorBounds bounds;                    ///< the motor's limits
    MotorBounds stop_bounds;               ///< the motor's limits for stops
  };

  /// @param members at least one. @param origin [s] the position on the path at which the curves
  ///   start.
  explicit TrajectoryPath(std::vector<Member> members, DoubleDouble origin = {},
                          std::shared_ptr<const PathMarks> marks = nullptr);

  const std::vector<Member>& members() const { return members_; }
  DoubleDouble origin() const { return origin_; }
  /// The position of its end.
  DoubleDouble end() const { return origin_ + members_.front().curve->duration(); }

  MotionState begin() const override { return {origin_, 1.0, 0.0}; }
  std::shared_ptr<const PathMarks> marks() const override { return marks_; }
  /// Continues at full rate if all axes are at rest at that position anyway.
  MotionState restart(DoubleDouble position) const override;
  Profile plan(std::int64_t at, const MotionState& from, double speed_override) const override;
  Profile planStop(std::int64_t at, const MotionState& from) const override;
  Profile profileOf(std::size_t member, const Profile& path) const override;

 private:
  using Bounds = MotorBounds Member::*;

  void endTogether();
  /// [s] The time on the curves that belongs to a position on the path.
  Profile changeRate(std::int64_t at, const MotionState& from, double rate, Bounds bounds) const;
  /// @return no value if the limits leave no room for it.
  std::optional<Profile> fastestChange(std::int64_t at, const MotionState& from, double rate,
                                       Bounds bounds) const;
  std::vector<Piece> rampDown(std::int64_t at, const MotionState& from) const;
  /// The path of changeRate(), or one on which the rate falls more steeply.
  Profile slowDown(std::int64_t at, const MotionState& from, double rate, Bounds bounds) const;
  /// The steepest fall to a rate, if it takes less time than this [s].
  std::optional<Profile> brake(std::int64_t at, const MotionState& from, double rate, Bounds bounds,
                               double sooner_than) const;
  Profile onPath(const Profile& on_curves) const;
  MotionState onCurves(const MotionState& on_path) const;
  FeedRateLimits steepest(const MotionState& from, double delay, Bounds bounds) const;
  bool keeps(const Profile& path, Bounds bounds) const;

  std::vector<Member> members_;
  const DoubleDouble origin_;
  const std::shared_ptr<const PathMarks> marks_;
};

}  // namespace stepdriver::motion
