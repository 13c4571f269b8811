#include "extend_path.h"

#include <fmt/format.h>

#include "trajectory/ended_path.h"

namespace stepdriver::machine {

std::string ExtendPath::text(const AxisWords& axes) const {
  return fmt::format("append to the path {} of {}", move, axes.name(axis));
}

void ExtendPath::serve(RequestContext& machine, const SharedCall& call) const {
  axis::AxisModel& extended = machine.axis(axis);
  const activity::Goal* goal = machine.goalOf(extended);
  if (goal == nullptr || goal->move != move) {
    extended.refuse("the path doesn't continue: " +
                    motion::howItEnded(extended.ended_path.get(), move));
  }
  machine.activities.owner(extended)->extend(extension, call);
}

}  // namespace stepdriver::machine
