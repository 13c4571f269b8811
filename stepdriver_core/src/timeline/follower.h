#pragma once

#include <cstdint>
#include <optional>

#include "profile/profile_sum.h"
#include "profile/shaped_profile.h"
#include "profile/step_finder.h"
#include "stepdriver_core/pulse/clock.h"
#include "timeline/successors.h"

namespace stepdriver::pulse {

/// What the speed of a motor means for its steps, as an order says it.
struct Pace {
  /// Steps planned closer than this are at a speed that the motor can't start from or stop at
  /// without a ramp.
  Nanoseconds restart_interval = 0;
  /// [microsteps] By how much a step may be late, as an angle of the motor; 0: only by a part of
  /// its interval.
  double late = 0.0;
};

/// What comes next on a channel, and when: the profile that it follows, those that take over, and
/// the next step. It knows no line and no clock: all times are motion times. For the pulse thread.
///
/// This is the follower of an axis with motors of its own. Axes that share motors have two other
/// kinds, see MotorSum.
class Follower {
 public:
  /// The shortest interval after a late step that isn't caught up, as a part of the planned one.
  static constexpr double kClosest = 0.75;
  /// The longest lateness that is caught up by the angle of a motor. After a longer one a rotor has
  /// come to rest where the field stands: catching up is no gentler then than starting again, and
  /// the axes of a line would be apart for that long.
  static constexpr Nanoseconds kLongestCatchUp = 2'000'000;

  Follower() = default;
  virtual ~Follower() = default;
  Follower(const Follower&) = delete;
  Follower& operator=(const Follower&) = delete;

  /// @name The next step
  /// @{
  const std::optional<motion::Step>& next() const { return next_; }
  /// It was handed over: to a port that writes now, it has gone out.
  void advance();
  /// [microsteps] The steps that were handed over, forward minus backward.
  std::int64_t count() const { return count_; }
  /// The same place in the microsteps of another mode, or where it has stopped before all steps
  /// that were handed over had gone out. @pre It follows nothing.
  void rescale(std::int64_t count) { count_ = count; }
  /// The planned interval between the last step and the next one, or from the profile's start.
  /// @pre There is a next one.
  Nanoseconds interval() const { return next_->time_ns - since_; }
  /// The current motion has made a step.
  bool running() const { return running_; }
  /// @}

  /// @name Profiles
  /// @{
  bool follows() const { return static_cast<bool>(profile_); }
  const motion::ShapedProfile& profile() const { return profile_; }
  /// Serial of the profile that is followed; 0: at rest.
  std::uint64_t following() const { return following_; }
  /// Serial of the profile that the next one must continue; 0: the channel is at rest.
  std::uint64_t latest() const {
    return successors_.empty() ? following_ : successors_.last().serial;
  }
  /// At its end it waits for the in-position outputs.
  bool settles() const { return settles_; }
  bool hasRoom(Nanoseconds start) const { return successors_.hasRoom(start); }
  /// Motion time before which its steps have been made, and no profile may begin.
  virtual Nanoseconds madeUntil() const;
  /// Begins a profile from rest, or adds one that takes over.
  void follow(const Successors::Entry& entry, const Pace& pace);
  /// The next step would come after a successor has begun.
  bool isReplaced() const {
    return next_ ? next_->time_ns >= replaced_at_ : replaced_at_ != kNever;
  }
  /// Continues with the first successor, before any step of it. @pre isReplaced()
  /// @return false if it can't do that alone: its next step waits for what other channels do.
  virtual bool takeOver();
  /// The motion time at which its profile ends, or is replaced if it makes no steps of its own,
  /// when nothing before that is left to be done.
  virtual std::optional<Nanoseconds> endsAt() const;
  bool hasSuccessor() const { return !successors_.empty(); }
  /// Its profile has come to its end, and it rests there. end() follows.
  virtual void finish() {}
  /// Follows nothing any more.
  virtual void end();
  /// All channels that end together with this one have ended early.
  virtual void halt() {}
  /// [microsteps] Where an axis that shares motors begins a motion from rest.
  virtual double restsAt() const { return 0.0; }
  /// @}

  /// @name What its motors can do
  /// @{
  /// It moves at a speed at which a motor can't start or stop at once.
  virtual bool isFast(Nanoseconds motion_now) const;
  /// The same of its next step, by its interval.
  bool nextIsFast() const { return running_ && next_ && isFastAt(interval()); }
  /// The same of steps at this interval.
  bool isFastAt(Nanoseconds interval) const { return interval < pace_.restart_interval; }
  /// The direction of the axis at a step of the channel with its switches, whichever way the motor
  /// turns: +1, -1, or 0 if it doesn't move. @param step time of it
  virtual int directionAt(Nanoseconds step) const;
  /// [microsteps/s]
  virtual double velocityAt(Nanoseconds motion_time) const;
  /// Its steps may be late by an angle of the motor.
  bool mayBeLate() const { return pace_.late > 0.0; }
  /// Its late steps follow as closely as the chip allows, until the plan is reached: not the first
  /// step of a motion, and none across a reversal.
  bool catchesUp() const {
    return running_ && next_ && next_->direction == stepped_ && mayBeLate();
  }
  /// By how much the next step may be late by the angle of the motor, whether it speeds up or slows
  /// down. @pre catchesUp()
  Nanoseconds angleAsTime(Nanoseconds motion_now) const;
  /// How late the next step may be without putting off all that follow.
  Nanoseconds absorbed(Nanoseconds motion_now) const;
  /// By how much it is later than that if it goes out then; not above 0: it isn't.
  Nanoseconds excess(Nanoseconds motion_then) const {
    const Nanoseconds lag = motion_then - next_->time_ns;
    return lag > 0 ? lag - absorbed(motion_then) : 0;
  }
  /// How soon the next step may follow the last one, by the motor and not by the chip.
  /// @pre !catchesUp()
  Nanoseconds closest() const {
    return static_cast<Nanoseconds>(kClosest * static_cast<double>(interval()));
  }
  /// @}

 protected:
  virtual void begin(const Successors::Entry& entry);
  virtual void append(const Successors::Entry& entry);
  /// Continues with a profile: its numbers, and no step.
  void adopt(const Successors::Entry& entry);
  /// Finds the steps of its profile from the present count on.
  void seed();
  void pullNext();

  std::optional<motion::Step> next_;
  Nanoseconds since_ = 0;             // motion time of the step before, or of the profile's start
  Nanoseconds replaced_at_ = kNever;  // from there on its steps are obsolete
  std::int64_t count_ = 0;
  int stepped_ = 0;  // the direction of the last step
  bool running_ = false;
  bool settles_ = false;
  Pace pace_;
  std::uint64_t following_ = 0;
  motion::ShapedProfile profile_;
  motion::StepFinder finder_;
  Successors successors_;

 private:
  motion::ProfileSum parts_;  // the parts of a profile that is shaped

  friend class MotorSum;
};

}  // namespace stepdriver::pulse
