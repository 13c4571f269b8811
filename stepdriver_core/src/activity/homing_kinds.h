#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "homing.h"
#include "switch_settling.h"

namespace stepdriver::activity {

/// A homing to an endstop: it approaches the switch, backs off, and latches slowly. The trigger
/// point is where the switch closes then.
///
/// If the axis has several motors, each with a home switch, the homing squares them: on the way to
/// the switches each motor stops at its own.
class HomingToLimit final : public Homing {
 public:
  HomingToLimit(Context& context, axis::AxisModel& axis, std::uint64_t id,
                std::shared_ptr<Result> outcome);

 protected:
  void start() override;
  void strokeEnded() override;
  void look(bool stroke_has_ended) override;
  pulse::Nanoseconds lookDue() const override;
  std::string unmet() const override;

 private:
  void reachedEnd();
  void seek(axis::HomingPhase phase);
  void goOn();
  void settle();
  void sample();
  void settled(bool closed);
  void keepLatch();
  std::optional<std::int64_t> triggerEdge() const;
  double triggerCount() const;
  void align();

  bool leaves() const;
  bool isClosed() const;
  bool isClosed(std::size_t side) const { return *axis_.endstopActive(side, config_.at_max); }
  int lineOf(std::size_t side) const;
  /// The first motor whose switch is closed or open, in words.
  std::string switchThatIs(bool closed) const;

  std::vector<std::size_t> sides_;  // the motors that have the home switch
  const bool squares_;
  const std::string switch_;
  const pulse::Nanoseconds debounce_;

  bool slowing_ = false;  // the switch has opened
  std::optional<SwitchSettling> settling_;

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

/// A homing to a block: the axis moves until an input reports that its motor stands still. With a
/// second approach it backs off, and comes back slowly.
class HomingToBlock final : public Homing {
 public:
  HomingToBlock(Context& context, axis::AxisModel& axis, std::uint64_t id,
                std::shared_ptr<Result> outcome)
      : Homing(context, axis, id, std::move(outcome)) {}

 protected:
  void start() override;
  void strokeEnded() override;
  void look(bool /*stroke_has_ended*/) override {}
  std::string unmet() const override;

 private:
  void approach(axis::HomingPhase phase);
  void backOff();
  void notBlocked();
  bool reports() const;
  /// What reports the block, in words.
  std::string sensor() const;

  double trigger_ = 0.0;  // [microsteps] of the joint, by the last approach
};

/// A homing to a stall, which the driver chip detects (StallGuard): with a current and a threshold
/// of its own, at one speed, and armed only while the speed is constant. It approaches until two
/// approaches in a row end at the same place. The chip's registers are as before for the last move.
class HomingToStall final : public Homing {
 public:
  HomingToStall(Context& context, axis::AxisModel& axis, std::uint64_t id,
                std::shared_ptr<Result> outcome);

  void speedChanged(const SharedCall& call) override;

 protected:
  void start() override;
  void strokeEnded() override;
  void look(bool stroke_has_ended) override;
  pulse::Nanoseconds lookDue() const override;
  std::string unmet() const override;

 private:
  enum class Waits { kNothing, kPrepared, kArmed, kLoad, kDisarmed, kBackedOff, kEnded };

  /// Why it can't come to its speed; empty if it can.
  std::string limitedSpeed() const;
  void post(bus::RegisterJob job, Waits waits);
  void take(const bus::RegisterDone& done);
  void approach();
  void backOff();
  void watch();
  void noteLoad(std::uint32_t load);
  void disarmed(int mscnt);
  void compare();
  std::string shiftText() const;
  bool isApproach() const {
    return phase() == axis::HomingPhase::kSeeking || phase() == axis::HomingPhase::kLatching;
  }
  bool isAtSpeed() const;
  bool hasDiag() const { return axis_.config.fault.has_value(); }
  double fullStep() const;  // [microsteps]

  motor::TmcChip& chip_;
  const config::StallConfig stall_;
  Waits waits_ = Waits::kNothing;
  std::uint64_t job_ = 0;
  motor::StepAudit audit_;  // tells in which direction MSCNT counts on the way to the stall
  pulse::Nanoseconds at_speed_since_ = pulse::kNever;
  pulse::Nanoseconds look_at_ = pulse::kNever;
  bool armed_ = false;
  int approaches_ = 0;
  std::optional<double> before_;  // [microsteps] the joint's place at the stall before the last one
  double trigger_ = 0.0;          // the same at the last one
  int mscnt_ = 0;                 // there
};

/// A homing without a motion: the axis is declared to stand at the trigger point.
class HomingInPlace final : public Homing {
 public:
  HomingInPlace(Context& context, axis::AxisModel& axis, std::uint64_t id,
                std::shared_ptr<Result> outcome)
      : Homing(context, axis, id, std::move(outcome)) {}

 protected:
  void start() override { succeed(axis_.exactCount()); }
  void strokeEnded() override {}
  void look(bool /*stroke_has_ended*/) override {}
  std::string unmet() const override { return "it didn't come to its end"; }
};

}  // namespace stepdriver::activity
