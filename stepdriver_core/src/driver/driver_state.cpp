#include "stepdriver_core/driver/driver_chip.h"

namespace stepdriver::driver {

std::optional<double> loadOf(const DriverState& driver) {
  if (!driver.stall_guard) return {};
  return 1.0 - *driver.stall_guard / static_cast<double>(driver.highest_stall_guard);
}

}  // namespace stepdriver::driver
