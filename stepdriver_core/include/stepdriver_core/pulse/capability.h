#pragma once

#include <cstddef>
#include <vector>

#include "stepdriver_core/gpio/lines.h"
#include "stepdriver_core/pulse/clock.h"
#include "stepdriver_core/pulse/pulse_engine.h"
#include "stepdriver_core/pulse/realtime.h"

/// What a machine and its wiring are capable of, measured as the pulse thread would find it: in a
/// thread of the same scheduling, with the same waits and the same calls. Nothing moves: an output
/// is only ever written the level that it has.
///
/// The calls take a bounded time, about 0.4 s for the wake-ups and up to 20 ms for each line, and
/// mean something on a clock with realtime() only.
namespace stepdriver::pulse {

/// How measured times are spread. A percentile is one of the times: the smallest that so many of
/// all don't exceed.
struct Spread {
  std::size_t count = 0;
  Nanoseconds p50 = 0;
  Nanoseconds p90 = 0;
  Nanoseconds p99 = 0;
  Nanoseconds max = 0;
};

/// @return all zero where there are no times.
Spread spreadOf(std::vector<Nanoseconds> times);

/// How late the pulse thread wakes.
struct WakeUps {
  Spread spun;            ///< lateness of a wait that ends with spinning
  Spread slept;           ///< lateness of one that may not spin (see Clock::sleepUntil())
  Nanoseconds guard = 0;  ///< Clock::guard()
  RealtimeRights rights;
};

WakeUps measureWakeUps(Clock& clock);

/// What the calls of one channel cost.
struct CallCost {
  Spread write;   ///< of its STEP line
  Spread read;    ///< of the slower one of its endstops; none where count is 0
  int error = 0;  ///< errno of a call that failed; 0: none did
};

/// @param lines as requested, before anything was written.
/// @return the costs by channel.
std::vector<CallCost> measureCalls(gpio::Lines& lines, Clock& clock,
                                   const std::vector<ChannelConfig>& channels);

}  // namespace stepdriver::pulse
