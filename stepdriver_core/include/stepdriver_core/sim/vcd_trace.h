#pragma once

#include <cstdint>
#include <fstream>
#include <string>
#include <vector>

#include "stepdriver_core/sim/pin_trace.h"

namespace stepdriver::sim {

/// Writes the edges to a VCD file (IEEE 1364-2005, clause 18; timescale 1 ns, time 0 at begin()),
/// which GTKWave, PulseView and sigrok-cli open. A last time stamp closes the file.
class VcdTrace : public PinTrace {
 public:
  /// @throw Error where the file can't be written; an existing one is replaced.
  explicit VcdTrace(const std::string& path);
  ~VcdTrace() override;

  void begin(const std::vector<TracePin>& pins, const std::vector<bool>& levels,
             std::int64_t time_ns) override;
  void edge(int pin, bool level, std::int64_t time_ns) override;

 private:
  std::ofstream file_;
  std::int64_t start_ns_ = 0;
  std::int64_t last_ns_ = 0;
};

}  // namespace stepdriver::sim
