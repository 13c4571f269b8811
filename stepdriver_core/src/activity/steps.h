#pragma once

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <utility>

#include "context.h"
#include "motor/pin_sequence.h"
#include "script.h"

namespace stepdriver::activity {

/// Does something at once.
class RunStep : public Step {
 public:
  explicit RunStep(std::function<void()> action) : action_(std::move(action)) {}
  bool poll() override {
    action_();
    return true;
  }

 private:
  std::function<void()> action_;
};

/// Waits for a clock time.
class WaitStep : public Step {
 public:
  /// @param until called when the step begins. @param earlier ends the wait when it returns true.
  WaitStep(const Context& context, std::function<pulse::Nanoseconds()> until,
           std::function<bool()> earlier = {})
      : context_(context), until_(std::move(until)), earlier_(std::move(earlier)) {}
  void begin() override { due_ = until_(); }
  bool poll() override { return context_.now >= due_ || (earlier_ && earlier_()); }
  pulse::Nanoseconds due() const override { return due_; }

 private:
  const Context& context_;
  std::function<pulse::Nanoseconds()> until_;
  std::function<bool()> earlier_;
  pulse::Nanoseconds due_ = 0;
};

/// Writes pins of one driver chip, at rest, one after the other, each with the time that the chip
/// needs after it. The engine has the channel reserved meanwhile. Axes that share its motors come
/// to rest before.
class PinsStep : public Step {
 public:
  /// The writes.
  struct Writes {
    motor::PinSequence sequence;
    /// The position of the motor afterwards, in a new mode.
    std::optional<pulse::Command::Scale> scale;
    /// The registers of its chip, after the pins.
    std::optional<bus::RegisterJob> registers;
    /// Takes the answers to them. @return why they failed; empty: they are right.
    std::function<std::string(const bus::RegisterDone&)> take;
    std::function<void()> then;    ///< called when everything is written
    std::function<void()> failed;  ///< called if a line could not be written
  };
  /// @param writes called when the step begins.
  PinsStep(Context& context, axis::AxisModel& axis, std::function<Writes()> writes)
      : context_(context), axis_(axis), build_(std::move(writes)) {}

  void begin() override;
  bool poll() override;
  pulse::Nanoseconds due() const override {
    return phase_ == Phase::kWaiting ? due_ : pulse::kNever;
  }

 private:
  enum class Phase { kAwaitingRest, kReserving, kWaiting, kWriting, kAccessing, kReleasing };

  bool sharersMove() const;

  void post(pulse::Command::Kind kind);
  void writeNext();
  void beginRegisters();
  void fail(int error);
  void failRegisters(const std::string& why);

  Context& context_;
  axis::AxisModel& axis_;
  std::function<Writes()> build_;
  Writes writes_;
  Phase phase_ = Phase::kAwaitingRest;
  std::size_t next_ = 0;
  std::uint64_t serial_ = 0;
  std::uint64_t job_ = 0;
  pulse::Nanoseconds due_ = 0;
};

/// Writes all registers of the chips of an axis that have a serial port, each verified, and learns
/// the place of each chip in the electrical cycle. The outputs of a chip are off meanwhile.
class SetUpChipsStep : public Step {
 public:
  enum class Which {
    kAll,
    kNotSetUp,  ///< those that haven't got theirs
    kFaulty,    ///< the same, and those that report a fault when they are asked
  };
  /// @param failed called at the end if a chip isn't ready, with its fault and its remedy.
  using Failed = std::function<void(const std::string& fault, const std::string& remedy)>;
  SetUpChipsStep(Context& context, axis::AxisModel& axis, Which which, Failed failed)
      : context_(context), axis_(axis), which_(which), failed_(std::move(failed)) {}

  void begin() override;
  bool poll() override;

 private:
  struct Open {
    std::size_t motor = 0;
    bool asks = false;  // whether the chip has a fault; otherwise it is set up
  };
  void post(const Open& open);
  void take(const Open& open, const bus::RegisterDone& done);

  Context& context_;
  axis::AxisModel& axis_;
  const Which which_;
  const Failed failed_;
  std::map<std::uint64_t, Open> open_;  // by job
  std::string fault_;
  std::string remedy_;
};

/// What the two steps below have in common.
class BrakeStep : public Step {
 public:
  BrakeStep(Context& context, axis::AxisModel& axis) : context_(context), axis_(axis) {}

 protected:
  Context& context_;
  axis::AxisModel& axis_;
  std::unique_ptr<Step> writing_;  // writes the brake's line; nullptr: it isn't being written
};

/// Engages the brake of an axis, and waits until it holds the load.
class EngageBrakeStep : public BrakeStep {
 public:
  using BrakeStep::BrakeStep;
  void begin() override;
  bool poll() override;
  pulse::Nanoseconds due() const override;
};

/// If the motor of an axis holds the load: waits for the times of its chip, releases the brake, and
/// waits until the motor can turn. A fault ends the waiting.
class ReleaseBrakeStep : public BrakeStep {
 public:
  using BrakeStep::BrakeStep;
  bool poll() override;
  pulse::Nanoseconds due() const override;
};

/// Switches the motor power on, if it isn't, and waits until it is there.
class PowerStep : public Step {
 public:
  PowerStep(Context& context, axis::AxisModel& axis) : context_(context), axis_(axis) {}
  /// @throw Refused if there was an emergency stop, or if the machine was closed.
  void begin() override;
  /// @throw GpioError if it can't be switched on. @throw Refused as above, meanwhile.
  bool poll() override;

 private:
  Context& context_;
  axis::AxisModel& axis_;
};

/// Follows a motion to its end.
class FollowStep : public Step {
 public:
  /// @param predecessors, call are taken when it begins. @param start, begins_ns see
  /// MotionExecution.
  FollowStep(Context& context, std::vector<Order> orders, JoinPath join,
             std::function<std::vector<Predecessor>()> predecessors,
             std::function<SharedCall()> call, std::shared_ptr<const CommonStart> start = {},
             std::int64_t begins_ns = 0)
      : execution_(context, std::move(orders), std::move(join), std::move(start), begins_ns),
        predecessors_(std::move(predecessors)),
        call_(std::move(call)) {}

  /// Plans it in advance. @throw Refused
  void prepare() { moves_ = execution_.prepare(); }

  void begin() override;
  bool poll() override { return execution_.poll(); }
  void end(const EarlyEnd& why, const SharedCall& call) override { execution_.stop(why, call); }
  MotionExecution* execution() override { return &execution_; }

 private:
  MotionExecution execution_;
  std::vector<axis::Move> moves_;
  std::function<std::vector<Predecessor>()> predecessors_;
  std::function<SharedCall()> call_;
};

/// @throw Refused if there was an emergency stop, or if the machine was closed.
void refuseIfStopped(const Context& context, const axis::AxisModel& axis);
/// @throw Refused as above, and if there is a fault: the motor won't keep its current.
void refuseUnlessCurrentStays(const Context& context, const axis::AxisModel& axis);

/// @name Pins that several scripts write
/// @{

/// Energizes the motor, or switches its current off. A line that another axis needs stays asserted.
std::unique_ptr<Step> enableStep(Context& context, axis::AxisModel& axis, bool on,
                                 std::function<void()> then);
/// Writes a fixed sequence.
std::unique_ptr<Step> pinsStep(Context& context, axis::AxisModel& axis,
                               const motor::PinSequence& sequence, std::function<void()> then = {});
/// Makes steps that take the motor's current away, bring it, or interrupt it safe for the load: the
/// brake is engaged before them, and released after them if the motor holds the load then, when all
/// times of the chip are over. Every such sequence passes here. Without a brake the steps stay as
/// they are.
Steps braked(Context& context, axis::AxisModel& axis, Steps steps);
/// Brings the motor power; does nothing if nothing switches it.
Steps powerSteps(Context& context, axis::AxisModel& axis);
/// Engages the brake, if there is one.
Steps engageSteps(Context& context, axis::AxisModel& axis);
/// Switches an idle motor's current on, and releases its brake; does nothing if neither is needed.
Steps wakeSteps(Context& context, axis::AxisModel& axis);
/// @}

inline void append(Steps& steps, Steps more) {
  for (auto& step : more) steps.push_back(std::move(step));
}

}  // namespace stepdriver::activity
