#include "stepdriver_core/driver/driver_chip.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "message_text.h"
#include "named_chips.h"
#include "printable.h"
#include "stepdriver_core/error.h"

namespace stepdriver::driver {

const DriverChip* findDriverChip(const std::string& name) {
  const auto same = [](char a, char b) { return a == (b >= 'A' && b <= 'Z' ? b - 'A' + 'a' : b); };
  for (const DriverChip& chip : namedChips()) {
    const std::string& own = chip.name;
    if (std::equal(own.begin(), own.end(), name.begin(), name.end(), same)) return &chip;
  }
  return nullptr;
}

const DriverChip& driverChip(const std::string& name) {
  const DriverChip* const chip = findDriverChip(name);
  if (chip != nullptr) return *chip;
  throw Error(fmt::format("there is no driver chip named \"{}\" (drivers: {})", printable(name),
                          fmt::join(driverChipNames(), ", ")));
}

std::vector<std::string> driverChipNames() {
  std::vector<std::string> names;
  for (const DriverChip& chip : namedChips()) names.push_back(chip.name);
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
  return std::nullopt;
}

std::vector<int> selectableMicrosteps(const DriverChip& chip) {
  std::vector<int> selectable;
  for (const Mode& mode : chip.modes) {
    const bool known =
        std::find(selectable.begin(), selectable.end(), mode.microsteps) != selectable.end();
    if (!known) selectable.push_back(mode.microsteps);
  }
  return selectable;
}

Timing longestOf(const Timing& one, const Timing& other) {
  Timing longest;
  for (std::int64_t Timing::*const time :
       {&Timing::step_high_ns, &Timing::step_low_ns, &Timing::dir_setup_ns, &Timing::dir_hold_ns,
        &Timing::mode_setup_ns, &Timing::mode_hold_ns, &Timing::enable_ns, &Timing::wake_ns,
        &Timing::reset_low_ns, &Timing::reset_wait_ns}) {
    longest.*time = std::max(one.*time, other.*time);
  }
  return longest;
}

std::int64_t shortestStepNs(const Timing& timing, bool both_edges) {
  return both_edges ? std::max(timing.step_high_ns, timing.step_low_ns)
                    : timing.step_high_ns + timing.step_low_ns;
}

bool keepsPosition(std::int64_t index, int from_microsteps, int to_microsteps) {
  return index % (from_microsteps / std::gcd(from_microsteps, to_microsteps)) == 0;
}

}  // namespace stepdriver::driver
