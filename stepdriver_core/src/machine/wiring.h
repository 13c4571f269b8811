#pragma once

#include <optional>
#include <vector>

#include "stepdriver_core/axis/axis_lines.h"
#include "stepdriver_core/axis/config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/pulse_engine.h"

namespace stepdriver::machine {

/// The lines of all axes, in one request.
struct Wiring {
  explicit Wiring(const std::vector<axis::AxisConfig>& axes,
                  const std::optional<axis::InputSwitch>& emergency = {});

  std::vector<gpio::OutputRequest> outputs;
  std::vector<gpio::InputRequest> inputs;
  std::vector<axis::AxisLines> axis_lines;     // by axis
  std::vector<pulse::ChannelConfig> channels;  // by axis
  std::optional<pulse::Signal> emergency_stop;
};

}  // namespace stepdriver::machine
