#pragma once

#include <optional>
#include <vector>

#include "activity/context.h"
#include "activity/debounced_input.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::activity {

/// The edges of an input, one after the other. With a debounce time an edge counts if the level
/// stays, and its time is that of the first contact; without one, each edge that is reported
/// counts, however short the pulse.
class InputEdges {
 public:
  /// The kernel reports an edge within this time after another level is read, or it is lost.
  static constexpr pulse::Nanoseconds kLongestReport = 5'000'000;

  struct Edge {
    bool active = false;
    pulse::Nanoseconds time = 0;  ///< clock time
    /// The kernel has reported no such edge: the time is that of the reading that shows it.
    bool was_read = false;
  };

  InputEdges(int line, bool active_level, pulse::Nanoseconds debounce)
      : input_(line, active_level, debounce), active_level_(active_level) {}

  /// Edges count from now on.
  void begin(const Context& context);
  /// @return the edges since the last call.
  std::vector<Edge> poll(const Context& context);
  /// The level now, after bouncing.
  bool active() const { return input_.active(); }
  int error() const { return input_.error(); }
  int line() const { return input_.line(); }
  /// Since when the level differs from that of the last edge, clock time; empty: it doesn't.
  std::optional<pulse::Nanoseconds> changingSince() const {
    return differs_ ? differs_ : input_.bouncesSince();
  }
  /// Clock time by which poll() must be called.
  pulse::Nanoseconds due() const { return input_.due(); }
  /// Clock time until which all reported edges must be known, to tell whether one was lost;
  /// pulse::kNever: no edge is missing.
  pulse::Nanoseconds edgesDue() const {
    return differs_ ? *differs_ + kLongestReport : pulse::kNever;
  }

 private:
  void add(bool level, pulse::Nanoseconds time, bool was_read, std::vector<Edge>& edges);

  DebouncedInput input_;
  bool active_level_;
  bool level_ = false;            // after the last edge
  pulse::Nanoseconds since_ = 0;  // the last edge, or begin()
  // Without a debounce time: since when another level is read, of which no edge was reported.
  std::optional<pulse::Nanoseconds> differs_;
};

}  // namespace stepdriver::activity
