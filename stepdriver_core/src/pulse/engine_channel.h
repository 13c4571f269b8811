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
  Nanoseconds time = 0;  ///< by which it had happened
};

/// Channels that depend on each other: that of an axis with motors of its own, alone, or those of
/// axes that share motors, and of these motors.
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

  std::vector<EngineChannel*> axes;  ///< what objects to a step, or ends, is theirs
  std::vector<EngineChannel*> all;   ///< a step of one may be what another one waits for
  bool guarded = false;              ///< an axis has an input that may object to a step
  bool ends = false;                 ///< they are being ended
  std::size_t open = 0;              ///< steps that a port with a horizon has, and hasn't played
  bool drains = false;               ///< they have ended early, and steps are still open
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
        lane(port_lane) {}
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

  /// Until the last open step of a motion that has ended is over, only its steps are told.
  void publish() { kin->drains ? published.storeFirst<kStepBytes>(state) : published.store(state); }
  void follow(const Follow& order);
  void release(const Command& command);
  /// Another profile is followed.
  void adopted();
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

  std::uint64_t group = 0;      // the last order's; 0: no group
  bool slows = false;           // the last order brings it to rest
  bool changed = false;         // it must be scheduled
  Nanoseconds fast_until = -1;  // time of the last step that was put at a speed that nextIsFast()
  Nanoseconds late = 0;         // how late the next step is so far
  Nanoseconds behind = 0;       // overdue() of the last step when its write had ended
  Snapshot<ChannelState> published;

 private:
  void takeUp(double of_backlash);
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
