#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "activity.h"
#include "motion_execution.h"
#include "profile/shaped_profile.h"
#include "script.h"
#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::activity {

/// A homing: a sequence of strokes, each an ordinary move of the axis, and the actions at the end
/// of each. It is a state machine driven by the engine's news, the switch and the time.
///
/// If the axis has several motors, each with a home switch, the homing squares them: on the way to
/// the switches each motor stops at its own.
class Homing : public Activity {
 public:
  using Result = axis::Outcome<axis::HomingResult>;

  /// @param outcome where its result appears.
  Homing(Context& context, axis::AxisModel& axis, std::uint64_t id,
         std::shared_ptr<Result> outcome);

  /// Why an axis can't be homed now. @throw Refused
  static void refuseUnlessReady(const axis::AxisModel& axis);

  bool canHandOver() const override { return stroke_ != nullptr; }
  std::vector<Predecessor> handOver(const std::string& by) override;
  void hold(const SharedCall& call) override;
  void refuseUnlessResumable() const override;
  void resume(const SharedCall& call) override;
  void speedChanged(const SharedCall& call) override;
  void cancelHomings(const std::vector<std::uint64_t>& ids) override;
  pulse::Nanoseconds due() const override;
  bool watchesInputs() const override { return !isHeld(); }
  axis::HomingPhase homingPhase() const override { return phase_; }
  const MotionExecution* motion() const override { return stroke_.get(); }
  bool isHeld() const { return held_since_.has_value(); }

 protected:
  void onBegin(std::vector<Predecessor> predecessors) override;
  void onLook() override;
  void onEnd(const EarlyEnd& why, const SharedCall& call) override;
  void onAbandon(const EarlyEnd& why) override;

 private:
  void step();
  void strokeEnded();
  void rested();
  void enter(axis::HomingPhase phase);
  void goOn();
  void stroke(Goal goal);
  void settle();
  void sample();
  void settled();
  void keepLatch();
  std::optional<std::int64_t> triggerEdge() const;
  double triggerCount() const;
  void align();
  void pullOff();
  void fail(const std::string& why, axis::HomingEnd end = axis::HomingEnd::kFailed,
            const SharedCall& call = {});
  void succeed();
  void conclude(const std::string& message, bool stands);

  bool leaves() const;
  bool isClosed() const;
  bool isClosed(std::size_t side) const { return *axis_.endstopActive(side, config_.at_max); }
  int lineOf(std::size_t side) const;
  /// The first motor whose switch is closed or open, in words.
  std::string switchThatIs(bool closed) const;
  std::string timeOver() const;

  axis::AxisModel& axis_;
  const config::HomingConfig& config_;
  std::vector<std::size_t> sides_;  // the motors that have the home switch
  const bool squares_;
  const double towards_;  // 1: the count rises towards the switch; -1: it falls
  const std::string switch_;
  const pulse::Nanoseconds debounce_;
  const std::uint64_t id_;
  const std::shared_ptr<Result> outcome_;

  axis::HomingPhase phase_ = axis::HomingPhase::kNone;
  axis::HomingResult result_;
  std::string failure_;
  pulse::Nanoseconds deadline_ = 0;
  std::optional<pulse::Nanoseconds> held_since_;

  Steps waking_;
  std::unique_ptr<MotionExecution> stroke_;  // under way
  std::int64_t bound_ = 0;  // the joint's count at which the strokes of this phase must end
  bool slowing_ = false;    // the switch has opened
  pulse::Nanoseconds phase_began_ = 0;

  // While the switch settles.
  bool settling_ = false;
  bool closed_ = false;
  pulse::Nanoseconds settle_began_ = 0;
  pulse::Nanoseconds steady_since_ = 0;

  // The motion of the latch, and how it ended.
  std::optional<motion::PlannedMotion> latch_;
  pulse::ChannelState latched_;
  pulse::Nanoseconds slipped_before_ = 0;
  pulse::Nanoseconds slipped_ = 0;
  double trigger_ = 0.0;  // [microsteps] the joint's position

  // Only for motors that are made square.
  std::vector<std::size_t> to_align_;  // those that still have to move alone
  std::int64_t skew_ = 0;              // [microsteps] the skew that this homing has made up
};

}  // namespace stepdriver::activity
