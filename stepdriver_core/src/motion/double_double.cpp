#include "motion/double_double.h"

#include <cmath>

namespace stepdriver::motion {
DoubleDouble fromInteger(std::int64_t value) {
  const double hi = static_cast<double>(value >> 32) * 4294967296.0;
  const double lo = static_cast<double>(value & 0xffffffff);
  return exactSum(hi, lo);
}

DoubleDouble operator/(DoubleDouble a, DoubleDouble b) {
  // a - b * part
  const auto without = [&b](DoubleDouble from, double part) {
    const DoubleDouble product = exactProduct(b.hi, part);
    return from - normalized(product.hi, product.lo + b.lo * part);
  };
  const double first = a.hi / b.hi;
  DoubleDouble rest = without(a, first);
  const double second = rest.hi / b.hi;
  rest = without(rest, second);
  return normalized(first, second) + DoubleDouble(rest.hi / b.hi);
}

DoubleDouble sqrt(DoubleDouble a) {
  if (!(a.hi > 0.0)) return 0.0;
  // One of Newton's steps from the double nearest to the root.
  const double root = std::sqrt(a.hi);
  const DoubleDouble rest = a - exactProduct(root, root);
  return normalized(root, rest.hi / (2.0 * root));
}

Split split(DoubleDouble value) {
  const auto high = static_cast<std::int64_t>(std::nearbyint(value.hi));
  const double rest = (value.hi - static_cast<double>(high)) + value.lo;
  const double carry = std::nearbyint(rest);
  // The remainder of value.hi without its integer is exact, so lo is not lost in it.
  return {high + static_cast<std::int64_t>(carry),
          ((value.hi - static_cast<double>(high)) - carry) + value.lo};
}

DoubleDouble secondsOf(std::int64_t nanoseconds) {
  return fromInteger(nanoseconds) / DoubleDouble(1e9);
}

Split splitNanoseconds(DoubleDouble seconds) { return split(seconds * DoubleDouble(1e9)); }

}  // namespace stepdriver::motion
