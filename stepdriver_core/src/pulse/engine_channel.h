#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>

#include "motion/step_finder.h"
#include "pulse/channel.h"
#include "pulse/command.h"
#include "pulse/snapshot.h"
#include "successors.h"

namespace stepdriver::pulse {

/// What the pulse thread knows of one channel: the motion that it follows, and its last edges.
struct EngineChannel {
  /// What it does when it is due.
  enum class Action { kNothing, kFall, kTurn, kRise, kFinish };

  Action action() const {
    if (high) return Action::kFall;
    if (next) return next->direction == direction ? Action::kRise : Action::kTurn;
    return profile != nullptr ? Action::kFinish : Action::kNothing;
  }

  /// Of the plan, between the last step and the next one. @pre There is a next one.
  Nanoseconds interval() const { return next->time_ns - last_planned; }

  /// It moves at a speed that the motor can't start from or stop at at once.
  bool isFast() const { return running && next && interval() < restart_interval; }

  /// The step that comes next, if any, is none any more: it would come when the first successor
  /// has begun.
  bool isSucceeded() const {
    return !successors.empty() && (!next || next->time_ns >= successors.first().profile->startNs());
  }

  /// Serial of the profile that the next one has to go on from; 0: it is at rest.
  std::uint64_t latest() const {
    return successors.empty() ? state.following : successors.last().serial;
  }

  void publish() { published.store(state); }
  void pullNext();
  void adopt(const motion::Profile& followed, std::uint64_t serial);
  void follow(const Follow& order);
  /// @return whether it can: it is at rest, and nobody has reserved it.
  bool reserve();
  void release(const Command& command);
  /// A pulse has gone out.
  void countStep();
  void endMotion(EndReason reason, Nanoseconds motion_now);

  std::size_t index = 0;
  bool high = false;       // the pulse is out
  bool running = false;    // the motion under way has made a step
  bool changed = false;    // it is to be scheduled
  bool faulty = false;     // as the fault line read last
  bool unchecked = false;  // its fault line is to be read before the next step
  bool reserved = false;   // somebody writes the chip's other pins
  int direction = -1;      // as the DIR line has it
  std::optional<motion::Step> next;
  Nanoseconds last_planned = 0;  // motion time of the step before, or of the profile's start
  Nanoseconds late = 0;          // of the next step, as far as it is by now

  // Clock times by which the last edges had happened.
  Nanoseconds rose = 0;
  Nanoseconds fell = 0;
  Nanoseconds turned = 0;

  const motion::Profile* profile = nullptr;  // the one that is followed
  std::uint64_t group = 0;                   // of the order that came last; 0: alone
  Nanoseconds restart_interval = 0;
  ChannelState state;
  Snapshot<ChannelState> published;
  motion::StepFinder finder;
  ChannelConfig config;
  Successors successors;
};

}  // namespace stepdriver::pulse
