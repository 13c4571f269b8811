#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "activity/activities.h"
#include "activity/context.h"
#include "activity/start_together.h"
#include "motor/motor_lines.h"
#include "requests.h"
#include "snapshot.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::machine {

/// Owns all state of a machine and makes all decisions. It has no thread, lock, clock, line or
/// file: its outputs are a function of its inputs and their order.
class Controller {
 public:
  Controller(const std::vector<config::AxisConfig>& axes,
             const std::vector<motor::MotorLines>& lines, axis::LineNames names,
             const std::optional<pulse::Signal>& emergency_stop, EmergencyDisable emergency_disable,
             activity::MotorPower motor_power = {});
  ~Controller();
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// A turn: handles an input, and returns what must be done.
  void handle(const Input& input, activity::Outputs& out);

  /// Clock time by which it needs a TimerDue.
  pulse::Nanoseconds due() const;
  /// Whether it acts on the levels of inputs; if not, they are read when a request comes.
  bool watchesInputs() const {
    return activities_.watchInputs() || context_.motor_power.watchesInputs();
  }

  std::shared_ptr<const MachineSnapshot> snapshot() const;

  /// A failure of any axis's line, in words.
  std::string textOf(const pulse::LineFailure& failure) const;

 private:
  // Inputs from outside.
  void on(const Requested& requested);
  void on(const EngineNews& news);
  void on(const EngineHangs& hang);
  void on(const InputRead& read) { context_.levels.update(read.input, read.level); }
  void on(const InputEdge& edge) { context_.levels.add(edge.edge); }
  void on(const activity::PinDone& done) { context_.pin_done = done; }
  void on(const TimerDue& /*due*/) {}

  // Requests. Each throws Refused or GpioError, or accepts the call.
  using SharedCall = activity::SharedCall;
  void serve(const MoveTo& wanted, const SharedCall& call);
  void serve(const MoveRounds& wanted, const SharedCall& call);
  void serve(const PlanMove& wanted, const SharedCall& call);
  void serve(const Jog& wanted, const SharedCall& call);
  void serve(const JogTogether& wanted, const SharedCall& call);
  void serve(const FollowSetpoints& wanted, const SharedCall& call);
  void serve(const MoveLine& wanted, const SharedCall& call);
  void serve(const FollowTrajectory& wanted, const SharedCall& call);
  void serve(const ExtendPath& wanted, const SharedCall& call);
  void serve(const StopAxis& wanted, const SharedCall& call);
  void serve(const StopMove& wanted, const SharedCall& call);
  void serve(const StopAll& wanted, const SharedCall& call);
  void serve(const Hold& wanted, const SharedCall& call);
  void serve(const Resume& wanted, const SharedCall& call);
  void serve(const SetSpeedOverride& wanted, const SharedCall& call);
  void serve(const SetLimits& wanted, const SharedCall& call);
  void serve(const Home& wanted, const SharedCall& call);
  void serve(const CancelHoming& wanted, const SharedCall& call);
  void serve(const Enable& wanted, const SharedCall& call);
  void serve(const Sleep& wanted, const SharedCall& call);
  void serve(const Reset& wanted, const SharedCall& call);
  void serve(const SetMicrosteps& wanted, const SharedCall& call);
  void serve(const SetPosition& wanted, const SharedCall& call);
  void serve(const Recover& wanted, const SharedCall& call);
  void serve(const BringUp& wanted, const SharedCall& call);
  void serve(const RestorePosition& wanted, const SharedCall& call);
  void serve(const NotePosition& wanted, const SharedCall& call);
  void serve(const Close& wanted, const SharedCall& call);
  void serve(const AwaitRest& wanted, const SharedCall& call);
  void serve(const PowerDown& wanted, const SharedCall& call);

  axis::AxisModel& axis(AxisId id) { return *context_.axes.at(id); }
  /// The axis, and all that share its motors.
  std::vector<axis::AxisModel*> withSharers(AxisId id);
  activity::Goal goalOf(const MoveTo& wanted);
  using MayBegin = std::optional<activity::Goal>;
  /// @return empty if nothing new must begin. @throw Refused
  MayBegin goalOf(const Jog& wanted, const SharedCall& call);
  MayBegin positionGoal(const Setpoint& wanted, double timeout);
  MayBegin velocityGoal(const Setpoint& wanted, double timeout);
  /// Of the axis's present or held motion.
  const activity::Goal* goalOf(const axis::AxisModel& axis) const;
  /// The goal of the axis's present motion if that is streamed.
  const activity::Goal* streamedGoal(const axis::AxisModel& axis) const;
  /// Sets the soft limit ahead as the end of a velocity. @throw Refused if it can't begin.
  void limitVelocity(activity::Goal& goal, const axis::AxisModel& axis, const char* moves) const;
  template <typename Message, typename GoalOf>
  void beginStreamed(const std::vector<Message>& messages, const SharedCall& call,
                     const GoalOf& goal_of);
  void beginTogether(std::vector<activity::StartTogether::Start> starts);
  void setTarget(activity::Goal& goal, axis::AxisModel& axis, double position, bool relative);
  /// [microsteps] The position of the joint from which a relative move counts.
  double relativeOrigin(const axis::AxisModel& axis) const;
  activity::Goal goalWithOutcome(activity::Goal goal);
  /// Requires that the axis neither moves nor changes its pins. @param what is refused, in words.
  void refuseUnlessFree(const axis::AxisModel& axis, const std::string& what) const;
  void refuseUnlessReadyToMove(const axis::AxisModel& axis) const;
  /// Refuses what concerns all axes that share its motors while one of the others is busy.
  void refuseUnlessSharersAreFree(const axis::AxisModel& axis, const std::string& what) const;
  void refuseWhileEmergencyStopInput() const;
  /// Whether an enable has something to do. @throw Refused
  bool mustEnable(const axis::AxisModel& axis) const;
  void disable(axis::AxisModel& axis, const activity::EarlyEnd& why, const SharedCall& call);

  // The engine.
  void update(axis::AxisModel& axis, const pulse::ChannelState& state);
  void handleStops(const EngineNews& news);
  void supervise();
  bool supervisePower();
  bool motorsMayLosePower() const;
  void superviseIdle(axis::AxisModel& axis);
  pulse::Nanoseconds idleDue(const axis::AxisModel& axis) const;
  AxisSnapshot snapshotOf(const axis::AxisModel& axis) const;

  activity::Context context_;
  activity::Activities activities_;
  const std::optional<pulse::Signal> emergency_stop_;
  const EmergencyDisable emergency_disable_;
  bool disables_all_ = false;  // an emergency stop has come, and all motors must be disabled
  std::uint64_t input_stops_seen_ = 0;
  std::uint64_t homings_ = 0;
  std::vector<SharedCall> awaiting_rest_;
  activity::Outputs last_;  // receives the answers to unserved calls at the end
};

}  // namespace stepdriver::machine
