#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>

#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/motion/profile.h"

namespace stepdriver::axis {

class Course;

/// What an axis was asked to do: all that a plan for it needs, from wherever the axis is.
struct Goal {
  enum class Kind { kMove, kJog, kTogether };

  Kind kind = Kind::kMove;
  std::uint64_t move = 0;  ///< the move that it belongs to
  /// [microsteps] Of a move; of a jog where it has to stand at the latest, none without a limit.
  std::optional<std::int64_t> target;
  double velocity = 0.0;   ///< [unit/s] as asked for, before any override; of a jog with its sign
  std::string stopped_by;  ///< what decelerates it; empty: it goes on
  bool held = false;       ///< decelerates, to go on later
  bool of_motor = false;   ///< the target is the motor's; else the joint's, backlash or not
  std::shared_ptr<Course> course;  ///< of kTogether, shared with the other axes
  std::size_t member = 0;          ///< which of its axes this is

  bool stops() const { return !stopped_by.empty(); }
  bool slowsDown() const { return held || stops(); }
};

/// A profile that the pulse engine has, and what it is for.
struct Motion {
  std::uint64_t serial = 0;     ///< of the command that it went out with
  std::uint64_t continues = 0;  ///< serial of the motion that it was planned to take over from
  Goal goal;
  std::int64_t begin_ns = 0;  ///< motion time at which the move began
  double overshoot = 0.0;     ///< [microsteps] how far it passes its end before it comes back
  std::unique_ptr<const motion::Profile> profile;
  std::shared_ptr<const motion::Profile> path;  ///< of kTogether: along its course
};

/// What a feed hold keeps of a motion.
struct Held {
  Goal goal;
  std::int64_t begin_ns = 0;
  std::shared_ptr<const motion::Profile> path;
};

/// The motions that the engine may still look at, and how the last moves ended.
class MoveLog {
 public:
  void add(Motion motion) { motions_.push_back(std::move(motion)); }

  /// The engine never took this one.
  void withdraw(std::uint64_t serial);

  /// Forgets what the engine has no more use for: all before the one that it follows or that ended.
  void dropBefore(std::uint64_t serial);

  /// The motion that went out last; nullptr where none is in the log.
  const Motion* latest() const { return motions_.empty() ? nullptr : &motions_.back(); }
  const Motion* find(std::uint64_t serial) const;

  void conclude(std::uint64_t move, MoveResult result);
  std::optional<MoveResult> result(std::uint64_t move) const;

 private:
  struct Concluded {
    std::uint64_t move;
    MoveResult result;
  };

  std::deque<Motion> motions_;
  std::deque<Concluded> concluded_;
};

}  // namespace stepdriver::axis
