#pragma once

#include <cstdint>
#include <fstream>
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
/// up to the last edge after flush() and after destruction.
class VcdTrace : public PinTrace {
 public:
  /// @throw Error if the file can't be written; an existing one is replaced.
  explicit VcdTrace(const std::string& path);
  ~VcdTrace() override;

  void begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
             std::int64_t time_ns) override;
  void edge(int pin, bool level, std::int64_t time_ns) override;

  /// @throw Error if the file couldn't be written, now or earlier.
  void flush() override;

 private:
  void stamp(std::int64_t time_ns);
  void writeOut();

  const std::string path_;
  std::ofstream file_;
  std::string buffer_;
  std::vector<std::string> ids_;
  bool begun_ = false;
  std::int64_t start_ns_ = 0;
  std::int64_t last_ns_ = 0;
};

}  // namespace stepdriver::sim
