#include "tmc_model.h"

#include <algorithm>
#include <cmath>

#include "rotor_model.h"

namespace stepdriver::sim {
namespace {

// TMC2209 datasheet rev. 1.03, section 5. The rig has its own reading of it.
constexpr int kGconf = 0x00;
constexpr int kGstat = 0x01;
constexpr int kIfcnt = 0x02;
constexpr int kIoin = 0x06;
constexpr int kIholdIrun = 0x10;
constexpr int kSgResult = 0x41;
constexpr int kMscnt = 0x6A;
constexpr int kChopconf = 0x6C;
constexpr int kDrvStatus = 0x6F;
constexpr int kPwmconf = 0x70;

constexpr std::uint32_t bit(bool is, unsigned number) { return is ? 1U << number : 0U; }

}  // namespace

TmcModel::TmcModel(const TmcSpec& spec) : spec_(spec) { reset(); }

void TmcModel::reset() {
  registers_ = {};
  registers_[kGconf] = 0x101;  // VREF scales the current, the pins select the microsteps
  registers_[kIholdIrun] = 0x11F10;
  registers_[kChopconf] = 0x10000053;
  registers_[kPwmconf] = 0xC10D0024;
  writes_ = 0;
  was_reset_ = true;
  driver_error_ = false;
}

void TmcModel::write(int number, std::uint32_t value) {
  ++writes_;
  if (number == kGstat) {
    was_reset_ = was_reset_ && (value & 1U) == 0;
    driver_error_ = driver_error_ && (value & 2U) == 0;
    return;
  }
  const bool is_read_only =
      number == kIfcnt || number == kIoin || number == kMscnt || number == kDrvStatus;
  if (!is_read_only) registers_.at(static_cast<std::size_t>(number)) = value;
  if (number == kIholdIrun && first_run_ == 0) first_run_ = runOf();
}

int TmcModel::microsteps() const {
  if ((registers_[kGconf] & 1U << 7U) == 0) {
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

double TmcModel::torque() const {
  return first_run_ == 0 ? 1.0 : static_cast<double>(runOf()) / static_cast<double>(first_run_);
}

bool TmcModel::outputsOn() const {
  return spec_.has_power && (registers_[kChopconf] & 0xFU) != 0 && !trouble_.undervoltage;
}

std::uint32_t TmcModel::status(const Senses& senses) const {
  const bool failed = senses.outputs_failed;
  const std::uint32_t hold = registers_[kIholdIrun] & 0x1FU;
  const std::uint32_t run = registers_[kIholdIrun] >> 8U & 0x1FU;
  const bool stealth = (registers_[kGconf] & 4U) == 0;
  return bit(trouble_.prewarning || trouble_.over_temperature, 0) |
         bit(trouble_.over_temperature, 1) | bit(trouble_.short_a && failed, 2) |
         bit(trouble_.short_b && failed, 3) | bit(trouble_.open_a, 6) | bit(trouble_.open_b, 7) |
         bit(trouble_.prewarning || trouble_.over_temperature, 8) |
         bit(trouble_.over_temperature, 9) | (senses.standstill ? hold : run) << 16U |
         bit(stealth, 30) | bit(senses.standstill, 31);
}

// It falls with the load, which makes the rotor lag: to 0 at the highest torque. At rest it keeps
// its value.
std::uint32_t TmcModel::stallGuard(const Senses& senses) const {
  const bool stealth = (registers_[kGconf] & 4U) == 0;
  if (stealth && !senses.standstill) {
    const double load = std::min(std::abs(senses.lag) / (kPi / 2.0), 1.0);
    stall_guard_ = 2 * static_cast<std::uint32_t>(std::lround(255.0 * (1.0 - load)));
  }
  return stall_guard_;
}

std::uint32_t TmcModel::read(int number, const Senses& senses) const {
  switch (number) {
    case kGstat:
      return bit(was_reset_, 0) | bit(driver_error_, 1) | bit(trouble_.undervoltage, 2);
    case kIfcnt:
      return writes_;
    case kIoin:
      return bit(senses.enn, 0) | bit((spec_.address & 1) != 0, 2) |
             bit((spec_.address & 2) != 0, 3) | bit(senses.diag, 4) | bit(senses.step, 7) |
             bit(senses.dir, 9) | static_cast<std::uint32_t>(spec_.version) << 24U;
    case kSgResult:
      return stallGuard(senses);
    case kMscnt:
      return static_cast<std::uint32_t>(senses.mscnt);
    case kDrvStatus:
      return status(senses);
    case kGconf:
    case kChopconf:
    case kPwmconf:
      return written(number);
    default:
      return 0;
  }
}

}  // namespace stepdriver::sim
