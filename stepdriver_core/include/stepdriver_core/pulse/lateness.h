#pragma once

#include <cstdint>

#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// How late pulses were: half of them by at most p50, and so on. The percentiles are rounded up, by
/// at most a sixteenth.
struct LatenessFigures {
  std::uint64_t count = 0;  ///< of the pulses
  Nanoseconds p50 = 0;      ///< the median
  Nanoseconds p99 = 0;
  Nanoseconds p999 = 0;
  Nanoseconds max = 0;  ///< exact
};

}  // namespace stepdriver::pulse
