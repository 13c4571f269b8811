#include "tmc_model.h"

#include <algorithm>
#include <cmath>

#include "rotor_model.h"

namespace stepdriver::sim {
namespace {

// TMC2209 datasheet rev. 1.03, section 5, and those of the TMC2130 and TMC5160. The rig has its own
// reading of them.
constexpr int kGconf = 0x00;
constexpr int kGstat = 0x01;
constexpr int kIfcnt = 0x02;
constexpr int kIoinOnSpi = 0x04;
constexpr int kIoin = 0x06;
constexpr int kGlobalScaler = 0x0B;
constexpr int kIholdIrun = 0x10;
constexpr int kTstep = 0x12;
constexpr int kTpwmthrs = 0x13;
constexpr int kSgthrs = 0x40;
constexpr int kSgResult = 0x41;
constexpr int kMscnt = 0x6A;
constexpr int kChopconf = 0x6C;
constexpr int kCoolconfOnSpi = 0x6D;
constexpr int kDrvStatus = 0x6F;
constexpr int kPwmconf = 0x70;

constexpr std::uint32_t bit(bool is, unsigned number) { return is ? 1U << number : 0U; }

}  // namespace

TmcModel::TmcModel(const TmcSpec& spec) : spec_(spec) { reset(); }

void TmcModel::reset() {
  registers_ = {};
  if (isOnSpi()) {
    registers_[kPwmconf] = spec_.version == kVersion2130 ? 0x00050480 : 0xC40C001E;
  } else {
    registers_[kGconf] = 0x101;  // VREF scales the current, the pins select the microsteps
    registers_[kIholdIrun] = 0x11F10;
    registers_[kChopconf] = 0x10000053;
    registers_[kPwmconf] = 0xC10D0024;
  }
  writes_ = 0;
  was_reset_ = true;
  driver_error_ = false;
}

void TmcModel::write(int number, std::uint32_t value) {
  ++writes_;
  if (number == kGstat) {
    if (spec_.version == kVersion2130) return;
    was_reset_ = was_reset_ && (value & 1U) == 0;
    driver_error_ = driver_error_ && (value & 2U) == 0;
    return;
  }
  const bool is_read_only = number == kIfcnt || number == (isOnSpi() ? kIoinOnSpi : kIoin) ||
                            number == kTstep || number == kMscnt || number == kDrvStatus;
  if (!is_read_only) registers_.at(static_cast<std::size_t>(number)) = value;
  if (number == kChopconf && (value & 0xFU) != 0 && first_run_ == 0) first_run_ = runOf();
}

int TmcModel::microsteps() const {
  if (!isOnSpi() && (registers_[kGconf] & 1U << 7U) == 0) {
    constexpr std::array<int, 4> kByPins2209{8, 32, 64, 16};
    constexpr std::array<int, 4> kByPins2208{8, 2, 4, 16};
    const auto pins = static_cast<std::size_t>(spec_.address & 3);
    return spec_.version == 0x20 ? kByPins2208.at(pins) : kByPins2209.at(pins);
  }
  const std::uint32_t mres = registers_[kChopconf] >> 24U & 0xFU;
  return mres > 8 ? 1 : 256 >> mres;
}

ChipModel::Configured TmcModel::configured() const {
  return {microsteps(), outputsOn(), (registers_[kChopconf] & 1U << 29U) != 0};
}

double TmcModel::clock() const { return spec_.version == kVersion2130 ? 13.2e6 : 12e6; }

double TmcModel::torque() const {
  return first_run_ == 0 ? 1.0 : static_cast<double>(runOf()) / static_cast<double>(first_run_);
}

bool TmcModel::outputsOn() const {
  return spec_.has_power && (registers_[kChopconf] & 0xFU) != 0 && !trouble_.undervoltage;
}

// A TMC5160 scales it by 1/256.
std::uint32_t TmcModel::runOf() const {
  const std::uint32_t scale = (registers_[kIholdIrun] >> 8U & 0x1FU) + 1;
  if (spec_.version != kVersion5160) return scale;
  const std::uint32_t global = registers_[kGlobalScaler];
  return scale * (global == 0 ? 256 : global);
}

std::uint8_t TmcModel::statusByte(const Senses& senses) const {
  return static_cast<std::uint8_t>(bit(was_reset_, 0) | bit(driver_error_, 1) |
                                   bit(senses.standstill, 3));
}

std::uint32_t TmcModel::statusOnSpi(const Senses& senses) const {
  const bool failed = senses.outputs_failed;
  const std::uint32_t hold = registers_[kIholdIrun] & 0x1FU;
  const std::uint32_t run = registers_[kIholdIrun] >> 8U & 0x1FU;
  const bool says_stealth = spec_.version == kVersion5160 && isStealthy(senses.tstep);
  return (isStealthy(senses.tstep) ? 0 : stall_guard_) | bit(says_stealth, 14) |
         (senses.standstill ? hold : run) << 16U | bit(trouble_.over_temperature, 25) |
         bit(trouble_.prewarning || trouble_.over_temperature, 26) |
         bit(trouble_.short_a && failed, 27) | bit(trouble_.short_b && failed, 28) |
         bit(trouble_.open_a, 29) | bit(trouble_.open_b, 30) | bit(senses.standstill, 31);
}

std::uint32_t TmcModel::inputs(const Senses& senses) const {
  const std::uint32_t version = static_cast<std::uint32_t>(spec_.version) << 24U;
  if (isOnSpi()) {
    return version | bit(senses.step, 0) | bit(senses.dir, 1) | bit(senses.enn, 4) | bit(true, 6);
  }
  return version | bit(senses.enn, 0) | bit((spec_.address & 1) != 0, 2) |
         bit((spec_.address & 2) != 0, 3) | bit(senses.diag, 4) | bit(senses.step, 7) |
         bit(senses.dir, 9);
}

std::uint32_t TmcModel::gstat() const {
  return bit(was_reset_, 0) | bit(driver_error_, 1) | bit(trouble_.undervoltage, 2);
}

std::uint32_t TmcModel::status(const Senses& senses) const {
  if (isOnSpi()) return statusOnSpi(senses);
  const bool failed = senses.outputs_failed;
  const std::uint32_t hold = registers_[kIholdIrun] & 0x1FU;
  const std::uint32_t run = registers_[kIholdIrun] >> 8U & 0x1FU;
  return bit(trouble_.prewarning || trouble_.over_temperature, 0) |
         bit(trouble_.over_temperature, 1) | bit(trouble_.short_a && failed, 2) |
         bit(trouble_.short_b && failed, 3) | bit(trouble_.open_a, 6) | bit(trouble_.open_b, 7) |
         bit(trouble_.prewarning || trouble_.over_temperature, 8) |
         bit(trouble_.over_temperature, 9) | (senses.standstill ? hold : run) << 16U |
         bit(isStealthy(senses.tstep), 30) | bit(senses.standstill, 31);
}

// Above the speed of TPWMTHRS it chops as in SpreadCycle.
bool TmcModel::isStealthy(std::uint32_t tstep) const {
  const bool is_set = (registers_[kGconf] & 4U) != 0;  // en_spreadcycle, on SPI en_pwm_mode
  return is_set == isOnSpi() && tstep >= registers_[kTpwmthrs];
}

// SGT, a signed number of 7 bits. The rig's chips have SG_RESULT 8 higher with each step of it.
int TmcModel::shiftOfLoad() const {
  constexpr int kPerStep = 8;
  const int sgt = static_cast<int>(registers_[kCoolconfOnSpi] >> 16U & 0x7FU);
  return kPerStep * (sgt < 64 ? sgt : sgt - 128);
}

// SG_RESULT falls with the load, which makes the rotor lag: to 0 at the highest torque. On SPI it
// has a bit more, is shifted by SGT, and is measured in SpreadCycle only: 0 is a stall, which DIAG0
// and DIAG1 report if GCONF says so.
bool TmcModel::measure(double lag, std::uint32_t tstep) {
  const double load = std::min(lag / (kPi / 2.0), 1.0);
  if (isOnSpi()) {
    if (isStealthy(tstep)) return false;
    constexpr double kHighest = 1023.0;
    stall_guard_ = static_cast<std::uint32_t>(
        std::lround(std::clamp(kHighest * (1.0 - load) + shiftOfLoad(), 0.0, kHighest)));
    const bool reports = (registers_[kGconf] & 3U << 7U) != 0;  // diag0_stall, diag1_stall
    return reports && tstep <= slowestStall() && stall_guard_ == 0;
  }
  if (!isStealthy(tstep)) return false;
  stall_guard_ = 2 * static_cast<std::uint32_t>(std::lround(255.0 * (1.0 - load)));
  return tstep <= slowestStall() && stall_guard_ <= 2 * registers_[kSgthrs];
}

std::uint32_t TmcModel::read(int number, const Senses& senses) {
  if (number == (isOnSpi() ? kIoinOnSpi : kIoin)) return inputs(senses);
  switch (number) {
    case kGstat: {
      const std::uint32_t flags = gstat();
      if (spec_.version == kVersion2130) was_reset_ = driver_error_ = false;
      return flags;
    }
    case kIfcnt:
      return isOnSpi() ? 0 : writes_;
    case kTstep:
      return senses.tstep;
    case kSgResult:
      return isOnSpi() ? 0 : stall_guard_;
    case kMscnt:
      return static_cast<std::uint32_t>(senses.mscnt);
    case kDrvStatus:
      return status(senses);
    case kPwmconf:
      return isOnSpi() ? 0 : written(number);
    case kGconf:
    case kChopconf:
      return written(number);
    default:
      return 0;
  }
}

}  // namespace stepdriver::sim
