#include "set_position_compare.h"

#include <fmt/format.h>

#include <algorithm>

#include "config/position_compare.h"
#include "message_text.h"
#include "printable.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {

std::string SetPositionCompare::text(const AxisWords& /*axes*/) const {
  if (!compare) return fmt::format("no position switches {}", printable(output));
  return fmt::format("the position of {} switches {}", printable(compare->axis), printable(output));
}

void SetPositionCompare::serve(RequestContext& machine, const SharedCall& call) const {
  activity::Context& context = machine.context;
  const std::size_t number = machine.named.outputs.numberOf(output);
  if (!compare) return context.motion_outputs.compare(number, {}, 0, call);
  const auto refuse = [this](const std::string& why) {
    throw Refused(fmt::format("the output {} {}", output, why));
  };
  const auto axis = std::find_if(context.axes.begin(), context.axes.end(),
                                 [&](const auto& any) { return any->name() == compare->axis; });
  if (axis == context.axes.end()) {
    refuse(fmt::format("can't be switched by {}: there is no such axis (axes: {})",
                       printable(compare->axis),
                       joinedText(context.axes, [](const auto& any) { return any->name(); })));
  }
  const std::string why =
      config::whyNotCompared(*compare, machine.named.outputs.config(number), (*axis)->config);
  if (!why.empty()) refuse(why);
  if (context.motion_outputs.isTaken(number) &&
      context.motion_outputs.comparedAxis(number).empty()) {
    refuse(fmt::format("is busy: {} switches it", context.motion_outputs.holder(number)));
  }
  if ((*axis)->moving()) {
    (*axis)->refuse("busy: it moves; say at which places it switches " + output + " at rest");
  }
  const auto id = static_cast<std::size_t>(axis - context.axes.begin());
  context.motion_outputs.compare(number, *compare, id, call);
}

}  // namespace stepdriver::machine
