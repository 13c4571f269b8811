#pragma once

#include <cstdint>
#include <variant>
#include <vector>

#include "activity/call.h"
#include "activity/context.h"
#include "channel/channel_state.h"
#include "channel/output_line.h"
#include "requests/request.h"
#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"

namespace stepdriver::machine {

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
  std::vector<pulse::OutputLineState> outputs;  ///< read after the channels
};
struct InputRead {
  int input = -1;
  int level = 0;  ///< 0 or 1, or -errno
};
struct InputEdge {
  gpio::EdgeEvent edge;
};
/// All edges that the lines had reported by a time were handed over.
struct EdgesTaken {
  pulse::Nanoseconds until = 0;  ///< clock time
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
  std::variant<Requested, EngineNews, EngineHangs, InputRead, InputEdge, EdgesTaken,
               activity::PinDone, bus::RegisterDone, TimerDue>
      what;
};

}  // namespace stepdriver::machine
