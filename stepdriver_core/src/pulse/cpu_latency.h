#pragma once

#include <string>

#include "stepdriver_core/pulse/capability.h"

namespace stepdriver::pulse {

/// Keeps kCpuLatencyDevice open, with a latency of 0, during its lifetime.
class CpuLatencyHold {
 public:
  explicit CpuLatencyHold(const std::string& device = kCpuLatencyDevice);
  ~CpuLatencyHold();
  CpuLatencyHold(const CpuLatencyHold&) = delete;
  CpuLatencyHold& operator=(const CpuLatencyHold&) = delete;

  /// @return 0 if it is open, or the errno of the refusal.
  int error() const { return error_; }

 private:
  int file_ = -1;
  int error_ = 0;
};

}  // namespace stepdriver::pulse
