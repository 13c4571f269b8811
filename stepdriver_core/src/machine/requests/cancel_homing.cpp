#include "cancel_homing.h"

#include <fmt/format.h>

namespace stepdriver::machine {

std::string CancelHoming::text(const AxisWords& /*axes*/) const {
  return fmt::format("cancel {} homings", ids.size());
}

void CancelHoming::serve(RequestContext& machine, const SharedCall& /*call*/) const {
  machine.activities.forEach([this](activity::Activity& activity) { activity.cancelHomings(ids); });
}

}  // namespace stepdriver::machine
