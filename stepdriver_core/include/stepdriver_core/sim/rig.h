#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/gpio/simulated_lines.h"
#include "stepdriver_core/sim/pin_trace.h"

/// The simulated rig: each axis has a driver chip that reads its pins according to the datasheet, a
/// motor, a carriage and two switches, behind the lines of a gpio::SimulatedBackend.
namespace stepdriver::sim {

/// How a line reaches the chip. An empty name: the pin isn't wired. An unwired ENABLE energizes the
/// motor, an unwired SLEEP or RESET does nothing, an unwired DIR is low (high if inverted), and
/// unwired microstep pins are strapped as RigAxisSpec::microsteps says.
struct Wire {
  std::string line;
  bool inverted = false;  ///< the chip sees the opposite level, as with common-anode wiring
};

/// A switch that the carriage presses: an endstop, or a flag that it passes on both sides.
///
/// After each change its line takes the new level at once, and then makes `bounces` on-off pairs of
/// edges, bounce_ns apart, ending at the new level.
struct SwitchSpec {
  std::string line;
  bool active_level = false;  ///< level of the line while the switch is pressed
  double position = 0.0;      ///< [mm|deg] pressed from here on outwards
  /// [mm|deg] Of a flag, pressed from position to here; infinite: an endstop.
  double end = std::numeric_limits<double>::infinity();
  double every = 0.0;  ///< [mm|deg] of a flag, there is one so often; above its length; 0: once
  double hysteresis = 0.0;     ///< [mm|deg] released again this far outside of that
  int bounces = 0;             ///< extra on-off pairs after each change
  std::int64_t bounce_ns = 0;  ///< time from one bounce edge to the next
};

/// A brake that holds the load of an axis while its line doesn't have the level that releases it.
struct BrakeSpec {
  std::string line;
  bool release_level = true;    ///< level of the line that releases it
  std::int64_t release_ns = 0;  ///< how long it drags after that level
  std::int64_t engage_ns = 0;   ///< from the other level until it holds the load
};

/// A relay that switches the power of all motors.
struct MotorPowerSpec {
  std::string line;
  bool active_level = true;      ///< level of the line that switches the power on
  std::int64_t on_ns = 0;        ///< from that level until the power is there
  std::string feedback_line;     ///< the line of the power's contact; empty: not wired
  bool feedback_active = false;  ///< its level while the power is there
};

/// A mass that a carriage pulls along by a spring, like the frame or the tool of a machine. It
/// moves nothing else.
struct SpringSpec {
  double frequency = 0.0;  ///< [Hz] of its oscillation without damping; above 0
  double damping = 0.0;    ///< damping ratio, from 0 to below 1
};

/// What the configuration allows a motor. Steps are microsteps of RigAxisSpec::microsteps; in
/// another mode, as many of them as it has fewer or more for the same way count as one.
struct MotorLimits {
  double rate = 0.0;          ///< [steps/s] the highest; above 0
  double acceleration = 0.0;  ///< [steps/s^2] the highest, speeding up or slowing down; above 0
  double start_rate = 0.0;    ///< [steps/s] the speed may jump by this much
  /// [steps] How far the steps may be behind their plan when they go out. 0: their times are
  /// exactly as planned, on a virtual clock. Otherwise late steps may catch up with the plan, and
  /// no acceleration can be judged.
  double late = 0.0;
};

/// The motor of an axis: a hybrid stepper whose torque is a sine of the electrical angle between
/// its field and its rotor. The defaults are those of a common NEMA 17 motor with a load of the
/// same inertia.
struct MotorSpec {
  int pole_pairs = 50;           ///< above 0; a full step is a quarter of a pole pair
  double holding_torque = 0.30;  ///< [Nm] above 0
  double inertia = 108e-7;  ///< [kg m^2] the rotor's and the load's, at the motor's shaft; above 0
  double friction = 0.0;    ///< [Nm] the bearings' and the load's, against each turn
  /// Damping ratio of its small oscillations, above 0. A motor has less, from 0.05 on: with full
  /// steps it then resonates, and loses steps at some speeds.
  double damping = 0.2;
};

/// The motor, with as much more holding torque as it takes to lose no step of an axis within these
/// limits, in each microstep mode.
///
/// With w the frequency of small oscillations, at least 1.5 times the electrical speed: the motor
/// can start and stop at that speed at once (w/2 is enough for that without damping and with
/// microsteps), the damping takes a lag of asin(2 d/1.5) = 15 degrees, and full steps at the worst
/// speed less than 120 degrees. The acceleration takes at most a quarter of the torque, and so does
/// the friction.
///
/// @param rate [full steps/s] the top speed of the motor
/// @param acceleration [full steps/s^2] its highest one
MotorSpec soundMotor(MotorSpec motor, double rate, double acceleration);

/// The UART or SPI of a chip on the rig.
struct TmcSpec {
  std::string port;       ///< as configured: chips of the same serial port share a wire
  int address = 0;        ///< as its address pins are strapped
  int version = 0x21;     ///< of IOIN: 20h TMC2208, 21h TMC2209, 11h TMC2130, 30h TMC5160
  bool has_power = true;  ///< false: it doesn't answer
};

/// What happens to the bytes on the wire of a serial port of the rig: each byte is lost, doubled or
/// gets a wrong bit with this probability. The sequence is the same each time.
struct WireFaults {
  double lost = 0.0;
  double doubled = 0.0;
  double flipped = 0.0;
  bool no_echo = false;  ///< the port doesn't hear what it sends
  /// The chips can't measure the baud rate: they take no frame for one.
  bool unmeasured_rate = false;
  /// From a byte of an answer on, the rest is heard only after the next bytes were sent.
  double late = 0.0;
};

/// What a chip with a serial interface measures on the rig.
struct TmcTrouble {
  bool prewarning = false;  ///< it is above 120 degrees
  bool over_temperature = false;
  bool short_a = false;  ///< to ground: its outputs are off until they are disabled
  bool short_b = false;
  bool undervoltage = false;  ///< of the charge pump: its outputs are off
  bool open_a = false;
  bool open_b = false;
};

/// An axis of the rig, as it is built and wired.
struct RigAxisSpec {
  std::string name;
  driver::DriverChip chip;  ///< its times are what counts as a violation
  /// On a chip with CW and CCW inputs, step is CW and dir is CCW.
  Wire step, dir, enable, ms1, ms2, ms3, sleep, reset, in1, in2, in3, in4;
  /// The lines may keep the coils' current when they are released.
  bool keeps_coils = false;
  int microsteps = 1;             ///< the DIP switches, or how unwired microstep pins are strapped
  double full_step_travel = 0.0;  ///< [mm|deg] travel of the carriage per full step; above 0
  double start = 0.0;             ///< [mm|deg] where the carriage stands when the rig is made
  std::optional<SwitchSpec> min_switch, max_switch;
  /// Flags that its carriage passes. Several may have one line.
  std::vector<SwitchSpec> flags;
  /// [mm|deg] Where a block stops the carriage, whatever the motor does; empty: nowhere. Only of an
  /// axis with motors of its own.
  std::optional<double> block_min, block_max;
  /// An output that is active from a step that a block stopped until one that moves the carriage;
  /// empty: not wired.
  std::string stall_line;
  bool stall_active = true;
  /// The driver's in-position output; empty: not wired. It is active while current flows, from
  /// settling_ns after the last pulse on.
  std::string in_position_line;
  std::int64_t settling_ns = 0;
  std::string fault_line;  ///< the chip's fault output, with a pull-up; empty: not wired
  std::optional<BrakeSpec> brake;
  /// [mm/s|deg/s] how fast the load sinks towards min while neither the motor nor a brake holds it
  double load_falls = 0.0;
  std::optional<SpringSpec> spring;
  std::optional<MotorLimits> limits;  ///< empty: its motor may do anything
  std::optional<MotorSpec> motor;     ///< empty: its rotor follows the field whatever comes
  /// Empty: the chip has no serial interface. Otherwise it begins with its registers reset: its
  /// microsteps are those of its address pins until they are written.
  std::optional<TmcSpec> tmc;
};

/// Axes whose motors together move their carriages, as on a CoreXY. A turn of the n-th axis's motor
/// is a way of the n-th column of `inverse`.
struct RigCoupling {
  std::vector<std::string> axes;
  /// For each motor: [mm|deg] for each mm or degree of each carriage, in full_step_travel of its
  /// axis.
  std::vector<std::vector<double>> matrix;
  /// For each carriage: [mm|deg] for each mm or degree of each motor.
  std::vector<std::vector<double>> inverse;
};

/// An output with a name, which the rig shows in its trace.
struct RigOutput {
  std::string name;
  std::string line;
  bool active_level = true;  ///< level of the line while it is on
};

/// An input with a name: a switch that is pressed by hand. Its position and hysteresis aren't used.
struct RigInput {
  std::string name;
  SwitchSpec contact;
};

/// The lines with a name of the rig.
struct RigIo {
  std::vector<RigOutput> outputs;
  std::vector<RigInput> inputs;
};

/// Everything that the chip must never see. One edge may violate several of these. A time of
/// exactly the limit is no violation.
enum class Violation {
  kShortStepHigh,
  kShortStepLow,
  kDirSetup,
  kDirHold,
  kModeSetup,
  kModeHold,
  kUndefinedMode,      ///< an undefined code on the microstep pins, even in passing or at a step
  kStepWhileDisabled,  ///< whether the chip counts it or not
  kStepAfterEnable,    ///< before the enable time is over
  kStepWhileAsleep,
  kStepAfterWake,     ///< before the wake-up time is over
  kStepInReset,       ///< while RESET is held, or before the time after it is over
  kUndefinedPattern,  ///< coils that no step has together
  kPatternJump,       ///< the next pattern isn't that of a step before or behind
  kCoilLeftOn,        ///< a single coil of full steps, or a current when the lines are released
  kBothInputs,        ///< a pulse on CW while CCW is active, or the other way round
  /// A step towards a switch that is active, unless it was read as inactive since the step before.
  /// An axis of a RigCoupling may get about a microstep further: motors that stop it together make
  /// their steps one after the other.
  kStepIntoSwitch,
  kStepAgainstBrake,  ///< before the brake is released and its release time is over
  kStepWithoutPower,  ///< while the motor power is off, or before it is there
  /// Steps faster than MotorLimits::rate, by more than a hundredth, which trajectories may have.
  kAboveTopRate,
  /// Steps whose speed changes faster than MotorLimits::acceleration, by more than a hundredth.
  /// Steps may end at once; what follows then begins from rest.
  kAboveAcceleration,
};

/// The violation in words, as in reports: `short step high`.
const char* nameOf(Violation violation);

/// What an axis of the rig has seen so far.
struct RigAxisReport {
  /// Active STEP edges with DIR forward, whether the chip counts them or not.
  std::int64_t pulses_forward = 0;
  std::int64_t pulses_backward = 0;
  std::int64_t translator = 0;  ///< microsteps of the finest mode, counted from Home at the start;
                                ///< RESET and SLEEP take it to the nearest Home
  double carriage = 0.0;        ///< [mm|deg]
  int microsteps = 1;           ///< the mode at the last STEP edge
  double fell = 0.0;            ///< [mm|deg] how far the load has sunk, in total
  /// [mm|deg] The amplitude with which the mass on the spring would ring on if the carriage stayed
  /// here and nothing damped it; 0 without a spring.
  double ringing = 0.0;
  /// [electrical degrees] The largest angle so far between field and rotor of its motor. A full
  /// step is 90 degrees; at 180 steps are lost. Without a RigAxisSpec::motor it is 0.
  double largest_lag = 0.0;
  std::int64_t lost_steps = 0;  ///< full steps that the rotor lost, in total: four at each slip
  bool energized = false;       ///< current flows: enabled, awake, not in RESET, and with power
  bool min_pressed = false;     ///< the reading of its line at the rig's latest time
  bool max_pressed = false;
  std::map<Violation, std::int64_t> violations;  ///< only kinds that occurred
  /// The first step beyond MotorLimits, with its time and numbers; empty if there was none.
  std::string beyond_limits;

  /// The number of violations of all kinds together.
  std::int64_t totalViolations() const;
};

/// Faults to simulate.
struct RigFaults {
  std::optional<bool> min_stuck;  ///< the switch always reads active (true) or inactive
  std::optional<bool> max_stuck;
  std::int64_t lose_every = 0;  ///< every n-th motor step, counted from setFaults() on, slips: the
                                ///< carriage stays behind permanently; 0: no step slips
  /// Over-current after this many steps of the motor, counted from setFaults() on: the outputs are
  /// off and the fault output is active, until what ends a fault of the chip
  /// (driver::DriverChip::fault_end).
  std::optional<std::int64_t> chip_fault_after;
  /// How long its cause lasts, for a chip whose fault ends by itself; 0: for ever.
  std::int64_t chip_fault_lasts_ns = 0;
  /// The driver chip misses so many of the next pulses on STEP, and counts so many of the next ones
  /// twice, as with a bad wire.
  int missed_pulses = 0;
  int doubled_pulses = 0;
  bool never_in_position = false;  ///< the in-position output stays inactive
};

/// The model of an axis. STEP's active edge moves the translator to the next index of the mode if
/// the chip counts: it must not be asleep or in RESET, and must be enabled unless it counts while
/// disabled. While current flows, the rotor follows the translator, and the carriage follows the
/// rotor. When current starts to flow, the rotor snaps to the nearest position with the
/// translator's phase, a multiple of an electrical cycle away from the translator's own count. DIR
/// high at the chip is forward: the carriage's position grows. On a chip with CW and CCW inputs,
/// pulses on CW are forward, and those on CCW backward. Lines that switch the coils of a motor act
/// together at the end of their write: current flows while any of them is on, and a pulse is a step
/// to another pattern. While a brake is engaged the rotor doesn't turn; when it is released, the
/// rotor snaps as above. A load turns the rotor back while neither current nor the brake holds it.
/// Without motor power no current flows in any axis; when the power comes, each chip with a
/// translator begins with it at the nearest Home.
///
/// Lines. Before its first request a line has the level of a pull resistor towards the safe side:
/// disabled, asleep, in RESET, everything else inactive or low. The first request makes no edge:
/// the line is assumed to have had its level always, but a chip that it enables, wakes up or
/// releases from RESET is in that state only from then on. A released line keeps its level; a later
/// request with another level makes an edge. Lines that no axis knows are ignored, and unknown
/// inputs read low until setInput(). A line may go to several pins and axes; switches that share a
/// line read active if any of them does. The watcher of a switch is told when the carriage or a
/// fault changes its line, but not of the bounces after that.
///
/// All calls are safe from any thread. A time before the latest one so far counts as the latest
/// one.
///
/// @code{.cpp}
/// sim::RigAxisSpec x;
/// x.name = "x";
/// sim::Rig rig({x});
/// std::cout << rig.report("x").pulses_forward << " pulses\n";
/// @endcode
class Rig : public gpio::Board {
 public:
  /// @param trace receives every edge in the order of time, including those of bouncing switches;
  ///   levels are those of the lines. May be null.
  /// @param couplings the motors of all other axes move only their own carriages.
  /// @param motor_power empty: the power is always there.
  /// @param io further lines.
  /// @throw Error if an axis is named twice, doesn't travel, or has microsteps that its chip
  /// doesn't
  ///   have, or if a coupling names an axis that there isn't, or has matrices of another size.
  explicit Rig(const std::vector<RigAxisSpec>& axes, std::shared_ptr<PinTrace> trace = nullptr,
               const std::vector<RigCoupling>& couplings = {},
               const std::optional<MotorPowerSpec>& motor_power = {}, const RigIo& io = {});
  ~Rig() override;

  /// @throw Error if there is no such axis; so do all functions that take an axis.
  RigAxisReport report(const std::string& axis) const;
  /// Their names, in the order in which they were given.
  std::vector<std::string> axes() const;

  /// Takes effect at the rig's latest time.
  void setFaults(const std::string& axis, const RigFaults& faults);

  /// The relay of the motor power doesn't follow its line from now on: the power is there (true:
  /// its contacts are welded), or it isn't (false: a fuse, or a safety relay). Empty: it follows.
  ///
  /// @throw Error if there is no such relay.
  void stickMotorPower(std::optional<bool> on, std::int64_t time_ns);

  /// The write that comes after `writes` more successful ones on this line fails with `error` (an
  /// errno), and so do all after it until clearWriteFault(). A write that fails because of another
  /// line may count.
  ///
  /// @throw Error if the name is empty, as it is of a pin that isn't wired; so do all functions
  /// that
  ///   take a line.
  void failWrites(const std::string& line, std::int64_t writes, int error);
  /// Writes of this line succeed again.
  void clearWriteFault(const std::string& line);

  /// Presses an input with a name, or releases it; it bounces as its switch does.
  ///
  /// @throw Error if there is no such input.
  void pressInput(const std::string& name, bool pressed, std::int64_t time_ns);

  /// The contacts of a line, or of an input with that name, read active (true) or inactive from now
  /// on; empty: they work again.
  void stickInput(const std::string& line, std::optional<bool> active, std::int64_t time_ns);

  /// The level of an output; empty if it was never requested.
  std::optional<bool> outputLevel(const std::string& line) const;

  /// Sets the level of an input that belongs to no axis, such as the emergency stop.
  void setInput(const std::string& line, bool level, std::int64_t time_ns);

  /// Moves the carriage as if by hand: no step is counted, and the rotor turns with it. If current
  /// flows, it snaps to the nearest position with the translator's phase, up to two full steps
  /// away.
  void placeCarriage(const std::string& axis, double position, std::int64_t time_ns);

  /// Something has stopped the clock, so that the next steps may be late: speeds and accelerations
  /// are then judged again from the second step on.
  void clockStalled();

  /// @name Chips with a serial interface
  /// @throw Error if the axis, or the port, has none.
  /// @{
  /// The chip loses its supply for a moment: its registers and its translator are reset.
  void brownOut(const std::string& axis);
  /// The chip has power, or none: then it doesn't answer. Its registers are reset when it comes.
  void powerChip(const std::string& axis, bool has_power);
  void setTrouble(const std::string& axis, const TmcTrouble& trouble);
  void setWireFaults(const std::string& port, const WireFaults& faults);
  /// What was written last to a register of the chip, whether it can be read or not.
  std::uint32_t registerOf(const std::string& axis, int number) const;
  bool hasSerial(const std::string& port) const override;
  std::vector<std::uint8_t> onBytes(const std::string& port, const std::uint8_t* bytes,
                                    std::size_t count, bool pause, std::int64_t time_ns) override;
  /// @}

  /// Makes the trace readable up to its last edge while the rig lives.
  ///
  /// @throw Error if the trace is incomplete because it couldn't be written; it names the reason.
  void flushTrace();

  int lineIndex(const std::string& line) override;
  void onRequest(int line, bool level, std::int64_t time_ns) override;
  void onEdge(int line, bool level, std::int64_t time_ns) override;
  void onWriteEnd(std::int64_t time_ns) override;
  void onRelease(int line, std::int64_t time_ns) override;
  bool inputLevel(int line, std::int64_t time_ns) override;
  int writeFault(int line, std::int64_t time_ns) override;
  void watchInput(int line, gpio::EdgeListener listener) override;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace stepdriver::sim
