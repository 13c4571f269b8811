#include "wiring.h"

#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::machine {

Wiring::Wiring(const std::vector<axis::AxisConfig>& axes) {
  for (const axis::AxisConfig& axis : axes) {
    axis_lines.push_back(axis::requestLines(axis, outputs, inputs));
    channels.push_back(axis::channelConfig(axis, axis_lines.back()));
  }
}

pulse::Capability measure(const std::vector<axis::AxisConfig>& axes, gpio::Backend& backend,
                          pulse::Clock& clock) {
  const Wiring wiring(axes);
  const auto lines = backend.request(wiring.outputs, wiring.inputs);
  return pulse::measureCapability(*lines, clock, wiring.channels);
}

}  // namespace stepdriver::machine
