#pragma once

#include <cstdint>

#include "channel/output_line.h"
#include "channel/watched_lines.h"
#include "port/pin_ring.h"
#include "pulse/command.h"
#include "pulse/snapshot.h"
#include "timeline/mark_follower.h"

namespace stepdriver::pulse {

/// The pulse thread's part of an output with a name: it writes the marks of a path at their times.
/// While a path has the output, nothing else writes it, except to its safe state.
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
  bool write(bool on, Nanoseconds now, PinRing* ring);
  void publish();

  const OutputLine line_;
  WatchedLines& lines_;
  Clock& clock_;
  MarkFollower marks_;
  OutputLineState state_;
  Nanoseconds tell_at_ = 0;  // The controller isn't told again before this clock time.
  bool untold_ = false;
  Snapshot<OutputLineState> published_;
};

}  // namespace stepdriver::pulse
