#include "pulse/cpu_latency.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdint>

namespace stepdriver::pulse {

CpuLatencyHold::CpuLatencyHold(const std::string& device)
    : file_(open(device.c_str(), O_WRONLY | O_CLOEXEC)) {
  if (file_ < 0) {
    error_ = errno;
    return;
  }
  const std::int32_t microseconds = 0;
  const ssize_t written = write(file_, &microseconds, sizeof microseconds);
  if (written != sizeof microseconds) error_ = written < 0 ? errno : EIO;
}

CpuLatencyHold::~CpuLatencyHold() {
  if (file_ >= 0) close(file_);
}

}  // namespace stepdriver::pulse
