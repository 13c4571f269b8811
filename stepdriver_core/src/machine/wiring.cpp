#include "wiring.h"

#include "pulse/measure.h"
#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::machine {

Wiring::Wiring(const std::vector<config::AxisConfig>& axes,
               const std::optional<config::InputSwitch>& emergency) {
  for (const config::AxisConfig& axis : axes) {
    motor_lines.push_back(motor::requestLines(axis, motor_lines, outputs, inputs));
    channels.push_back(motor::channelConfig(axis, motor_lines.back()));
  }
  if (!emergency) return;
  emergency_stop = pulse::Signal{static_cast<int>(inputs.size()), emergency->active_level};
  inputs.push_back({emergency->line, emergency->bias, true});
}

pulse::Capability measure(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                          pulse::Clock& clock, const std::string& latency_device) {
  const Wiring wiring(axes);
  const auto lines = backend.request(wiring.outputs, wiring.inputs);
  return pulse::measureCapability(*lines, clock, wiring.channels, latency_device);
}

}  // namespace stepdriver::machine
