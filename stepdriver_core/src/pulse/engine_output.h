#pragma once

#include <cstdint>
#include <optional>

#include "channel/output_line.h"
#include "channel/watched_lines.h"
#include "port/pin_ring.h"
#include "pulse/command.h"
#include "pulse/snapshot.h"
#include "timeline/compare_follower.h"
#include "timeline/mark_follower.h"

namespace stepdriver::pulse {

/// The pulse thread's part of an output with a name: it writes the marks of a path, or what the
/// position of an axis makes it do, at their times. While a path or an axis has the output, nothing
/// else writes it, except to its safe state.
class EngineOutput {
 public:
  /// @param lines, clock outlive it.
  EngineOutput(const OutputLine& line, WatchedLines& lines, Clock& clock)
      : line_(line), lines_(lines), clock_(clock) {}

  bool mayFollow(const FollowMarks& order) const {
    return !marks_.follows() ||
           (order.group == state_.group && marks_.hasRoom(order.along->startNs()));
  }
  void follow(const FollowMarks& order);
  /// No mark is left: what wasn't made is given up. @return whether a path had the output
  bool end();
  /// An axis has the output, which first gets the state that belongs to its place.
  /// @pre The axis is at rest. @param joint [microsteps] where it rests
  void compare(const Compare& order, double joint);
  /// No axis has it any more.
  void endCompare();
  /// It isn't written until the next order: an emergency stop has come. @return whether it was
  bool mute();
  /// The channel of the axis that has it; negative: none has.
  int channel() const { return channel_; }
  bool hasRoom(Nanoseconds start) const { return !compare_.follows() || compare_.hasRoom(start); }
  void followAxis(const Successors::Entry& entry, double joint) { compare_.follow(entry, joint); }
  /// The axis has come to rest. @param reached it was a target
  void axisEnded(Nanoseconds motion_now, double joint, bool reached);
  /// An order was handled.
  void taken(std::uint64_t serial);
  std::uint64_t group() const { return state_.group; }

  /// Clock time at which serve() has something to do.
  Nanoseconds due(Nanoseconds slipped) const;
  /// Does what is due. @param ring may be nullptr. @return whether the controller must be told
  bool serve(Nanoseconds now, Nanoseconds slipped, PinRing* ring);

  OutputLineState state() const { return published_.load(); }

 private:
  Nanoseconds markDue(Nanoseconds slipped) const;
  Nanoseconds tooLongAt() const;
  Nanoseconds compareDue(Nanoseconds slipped) const;
  bool serveMark(Nanoseconds now, Nanoseconds slipped, PinRing* ring);
  bool serveCompare(Nanoseconds now, Nanoseconds slipped, PinRing* ring);
  void act(CompareAction action, Nanoseconds now, PinRing* ring);
  void adopt(std::uint64_t changes, const WrittenOutput& written);
  Nanoseconds mayChange() const {
    const WrittenOutput& last = state_.written;
    return last.switched + (last.setting.on ? line_.min_on : line_.min_off);
  }
  bool endLateWrites(Nanoseconds now);
  void fail(int error);
  bool isWritten() const { return channel_ >= 0 && !state_.muted; }
  bool write(const OutputSetting& setting, Nanoseconds now, PinRing* ring);
  void publish();

  const OutputLine line_;
  WatchedLines& lines_;
  Clock& clock_;
  MarkFollower marks_;
  CompareFollower compare_;
  int channel_ = -1;           // of the axis that compare_ follows
  std::optional<bool> rests_;  // the state that it gets as soon as its least times allow
  Nanoseconds pulse_ends_ = kNever;
  bool reached_ = false;  // a motion has come to its end
  // Writes that have not ended for certain, and what counted as made before the first of them.
  struct Late {
    std::uint64_t first = 0;  // its number
    std::uint64_t ended = 0;
    Nanoseconds look_at = 0;
    Nanoseconds looks = 0;  // since a write has ended: a process that was suspended looks once
    std::uint64_t group = 0;
    std::uint64_t made = 0;
    std::uint64_t compared = 0;
  };
  std::optional<Late> late_;
  OutputLineState state_;
  Nanoseconds tell_at_ = 0;  // The controller isn't told again before this clock time.
  bool untold_ = false;
  Snapshot<OutputLineState> published_;
};

}  // namespace stepdriver::pulse
