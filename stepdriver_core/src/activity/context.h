#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "axis/axis_model.h"
#include "bus/register_job.h"
#include "call.h"
#include "motion_outputs.h"
#include "motor_power.h"
#include "pulse/command.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::activity {

/// A write of a line other than STEP or DIR, for the line writers.
struct PinJob {
  std::uint64_t id = 0;
  int output = -1;
  bool level = false;
  std::uint16_t part = gpio::LineWrite::kWhole;
};

/// Its result.
struct PinDone {
  std::uint64_t id = 0;
  int error = 0;  ///< errno; 0: the line was written
};

/// The outputs of a turn of the controller, in this order: first the snapshot, then the answers,
/// then the orders.
struct Outputs {
  std::vector<pulse::Command> commands;
  std::vector<PinJob> pin_jobs;
  std::vector<bus::RegisterJob> register_jobs;  ///< for the threads of the serial ports
  std::vector<std::pair<CallId, Reply>> answers;
  std::uint64_t clear_stops = 0;  ///< emergency stops up to this count are cleared
  bool stops = false;             ///< an emergency stop, because the motor power is lost
};

/// The environment of activities: the axes, the state of the machine, the time of this turn, and
/// the outputs.
class Context : public AnswerSink {
 public:
  /// @param port_horizon of the port that plays the steps.
  explicit Context(std::size_t inputs, pulse::Nanoseconds port_horizon = 0)
      : horizon(port_horizon), levels(inputs) {}

  /// See pulse::StepPort::horizon(): a new profile begins later than this from now.
  const pulse::Nanoseconds horizon;

  axis::MachineMode mode;
  axis::InputLevels levels;
  axis::LineNames lines;
  std::vector<std::unique_ptr<axis::AxisModel>> axes;
  MotorPower motor_power;
  MotionOutputs motion_outputs;

  /// @name What belongs to this turn
  /// @{
  pulse::Nanoseconds now = 0;      ///< clock time
  pulse::Nanoseconds slipped = 0;  ///< motion time is clock time minus this
  std::uint64_t stops_asked = 0;   ///< emergency stops
  std::optional<PinDone> pin_done;
  std::optional<bus::RegisterDone> register_done;
  Outputs* out = nullptr;
  /// @}
  /// Emergency stops that were handled, and those of them that were cleared.
  std::uint64_t stops_handled = 0;
  std::uint64_t stops_cleared = 0;
  /// The count when the last ramp of an emergency stop began.
  std::uint64_t stops_ramping = 0;
  /// Whether an emergency stop was requested that the controller hasn't been told of.
  bool hasUnknownStop() const { return stops_asked != std::max(stops_handled, stops_ramping); }

  pulse::Nanoseconds motionNow() const { return now - slipped; }
  /// The motion time at a clock time of the last seconds. It is uncertain by how far the timeline
  /// slid between the turns before and after that.
  pulse::Nanoseconds motionTimeAt(pulse::Nanoseconds clock_time) const;
  /// The addresses of all chips on a serial port.
  std::vector<int> addressesOn(const std::string& port) const;
  std::uint64_t newGroup() { return ++groups_; }
  std::uint64_t newMove() { return ++moves_; }
  std::uint64_t newJob() { return ++jobs_; }
  std::uint64_t newStart() { return ++starts_; }

  /// A turn begins.
  void beginTurn(Outputs& outputs);
  /// All its commands are complete.
  void endTurn();
  /// A command to follow profiles, to be filled in this turn. The engine accepts all of them or
  /// none.
  /// @param start those of one turn with the same number share a command, unless it is 0.
  std::shared_ptr<std::vector<pulse::Follow>> newCommand(std::uint64_t start);
  /// The marks of such a command.
  /// @return they must live until the engine has handled it.
  std::shared_ptr<std::vector<pulse::FollowMarks>> marksOf(
      const std::shared_ptr<std::vector<pulse::Follow>>& command);

  void answer(CallId call, Reply reply) override {
    if (call != 0) out->answers.emplace_back(call, std::move(reply));
  }

 private:
  struct FollowCommand {
    std::size_t index = 0;  // its index in Outputs::commands
    std::uint64_t start = 0;
    std::shared_ptr<std::vector<pulse::Follow>> follows;
    std::shared_ptr<std::vector<pulse::FollowMarks>> marks;
  };

  /// How far the timeline has slid from a clock time on.
  struct Slip {
    pulse::Nanoseconds from = 0;
    pulse::Nanoseconds slipped = 0;
  };

  std::vector<FollowCommand> follow_commands_;  // those of this turn
  std::deque<Slip> slips_;
  pulse::Nanoseconds last_turn_ = 0;
  std::uint64_t groups_ = 0;
  std::uint64_t moves_ = 0;
  std::uint64_t jobs_ = 0;
  std::uint64_t starts_ = 0;
};

/// Why something ends early.
struct EarlyEnd {
  axis::MoveEnd end = axis::MoveEnd::kStopped;
  std::string text;
};

}  // namespace stepdriver::activity
