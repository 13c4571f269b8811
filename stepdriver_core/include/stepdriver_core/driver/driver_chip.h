#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// What the driver chips need. Data, no I/O.
///
/// Sources: A4988: Allegro datasheet 4988-DS. DRV8825: TI datasheet SLVSA73F. TB6600 module:
/// DFRobot's TB6600 manual V1.2; where that gives no figure, what its slower clones need.
namespace stepdriver::driver {

/// The driver chips that there are data of.
enum class Model { kA4988, kDrv8825, kTb6600 };

/// The levels of the microstep pins MS1 MS2 MS3 (M0 M1 M2 on the DRV8825); true is high.
using ModeCode = std::array<bool, 3>;

/// One microstep mode and the code that selects it.
struct Mode {
  int microsteps;  ///< microsteps per full step
  ModeCode code;
};

/// How long the chip wants things to be, in nanoseconds. Each can be overridden by configuration.
struct Timing {
  std::int64_t step_high_ns;   ///< shortest active STEP pulse
  std::int64_t step_low_ns;    ///< shortest gap between two pulses
  std::int64_t dir_setup_ns;   ///< DIR stable before the active STEP edge
  std::int64_t dir_hold_ns;    ///< DIR stable after the active STEP edge
  std::int64_t mode_setup_ns;  ///< microstep pins stable before the active STEP edge
  std::int64_t mode_hold_ns;   ///< microstep pins stable after the active STEP edge
  std::int64_t enable_ns;      ///< from enabling to the first STEP
  std::int64_t wake_ns;        ///< from the end of SLEEP to the first STEP
  std::int64_t reset_low_ns;   ///< how long RESET is held
  std::int64_t reset_wait_ns;  ///< from the end of RESET to the first STEP
};

/// A driver chip as its datasheet has it, wired plainly (no inversion on the way to its pins).
struct DriverChip {
  Model model;
  std::string name;   ///< as in configurations: a4988, drv8825, tb6600
  std::string title;  ///< as in messages: A4988
  Timing timing;
  std::vector<Mode> modes;      ///< codes that software may drive; empty: set by DIP switches
  std::vector<int> microsteps;  ///< what it can be set to, by pins or by switches
  bool has_sleep;
  bool has_reset;
  bool has_fault;              ///< nFAULT: open drain, low at a fault, latched until RESET
  bool counts_while_disabled;  ///< STEP moves the translator although the outputs are off
  bool step_active;            ///< level of STEP after its active edge
  bool enable_on;              ///< level of ENABLE that energizes the motor
  bool sleep_asleep;           ///< level of SLEEP that puts the chip to sleep
  bool reset_held;             ///< level of RESET that holds the translator at Home
};

/// The data of a chip; they live as long as the program.
const DriverChip& driverChipOf(Model model);

/// @return nullptr where there is no driver of that name.
const DriverChip* findDriverChip(const std::string& name);

/// Names of all drivers, for messages and checks.
std::vector<std::string> driverChipNames();

/// @return the code that the chip's software selects this mode with; none where the mode is unknown
///   or is set by switches.
std::optional<ModeCode> codeOf(const DriverChip& chip, int microsteps);

/// @return what the chip does with these levels; none where the datasheet leaves the code undefined
///   or the chip has no microstep pins. Chips decode more codes than codeOf() uses.
std::optional<int> microstepsOf(const DriverChip& chip, const ModeCode& code);

/// The way from one mode to another on which each code differs from the one before it in one pin,
/// and every code is defined: a kernel driver may set pins one after the other, and so no undefined
/// code appears in passing. Without the first code; empty where both are the same.
///
/// @throw std::invalid_argument where a mode has no code on this chip.
std::vector<ModeCode> modePath(const DriverChip& chip, int from_microsteps, int to_microsteps);

/// Full steps in an electrical cycle; after one, the coil currents are the same again. After
/// power-up, RESET and SLEEP the translator stands at Home, a full-step position (45 degrees).
constexpr int kFullStepsPerCycle = 4;

/// Whether changing modes at this translator index (microsteps of `from` counted from Home) keeps
/// the position: both modes must have a place there.
bool keepsPosition(std::int64_t index, int from_microsteps, int to_microsteps);

}  // namespace stepdriver::driver
