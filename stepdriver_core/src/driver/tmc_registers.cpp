#include "tmc_registers.h"

#include <algorithm>
#include <cmath>

namespace stepdriver::driver::tmc {
namespace {

// Section 9.2: the full-scale voltages across the sense resistor, to which the chip adds 20 mOhm.
constexpr double kFullScale = 0.325;      // [V] vsense 0
constexpr double kFineFullScale = 0.180;  // [V] vsense 1
constexpr double kInnerResistance = 0.020;
constexpr int kScales = 32;
// A current that was computed from a scale must give that scale.
constexpr double kRounding = 1e-9;

// Section 5.2: TPOWERDOWN counts 2^18 clocks of 12 MHz. Below 2, StealthChop can't find the
// current at rest.
constexpr double kPowerDownUnit = 262144.0 / 12e6;
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
// Several chips on a wire: their answers begin 3 times 8 bits after a read.
constexpr std::uint32_t kSendDelay = 2U << 8U;

bool needsCoarse(double current, double sense_resistor) {
  return current > currentOf(kScales - 1, true, sense_resistor) * (1.0 + kRounding);
}

}  // namespace

int scaleBelow(double current, bool fine, double sense_resistor) {
  const double whole = currentOf(kScales - 1, fine, sense_resistor);
  const auto steps = static_cast<int>(std::floor(current / whole * kScales + kRounding));
  return std::clamp(steps, 1, kScales) - 1;
}

std::optional<std::uint32_t> mresOf(int microsteps) {
  for (std::uint32_t mres = 0; mres <= 8; ++mres) {
    if (kFinest >> mres == microsteps) return mres;
  }
  return {};
}

double currentOf(int scale, bool fine, double sense_resistor) {
  const double full = fine ? kFineFullScale : kFullScale;
  return (scale + 1.0) / kScales * full / (sense_resistor + kInnerResistance) / std::sqrt(2.0);
}

double lowestCurrent(double sense_resistor) { return currentOf(0, true, sense_resistor); }
double highestCurrent(double sense_resistor) {
  return currentOf(kScales - 1, false, sense_resistor);
}

double lowestHold(double run, double sense_resistor) {
  return currentOf(0, !needsCoarse(run, sense_resistor), sense_resistor);
}

CurrentScale scaleOf(double run, double hold, double sense_resistor) {
  CurrentScale scale;
  scale.fine = !needsCoarse(std::max(run, hold), sense_resistor);
  scale.run = scaleBelow(run, scale.fine, sense_resistor);
  scale.hold = scaleBelow(hold, scale.fine, sense_resistor);
  return scale;
}

double longestHoldDelay() { return kMostPowerDown * kPowerDownUnit; }

std::uint32_t powerDownOf(double delay) {
  return static_cast<std::uint32_t>(
      std::clamp(std::round(delay / kPowerDownUnit), kLeastPowerDown, kMostPowerDown));
}

std::uint32_t currentsOf(const CurrentScale& current) {
  const auto hold = static_cast<std::uint32_t>(current.hold);
  const auto run = static_cast<std::uint32_t>(current.run);
  return hold | run << 8U | kHoldDelay;
}

std::uint32_t chopconfOf(const Settings& settings, int microsteps, bool on) {
  std::uint32_t value = kTbl | kHysteresis | *mresOf(microsteps) << kMresShift;
  if (on) value |= kToffOn;
  if (settings.current.fine) value |= kVsense;
  if (settings.interpolate) value |= kInterpolate;
  if (settings.both_edges) value |= kBothEdges;
  return value;
}

std::vector<RegisterValue> setUpOf(const Settings& settings, int microsteps) {
  std::uint32_t gconf = kGconfUartPin | kGconfMicrostepsByMres | kGconfFilter;
  if (settings.spread_cycle) gconf |= kGconfSpreadCycle;
  std::vector<RegisterValue> all{
      {kSlaveconf, kSendDelay, false},
      {kChopconf, chopconfOf(settings, microsteps, false), true},
      {kVactual, 0, false},
      {kGconf, gconf, true},
      {kIholdIrun, currentsOf(settings.current), false},
      {kTpowerdown, powerDownOf(settings.hold_delay), false},
      {kTpwmthrs, 0, false},
      {kPwmconf, kPwmconfValue, true},
  };
  if (settings.has_stall_guard) {
    all.push_back({kTcoolthrs, 0, false});
    all.push_back({kSgthrs, 0, false});
    all.push_back({kCoolconf, 0, false});
  }
  all.push_back({kChopconf, chopconfOf(settings, microsteps, true), true});
  return all;
}

}  // namespace stepdriver::driver::tmc
