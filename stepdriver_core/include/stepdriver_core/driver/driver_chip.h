#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

/// What step/dir drivers require, as data: a chip that a configuration describes and a named one
/// are the same thing; and what a chip with registers has told of itself. No I/O.
namespace stepdriver::driver {

/// The levels of the microstep pins, in the order of their numbers (MS1 MS2 MS3, M0 M1 M2); true is
/// high. A chip with two of them leaves the third one low.
using ModeCode = std::array<bool, 3>;
constexpr std::size_t kMostModePins = std::tuple_size_v<ModeCode>;

/// One code of the microstep pins and the mode that it selects.
struct Mode {
  int microsteps;  ///< microsteps per full step
  ModeCode code;
};

/// The times that the chip requires, in nanoseconds. The configuration can override each of them.
struct Timing {
  std::int64_t step_high_ns = 0;   ///< shortest active STEP pulse
  std::int64_t step_low_ns = 0;    ///< shortest gap between two pulses
  std::int64_t dir_setup_ns = 0;   ///< DIR stable before the active STEP edge
  std::int64_t dir_hold_ns = 0;    ///< DIR stable after the active STEP edge
  std::int64_t mode_setup_ns = 0;  ///< microstep pins stable before the active STEP edge
  std::int64_t mode_hold_ns = 0;   ///< microstep pins stable after the active STEP edge
  std::int64_t enable_ns = 0;      ///< from enabling to the first STEP
  std::int64_t wake_ns = 0;        ///< from the end of SLEEP to the first STEP
  std::int64_t reset_low_ns = 0;   ///< how long RESET is held, or ENABLE off to end a fault
  std::int64_t reset_wait_ns = 0;  ///< from the end of RESET to the first STEP
};

/// What a chip does with STEP and with its translator while it is disabled or asleep.
enum class TranslatorState {
  kHeld,    ///< it ignores STEP, and its translator stays
  kCounts,  ///< STEP moves the translator although the outputs are off
  kHome,    ///< it ignores STEP, and its translator goes to Home
};

/// What ends the report of a fault when its cause is gone.
enum class FaultEnd {
  kItself,  ///< nothing is needed: it isn't latched
  kReset,   ///< a pulse on RESET
  kEnable,  ///< ENABLE switched off for Timing::reset_low_ns, and on again
  kPower,   ///< no line: only switching the driver's power off
};

/// How the steps reach a driver.
enum class StepInputs {
  kStepDir,  ///< pulses on STEP, in the direction of DIR
  kCwCcw,    ///< pulses on CW are steps forward, pulses on CCW steps backward
  kPhases,   ///< IN1 to IN4 switch the coils of a motor: a step is their next pattern
};

/// The inputs of a driver with kPhases, each of a coil.
constexpr std::size_t kCoils = 4;
/// Coils that have current, a bit for each: the lowest is that of IN1.
using CoilSet = std::uint8_t;
/// The half steps of an electrical cycle, from Home. Those with two coils are the full steps. From
/// one to the next, a single coil is switched.
constexpr std::array<CoilSet, 8> kHalfSteps = {0b0011, 0b0010, 0b0110, 0b0100,
                                               0b1100, 0b1000, 0b1001, 0b0001};

/// A driver chip or a driver box according to its datasheet, wired without inversions.
///
/// @code{.cpp}
/// driver::DriverChip mine = driver::driverChip("a4988");
/// mine.title = "A4988 behind an optocoupler";
/// mine.timing.step_high_ns = 5'000;
/// mine.timing.step_low_ns = 5'000;
/// @endcode
struct DriverChip {
  std::string name;   ///< as in configurations: a4988
  std::string title;  ///< as in messages: A4988
  Timing timing;

  /// Codes that software can select; empty: the mode is set by switches or straps. If several codes
  /// select the same mode, software uses the first.
  std::vector<Mode> modes;
  int mode_pins = 0;                 ///< how many microstep pins there are
  bool mode_pins_from_0 = false;     ///< their names are M0 M1 M2, not MS1 MS2 MS3
  std::vector<int> microsteps;       ///< the available modes, set by pins, straps or switches
  bool opto_inputs = false;          ///< the inputs are LEDs, which can be wired to a common anode
  bool step_active = true;           ///< the level of STEP after its active edge
  bool enable_on = false;            ///< level of ENABLE that energizes the motor
  std::optional<bool> sleep_asleep;  ///< level of SLEEP that puts it to sleep; empty: no such pin
  std::optional<bool> reset_held;    ///< level of RESET that holds the translator at Home
  std::optional<bool> fault_active;  ///< level of its fault output at a fault; empty: no such pin
  FaultEnd fault_end = FaultEnd::kPower;
  std::string fault_name = "its fault output";  ///< as in messages: nFAULT
  /// Level of its in-position output while the motor is in position; empty: no such pin.
  std::optional<bool> in_position_active;
  std::string in_position_name = "its in-position output";  ///< as in messages: PEND
  StepInputs step_inputs = StepInputs::kStepDir;
  /// Each edge of STEP, or each change of the pattern of coils, is a step; step_high_ns and
  /// step_low_ns are the shortest times between them.
  bool both_edges = false;
  TranslatorState disabled = TranslatorState::kHeld;
  TranslatorState asleep = TranslatorState::kHome;
};

/// @param name in upper or lower case.
/// @return a named chip, which lives as long as the program; nullptr if there is no such name.
const DriverChip* findDriverChip(const std::string& name);

/// @param name in upper or lower case.
/// @throw Error if there is no driver of that name.
const DriverChip& driverChip(const std::string& name);

/// Names of all named chips, for messages and checks.
std::vector<std::string> driverChipNames();

/// @return the code with which software selects this mode; empty if the mode is unknown or is set
///   by switches.
std::optional<ModeCode> codeOf(const DriverChip& chip, int microsteps);

/// @return the mode that the chip selects at these levels; empty if the datasheet leaves the code
///   undefined or the chip has no microstep pins.
std::optional<int> microstepsOf(const DriverChip& chip, const ModeCode& code);

/// @return the modes that software can select, in the order of their first codes.
std::vector<int> selectableMicrosteps(const DriverChip& chip);

/// The path from one mode to another on which each code differs from the one before it in one pin,
/// and every code is defined. A kernel driver may set pins one after the other; on this path no
/// undefined code appears in passing. The first code is left out; the path is empty if both modes
/// are the same.
///
/// @throw Error if a mode has no code on this chip, or no such path leads to it.
std::vector<ModeCode> modePath(const DriverChip& chip, int from_microsteps, int to_microsteps);

/// Whether there is such a path. @throw Error if a mode has no code on this chip.
bool hasModePath(const DriverChip& chip, int from_microsteps, int to_microsteps);

/// The times that suit two chips that get the same edges: of each time the longer one.
Timing longestOf(const Timing& one, const Timing& other);

/// [ns] The shortest time from one step to the next one.
/// @param both_edges each edge of STEP is a step.
std::int64_t shortestStepNs(const Timing& timing, bool both_edges);

/// Full steps in an electrical cycle; after one, the coil currents are the same again. After
/// power-up, RESET and SLEEP the translator stands at Home, a full-step position (45 degrees).
constexpr int kFullStepsPerCycle = 4;

/// Whether changing modes at this translator index (microsteps of `from` counted from Home) keeps
/// the position: the index must exist in both modes.
bool keepsPosition(std::int64_t index, int from_microsteps, int to_microsteps);

/// How the registers of a chip are reached.
enum class RegisterBus {
  kNone,  ///< it has none, or this version doesn't know them
  kUart,
  kSpi,
};
RegisterBus registerBusOf(const DriverChip& chip);

/// The chip as it is when its registers, and not its pins, select the microsteps: it has each power
/// of two up to 256. On a UART its address is at MS1 and MS2; on SPI the fault pin is DIAG0, which
/// pulls low. A config::MotorConfig with a config::TmcConfig has this chip.
///
/// @throw Error if it has no registers.
DriverChip registerChip(DriverChip chip);

/// What a driver chip has told of itself over its UART or SPI.
///
/// @code{.cpp}
/// const axis::AxisState x = machine.axis("x").state();
/// if (x.drivers == nullptr) return;  // none has registers that are known
/// for (const driver::DriverState& chip : *x.drivers) std::cout << chip.run_current << " A\n";
/// @endcode
struct DriverState {
  std::string motor;       ///< of an axis with several; empty: it is the only one
  bool is_set_up = false;  ///< its registers are written and verified
  /// [A rms] As set, in motion and at rest: the step of the chip's scale below what is wanted.
  double run_current = 0.0;
  double hold_current = 0.0;
  /// [A rms] At this moment, on the way from one to the other.
  double present_current = 0.0;
  bool stealth_chop = false;  ///< it chops silently at this moment
  int at_least_celsius = 0;   ///< the highest threshold that its temperature is above; 0: none
  bool temperature_warning = false;  ///< it will soon switch itself off
  bool open_load_a = false;          ///< no current flows in coil A; true at speed or at rest too
  bool open_load_b = false;
  /// SG_RESULT in the last motion, in which a TMC2209 is asked for it twenty times a second: the
  /// lower, the higher the load. It depends on the speed and the current, and means something only
  /// while the chip chops silently. Empty: the chip hasn't measured it.
  std::optional<int> stall_guard;
  double stall_guard_position = 0.0;  ///< [unit] of the axis, as planned, when SG_RESULT was read
  double stall_guard_velocity = 0.0;  ///< [unit/s] the same
  int highest_stall_guard = 510;      ///< without a load
  std::uint64_t transactions = 0;     ///< reads and writes of its registers that succeeded
  std::uint64_t retries = 0;          ///< that were tried again
};

/// How much of its capacity the load takes, from 0 to 1, to be compared at the same speed and
/// current only. Empty: the chip hasn't measured it.
std::optional<double> loadOf(const DriverState& driver);

}  // namespace stepdriver::driver
