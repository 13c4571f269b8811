#pragma once

#include <cstddef>
#include <memory>
#include <optional>

#include "axis/axis_memory.h"
#include "script.h"
#include "steps.h"

/// Activities on the pins of a driver chip.
namespace stepdriver::activity {

/// A sequence of pins, which is always completed.
class PinScript : public Script {
 public:
  PinScript(Context& context, axis::AxisModel& axis, SharedCall call)
      : Script(context, {&axis}, Handover::kAfterRest, std::move(call)) {}
  Work work() const override { return Work::kWritesPins; }

 protected:
  void onEnd(const EarlyEnd& /*why*/, const SharedCall& /*call*/) override {}
  bool endsBeforeItBegins() const override { return false; }
};

/// Wakes a chip, ends its reset, and enables it if the configuration says so.
class BringUp : public PinScript {
 public:
  using PinScript::PinScript;

 protected:
  Steps plan() override;
};

/// Energizes the motor.
class Enable : public PinScript {
 public:
  using PinScript::PinScript;

 protected:
  Steps plan() override;
};

/// Wakes a motor that is idle, because a motion of its axis begins soon.
class WakeUp : public Enable {
 public:
  using Enable::Enable;
  bool isInBackground() const override { return true; }
};

/// Switches the motor's current off when the axis has come to rest.
class Disable : public PinScript {
 public:
  using PinScript::PinScript;
  Work work() const override { return Work::kDisables; }
  bool joinDisable(const SharedCall& call) override {
    joined_.push_back(call);
    return true;
  }

 protected:
  Steps plan() override;

 private:
  std::vector<SharedCall> joined_;
};

/// Puts the chip to sleep, or wakes it.
class Sleep : public PinScript {
 public:
  Sleep(Context& context, axis::AxisModel& axis, bool asleep, SharedCall call)
      : PinScript(context, axis, std::move(call)), asleep_(asleep) {}

 protected:
  Steps plan() override;

 private:
  const bool asleep_;
};

/// Pulses RESET.
class Reset : public PinScript {
 public:
  using PinScript::PinScript;

 protected:
  Steps plan() override;
};

/// Switches off the current of a motor that has been at rest for its idle timeout.
class GoIdle : public PinScript {
 public:
  GoIdle(Context& context, axis::AxisModel& axis) : PinScript(context, axis, nullptr) {}
  bool isInBackground() const override { return true; }

 protected:
  Steps plan() override;
};

/// Engages the brake. Without a call it is in the background: the axis is at fault.
class EngageBrake : public PinScript {
 public:
  EngageBrake(Context& context, axis::AxisModel& axis, SharedCall call)
      : PinScript(context, axis, std::move(call)), is_in_background_(this->call() == nullptr) {}
  bool isInBackground() const override { return is_in_background_; }

 protected:
  Steps plan() override { return engageSteps(context(), *axes().front()); }

 private:
  const bool is_in_background_;
};

/// Ends a fault: restores the pins if a write had failed, and ends the fault that a driver reports
/// as DriverChip::fault_end says.
class Recover : public PinScript {
 public:
  using PinScript::PinScript;
  bool watchesInputs() const override { return true; }

 protected:
  Steps plan() override;

 private:
  Steps setUpChips();
  Steps endFaultsOfDrivers();
  Steps switchOffAndOn(std::size_t faulty);
  std::string whyItStays(std::size_t faulty) const;
  /// The first motor from one on whose driver reports a fault; empty: none, or none can.
  std::optional<std::size_t> faultyFrom(std::size_t motor) const;
  void clearFault();
};

/// Changes the microstep mode and keeps the position; moves to the nearest common position first if
/// there is none here.
class ChangeMicrosteps : public Script {
 public:
  ChangeMicrosteps(Context& context, axis::AxisModel& axis, int wanted, SharedCall call)
      : Script(context, {&axis}, Handover::kAfterRest, std::move(call)), wanted_(wanted) {}
  Work work() const override { return Work::kChangesMicrosteps; }

 protected:
  Steps plan() override;

 private:
  PinsStep::Writes writes();
  const int wanted_;
};

/// Restores the position of an earlier run. An empty doubt says that it can be trusted.
class RestorePosition : public PinScript {
 public:
  RestorePosition(Context& context, axis::AxisModel& axis, const axis::AxisMemory& kept,
                  std::string doubt, SharedCall call)
      : PinScript(context, axis, std::move(call)), kept_(kept), doubt_(std::move(doubt)) {}

 protected:
  Steps plan() override;

 private:
  const axis::AxisMemory kept_;
  const std::string doubt_;
};

}  // namespace stepdriver::activity
