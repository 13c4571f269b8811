#pragma once

#include <cmath>
#include <complex>
#include <cstdint>

namespace stepdriver::sim {

/// A mass that a carriage pulls along by a spring: what rings on a machine. Its motion is computed
/// exactly, from step to step: between them the carriage stands still.
///
/// With f the frequency, d the damping ratio and w = 2 pi f: x'' + 2 d w x' + w^2 (x - carriage) =
/// 0. With z = (x - carriage) + i (x' + d w (x - carriage)) / w_d, w_d = w sqrt(1 - d^2), that is a
/// rotation: z(t) = z(0) exp(-(d w + i w_d) t).
class SpringMass {
 public:
  /// @param frequency [Hz] above 0, undamped @param damping ratio, from 0 to below 1
  /// @param position where the carriage and the mass rest
  SpringMass(double frequency, double damping, double position)
      : decay_(2.0 * kPi * frequency * damping),
        rotation_(2.0 * kPi * frequency * std::sqrt(1.0 - damping * damping)),
        carriage_(position) {}

  /// The carriage is at this position from this time on. @param time_ns not before the last one
  void moveTo(double position, std::int64_t time_ns) {
    z_ = at(time_ns);
    time_ns_ = time_ns;
    // The mass and its speed stay as they are.
    const double jump = carriage_ - position;
    z_ += std::complex<double>(jump, decay_ / rotation_ * jump);
    carriage_ = position;
  }

  /// The position of the mass. @param time_ns not before the last moveTo(), as for ringing()
  double position(std::int64_t time_ns) const { return carriage_ + at(time_ns).real(); }
  /// The amplitude with which the mass would ring on if the carriage stayed here and there were no
  /// damping.
  double ringing(std::int64_t time_ns) const { return std::abs(at(time_ns)); }

 private:
  static constexpr double kPi = 3.14159265358979323846;

  std::complex<double> at(std::int64_t time_ns) const {
    const double t = static_cast<double>(time_ns - time_ns_) * 1e-9;
    return z_ * std::exp(std::complex<double>(-decay_ * t, -rotation_ * t));
  }

  double decay_;     // 1/s
  double rotation_;  // 1/s
  double carriage_;
  std::complex<double> z_;
  std::int64_t time_ns_ = 0;
};

}  // namespace stepdriver::sim
