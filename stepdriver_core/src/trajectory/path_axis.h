#pragma once

#include <cmath>
#include <cstdint>
#include <optional>
#include <string>
#include <type_traits>

#include "point_to_point/motion_limits.h"
#include "profile/profile.h"
#include "profile/resting_count.h"
#include "stepdriver_core/config/axis_config.h"

namespace stepdriver::motion {

/// Everything that a path of several axes needs to know about one of them. It is a copy: any thread
/// may plan a path from it, and compare it later with the state at that time.
struct PathAxis {
  std::string name;  ///< refusals begin with it
  config::Kind kind = config::Kind::kLinear;
  /// The axis shares motors, and may come to rest between its own counts.
  bool shares_motors = false;
  int microsteps = 1;           ///< microsteps in a full step
  double steps_per_unit = 1.0;  ///< [microsteps/unit]
  double origin = 0.0;          ///< [unit] the position at count 0
  bool continuous = false;      ///< see config::AxisConfig
  /// [unit] The soft limits.
  std::optional<double> min_position;
  std::optional<double> max_position;
  config::LimitSource min_position_source = config::LimitSource::kConfiguration;
  config::LimitSource max_position_source = config::LimitSource::kConfiguration;
  double configured_backlash = 0.0;  ///< [unit]
  std::int64_t backlash = 0;         ///< [microsteps]
  /// [microsteps] The limits for motions that begin now. The maximum speed doesn't include the
  /// speed override.
  MotionLimits limits;
  config::LimitSource max_speed_source = config::LimitSource::kConfiguration;
  /// [microsteps] The configured limits, which apply to every stop regardless of `limits`.
  MotionLimits stop_limits;

  bool operator==(const PathAxis& other) const;
  bool operator!=(const PathAxis& other) const { return !(*this == other); }

  double positionOf(double count) const { return origin + count / steps_per_unit; }
  double countOf(double position) const { return (position - origin) * steps_per_unit; }
  /// [unit] The whole turns that bring a position as near as possible to another one if they are
  /// added to it. They are 0 if the axis isn't continuous, or if the position is too far away to be
  /// counted.
  double turnsTowards(double other, double position) const {
    if (!continuous || isTooFar(position)) return 0.0;
    return config::kTurn * std::round((other - position) / config::kTurn);
  }
  /// [microsteps] The place at which a motion ends that is to bring the axis to a position.
  double restAt(double count) const {
    return shares_motors ? count : static_cast<double>(restingCount(count));
  }
  /// [microsteps/s^2] The larger of acceleration and deceleration.
  double mostAcceleration() const;

  /// The text of a value that was requested or configured: "0.1 m", "0.1 rad/s".
  std::string show(double value, const char* per = "") const;
  /// The text of a position at which the axis stands or comes to rest: "0.1 m".
  std::string showPlace(double position) const;
  /// The text of a limit with its source: "0.1 m, from robot_description".
  std::string showLimit(double value, config::LimitSource source, const char* per = "") const;
  /// Refuses with the name of the axis before the reason: "x: why". @throw Refused always.
  [[noreturn]] void refuse(const std::string& why) const;
  /// Why the axis may not be at a position: it is beyond a soft limit, or too many steps away.
  ///
  /// @param position [unit]
  /// @param what the name of the position in the text: "the position"
  /// @return empty if the axis may be there.
  std::string whyBeyondLimits(double position, const std::string& what) const;
  /// @throw Refused if whyBeyondLimits() returns a reason.
  void refuseBeyondLimits(double position, const std::string& what) const;
  /// @param what returns the text; it is called only for a refusal.
  template <typename What>
  std::enable_if_t<std::is_invocable_v<What>> refuseBeyondLimits(double position,
                                                                 const What& what) const {
    if (isBelow(position) || isAbove(position) || isTooFar(position)) {
      refuseBeyondLimits(position, std::string(what()));
    }
  }

 private:
  // [microsteps] The longest distance of one move: up to it, doubles represent every count and half
  // count exactly.
  static constexpr double kFarthest = 1099511627776.0;  // 2^40

  // The tolerance is half a step: a position that rounds to the limit is at the limit.
  bool isBelow(double position) const {
    return min_position && position < *min_position - 0.5 / steps_per_unit;
  }
  bool isAbove(double position) const {
    return max_position && position > *max_position + 0.5 / steps_per_unit;
  }
  bool isTooFar(double position) const { return std::abs(countOf(position)) > kFarthest; }
};

/// The state of an axis at the beginning of a path.
struct PathStart {
  MotionState motor;   ///< [microsteps]
  double slack = 0.0;  ///< [microsteps] the part of the backlash that is taken up
  bool moves = false;  ///< whether the axis is moving
};

}  // namespace stepdriver::motion
