#pragma once

#include <cmath>
#include <cstdint>

namespace stepdriver::motion {

/// [microsteps] Where a motor comes to rest whose position was commanded: on the nearest whole
/// microstep, halves away from 0. Whatever becomes a count is rounded here, and once: two roundings
/// of one position may differ in its half.
inline std::int64_t restingCount(double position) { return std::llround(position); }

}  // namespace stepdriver::motion
