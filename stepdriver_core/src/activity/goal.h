#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>

#include "axis/axis_model.h"
#include "axis/shared_path.h"
#include "call.h"
#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::activity {

/// What an axis was asked to do: all that a plan for it needs, from wherever the axis is.
struct Goal {
  enum class Kind { kMove, kJog, kTogether };

  Kind kind = Kind::kMove;
  std::uint64_t move = 0;  ///< its number; 0: nobody asked for it
  /// [microsteps] Of a move; of a jog where it has to stand at the latest, none without a limit.
  std::optional<std::int64_t> target;
  double remainder = 0.0;  ///< [microsteps] of a move: what was asked for less the target
  double velocity = 0.0;   ///< [unit/s] as asked for, before any override; of a jog with its sign
  bool of_motor = false;   ///< the target is the motor's; else the joint's, backlash or not
  std::shared_ptr<axis::Outcome<axis::MoveResult>> outcome;  ///< where its result appears
  std::int64_t began_ns = 0;                                 ///< motion time at which it began
  pulse::Nanoseconds slipped_ns = 0;  ///< by which the timeline had slid until then
};

/// Makes the path that axes share which are taken over at a motion time. @throw Refused
using JoinPath = std::function<std::shared_ptr<const axis::SharedPath>(std::int64_t at)>;

/// A goal and the axis that it is for.
struct Order {
  axis::AxisModel* axis = nullptr;
  Goal goal;
};

/// A goal that another one takes over from, until the engine has taken that.
struct Predecessor {
  axis::AxisModel* axis = nullptr;
  Goal goal;
  bool slowed_down = false;  ///< it had been stopped
  std::string stopped_by;
  Ack call;                  ///< of its beginning, if the engine had not yet taken that
  std::uint64_t serial = 0;  ///< of the order that would have begun it
};

}  // namespace stepdriver::activity
