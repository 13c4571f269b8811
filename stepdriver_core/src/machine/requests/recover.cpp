#include "recover.h"

#include <memory>

#include "activity/driver_activities.h"
#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::machine {
namespace {

void refuseWhileEmergencyStopInput(const RequestContext& machine) {
  const std::optional<pulse::Signal>& stop = machine.emergency_stop;
  if (!stop) return;
  const int level = machine.context.levels.level(stop->line);
  const std::string input = "the emergency stop input " + machine.context.lines.input(stop->line);
  if (level < 0) throw Refused(input + " can't be read: " + gpio::errorText(-level));
  if ((level != 0) == stop->active) throw Refused(input + " is active; release it");
}

}  // namespace

std::string Recover::text(const AxisWords& /*axes*/) const { return "recover"; }

void Recover::serve(RequestContext& machine, const SharedCall& call) const {
  refuseWhileEmergencyStopInput(machine);
  activity::Context& context = machine.context;
  if (context.stops_asked != context.stops_handled) {
    throw Refused("an emergency stop has come meanwhile");
  }
  context.stops_cleared = context.stops_handled;
  context.out->clear_stops = context.stops_handled;
  for (const auto& faulty : context.axes) {
    if (!faulty->fault) continue;
    ++faulty->stops;
    machine.activities.begin(std::make_unique<activity::Recover>(context, *faulty, call),
                             {axis::MoveEnd::kFault, faulty->fault.what()});
  }
}

}  // namespace stepdriver::machine
