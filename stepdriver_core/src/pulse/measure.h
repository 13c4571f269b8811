#pragma once

#include <string>
#include <vector>

#include "channel/channel_config.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/capability.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::pulse {

/// @param samples not empty.
Spread spreadOf(std::vector<Nanoseconds> samples);

constexpr int kMeasuredWakeUps = 300;  // a millisecond each
constexpr int kMeasuredSleeps = 100;   // a millisecond each
constexpr int kMeasuredCalls = 200;    // calls of each line; fewer if they take more than 20 ms

/// Measures the same as measureWakeUps(), and the costs of the calls. Nothing moves: STEP lines are
/// written with their current level, and no other line is written.
///
/// @param lines nobody else may use them meanwhile; the STEP lines of the channels are at their
///   inactive level.
/// @throw GpioError if a line can't be written or read.
Capability measureCapability(gpio::Lines& lines, Clock& clock,
                             const std::vector<ChannelConfig>& channels,
                             const RealtimeRequest& request = {});

}  // namespace stepdriver::pulse
