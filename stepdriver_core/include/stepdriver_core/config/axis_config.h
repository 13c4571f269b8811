#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "stepdriver_core/bias.h"
#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/kinematics/kinematics.h"

namespace stepdriver::config {

/// How a driver chip chops the current of its coils.
enum class ChopperMode {
  kStealthChop,  ///< silent, for low and medium speeds
  kSpreadCycle,  ///< audible, with more torque at high speeds
};

/// How a driver chip detects a stall of its motor (StallGuard), for a homing to it.
struct StallConfig {
  /// Of a TMC2209 or TMC2226, 0 to 255: SG_RESULT at or below twice this is a stall; higher is more
  /// sensitive. Of a TMC2130 or TMC5160, -64 to 63 (SGT): lower is more sensitive. It depends on
  /// the speed, the current and the motor.
  int threshold = 0;
  double current = 0.0;  ///< [A rms] of a coil, while it approaches
  /// 0 to 1023: MSCNT, the place in the electrical cycle, at which the motor is blocked; empty: not
  /// known. With it the place is found to a microstep, without it to about 4 full steps.
  std::optional<int> phase;
};

/// How a driver chip detects in any motion that its motor has stalled (StallGuard), which is a
/// fault.
struct StallFaultConfig {
  int threshold = 0;   ///< see StallConfig
  double above = 0.0;  ///< [full steps/s] of the motor: below this speed SG_RESULT means nothing
};

/// A driver chip that is configured and diagnosed over its UART or SPI. A program that makes its
/// own config::MotorConfig gives it a driver::registerChip().
///
/// @code{.cpp}
/// config::TmcConfig tmc;
/// tmc.port = "/dev/serial0";
/// tmc.sense_resistor = 0.11;  // [Ohm]
/// tmc.run_current = 0.8;      // [A rms]
/// config::AxisConfig x;
/// x.driver = driver::registerChip(driver::driverChip("tmc2209"));
/// x.tmc = tmc;
/// @endcode
struct TmcConfig {
  /// Serial port, such as `/dev/serial0`, or SPI device, such as `/dev/spidev0.0`.
  std::string port;
  int baud = 115200;            ///< the same for all chips of a port; 0 on SPI
  int address = 0;              ///< MS1 + 2 MS2; 0 on a TMC2208, and on SPI
  double sense_resistor = 0.0;  ///< [Ohm] of the board
  double run_current = 0.0;     ///< [A rms] of a coil, in motion
  double hold_current = 0.0;    ///< [A rms] at rest, hold_delay after the last step
  double hold_delay = 0.5;      ///< [s]
  /// [A rms] at rest after the idle timeout, with kLowerCurrent of IdleAction.
  std::optional<double> idle_current;
  ChopperMode mode = ChopperMode::kStealthChop;
  /// [full steps/s] With kStealthChop: above this speed of the motor it chops as kSpreadCycle does;
  /// 0: at none.
  double spread_cycle_above = 0.0;
  std::optional<StallConfig> stall;
  std::optional<StallFaultConfig> stall_fault;
  bool interpolate = true;  ///< the chip divides each microstep into steps of 1/256
};

/// The lowest limits that an axis may have, from any source. They are far below any machine, and
/// well within what the motion can count and time in 64 bits.
constexpr double kLowestRate = 1e-3;          ///< [steps/s]
constexpr double kLowestAcceleration = 1e-3;  ///< [steps/s^2]
constexpr double kLowestJerk = 1e-3;          ///< [steps/s^3]

/// What an axis moves along, which determines its units.
enum class Kind {
  kLinear,  ///< mm in configurations, m elsewhere
  kRotary,  ///< degrees in configurations, rad elsewhere
};

/// Units of configurations (mm or degrees) per unit of the axis (m or rad).
constexpr double configUnitsPerUnit(Kind kind) {
  return kind == Kind::kLinear ? 1000.0 : 180.0 / 3.14159265358979323846;
}

/// [rad] A turn of a rotary axis.
constexpr double kTurn = 2.0 * 3.14159265358979323846;

/// The axis's unit in messages and on every ROS interface: "m" or "rad".
constexpr const char* unitOf(Kind kind) { return kind == Kind::kLinear ? "m" : "rad"; }

/// A place of an axis with its unit, as messages show it: rounded to what a microstep is worth, so
/// that the rounding of sums doesn't show. "0.05 m"
std::string placeText(double position, Kind kind, double steps_per_unit);

/// A distance between two places of an axis, with its unit: rounded like a place. One that is
/// shorter than a microstep keeps two digits, because a target need not be on a whole microstep.
/// "0.0000063 m"
std::string distanceText(double distance, Kind kind, double steps_per_unit);

/// A line of the driver chip. An empty name: the pin isn't wired.
struct Pin {
  std::string line;       ///< `chip:offset`, `label:offset` or the kernel's name
  bool inverted = false;  ///< the wiring inverts the level on its way to the chip

  bool wired() const { return !line.empty(); }
};

/// The lines to the pins of a driver chip. ms1 to ms3 are M0 to M2 on a DRV8825. On a driver with
/// CW and CCW inputs, step is CW and dir is CCW. A driver with coils (kPhases) has
/// in1 to in4 alone.
struct Pins {
  Pin step, dir, enable, ms1, ms2, ms3, sleep, reset, in1, in2, in3, in4;
  /// The pin that switches a coil, by its number from 0.
  const Pin& coil(std::size_t number) const {
    return *std::array<const Pin*, driver::kCoils>{&in1, &in2, &in3, &in4}.at(number);
  }
};

/// A switch on an input line: an endstop, or the emergency stop of the whole machine.
struct InputSwitch {
  std::string line;
  bool active_level = false;  ///< level of the line while the switch is pressed
  Bias bias = Bias::kAsIs;
};

/// A switch at one end of an axis.
struct Endstop : InputSwitch {
  /// Its line is also that of the other end, or of ends of other axes: it is active while any of
  /// these switches is pressed.
  bool shared = false;
};

/// The driver's fault or alarm output, such as nFAULT: an open drain that is pulled low at
/// over-current or over-temperature.
struct FaultPin {
  std::string line;
  Bias bias = Bias::kAsIs;
};

/// The in-position output of a closed-loop driver, which a motion waits for at its end.
struct InPositionPin {
  std::string line;
  Bias bias = Bias::kAsIs;
  double timeout = 1.0;  ///< [s] after the last step; if it is missing by then, that is a fault
};

/// A brake that holds the load while the motor can't, such as that of a vertical axis. It is
/// engaged before the motor loses its current, and released after the current has come.
struct BrakeConfig {
  std::string line;
  bool release_level = true;    ///< level of the line that releases it; the other one engages it
  std::int64_t release_ns = 0;  ///< [ns] from that level until the motor can turn
  std::int64_t engage_ns = 0;   ///< [ns] from the other level until it holds the load
};

/// How the motor's current is switched off or lowered at rest.
enum class IdleAction {
  kDisable,
  kSleep,
  kLowerCurrent,  ///< to TmcConfig::idle_current of each of its motors
};

/// What tells an axis where it is when it is homed.
enum class HomingKind {
  kLimit,       ///< the place where one of its endstop switches closes
  kFlag,        ///< the edge of a flag, a switch that it passes on both sides
  kFlagCentre,  ///< the middle of a flag
  kIndex,   ///< an index pulse, which comes once a turn of the motor, after a flag's edge or alone
  kBlock,   ///< the place where its motor is blocked
  kDirect,  ///< nothing: it is where it stands
  kStall,   ///< the place where its driver chip detects a stall, see TmcConfig::stall
};

/// What it means if the flag of a homing comes at another place later.
enum class FlagCheck {
  kNone,     ///< nothing looks
  kWarning,  ///< AxisState::position_note says so
  kFault,    ///< the axis has a fault, and its position can't be trusted
};

/// How an axis finds its zero: at its trigger point. A unit is m on a linear axis, rad on a rotary
/// one.
struct HomingConfig {
  HomingKind kind = HomingKind::kLimit;
  /// The switch is the max endstop, or of other kinds, the axis moves towards max; false: min.
  bool at_max = false;
  /// The input with a name that tells of a flag, an index or a block. It may be active for an
  /// instant only, but not that of a flag. Empty, of a kBlock only: the fault outputs of its
  /// drivers tell of it.
  std::string input;
  std::string flag;    ///< of a kIndex, the input of the flag before it; empty: the next one counts
  int approaches = 1;  ///< of a kBlock: 2 for a second one at latch_speed
  double seek_speed = 0.0;   ///< [unit/s] the speed of the first approach to the trigger point
  double latch_speed = 0.0;  ///< [unit/s] off the switch, and back to the trigger point
  double pull_off = 0.0;     ///< [unit] from the trigger point to the final position
  /// [unit] Where the axis stands at the end; empty: pull_off away from the trigger point.
  std::optional<double> final_position;
  double offset = 0.0;      ///< [unit] position of the trigger point
  double max_travel = 0.0;  ///< [unit] longest stroke to reach or leave the switch
  double timeout = 60.0;    ///< [s] for the whole homing
  double debounce = 0.005;  ///< [s] a level of the endstop must last so long to count
  FlagCheck check_at_flag = FlagCheck::kNone;
  double flag_tolerance = 0.0;  ///< [unit] of that check
  int order = 0;  ///< axes with the lowest number go first; the same number: simultaneously
};

/// Who sets a limit of an axis. Of several the tightest counts.
enum class LimitSource {
  kConfiguration,     ///< the axis's own keys
  kRobotDescription,  ///< its joint in the URDF
  kSetLimits,         ///< a call that lowered it while the machine runs
  kChip,              ///< the highest step rate of the driver chip
};

/// The source as messages name it: "the configuration".
const char* sourceText(LimitSource source);

/// The most motors that an axis can have.
constexpr std::size_t kMostMotors = 4;

/// A motor of an axis: its driver and that one's pins, and the switches at its side.
struct MotorConfig {
  std::string motor;          ///< its name; empty: it is the only one
  driver::DriverChip driver;  ///< with the overrides of the configuration
  Pins pins;
  /// Empty: the chip is configured by its pins alone.
  std::optional<TmcConfig> tmc;
  std::optional<Endstop> endstop_min;
  std::optional<Endstop> endstop_max;
  std::optional<FaultPin> fault;
  /// At a fault of the driver in motion, which its fault pin or its registers report, the axis
  /// decelerates to rest; false: its steps end at once. If one motor has it, all have.
  bool fault_ramps = false;
  std::optional<InPositionPin> in_position;
  /// Lines switch its current: ENABLE, or those of its coils.
  bool hasSwitchedCurrent() const { return pins.enable.wired() || hasPhases(); }
  /// A step is the next pattern of its coils.
  bool hasPhases() const { return driver.step_inputs == driver::StepInputs::kPhases; }
  /// [unit] Where its home switch closes, relative to HomingConfig::offset, when the motors are
  /// square.
  double offset = 0.0;
};

/// How the motions of an axis are shaped, see motion::InputShaper.
enum class ShaperType { kZv, kMzv, kEi, kTwoHumpEi };

/// What shapes its motions, so that one oscillation of the machine comes to rest with them.
struct ShaperConfig {
  ShaperType type = ShaperType::kMzv;
  double frequency = 0.0;  ///< [Hz] above 0
  double damping = 0.1;    ///< its damping ratio: from 0 to below 1
};

/// The complete configuration of an axis, checked by readAxes(). A unit is m on a linear axis, rad
/// on a rotary one; a step is a microstep of the configured mode.
///
/// An axis with several motors, such as a gantry, has those of the first one here and all others in
/// `twins`. They step together: what kind of edges makes a step is the same for all their drivers,
/// each has the configured microsteps, and ENABLE and SLEEP are wired for all or for none.
///
/// @code{.cpp}
/// config::AxisConfig x;
/// x.name = x.joint = "x";
/// x.driver = driver::driverChip("a4988");
/// x.pins.step.line = "gpiochip0:17";
/// x.pins.dir.line = "gpiochip0:27";
/// x.microsteps = 16;
/// x.steps_per_unit = 80'000.0;  // 80 steps/mm
/// x.max_speed = 0.1;            // [m/s]
/// x.acceleration = x.deceleration = 1.0;  // [m/s^2]
/// config::checkAxes({x});
/// @endcode
struct AxisConfig : MotorConfig {
  std::string name;
  std::string joint;  ///< its name in joint_states and in the URDF
  Kind kind = Kind::kLinear;
  std::vector<MotorConfig> twins;
  /// Of an axis that shares motors, the same for all of them; null: its motors are its own.
  std::shared_ptr<const Kinematics> kinematics;

  int microsteps = 1;            ///< microsteps per full step, as counted by steps_per_unit
  double steps_per_unit = 0.0;   ///< [steps/unit]
  double steps_per_round = 0.0;  ///< [steps per motor revolution]; 0: not known

  double max_speed = 0.0;     ///< [unit/s]
  double start_speed = 0.0;   ///< [unit/s] reached without a ramp (pull-in); 0: ramps start at rest
  double acceleration = 0.0;  ///< [unit/s^2]
  double deceleration = 0.0;  ///< [unit/s^2]
  /// [unit/s^2] For stops; at least the deceleration, which is also the default.
  std::optional<double> stop_deceleration;
  double jerk = 0.0;  ///< [unit/s^3] 0: the acceleration may jump
  /// One for each oscillation; empty: motions are made as they are planned. There are none with a
  /// start speed or a backlash.
  std::vector<ShaperConfig> input_shaper;
  double backlash = 0.0;  ///< [unit] travel that a reversal loses; the motor makes it up
  /// A rotary axis that turns without end, without soft limits: positions that differ by whole
  /// turns are the same place. Trajectories then go to the nearest one, see
  /// Machine::followTrajectory().
  bool continuous = false;
  std::optional<double> min_position;  ///< [unit] soft limits
  std::optional<double> max_position;
  LimitSource max_speed_source = LimitSource::kConfiguration;
  LimitSource min_position_source = LimitSource::kConfiguration;
  LimitSource max_position_source = LimitSource::kConfiguration;

  /// ENABLE or SLEEP is wired if there is a brake.
  std::optional<BrakeConfig> brake;

  /// [unit] If both its ends share one line: the way on which the switch opens for certain, from
  /// wherever it is pressed. It must be longer than the hysteresis of the switch, and shorter than
  /// half of the way between the ends. 0: they don't.
  double switch_release = 0.0;
  /// The end that presses that switch if nothing tells, as after the start: true: max; false: min.
  /// Empty: then the axis is refused all motions until it was moved off by hand.
  std::optional<bool> assumed_end_is_max;

  std::optional<HomingConfig> homing;
  /// [unit] How far the motors may get apart while a homing squares them.
  double max_skew = 0.0;
  bool require_homing = false;  ///< no absolute move until homed; in files true with a homing

  bool enable_on_start = false;
  bool disable_on_shutdown = true;
  /// If the current position doesn't exist in the new mode, a microstep change first moves to the
  /// nearest common one; if false, it is refused.
  bool align_on_microstep_change = false;

  double idle_timeout = 0.0;                      ///< [s] at rest until the idle action; 0: never
  IdleAction idle_action = IdleAction::kDisable;  ///< its pin is wired with a timeout
  /// The carriage stays where it is without current, as with a self-locking screw.
  bool holds_position_unpowered = false;

  std::size_t motors() const { return 1 + twins.size(); }
  const MotorConfig& motorAt(std::size_t index) const {
    return index == 0 ? *this : twins[index - 1];
  }
  /// Whether any of its motors has an endstop at that end.
  bool hasEndstop(bool at_max) const {
    for (std::size_t i = 0; i < motors(); ++i) {
      if (at_max ? motorAt(i).endstop_max : motorAt(i).endstop_min) return true;
    }
    return false;
  }

  /// Whether any of its motors has a driver with a TmcConfig.
  bool hasTmc() const {
    for (std::size_t i = 0; i < motors(); ++i) {
      if (motorAt(i).tmc) return true;
    }
    return false;
  }

  /// @name The drivers of its motors, which get the same edges at the same time
  /// @{
  /// Each edge of STEP is a step.
  bool stepsOnBothEdges() const { return driver.both_edges; }
  bool hasCwCcwInputs() const { return driver.step_inputs == driver::StepInputs::kCwCcw; }
  /// The times that suit all of them: of each time the longest.
  driver::Timing timing() const;
  /// [ns] The shortest time from one step to the next one.
  std::int64_t shortestStepNs() const {
    return driver::shortestStepNs(timing(), stepsOnBothEdges());
  }
  /// "DM542", or of several, "A4988 and DM542". Each is named once.
  std::string driverTitles() const;
  /// @}

  /// The name of a motor on the simulated rig and in traces of pins: "y", the axis's, for the first
  /// one, and "y.right" for another.
  std::string traceName(std::size_t index) const {
    return index == 0 ? name : name + "." + motorAt(index).motor;
  }
};

/// [unit/s] The top speed of a motor that axes share, if all of them move at theirs.
double highestMotorSpeed(const Kinematics& kinematics, std::size_t motor,
                         const std::vector<AxisConfig>& axes);

/// [steps] The farthest soft limit that an axis may have, from any source: 2^53, because doubles
/// represent each step up to there exactly.
constexpr double kFarthestLimit = 9007199254740992.0;

/// Checks axes that a program has made itself, by the rules of a configuration file: readAxes() has
/// checked those of a file already. A machine::Machine and a setup::Hardware call it. Messages name
/// the keys and the units of a file.
///
/// @throw ConfigError with all issues, for example "axes/x/deceleration_mm_s2: is 0.0, but must be
///   above 0".
void checkAxes(const std::vector<AxisConfig>& axes);

/// What is allowed, but may not be meant, of the order in which axes are homed: an axis with a
/// brake, which may carry a load, is homed together with others, whose way it may be in.
///
/// @return a sentence for each such axis.
std::vector<std::string> homingWarnings(const std::vector<AxisConfig>& axes);

}  // namespace stepdriver::config
