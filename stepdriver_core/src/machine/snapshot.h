#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "axis/axis_memory.h"
#include "axis/path_axis.h"
#include "motion/profile.h"
#include "pulse/channel.h"
#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

/// What the controller knows of an axis, for readers in any thread. Never changed once made.
struct AxisSnapshot {
  /// A profile that the engine follows, or is to follow.
  struct Motion {
    std::uint64_t serial = 0;
    std::shared_ptr<const motion::Profile> profile;
    std::optional<double> target;  ///< [unit]
    bool slows_down = false;
  };

  axis::AxisState state;        ///< but for what changes with every step
  double steps_per_unit = 1.0;  ///< [microsteps/unit]
  double origin = 0.0;          ///< [unit] position at count 0
  std::int64_t backlash = 0;    ///< [microsteps]
  axis::AxisLimits limits;
  std::optional<double> held_target;  ///< [unit]
  std::vector<Motion> motions;
  axis::PathAxis path_axis;
  pulse::ChannelState channel;             ///< as the engine has told it last
  std::optional<axis::AxisMemory> memory;  ///< at rest
};

/// All axes at the end of one turn of the controller.
struct MachineSnapshot {
  std::vector<AxisSnapshot> axes;
  std::uint64_t stops_handled = 0;  ///< emergency stops
};

/// An axis as it is at one instant.
///
/// @param live what the engine's channel does now.
/// @param before, after motion times around the moment at which `live` was read.
axis::AxisState stateOf(const AxisSnapshot& axis, const pulse::ChannelState& live,
                        pulse::Nanoseconds before, pulse::Nanoseconds after);

/// [microsteps/s] The highest rate of the motion under way, as planned; 0 at rest.
double peakRateOf(const AxisSnapshot& axis, const pulse::ChannelState& live);

}  // namespace stepdriver::machine
