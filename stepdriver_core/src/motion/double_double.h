#pragma once

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

  /// Rounded to a double.
  double value() const { return hi + lo; }
};

/// Exact for every integer of 64 bits.
DoubleDouble fromInteger(std::int64_t value);

DoubleDouble operator+(DoubleDouble a, DoubleDouble b);
DoubleDouble operator-(DoubleDouble a, DoubleDouble b);
DoubleDouble operator*(DoubleDouble a, DoubleDouble b);
DoubleDouble operator/(DoubleDouble a, DoubleDouble b);
DoubleDouble operator-(DoubleDouble a);
bool operator<(DoubleDouble a, DoubleDouble b);
DoubleDouble abs(DoubleDouble a);
/// @pre a >= 0
DoubleDouble sqrt(DoubleDouble a);

/// A number as the nearest integer and the remainder, at most a half.
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
