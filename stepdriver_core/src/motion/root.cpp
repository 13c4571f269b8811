#include "root.h"

#include <cmath>

namespace stepdriver::motion {
namespace {

using Function = std::function<DoubleDouble(DoubleDouble)>;

struct Bracket {
  double low;  // f is above 0 there
  double high;
  double f_low;
  double f_high;

  void narrow(double t, double f_t) {
    if (!(t > low && t < high)) return;
    (f_t > 0.0 ? low : high) = t;
    (f_t > 0.0 ? f_low : f_high) = f_t;
  }
};

// A bracket whose ends have the root's order of magnitude, so that its halves have enough bits.
Bracket bracketOf(const Function& f, double high) {
  Bracket bracket{0.0, high, 0.0, f(high).hi};
  for (double t = high / 16.0; t > 1e-300; t /= 16.0) {
    const double f_t = f(t).hi;
    (f_t > 0.0 ? bracket.low : bracket.high) = t;
    (f_t > 0.0 ? bracket.f_low : bracket.f_high) = f_t;
    if (f_t > 0.0) break;
  }
  return bracket;
}

double ridders(const Function& f, Bracket bracket) {
  constexpr double kNear = 1e-13;  // secants do the rest
  while (bracket.high - bracket.low > 4e-16 * bracket.high) {
    const double half = (bracket.high - bracket.low) / 2.0;
    const double middle = bracket.low + half;
    if (!(middle > bracket.low && middle < bracket.high)) break;
    const double f_middle = f(middle).hi;
    const double root = std::sqrt(f_middle * f_middle - bracket.f_low * bracket.f_high);
    const double t = root > 0.0 ? middle + half * (f_middle / root) : middle;
    const double f_t = f(t).hi;
    if (std::abs(f_t) < kNear) return t;
    bracket.narrow(middle, f_middle);
    bracket.narrow(t, f_t);
  }
  return bracket.high;
}

}  // namespace

DoubleDouble rootOf(const Function& f, double high) {
  DoubleDouble t = ridders(f, bracketOf(f, high));
  DoubleDouble f_t = f(t);
  const double aside = 1e-7 * t.hi;
  const DoubleDouble slope = (f_t - f(t - DoubleDouble(aside))) / DoubleDouble(aside);
  for (int i = 0; i < 6 && slope.hi < 0.0 && f_t.hi != 0.0; ++i) {
    const DoubleDouble better = t - f_t / slope;
    const DoubleDouble f_better = f(better);
    if (!(abs(f_better) < abs(f_t))) break;
    t = better;
    f_t = f_better;
  }
  return t;
}

}  // namespace stepdriver::motion
