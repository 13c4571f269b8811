#include "home.h"

#include <algorithm>
#include <cstdint>
#include <memory>
#include <utility>

#include "activity/homing.h"

namespace stepdriver::machine {

std::string Home::text(const AxisWords& words) const {
  return (only_check ? "check the homing of " : "home ") + words.names(axes);
}

void Home::serve(RequestContext& machine, const SharedCall& call) const {
  for (const AxisId id : axes) {
    axis::AxisModel& homed = machine.axis(id);
    activity::Homing::refuseUnlessReady(homed);
    machine.refuseUnlessReadyToMove(homed);
    machine.refuseUnlessFree(homed, "it is homed");
    for (const axis::AxisModel* sharer : homed.switchSharers()) {
      machine.refuseUnlessFree(*sharer,
                               homed.name() + ", which has a switch on the same line, is homed");
    }
  }
  if (only_check) return;
  for (const AxisId id : axes) {
    const axis::AxisModel& homed = machine.axis(id);
    for (const AxisId other : axes) {
      const auto& sharers = homed.sharers();
      if (std::find(sharers.begin(), sharers.end(), &machine.axis(other)) == sharers.end())
        continue;
      homed.refuse("it shares its motors with " + machine.axis(other).name() +
                   ": home them one after the other");
    }
  }
  activity::AcceptedHoming accepted;
  for (const AxisId id : axes) {
    const auto outcome = std::make_shared<activity::Homing::Result>();
    const std::uint64_t number = machine.newHoming();
    accepted.ids.push_back(number);
    accepted.outcomes.push_back(outcome);
    machine.activities.begin(
        activity::Homing::make(machine.context, machine.axis(id), number, outcome), kTakenOver);
  }
  call->succeed(std::move(accepted));
}

}  // namespace stepdriver::machine
