#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

namespace stepdriver::motion {

/// A part of a motion that is made later.
struct Impulse {
  double part = 1.0;          ///< above 0
  std::int64_t delay_ns = 0;  ///< the first one has none
};

/// Divides a motion into a few delayed parts, so that what it makes ring comes to rest with it: the
/// shaped motion is the sum of part_i p(t - delay_i). Each part makes the same oscillation, at
/// times at which they cancel each other out.
///
/// The parts are positive, and their sum is exactly 1. At any time, the shaped position is
/// therefore a weighted mean of positions that the motion had within the last duration(), and the
/// same is true for velocities, accelerations and jerks: it keeps all their limits. It has the same
/// beginning and end, and comes to rest durationNs() later.
///
/// With f the frequency, d the damping ratio, T = 1 / (f sqrt(1 - d^2)) the period of the damped
/// oscillation, K = exp(-pi d / sqrt(1 - d^2)) what remains of it after half a period, and V = 0.05
/// the part of the oscillation that EI allows at the frequency itself, and 2HUMP_EI on either side
/// of it:
///
/// | shaper   | delays            | parts                                                  |
/// |----------|-------------------|--------------------------------------------------------|
/// | ZV       | 0, T/2            | 1, K                                                   |
/// | MZV      | 0, 3T/8, 3T/4     | 1 - 1/sqrt(2), (sqrt(2) - 1) k, (1 - 1/sqrt(2)) k^2    |
/// | EI       | 0, T/2, T         | (1 + V)/4, (1 - V)/2 K, (1 + V)/4 K^2                  |
/// | 2HUMP_EI | 0, T/2, T, 3T/2   | a, (1/2 - a) K, (1/2 - a) K^2, a K^3                   |
///
/// each divided by its sum, with k = K^(3/4), a = (3 X^2 + 2 X + 3 V^2) / (16 X) and
/// X = cbrt(V^2 (sqrt(1 - V^2) + 1)).
///
/// ZV: N. C. Singer, W. P. Seering, Preshaping command inputs to reduce system vibration, 1990.
/// EI: W. E. Singhose, W. P. Seering, N. C. Singer, Residual vibration reduction using vector
/// diagrams to generate shaped inputs, 1994. 2HUMP_EI: W. E. Singhose, L. J. Porter, T. D. Tuttle,
/// N. C. Singer, Vibration reduction using multi-hump input shapers, 1997. MZV: the formula in the
/// documentation of Klipper.
///
/// Immutable.
class InputShaper {
 public:
  /// The most parts of a shaper: two 2HUMP_EI have that many.
  static constexpr std::size_t kMostImpulses = 16;

  /// @name Shapers for one oscillation
  /// @param frequency [Hz] above 0
  /// @param damping its damping ratio: from 0 to below 1
  /// @{
  static InputShaper zv(double frequency, double damping);
  static InputShaper mzv(double frequency, double damping);
  static InputShaper ei(double frequency, double damping);
  static InputShaper twoHumpEi(double frequency, double damping);
  /// @}

  /// A shaper for two oscillations, this one's and the other one's: the other shapes each part of
  /// this one. @pre The product of their numbers of parts is at most kMostImpulses.
  InputShaper with(const InputShaper& other) const;

  /// The parts in the order of their delays, which all differ.
  const std::vector<Impulse>& impulses() const { return impulses_; }
  /// How much later the shaped motion ends.
  std::int64_t durationNs() const { return impulses_.back().delay_ns; }

 private:
  explicit InputShaper(std::vector<Impulse> impulses);

  std::vector<Impulse> impulses_;
};

}  // namespace stepdriver::motion
