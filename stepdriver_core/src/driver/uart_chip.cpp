#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/error.h"
#include "tmc_registers.h"

namespace stepdriver::driver {

bool hasUart(const DriverChip& chip) {
  return chip.name == "tmc2208" || chip.name == "tmc2209" || chip.name == "tmc2226";
}

DriverChip uartChip(DriverChip chip) {
  if (!hasUart(chip)) throw Error("the " + chip.title + " isn't configured over a UART");
  chip.modes.clear();
  chip.mode_pins = 0;
  chip.microsteps.clear();
  for (int microsteps = 1; microsteps <= tmc::kFinest; microsteps *= 2) {
    chip.microsteps.push_back(microsteps);
  }
  return chip;
}

}  // namespace stepdriver::driver
