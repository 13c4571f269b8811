#pragma once

#include <memory>
#include <vector>

#include "channel/channel_config.h"
#include "port/step_port.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// A backend whose steps go out by a port of its own, and not by its lines.
class PortBackend : public gpio::Backend {
 public:
  /// @param lines of its last request; outlive the port. Its other lines work from now on.
  /// @param lanes as of PulseEngine::lanesOf().
  /// @throw Error if it can't make steps on these lines, naming the line.
  virtual std::unique_ptr<StepPort> makePort(gpio::Lines& lines, Clock& clock,
                                             const std::vector<ChannelConfig>& lanes) = 0;
  /// Brings back what can't be used any more, see gpio::Lines::failureText(). That text says
  /// afterwards why something couldn't be brought back. Outputs have their safe levels then. It may
  /// take some seconds. For any thread but the pulse thread.
  /// @param lines of its last request.
  virtual void restore(gpio::Lines& lines) = 0;
};

}  // namespace stepdriver::pulse
