#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "guard/axis_guard.h"
#include "port/step_port.h"
#include "pulse/command.h"
#include "pulse/snapshot.h"
#include "timeline/follower.h"
#include "timeline/motor_sum.h"

namespace stepdriver::pulse {

struct EngineChannel;

/// A step that has gone out.
struct PlayedStep {
  int direction = 0;
  MotorSet still = 0;    ///< motors that didn't take part
  Nanoseconds time = 0;  ///< The step had gone out by this clock time.
};

/// Channels that depend on each other. An axis with motors of its own has one channel, alone. Axes
/// that share motors have theirs together with the channels of these motors.
class Kin {
 public:
  Kin() = default;
  virtual ~Kin() = default;
  Kin(const Kin&) = delete;
  Kin& operator=(const Kin&) = delete;

  /// A step of a channel has gone out: tells the places of the axes.
  virtual void stepped(EngineChannel& channel, const PlayedStep& step);
  /// All axes have ended early: tells their places.
  virtual void halted() {}

  bool follows() const;     ///< an axis follows a profile
  bool isRunning() const;   ///< such a motion has made a step
  bool isReserved() const;  ///< the pins of a chip are being written
  bool isBusy() const;      ///< a pulse is out, or a step is open
  /// The axis whose chip has the motor of a channel. For the channel of an axis it is this axis.
  EngineChannel* axisOf(EngineChannel& channel);
  /// The channel of the motor that has the chip of an axis.
  EngineChannel& motorOf(EngineChannel& axis);

  std::vector<EngineChannel*> axes;  ///< what objects to a step, or ends, is theirs
  std::vector<EngineChannel*> all;   ///< a step of one may be what another one waits for
  bool guarded = false;              ///< an axis has an input that may object to a step
  bool ends = false;                 ///< they are being ended
  std::size_t open = 0;              ///< steps that a port with a horizon has, and hasn't played
  bool drains = false;               ///< they have ended early, and steps are still open
  bool unmade = false;  ///< They have ended before a step that was planned (with a horizon only).
};

/// The pulse thread's state of one channel: what comes next on it (timeline), whether that may go
/// out (guard), what the port has made of it, and what others may know.
struct EngineChannel {
  EngineChannel(std::size_t number, const ChannelConfig& channel_config, Follower& follower,
                WatchedLines& lines, const StepPort::Lane& port_lane)
      : index(number),
        config(channel_config),
        motion(&follower),
        guard(config, state, lines),
        lane(port_lane) {
    published.store(state);
  }
  EngineChannel(const EngineChannel&) = delete;
  EngineChannel& operator=(const EngineChannel&) = delete;

  /// The port accepts its next step.
  bool canStep() const {
    const auto& next = motion->next();
    return next && lane.accepts(next->direction);
  }
  /// Nothing is left to be done before the end of its profile.
  bool canFinish() const { return !lane.busy && !motion->next() && motion->follows(); }

  /// How much longer than planned it is since the last step, if the motor can't stop or start at
  /// once between them; otherwise 0.
  Nanoseconds overdue(Nanoseconds now) const {
    return motion->nextIsFast() ? now - lane.last - motion->interval() : 0;
  }

  /// [microsteps] Where the joint is by its steps, or has come to rest.
  /// @param done its motion has come to its end
  double joint(bool done) const {
    if (kin->all.size() == 1) return static_cast<double>(state.count - state.slack);
    return done ? motion->restsAt() : static_cast<double>(state.count) + state.between;
  }
  /// [microsteps] The same at rest.
  double jointRests() const { return joint(true); }

  /// Until the last open step of a motion that has ended is over, only its steps are told.
  void publish() { kin->drains ? published.storeFirst<kStepBytes>(state) : published.store(state); }
  /// @param now clock time.
  void follow(const Follow& order, Nanoseconds now);
  void release(const Command& command);
  /// Another profile is followed. @param told whether to say so at once: the steps of the one
  ///   before it have been played.
  void adopted(bool told);
  /// A step has gone out. @pre The axis has motors of its own.
  void publishStep(const PlayedStep& step);
  void endMotion(EndReason reason, bool abrupt, Nanoseconds motion_now);

  const std::size_t index;
  ChannelConfig config;
  ChannelState state;
  Follower* motion;
  AxisGuard guard;
  const StepPort::Lane& lane;
  Kin* kin = nullptr;
  EngineChannel* next_of_kin = this;  // a ring through all of them

  std::uint64_t group = 0;  // the last order's group; 0: no group
  bool slows = false;       // the last order brings it to rest
  bool arrives = false;     // the last order leads to a target
  bool changed = false;     // it must be scheduled
  Nanoseconds at = 0;       // clock time of the next step
  Nanoseconds late = 0;     // how late the next step is so far
  Nanoseconds behind = 0;   // overdue() of the last step when its write had ended
  Snapshot<ChannelState> published;

  /// @name With a port that has a horizon
  /// @{
  /// Notes which steps must be over before its profile has ended, once the timeline has made them.
  void noteLastSteps();
  void reserve() {
    last_steps_.reserve(kin->all.size());
    untold_.reserve(kMostUntold);
  }
  /// The steps that noteLastSteps() noted are over.
  bool isPlayed() const;
  /// When the next profile begins that is followed and hasn't been told; kNever: there is none.
  Nanoseconds tellAt() const { return untold_.empty() ? kNever : untold_.front().start; }
  /// Tells which profile is played at a motion time.
  void tell(Nanoseconds motion_now);

  std::uint64_t put = 0;   // counts the steps that were handed over
  std::uint64_t over = 0;  // counts those of them that were played or given back
  bool is_fast = false;    // The motor can't stop at once after the last step that was played.
  /// Its motion has ended early, and steps of its kin are still open.
  bool ended_early = false;
  /// @}

 private:
  void takeUp(double of_backlash);

  struct Untold {
    std::uint64_t serial = 0;
    Nanoseconds start = 0;  // motion time
  };
  // One a millisecond for the longest horizon that is to be expected. If there are more, the oldest
  // ones are told too early.
  static constexpr std::size_t kMostUntold = 64;

  std::vector<std::uint64_t> last_steps_;  // EngineChannel::put of its kin's channels, or empty
  std::vector<Untold> untold_;             // in the order of their starts
};

/// The channels of axes that share motors, and of these motors.
class SumKin final : public Kin {
 public:
  explicit SumKin(const SharedAxes& shared) : sum(shared.matrix, shared.inverse) {}

  void stepped(EngineChannel& channel, const PlayedStep& step) override;
  void halted() override;

  MotorSum sum;
};

}  // namespace stepdriver::pulse
