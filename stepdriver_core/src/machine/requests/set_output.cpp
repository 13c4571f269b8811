#include "set_output.h"

#include <fmt/format.h>

#include "output_setting.h"
#include "printable.h"
#include "stepdriver_core/error.h"

namespace stepdriver::machine {

std::string SetOutput::text(const AxisWords& /*axes*/) const {
  return fmt::format("switch {} {}", printable(name), switchText(on, value));
}

void SetOutput::serve(RequestContext& machine, const SharedCall& call) const {
  const std::string why = machine.whySafe();
  if (!why.empty()) {
    throw Refused(fmt::format("the output {}: {}{}", printable(name), why,
                              machine.context.mode.closed.empty() ? "; call recover first" : ""));
  }
  machine.refuseWhileEmergencyStopInput();
  machine.named.outputs.set(machine.context, name, on, value, call);
}

}  // namespace stepdriver::machine
