#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "profile/profile_sum.h"
#include "profile/shaped_profile.h"
#include "profile/step_finder.h"
#include "pulse/channel.h"
#include "pulse/command.h"
#include "pulse/snapshot.h"
#include "successors.h"

namespace stepdriver::pulse {

class SharedMotors;

/// The pulse thread's state of one channel: the motion that it follows, and its last edges.
struct EngineChannel {
  /// What to do when the channel is due.
  enum class Action { kNothing, kFall, kTurn, kRise, kFinish };

  Action action() const {
    if (high) return Action::kFall;
    if (next) return next->direction == direction ? Action::kRise : Action::kTurn;
    return follows() ? Action::kFinish : Action::kNothing;
  }

  bool follows() const { return static_cast<bool>(profile); }

  /// The planned interval between the last step and the next one. @pre There is a next one.
  Nanoseconds interval() const { return next->time_ns - last_planned; }

  /// How much longer than planned it is since the last step, if the motor can't stop or start at
  /// once between them; otherwise 0.
  Nanoseconds overdue(Nanoseconds now) const {
    if (!running || !next || interval() >= restartInterval()) return 0;
    return now - rose - interval();
  }

  /// It moves at a speed at which the motor can't start or stop at once.
  bool isFast() const { return running && next && interval() < restart_interval; }

  /// Its late steps follow as closely as the chip allows, until the plan is reached: not the first
  /// step of a motion, and none across a reversal.
  bool catchesUp() const {
    return running && next && next->direction == stepped && config.late_steps > 0.0 &&
           fullStep() > 0;
  }
  /// By how much the next step may be late by the angle of the motor, whether it speeds up or slows
  /// down. @pre catchesUp()
  Nanoseconds angleAsTime(Nanoseconds motion_now) const;

  /// Steps with this interval or a longer one can begin and end at once.
  Nanoseconds restartInterval() const;
  /// [microsteps] See Follow::full_step.
  int fullStep() const;

  /// The next step is obsolete: it would come after the first successor has begun.
  bool isSucceeded() const {
    return !successors.empty() && shared == nullptr &&
           (!next || next->time_ns >= successors.first().profile.startNs());
  }

  /// Serial of the profile that the next one must continue; 0: the channel is at rest.
  std::uint64_t latest() const {
    return successors.empty() ? state.following : successors.last().serial;
  }

  /// Motion time before which its steps have been made, and no profile may begin.
  Nanoseconds madeUntil() const;
  /// Its motion has made a step, or that of an axis that shares its motors.
  bool isRunning() const;
  /// The pins of its chip are being written, or of one that it shares.
  bool isReserved() const;

  bool isAlone() const { return all_motors == 1; }
  std::size_t motors() const { return 1 + config.twins.size(); }
  const MotorSignals& motor(std::size_t number) const {
    return number == 0 ? config : config.twins[number - 1];
  }
  bool isStill(std::size_t number) const { return (state.still & motorBit(number)) != 0; }
  /// Whether any motor's signals have this one.
  bool has(std::optional<Signal> MotorSignals::*signal) const;
  /// [microsteps] How far apart the motors are, since they were square.
  /// @param step_direction of a step that would be made before; 0: none.
  std::int64_t skewAfter(int step_direction) const;
  /// The next step would get them farther apart than they may be.
  bool wouldSkew() const {
    const std::int64_t after = skewAfter(next->direction);
    return after > config.max_skew && after > skewAfter(0);
  }

  /// A motor's line of pulses in a direction.
  const Signal& stepOf(std::size_t number, int forward) const {
    const MotorSignals& signals = motor(number);
    return config.dir_steps && forward < 0 ? signals.dir : signals.step;
  }

  void publish() { published.store(state); }
  void pullNext();
  void adopt(const Successors::Entry& followed);
  void follow(const Follow& order);
  /// @return whether it could be reserved: it is at rest, and not reserved yet.
  bool reserve();
  void release(const Command& command);
  /// @param of_backlash [microsteps] is taken up now, of that which there is.
  void takeUp(double of_backlash);
  /// A pulse has gone out.
  void countStep();
  void endMotion(EndReason reason, Nanoseconds motion_now);

  std::size_t index = 0;
  SharedMotors* shared = nullptr;  // of an axis that shares motors, or of such a motor
  bool drives = false;             // it is such a motor
  bool high = false;               // the pulse is out; never so if both edges are steps
  MotorSet all_motors = 1;         // 1: the axis has one motor
  MotorSet pulsed = 1;             // the motors that took part in the last edge
  MotorSet toggled = 0;  // both edges are steps, and these motors' lines are at their active level
  bool squares = false;  // the current motion does
  bool running = false;  // the current motion has made a step
  bool slows = false;    // the last order brings it to rest
  bool changed = false;  // it must be scheduled
  MotorSet faulty = 0;   // by the last readings of the fault lines
  bool unchecked = false;  // its fault line must be read before the next step
  bool reserved = false;   // the chip's other pins are being written
  int stepped = 0;         // the direction of the last step
  int direction = -1;      // the direction on the DIR line, or of pulse_line
  Signal pulse_line;       // the first motor's line of steps in that direction
  std::optional<motion::Step> next;
  Nanoseconds last_planned = 0;  // motion time of the step before, or of the profile's start
  Nanoseconds late = 0;          // of the next step, so far
  Nanoseconds behind = 0;        // overdue() of the last step when its write had ended

  // Clock times at which the writes of the last edges had ended.
  Nanoseconds rose = 0;
  Nanoseconds fell = 0;
  Nanoseconds turned = 0;

  // At the end of a profile that settles: it waits for the in-position output, from this clock time
  // on, and looks again at the other one.
  bool settles = false;
  bool settling = false;
  Nanoseconds settling_since = 0;
  Nanoseconds look_at = 0;

  motion::ShapedProfile profile;  // the one that is followed
  std::uint64_t group = 0;        // of the last order; 0: no group
  Nanoseconds restart_interval = 0;
  int full_step = 0;          // of the last order
  MotorCounts square_lags{};  // ChannelState::lags when it was square
  ChannelState state;
  Snapshot<ChannelState> published;
  motion::StepFinder finder;
  ChannelConfig config;
  Successors successors;
  motion::ProfileSum parts;  // of a profile that is shaped
};

}  // namespace stepdriver::pulse
