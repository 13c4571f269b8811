#include "chip_settings.h"

#include <utility>

namespace stepdriver::machine {

std::vector<std::size_t> settableChips(axis::AxisModel& axis) {
  std::vector<std::size_t> motors;
  for (std::size_t i = 0; i < axis.motor.chips(); ++i) {
    const motor::TmcChip* chip = axis.motor.tmcAt(i);
    if (chip == nullptr) continue;
    if (!chip->isSetUp())
      axis.refuse(axis.chipText(i) + " isn't set up: it has no power, or the axis is at fault");
    if (chip->isPreparedForStall()) {
      axis.refuse("its current and threshold are those of a homing to a stall, until that ends");
    }
    motors.push_back(i);
  }
  return motors;
}

void writeSetting(RequestContext& machine, AxisId axis, std::size_t motor, bus::RegisterJob job,
                  const SharedCall& call) {
  job.id = machine.context.newJob();
  machine.setting_changes.emplace(job.id, RequestContext::SettingChange{axis, motor, call});
  machine.context.out->register_jobs.push_back(std::move(job));
}

}  // namespace stepdriver::machine
