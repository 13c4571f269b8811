#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "engine_channel.h"
#include "profile/profile_sum.h"

namespace stepdriver::pulse {

/// The pulse thread's state of axes that share motors.
///
/// Each axis has a channel that follows its profiles and makes no step. Each motor has one that
/// follows no profile: its steps are those of the sum of the axes' profiles. A profile takes over
/// when all steps before its start have been made. What ends one axis early ends all.
class SharedMotors {
 public:
  /// @param axes, motors outlive this. The n-th motor has the driver chip of the n-th axis.
  SharedMotors(const SharedAxes& shared, std::vector<EngineChannel*> axes,
               std::vector<EngineChannel*> motors);

  const std::vector<EngineChannel*>& axes() const { return axes_; }
  const std::vector<EngineChannel*>& motors() const { return motors_; }

  /// An axis follows a profile.
  bool moves() const;
  /// Such a motion has made a step.
  bool isRunning() const;
  /// The pins of a chip are being written.
  bool isReserved() const;
  /// A motor moves at a speed at which it can't start or stop at once.
  bool isFast(Nanoseconds motion_now) const;
  /// The longest of the axes, see EngineChannel::restartInterval().
  Nanoseconds restartInterval() const;
  /// The least of the axes that move, see EngineChannel::fullStep(). @pre moves()
  int fullStep() const;
  /// See EngineChannel::madeUntil().
  Nanoseconds madeUntil() const;

  /// @name Profiles of an axis
  /// @{
  /// It begins the first one, from rest.
  void begin(EngineChannel& axis, const Successors::Entry& followed);
  /// The motion time of its next take-over or end, when nothing before that is left to be done.
  std::optional<Nanoseconds> dueOf(const EngineChannel& axis) const;
  /// @pre It has a successor.
  void takeOver(EngineChannel& axis);
  /// It has come to the end of its profile, and rests there.
  void finish(EngineChannel& axis);
  /// All motions have ended early: the places of the axes are those of the motors' edges.
  void halt();
  /// @}

  /// A motor's next step belongs to a profile that is about to be replaced.
  bool isObsolete(const EngineChannel& motor) const;
  /// [microsteps/s] Of a motor, by the motions of the axes.
  double velocityOf(const EngineChannel& motor, Nanoseconds motion_now) const;
  /// A motor has made a step.
  void stepped(const EngineChannel& motor);
  /// A chip is ready at a clock time: no motor steps before.
  void noteReady(Nanoseconds ready);

  /// @name Of one end, while the axes are being ended
  /// @{
  bool ends = false;
  bool ends_fast = false;
  /// @}

 private:
  std::optional<Nanoseconds> nextTakeOver() const;
  bool isBefore(Nanoseconds time) const;
  void seed();
  double placeOf(std::size_t axis) const;
  std::size_t numberOf(const EngineChannel& axis) const;

  const std::vector<std::vector<double>> matrix_;
  const std::vector<std::vector<double>> inverse_;
  const std::vector<EngineChannel*> axes_;
  const std::vector<EngineChannel*> motors_;
  std::vector<motion::ProfileSum> sums_;  // by motor
  Nanoseconds since_ = 0;  // motion time at which a profile was last begun, replaced or ended
};

}  // namespace stepdriver::pulse
