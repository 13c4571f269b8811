#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The requirements of the driver chips. Data, no I/O.
///
/// Sources: A4988: Allegro datasheet 4988-DS. DRV8825: TI datasheet SLVSA73F. TB6600 module:
/// DFRobot's TB6600 manual V1.2; if it gives no figure, the needs of slower clones.
namespace stepdriver::driver {

/// The known driver chips.
enum class Model { kA4988, kDrv8825, kTb6600 };

/// The levels of the microstep pins MS1 MS2 MS3 (M0 M1 M2 on the DRV8825); true is high.
using ModeCode = std::array<bool, 3>;

/// One microstep mode and the code that selects it.
struct Mode {
  int microsteps;  ///< microsteps per full step
  ModeCode code;
};

/// The times that the chip requires, in nanoseconds. The configuration can override each of them.
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

/// A driver chip according to its datasheet, wired without inversions.
struct DriverChip {
  Model model;
  std::string name;   ///< as in configurations: a4988, drv8825, tb6600
  std::string title;  ///< as in messages: A4988
  Timing timing;
  std::vector<Mode> modes;      ///< codes that software can select; empty: set by DIP switches
  std::vector<int> microsteps;  ///< the available modes, set by pins or by switches
  bool has_sleep;
  bool has_reset;
  bool has_fault;              ///< nFAULT: open drain, low at a fault, latched until RESET
  bool counts_while_disabled;  ///< STEP moves the translator although the outputs are off
  bool step_active;            ///< the level of STEP after its active edge
  bool enable_on;              ///< level of ENABLE that energizes the motor
  bool sleep_asleep;           ///< level of SLEEP that puts the chip to sleep
  bool reset_held;             ///< level of RESET that holds the translator at Home
};

/// The data of a chip, which live as long as the program.
const DriverChip& driverChipOf(Model model);

/// @param name in upper or lower case.
/// @return nullptr if there is no driver of that name.
const DriverChip* findDriverChip(const std::string& name);

/// Names of all drivers, for messages and checks.
std::vector<std::string> driverChipNames();

/// @return the code with which software selects this mode; empty if the mode is unknown or is set
///   by switches.
std::optional<ModeCode> codeOf(const DriverChip& chip, int microsteps);

/// @return the mode that the chip selects at these levels; empty if the datasheet leaves the code
///   undefined or the chip has no microstep pins. Chips decode more codes than codeOf() uses.
std::optional<int> microstepsOf(const DriverChip& chip, const ModeCode& code);

/// The path from one mode to another on which each code differs from the one before it in one pin,
/// and every code is defined. A kernel driver may set pins one after the other; on this path no
/// undefined code appears in passing. The first code is left out; the path is empty if both modes
/// are the same.
///
/// @throw std::invalid_argument if a mode has no code on this chip.
std::vector<ModeCode> modePath(const DriverChip& chip, int from_microsteps, int to_microsteps);

/// Full steps in an electrical cycle; after one, the coil currents are the same again. After
/// power-up, RESET and SLEEP the translator stands at Home, a full-step position (45 degrees).
constexpr int kFullStepsPerCycle = 4;

/// Whether changing modes at this translator index (microsteps of `from` counted from Home) keeps
/// the position: the index must exist in both modes.
bool keepsPosition(std::int64_t index, int from_microsteps, int to_microsteps);

}  // namespace stepdriver::driver
