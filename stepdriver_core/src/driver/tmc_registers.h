#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The registers of Trinamic's drivers, as data: TMC2208, TMC2209 and TMC2226 on a UART (TMC2209
/// datasheet rev. 1.03, section 5), TMC2130 and TMC5160 on SPI (their datasheets, rev. 1.15 and
/// 1.18). No I/O.
namespace stepdriver::driver::tmc {

enum Register : std::uint8_t {
  kGconf = 0x00,
  kGstat = 0x01,
  kIfcnt = 0x02,
  kSlaveconf = 0x03,
  kIoinOnSpi = 0x04,
  kIoin = 0x06,
  kGlobalScaler = 0x0B,  ///< of a TMC5160
  kIholdIrun = 0x10,
  kTpowerdown = 0x11,
  kTstep = 0x12,
  kTpwmthrs = 0x13,
  kTcoolthrs = 0x14,
  kVactual = 0x22,
  kSgthrs = 0x40,
  kSgResult = 0x41,
  kCoolconf = 0x42,
  kMscnt = 0x6A,
  kChopconf = 0x6C,
  kCoolconfOnSpi = 0x6D,
  kDrvStatus = 0x6F,
  kPwmconf = 0x70,
};

/// Chips that differ in their registers.
enum class Model {
  kTmc2208,
  kTmc2209,  ///< and TMC2226
  kTmc2130,
  kTmc5160,
};

/// Of a driver with registers, by DriverChip::name.
Model modelOf(const std::string& chip);
/// [Hz] Its own clock, typically: it counts all times with it.
double clockOf(Model model);
constexpr bool isOnSpi(Model model) { return model == Model::kTmc2130 || model == Model::kTmc5160; }
/// The number of IOIN, and the version in its highest byte.
constexpr std::uint8_t ioinOf(Model model) { return isOnSpi(model) ? kIoinOnSpi : kIoin; }
std::uint32_t versionOf(Model model);
/// "a TMC2209 or TMC2226".
const char* nameOfVersion(std::uint32_t version);

/// @name Bits
/// @{
constexpr std::uint32_t kGconfScaleByVref = 1U << 0U;
constexpr std::uint32_t kGconfSpreadCycle = 1U << 2U;
constexpr std::uint32_t kGconfUartPin = 1U << 6U;  ///< PDN_UART doesn't power down
constexpr std::uint32_t kGconfMicrostepsByMres = 1U << 7U;
constexpr std::uint32_t kGconfFilter = 1U << 8U;
constexpr std::uint32_t kGconfStallOnDiag0OnSpi = 1U << 7U;
constexpr std::uint32_t kGconfStallOnDiag1OnSpi = 1U << 8U;

constexpr std::uint32_t kGstatReset = 1U << 0U;
constexpr std::uint32_t kGstatDriverError = 1U << 1U;
constexpr std::uint32_t kGstatUndervoltage = 1U << 2U;
constexpr std::uint32_t kGstatAll = 7;

constexpr std::uint32_t kToff = 0xF;  ///< of CHOPCONF; 0: the outputs are off
constexpr std::uint32_t kVsense = 1U << 17U;
constexpr unsigned kMresShift = 24;
constexpr std::uint32_t kInterpolate = 1U << 28U;
constexpr std::uint32_t kBothEdges = 1U << 29U;
/// @}

constexpr int kFinest = 256;          ///< microsteps
constexpr int kMscntPerCycle = 1024;  ///< MSCNT in the 4 full steps of an electrical cycle

/// The mode of MRES; empty: it has none with this number of microsteps.
std::optional<std::uint32_t> mresOf(int microsteps);

/// What a chip says in DRV_STATUS.
struct Status {
  bool standstill = false;
  bool temperature_warning = false;
  bool over_temperature = false;
  const char* short_circuit = nullptr;  ///< "coil A to ground"; nullptr: none
  bool open_load_a = false;
  bool open_load_b = false;
  int at_least_celsius = 0;          ///< the highest threshold that it is above; 0: none
  int present_scale = 0;             ///< of the current
  std::optional<bool> stealth_chop;  ///< empty: the chip doesn't say it
  std::optional<int> stall_guard;    ///< SG_RESULT, if it is in this register
};
Status statusOf(Model model, std::uint32_t drv_status);
/// What changes in each motion; all other bits are flags that stay for a while.
std::uint32_t volatileStatusOf(Model model);

/// A chip with its sense resistors [Ohm].
struct Board {
  Model model = Model::kTmc2209;
  double sense_resistor = 0.0;
};

/// How the highest current is set, of which the scales are parts.
struct CurrentRange {
  bool fine = false;        ///< vsense: a lower highest current, in finer steps
  int global_scaler = 256;  ///< of a TMC5160: 32 to 256 parts of 256
};

/// How the chip is told a current.
struct CurrentScale {
  int run = 0;   ///< 0 to 31: 1/32 to 32/32 of the highest current
  int hold = 0;  ///< the same at rest
  CurrentRange range;
};

/// The highest scale that doesn't exceed a current [A rms]; 0 if each does.
int scaleBelow(double current, const CurrentRange& range, const Board& board);
/// [A rms] The current of a scale.
double currentOf(int scale, const CurrentRange& range, const Board& board);
/// The lowest and the highest current that a board can make.
double lowestCurrent(const Board& board);
double highestCurrent(const Board& board);
/// The highest scales that don't exceed the wanted currents [A rms]; the finest range that reaches
/// both. @pre They are within the range of the board; the lower of both is at least the lowest
/// current in the range that the higher one needs.
CurrentScale scaleOf(double run, double hold, const Board& board);
/// [A rms] The lowest current at rest for a current in motion, which takes the same range.
double lowestHold(double run, const Board& board);

/// [s] The longest delay until the current is lowered at rest.
double longestHoldDelay(Model model);
/// TPOWERDOWN of a delay [s].
std::uint32_t powerDownOf(double delay, Model model);

/// @name Thresholds of speed, which the chip compares with the time of a step of 1/256
/// @{
/// [full steps/s] The lowest and the highest speed that a threshold can have.
double lowestThreshold(Model model);
double highestThreshold(Model model);
/// TPWMTHRS or TCOOLTHRS of a speed [full steps/s] between these; 0 of 0: there is none.
std::uint32_t thresholdOf(double speed, Model model);
/// @}

/// What the registers are to say.
struct Settings {
  Model model = Model::kTmc2209;
  CurrentScale current;
  double hold_delay = 0.5;  ///< [s]
  bool spread_cycle = false;
  double spread_cycle_above = 0.0;  ///< [full steps/s] 0: at no speed
  bool interpolate = true;
  bool both_edges = false;
  int stall_threshold = 0;   ///< SGTHRS, or SGT of a chip on SPI, for stalls in any motion
  double stall_above = 0.0;  ///< [full steps/s] 0: at no speed. On SPI only with spread_cycle
};

/// IHOLD_IRUN of these currents.
std::uint32_t currentsOf(const CurrentScale& current);
/// CHOPCONF in a microstep mode. @param on false: the outputs are off. @pre mresOf() has it
std::uint32_t chopconfOf(const Settings& settings, int microsteps, bool on);

/// GCONF: VREF doesn't scale the current.
std::uint32_t gconfOf(const Settings& settings);

/// @name Stalls: StallGuard4 of a TMC2209, in StealthChop only, and StallGuard2 of chips on SPI, in
/// SpreadCycle only
/// @{
constexpr bool detectsStalls(Model model) { return model != Model::kTmc2208; }
/// The thresholds of a chip.
struct Thresholds {
  int least = 0;
  int most = 0;
};
/// SGTHRS, or SGT of a chip on SPI. @pre detectsStalls()
Thresholds stallThresholdsOf(Model model);
/// COOLCONF of a chip on SPI with this SGT.
std::uint32_t coolconfOf(int threshold);
/// GCONF of a chip on SPI while it watches for a stall: in SpreadCycle, and both of its outputs
/// DIAG report it.
std::uint32_t gconfForStallOnSpi();
/// The register with SG_RESULT.
constexpr std::uint8_t loadRegisterOf(Model model) {
  return isOnSpi(model) ? kDrvStatus : kSgResult;
}
/// Whether the value of that register is a stall.
bool isStall(Model model, std::uint32_t load, int threshold);
/// @}

/// A register and its value.
struct RegisterValue {
  std::uint8_t number = 0;
  std::uint32_t value = 0;
  bool reads_back = false;  ///< it can be read, too
};

/// All registers that are written, in their order: the outputs are off until all others are right,
/// and the chip turns no motor by itself (VACTUAL 0).
std::vector<RegisterValue> setUpOf(const Settings& settings, int microsteps);

}  // namespace stepdriver::driver::tmc
