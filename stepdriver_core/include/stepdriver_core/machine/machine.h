#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/coordinated_move.h"
#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

/// What a Machine is made with, beside its axes.
struct MachineOptions {
  /// Serve the pulses in a thread of the machine's own. Without, waiting calls serve them, and
  /// advance() does: for tests on a virtual clock.
  bool threaded = true;
  /// A pulse that comes later than this at a speed that the motor can't restart from is a fault.
  double max_lateness = 0.005;  ///< [s]
  /// On a clock that is real, measure what the machine and its lines can do, before anything else.
  bool measure = false;
  /// And where that is less than the axes ask for, or real-time rights are refused, don't start.
  bool enforce = false;
  /// A line other than STEP and DIR that can't be written in this time is a fault of its axis,
  /// which names it.
  double write_timeout = 0.5;  ///< [s]
  /// An input that does what Machine::emergencyStop() does, where it becomes active or can't be
  /// read.
  std::optional<config::InputSwitch> emergency_stop{};
  /// Absolute path of the file that keeps positions over a restart; empty: none. See
  /// machine::StateFile.
  std::string state_file{};
  /// On a clock that is real, held open to keep the processors awake; empty: they may sleep. See
  /// pulse::kCpuLatencyDevice.
  std::string latency_device = pulse::kCpuLatencyDevice;
};

/// What the pulse engine has done since the start.
struct EngineFigures {
  std::uint64_t edges = 0;  ///< of all STEP lines, both ends of each pulse
  std::uint64_t pulses = 0;
  std::uint64_t slips = 0;      ///< times that the timeline was slid because a pulse was late
  double slipped = 0.0;         ///< [s] by how much altogether
  double worst_lateness = 0.0;  ///< [s] of one pulse
  /// Of the pulses since the start, and of those in the last whole second of the clock [ns].
  pulse::LatenessFigures lateness;
  pulse::LatenessFigures lateness_last_second;
  std::string realtime;  ///< how the pulse thread runs, in words
};

/// All axes, one pulse engine, one set of lines. All calls are safe from any thread.
class Machine {
 public:
  /// Takes the lines, all with their safe levels, and brings each chip to a known state; enables
  /// the axes that want it. Nothing moves.
  ///
  /// @param backend, clock outlive the machine.
  /// @throw GpioError where a line can't be had; then none is held.
  /// @throw Refused with MachineOptions::enforce, naming what can't be done; no line is held then.
  Machine(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend, pulse::Clock& clock,
          const MachineOptions& options = {});

  /// shutdown(), where that wasn't called; then drives every line to its safe level and releases
  /// it.
  ~Machine();
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;

  /// The axes in the order of the configuration.
  const std::vector<std::unique_ptr<axis::Axis>>& axes() const;

  /// @throw Refused naming the axes that there are.
  axis::Axis& axis(const std::string& name) const;

  /// Decelerates every axis to rest, and ends a hold.
  void stop();

  /// A straight line of several axes: all begin and end together, each within its own limits. Axes
  /// that move come to rest first; relative positions count from where their motions were to end.
  /// What ends one of them ends all, a stop of one slows all of them down along the line.
  ///
  /// @throw Refused as Axis::moveTo(), and where the request isn't one; then nothing moves.
  CoordinatedMove moveLine(const LineRequest& request);

  /// Several axes through the points of a trajectory, from whatever they do, which it replaces. The
  /// points' time is the trajectory's: a hold or a speed override below 1 runs through it more
  /// slowly, one above 1 does nothing. A backlash is taken up in addition to the joint's own
  /// motion, which may last longer than the points. A long one is planned in the calling thread and
  /// delays no other call.
  ///
  /// @throw Refused as moveTo(), and if a position is beyond a soft limit, a velocity by more than
  ///   axis::kTrajectoryTolerance beyond the maximum, an acceleration beyond the larger of
  ///   acceleration and deceleration, if a velocity jumps by more than the start speed, if with a
  ///   jerk limit the jerk is beyond it or the acceleration jumps, if there is no room for the
  ///   backlash, or if one of the axes was stopped while this was planned.
  CoordinatedMove followTrajectory(const TrajectoryRequest& request);

  /// How a motion of several axes ended; none where it hasn't.
  std::optional<CoordinatedResult> result(const CoordinatedMove& move) const;
  /// Returns when it has ended.
  CoordinatedResult wait(const CoordinatedMove& move) const;

  /// Feed hold: every axis decelerates to rest along its path, and keeps its goal; a jog ends. It
  /// lasts until resume() or stop(), also if nothing moves; new motions are refused until then, and
  /// a line that waits for its axes begins after resume().
  void hold();

  /// Ends the hold: held motions continue.
  void resume();

  /// Homes several axes, by HomingConfig::order: the lowest first, those with the same at once.
  /// Where one fails, those that come later aren't homed. Returns when all is over.
  ///
  /// @param names empty: all that have a homing.
  /// @param cancelled as for Axis::home().
  /// @return how each ended, in the order in which they came.
  /// @throw Refused where a name isn't known or comes twice, or one of the axes can't be homed now;
  ///   then none moves.
  std::vector<axis::HomingResult> home(const std::vector<std::string>& names = {},
                                       const std::function<bool()>& cancelled = {});

  /// @throw Refused where home() would be, now.
  void checkHoming(const std::vector<std::string>& names = {}) const;

  /// Scales the velocities of all motions, of those under way too, within the axes' accelerations.
  /// No axis goes beyond its maximum.
  ///
  /// @param factor 0.01 to 2.0. @throw Refused where it isn't; then nothing changes.
  void setSpeedOverride(double factor);

  /// Lets the pulse that is out finish and sends no other. Every axis is at fault until recover();
  /// motors stay energized. MachineOptions::emergency_stop does the same; where it is active at the
  /// start no motor is energized.
  void emergencyStop();
  /// From an emergency stop on until recover().
  bool emergencyStopped() const;

  /// Ends the emergency stop and all faults. Nothing moves.
  ///
  /// @throw Refused while the emergency-stop input is active or can't be read; nothing is ended
  ///   then.
  void recover();

  /// Refuses every command from now on, decelerates, and disables the axes that are configured so.
  /// Returns when that is done. @throw Error where a line can't be written; all others are, then.
  void shutdown();

  /// What the engine has done, read while it goes on.
  EngineFigures figures() const;

  /// Why the state file couldn't be written the last time; empty: it could, or there is none.
  std::string stateFileError() const;

  /// As measured at the start; none where that wasn't asked for, or the clock is virtual.
  const std::optional<pulse::Capability>& capability() const;

  /// Serves the pulses for a time of the clock. Only where the machine has no thread.
  void advance(double seconds);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::machine
