#include "drive.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

namespace stepdriver::base {
namespace {

// A wheel that is slower than this part of its maximum stands: the rest of a rounded difference.
constexpr double kSlowest = 1e-9;
// How long an axis may stand after its order: the time of messages, and for a brake or a chip to
// wake up.
constexpr double kFollowTime = 0.5;  // [s]
// How long the order to stop is repeated while a wheel still turns.
constexpr double kStopTime = 1.0;  // [s]
// A late call must not make the wheels jump; this is the period of the lowest rate.
constexpr double kLongestPeriod = 1.0;        // [s]
constexpr double kSameAngle = 1e-6;           // [rad]
constexpr double kSteeringTolerance = 0.035;  // [rad] 2 degrees
constexpr double kDegreesPerRadian = 180.0 / 3.14159265358979323846;

bool isZero(const Twist& twist) { return twist.linear == 0.0 && twist.angular == 0.0; }

}  // namespace

Drive::Drive(Kinematics kinematics, std::vector<std::string> wheels, std::string steering,
             std::string driver, Timeouts timeouts)
    : kinematics_(std::move(kinematics)),
      names_(std::move(wheels)),
      steering_name_(std::move(steering)),
      driver_(std::move(driver)),
      timeouts_(timeouts),
      cause_("there is no state of " + driver_ + " yet"),
      stands_since_(names_.size() + 1) {}

void Drive::command(const Twist& wanted, double now) {
  wanted_ = wanted;
  commanded_at_ = now;
  if (state_ == State::kWaiting && isZero(wanted)) state_ = State::kReady;
}

void Drive::report(const std::vector<AxisReport>& wheels, const AxisReport& steering, double now) {
  reports_ = wheels;
  steering_report_ = steering;
  reported_at_ = now;
}

DriveOrders Drive::orders(double now) {
  const double seconds = std::clamp(now - asked_at_, 0.0, kLongestPeriod);
  asked_at_ = now;
  updateState(now);
  if (state_ != State::kReady) return stopOrders(now);
  timeOut(now);
  return driveOrders(seconds);
}

DriveOrders Drive::rest() {
  DriveOrders orders;
  if (!told_.empty()) orders.wheels.assign(names_.size(), 0.0);
  told_.clear();
  return orders;
}

bool Drive::takeTimedOut() { return std::exchange(timed_out_, false); }

bool Drive::takeTooTight() { return std::exchange(too_tight_, false); }

std::string Drive::findCause(double now) {
  if (now - reported_at_ > timeouts_.driver) {
    return reported_at_ == kNever
               ? "there is no state of " + driver_ + " yet"
               : fmt::format("there was no state of {} for {} s", driver_, timeouts_.driver);
  }
  for (std::size_t i = 0; i < names_.size(); ++i) {
    if (!reports_[i].trouble.empty()) return names_[i] + ": " + reports_[i].trouble;
  }
  if (kinematics_.steering && !steering_report_.trouble.empty()) {
    return steering_name_ + ": " + steering_report_.trouble;
  }
  if (!steering_refused_.empty()) {
    return steering_name_ + ": " + std::exchange(steering_refused_, std::string());
  }
  return standingAxis(now);
}

std::string Drive::standingAxis(double now) {
  const auto stands_too_long = [this, now](std::size_t axis, bool stands) {
    std::optional<double>& since = stands_since_[axis];
    if (!stands) {
      since.reset();
      return false;
    }
    if (!since) since = now;
    return now - *since > kFollowTime;
  };
  std::string cause;
  for (std::size_t i = 0; i < names_.size(); ++i) {
    const bool stands = !told_.empty() && told_[i] != 0.0 && !reports_[i].moving;
    if (stands_too_long(i, stands)) {
      cause = fmt::format("{}: it stands although it should turn; the log of {} says why",
                          names_[i], driver_);
    }
  }
  const bool stands =
      target_ && !steering_report_.moving && std::abs(*target_ - angle_) > kSteeringTolerance;
  if (stands_too_long(names_.size(), stands)) {
    cause = fmt::format("{}: it stands at {:.1f} degrees instead of {:.1f}", steering_name_,
                        angle_ * kDegreesPerRadian, *target_ * kDegreesPerRadian);
  }
  return cause;
}

void Drive::updateState(double now) {
  std::string cause = findCause(now);
  if (!cause.empty()) {
    if (state_ != State::kStopped) stopped_at_ = now;
    state_ = State::kStopped;
    cause_ = std::move(cause);
    return;
  }
  if (state_ == State::kStopped) state_ = State::kWaiting;
  if (state_ == State::kWaiting && now - commanded_at_ >= timeouts_.command) {
    wanted_ = {};
    state_ = State::kReady;
  }
}

void Drive::timeOut(double now) {
  if (now - commanded_at_ < timeouts_.command || isZero(wanted_)) return;
  timed_out_ = true;
  wanted_ = {};
}

DriveOrders Drive::stopOrders(double now) {
  wanted_ = {};
  twist_ = {};
  speed_ = 0.0;
  target_.reset();
  DriveOrders orders;
  const bool turns = std::any_of(reports_.begin(), reports_.end(),
                                 [](const AxisReport& report) { return report.moving; });
  if (!told_.empty() || (turns && now - stopped_at_ < kStopTime)) {
    orders.wheels.assign(names_.size(), 0.0);
  }
  told_.clear();
  return orders;
}

DriveOrders Drive::driveOrders(double seconds) {
  DriveOrders orders;
  const bool steers = kinematics_.steering.has_value();
  double speed = steers ? steer(orders) : 0.0;
  Twist goal = steers ? twistOf(*kinematics_.steering, speed, angle_) : wanted_;
  std::vector<double> velocities = wheelVelocities(kinematics_, goal, angle_);
  for (double& velocity : velocities) velocity *= std::max(1.0, speed_override_);
  const double factor = speedFactor(kinematics_, velocities);
  speed *= factor;
  goal.linear *= factor;
  goal.angular *= factor;
  if (steers) twist_ = twistOf(*kinematics_.steering, speed_, angle_);
  const double fraction = changeFraction(kinematics_, wheelVelocities(kinematics_, twist_, angle_),
                                         wheelVelocities(kinematics_, goal, angle_), seconds);
  // At the end it is exactly the goal, without the rounding of a sum.
  if (fraction < 1.0) {
    goal.linear = twist_.linear + fraction * (goal.linear - twist_.linear);
    goal.angular = twist_.angular + fraction * (goal.angular - twist_.angular);
    speed = speed_ + fraction * (speed - speed_);
  }
  twist_ = goal;
  speed_ = speed;
  tell(orders, wheelVelocities(kinematics_, twist_, angle_));
  return orders;
}

double Drive::steer(DriveOrders& orders) {
  if (isZero(wanted_)) {  // the steering stays where it is
    if (told_.empty()) target_.reset();
    return 0.0;
  }
  const SteeredMotion motion = steeredMotion(*kinematics_.steering, wanted_);
  too_tight_ = too_tight_ || !motion.exact;
  if (!target_ || std::abs(*target_ - motion.angle) > kSameAngle) {
    target_ = motion.angle;
    orders.steering = motion.angle;
  }
  return motion.speed * std::max(0.0, std::cos(motion.angle - angle_));
}

void Drive::tell(DriveOrders& orders, std::vector<double> velocities) {
  bool rests = true;
  for (std::size_t i = 0; i < velocities.size(); ++i) {
    const double most = kinematics_.wheels[i].max_speed;
    velocities[i] = std::clamp(velocities[i], -most, most);
    if (std::abs(velocities[i]) < kSlowest * most) velocities[i] = 0.0;
    rests = rests && velocities[i] == 0.0;
  }
  if (!rests || !told_.empty()) orders.wheels = velocities;
  if (rests) velocities.clear();
  told_ = std::move(velocities);
}

}  // namespace stepdriver::base
