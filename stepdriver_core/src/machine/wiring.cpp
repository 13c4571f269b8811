#include "wiring.h"

#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::machine {

Wiring::Wiring(const std::vector<axis::AxisConfig>& axes,
               const std::optional<axis::InputSwitch>& emergency) {
  for (const axis::AxisConfig& axis : axes) {
    axis_lines.push_back(axis::requestLines(axis, axis_lines, outputs, inputs));
    channels.push_back(axis::channelConfig(axis, axis_lines.back()));
  }
  if (!emergency) return;
  emergency_stop = pulse::Signal{static_cast<int>(inputs.size()), emergency->active_level};
  inputs.push_back({emergency->line, emergency->bias, true});
}

pulse::Capability measure(const std::vector<axis::AxisConfig>& axes, gpio::Backend& backend,
                          pulse::Clock& clock, const std::string& latency_device) {
  const Wiring wiring(axes);
  const auto lines = backend.request(wiring.outputs, wiring.inputs);
  return pulse::measureCapability(*lines, clock, wiring.channels, latency_device);
}

}  // namespace stepdriver::machine
