#pragma once

#include <cstdint>
#include <limits>

namespace stepdriver::pulse {

/// Nanoseconds on a Clock. Its zero means nothing; the steady clock's is CLOCK_MONOTONIC's.
using Nanoseconds = std::int64_t;

constexpr Nanoseconds kNever = std::numeric_limits<Nanoseconds>::max();

}  // namespace stepdriver::pulse
