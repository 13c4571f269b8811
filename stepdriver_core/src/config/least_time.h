#pragma once

#include <cstdint>

#include "stepdriver_core/config/io_config.h"

namespace stepdriver::config {

/// How long an output stays on, or off, at least: a PWM output for a period, because the kernel may
/// finish a pulse that has begun.
struct LeastTime {
  std::int64_t ns = 0;
  const char* name = "";  ///< as refusals call it: "min_on_ms", "min_off_ms", "the PWM period"
};

LeastTime leastTime(const OutputConfig& output, bool on);

}  // namespace stepdriver::config
