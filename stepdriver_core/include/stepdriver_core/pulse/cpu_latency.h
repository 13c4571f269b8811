#pragma once

#include <string>

namespace stepdriver::pulse {

/// Keeps all processors out of idle states that take time to wake from, for as long as it lives: it
/// holds the kernel's device for that open, with a latency of 0. It costs power.
class CpuLatencyHold {
 public:
  static constexpr const char* kDevice = "/dev/cpu_dma_latency";

  explicit CpuLatencyHold(const std::string& device = kDevice);
  ~CpuLatencyHold();
  CpuLatencyHold(const CpuLatencyHold&) = delete;
  CpuLatencyHold& operator=(const CpuLatencyHold&) = delete;

  /// @return 0 where it is held, or the errno of the refusal.
  int error() const { return error_; }

 private:
  int file_ = -1;
  int error_ = 0;
};

}  // namespace stepdriver::pulse
