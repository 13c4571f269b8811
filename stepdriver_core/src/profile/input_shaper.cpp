#include "input_shaper.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "nanoseconds.h"

namespace stepdriver::motion {
namespace {

constexpr double kTurn = 6.283185307179586;  // 2 pi
constexpr double kAllowed = 0.05;            // the oscillation that may be left, V in the formulas

/// A damped oscillation with the period T.
struct Oscillation {
  double period_s;  // T
  double damping;   // d / sqrt(1 - d^2)

  Oscillation(double frequency, double ratio)
      : period_s(1.0 / (frequency * std::sqrt(1.0 - ratio * ratio))),
        damping(ratio / std::sqrt(1.0 - ratio * ratio)) {}

  /// An impulse after a part of the period, as large as what then remains of the oscillation.
  Impulse impulse(double part, double periods) const {
    return {part * std::exp(-kTurn * damping * periods), nanoseconds(periods * period_s)};
  }
};

}  // namespace

// All parts but the first are whole multiples of 2^-52. The first one, which is the rest up to
// 1, is such a multiple too: sums of parts have no rounding error.
InputShaper::InputShaper(std::vector<Impulse> impulses) {
  std::sort(impulses.begin(), impulses.end(),
            [](const Impulse& a, const Impulse& b) { return a.delay_ns < b.delay_ns; });
  double sum = 0.0;
  for (const Impulse& impulse : impulses) {
    sum += impulse.part;
    if (!impulses_.empty() && impulses_.back().delay_ns == impulse.delay_ns) {
      impulses_.back().part += impulse.part;
    } else {
      impulses_.push_back(impulse);
    }
  }
  constexpr double kUnits = 4503599627370496.0;  // 2^52
  double left = 1.0;
  for (std::size_t i = impulses_.size(); i-- > 1;) {
    double& part = impulses_[i].part;
    part = std::max(1.0, std::nearbyint(part / sum * kUnits)) / kUnits;
    left -= part;
  }
  impulses_.front().part = left;
}

InputShaper InputShaper::zv(double frequency, double damping) {
  const Oscillation o(frequency, damping);
  return InputShaper({o.impulse(1.0, 0.0), o.impulse(1.0, 0.5)});
}

InputShaper InputShaper::mzv(double frequency, double damping) {
  const Oscillation o(frequency, damping);
  const double outer = 1.0 - std::sqrt(0.5);
  const double inner = std::sqrt(2.0) - 1.0;
  return InputShaper({o.impulse(outer, 0.0), o.impulse(inner, 0.375), o.impulse(outer, 0.75)});
}

InputShaper InputShaper::ei(double frequency, double damping) {
  const Oscillation o(frequency, damping);
  const double outer = 0.25 * (1.0 + kAllowed);
  const double inner = 0.5 * (1.0 - kAllowed);
  return InputShaper({o.impulse(outer, 0.0), o.impulse(inner, 0.5), o.impulse(outer, 1.0)});
}

InputShaper InputShaper::twoHumpEi(double frequency, double damping) {
  const Oscillation o(frequency, damping);
  const double square = kAllowed * kAllowed;
  const double x = std::cbrt(square * (std::sqrt(1.0 - square) + 1.0));
  const double outer = (3.0 * x * x + 2.0 * x + 3.0 * square) / (16.0 * x);
  const double inner = 0.5 - outer;
  return InputShaper(
      {o.impulse(outer, 0.0), o.impulse(inner, 0.5), o.impulse(inner, 1.0), o.impulse(outer, 1.5)});
}

InputShaper InputShaper::with(const InputShaper& other) const {
  std::vector<Impulse> both;
  for (const Impulse& a : impulses_) {
    for (const Impulse& b : other.impulses_) {
      both.push_back({a.part * b.part, a.delay_ns + b.delay_ns});
    }
  }
  return InputShaper(std::move(both));
}

}  // namespace stepdriver::motion
