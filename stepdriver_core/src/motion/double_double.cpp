#include "motion/double_double.h"

#include <cmath>

namespace stepdriver::motion {
namespace {

DoubleDouble exactSum(double a, double b) {
  const double sum = a + b;
  const double part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

DoubleDouble exactProduct(double a, double b) {
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
}

// Needs |a| >= |b|.
DoubleDouble normalized(double a, double b) {
  const double sum = a + b;
  return {sum, b - (sum - a)};
}

}  // namespace

DoubleDouble fromInteger(std::int64_t value) {
  const double hi = static_cast<double>(value >> 32) * 4294967296.0;
  const double lo = static_cast<double>(value & 0xffffffff);
  return exactSum(hi, lo);
}

DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  DoubleDouble sum = exactSum(a.hi, b.hi);
  const DoubleDouble low = exactSum(a.lo, b.lo);
  sum = normalized(sum.hi, sum.lo + low.hi);
  return normalized(sum.hi, sum.lo + low.lo);
}

DoubleDouble operator-(DoubleDouble a) { return {-a.hi, -a.lo}; }

DoubleDouble operator-(DoubleDouble a, DoubleDouble b) { return a + (-b); }

DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble product = exactProduct(a.hi, b.hi);
  return normalized(product.hi, product.lo + (a.hi * b.lo + a.lo * b.hi));
}

DoubleDouble operator/(DoubleDouble a, DoubleDouble b) {
  const double first = a.hi / b.hi;
  DoubleDouble rest = a - b * DoubleDouble(first);
  const double second = rest.hi / b.hi;
  rest = rest - b * DoubleDouble(second);
  return normalized(first, second) + DoubleDouble(rest.hi / b.hi);
}

bool operator<(DoubleDouble a, DoubleDouble b) {
  return a.hi < b.hi || (a.hi == b.hi && a.lo < b.lo);
}

DoubleDouble abs(DoubleDouble a) { return a.hi < 0.0 ? -a : a; }

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
