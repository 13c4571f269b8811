#pragma once

namespace stepdriver::motion {

/// [s] A millionth of a nanosecond: a part of a motion that isn't longer is only rounding.
constexpr double kNegligibleTime = 1e-15;

}  // namespace stepdriver::motion
