#pragma once

#include <cmath>
#include <cstdint>

namespace stepdriver::motion {

/// The unevaluated sum of two doubles: about 106 bits of mantissa.
///
/// A move may be 2^40 steps long and last for years, and yet the time of each step must be exact to
/// the nanosecond: that takes more than a double's 53 bits. Algorithms: error-free sum and product
/// after Knuth and Dekker (T. J. Dekker, A floating-point technique for extending the available
/// precision, 1971).
struct DoubleDouble {
  double hi = 0.0;
  double lo = 0.0;

  constexpr DoubleDouble() = default;
  constexpr DoubleDouble(double value) : hi(value) {}  // NOLINT: a double is one of these
  constexpr DoubleDouble(double high, double low) : hi(high), lo(low) {}

  /// The nearest double.
  double value() const { return hi + lo; }
};

/// The sum of two doubles.
inline DoubleDouble exactSum(double a, double b) {
  const double sum = a + b;
  const double part = sum - a;
  return {sum, (a - (sum - part)) + (b - part)};
}

/// The product of two doubles, if it is neither below 1e-290 nor above 1e290.
inline DoubleDouble exactProduct(double a, double b) {
#ifdef FP_FAST_FMA
  const double product = a * b;
  return {product, std::fma(a, b, -product)};
#else
  // Each factor is split into two of 26 bits: a call of fma() takes longer than that.
  constexpr double kSplitter = 134217729.0;  // 2^27 + 1
  const double product = a * b;
  const double a_scaled = kSplitter * a;
  const double b_scaled = kSplitter * b;
  const double a_high = a_scaled - (a_scaled - a);
  const double b_high = b_scaled - (b_scaled - b);
  const double a_low = a - a_high;
  const double b_low = b - b_high;
  const double rest = ((a_high * b_high - product) + a_high * b_low + a_low * b_high);
  return {product, rest + a_low * b_low};
#endif
}

/// The sum of two doubles. @pre |a| >= |b|
inline DoubleDouble normalized(double a, double b) {
  const double sum = a + b;
  return {sum, b - (sum - a)};
}

/// It is exact for every integer of 64 bits.
DoubleDouble fromInteger(std::int64_t value);

inline DoubleDouble operator+(DoubleDouble a, DoubleDouble b) {
  DoubleDouble sum = exactSum(a.hi, b.hi);
  const DoubleDouble low = exactSum(a.lo, b.lo);
  sum = normalized(sum.hi, sum.lo + low.hi);
  return normalized(sum.hi, sum.lo + low.lo);
}

inline DoubleDouble operator+(DoubleDouble a, double b) {
  const DoubleDouble sum = exactSum(a.hi, b);
  return normalized(sum.hi, sum.lo + a.lo);
}

inline DoubleDouble operator-(DoubleDouble a) { return {-a.hi, -a.lo}; }

inline DoubleDouble operator-(DoubleDouble a, DoubleDouble b) { return a + (-b); }

inline DoubleDouble operator-(DoubleDouble a, double b) { return a + (-b); }

inline DoubleDouble operator*(DoubleDouble a, DoubleDouble b) {
  const DoubleDouble product = exactProduct(a.hi, b.hi);
  return normalized(product.hi, product.lo + (a.hi * b.lo + a.lo * b.hi));
}

inline DoubleDouble operator*(DoubleDouble a, double b) {
  const DoubleDouble product = exactProduct(a.hi, b);
  return normalized(product.hi, product.lo + a.lo * b);
}

/// The relative error is below 2^-102.
inline DoubleDouble operator/(DoubleDouble a, DoubleDouble b) {
  const double quotient = a.hi / b.hi;
  const DoubleDouble product = b * quotient;
  const double rest = (a.hi - product.hi) + (a.lo - product.lo);
  return normalized(quotient, rest / b.hi);
}

/// The relative error is below 2^-104.
inline DoubleDouble operator/(DoubleDouble a, double b) {
  const double quotient = a.hi / b;
  const DoubleDouble product = exactProduct(quotient, b);
  const double rest = ((a.hi - product.hi) - product.lo) + a.lo;
  return normalized(quotient, rest / b);
}

inline bool operator<(DoubleDouble a, DoubleDouble b) {
  return a.hi < b.hi || (a.hi == b.hi && a.lo < b.lo);
}

inline DoubleDouble abs(DoubleDouble a) { return a.hi < 0.0 ? -a : a; }

/// The root of a negative number is 0.
inline DoubleDouble sqrt(DoubleDouble a) {
  if (!(a.hi > 0.0)) return 0.0;
  // Takes one step of Newton's method from the double that is nearest to the root.
  const double root = std::sqrt(a.hi);
  const DoubleDouble square = exactProduct(root, root);
  return normalized(root, (((a.hi - square.hi) - square.lo) + a.lo) / (2.0 * root));
}

inline DoubleDouble half(DoubleDouble a) { return {0.5 * a.hi, 0.5 * a.lo}; }

/// @name The same functions for doubles, so that templates work with either type
/// @{
inline double abs(double a) { return std::abs(a); }
inline double sqrt(double a) { return a > 0.0 ? std::sqrt(a) : 0.0; }
inline double half(double a) { return 0.5 * a; }
inline double highOf(double a) { return a; }
inline double highOf(DoubleDouble a) { return a.hi; }
template <typename Real>
Real numberOf(DoubleDouble a);
template <>
inline double numberOf<double>(DoubleDouble a) {
  return a.hi;
}
template <>
inline DoubleDouble numberOf<DoubleDouble>(DoubleDouble a) {
  return a;
}
/// @}

/// 1/3 to the precision of the type.
template <typename Real>
constexpr Real third() {
  return Real(1.0 / 3.0);
}
template <>
constexpr DoubleDouble third<DoubleDouble>() {
  return {0x1.5555555555555p-2, 0x1.5555555555555p-56};
}

/// A number as the nearest integer and the remainder, which is at most a half.
struct Split {
  std::int64_t whole = 0;
  double rest = 0.0;
};

/// @pre |value| < 2^62
Split split(DoubleDouble value);

/// Nanoseconds in seconds.
DoubleDouble secondsOf(std::int64_t nanoseconds);

/// Seconds as whole nanoseconds and the remaining fraction.
Split splitNanoseconds(DoubleDouble seconds);

}  // namespace stepdriver::motion
