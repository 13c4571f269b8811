#pragma once

#include <cstddef>
#include <memory>
#include <vector>

#include "channel/channel_config.h"
#include "channel/watched_lines.h"
#include "port/step_port.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// The port that writes the lines of these channels now: a GpioPort for drivers with STEP and DIR,
/// a CoilPort for motors whose coils are switched by lines, or both, each for its own channels.
///
/// @param lines, clock outlive it.
std::unique_ptr<StepPort> makeLinePort(WatchedLines& lines, Clock& clock,
                                       const std::vector<ChannelConfig>& channels);

}  // namespace stepdriver::pulse
