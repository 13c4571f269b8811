#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "double_double.h"

namespace stepdriver::motion {

/// @file Finds the roots of continuous functions that fall from above 0 at 0 to 0 or less at
///   `high`.
///
/// Newton's method is used if the slope is known, otherwise Ridders' (C. J. F. Ridders, A new
/// algorithm for computing a single root of a real continuous function, 1979). Neither leaves its
/// bracket. Secants in double-double then add the remaining bits.

/// An interval that contains such a root.
struct Bracket {
  double low = 0.0;
  double high = 0.0;
  double f_low = 0.0;   ///< above 0
  double f_high = 0.0;  ///< 0 or less

  void narrow(double t, double f_t) {
    if (!(t > low && t < high)) return;
    (f_t > 0.0 ? low : high) = t;
    (f_t > 0.0 ? f_low : f_high) = f_t;
  }
};

/// A bracket whose ends have the root's order of magnitude, so that bisection reaches all bits.
///
/// @param f a function of a double that returns a double
template <typename Function>
Bracket bracketOf(const Function& f, double high) {
  Bracket bracket{0.0, high, 0.0, f(high)};
  for (double t = high / 16.0; t > 1e-300; t /= 16.0) {
    const double f_t = f(t);
    (f_t > 0.0 ? bracket.low : bracket.high) = t;
    (f_t > 0.0 ? bracket.f_low : bracket.f_high) = f_t;
    if (f_t > 0.0) break;
  }
  return bracket;
}

/// @param f a function of a double that returns a double
/// @param noise the rounding error of f: values this near to 0 are as good as 0
template <typename Function>
double roughRootOf(const Function& f, Bracket bracket, double noise) {
  constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();
  while (bracket.high - bracket.low > kRounding * bracket.high) {
    const double half = (bracket.high - bracket.low) / 2.0;
    const double middle = bracket.low + half;
    if (!(middle > bracket.low && middle < bracket.high)) break;
    const double f_middle = f(middle);
    const double root = std::sqrt(f_middle * f_middle - bracket.f_low * bracket.f_high);
    const double t = root > 0.0 ? middle + half * (f_middle / root) : middle;
    const double f_t = f(t);
    if (std::abs(f_t) <= noise) return t;
    bracket.narrow(middle, f_middle);
    bracket.narrow(t, f_t);
  }
  return bracket.high;
}

struct ExactRoot {
  DoubleDouble t;
  DoubleDouble left;  ///< the value of f there, apart from its rounding
};

/// Relative to a root: this near to it, the slope is that of the root.
constexpr double kNextTo = 1e-9;

/// Corrects a root of `f` to more bits than a double has.
///
/// @param f a function of a DoubleDouble that returns a DoubleDouble
/// @param slope roughly the slope of f near the root
/// @param last values this near to 0 are corrected once more, without another value of f
template <typename Function>
ExactRoot correctedRoot(const Function& f, DoubleDouble t, double slope, double last) {
  DoubleDouble f_t = f(t);
  for (int i = 0; i < 6 && slope < 0.0 && f_t.hi != 0.0; ++i) {
    const DoubleDouble change = f_t / -slope;
    const DoubleDouble better = t + change;
    if (std::abs(f_t.hi) <= last && std::abs(change.hi) <= kNextTo * t.hi) return {better, {}};
    const DoubleDouble f_better = f(better);
    if (!(abs(f_better) < abs(f_t))) break;
    const double secant = (f_better - f_t).hi / change.hi;
    if (secant < 0.0) slope = secant;
    t = better;
    f_t = f_better;
  }
  return {t, f_t};
}

/// The root of a function that is known in double-double only.
template <typename Function>
DoubleDouble rootOf(const Function& f, double high) {
  constexpr double kNear = 1e-13;  // secants do the rest
  const auto rough = [&f](double t) { return f(DoubleDouble(t)).hi; };
  const double t = roughRootOf(rough, bracketOf(rough, high), kNear);
  const double aside = 1e-7 * t;
  const DoubleDouble change = f(DoubleDouble(t)) - f(DoubleDouble(t - aside));
  return correctedRoot(f, t, change.hi / aside, 0.0).t;
}

/// A function's value and slope at one place.
struct Value {
  double f = 0.0;
  double slope = 0.0;
};

/// A root as Newton's method finds it within the bracket, roughly.
struct RoughRoot {
  double t = 0.0;
  double slope = 0.0;  ///< the slope of f near there
};

/// @param f a function of a double that returns a Value
/// @param noise the rounding error of f: values this near to 0 are as good as 0
template <typename Function>
RoughRoot newtonRootOf(const Function& f, Bracket bracket, double noise) {
  constexpr double kRounding = 4.0 * std::numeric_limits<double>::epsilon();
  constexpr int kMost = 100;  // after so many halvings, doubles are exhausted
  // Estimates the root as if f fell with the square of t.
  double t = bracket.high * std::sqrt(bracket.f_low / (bracket.f_low - bracket.f_high));
  double slope = 0.0;
  for (int i = 0; i < kMost; ++i) {
    const Value value = f(t);
    slope = value.slope;
    if (std::abs(value.f) <= noise) break;
    (value.f > 0.0 ? bracket.low : bracket.high) = t;
    double better = t - value.f / slope;
    if (!(better > bracket.low && better < bracket.high)) {
      better = bracket.low + (bracket.high - bracket.low) / 2.0;
    }
    const double change = std::abs(better - t);
    t = better;
    if (change <= kRounding * t) break;
  }
  return {t, slope};
}

/// The root of a function near a rough one.
///
/// @param f a function of a DoubleDouble that returns a DoubleDouble
/// @param high the end of the bracket
template <typename Function>
DoubleDouble rootNear(const Function& f, const RoughRoot& rough, double high) {
  constexpr double kLast = 1e-7;
  constexpr double kWrong = 1e-9;  // beyond this, the rough function has another root
  const ExactRoot root = correctedRoot(f, rough.t, rough.slope, kLast);
  return std::abs(root.left.hi) > kWrong ? rootOf(f, high) : root.t;
}

/// The root of a function that is also known in doubles, which is faster.
///
/// @param rough the function from double to double, with this rounding error
/// @param exact the function from DoubleDouble to DoubleDouble
template <typename Rough, typename Exact>
DoubleDouble rootOf(const Rough& rough, const Exact& exact, const Bracket& bracket, double noise) {
  const double t = roughRootOf(rough, bracket, noise);
  const double aside = 1e-6 * t;
  return rootNear(exact, {t, (rough(t) - rough(t - aside)) / aside}, bracket.high);
}

}  // namespace stepdriver::motion
