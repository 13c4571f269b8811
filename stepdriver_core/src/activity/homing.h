#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "activity.h"
#include "motion_execution.h"
#include "script.h"
#include "stepdriver_core/axis/axis.h"

namespace stepdriver::activity {

/// A homing: a sequence of strokes, each an ordinary move of the axis, and the actions at the end
/// of each. It is a state machine driven by the engine's news, the inputs and the time. Each kind
/// of homing (config::HomingKind) finds its trigger point in a way of its own; what ends or stops a
/// homing is the same for all of them.
class Homing : public Activity {
 public:
  using Result = axis::Outcome<axis::HomingResult>;

  /// The homing of an axis, of its configured kind.
  ///
  /// @param outcome where its result appears.
  static std::unique_ptr<Homing> make(Context& context, axis::AxisModel& axis, std::uint64_t id,
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
  Homing(Context& context, axis::AxisModel& axis, std::uint64_t id,
         std::shared_ptr<Result> outcome);

  void onBegin(std::vector<Predecessor> predecessors) override;
  void onLook() override;
  void onEnd(const EarlyEnd& why, const SharedCall& call) override;
  void onAbandon(const EarlyEnd& why) override;

  /// @name What a kind of homing does. All may throw an Error, which makes the homing fail.
  /// @{
  /// The motor is ready. It begins its first phase.
  virtual void start() = 0;
  /// A stroke has ended, other than by a fault or before it began.
  virtual void strokeEnded() = 0;
  /// Something may have happened, also while the homing is held.
  virtual void observe() {}
  /// Something may have happened in a stroke, or in a pause between two.
  virtual void look(bool /*stroke_has_ended*/) = 0;
  /// Clock time by which look() must be called.
  virtual pulse::Nanoseconds lookDue() const { return pulse::kNever; }
  /// What hasn't happened yet in this phase: "the min switch didn't close".
  virtual std::string unmet() const = 0;
  /// @}

  /// Begins a phase, whose strokes must end within max_travel. @param direction 1 or -1
  void enter(axis::HomingPhase phase, double direction);
  axis::HomingPhase phase() const { return phase_; }
  /// The axis was homed when this homing began.
  bool wasHomed() const { return was_homed_; }
  /// The joint's count at which the strokes of this phase must end.
  std::int64_t bound() const { return bound_; }
  /// Clock time.
  pulse::Nanoseconds phaseBegan() const { return phase_began_; }
  void begin(Goal goal);
  MotionExecution* stroke() { return stroke_.get(); }
  void endStroke() { stroke_.reset(); }
  /// The last move: from the trigger point to the final position. @param trigger [microsteps of the
  ///   joint]
  void pullOff(double trigger, const MotorsTogether& motors = {});
  void fail(const std::string& why, axis::HomingEnd end = axis::HomingEnd::kFailed,
            const SharedCall& call = {});
  /// The same at once, if the axis is at rest.
  void failNow(const std::string& why);
  /// @param skew [unit] see axis::HomingResult
  /// @param remark continues "x is homed"; may be empty.
  void succeed(double trigger, double skew = 0.0, const std::string& remark = "");

  axis::AxisModel& axis_;
  const config::HomingConfig& config_;
  const double towards_;  // 1: the count rises towards the trigger point; -1: it falls

 private:
  void step();
  void conclude(const std::string& message, bool stands);
  std::string timeOver() const;

  const std::uint64_t id_;
  const std::shared_ptr<Result> outcome_;

  axis::HomingPhase phase_ = axis::HomingPhase::kNone;
  axis::HomingResult result_;
  std::string failure_;
  pulse::Nanoseconds deadline_ = 0;
  std::optional<pulse::Nanoseconds> held_since_;
  Steps waking_;
  std::unique_ptr<MotionExecution> stroke_;  // under way
  std::int64_t bound_ = 0;
  pulse::Nanoseconds phase_began_ = 0;
  bool was_homed_ = false;
  bool presses_ = false;  // a stroke was against a block, where the motor loses steps
};

}  // namespace stepdriver::activity
