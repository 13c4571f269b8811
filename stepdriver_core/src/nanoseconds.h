#pragma once

#include <cmath>
#include <cstdint>

namespace stepdriver {

/// Seconds as the nearest whole nanoseconds.
inline std::int64_t nanoseconds(double seconds) { return std::llround(seconds * 1e9); }

}  // namespace stepdriver
