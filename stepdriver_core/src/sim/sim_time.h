#pragma once

#include <cstdint>
#include <limits>

namespace stepdriver::sim {

/// Earlier than any time of a clock, and far enough from the end of the range for differences.
constexpr std::int64_t kForEver = std::numeric_limits<std::int64_t>::min() / 2;
constexpr std::int64_t kNever = std::numeric_limits<std::int64_t>::max();

}  // namespace stepdriver::sim
