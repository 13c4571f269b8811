#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/config/axis_config.h"
#include "stepdriver_core/config/io_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/io.h"
#include "stepdriver_core/machine/recording.h"
#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/trajectory/requests.h"

namespace stepdriver::machine {

/// An accepted motion of several axes.
///
/// @code{.cpp}
/// const machine::CoordinatedMove line = machine.moveLine({{"x", "y"}, {0.05, 0.02}});  // [m]
/// std::cout << "it takes " << line.duration << " s\n";
/// std::cout << machine.wait(line).message << "\n";  // "all axes reached their targets"
/// @endcode
struct CoordinatedMove {
  /// The part of one axis in it.
  struct Member {
    std::string axis;
    axis::Move move;
  };
  std::vector<Member> members;  ///< in the order of the request
  double duration = 0.0;        ///< [s] as planned
  /// For Machine::appendPath(); never the same twice.
  std::uint64_t id() const { return members.front().move.id; }
};

/// How and where a motion of several axes ended.
struct CoordinatedResult {
  /// How it ended: kReached, or what ended it first.
  axis::MoveEnd end = axis::MoveEnd::kReached;
  std::string message;            ///< a sentence that says how, and names the axis that ended it
  std::vector<double> positions;  ///< [unit] where the members stand
  double duration = 0.0;          ///< [s] the time that it took
  std::uint64_t marks_made = 0;   ///< as those of its members
  std::uint64_t marks_not_made = 0;
  bool marks_known = true;  ///< whether those of all its members are
};

/// How such a motion ended, from how each of its axes ended it: for a move that outlived its
/// machine, whose axis::Move::outcome are still there.
CoordinatedResult combinedResult(const std::vector<axis::MoveResult>& members);

/// An output whose level changes at a fixed rate as long as the pulse thread works, and stays as it
/// is if that thread stands still: an external monostable or safety relay that watches it can take
/// the motors' power away then. It isn't a certified safety function.
struct HeartbeatConfig {
  std::string line;     ///< low before its first edge, and again once the machine has released it
  double rate = 100.0;  ///< [Hz] whole periods of two edges each
};

/// What an emergency stop does to the motors.
enum class EmergencyDisable {
  kHold,  ///< once the last pulse has ended, they stay energized
  /// They decelerate first, as for Machine::stop(), and are then disabled as with kOff. Their
  /// positions stay valid. Machine::emergencyStop() returns when all are at rest; another call, a
  /// lost motor power, or more than the time that the slowest deceleration takes ends the pulses at
  /// once.
  kRamp,
  /// Once the last pulse has ended, they are disabled, as by Axis::enable(false), until
  /// Axis::enable(true): each brake takes hold first. A motor without ENABLE stays energized.
  kOff,
};

/// What a Machine is made with, in addition to its axes.
struct MachineOptions {
  /// A pulse that comes later than this, or so much longer after the last one than planned, at a
  /// speed that the motor can't restart from is a fault.
  double max_lateness = 0.005;  ///< [s]
  /// [full steps] How far the pulses of an axis may be behind their plan before the timeline of all
  /// axes slides, from 0 to 0.5. The motor feels it as an angle, and the steps that are overdue
  /// then follow as closely as its driver chip allows. 0.25 is what a motor feels at each step of
  /// quarter stepping. A quarter of a step's interval is always allowed.
  double late_steps = 0.25;
  /// On a real clock, first measure what step rates this computer and its lines can sustain.
  bool measure = false;
  /// Don't start if that is less than the axes need, or if real-time permissions are refused.
  bool enforce = false;
  /// If a line can't be written in this time, its axis has a fault that names the line. The pulse
  /// thread writes STEP and DIR: if it hangs, all axes have a fault, see Machine::whyHung().
  double write_timeout = 0.5;  ///< [s]
  /// An input that does what Machine::emergencyStop() does, if it becomes active or can't be read.
  std::optional<config::InputSwitch> emergency_stop{};
  EmergencyDisable emergency_disable = EmergencyDisable::kHold;
  /// If it can't be written, all axes have a fault.
  std::optional<HeartbeatConfig> heartbeat{};
  /// Switched on before the first motor is energized, at the start and by Axis::enable() and
  /// recover(); off at an emergency stop and at the end. If it doesn't come in time or is lost,
  /// that is an emergency stop, and all axes have a fault that says so.
  std::optional<config::MotorPowerConfig> motor_power{};
  /// Lines with a name, see setOutput() and ioStates(). If an output can't be written, all axes
  /// have a fault.
  std::vector<config::OutputConfig> outputs{};
  std::vector<config::InputConfig> inputs{};
  /// Absolute path of the file that keeps positions across a restart; empty: no file. A position
  /// in it that Axis::setPosition() would refuse isn't restored.
  std::string state_file{};
  /// What the pulse thread requests on a real clock. If it is refused, the machine works without
  /// it, and EngineFigures::realtime says so.
  pulse::RealtimeRequest realtime{};
  /// [s] How much of the past recording() returns; 0: nothing is recorded.
  double record_seconds = 0.0;
  /// [bytes] Memory for recorded edges, 8 bytes each. The recorder takes less if the top speeds of
  /// the axes need less.
  std::size_t record_bytes = 16'000'000;
};

/// What the pulse engine has done since the start.
struct EngineFigures {
  std::uint64_t edges = 0;  ///< edges of all STEP lines, both ends of each pulse
  std::uint64_t pulses = 0;
  std::uint64_t slips = 0;      ///< times that the timeline was slid because a pulse was late
  double slipped = 0.0;         ///< [s] the sum of these delays
  double worst_lateness = 0.0;  ///< [s] the largest of a pulse
  /// [ns] For the pulses since the start, and for those in the last whole second of the clock.
  pulse::LatenessFigures lateness;
  pulse::LatenessFigures lateness_last_second;
  std::string realtime;  ///< how the pulse thread runs, in words
};

/// What the numbers of a stream of setpoints are.
enum class SetpointMode { kPosition, kVelocity };

/// A message of a stream for one axis, see Machine::jog() and Machine::followSetpoints().
struct StreamMessage {
  std::string name;    ///< the axis's name
  double value = 0.0;  ///< [unit] a position, or [unit/s] a velocity: m or rad
  /// AxisState::stops as it was when the stream began: a stream does not continue after a stop, a
  /// hold, a disable or a recover. Empty: it is not checked.
  std::optional<std::uint64_t> unless_stopped_since;
};

/// All axes of a machine, with one pulse engine and one set of lines. All calls are safe from any
/// thread.
///
/// @code{.cpp}
/// const setup::MachineConfig config = yaml::readFile("a4988.yaml");
/// setup::Hardware hardware(config);
/// machine::Machine machine(config.axes, hardware.backend(), hardware.clock(), config.options());
/// axis::Axis& x = machine.axis("x");
/// x.wait(x.moveTo(0.05));  // [m]
/// machine.shutdown();
/// @endcode
class Machine {
 public:
  /// Requests the lines, all with their safe levels, brings each driver chip to a known state, and
  /// enables the axes that are configured so. Nothing moves.
  ///
  /// @param backend, clock outlive the machine.
  /// @throw ConfigError with all that the axes and the options contradict of the rules of a
  ///   configuration file, see config::checkAxes(); then no line is requested.
  /// @throw GpioError if a line can't be requested; then no line is held.
  /// @throw Refused with MachineOptions::enforce, naming what this computer can't do; then no line
  ///   is held.
  /// @throw ExhaustedError if a thread can't be started; then no line is held.
  /// @throw Error if the state file is used by another program or can't be written, or if an axis
  ///   can't be brought up; then no line is held.
  Machine(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend, pulse::Clock& clock,
          const MachineOptions& options = {});

  /// Calls shutdown() if it wasn't called; then drives every line to its safe level and releases
  /// it.
  ~Machine();
  Machine(const Machine&) = delete;
  Machine& operator=(const Machine&) = delete;

  /// The axes in the order of the configuration.
  const std::vector<std::unique_ptr<axis::Axis>>& axes() const;

  /// @throw Refused if there is no such axis; it names those that there are.
  axis::Axis& axis(const std::string& name) const;

  /// Decelerates every axis to rest, and ends a hold.
  void stop();

  /// Jogs several axes, see Axis::jog(). Those that begin a motion do so at the same nanosecond;
  /// axes that must be woken first begin together with the others that are at rest, when all are
  /// awake. From then on they are independent.
  ///
  /// @return for each message why its axis does not jog; empty if it does. An axis that is refused
  ///   doesn't keep the others from moving.
  /// @throw Refused if a name isn't known or comes twice; then nothing moves.
  [[nodiscard]] std::vector<std::string> jog(const std::vector<StreamMessage>& messages);

  /// The next setpoints of a stream, of some axes; they begin as for jog(). Each call gives new
  /// targets, from the present states of the axes. In a regular stream of positions within the
  /// limits, an axis passes each position about one period after it came, at the velocity of the
  /// stream, which is estimated. A position beyond a soft limit is replaced by the limit. When no
  /// setpoint follows, an axis comes to rest on the last position. Velocities are as for
  /// Axis::jog(); 0 slows down at the axis's own deceleration.
  ///
  /// @param timeout [s] from 0.005 to 60: without another setpoint, an axis then slows down to
  ///   rest, wherever it is.
  /// @return as jog().
  /// @throw Refused as jog(), or if the timeout is out of its range.
  [[nodiscard]] std::vector<std::string> followSetpoints(
      SetpointMode mode, double timeout, const std::vector<StreamMessage>& messages);

  /// A straight line of several axes: all begin and end together, each within its own limits. Axes
  /// that move come to rest first; relative positions count from where their motions would have
  /// ended. Whatever ends the motion of one axis ends that of all; a stop of one slows all of them
  /// down along the line.
  ///
  /// @throw Refused as Axis::moveTo(), and if the request is malformed; then nothing moves.
  CoordinatedMove moveLine(const motion::LineRequest& request);

  /// Moves several axes through the points of a trajectory; it can interrupt their motions. Points
  /// without velocities get those of a spline through all positions, see docs/motion.md. The
  /// points' time is the trajectory's: a hold or a speed override below 1 runs through it more
  /// slowly, one above 1 does nothing. A backlash is taken up in addition to the joint's own
  /// motion, which may last longer than the points. A long one is planned in the calling thread and
  /// delays no other call.
  ///
  /// On an axis with AxisConfig::continuous, all positions of the trajectory are changed by the
  /// same whole turns: those with which the first point is as near as possible to the axis.
  ///
  /// If it begins later, it is checked now, from the states that its axes will have then, and again
  /// if one of their plans changes. Until it begins, only streamed setpoints and jogs, and earlier
  /// trajectories, leave it as it is: a stop, a hold, a fault, an endstop, new limits and any other
  /// motion of one of its axes drop it, and its result says why. So does a trajectory that begins
  /// no later; one that begins after it takes over from it.
  ///
  /// @throw Refused as moveTo(), and if a position is beyond a soft limit, a velocity by more than
  ///   motion::kTrajectoryTolerance beyond the maximum, an acceleration beyond the larger of
  ///   acceleration and deceleration, if a velocity jumps by more than the start speed, if with a
  ///   jerk limit the jerk is beyond it or the acceleration jumps, if there is no room for the
  ///   backlash, or if one of the axes was stopped while this was planned.
  CoordinatedMove followTrajectory(const motion::TrajectoryRequest& request);

  /// Moves several axes along a path of lines, arcs and Beziers, from where they stand to rest at
  /// its end, as fast as their limits allow. Corners are rounded within the tolerance and passed
  /// without a stop; at a corner with a tolerance of 0, and at a turn by more than 170 degrees, the
  /// axes stop. If an axis has a jerk limit, the same holds for places where the curvature jumps,
  /// such as the one between a line and an arc. From then on it is a trajectory: for holds, stops,
  /// the speed override and backlash see followTrajectory(). Axes with a backlash use four fifths
  /// of their speeds, accelerations and jerks, so that it can be taken up meanwhile. It is planned
  /// in the calling thread and delays no other call.
  ///
  /// @throw Refused as moveTo(), and if one of the axes moves, if the request is malformed, if a
  ///   segment leads beyond a soft limit, if an arc has no circle, if a Bezier has a cusp, or if
  ///   one of the axes was stopped while this was planned; the message names the segment (the first
  ///   is 0). Then nothing moves.
  CoordinatedMove followPath(const motion::PathRequest& request);

  /// How long followPath() would take for a path, at the speed override of 1. Nothing moves, and it
  /// doesn't matter whether the axes are enabled, homed, on hold or at fault.
  ///
  /// @param from [unit] where the path begins, one for each name; empty: where the axes stand.
  /// @return [s]
  /// @throw Refused as followPath() for the path, if `from` has another number of positions, if one
  ///   of them is beyond a soft limit, or with PathRequest::more_follows.
  double pathDuration(const motion::PathRequest& request,
                      const std::vector<double>& from = {}) const;

  /// Appends segments to a path that began with PathRequest::more_follows: the axes don't stop at
  /// its former end, and the corner there is rounded, as far as they can still slow down for it. If
  /// the segments come too late, the axes come to rest at the former end, wait there, and continue
  /// from rest. Holds, stops and the speed override act as before; segments can also be appended
  /// during a hold. The limits are those with which the path began. The path reaches its end, and
  /// wait() returns, only after an append without PathAppend::more_follows, which may have no
  /// segments. It is planned in the calling thread; that takes time in proportion to the appended
  /// segments, and to all that lie ahead.
  ///
  /// @return what lies ahead afterwards, counted from the present position. An append without
  ///   segments but with `more_follows` only asks for that.
  /// @throw Refused if the axes no longer follow this path, if it is complete, if more than
  ///   kMostPathSegments would lie ahead, or as followPath() for a segment, by its number among the
  ///   appended ones. Then the path stays as it is.
  motion::PathAhead appendPath(const motion::PathAppend& request);
  /// What lies ahead on such a path; empty if no axis follows it any longer.
  std::optional<motion::PathAhead> pathAhead(std::uint64_t path) const;

  /// How a motion of several axes ended; empty if it hasn't ended.
  std::optional<CoordinatedResult> result(const CoordinatedMove& move) const;
  /// Returns when it has ended.
  CoordinatedResult wait(const CoordinatedMove& move) const;
  /// The same for at most this time, as axis::Axis::waitFor(); empty if it hasn't ended by then.
  std::optional<CoordinatedResult> waitFor(const CoordinatedMove& move,
                                           std::chrono::nanoseconds longest) const;
  /// Stops the axes that still make this move or hold it; they decelerate along its path. A motion
  /// that has replaced the move continues.
  void stop(const CoordinatedMove& move);

  /// Feed hold: every axis decelerates to rest along its path, and keeps its goal; a jog ends. It
  /// lasts until resume() or stop(), also if nothing moves; new motions are refused until then, and
  /// a line that waits for its axes begins after resume().
  void hold();

  /// Ends the hold: held motions continue.
  ///
  /// @throw Refused if one of them can't; then all axes stay on hold.
  void resume();

  /// Homes several axes, by HomingConfig::order: the lowest first, those with the same at once.
  /// If one fails, those that come later aren't homed. Returns when all is over.
  ///
  /// @param names empty: all that have a homing.
  /// @param cancelled as for Axis::home().
  /// @return how each ended, in the order in which they came.
  /// @throw Refused if a name isn't known or comes twice, or one of the axes can't be homed now;
  ///   then none moves.
  std::vector<axis::HomingResult> home(const std::vector<std::string>& names = {},
                                       const std::function<bool()>& cancelled = {});

  /// @throw Refused if home() would be refused now.
  void checkHoming(const std::vector<std::string>& names = {}) const;

  /// Scales the velocities of all motions, including those in progress, within the limits of their
  /// axes. The approaches of a homing to a stall keep their speed.
  ///
  /// @param factor 0.01 to 2.0. @throw Refused if it is outside of that; then nothing changes.
  void setSpeedOverride(double factor);

  /// Completes the current pulse, or the ramp of MachineOptions::emergency_disable, sends no more,
  /// and then returns. Every axis is at fault until recover(), from the beginning of the ramp on.
  /// MachineOptions::emergency_disable may disable the motors then; this doesn't wait
  /// until they are disabled. MachineOptions::emergency_stop does the same; if it is active at the
  /// start, no motor is energized. Each output with a name is in its safe state when this returns,
  /// unless its line has failed.
  ///
  /// @throw GpioError if the pulse thread hangs, see whyHung(): then no other pulse goes out when
  ///   the chip answers again, except for those of the write that hangs.
  void emergencyStop();
  /// True from an emergency stop until recover().
  bool emergencyStopped() const;

  /// Clears the emergency stop and all faults. Nothing moves.
  ///
  /// @throw Refused while the emergency-stop input is active or can't be read; then nothing is
  ///   cleared.
  /// @throw Error if an axis can't recover, because its chip still reports a fault or a line can't
  ///   be written; it names the axis, which stays at fault. The other axes have recovered.
  void recover();

  /// Switches an output with a name, as soon as its least times allow. Returns when its line was
  /// written.
  ///
  /// While an axis is at fault, from an emergency stop until recover(), and from the beginning of a
  /// shutdown on, each output is in its safe state. It stays in it until this is called again.
  ///
  /// @param value of a PWM output that is on, above 0: 1 is the length of its pulses when it is on,
  ///   and smaller values are nearer to that when it is off. It changes at once whatever the least
  ///   times are.
  /// @throw Refused if there is no such output or it can't have the value, while the outputs are in
  ///   their safe states, if that comes before it was switched, or if another call switches it
  ///   otherwise meanwhile.
  /// @throw GpioError if its line can't be written; then all axes have a fault.
  void setOutput(const std::string& name, bool on, double value = 1.0);

  /// Lets the position of an axis switch an output, at the nanosecond at which the joint arrives at
  /// a place, until clearPositionCompare(). Nothing else switches it meanwhile, except to its safe
  /// state. Returns when the next motion will.
  ///
  /// @code{.cpp}
  /// config::PositionCompare camera;
  /// camera.axis = "x";
  /// camera.every = config::PositionCompare::Every{0.002, 0.01, 0.21};
  /// camera.pulse_ns = 1'000'000;
  /// machine.setPositionCompare("camera", camera);
  /// @endcode
  ///
  /// It is a passage of the joint that counts: with backlash, an input shaper, or axes that share
  /// motors, too. While the position can't be trusted (AxisState::position_valid), during a homing,
  /// and while outputs are in their safe states, the output isn't switched by it. Then, and if a
  /// pulse is due while the one before it is on, OutputState::missed counts what isn't made.
  ///
  /// @throw Refused if there is no such output or axis, a place is outside its soft limits, the
  ///   output can't be switched as fast as the top speed of the axis would need it, or the axis
  ///   moves.
  void setPositionCompare(const std::string& output, const config::PositionCompare& compare);
  /// No position switches it any more: it goes off. @throw Refused if there is no such output.
  void clearPositionCompare(const std::string& output);

  /// Latches the positions of axes at edges of an input with a name, each at the edge's kernel time
  /// stamp, while they move or rest. Nothing that happens to the axes ends it.
  ///
  /// @throw Refused if there is no such input or axis, or if the window is empty.
  Latch latch(const LatchRequest& request);
  /// Returns when it has ended: after its first edge, by end(), or with the machine.
  ///
  /// @param cancelled asked often while this waits; if it returns true, the latch ends.
  LatchResult wait(const Latch& latch, const std::function<bool()>& cancelled = {});
  /// The same for at most this time, as axis::Axis::waitFor(); empty if it hasn't ended by then.
  std::optional<LatchResult> waitFor(const Latch& latch, std::chrono::nanoseconds longest) const;
  /// Ends it. Does nothing if it has ended.
  void end(const Latch& latch);
  /// Moves axes along a straight line until an input tells of a contact: they come to rest then, at
  /// the deceleration of stops, and the result has the place of the contact, by the edge's time
  /// stamp. Never beyond the requested positions. What ends a line ends this. Returns at the end.
  ///
  /// @param cancelled asked often while this waits; if it returns true, the axes come to rest.
  /// @throw Refused as latch() and moveLine(), and if the input tells of a contact at the start;
  ///   then nothing moves. A later refusal is a failure in the result.
  ProbeResult probe(const ProbeRequest& request, const std::function<bool()>& cancelled = {});
  /// The outputs and inputs with a name.
  IoStates ioStates() const;

  /// @param told called at each change of an output or an input with a name, by the thread that all
  ///   axes wait for: it returns at once, and calls nothing of the machine. Empty: nobody is told,
  ///   and when this returns, nobody is being told.
  void onIoChange(std::function<void(const IoStates&)> told);

  /// Energizes the motors of all axes that have an enable line, or switches their current off:
  /// those that move decelerate first, all at once. Returns when it is done for all, see
  /// Axis::enable().
  ///
  /// @throw Refused if one of them can't be enabled now, for example because it is at fault: then
  ///   none is. Also if no axis has such a line.
  void enable(bool on);

  /// Refuses every command from now on, decelerates, and disables the axes that are configured so.
  /// Returns when that is done.
  ///
  /// @throw Error if a line can't be written; all others are written.
  /// @throw StateFileError if all lines were written, but not the state file.
  void shutdown();

  /// Whether the thread that all axes wait for still works: for watchdogs. Waits for it for at most
  /// this time. Always true without threads, and after shutdown().
  bool responds(std::chrono::nanoseconds longest) const;

  /// What the pulse engine has done so far.
  EngineFigures figures() const;

  /// The line of STEP, DIR or an input for which the pulse thread has waited for more than the
  /// write_timeout (at least 0.5 s), because its GPIO chip doesn't answer; empty: it works. While
  /// it hangs, every axis is at fault, its position is invalid, each waiting call ends with a
  /// fault, and new calls throw GpioError. When the chip answers again, no motion continues;
  /// recover() ends the faults. The destructor waits for the chip.
  std::string whyHung() const;
  /// The last MachineOptions::record_seconds of the clock: what every output did, and why. Nothing
  /// waits for this, however long it takes.
  ///
  /// @throw Refused if nothing is recorded.
  Recording recording() const;
  /// [s] How long the recording is at least, if all axes move at their top speeds all the time.
  double recordedSeconds() const;
  /// @param told called when an axis gets a fault, also by an emergency stop, by the thread that
  ///   all axes wait for: it returns at once and calls nothing of this machine. Called now if an
  ///   axis had a fault before. Never called if nothing is recorded.
  void onFault(std::function<void()> told);

  /// Why the last write of the state file failed; empty if it succeeded, or if there is no file.
  std::string stateFileError() const;

  /// As measured at the start; empty if that wasn't requested, or if the clock is virtual.
  const std::optional<pulse::Capability>& capability() const;

 protected:
  /// Who serves the pulses and calls of a machine. A machine without threads is for tests and
  /// simulations on a virtual clock, which derive a class of their own from this one.
  enum class ServedBy {
    kThreads,  ///< threads of the machine
    kCallers,  ///< calls that wait, and advance(); one call at a time
  };
  Machine(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend, pulse::Clock& clock,
          const MachineOptions& options, ServedBy served_by);

  /// Serves the pulses for a time of the clock.
  ///
  /// @throw Refused if the machine has threads, which serve the pulses.
  void advance(double seconds);

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::machine
