#pragma once

#include <string>
#include <variant>

#include "await_rest.h"
#include "begin_latch.h"
#include "bring_up.h"
#include "cancel_homing.h"
#include "close.h"
#include "enable.h"
#include "end_latch.h"
#include "extend_path.h"
#include "follow_setpoints.h"
#include "follow_trajectory.h"
#include "hold.h"
#include "home.h"
#include "jog.h"
#include "jog_together.h"
#include "move_line.h"
#include "move_rounds.h"
#include "move_to.h"
#include "note_position.h"
#include "plan_move.h"
#include "power_down.h"
#include "probe_stroke.h"
#include "recover.h"
#include "reset.h"
#include "restore_position.h"
#include "resume.h"
#include "set_current.h"
#include "set_limits.h"
#include "set_microsteps.h"
#include "set_output.h"
#include "set_position.h"
#include "set_position_compare.h"
#include "set_speed_override.h"
#include "set_stall_threshold.h"
#include "sleep.h"
#include "stop_all.h"
#include "stop_axis.h"
#include "stop_move.h"

namespace stepdriver::machine {

/// What clients and the machine itself ask of the controller. The file of each request has its
/// values, whether it reads inputs, its text, and how it is served.
using Request =
    std::variant<MoveTo, MoveRounds, PlanMove, Jog, JogTogether, FollowSetpoints, MoveLine,
                 FollowTrajectory, ExtendPath, StopAxis, StopMove, StopAll, Hold, Resume,
                 SetSpeedOverride, SetLimits, SetCurrent, SetStallThreshold, Home, CancelHoming,
                 Enable, Sleep, Reset, SetMicrosteps, SetPosition, Recover, SetOutput,
                 SetPositionCompare, BeginLatch, EndLatch, ProbeStroke, BringUp, RestorePosition,
                 NotePosition, Close, AwaitRest, PowerDown>;

/// Whether it may be refused because of the level of a switch: the inputs are read when it is made.
inline bool readsInputs(const Request& request) {
  return std::visit([](const auto& wanted) { return wanted.kReadsInputs; }, request);
}

/// The request in words, as the flight recorder shows it: "x: move to 0.1 m".
inline std::string textOf(const Request& request, const AxisWords& axes) {
  return std::visit([&axes](const auto& wanted) { return wanted.text(axes); }, request);
}

/// Accepts the call, or answers it. @throw Refused, GpioError
inline void serve(const Request& request, RequestContext& machine, const SharedCall& call) {
  std::visit([&](const auto& wanted) { wanted.serve(machine, call); }, request);
}

}  // namespace stepdriver::machine
