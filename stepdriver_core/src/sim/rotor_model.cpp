#include "rotor_model.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::sim {
namespace {

constexpr double kCycle = 2.0 * kPi;
// A rotor beyond the middle between two cycles may still be carried back. It has lost its steps
// when it is at the steepest place of the next cycle.
constexpr double kLost = 0.75 * kCycle;
// Exactly between two places of rest, no torque turns the rotor: it is tipped to the one that it
// belongs to.
constexpr double kCrest = 0.999 * kPi;
// [rad, and of w] A ten-thousandth of a full step: nothing that happens later depends on it.
constexpr double kSettled = 1e-4;

// To 6e-8, in a third of the time of the C library's, and the same on each processor: the sum of
// its series up to x^11 for the angle to the next multiple of pi.
double sine(double angle) {
  const auto half_turns = static_cast<int>(angle * (1.0 / kPi) + std::copysign(0.5, angle));
  const double x = angle - half_turns * kPi;
  const double s = x * x;
  const double value =
      x *
      (1.0 - s / 6.0 * (1.0 - s / 20.0 * (1.0 - s / 42.0 * (1.0 - s / 72.0 * (1.0 - s / 110.0)))));
  return half_turns % 2 == 0 ? value : -value;
}

}  // namespace

MotorSpec soundMotor(MotorSpec motor, double rate, double acceleration) {
  constexpr double kFullStep = kPi / 2.0;  // [electrical rad]
  const double by_speed = 1.5 * kFullStep * rate;
  const double by_acceleration = 4.0 * kFullStep * acceleration;
  const double for_frequency = std::max(by_speed * by_speed, by_acceleration);
  motor.holding_torque = std::max({motor.holding_torque, 4.0 * motor.friction,
                                   for_frequency * motor.inertia / motor.pole_pairs});
  return motor;
}

RotorModel::RotorModel(const MotorSpec& spec)
    : full_frequency_(std::sqrt(spec.pole_pairs * spec.holding_torque / spec.inertia)),
      full_friction_(spec.friction / spec.holding_torque),
      damping_(spec.damping),
      frequency_(full_frequency_),
      friction_(full_friction_) {}

void RotorModel::setTorque(double part) {
  if (part == torque_) return;
  torque_ = part;
  const double before = frequency_;
  frequency_ = full_frequency_ * std::sqrt(part);
  friction_ = full_friction_ / part;
  speed_ *= before / frequency_;
  settled_ = false;
}

void RotorModel::setStops(double least, double most) {
  least_lag_ = least;
  most_lag_ = most;
  meetStops();
}

void RotorModel::meetStops() {
  if (lag_ <= least_lag_) {
    lag_ = least_lag_;
    speed_ = std::min(speed_, 0.0);
  }
  if (lag_ >= most_lag_) {
    lag_ = most_lag_;
    speed_ = std::max(speed_, 0.0);
  }
}

std::int64_t RotorModel::turnTo(std::int64_t time_ns) {
  std::int64_t behind = 0;
  if (!settled_) {
    const double time = elapsed(time_ns);
    const double steps = time > kLongestStep ? std::ceil(time / kLongestStep) : 1.0;
    const double step = time / steps;
    // exp(-x) for x = 2 damping step, by its Pade approximant of second order, and the integral of
    // it: to 1e-7 for usual dampings, and it decays for all of them.
    const double x = 2.0 * damping_ * step;
    const double whole = 1.0 / (1.0 + x * (0.5 + x / 12.0));
    const double decay = (1.0 - x * (0.5 - x / 12.0)) * whole;
    const double gain = step * whole;
    for (double i = 0.0; i < steps && !settled_; ++i) {
      turn(step, decay, gain);
      behind += slip();
      settle();
    }
  }
  time_ns_ = time_ns;
  return behind;
}

void RotorModel::turn(double duration, double decay, double gain) {
  lag_ -= 0.5 * duration * speed_;
  speed_ = decay * speed_ + gain * sine(lag_);
  // Friction brings the rotor to rest, and never turns it.
  const double most = gain * friction_;
  speed_ = speed_ > 0.0 ? std::max(speed_ - most, 0.0) : std::min(speed_ + most, 0.0);
  lag_ -= 0.5 * duration * speed_;
  meetStops();
  noteLag();
}

void RotorModel::noteLag() {
  if (follows_) largest_lag_ = std::max(largest_lag_, std::abs(lag_));
}

std::int64_t RotorModel::slip() {
  if (std::abs(lag_) < kLost) return 0;
  const double cycles = std::round(lag_ / kCycle);
  lag_ -= cycles * kCycle;
  least_lag_ -= cycles * kCycle;
  most_lag_ -= cycles * kCycle;
  slips_ += std::llabs(std::llround(cycles));
  return std::llround(cycles);
}

void RotorModel::settle() {
  if (std::abs(speed_) >= kSettled) return;
  const double angle = std::abs(lag_);
  if (std::abs(angle - kPi) < kPi - kCrest) lag_ = std::copysign(kCrest, lag_);
  const double torque = sine(lag_);
  const bool is_blocked =
      (lag_ <= least_lag_ && torque > 0.0) || (lag_ >= most_lag_ && torque < 0.0);
  settled_ = is_blocked || std::abs(torque) < friction_ + kSettled;
  if (settled_) speed_ = 0.0;
  if (angle < kSettled) lag_ = 0.0;
}

void RotorModel::moveField(double angle) {
  lag_ += angle;
  least_lag_ += angle;
  most_lag_ += angle;
  settled_ = false;
  follows_ = true;
  noteLag();
}

void RotorModel::rest(std::int64_t time_ns) {
  time_ns_ = time_ns;
  lag_ = speed_ = 0.0;
  settled_ = true;
}

void RotorModel::snap(double angle, std::int64_t time_ns) {
  time_ns_ = time_ns;
  // The caller has decided to which of two places a rotor between them falls.
  lag_ = std::clamp(angle, -kCrest, kCrest);
  speed_ = 0.0;
  settled_ = false;
  follows_ = false;
}

double RotorModel::largestLag() const { return std::min(largest_lag_, kPi); }

}  // namespace stepdriver::sim
