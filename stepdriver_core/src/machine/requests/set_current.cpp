#include "set_current.h"

#include <fmt/format.h>

#include <algorithm>
#include <vector>

#include "chip_settings.h"
#include "driver/tmc_registers.h"
#include "message_text.h"

namespace stepdriver::machine {
namespace {

struct Wanted {
  double run = 0.0;
  double hold = 0.0;
};

struct Change {
  std::size_t motor = 0;
  driver::tmc::CurrentScale scale;
};

double checkedCurrent(const axis::AxisModel& axis, const char* what, double wanted, double least,
                      double most, const char* most_is) {
  if (wanted >= least && wanted <= most) return wanted;
  axis.refuse(fmt::format("the {} current of {} A must be 0 or from {} to {} A, {}", what,
                          numberText(wanted), lowerBoundText(least), upperBoundText(most),
                          most_is));
}

/// @throw Refused
Wanted checkedCurrents(const axis::AxisModel& axis, const motor::TmcChip& chip,
                       const SetCurrent& request) {
  const config::TmcConfig& config = chip.config();
  const double least = chip.lowestCurrent();
  Wanted wanted;
  wanted.run = request.run == 0.0 ? config.run_current
                                  : checkedCurrent(axis, "run", request.run, least,
                                                   config.run_current, "its tmc/run_current_a");
  wanted.hold = request.hold == 0.0 ? std::min(config.hold_current, wanted.run)
                                    : checkedCurrent(axis, "hold", request.hold, least, wanted.run,
                                                     "its run current");
  return wanted;
}

}  // namespace

std::string SetCurrent::text(const AxisWords& axes) const {
  return fmt::format("set currents of {}: run {} A, hold {} A", axes.name(axis), numberText(run),
                     numberText(hold));
}

void SetCurrent::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& changed = machine.axis(axis);
  changed.refuseUnlessOpen();
  std::vector<Change> changes;
  for (const std::size_t motor : settableChips(changed)) {
    const motor::TmcChip& chip = *changed.motor.tmcAt(motor);
    const Wanted wanted = checkedCurrents(changed, chip, *this);
    changes.push_back({motor, chip.scaleOf(wanted.run, wanted.hold)});
  }
  if (changes.empty()) {
    changed.refuse("its current is set by the board: it has no driver with `tmc`");
  }
  for (const Change& change : changes) {
    writeSetting(machine, axis, change.motor,
                 changed.motor.tmcAt(change.motor)->setCurrent(change.scale), call);
  }
}

}  // namespace stepdriver::machine
