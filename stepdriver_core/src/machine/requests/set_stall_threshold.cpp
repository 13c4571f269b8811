#include "set_stall_threshold.h"

#include <fmt/format.h>

#include <cstddef>
#include <vector>

#include "chip_settings.h"
#include "driver/tmc_registers.h"

namespace stepdriver::machine {

std::string SetStallThreshold::text(const AxisWords& axes) const {
  return fmt::format("set stall threshold of {}: {}", axes.name(axis), threshold);
}

void SetStallThreshold::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& changed = machine.axis(axis);
  changed.refuseUnlessOpen();
  const std::vector<std::size_t> motors = settableChips(changed);
  if (motors.empty()) changed.refuse("it has no driver with `tmc`");
  for (const std::size_t motor : motors) {
    const auto range = changed.motor.tmcAt(motor)->stallThresholds();
    if (!range) {
      changed.refuse(changed.chipText(motor) +
                     " uses a threshold in homings only: it has no tmc/stall_fault_threshold");
    }
    if (threshold < range->least || threshold > range->most) {
      changed.refuse(fmt::format("the stall threshold {} must be from {} to {}", threshold,
                                 range->least, range->most));
    }
  }
  for (const std::size_t motor : motors) {
    writeSetting(machine, axis, motor, changed.motor.tmcAt(motor)->setStallThreshold(threshold),
                 call);
  }
}

}  // namespace stepdriver::machine
