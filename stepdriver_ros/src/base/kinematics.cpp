#include "kinematics.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace stepdriver::base {
namespace {

/// Whether the wheels that don't steer tell the rotation by themselves.
bool hasBothSides(const Kinematics& kinematics) {
  const auto fixed_at = [&kinematics](double side) {
    return std::any_of(kinematics.wheels.begin(), kinematics.wheels.end(),
                       [side](const Wheel& wheel) { return wheel.y * side > 0.0; });
  };
  return fixed_at(1.0) && fixed_at(-1.0);
}

/// The regression line of the travels over the places of the wheels: travel = linear - angular y.
Twist twistOfBothSides(const Kinematics& kinematics, const std::vector<double>& wheels) {
  const auto count = static_cast<double>(wheels.size());
  double mean_y = 0.0;
  double mean_travel = 0.0;
  for (std::size_t i = 0; i < wheels.size(); ++i) {
    mean_y += kinematics.wheels[i].y / count;
    mean_travel += wheels[i] * kinematics.wheels[i].travel / count;
  }
  double products = 0.0;
  double squares = 0.0;
  for (std::size_t i = 0; i < wheels.size(); ++i) {
    const double y = kinematics.wheels[i].y - mean_y;
    products += y * (wheels[i] * kinematics.wheels[i].travel - mean_travel);
    squares += y * y;
  }
  const double angular = -products / squares;
  return {mean_travel + angular * mean_y, angular};
}

}  // namespace

SteeredMotion steeredMotion(const Steering& steering, const Twist& wanted) {
  const double sideways = wanted.angular * steering.wheelbase;
  const double direction = wanted.linear < 0.0 ? -1.0 : 1.0;
  const double angle = std::atan2(direction * sideways, std::abs(wanted.linear));
  if (std::abs(angle) <= steering.max_angle) {
    return {angle, direction * std::hypot(wanted.linear, sideways), true};
  }
  return {std::copysign(steering.max_angle, angle),
          wanted.linear == 0.0 ? 0.0 : wanted.linear / std::cos(steering.max_angle), false};
}

Twist twistOf(const Steering& steering, double speed, double angle) {
  return {speed * std::cos(angle), speed * std::sin(angle) / steering.wheelbase};
}

std::vector<double> wheelVelocities(const Kinematics& kinematics, const Twist& twist,
                                    double angle) {
  std::vector<double> velocities;
  velocities.reserve(kinematics.wheels.size());
  for (const Wheel& wheel : kinematics.wheels) {
    const double along = wheel.steered
                             ? twist.linear * std::cos(angle) +
                                   twist.angular * kinematics.steering->wheelbase * std::sin(angle)
                             : twist.linear - twist.angular * wheel.y;
    velocities.push_back(along / wheel.travel);
  }
  return velocities;
}

Twist twistFrom(const Kinematics& kinematics, const std::vector<double>& wheels, double angle) {
  if (hasBothSides(kinematics)) return twistOfBothSides(kinematics, wheels);
  const Wheel& wheel = kinematics.wheels.front();
  const double along = wheels.front() * wheel.travel;
  return twistOf(*kinematics.steering, wheel.steered ? along : along / std::cos(angle), angle);
}

double speedFactor(const Kinematics& kinematics, const std::vector<double>& velocities) {
  double factor = 1.0;
  for (std::size_t i = 0; i < velocities.size(); ++i) {
    const double speed = std::abs(velocities[i]);
    const double most = kinematics.wheels[i].max_speed;
    if (speed > most) factor = std::min(factor, most / speed);
  }
  return factor;
}

double changeFraction(const Kinematics& kinematics, const std::vector<double>& from,
                      const std::vector<double>& to, double seconds) {
  double fraction = 1.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Wheel& wheel = kinematics.wheels[i];
    const double change = std::abs(to[i] - from[i]);
    double rate = wheel.acceleration;
    if (from[i] * to[i] < 0.0) {
      rate = std::min(wheel.acceleration, wheel.deceleration);
    } else if (std::abs(to[i]) < std::abs(from[i])) {
      rate = wheel.deceleration;
    }
    if (change > rate * seconds) fraction = std::min(fraction, rate * seconds / change);
  }
  return fraction;
}

}  // namespace stepdriver::base
