#include "wiring.h"

#include "stepdriver_core/error.h"
#include "stepdriver_core/gpio/chip_table.h"

namespace stepdriver::machine {

Wiring::Wiring(const std::vector<axis::AxisConfig>& axes) {
  for (const axis::AxisConfig& axis : axes) {
    axis_lines.push_back(axis::requestLines(axis, outputs, inputs));
    channels.push_back(axis::channelConfig(axis, axis_lines.back()));
  }
}

Capability measure(gpio::Lines& lines, pulse::Clock& clock, const Wiring& wiring) {
  Capability capability;
  capability.calls = pulse::measureCalls(lines, clock, wiring.channels);
  for (std::size_t i = 0; i < capability.calls.size(); ++i) {
    const int error = capability.calls[i].error;
    if (error == 0) continue;
    const auto step = static_cast<std::size_t>(wiring.axis_lines[i].step);
    throw GpioError("Line " + wiring.outputs[step].line +
                    " or an endstop of the same axis failed while its calls were measured: " +
                    gpio::errorText(error) + ".");
  }
  capability.wake_ups = pulse::measureWakeUps(clock);
  return capability;
}

Capability measure(const std::vector<axis::AxisConfig>& axes, gpio::Backend& backend,
                   pulse::Clock& clock) {
  const Wiring wiring(axes);
  const auto lines = backend.request(wiring.outputs, wiring.inputs);
  return measure(*lines, clock, wiring);
}

}  // namespace stepdriver::machine
