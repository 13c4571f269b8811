#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <vector>

#include "profile/profile_sum.h"
#include "timeline/follower.h"

namespace stepdriver::pulse {

class MotorSum;

/// Follows the profiles of an axis that shares motors, and makes no step.
class AxisOfSum final : public Follower {
 public:
  AxisOfSum(MotorSum& sum, std::size_t number) : sum_(sum), number_(number) {}

  /// [microsteps] Its place by the steps of the motors, which need not be a whole number: count()
  /// is the nearest one.
  double place() const { return place_; }

  Nanoseconds madeUntil() const override;
  bool takeOver() override;
  std::optional<Nanoseconds> endsAt() const override;
  void finish() override;
  void end() override;
  void halt() override;
  double restsAt() const override { return rests_at_; }
  bool isFast(Nanoseconds motion_now) const override;
  int directionAt(Nanoseconds step) const override;

 private:
  void begin(const Successors::Entry& entry) override;
  void append(const Successors::Entry& entry) override;

  MotorSum& sum_;
  const std::size_t number_;
  double place_ = 0.0;
  double rests_at_ = 0.0;

  friend class MotorSum;
};

/// Follows no profile: its steps are those of the sum of the axes' motions.
class MotorOfSum final : public Follower {
 public:
  MotorOfSum(MotorSum& sum, std::size_t number) : sum_(sum), number_(number) {}

  bool takeOver() override { return false; }
  std::optional<Nanoseconds> endsAt() const override { return std::nullopt; }
  void halt() override;
  bool isFast(Nanoseconds motion_now) const override;
  double velocityAt(Nanoseconds motion_time) const override;

 private:
  MotorSum& sum_;
  const std::size_t number_;
  std::int64_t made_ = 0;  // its steps that have gone out, of those that were handed over

  friend class MotorSum;
};

/// The timeline of axes that share motors, as on a CoreXY: each motor moves by a sum of the motions
/// of the axes. A profile takes over when all steps before its start have been made.
class MotorSum {
 public:
  using Matrix = std::vector<std::vector<double>>;

  /// @param matrix by motor: [microsteps of the motor] for a microstep of each axis.
  /// @param inverse by axis: [microsteps of the axis] for a microstep of each motor.
  MotorSum(Matrix matrix, Matrix inverse);
  MotorSum(const MotorSum&) = delete;
  MotorSum& operator=(const MotorSum&) = delete;

  AxisOfSum& axis(std::size_t number) { return *axes_[number]; }
  MotorOfSum& motor(std::size_t number) { return *motors_[number]; }

  /// A motor has made a step: the places of the axes follow. @param count of the motor
  void stepped(std::size_t motor, std::int64_t count);

 private:
  bool moves() const;
  Nanoseconds madeUntil() const;
  std::optional<Nanoseconds> endOf(const AxisOfSum& axis) const;
  void begin(AxisOfSum& axis, const Successors::Entry& entry);
  void takeOver(AxisOfSum& axis);
  void finish(AxisOfSum& axis);
  void halt();
  bool isFast(Nanoseconds motion_now) const;
  double velocityOf(std::size_t motor, Nanoseconds motion_time) const;
  void refresh();
  bool isBefore(Nanoseconds time) const;
  void seed();
  double placeOf(std::size_t axis) const;

  const Matrix matrix_;
  const Matrix inverse_;
  std::vector<std::unique_ptr<AxisOfSum>> axes_;
  std::vector<std::unique_ptr<MotorOfSum>> motors_;
  std::vector<motion::ProfileSum> sums_;  // by motor
  Nanoseconds since_ = 0;  // motion time at which a profile was last begun, replaced or ended
  Nanoseconds replaced_at_ = kNever;  // when the first successor begins

  friend class AxisOfSum;
  friend class MotorOfSum;
};

}  // namespace stepdriver::pulse
