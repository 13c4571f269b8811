#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "axis/axis_memory.h"
#include "channel/channel_config.h"
#include "channel/channel_state.h"
#include "profile/shaped_profile.h"
#include "stepdriver_core/axis/axis.h"
#include "stepdriver_core/machine/io.h"
#include "stepdriver_core/pulse/clock.h"
#include "trajectory/ended_path.h"
#include "trajectory/path_axis.h"
#include "trajectory/shared_path.h"

namespace stepdriver::machine {

/// The controller's state of an axis, for readers in any thread. Immutable.
struct AxisSnapshot {
  /// A motion that the engine follows, or will follow.
  struct Motion {
    std::uint64_t serial = 0;
    motion::PlannedMotion planned;
    std::optional<double> target;  ///< [unit]
    bool slows_down = false;
  };

  axis::AxisState state;        ///< without the parts that change with every step
  std::uint64_t holds = 0;      ///< how many of its stops were holds, or the ends of holds
  double steps_per_unit = 1.0;  ///< [microsteps/unit]
  double origin = 0.0;          ///< [unit] position at count 0
  double commanded = 0.0;       ///< [unit] the commanded position, if the axis is at rest
  /// [microsteps] The joint, if it is at rest: after a stop on a path it is between two counts.
  double rest = 0.0;
  std::int64_t backlash = 0;  ///< [microsteps]
  std::size_t motors = 1;
  pulse::MotorCounts square_lags{};  ///< ChannelState::lags when the motors were square
  axis::AxisLimits limits;
  std::optional<double> held_target;  ///< [unit]
  /// The path that it follows with other axes.
  struct Path {
    std::uint64_t move = 0;  ///< the number of this axis's move
    std::shared_ptr<const motion::SharedPath> shared;
    std::shared_ptr<const motion::Profile> along;  ///< the motion along it that was ordered last
    bool slows_down = false;                       ///< that motion slows down
  };
  std::optional<Path> path;
  std::shared_ptr<const motion::EndedPath> ended_path;  ///< the last one; nullptr if there is none
  std::vector<Motion> motions;
  motion::PathAxis path_axis;
  pulse::ChannelState channel;  ///< from the engine's last news
  axis::AxisMemory memory;

  std::uint64_t stopsOtherThanHolds() const { return state.stops - holds; }
};

/// All axes at the end of one turn of the controller.
struct MachineSnapshot {
  std::vector<AxisSnapshot> axes;
  std::uint64_t stops_handled = 0;  ///< emergency stops
  /// Those of them after which each output with a name is in its safe state, or has failed.
  std::uint64_t stops_concluded = 0;
  std::shared_ptr<const IoStates> io;  ///< the same as before if nothing has changed
};

/// The state of an axis at one instant.
///
/// @param live the current state of the engine's channel.
/// @param before, after motion times before and after `live` was read.
axis::AxisState stateOf(const AxisSnapshot& axis, const pulse::ChannelState& live,
                        pulse::Nanoseconds before, pulse::Nanoseconds after);

/// [microsteps/s] The highest planned rate of the current motion; 0 at rest.
double peakRateOf(const AxisSnapshot& axis, const pulse::ChannelState& live);

}  // namespace stepdriver::machine
