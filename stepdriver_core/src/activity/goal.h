#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "axis/axis_model.h"
#include "call.h"
#include "motion_outputs.h"
#include "point_to_point/motion_limits.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/pulse/clock.h"
#include "trajectory/shared_path.h"

namespace stepdriver::activity {

/// What the motors of an axis with several do in a motion, see pulse::Follow.
struct MotorsTogether {
  pulse::MotorSet still = 0;
  bool square = false;
  bool are_square = false;
};

/// A setpoint, of a stream of them. Positions are of the joint, times are motion times.
struct Setpoint {
  bool of_position = false;    ///< otherwise Goal::velocity is the setpoint
  double position = 0.0;       ///< [microsteps]
  double velocity = 0.0;       ///< [microsteps/s] the velocity of the position
  std::int64_t reach_ns = 0;   ///< the position is reached then, with that velocity
  std::int64_t return_ns = 0;  ///< without another setpoint it comes to rest at the position then
  double period = 0.0;         ///< [s] the stream's period
  std::int64_t until_ns = 0;   ///< without another setpoint it begins to come to rest then
};

/// A command for an axis: everything that a plan needs, from any state of the axis.
struct Goal {
  enum class Kind { kMove, kJog, kSetpoint, kTogether };

  Kind kind = Kind::kMove;
  std::uint64_t move = 0;  ///< its number; 0: no client has requested it
  /// [microsteps] The target of a move or of a setpoint of position. For a jog or a setpoint of
  /// velocity it is the position at which the axis must stop, empty without a limit.
  std::optional<std::int64_t> target;
  double remainder = 0.0;  ///< [microsteps] the commanded position of a move minus the target
  /// [unit/s] As requested, without the override; of a jog or a setpoint of velocity with its sign.
  double velocity = 0.0;
  Setpoint setpoint;      ///< used by a kSetpoint only
  bool of_motor = false;  ///< true: the target is the motor's; false: the joint's
  MotorsTogether motors;
  /// Its steps are never late by more than a quarter of an interval: its end measures a place.
  bool measures = false;
  bool until_block = false;                  ///< see pulse::Follow
  bool ignores_override = false;             ///< what it measures depends on its speed
  std::shared_ptr<const MarksOfPath> marks;  ///< of its path; may be empty
  motion::MotionLimits path_limits;  ///< [microsteps] the limits that the path of a kTogether keeps
  /// At the target the axis waits for a path that continues its own: it isn't the end.
  bool waits_at_target = false;
  std::shared_ptr<axis::Outcome<axis::MoveResult>> outcome;  ///< receives its result
  std::int64_t began_ns = 0;                                 ///< motion time at which it began
  pulse::Nanoseconds slipped_ns = 0;  ///< how far the timeline had slid by then

  /// [microsteps] The commanded position minus the count at which its motion ends. An axis that
  /// shares motors has no counts of its own, and its motions end at the commanded position.
  double between(const axis::AxisModel& axis) const {
    return axis.sharers().empty() ? 0.0 : remainder;
  }
  /// [microsteps] The end of its motion. @pre it has a target.
  double end(const axis::AxisModel& axis) const {
    return static_cast<double>(*target) + between(axis);
  }
  /// It is a velocity, not a position.
  bool runs() const {
    return kind == Kind::kJog || (kind == Kind::kSetpoint && !setpoint.of_position);
  }
  /// It leads the joint to a place.
  bool hasTarget() const { return !of_motor && !runs(); }
  bool isSetpointOfPosition() const { return kind == Kind::kSetpoint && setpoint.of_position; }
  /// It lasts only as long as its client sends messages: a hold ends it.
  bool isStreamed() const { return kind == Kind::kJog || kind == Kind::kSetpoint; }
};

/// Makes the shared path of axes that are taken over at a motion time. @throw Refused
using JoinPath = std::function<std::shared_ptr<const motion::SharedPath>(std::int64_t at)>;

/// A path that continues the one that axes follow.
struct Extension {
  std::shared_ptr<const motion::SharedPath> of;  ///< the path that it continues
  std::shared_ptr<const motion::SharedPath> path;
  /// Positions on both paths between which they are the same. Before that, the new one isn't known.
  motion::DoubleDouble same_from;
  motion::DoubleDouble same_until;
  bool moves_on =
      false;  ///< it leads beyond the end of the other; otherwise only that is known now
  std::vector<double> targets;  ///< [microsteps] the commanded position of each joint at its end
};

/// Axes whose motions begin at the same motion time, and are independent from then on. The engine
/// accepts all of them or none.
struct CommonStart {
  std::uint64_t number = 0;  ///< Context::newStart()
  std::vector<const axis::AxisModel*> axes;
};

/// A goal and its axis.
struct Order {
  axis::AxisModel* axis = nullptr;
  Goal goal;
};

/// A goal that another one replaces, until the engine has accepted the new one.
struct Predecessor {
  /// An order to the engine, towards the goal or to come to rest before it.
  struct Followed {
    std::uint64_t serial = 0;
    bool slows_down = false;
  };

  axis::AxisModel* axis = nullptr;
  Goal goal;
  std::string left_by;       ///< why it isn't reached if its axis comes to rest before it, in words
  SharedCall call;           ///< waits for its beginning, if the engine had not yet accepted it
  std::uint64_t serial = 0;  ///< the order that would have begun it
  /// The last order for it that the engine has accepted, and those that it has not yet handled.
  std::vector<Followed> orders;
};

}  // namespace stepdriver::activity
