#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "stepdriver_core/sim/pin_trace.h"

namespace stepdriver::sim {

/// Writes the edges to a VCD file (IEEE 1364-2005, clause 18; timescale 1 ns, time 0 at begin()),
/// which GTKWave, PulseView and sigrok-cli open. A last time stamp, 1 us after the last edge,
/// closes the file: without it viewers don't show the last levels.
///
/// Each axis is a scope, and its pins have the names of TracePin. sigrok up to 0.5 drops the
/// scopes: with several axes it shows pins of the same name.
///
/// The same edges make the same file: it contains no date. Edges are buffered; the file is complete
/// up to the last edge after flush() and after destruction. If a write fails, the trace ends with
/// the last one that succeeded.
class VcdTrace : public PinTrace {
 public:
  /// Which existing files the trace may replace.
  enum class Replaces {
    kTraces,  ///< those that begin as a trace does, and empty ones
    kAnyFile,
    kNoFile,  ///< none: the file is new, follows no link, and only its owner can read it
  };

  /// @throw Error if the file can't be written, or may not be replaced.
  explicit VcdTrace(std::string path, Replaces replaces = Replaces::kTraces);
  ~VcdTrace() override;
  VcdTrace(const VcdTrace&) = delete;
  VcdTrace& operator=(const VcdTrace&) = delete;

  void begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
             std::int64_t time_ns) override;
  void edge(int pin, bool level, std::int64_t time_ns) override;

  /// As a comment.
  void summary(const std::string& text) override;
  /// @throw Error, which names the reason, if the file couldn't be written, now or earlier.
  void flush() override;

  /// Closes the trace with this time instead of 1 us after the last edge. No edge may follow.
  /// @throw Error as flush().
  void end(std::int64_t time_ns);

 private:
  void stamp(std::int64_t time_ns);
  void writeOut();

  const std::string path_;
  const int file_;
  std::size_t written_ = 0;  // bytes of the file
  std::string error_;        // why it is incomplete
  std::string buffer_;
  std::vector<std::string> ids_;
  bool begun_ = false;
  std::int64_t start_ns_ = 0;
  std::int64_t last_ns_ = 0;
};

}  // namespace stepdriver::sim
