#include "wiring.h"

#include "nanoseconds.h"
#include "pulse/measure.h"
#include "stepdriver_core/machine/step_rates.h"

namespace stepdriver::machine {

Wiring::Wiring(const std::vector<config::AxisConfig>& axes) {
  for (const config::AxisConfig& axis : axes) {
    motor_lines.push_back(motor::requestLines(axis, motor_lines, outputs, inputs));
    channels.push_back(motor::channelConfig(axis, motor_lines.back()));
  }
}

Wiring::Wiring(const std::vector<config::AxisConfig>& axes, const MachineOptions& options)
    : Wiring(axes) {
  if (const auto& button = options.emergency_stop) {
    emergency_stop = pulse::Signal{static_cast<int>(inputs.size()), button->active_level};
    inputs.push_back({button->line, button->bias, true});
  }
  if (options.heartbeat) {
    heartbeat = pulse::HeartbeatLine{static_cast<int>(outputs.size()),
                                     nanoseconds(0.5 / options.heartbeat->rate)};
    outputs.push_back({options.heartbeat->line, false, false});
  }
}

pulse::Capability measure(const std::vector<config::AxisConfig>& axes, gpio::Backend& backend,
                          pulse::Clock& clock, const pulse::RealtimeRequest& request) {
  const Wiring wiring(axes);
  const auto lines = backend.request(wiring.outputs, wiring.inputs);
  return pulse::measureCapability(*lines, clock, wiring.channels, request);
}

}  // namespace stepdriver::machine
