#include "stepdriver_core/driver/driver_chip.h"

#include <algorithm>

namespace stepdriver::driver {
namespace {

constexpr std::int64_t kMicrosecond = 1'000;
constexpr std::int64_t kMillisecond = 1'000'000;

constexpr bool kLow = false;
constexpr bool kHigh = true;

// No datasheet says how long RESET has to be held, or how long the chip takes after it. 1 ms is
// far above any logic delay; the wake-up time covers the charge pump, which RESET may have stopped.
constexpr std::int64_t kResetLow = 1 * kMillisecond;

DriverChip a4988() {
  DriverChip chip{};
  chip.model = Model::kA4988;
  chip.name = "a4988";
  chip.title = "A4988";
  chip.timing.step_high_ns = 1 * kMicrosecond;
  chip.timing.step_low_ns = 1 * kMicrosecond;
  chip.timing.dir_setup_ns = 200;
  chip.timing.dir_hold_ns = 200;
  chip.timing.mode_setup_ns = 200;
  chip.timing.mode_hold_ns = 200;
  chip.timing.enable_ns = 0;  // none given
  chip.timing.wake_ns = 1 * kMillisecond;
  chip.timing.reset_low_ns = kResetLow;
  chip.timing.reset_wait_ns = chip.timing.wake_ns;
  chip.modes = {{1, {kLow, kLow, kLow}},
                {2, {kHigh, kLow, kLow}},
                {4, {kLow, kHigh, kLow}},
                {8, {kHigh, kHigh, kLow}},
                {16, {kHigh, kHigh, kHigh}}};
  chip.microsteps = {1, 2, 4, 8, 16};
  chip.has_sleep = true;
  chip.has_reset = true;
  chip.has_fault = false;
  chip.counts_while_disabled = true;
  chip.step_active = kHigh;
  chip.enable_on = kLow;
  chip.sleep_asleep = kLow;
  chip.reset_held = kLow;
  return chip;
}

DriverChip drv8825() {
  DriverChip chip{};
  chip.model = Model::kDrv8825;
  chip.name = "drv8825";
  chip.title = "DRV8825";
  chip.timing.step_high_ns = 1'900;
  // 1.9 us alone, but at least 4 us from step to step: 250 kHz.
  chip.timing.step_low_ns = 2'100;
  chip.timing.dir_setup_ns = 650;
  chip.timing.dir_hold_ns = 650;
  chip.timing.mode_setup_ns = 650;
  chip.timing.mode_hold_ns = 650;
  chip.timing.enable_ns = 650;
  chip.timing.wake_ns = 1'700 * kMicrosecond;
  chip.timing.reset_low_ns = kResetLow;
  chip.timing.reset_wait_ns = chip.timing.wake_ns;
  // 1/16 is LLH here and HHH on the A4988: a code must never be carried over from the other chip.
  chip.modes = {{1, {kLow, kLow, kLow}},   {2, {kHigh, kLow, kLow}},  {4, {kLow, kHigh, kLow}},
                {8, {kHigh, kHigh, kLow}}, {16, {kLow, kLow, kHigh}}, {32, {kHigh, kLow, kHigh}}};
  chip.microsteps = {1, 2, 4, 8, 16, 32};
  chip.has_sleep = true;
  chip.has_reset = true;
  chip.has_fault = true;
  chip.counts_while_disabled = false;
  chip.step_active = kHigh;
  chip.enable_on = kLow;
  chip.sleep_asleep = kLow;
  chip.reset_held = kLow;
  return chip;
}

DriverChip tb6600() {
  DriverChip chip{};
  chip.model = Model::kTb6600;
  chip.name = "tb6600";
  chip.title = "TB6600";
  // The IC itself needs 2.2 us. The optocouplers of modules need more, and those of clones most.
  chip.timing.step_high_ns = 5 * kMicrosecond;
  chip.timing.step_low_ns = 5 * kMicrosecond;
  chip.timing.dir_setup_ns = 5 * kMicrosecond;
  chip.timing.dir_hold_ns = 5 * kMicrosecond;
  chip.timing.enable_ns = 200 * kMillisecond;
  // The IC has the modes 1 to 16; the DIP switches of the common modules go to 32.
  chip.microsteps = {1, 2, 4, 8, 16, 32};
  chip.has_sleep = false;
  chip.has_reset = false;
  chip.has_fault = false;
  chip.counts_while_disabled = false;
  chip.step_active = kHigh;
  chip.enable_on = kLow;  // ENA lights an LED, and the lit LED frees the motor
  return chip;
}

const std::vector<DriverChip>& chips() {
  static const std::vector<DriverChip> all{a4988(), drv8825(), tb6600()};
  return all;
}

}  // namespace

const DriverChip& driverChipOf(Model model) {
  const auto& all = chips();
  return *std::find_if(all.begin(), all.end(),
                       [model](const DriverChip& c) { return c.model == model; });
}

const DriverChip* findDriverChip(const std::string& name) {
  const auto same = [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b - 'A' + 'a' : b); };
  for (const DriverChip& chip : chips()) {
    const std::string& own = chip.name;
    if (std::equal(own.begin(), own.end(), name.begin(), name.end(), same)) return &chip;
  }
  return nullptr;
}

std::vector<std::string> driverChipNames() {
  std::vector<std::string> names;
  for (const DriverChip& chip : chips()) names.push_back(chip.name);
  return names;
}

std::optional<ModeCode> codeOf(const DriverChip& chip, int microsteps) {
  for (const Mode& mode : chip.modes) {
    if (mode.microsteps == microsteps) return mode.code;
  }
  return std::nullopt;
}

std::optional<int> microstepsOf(const DriverChip& chip, const ModeCode& code) {
  for (const Mode& mode : chip.modes) {
    if (mode.code == code) return mode.microsteps;
  }
  // The DRV8825 decodes LHH and HHH as well, both as 1/32.
  if (chip.model == Model::kDrv8825) return 32;
  return std::nullopt;
}

bool keepsPosition(std::int64_t index, int from_microsteps, int to_microsteps) {
  return index % (from_microsteps / std::min(from_microsteps, to_microsteps)) == 0;
}

}  // namespace stepdriver::driver
