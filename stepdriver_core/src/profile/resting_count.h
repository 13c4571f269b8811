#pragma once

#include <cmath>
#include <cstdint>

namespace stepdriver::motion {

/// The count on which a motor comes to rest if its position [microsteps] was commanded: the nearest
/// whole microstep, with halves rounded away from 0. Whatever becomes a count is rounded here, and
/// once: two roundings of one position may differ in its half.
inline std::int64_t restingCount(double position) { return std::llround(position); }

}  // namespace stepdriver::motion
