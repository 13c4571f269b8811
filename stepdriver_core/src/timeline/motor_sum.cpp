#include "timeline/motor_sum.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "profile/resting_count.h"

namespace stepdriver::pulse {

// ---- an axis ----

Nanoseconds AxisOfSum::madeUntil() const { return sum_.madeUntil(); }
bool AxisOfSum::isFast(Nanoseconds motion_now) const { return sum_.isFast(motion_now); }
void AxisOfSum::begin(const Successors::Entry& entry) { sum_.begin(*this, entry); }
std::optional<Nanoseconds> AxisOfSum::endsAt() const { return sum_.endOf(*this); }
void AxisOfSum::finish() { sum_.finish(*this); }
void AxisOfSum::halt() { sum_.halt(); }

void AxisOfSum::append(const Successors::Entry& entry) {
  successors_.add(entry);
  sum_.refresh();
}

bool AxisOfSum::takeOver() {
  sum_.takeOver(*this);
  return true;
}

void AxisOfSum::end() {
  Follower::end();
  sum_.refresh();
}

int AxisOfSum::directionAt(Nanoseconds step) const {
  const double velocity = follows() ? velocityAt(step) : 0.0;
  return static_cast<int>(velocity > 0.0) - static_cast<int>(velocity < 0.0);
}

// ---- a motor ----

void MotorOfSum::halt() { sum_.halt(); }
bool MotorOfSum::isFast(Nanoseconds motion_now) const { return sum_.isFast(motion_now); }

double MotorOfSum::velocityAt(Nanoseconds motion_time) const {
  return sum_.velocityOf(number_, motion_time);
}

// ---- all of them ----

MotorSum::MotorSum(Matrix matrix, Matrix inverse)
    : matrix_(std::move(matrix)), inverse_(std::move(inverse)), sums_(matrix_.size()) {
  for (std::size_t i = 0; i < matrix_.size(); ++i) {
    axes_.push_back(std::make_unique<AxisOfSum>(*this, i));
    motors_.push_back(std::make_unique<MotorOfSum>(*this, i));
  }
}

bool MotorSum::moves() const {
  return std::any_of(axes_.begin(), axes_.end(), [](const auto& axis) { return axis->follows(); });
}

bool MotorSum::isFast(Nanoseconds motion_now) const {
  const Nanoseconds restart = motors_.front()->pace_.restart_interval;
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    constexpr double kRounding = 1.0 + 1e-6;
    if (std::abs(velocityOf(i, motion_now)) * static_cast<double>(restart) > 1e9 * kRounding) {
      return true;
    }
  }
  return false;
}

double MotorSum::velocityOf(std::size_t motor, Nanoseconds motion_time) const {
  double velocity = 0.0;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    if (axes_[i]->follows()) velocity += matrix_[motor][i] * axes_[i]->velocityAt(motion_time);
  }
  return velocity;
}

Nanoseconds MotorSum::madeUntil() const {
  Nanoseconds until = std::numeric_limits<Nanoseconds>::min();
  if (!moves()) return until;
  for (const auto& motor : motors_) until = std::max(until, motor->since_);
  return until;
}

// What the motors must know of the axes: the longest interval at which one can't stop at once, the
// least angle by which one of those that move may be late, and when a profile is replaced.
void MotorSum::refresh() {
  Pace pace;
  pace.late = std::numeric_limits<double>::infinity();
  replaced_at_ = kNever;
  for (const auto& axis : axes_) {
    pace.restart_interval = std::max(pace.restart_interval, axis->pace_.restart_interval);
    if (axis->follows()) pace.late = std::min(pace.late, axis->pace_.late);
    if (axis->successors_.empty()) continue;
    replaced_at_ = std::min(replaced_at_, axis->successors_.first().profile.startNs());
  }
  for (const auto& motor : motors_) {
    motor->pace_ = pace;
    motor->replaced_at_ = replaced_at_;
  }
}

// ---- profiles ----

// Each motor's steps from here on.
void MotorSum::seed() {
  refresh();
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    MotorOfSum& motor = *motors_[i];
    motion::ProfileSum& sum = sums_[i];
    sum.begin(std::max(motor.since_, since_));
    for (std::size_t k = 0; k < axes_.size(); ++k) {
      const AxisOfSum& axis = *axes_[k];
      if (axis.follows()) {
        sum.add(matrix_[i][k], axis.profile_);
      } else {
        sum.add(matrix_[i][k], motion::DoubleDouble(axis.rests_at_));
      }
    }
    motor.finder_ = motion::StepFinder(sum, motor.count_);
    motor.pullNext();
  }
}

void MotorSum::begin(AxisOfSum& axis, const Successors::Entry& entry) {
  const bool moved = moves();
  axis.adopt(entry);
  axis.since_ = entry.profile.startNs();
  axis.running_ = false;
  if (!moved) {
    since_ = axis.since_;
    for (const auto& motor : motors_) {
      motor->since_ = since_;
      motor->running_ = false;
    }
  }
  seed();
}

// Whether no step before a motion time is left to be made.
bool MotorSum::isBefore(Nanoseconds time) const {
  return std::none_of(motors_.begin(), motors_.end(), [time](const auto& motor) {
    return motor->next_ && motor->next_->time_ns < time;
  });
}

std::optional<Nanoseconds> MotorSum::endOf(const AxisOfSum& axis) const {
  if (!axis.follows()) return std::nullopt;
  if (!axis.successors_.empty()) {
    const Nanoseconds start = axis.successors_.first().profile.startNs();
    return start == replaced_at_ && isBefore(start) ? std::optional<Nanoseconds>(start)
                                                    : std::nullopt;
  }
  const Nanoseconds end = axis.profile_.endNs();
  if (replaced_at_ <= end) return std::nullopt;
  // A last step may be at the end itself.
  return isBefore(end + 1) ? std::optional<Nanoseconds>(end) : std::nullopt;
}

void MotorSum::takeOver(AxisOfSum& axis) {
  since_ = std::max(since_, axis.successors_.first().profile.startNs());
  axis.adopt(axis.successors_.takeFirst());
  seed();
}

void MotorSum::finish(AxisOfSum& axis) {
  since_ = std::max(since_, axis.profile_.endNs());
  axis.rests_at_ = axis.profile_.endPosition().value();
  for (motion::ProfileSum& sum : sums_) sum.rest(axis.number_);
}

// The places of the axes are those of the motors' edges.
void MotorSum::halt() {
  for (const auto& motor : motors_) motor->next_.reset();
  for (std::size_t i = 0; i < axes_.size(); ++i) axes_[i]->rests_at_ = placeOf(i);
}

// ---- steps ----

double MotorSum::placeOf(std::size_t axis) const {
  double place = 0.0;
  for (std::size_t i = 0; i < motors_.size(); ++i) {
    place += inverse_[axis][i] * static_cast<double>(motors_[i]->made_);
  }
  return place;
}

void MotorSum::stepped(std::size_t motor, std::int64_t count) {
  motors_[motor]->made_ = count;
  for (std::size_t i = 0; i < axes_.size(); ++i) {
    AxisOfSum& axis = *axes_[i];
    axis.place_ = placeOf(i);
    axis.count_ = motion::restingCount(axis.place_);
    axis.running_ = axis.follows();
  }
}

}  // namespace stepdriver::pulse
