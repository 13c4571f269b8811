#include "tmc_registers.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <initializer_list>

namespace stepdriver::driver::tmc {
namespace {

// The full-scale voltages across the sense resistor [V], to which the chip adds 20 mOhm: VSRT in
// the electrical characteristics, and the formula in section 9 of each datasheet. The table of
// TMC2209 (rev. 1.03, section 8: 100 mOhm 1.92 A, 120 mOhm 1.64 A, 150 mOhm 1.35 A, 220 mOhm 0.96
// A) is met by 0.325 V to its last digit, and so is the one of TMC5160 up to 100 mOhm (2.3 A),
// which adds no resistance and has no vsense; so compute TMCStepper (TMC2160Stepper.cpp) and
// Klipper (tmc5160.py). For the TMC2130 Klipper (tmc2130.py) computes with 0.32 V and 0.18 V,
// TMCStepper and grblHAL (tmc2130.c) with 0.325 V: 1.6 % apart, which is half of a step of the
// scale.
constexpr double kFullScale = 0.325;      // vsense 0
constexpr double kFullScale2130 = 0.320;  // the same
constexpr double kFineFullScale = 0.180;  // vsense 1
constexpr double kInnerResistance = 0.020;
constexpr int kWholeScaler = 256;
constexpr int kLeastScaler = 32;  // TMC5160: lower ones aren't allowed
constexpr int kScales = 32;
// A current that was computed from a scale must give that scale.
constexpr double kRounding = 1e-9;

constexpr double kClock = 12e6;  // [Hz]
// TMC2130, electrical characteristics: 13.2 MHz at 50 degrees C, as in Klipper (tmc2130.py) and
// grblHAL (tmc2130.h), too.
constexpr double kClock2130 = 13.2e6;

// Section 5.2: TSTEP counts clocks in 20 bits, and the thresholds are compared with it.
constexpr double kMostThreshold = (1U << 20U) - 1;

// Section 5.2: TPOWERDOWN counts 2^18 clocks. Below 2, StealthChop can't find the
// current at rest.
constexpr double kPowerDownClocks = 262144.0;
constexpr double kLeastPowerDown = 2.0;
constexpr double kMostPowerDown = 255.0;

// CHOPCONF as after a reset but for the rest: TBL 2, HSTRT 5, HEND 0, and TOFF 3.
constexpr std::uint32_t kTbl = 2U << 15U;
constexpr std::uint32_t kHysteresis = 5U << 4U;
constexpr std::uint32_t kToffOn = 3;
// From one scale to the next one takes 22 ms when the current is lowered at rest.
constexpr std::uint32_t kHoldDelay = 1U << 16U;
// PWMCONF after a reset: automatic scale and gradient, 35 kHz.
constexpr std::uint32_t kPwmconfValue = 0xC10D0024;
// TMC2130, section 23.1, and TMC5160, section 24.1: TBL 2, HSTRT 4, HEND 1.
constexpr std::uint32_t kSpiTimes = kTbl | 4U << 4U | 1U << 7U;
// TMC2130, section 23.1: automatic scale, 2/1024 of the clock, amplitude 200, gradient 1.
constexpr std::uint32_t kPwmconf2130 = 0x000401C8;
// TMC5160 after a reset: automatic scale and gradient.
constexpr std::uint32_t kPwmconf5160 = 0xC40C001E;
constexpr std::uint32_t kGconfStealthChopOnSpi = 1U << 2U;
// DIAG0 pulls low at over-temperature and shorts.
constexpr std::uint32_t kGconfErrorsOnDiag0 = 1U << 5U;
constexpr std::uint32_t kStallGuardOnSpi = 0x3FF;  // of DRV_STATUS
// SGT, a signed number of 7 bits in COOLCONF.
constexpr std::uint32_t kSgt = 0x7F;
constexpr unsigned kSgtShift = 16;
constexpr int kSpiWarningCelsius = 120;
constexpr unsigned kPresentScaleShift = 16;
constexpr std::uint32_t kPresentScale = 0x1FU << kPresentScaleShift;
// Several chips on a wire: their answers begin 3 times 8 bits after a read.
constexpr std::uint32_t kSendDelay = 2U << 8U;

double fullScaleOf(const CurrentRange& range, Model model) {
  if (range.fine) return kFineFullScale;
  return model == Model::kTmc2130 ? kFullScale2130 : kFullScale;
}

/// The finest range that reaches a current.
CurrentRange rangeFor(double current, const Board& board) {
  CurrentRange range;
  if (board.model == Model::kTmc5160) {
    const double whole = currentOf(kScales - 1, range, board);
    const double parts = std::floor(current / whole * kWholeScaler * (1.0 + kRounding));
    range.global_scaler =
        static_cast<int>(std::clamp(parts, double{kLeastScaler}, double{kWholeScaler}));
    return range;
  }
  range.fine = true;
  range.fine = current <= currentOf(kScales - 1, range, board) * (1.0 + kRounding);
  return range;
}

constexpr bool has(std::uint32_t status, unsigned bit) { return (status >> bit & 1U) != 0; }

/// The numbers of the four bits of short circuits, or less, in the order of their names.
const char* shortIn(std::uint32_t status, std::initializer_list<unsigned> bits) {
  static constexpr std::array<const char*, 4> kNames{
      "coil A to ground", "coil B to ground", "coil A to the supply", "coil B to the supply"};
  std::size_t name = 0;
  for (const unsigned bit : bits) {
    if (has(status, bit)) return kNames.at(name);
    ++name;
  }
  return nullptr;
}

Status statusOfUart(std::uint32_t status) {
  Status said;
  said.temperature_warning = has(status, 0);
  said.over_temperature = has(status, 1);
  said.short_circuit = shortIn(status, {2, 3, 4, 5});
  said.open_load_a = has(status, 6);
  said.open_load_b = has(status, 7);
  said.at_least_celsius = has(status, 11)   ? 157
                          : has(status, 10) ? 150
                          : has(status, 9)  ? 143
                          : has(status, 8)  ? 120
                                            : 0;
  said.stealth_chop = has(status, 30);
  return said;
}

Status statusOnSpi(Model model, std::uint32_t status) {
  Status said;
  said.over_temperature = has(status, 25);
  said.temperature_warning = has(status, 26);
  said.short_circuit =
      model == Model::kTmc5160 ? shortIn(status, {27, 28, 12, 13}) : shortIn(status, {27, 28});
  said.open_load_a = has(status, 29);
  said.open_load_b = has(status, 30);
  said.at_least_celsius = said.temperature_warning ? kSpiWarningCelsius : 0;
  if (model == Model::kTmc5160) said.stealth_chop = has(status, 14);
  said.stall_guard = static_cast<int>(status & kStallGuardOnSpi);
  return said;
}

}  // namespace

Model modelOf(const std::string& chip) {
  if (chip == "tmc2208") return Model::kTmc2208;
  if (chip == "tmc2130") return Model::kTmc2130;
  return chip == "tmc5160" ? Model::kTmc5160 : Model::kTmc2209;
}

double clockOf(Model model) { return model == Model::kTmc2130 ? kClock2130 : kClock; }

std::uint32_t versionOf(Model model) {
  switch (model) {
    case Model::kTmc2208:
      return 0x20;
    case Model::kTmc2209:
      return 0x21;
    case Model::kTmc2130:
      return 0x11;
    case Model::kTmc5160:
      return 0x30;
  }
  return 0;
}

const char* nameOfVersion(std::uint32_t version) {
  switch (version) {
    case 0x20:
      return "a TMC2208 or TMC2225";
    case 0x21:
      return "a TMC2209 or TMC2226";
    case 0x11:
      return "a TMC2130";
    case 0x30:
      return "a TMC5160";
    default:
      return "another chip";
  }
}

Status statusOf(Model model, std::uint32_t drv_status) {
  Status said = isOnSpi(model) ? statusOnSpi(model, drv_status) : statusOfUart(drv_status);
  said.present_scale = static_cast<int>((drv_status & kPresentScale) >> kPresentScaleShift);
  said.standstill = has(drv_status, 31);
  return said;
}

std::uint32_t volatileStatusOf(Model model) {
  constexpr std::uint32_t kStandstill = 1U << 31U;
  // The chopper, the open loads, and on SPI what StallGuard has measured.
  if (isOnSpi(model)) {
    return kStandstill | kPresentScale | kStallGuardOnSpi | 3U << 29U | 1U << 24U | 1U << 14U |
           1U << 15U;
  }
  return kStandstill | kPresentScale | 1U << 30U | 3U << 6U;
}

int scaleBelow(double current, const CurrentRange& range, const Board& board) {
  const double whole = currentOf(kScales - 1, range, board);
  const auto steps = static_cast<int>(std::floor(current / whole * kScales + kRounding));
  return std::clamp(steps, 1, kScales) - 1;
}

std::optional<std::uint32_t> mresOf(int microsteps) {
  for (std::uint32_t mres = 0; mres <= 8; ++mres) {
    if (kFinest >> mres == microsteps) return mres;
  }
  return {};
}

double currentOf(int scale, const CurrentRange& range, const Board& board) {
  const double inner = board.model == Model::kTmc5160 ? 0.0 : kInnerResistance;
  return range.global_scaler / double{kWholeScaler} * (scale + 1.0) / kScales *
         fullScaleOf(range, board.model) / (board.sense_resistor + inner) / std::sqrt(2.0);
}

double lowestCurrent(const Board& board) { return currentOf(0, rangeFor(0.0, board), board); }
double highestCurrent(const Board& board) { return currentOf(kScales - 1, {}, board); }

double lowestHold(double run, const Board& board) {
  return currentOf(0, rangeFor(run, board), board);
}

CurrentScale scaleOf(double run, double hold, const Board& board) {
  CurrentScale scale;
  scale.range = rangeFor(std::max(run, hold), board);
  scale.run = scaleBelow(run, scale.range, board);
  scale.hold = scaleBelow(hold, scale.range, board);
  return scale;
}

double longestHoldDelay(Model model) { return kMostPowerDown * kPowerDownClocks / clockOf(model); }

std::uint32_t powerDownOf(double delay, Model model) {
  const double units = std::round(delay * clockOf(model) / kPowerDownClocks);
  return static_cast<std::uint32_t>(std::clamp(units, kLeastPowerDown, kMostPowerDown));
}

double lowestThreshold(Model model) { return clockOf(model) / (kFinest * kMostThreshold); }
double highestThreshold(Model model) { return clockOf(model) / kFinest; }

std::uint32_t thresholdOf(double speed, Model model) {
  if (speed <= 0.0) return 0;
  return static_cast<std::uint32_t>(
      std::clamp(std::round(clockOf(model) / (kFinest * speed)), 1.0, kMostThreshold));
}

std::uint32_t currentsOf(const CurrentScale& current) {
  const auto hold = static_cast<std::uint32_t>(current.hold);
  const auto run = static_cast<std::uint32_t>(current.run);
  return hold | run << 8U | kHoldDelay;
}

std::uint32_t chopconfOf(const Settings& settings, int microsteps, bool on) {
  const std::uint32_t times = isOnSpi(settings.model) ? kSpiTimes : kTbl | kHysteresis;
  std::uint32_t value = times | *mresOf(microsteps) << kMresShift;
  if (on) value |= kToffOn;
  if (settings.current.range.fine) value |= kVsense;
  if (settings.interpolate) value |= kInterpolate;
  if (settings.both_edges) value |= kBothEdges;
  return value;
}

std::uint32_t gconfOf(const Settings& settings) {
  if (isOnSpi(settings.model)) {
    if (settings.stall_above > 0.0) return gconfForStallOnSpi();
    return kGconfErrorsOnDiag0 | (settings.spread_cycle ? 0 : kGconfStealthChopOnSpi);
  }
  return kGconfUartPin | kGconfMicrostepsByMres | kGconfFilter |
         (settings.spread_cycle ? kGconfSpreadCycle : 0);
}

Thresholds stallThresholdsOf(Model model) {
  return isOnSpi(model) ? Thresholds{-64, 63} : Thresholds{0, 255};
}

std::uint32_t coolconfOf(int threshold) {
  return (static_cast<std::uint32_t>(threshold) & kSgt) << kSgtShift;
}

std::uint32_t gconfForStallOnSpi() {
  return kGconfErrorsOnDiag0 | kGconfStallOnDiag0OnSpi | kGconfStallOnDiag1OnSpi;
}

// SGT moves SG_RESULT itself, which is 0 at a stall.
bool isStall(Model model, std::uint32_t load, int threshold) {
  if (isOnSpi(model)) return (load & kStallGuardOnSpi) == 0;
  return load <= 2U * static_cast<std::uint32_t>(threshold);
}

std::vector<RegisterValue> setUpOnSpi(const Settings& settings, int microsteps) {
  const bool is_5160 = settings.model == Model::kTmc5160;
  std::vector<RegisterValue> all{
      {kChopconf, chopconfOf(settings, microsteps, false), true},
      {kGconf, gconfOf(settings), true},
      {kIholdIrun, currentsOf(settings.current), false},
      {kTpowerdown, powerDownOf(settings.hold_delay, settings.model), false},
      {kTpwmthrs, thresholdOf(settings.spread_cycle_above, settings.model), false},
      {kTcoolthrs, thresholdOf(settings.stall_above, settings.model), false},
      {kCoolconfOnSpi, coolconfOf(settings.stall_threshold), false},
      {kPwmconf, is_5160 ? kPwmconf5160 : kPwmconf2130, false},
  };
  if (is_5160) {
    const auto scaler = static_cast<std::uint32_t>(settings.current.range.global_scaler);
    all.push_back({kGlobalScaler, scaler % kWholeScaler, false});
  }
  all.push_back({kChopconf, chopconfOf(settings, microsteps, true), true});
  return all;
}

std::vector<RegisterValue> setUpOf(const Settings& settings, int microsteps) {
  if (isOnSpi(settings.model)) return setUpOnSpi(settings, microsteps);
  std::vector<RegisterValue> all{
      {kSlaveconf, kSendDelay, false},
      {kChopconf, chopconfOf(settings, microsteps, false), true},
      {kVactual, 0, false},
      {kGconf, gconfOf(settings), true},
      {kIholdIrun, currentsOf(settings.current), false},
      {kTpowerdown, powerDownOf(settings.hold_delay, settings.model), false},
      {kTpwmthrs, thresholdOf(settings.spread_cycle_above, settings.model), false},
      {kPwmconf, kPwmconfValue, true},
  };
  if (settings.model == Model::kTmc2209) {
    const auto threshold = static_cast<std::uint32_t>(settings.stall_threshold);
    all.push_back({kTcoolthrs, thresholdOf(settings.stall_above, settings.model), false});
    all.push_back({kSgthrs, threshold, false});
    all.push_back({kCoolconf, 0, false});
  }
  all.push_back({kChopconf, chopconfOf(settings, microsteps, true), true});
  return all;
}

}  // namespace stepdriver::driver::tmc
