#include "stepdriver_core/driver/driver_chip.h"
#include "stepdriver_core/error.h"
#include "tmc_registers.h"

namespace stepdriver::driver {

RegisterBus registerBusOf(const DriverChip& chip) {
  if (chip.name == "tmc2208" || chip.name == "tmc2209" || chip.name == "tmc2226") {
    return RegisterBus::kUart;
  }
  return chip.name == "tmc2130" || chip.name == "tmc5160" ? RegisterBus::kSpi : RegisterBus::kNone;
}

DriverChip registerChip(DriverChip chip) {
  const RegisterBus bus = registerBusOf(chip);
  if (bus == RegisterBus::kNone) throw Error("the " + chip.title + " has no registers");
  chip.modes.clear();
  chip.mode_pins = 0;
  chip.microsteps.clear();
  for (int microsteps = 1; microsteps <= tmc::kFinest; microsteps *= 2) {
    chip.microsteps.push_back(microsteps);
  }
  if (bus == RegisterBus::kSpi) {
    chip.fault_active = false;  // low
    chip.fault_name = "DIAG0";
    chip.fault_end = FaultEnd::kEnable;  // ENN high resets an error, as on the others
    chip.timing.reset_low_ns = 1'000'000;
  }
  return chip;
}

}  // namespace stepdriver::driver
