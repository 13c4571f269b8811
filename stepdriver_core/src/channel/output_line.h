#pragma once

#include <cstdint>

#include "output_setting.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// An output with a name that paths may switch.
struct OutputLine {
  int output = -1;     ///< by its index in the gpio::Lines
  bool active = true;  ///< its level while it is on
  Nanoseconds min_on = 0;
  Nanoseconds min_off = 0;
  Nanoseconds max_on = kNever;
  Nanoseconds write_timeout = kNever;  ///< a late write that takes longer counts as failed
};

/// What the writes of an output have made of it. All times are clock times.
struct WrittenOutput {
  OutputSetting setting;
  Nanoseconds changed = 0;   ///< when the last write that changed something had ended
  Nanoseconds switched = 0;  ///< the same of the last one that switched it on or off
  Nanoseconds on_since = 0;  ///< when the last write that switched it on began
};

/// The state of such an output, as far as paths switch it.
struct OutputLineState {
  std::uint64_t taken = 0;       ///< serial of the last command that was handled
  std::uint64_t reads = 0;       ///< the oldest order whose data are still read; 0: none
  std::uint64_t group = 0;       ///< Follow::group of the path that switches it; 0: none does
  std::uint64_t made = 0;        ///< marks of that path that were made
  std::uint64_t ended = 0;       ///< the group of the last path that has ended
  std::uint64_t ended_made = 0;  ///< marks of that one that were made
  std::uint64_t changes = 0;     ///< how often a path has switched it
  WrittenOutput written;         ///< by the last of them
  /// A mark is still to come in the motion as it is ordered, or a write is still to end.
  bool due = false;
  bool too_long = false;  ///< the last of them was by OutputLine::max_on
  /// @name What the position of an axis switches
  /// @{
  std::uint64_t compare = 0;   ///< serial of the order for it that is kept; 0: none
  bool muted = false;          ///< an emergency stop or a failure has come since: it only counts
  std::uint64_t compared = 0;  ///< actions that were made since the start
  std::uint64_t missed = 0;    ///< those whose place was passed, but which could not be made
  /// @}
  std::uint64_t failures = 0;  ///< how often a write has failed, which ends the part of a motion
  int error = 0;               ///< errno of the last of them
};

}  // namespace stepdriver::pulse
