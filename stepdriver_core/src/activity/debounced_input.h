#pragma once

#include <cstdint>
#include <optional>

#include "context.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::activity {

/// The level of an input after bouncing. Edges say when something has changed, and only the level
/// that was read says to what: a lost edge costs no more than the exact time.
class DebouncedInput {
 public:
  /// @param line its index in the request. @param debounce a level must stay for so long to count.
  DebouncedInput(int line, bool active_level, pulse::Nanoseconds debounce)
      : line_(line), active_level_(active_level), debounce_(debounce) {}

  /// The level is known from now on.
  void begin(const Context& context);
  /// Something may have happened.
  /// @return whether active() has changed.
  bool poll(const Context& context);

  bool active() const { return active_; }
  /// Clock time at which it began to change last: of the first edge, or of the reading if no edge
  /// was reported. Empty: it has not changed since begin().
  std::optional<pulse::Nanoseconds> changed() const { return changed_; }
  /// No edge was reported of that change: it was read later, by up to the time between two
  /// readings.
  bool changeWasRead() const { return change_was_read_; }
  /// errno of its last reading; 0: it could be read.
  int error() const { return level_ && *level_ < 0 ? -*level_ : 0; }
  int line() const { return line_; }
  bool activeLevel() const { return active_level_; }
  pulse::Nanoseconds debounce() const { return debounce_; }
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const;
  /// Since when it has not stayed at one level; empty: it stays.
  std::optional<pulse::Nanoseconds> bouncesSince() const { return left_; }

 private:
  void noteChange(const Context& context, bool has_changed);

  int line_;
  bool active_level_;
  pulse::Nanoseconds debounce_;
  std::optional<int> level_;                // as read last; empty: before begin()
  pulse::Nanoseconds level_since_ = 0;      // when that was read first
  std::optional<pulse::Nanoseconds> left_;  // when its level began to change
  pulse::Nanoseconds stable_since_ = 0;     // when the level before that was read first
  pulse::Nanoseconds quiet_since_ = 0;      // the latest change of its level after that
  pulse::Nanoseconds polled_at_ = 0;
  bool active_ = false;
  bool left_was_read_ = false;  // no edge tells of left_
  std::optional<pulse::Nanoseconds> changed_;
  bool change_was_read_ = false;
};

}  // namespace stepdriver::activity
