#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "activity/call.h"
#include "activity/context.h"
#include "activity/goal.h"
#include "axis/axis_memory.h"
#include "channel/channel_state.h"
#include "stepdriver_core/axis/axis_state.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/machine/streams.h"
#include "trajectory/prepared_trajectory.h"
#include "trajectory/queued_path.h"

namespace stepdriver::machine {

/// An axis by its number in the configuration.
using AxisId = std::size_t;

/// @name Requests of clients, see the functions of Axis and Machine with these names.
/// @{
struct MoveTo {
  AxisId axis = 0;
  double position = 0.0;
  bool relative = false;
  double velocity = 0.0;
  bool shortest = false;
};
struct MoveRounds {
  AxisId axis = 0;
  double rounds = 0.0;
  double velocity = 0.0;
};
struct PlanMove {
  MoveTo move;
};
struct Jog {
  AxisId axis = 0;
  double velocity = 0.0;
  std::optional<std::uint64_t> unless_stopped_since;
};
/// Jogs that begin at the same motion time; answered with activity::Refusals.
struct JogTogether {
  std::vector<Jog> jogs;
};
struct Setpoint {
  AxisId axis = 0;
  double value = 0.0;  ///< [unit] or [unit/s]
  std::optional<std::uint64_t> unless_stopped_since;
};
/// Setpoints that take effect at the same motion time; answered with activity::Refusals.
struct FollowSetpoints {
  SetpointMode mode = SetpointMode::kPosition;
  double timeout = 0.0;
  std::vector<Setpoint> setpoints;
};
struct MoveLine {
  std::vector<AxisId> axes;
  std::vector<double> positions;
  bool relative = false;
  double velocity = 0.0;
  double duration = 0.0;
};
struct FollowTrajectory {
  std::vector<AxisId> axes;
  /// nullptr if something has ended the preparation: the request is refused for that, or outdated.
  std::shared_ptr<const axis::PreparedTrajectory> prepared;
  /// AxisState::stops of each axis at the time of the request: if one was stopped since, it isn't
  /// begun.
  std::vector<std::uint64_t> stops;
  /// What is known about a path, of which this is the trajectory.
  struct Path {
    std::vector<double> from;     ///< [microsteps] AxisSnapshot::rest of each axis
    std::vector<double> targets;  ///< [microsteps] the commanded positions at its end
    /// If more segments follow.
    std::shared_ptr<const PathWindow> window;
  };
  std::optional<Path> path{};
  std::int64_t begins_ns = 0;  ///< motion time at which it takes over; 0: at once
};
/// Continues the path that axes follow.
struct ExtendPath {
  AxisId axis = 0;         ///< one of them
  std::uint64_t move = 0;  ///< the number of that axis's move
  activity::Extension extension;
};
struct StopAxis {
  AxisId axis = 0;
};
/// Only if the axis still makes this move, or holds it.
struct StopMove {
  AxisId axis = 0;
  std::uint64_t move = 0;
};
struct StopAll {};
struct Hold {};
struct Resume {};
struct SetSpeedOverride {
  double factor = 1.0;
};
struct SetLimits {
  AxisId axis = 0;
  axis::AxisLimits limits;
};
struct Home {
  std::vector<AxisId> axes;
  bool only_check = false;
};
struct CancelHoming {
  std::vector<std::uint64_t> ids;
};
/// Of all or of none, if one of them can't be.
struct Enable {
  std::vector<AxisId> axes;
  bool on = false;
};
struct Sleep {
  AxisId axis = 0;
  bool asleep = false;
};
struct Reset {
  AxisId axis = 0;
};
struct SetMicrosteps {
  AxisId axis = 0;
  int microsteps = 1;
};
struct SetPosition {
  AxisId axis = 0;
  double position = 0.0;
};
struct Recover {};
/// @}

/// @name Requests of the machine itself
/// @{
struct BringUp {};
struct RestorePosition {
  AxisId axis = 0;
  axis::AxisMemory memory;
  bool clean = false;
  std::string source;  ///< names the file, for messages
};
struct NotePosition {
  AxisId axis = 0;
  std::string why;
};
/// Refuses every request from now on, and brings all axes to rest.
struct Close {
  std::string reason;
};
/// Answered when every axis is at rest.
struct AwaitRest {};
/// Disables the axes that are configured so.
struct PowerDown {};
/// @}

using Request = std::variant<MoveTo, MoveRounds, PlanMove, Jog, JogTogether, FollowSetpoints,
                             MoveLine, FollowTrajectory, ExtendPath, StopAxis, StopMove, StopAll,
                             Hold, Resume, SetSpeedOverride, SetLimits, Home, CancelHoming, Enable,
                             Sleep, Reset, SetMicrosteps, SetPosition, Recover, BringUp,
                             RestorePosition, NotePosition, Close, AwaitRest, PowerDown>;

/// @name Inputs of the controller
/// @{
struct Requested {
  activity::CallId call = 0;
  Request request;
};
/// The state of the pulse engine: its emergency stops, and then all its channels.
struct EngineNews {
  std::uint64_t stops_served = 0;
  std::uint64_t stops_ramping = 0;  ///< PulseEngine::stopsRamping()
  std::uint64_t input_stops = 0;
  std::vector<pulse::ChannelState> channels;
};
struct InputRead {
  int input = -1;
  int level = 0;  ///< 0 or 1, or -errno
};
struct InputEdge {
  gpio::EdgeEvent edge;
};
/// The pulse engine waits for a line whose chip doesn't answer. Until it does, nothing moves and
/// nothing that moved has an end.
struct EngineHangs {
  pulse::LineFailure line;
};
/// Time has passed.
struct TimerDue {};
/// @}

struct Input {
  pulse::Nanoseconds now = 0;      ///< clock time
  pulse::Nanoseconds slipped = 0;  ///< motion time is clock time minus this
  std::uint64_t stops_asked = 0;   ///< emergency stops that were requested
  std::variant<Requested, EngineNews, EngineHangs, InputRead, InputEdge, activity::PinDone,
               TimerDue>
      what;
};

}  // namespace stepdriver::machine
