#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "activity/activities.h"
#include "activity/context.h"
#include "chip_watch.h"
#include "flag_checks.h"
#include "input.h"
#include "motor/motor_lines.h"
#include "snapshot.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/machine/machine.h"

namespace stepdriver::machine {

/// Owns all state of a machine and makes all decisions. It has no thread, lock, clock, line or
/// file: its outputs are a function of its inputs and their order.
class Controller {
 public:
  /// @param horizon of the engine, see pulse::PulseEngine::horizon().
  Controller(const std::vector<config::AxisConfig>& axes,
             const std::vector<motor::MotorLines>& lines, axis::LineNames names,
             const std::optional<pulse::Signal>& emergency_stop, EmergencyDisable emergency_disable,
             activity::MotorPower motor_power = {}, NamedLines named = {},
             pulse::Nanoseconds horizon = 0);
  ~Controller();
  Controller(const Controller&) = delete;
  Controller& operator=(const Controller&) = delete;

  /// A turn: handles an input, and returns what must be done.
  void handle(const Input& input, activity::Outputs& out);

  /// Clock time by which it needs a TimerDue.
  pulse::Nanoseconds due() const;
  /// Clock time from which on a TimerDue asks a driver chip how it is. It is no reason for a clock
  /// to go on that stands still while nothing is waited for.
  pulse::Nanoseconds pollDue() const { return chip_watch_.due(); }
  /// Whether it acts on the levels of inputs; if not, they are read when a request comes.
  bool watchesInputs() const {
    return activities_.watchInputs() || context_.motor_power.watchesInputs() ||
           requests_.named.inputs.areWatched() || requests_.latches.areWatched() ||
           flag_checks_.areWatched();
  }

  /// Clock time for which it needs EdgesTaken; pulse::kNever: for none.
  pulse::Nanoseconds edgesDue() const {
    return std::min(requests_.latches.edgesDue(), flag_checks_.edgesDue());
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
  void on(const EdgesTaken& taken) { context_.levels.edgesAddedUntil(taken.until); }
  void on(const activity::PinDone& done) { context_.pin_done = done; }
  void on(const bus::RegisterDone& done);
  void on(const TimerDue& /*due*/) {}

  // The engine.
  void update(axis::AxisModel& axis, const pulse::ChannelState& state);
  void handleStops(const EngineNews& news);
  void supervise();
  void pollLatches();
  void checkFlags();
  bool isBeingHomed(const axis::AxisModel& axis) const;
  void failAxis(axis::AxisModel& axis, const std::string& fault, const std::string& remedy);
  bool supervisePower();
  bool motorsMayLosePower() const;
  bool superviseOutputs();
  void superviseCompares();
  void showIo();
  void superviseIdle(axis::AxisModel& axis);
  pulse::Nanoseconds idleDue(const axis::AxisModel& axis) const;
  AxisSnapshot snapshotOf(const axis::AxisModel& axis) const;

  activity::Outputs last_;  // receives the answers to unserved calls at the end
  activity::Context context_;
  activity::Activities activities_;
  RequestContext requests_;
  FlagChecks flag_checks_;
  ChipWatch chip_watch_;
  std::shared_ptr<const IoStates> io_;  // what readers see of the lines with a name
  std::uint64_t stops_concluded_ = 0;   // as MachineSnapshot's
  const EmergencyDisable emergency_disable_;
  bool disables_all_ = false;  // an emergency stop has come, and all motors must be disabled
  std::uint64_t input_stops_seen_ = 0;
};

}  // namespace stepdriver::machine
