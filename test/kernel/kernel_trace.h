#pragma once

#include <cstdint>
#include <iosfwd>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/sim/pin_trace.h"

namespace stepdriver::kernel {

/// What the kernel did to a line, or read from it: one event gpio_value.
struct LineEvent {
  std::int64_t time_ns;  ///< CLOCK_MONOTONIC, just before the chip's own driver is called
  unsigned line;         ///< base of its chip plus the offset
  bool level;            ///< physical, also where the line is requested as active low
  bool read;             ///< an input was read; else an output was written
};

/// An output that is written the level that it has isn't in here.
struct LineEdge {
  std::int64_t time_ns;
  bool level;
};

/// The GPIO events of the kernel's text trace, as gpio_trace.sh writes it, with its nanoseconds, or
/// as the file `trace` itself is, in microseconds.
class KernelTrace {
 public:
  /// @param name of the source, for messages.
  /// @throw Error for a line that can't be read, for times that go back (another clock than
  ///   `mono`), and if the kernel says that it dropped events.
  explicit KernelTrace(std::istream& text, const std::string& name = "the trace");

  /// @throw Error as above, and if the file can't be read.
  static KernelTrace fromFile(const std::string& path);

  const std::vector<LineEvent>& events() const { return events_; }

  /// @param name a number, or chip:offset with the label of a chip.
  /// @throw Error if it is neither, or there is no such chip or line.
  unsigned line(const std::string& name) const;

  /// @return the level in the line's first event: for an output the one that it was requested with.
  ///   None if the line has no event.
  std::optional<bool> firstLevel(unsigned line) const;

  /// Changes of the line's level; its first event isn't one.
  std::vector<LineEdge> edges(unsigned line) const;

  /// Times at which the line took this level.
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

/// A pin and the line that it is on.
struct TracedPin {
  sim::TracePin pin;
  unsigned line;
};

/// Hands the edges of these lines to another trace: sim::VcdTrace writes them to a file,
/// sim::MemoryTrace keeps them for a test. It begins with the first event of any of the lines; a
/// line that has none until later has the level of its first event until then.
/// @throw Error for a line without any event: it is a wrong number, or nothing drove it.
void copyTo(sim::PinTrace& trace, const KernelTrace& from, const std::vector<TracedPin>& pins);

}  // namespace stepdriver::kernel
