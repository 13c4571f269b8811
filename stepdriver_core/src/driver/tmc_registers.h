#pragma once

#include <cstdint>
#include <optional>
#include <vector>

/// The registers of a TMC2208, TMC2209 or TMC2226 (TMC2209 datasheet rev. 1.03, section 5), as
/// data. No I/O.
namespace stepdriver::driver::tmc {

enum Register : std::uint8_t {
  kGconf = 0x00,
  kGstat = 0x01,
  kIfcnt = 0x02,
  kSlaveconf = 0x03,
  kIoin = 0x06,
  kIholdIrun = 0x10,
  kTpowerdown = 0x11,
  kTpwmthrs = 0x13,
  kTcoolthrs = 0x14,
  kVactual = 0x22,
  kSgthrs = 0x40,
  kSgResult = 0x41,
  kCoolconf = 0x42,
  kMscnt = 0x6A,
  kChopconf = 0x6C,
  kDrvStatus = 0x6F,
  kPwmconf = 0x70,
};

/// @name Bits
/// @{
constexpr std::uint32_t kGconfScaleByVref = 1U << 0U;
constexpr std::uint32_t kGconfSpreadCycle = 1U << 2U;
constexpr std::uint32_t kGconfUartPin = 1U << 6U;  ///< PDN_UART doesn't power down
constexpr std::uint32_t kGconfMicrostepsByMres = 1U << 7U;
constexpr std::uint32_t kGconfFilter = 1U << 8U;

constexpr std::uint32_t kGstatReset = 1U << 0U;
constexpr std::uint32_t kGstatDriverError = 1U << 1U;
constexpr std::uint32_t kGstatUndervoltage = 1U << 2U;
constexpr std::uint32_t kGstatAll = 7;

constexpr std::uint32_t kToff = 0xF;  ///< of CHOPCONF; 0: the outputs are off
constexpr std::uint32_t kVsense = 1U << 17U;
constexpr unsigned kMresShift = 24;
constexpr std::uint32_t kInterpolate = 1U << 28U;
constexpr std::uint32_t kBothEdges = 1U << 29U;

constexpr std::uint32_t kOverTemperatureWarning = 1U << 0U;  ///< of DRV_STATUS, as all below
constexpr std::uint32_t kOverTemperature = 1U << 1U;
constexpr std::uint32_t kShortToGroundA = 1U << 2U;
constexpr std::uint32_t kShortToGroundB = 1U << 3U;
constexpr std::uint32_t kShortToSupplyA = 1U << 4U;
constexpr std::uint32_t kShortToSupplyB = 1U << 5U;
constexpr std::uint32_t kOpenLoadA = 1U << 6U;
constexpr std::uint32_t kOpenLoadB = 1U << 7U;
constexpr std::uint32_t kAbove120 = 1U << 8U;
constexpr std::uint32_t kAbove143 = 1U << 9U;
constexpr std::uint32_t kAbove150 = 1U << 10U;
constexpr std::uint32_t kAbove157 = 1U << 11U;
constexpr unsigned kPresentScaleShift = 16;
constexpr std::uint32_t kPresentScale = 0x1FU << kPresentScaleShift;
constexpr std::uint32_t kStealthChop = 1U << 30U;
constexpr std::uint32_t kStandstill = 1U << 31U;
/// What changes in each motion; all other bits are flags that stay for a while.
constexpr std::uint32_t kVolatileStatus =
    kPresentScale | kStealthChop | kStandstill | kOpenLoadA | kOpenLoadB;
/// @}

constexpr int kFinest = 256;          ///< microsteps
constexpr int kMscntPerCycle = 1024;  ///< MSCNT in the 4 full steps of an electrical cycle

/// The mode of MRES; empty: it has none with this number of microsteps.
std::optional<std::uint32_t> mresOf(int microsteps);

/// How the chip is told a current.
struct CurrentScale {
  int run = 0;        ///< 0 to 31: 1/32 to 32/32 of the highest current
  int hold = 0;       ///< the same at rest
  bool fine = false;  ///< vsense: a lower highest current, in finer steps
};

/// The highest scale that doesn't exceed a current [A rms]; 0 if each does.
int scaleBelow(double current, bool fine, double sense_resistor);
/// [A rms] The current of a scale with a sense resistor [Ohm].
double currentOf(int scale, bool fine, double sense_resistor);
/// The lowest and the highest current that a board can make.
double lowestCurrent(double sense_resistor);
double highestCurrent(double sense_resistor);
/// The highest scales that don't exceed the wanted currents [A rms]; the finer range if it reaches
/// both. @pre They are within the range of the board; the lower of both is at least the lowest
/// current in the range that the higher one needs.
CurrentScale scaleOf(double run, double hold, double sense_resistor);
/// [A rms] The lowest current at rest for a current in motion, which takes the same range.
double lowestHold(double run, double sense_resistor);

/// [s] The longest delay until the current is lowered at rest.
double longestHoldDelay();
/// TPOWERDOWN of a delay [s].
std::uint32_t powerDownOf(double delay);

/// What the registers are to say.
struct Settings {
  CurrentScale current;
  double hold_delay = 0.5;  ///< [s]
  bool spread_cycle = false;
  bool interpolate = true;
  bool both_edges = false;
  bool has_stall_guard = true;  ///< a TMC2209 or TMC2226
};

/// IHOLD_IRUN of these currents.
std::uint32_t currentsOf(const CurrentScale& current);
/// CHOPCONF in a microstep mode. @param on false: the outputs are off. @pre mresOf() has it
std::uint32_t chopconfOf(const Settings& settings, int microsteps, bool on);

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
