#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "activity.h"
#include "manoeuvre.h"
#include "motion/profile.h"
#include "script.h"
#include "stepdriver_core/axis/axis_state.h"

namespace stepdriver::activity {

/// A homing: a sequence of strokes, each an ordinary move of the axis, and the actions at the end
/// of each. It is a state machine driven by the engine's news, the switch and the time.
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
  void hold(const Ack& call) override;
  void refuseUnlessResumable() const override;
  void resume(const Ack& call) override;
  void speedChanged(const Ack& call) override;
  void cancelHomings(const std::vector<std::uint64_t>& ids) override;
  pulse::Nanoseconds due() const override;
  bool watchesInputs() const override { return !isHeld(); }
  axis::HomingPhase homingPhase() const override { return phase_; }
  const Manoeuvre* motion() const override { return stroke_.get(); }
  bool isHeld() const { return held_since_.has_value(); }

 protected:
  void onBegin(std::vector<Predecessor> predecessors) override;
  void onLook() override;
  void onEnd(const Why& why, const Ack& call) override;
  void onAbandon(const Why& why) override;

 private:
  void step();
  void strokeEnded();
  void rested();
  void enter(axis::HomingPhase phase);
  void goOn();
  void stroke(std::int64_t target, double speed);
  void settle();
  void sample();
  void settled();
  void keepLatch();
  std::optional<std::int64_t> triggerEdge() const;
  double triggerCount() const;
  void pullOff();
  void fail(const std::string& why, axis::HomingEnd end = axis::HomingEnd::kFailed,
            const Ack& call = {});
  void succeed();
  void conclude(const std::string& message, bool stands);

  bool leaves() const;
  bool isClosed() const { return *axis_.endstopActive(line_, endstop_); }
  std::string timeOver() const;

  axis::AxisModel& axis_;
  const config::HomingConfig& config_;
  const std::optional<config::Endstop>& endstop_;
  const int line_;
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
  std::unique_ptr<Manoeuvre> stroke_;  // under way
  std::int64_t bound_ = 0;  // the joint's count at which the strokes of this phase must end
  bool slowing_ = false;    // the switch has opened
  pulse::Nanoseconds phase_began_ = 0;

  // While the switch settles.
  bool settling_ = false;
  bool closed_ = false;
  pulse::Nanoseconds settle_began_ = 0;
  pulse::Nanoseconds steady_since_ = 0;

  // The profile of the latch, and how it ended.
  std::shared_ptr<const motion::Profile> latch_profile_;
  pulse::ChannelState latched_;
  pulse::Nanoseconds slipped_before_ = 0;
  pulse::Nanoseconds slipped_ = 0;
  double trigger_ = 0.0;  // [microsteps] of the joint
};

}  // namespace stepdriver::activity
