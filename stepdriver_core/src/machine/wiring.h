#pragma once

#include <memory>
#include <vector>

#include "stepdriver_core/axis/axis_lines.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/capability.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/pulse/pulse_engine.h"

namespace stepdriver::machine {

/// The lines of all axes, in one request.
struct Wiring {
  explicit Wiring(const std::vector<axis::AxisConfig>& axes);

  std::vector<gpio::OutputRequest> outputs;
  std::vector<gpio::InputRequest> inputs;
  std::vector<axis::AxisLines> axis_lines;     // by axis
  std::vector<pulse::ChannelConfig> channels;  // by axis
};

/// Measures on lines that are held and that nothing was written to yet.
///
/// @throw GpioError where a call fails.
Capability measure(gpio::Lines& lines, pulse::Clock& clock, const Wiring& wiring);

}  // namespace stepdriver::machine
