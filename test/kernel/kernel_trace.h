#pragma once

#include <cstdint>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/sim/pin_trace.h"

namespace stepdriver::kernel {

/// One event gpio_value: the kernel set a line, or read it.
struct LineEvent {
  std::int64_t time_ns;  ///< CLOCK_MONOTONIC, just before the call of the chip's driver
  unsigned line;         ///< base of its chip plus the offset
  bool level;            ///< physical, even if the line was requested as active low
  bool read;             ///< true: an input was read; false: an output was written
};

/// Writes that don't change the level of an output aren't in the trace.
struct LineEdge {
  std::int64_t time_ns;
  bool level;
};

/// The GPIO events of the kernel's text trace: in nanoseconds, as gpio_trace.sh writes it, or in
/// microseconds, as in the file `trace`.
class KernelTrace {
 public:
  /// @param name of the source, for messages.
  /// @throw Error if a line can't be read, if the times decrease (another clock than `mono`), or if
  ///   the kernel says that it dropped events.
  explicit KernelTrace(std::istream& text, const std::string& name = "the trace");

  /// @throw Error as above, and if the file can't be read.
  static KernelTrace fromFile(const std::string& path);

  const std::vector<LineEvent>& events() const { return events_; }

  /// @param name a number, or chip:offset with the label of a chip.
  /// @throw Error if it is neither, or if the chip or line doesn't exist.
  unsigned line(const std::string& name) const;

  /// @return the level in the line's first event, which for an output is its initial level; no
  ///   value if the line has no event.
  std::optional<bool> firstLevel(unsigned line) const;

  /// Changes of the line's level. Its first event doesn't count as a change.
  std::vector<LineEdge> edges(unsigned line) const;

  /// Times at which the line changed to this level.
  std::vector<std::int64_t> times(unsigned line, bool level) const;

 private:
  struct Chip {
    unsigned base;
    unsigned lines;
  };

  void readChip(const std::string& text);
  void readEvent(const std::string& text);

  std::map<std::string, Chip> chips_;
  std::vector<LineEvent> events_;
};

/// A pin and its line.
struct TracedPin {
  sim::TracePin pin;
  unsigned line;
};

/// Passes the edges of these lines to another trace: sim::VcdTrace writes them to a file,
/// sim::MemoryTrace keeps them for a test. It begins with the first event of any of the lines;
/// until a line's first event, it has the level of that event.
/// @throw Error if a line has no event: its number is wrong, or nothing drove it.
void copyTo(sim::PinTrace& trace, const KernelTrace& from, const std::vector<TracedPin>& pins);

}  // namespace stepdriver::kernel
