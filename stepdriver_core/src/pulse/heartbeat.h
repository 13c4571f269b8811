#pragma once

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// An output whose level changes at a fixed rate while the engine is served.
struct HeartbeatLine {
  int output = -1;
  Nanoseconds interval = 0;  ///< the time between two edges
};

/// When the next edge of a heartbeat is due, and its level. For the pulse thread.
class Heartbeat {
 public:
  /// @param line It is low. @param now The clock time of the first edge.
  Heartbeat(const HeartbeatLine& line, Nanoseconds now) : line_(line), due_(now) {}

  Nanoseconds due() const { return due_; }
  gpio::LineWrite next() const { return {line_.output, level_}; }

  /// The edge was written, or that failed. Edges that were missed aren't made up.
  ///
  /// @return true if it is the first failure, or the first one after a success.
  bool done(bool written, Nanoseconds now) {
    if (written) level_ = !level_;
    due_ = due_ + line_.interval > now ? due_ + line_.interval : now + line_.interval;
    const bool first = !written && !failing_;
    failing_ = !written;
    return first;
  }

 private:
  const HeartbeatLine line_;
  Nanoseconds due_;
  bool level_ = true;  // the level after the next edge
  bool failing_ = false;
};

}  // namespace stepdriver::pulse
