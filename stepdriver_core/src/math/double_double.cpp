#include "double_double.h"

#include <cmath>

namespace stepdriver::motion {
DoubleDouble fromInteger(std::int64_t value) {
  const double hi = static_cast<double>(value >> 32) * 4294967296.0;
  const double lo = static_cast<double>(value & 0xffffffff);
  return exactSum(hi, lo);
}

Split split(DoubleDouble value) {
  const auto high = static_cast<std::int64_t>(std::nearbyint(value.hi));
  const double rest = (value.hi - static_cast<double>(high)) + value.lo;
  const double carry = std::nearbyint(rest);
  // The difference between value.hi and its integer is exact, so lo is not lost in it.
  return {high + static_cast<std::int64_t>(carry),
          ((value.hi - static_cast<double>(high)) - carry) + value.lo};
}

DoubleDouble secondsOf(std::int64_t nanoseconds) { return fromInteger(nanoseconds) / 1e9; }

Split splitNanoseconds(DoubleDouble seconds) { return split(seconds * 1e9); }

}  // namespace stepdriver::motion
