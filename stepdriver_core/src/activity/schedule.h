#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "context.h"
#include "follow_goal.h"
#include "goal.h"
#include "trajectory/path_axis.h"
#include "trajectory/shared_path.h"

namespace stepdriver::activity {

/// Makes the shared path of axes from their states at its beginning. @throw Refused
using JoinStarts =
    std::function<std::shared_ptr<const motion::SharedPath>(const std::vector<motion::PathStart>&)>;

/// A motion of several axes along one path that begins at a motion time ahead.
struct LaterMotion {
  std::vector<Order> orders;
  JoinStarts join;
  std::vector<motion::PathAxis> facts;  ///< from which the path was prepared, by order
  std::int64_t begins_ns = 0;           ///< motion time
};

/// Motions that were accepted and begin later. Until then they own nothing: their axes continue
/// whatever they do. Here alone it is decided what ends them before that:
///
/// - Each is checked when it is accepted, from the state that its axes will have at its beginning,
///   and again when the plan of one of them changes. If it can't begin from there, it is dropped.
/// - Whatever stops, holds, disables or puts at fault one of its axes drops it, and so do an
///   endstop, new limits, and each command that replaces a motion. Streamed setpoints and jogs do
///   not: they continue until it begins.
/// - A later motion that begins at the same time or earlier replaces it, one that begins after it
///   takes over from it in its turn.
class Schedule {
 public:
  explicit Schedule(Context& context) : context_(context) {}

  /// @return the move of each axis. @throw Refused; then nothing has changed.
  std::vector<axis::Move> add(LaterMotion motion);
  bool has(const axis::AxisModel& axis) const;
  /// Drops all motions of an axis; their callers are told.
  void drop(const axis::AxisModel& axis, const EarlyEnd& why);
  void dropAll(const EarlyEnd& why);
  /// Drops one motion. @return whether there was one with this move of the axis.
  bool dropMove(const axis::AxisModel& axis, std::uint64_t move, const EarlyEnd& why);

  /// Drops what can't begin anymore.
  void poll();
  /// Axes that must be woken up before their motion begins.
  std::vector<axis::AxisModel*> toWake() const;
  /// A motion that must begin now, and the call that tells its callers if it doesn't.
  struct Due {
    std::unique_ptr<FollowGoal> activity;
    SharedCall call;
  };
  std::optional<Due> takeDue();
  /// Clock time by which takeDue() must be called.
  pulse::Nanoseconds due() const;

 private:
  /// What an axis will be doing when a motion begins: the later motion of this number in this
  /// version, or the order to the engine with this serial.
  struct Source {
    std::uint64_t later = 0;
    std::uint64_t number = 0;
    bool operator==(const Source& other) const {
      return later == other.later && number == other.number;
    }
  };
  struct Entry {
    LaterMotion motion;
    std::uint64_t id = 0;
    std::uint64_t version = 0;  // how often it was planned
    // One of each for each order:
    std::vector<std::uint64_t> stops;
    std::vector<std::uint64_t> ended;  // motions of its axis
    std::vector<Source> from;
    std::vector<std::shared_ptr<const motion::Profile>> plans;  // one for each motor
  };
  struct Drop {
    const axis::AxisModel* axis;
    EarlyEnd why;
  };

  const Entry* before(const Entry& entry, const axis::AxisModel& axis) const;
  Source sourceOf(const Entry& entry, const axis::AxisModel& axis) const;
  void plan(Entry& entry) const;
  std::optional<Drop> whyNot(Entry& entry) const;
  pulse::Nanoseconds lead(const Entry& entry) const;
  template <typename Which>
  bool dropIf(const Which& which, const axis::AxisModel& axis, const EarlyEnd& why);

  Context& context_;
  std::vector<Entry> entries_;  // in the order of their beginnings
  std::uint64_t accepted_ = 0;
};

}  // namespace stepdriver::activity
